//! What a board is asked to play, by either command.

use crate::error::CliError;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use hysteron_board::Request;
use hysteron_board::capture::Wish;
use hysteron_board::shapes::{Named, SHAPES};
use hysteron_board::upload::Upload;
use std::path::{Path, PathBuf};

/// Frequency of a reference where none is given, hertz.
const USUAL_HZ: f64 = 100.0;

#[derive(Args, PartialEq, Default)]
pub(crate) struct Wanted {
    /// Which of the image's tables runs, from 0 on; 0 where it is not given
    #[arg(long)]
    pub bank: Option<u8>,
    /// What a period of the reference looks like; a sine where it is not given
    #[arg(long, value_parser = shapes())]
    pub shape: Option<Named>,
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
        let request = Request {
            shape: self.shape.map(|named| named.shape).unwrap_or_default(),
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
            None => {
                let name = self.shape.map_or("sine", |named| named.name);
                format!("{} {hz} Hz", name.replace('-', " "))
            }
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

/// The names of the references on the command line.
fn shapes() -> impl TypedValueParser<Value = Named> {
    let named = SHAPES.map(|shape| PossibleValue::new(shape.name).help(shape.about));
    let unknown = |name: String| format!("there is no reference `{name}`");
    PossibleValuesParser::new(named).try_map(move |name| Named::find(&name).ok_or_else(|| unknown(name)))
}
