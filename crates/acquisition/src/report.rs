//! What is found of the rig: typed findings, each with a figure, what it hides and what to do.

use crate::NoiseFloor;
use serde::{Deserialize, Serialize};

/// A column of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Channel {
    /// The voltage at the actuator.
    Voltage,
    /// The measured position.
    Position,
}

/// What is wrong, or other than expected, with a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The position turns before the voltage does.
    PositionLeads,
    /// Like records start at different instants.
    TriggerJitter,
    /// Like records differ by a factor.
    GainByRecord,
    /// Like records differ by an offset, in no order.
    OffsetByRecord,
    /// A record, or all of them, seems to be in another unit.
    OtherUnits,
    /// The position falls where the voltage rises.
    NegativeGain,
    /// The position rises with the voltage in some records and falls in others.
    SignByRecord,
    /// Voltage and position stand in each other's column.
    SwappedColumns,
    /// The voltage is a measurement, not the command.
    MeasuredVoltage,
    /// The drive is computed from the sensor.
    Feedback,
    /// A converter's steps are coarse for what is recorded.
    CoarseCodes,
    /// Codes that the position passes are never read.
    MissingCodes,
    /// Readings stand at the end of the converter's range.
    Clipped,
    /// The position stops short of the voltage's end.
    FlatTop,
    /// Readings stand still while the voltage moves.
    StuckSensor,
    /// Readings are repeated.
    HeldSamples,
    /// A tone that is neither the drive's nor the mains'.
    Tone,
    /// Voltage and position were sampled by clocks that differ.
    DifferentClocks,
    /// No record turns back.
    NeverReverses,
}

impl Kind {
    /// The finding in a few words.
    pub fn title(self) -> &'static str {
        match self {
            Self::PositionLeads => "the position leads the voltage",
            Self::TriggerJitter => "like records start at different instants",
            Self::GainByRecord => "like records differ by a factor",
            Self::OffsetByRecord => "like records differ by an offset, in no order",
            Self::OtherUnits => "units look wrong",
            Self::NegativeGain => "the position falls where the voltage rises",
            Self::SignByRecord => "the position's sign differs between records",
            Self::SwappedColumns => "voltage and position look swapped",
            Self::MeasuredVoltage => "the voltage is a measurement, not the command",
            Self::Feedback => "the drive is computed from the sensor",
            Self::CoarseCodes => "coarse converter steps",
            Self::MissingCodes => "codes that are passed and never read",
            Self::Clipped => "readings clipped at the converter's end",
            Self::FlatTop => "the position stops before the voltage does",
            Self::StuckSensor => "readings stand still while the voltage moves",
            Self::HeldSamples => "repeated readings",
            Self::Tone => "a tone of neither drive nor mains",
            Self::DifferentClocks => "voltage and position run on different clocks",
            Self::NeverReverses => "no record turns back",
        }
    }

    /// Whether a lab has erred, so that every reader of the records should know at once; the rest is as the rig is.
    pub fn is_mistake(self) -> bool {
        match self {
            Self::PositionLeads
            | Self::OtherUnits
            | Self::SignByRecord
            | Self::SwappedColumns
            | Self::MissingCodes
            | Self::Clipped
            | Self::StuckSensor
            | Self::HeldSamples
            | Self::Tone
            | Self::DifferentClocks => true,
            Self::TriggerJitter
            | Self::GainByRecord
            | Self::OffsetByRecord
            | Self::NegativeGain
            | Self::MeasuredVoltage
            | Self::Feedback
            | Self::CoarseCodes
            | Self::FlatTop
            | Self::NeverReverses => false,
        }
    }

    /// What cannot be told, or is told wrongly, because of it.
    pub fn hides(self) -> &'static str {
        match self {
            Self::PositionLeads => "delay, lag and slew limits of the stage, up to the lead and beyond",
            Self::TriggerJitter => "delays below the jitter; it looks like noise that grows with speed",
            Self::GainByRecord => "gain over amplitude, frequency and temperature",
            Self::OffsetByRecord => "drift, creep and the state before each record",
            Self::OtherUnits => "everything with a unit: gains, slew rates, limits",
            Self::NegativeGain => "nothing, where every effect takes a sign; signs of parameters are reversed",
            Self::SignByRecord => "everything: no model fits both",
            Self::SwappedColumns => "everything: loops run backwards",
            Self::MeasuredVoltage => "lag, slew limit and delay of the amplifier, which lie before this voltage",
            Self::Feedback => {
                "noise and effects that the loop has put into the drive; forward models are biased by them"
            }
            Self::CoarseCodes => "whatever is smaller than a third of a step",
            Self::MissingCodes => "the shape between the codes; it looks like jumps",
            Self::Clipped => "the stage beyond the end; the top looks like saturation",
            Self::FlatTop => "the stage beyond the stop; the top looks like saturation or shape",
            Self::StuckSensor => "the stage over that time",
            Self::HeldSamples => "what is faster than the readings; half the hold looks like delay",
            Self::Tone => "effects at its frequency; a ripple above half the sampling rate folds to anywhere",
            Self::DifferentClocks => "delay, lag and creep: the skew grows along each record",
            Self::NeverReverses => "hysteresis, backlash and all that needs a loop",
        }
    }

    /// What to do.
    pub fn advice(self) -> &'static str {
        match self {
            Self::PositionLeads => "record both columns on one instrument, or measure a cable in place of the stage",
            Self::TriggerJitter => "trigger drive and recording from one clock",
            Self::GainByRecord => {
                "set the same range for all records, or give each its factor: --column position=NAME:um*FACTOR"
            }
            Self::OffsetByRecord => "start each record from a rest at 0 V",
            Self::OtherUnits => "give the unit: --column position=NAME:nm",
            Self::NegativeGain => "nothing; or turn the sensor's sign: --column position=NAME:um*-1",
            Self::SignByRecord => "give the records of one sign the factor -1",
            Self::SwappedColumns => "name the columns: --column voltage=... --column position=...",
            Self::MeasuredVoltage => "record the command to see the amplifier as well",
            Self::Feedback => "record with the loop open, or record the reference beside the drive",
            Self::CoarseCodes => "use a smaller range, more bits, or average several captures",
            Self::MissingCodes => "look for a stuck bit of the converter, or an int that was cut",
            Self::Clipped => "use a larger range or a smaller drive",
            Self::FlatTop => "stay below the stop, or leave out what lies beyond",
            Self::StuckSensor => "look at the cable and the target, and leave the stretch out",
            Self::HeldSamples => "record at the sensor's own rate",
            Self::Tone => "record once at another rate: a folded tone moves, a true one stays",
            Self::DifferentClocks => "sample both columns by one clock, or resample the position by the difference",
            Self::NeverReverses => "add a record that goes up and comes back",
        }
    }
}

/// Unit of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// Seconds.
    Second,
    /// Hertz.
    Hertz,
    /// Micrometres.
    Micrometre,
    /// Volts.
    Volt,
    /// Micrometres per volt.
    MicrometrePerVolt,
    /// Percent.
    Percent,
    /// Bits.
    Bit,
    /// A number of codes.
    Code,
    /// A number of samples.
    Sample,
    /// A plain factor.
    Factor,
    /// Parts in a million.
    PartsPerMillion,
}

/// A number with unit and standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// The value.
    pub value: f64,
    /// Its standard error, where there is one.
    pub uncertainty: Option<f64>,
    /// Its unit.
    pub unit: Unit,
    /// What the number is of.
    pub of: Quantity,
}

/// What a figure is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Time by which the position leads.
    Lead,
    /// Largest time between like records.
    Spread,
    /// Largest difference between like records.
    Difference,
    /// Stroke of the records.
    Stroke,
    /// Gain against the other records.
    GainRatio,
    /// Slope of the position over the voltage.
    Slope,
    /// Opening of the loops, negative where they run backwards.
    Opening,
    /// Noise of the column.
    Noise,
    /// Coherence of drive and reading where only noise is.
    Coherence,
    /// Range over step.
    EffectiveBits,
    /// Number of codes.
    Codes,
    /// Share of the samples.
    Share,
    /// Samples a reading.
    Hold,
    /// Frequency as recorded.
    Frequency,
    /// Range of the voltage.
    Range,
    /// Rate of the position's clock over that of the voltage's, less one.
    ClockDifference,
}

impl Quantity {
    fn words(self) -> &'static str {
        match self {
            Self::Lead => "lead",
            Self::Spread => "largest distance",
            Self::Difference => "largest difference",
            Self::Stroke => "stroke",
            Self::GainRatio => "gain over that of the others",
            Self::Slope => "slope",
            Self::Opening => "loop opening",
            Self::Noise => "noise of the column",
            Self::Coherence => "coherence of drive and reading in the noise",
            Self::EffectiveBits => "range over step",
            Self::Codes => "missing codes",
            Self::Share => "share of the samples",
            Self::Hold => "samples a reading",
            Self::Frequency => "frequency as recorded",
            Self::Range => "range of the voltage",
            Self::ClockDifference => "difference of the clocks",
        }
    }
}

impl core::fmt::Display for Figure {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let (scale, unit) = match self.unit {
            Unit::Second => (1e6, " us"),
            Unit::Hertz => (1.0, " Hz"),
            Unit::Micrometre => (1.0, " um"),
            Unit::Volt => (1.0, " V"),
            Unit::MicrometrePerVolt => (1.0, " um/V"),
            Unit::Percent => (1.0, " %"),
            Unit::Bit => (1.0, " bits"),
            Unit::PartsPerMillion => (1.0, " ppm"),
            Unit::Code | Unit::Sample | Unit::Factor => (1.0, ""),
        };
        write!(f, "{} {}", self.of.words(), rounded(scale * self.value))?;
        if let Some(uncertainty) = self.uncertainty {
            write!(f, " +- {}", rounded(scale * uncertainty))?;
        }
        f.write_str(unit)
    }
}

/// Three significant digits, without an exponent where that is readable.
fn rounded(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = 2 - value.abs().log10().floor() as i32;
    match digits {
        0..=8 => format!("{value:.*}", digits as usize),
        -6..0 => format!("{value:.0}"),
        _ => format!("{value:.2e}"),
    }
}

/// One finding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What it is.
    pub kind: Kind,
    /// In which column.
    pub channel: Option<Channel>,
    /// Files of the records that show it.
    pub records: Vec<String>,
    /// How much.
    pub figure: Figure,
}

impl core::fmt::Display for Finding {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.kind.title())?;
        match self.channel {
            Some(Channel::Voltage) => f.write_str(" (voltage)")?,
            Some(Channel::Position) => f.write_str(" (position)")?,
            None => {}
        }
        write!(f, ": {}; {}", self.figure, listed(&self.records))?;
        write!(f, "; hides {}; {}", self.kind.hides(), self.kind.advice())
    }
}

fn listed(records: &[String]) -> String {
    match records {
        [] => "all records".to_owned(),
        [a] => a.clone(),
        [a, b] => format!("{a}, {b}"),
        [a, b, rest @ ..] => format!("{a}, {b} and {} more", rest.len()),
    }
}

/// By how much the position follows the voltage where both turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Following {
    /// Time, seconds; negative where the position leads.
    pub seconds: f64,
    /// Standard error, seconds.
    pub uncertainty_s: f64,
    /// Turning points behind it.
    pub turns: usize,
}

impl core::fmt::Display for Following {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let (us, error) = (1e6 * self.seconds, 1e6 * self.uncertainty_s);
        write!(
            f,
            "the position turns {} +- {} us after the voltage",
            rounded(us),
            rounded(error)
        )?;
        f.write_str(
            " (skew of the channels, delay and lag of the stage together; these records cannot tell them apart)",
        )
    }
}

/// Steps of a column.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Resolution {
    /// Width of a code, in the column's unit (um or V); 0 where no steps show.
    pub step: f64,
    /// Range of the column over the width of a code, as bits; `None` where no steps show.
    pub bits: Option<f64>,
}

/// The rig as its recordings show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Noise of the sensor.
    pub noise: NoiseFloor,
    /// Steps of the voltage, volts.
    pub voltage: Resolution,
    /// Steps of the position, micrometres.
    pub position: Resolution,
    /// How much later the position turns, where the records tell.
    pub following: Option<Following>,
    /// What was found.
    pub findings: Vec<Finding>,
}

impl Report {
    /// The findings of a kind.
    pub fn of(&self, kind: Kind) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(move |finding| finding.kind == kind)
    }

    /// Whether there is a finding of a kind.
    pub fn finds(&self, kind: Kind) -> bool {
        self.of(kind).next().is_some()
    }

    /// The kinds of all findings, in their order.
    pub fn kinds(&self) -> Vec<Kind> {
        self.findings.iter().map(|finding| finding.kind).collect()
    }
}

impl core::fmt::Display for Report {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        writeln!(f, "acquisition: noise {}", self.noise)?;
        if let Some(bits) = self.position.bits {
            writeln!(
                f,
                "  position in steps of {} um, {bits:.1} bits of its range",
                rounded(self.position.step)
            )?;
        }
        if let Some(bits) = self.voltage.bits {
            writeln!(
                f,
                "  voltage in steps of {} V, {bits:.1} bits of its range",
                rounded(self.voltage.step)
            )?;
        }
        if let Some(following) = &self.following {
            writeln!(f, "  {following}")?;
        }
        for finding in &self.findings {
            writeln!(f, "  {finding}")?;
        }
        Ok(())
    }
}
