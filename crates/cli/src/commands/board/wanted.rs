//! What a board is asked to play, by either command.

use crate::error::CliError;
use clap::{Args, ValueEnum};
use hysteron_board::capture::Wish;
use hysteron_board::upload::Upload;
use hysteron_board::{Request, Shape};
use std::path::{Path, PathBuf};

/// Frequency of a reference where none is given, hertz.
const USUAL_HZ: f64 = 100.0;

#[derive(Args, PartialEq, Default)]
pub(crate) struct Wanted {
    /// Which of the image's tables runs, from 0 on; 0 where it is not given
    #[arg(long)]
    pub bank: Option<u8>,
    /// What a period of the reference looks like; a sine where it is not given
    #[arg(long, value_enum)]
    pub shape: Option<ShapeName>,
    /// A reference of one's own instead: one period in a file of 256 positions, micrometres, one a line
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["shape", "low", "high"])]
    pub trajectory: Option<PathBuf>,
    /// Frequency of the reference, hertz; 100 where it is not given
    #[arg(long)]
    pub hz: Option<f64>,
    /// Lowest reference, micrometres; by default the table's lowest and 2 % of its range
    #[arg(long, requires = "high", allow_negative_numbers = true)]
    pub low: Option<f64>,
    /// Highest reference, micrometres; by default the table's highest less 2 % of its range
    #[arg(long, requires = "low", allow_negative_numbers = true)]
    pub high: Option<f64>,
    /// Open loop: the inverse alone
    #[arg(long)]
    pub no_feedback: bool,
    /// Feedback alone
    #[arg(long)]
    pub no_feedforward: bool,
}

impl Wanted {
    /// Whether nothing was asked for.
    pub(crate) fn is_nothing(&self) -> bool {
        *self == Self::default()
    }

    /// What the board is asked for, its trajectory's file read.
    pub(crate) fn wish(&self, seconds: f64) -> Result<Wish, CliError> {
        let upload = self.trajectory.as_deref().map(upload).transpose()?;
        let given_um = self.low.zip(self.high).map(|(low, high)| [low, high]);
        let shape = self.shape.unwrap_or(ShapeName::Sine);
        let request = Request {
            shape: shape.shape(),
            frequency_hz: self.hz.unwrap_or(USUAL_HZ),
            range_um: given_um,
            seconds,
            feedforward: !self.no_feedforward,
            feedback: !self.no_feedback,
        };
        Ok(Wish::new(self.bank.unwrap_or(0), request, upload))
    }

    /// The reference in words.
    pub(crate) fn words(&self) -> String {
        let hz = self.hz.unwrap_or(USUAL_HZ);
        match &self.trajectory {
            Some(path) => format!("{} {hz} Hz", path.display()),
            None => format!("{} {hz} Hz", self.shape.unwrap_or(ShapeName::Sine).words()),
        }
    }
}

fn upload(path: &Path) -> Result<Upload, CliError> {
    let text = std::fs::read_to_string(path).map_err(|source| CliError::Read {
        path: path.to_owned(),
        source,
    })?;
    Upload::parse(&text).map_err(|source| CliError::Option(format!("{}: {source}", path.display())))
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ShapeName {
    /// From the lowest point on
    Sine,
    /// The paper's sum of a sine and its third harmonic
    ComplexHarmonic,
    /// Straight lines
    Triangle,
    /// A staircase of quarters
    Steps,
    /// Twenty turns outwards and as many back, the cosine
    Spiral,
    /// The same with the sine, for the other axis
    SpiralSine,
}

impl ShapeName {
    fn shape(self) -> Shape {
        match self {
            Self::Sine => Shape::Sine,
            Self::ComplexHarmonic => Shape::ComplexHarmonic,
            Self::Triangle => Shape::Triangle,
            Self::Steps => Shape::Steps,
            Self::Spiral => Shape::Spiral,
            Self::SpiralSine => Shape::SpiralSine,
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Sine => "sine",
            Self::ComplexHarmonic => "complex harmonic",
            Self::Triangle => "triangle",
            Self::Steps => "steps",
            Self::Spiral => "spiral",
            Self::SpiralSine => "spiral's sine",
        }
    }
}
