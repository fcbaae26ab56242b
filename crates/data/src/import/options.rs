//! What the user says about a file, where it does not say it itself.

use std::str::FromStr;

use super::spelling;
use crate::error::DataError;
use crate::record::Role;
use crate::units::{Quantity, Unit};

/// How a file is to be imported. The default finds everything out and refuses what is not clear.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportOptions {
    /// Role of the records.
    pub role: Role,
    /// Columns (of a table) or variables (of a `.mat` file) by quantity; quantities not named are looked for.
    pub columns: Vec<ColumnChoice>,
    /// Sample rate, hertz: for files without time, and instead of the time in the file.
    pub rate_hz: Option<f64>,
    /// Separator of a text file; found out if not given.
    pub separator: Option<Separator>,
    /// Decimal sign of a text file; found out if not given.
    pub decimal: Option<Decimal>,
    /// Line of the column names of a text file, from 1; 0 says that there is none; found out if not given.
    pub header_line: Option<u64>,
    /// What to do with cells that are empty or no number.
    pub missing: Missing,
    /// What to do where time jumps.
    pub gaps: Gaps,
    /// What to do with time stamps that jitter.
    pub jitter: Jitter,
}

impl Default for ImportOptions {
    fn default() -> ImportOptions {
        ImportOptions {
            role: Role::Identify,
            columns: Vec::new(),
            rate_hz: None,
            separator: None,
            decimal: None,
            header_line: None,
            missing: Missing::default(),
            gaps: Gaps::default(),
            jitter: Jitter::default(),
        }
    }
}

/// Where the columns of a text file end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Separator {
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// Tab.
    Tab,
    /// One or more spaces or tabs.
    Blank,
}

impl Separator {
    /// How it is named to people.
    pub fn name(self) -> &'static str {
        match self {
            Separator::Comma => "`,`",
            Separator::Semicolon => "`;`",
            Separator::Tab => "tab",
            Separator::Blank => "blanks",
        }
    }
}

/// The decimal sign of a text file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decimal {
    /// `1.5`
    Point,
    /// `1,5`
    Comma,
}

/// What to do with cells that are empty or no number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Missing {
    /// An error that names the first.
    #[default]
    Refuse,
    /// Leave out lines at the beginning and the end; an error for one in between.
    Trim,
    /// Leave out lines at the beginning and the end, and close single gaps in between by the mean of the neighbours;
    /// an error for longer ones.
    Interpolate,
}

/// What to do where time jumps forth or back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Gaps {
    /// An error that names the first.
    #[default]
    Refuse,
    /// A new record begins.
    Split,
}

/// What to do with time stamps that jitter by more than a tenth of a sample period. Below that the samples are
/// always put on the uniform clock that fits the stamps best, with a notice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Jitter {
    /// An error that says how large the jitter is.
    #[default]
    Refuse,
    /// The samples were taken uniformly, the stamps are late: the samples are put on the clock that fits best.
    Clock,
    /// The samples were taken when the stamps say: they are interpolated linearly to a uniform clock.
    Interpolate,
}

/// Where a quantity is in the file, `QUANTITY=COLUMN:UNIT*FACTOR+OFFSET`; COLUMN, `:UNIT`, `*FACTOR` and `+OFFSET` may
/// each be left out. A number `x` of the file is `x * FACTOR + OFFSET` in the unit.
///
/// # Example
/// ```
/// use hysteron_data::import::{ColumnChoice, Source};
/// use hysteron_data::units::Quantity;
///
/// let drive: ColumnChoice = "voltage=CH1:mV*20".parse()?; // a monitor output of 1/20, in millivolts
/// assert_eq!((drive.quantity, drive.factor), (Quantity::Voltage, 20.0));
/// assert_eq!(drive.source, Source::Name("CH1".into()));
/// let sensor: ColumnChoice = "position=CH2:um*5-50".parse()?; // a sensor of 0.2 V/um whose 10 V are the middle
/// assert_eq!((sensor.factor, sensor.offset), (5.0, -50.0));
/// let third: ColumnChoice = "position=3:um".parse()?;
/// assert_eq!(third.source, Source::Number(3));
/// let error = "position=3:inch".parse::<ColumnChoice>().unwrap_err().to_string();
/// assert_eq!(error, "`position=3:inch`: `inch` is no unit of position; known are µm, nm, pm, mm, m");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnChoice {
    /// The quantity.
    pub quantity: Quantity,
    /// The column or variable.
    pub source: Source,
    /// Its unit, instead of the one the file gives.
    pub unit: Option<Unit>,
    /// What its numbers are multiplied by before the unit holds (the gain of an amplifier).
    pub factor: f64,
    /// What is added after that, in the unit (the offset of a sensor).
    pub offset: f64,
}

/// The column or variable of a quantity.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// To be found by its name.
    Find,
    /// By its name in the file; if no name is equal, by the name without its unit.
    Name(String),
    /// By its number, the first is 1.
    Number(usize),
}

impl FromStr for ColumnChoice {
    type Err = DataError;

    fn from_str(text: &str) -> Result<ColumnChoice, DataError> {
        let refuse = |found: String, allowed: String| {
            Err(DataError::Choice {
                found: format!("`{text}`{found}"),
                allowed,
            })
        };
        let quantities = || Quantity::ALL.map(Quantity::name).join(", ");
        let form =
            || "give QUANTITY=COLUMN:UNIT*FACTOR+OFFSET, as in `voltage=CH1:mV*20` or `position=3:um`".to_owned();
        let Some((name, rest)) = text.split_once('=') else {
            return refuse(" has no `=`".into(), form());
        };
        let Some(quantity) = Quantity::ALL
            .into_iter()
            .find(|quantity| quantity.name() == name.trim())
        else {
            return refuse(
                format!(": `{}` is no quantity of a record", name.trim()),
                format!("known are {}", quantities()),
            );
        };
        let (rest, factor, offset) = match scale(rest) {
            Ok(scale) => scale,
            Err((found, allowed)) => return refuse(format!(": `{found}` is no {allowed}"), numbers(allowed)),
        };
        let (column, symbol) = rest
            .rsplit_once(':')
            .map_or((rest, None), |(column, symbol)| (column, Some(symbol)));
        let unit = symbol.and_then(|symbol| spelling::unit(quantity, symbol));
        if let (Some(symbol), None) = (symbol, unit) {
            let found = format!(": `{}` is no unit of {quantity}", symbol.trim());
            return refuse(found, format!("known are {}", spelling::known_units(quantity)));
        }
        let source = match (column.trim(), column.trim().parse::<usize>()) {
            ("", _) => Source::Find,
            (_, Ok(0)) => return refuse(": there is no column 0".into(), "columns count from 1".into()),
            (_, Ok(number)) => Source::Number(number),
            (name, Err(_)) => Source::Name(name.to_owned()),
        };
        if source == Source::Find && unit.is_none() && factor == 1.0 && offset == 0.0 {
            return refuse(" says nothing".into(), form());
        }
        Ok(ColumnChoice {
            quantity,
            source,
            unit,
            factor,
            offset,
        })
    }
}

/// Takes `*FACTOR+OFFSET`, or `+OFFSET` after a unit, off the end; else the piece that is no number, and what it should be.
fn scale(text: &str) -> Result<(&str, f64, f64), (&str, &'static str)> {
    let (column, scaled) = match text.rsplit_once('*') {
        Some((column, scaled)) => (column, Some(scaled)),
        None => (text, None),
    };
    // an offset needs something before it that says that it is one: a name may have a `-`
    let from = match scaled {
        Some(_) => column.len() + 1,
        None => match text.rfind(':') {
            Some(colon) => colon + 1,
            None => return Ok((text, 1.0, 0.0)),
        },
    };
    let tail = &text[from..];
    let is_sign = |(at, sign): (usize, char)| {
        let exponent =
            tail[..at].ends_with(['e', 'E']) && tail[..at - 1].ends_with(|c: char| c.is_ascii_digit() || c == '.');
        (matches!(sign, '+' | '-') && at > 0 && !exponent).then_some(at)
    };
    let at = tail.char_indices().filter_map(is_sign).next();
    let (before, offset) = at.map_or((tail, None), |at| (&tail[..at], Some(&tail[at..])));
    let finite = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let offset = match offset {
        Some(text) => finite(text).ok_or((text, "offset"))?,
        None => 0.0,
    };
    match scaled {
        Some(_) => {
            let factor = finite(before)
                .filter(|factor| *factor != 0.0)
                .ok_or((before, "factor"))?;
            Ok((column, factor, offset))
        }
        None => Ok((&text[..from + before.len()], 1.0, offset)),
    }
}

fn numbers(what: &str) -> String {
    match what {
        "factor" => "a factor is a finite number, not 0".into(),
        _ => "an offset is a finite number in the unit before it, as in `um*5-50`".into(),
    }
}

impl ImportOptions {
    /// The choice for a quantity, if there is one.
    pub(crate) fn choice(&self, quantity: Quantity) -> Option<&ColumnChoice> {
        self.columns.iter().find(|choice| choice.quantity == quantity)
    }

    /// Refuses choices that contradict each other.
    pub(crate) fn validate(&self) -> Result<(), DataError> {
        for (index, choice) in self.columns.iter().enumerate() {
            if self.columns[..index]
                .iter()
                .any(|other| other.quantity == choice.quantity)
            {
                let found = format!("{} is given two columns", choice.quantity);
                return Err(DataError::Choice {
                    found,
                    allowed: "give each quantity one".into(),
                });
            }
        }
        match self.rate_hz {
            Some(rate) if self.choice(Quantity::Time).is_some() => Err(DataError::Choice {
                found: format!("a sample rate of {rate} Hz and a column of time"),
                allowed: "give one of them: the rate is used instead of the time in the file".into(),
            }),
            Some(rate) if !(rate.is_finite() && rate > 0.0 && (1.0 / rate).is_finite()) => Err(DataError::Choice {
                found: format!("a sample rate of {rate} Hz"),
                allowed: "the rate is positive and finite".into(),
            }),
            _ => Ok(()),
        }
    }
}
