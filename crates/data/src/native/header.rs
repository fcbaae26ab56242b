//! The header line of a native CSV: `time_s,voltage_v,position_um`, or `time_s,reference_um`.

use crate::error::DataError;
use crate::place::{Place, shown};
use crate::record::Notice;
use crate::units::{Quantity, Unit};

/// A column that is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Column {
    /// Its place in the line, from 0.
    pub(crate) index: usize,
    pub(crate) quantity: Quantity,
    pub(crate) unit: Unit,
}

/// What the header line says.
#[derive(Debug)]
pub(crate) struct Header {
    /// The columns to read, left to right.
    pub(crate) columns: Vec<Column>,
    /// All names.
    pub(crate) names: Vec<String>,
    /// Units to convert and columns to ignore.
    pub(crate) notices: Vec<Notice>,
}

/// What a native CSV holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Holds {
    /// A run of the stage.
    Record,
    /// A reference to follow.
    Reference,
}

impl Holds {
    fn requires(self, quantity: Quantity) -> bool {
        match self {
            Self::Record => quantity.is_required(),
            Self::Reference => matches!(quantity, Quantity::Time | Quantity::Reference),
        }
    }

    pub(crate) fn layout(self) -> &'static str {
        match self {
            Self::Record => {
                "the native header is `time_s,voltage_v,position_um`, then optionally `reference_um`, `temperature_c`, \
                 `voltage2_v`; for files of other programs use `hysteron import`"
            }
            Self::Reference => "the header of a reference is `time_s,reference_um`; other columns are left out",
        }
    }
}

/// Reads a header line.
pub(crate) fn parse(line: &[u8], line_number: u64, file: &str, holds: Holds) -> Result<Header, DataError> {
    let at = Place::line(file, line_number);
    let Ok(text) = std::str::from_utf8(line) else {
        return Err(DataError::NoHeader {
            at,
            found: format!("found {}, which is not UTF-8", shown(line)),
            allowed: holds.layout().into(),
        });
    };
    let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
    if names.iter().all(|name| name.is_empty() || name.parse::<f64>().is_ok()) {
        return Err(DataError::NoHeader {
            at,
            found: format!("found {} where the column names must be", shown(line)),
            allowed: holds.layout().into(),
        });
    }
    if names.len() == 1 && line.iter().any(|byte| b";\t".contains(byte)) {
        return Err(DataError::NoHeader {
            at,
            found: format!("the columns of {} are not separated by `,`", shown(line)),
            allowed: holds.layout().into(),
        });
    }
    let mut header = Header {
        columns: Vec::new(),
        names,
        notices: Vec::new(),
    };
    let mut strangers = Vec::new();
    for (index, name) in header.names.iter().enumerate() {
        let Some((quantity, unit)) = quantity_and_unit(name) else {
            strangers.push(index);
            continue;
        };
        if let Some(first) = header.columns.iter().find(|column| column.quantity == quantity) {
            return Err(DataError::DuplicateColumn {
                at: Place::cell(file, line_number, index, name),
                quantity: quantity.to_string(),
                first: first.index + 1,
                what_to_do: "keep one of them".into(),
            });
        }
        header.columns.push(Column { index, quantity, unit });
    }
    for quantity in Quantity::ALL.into_iter().filter(|&quantity| holds.requires(quantity)) {
        if !header.columns.iter().any(|column| column.quantity == quantity) {
            return Err(missing(&header, quantity, (file, line_number), line, holds));
        }
    }
    header.notices = notices(&header, &strangers, file);
    Ok(header)
}

fn quantity_and_unit(name: &str) -> Option<(Quantity, Unit)> {
    let (quantity, suffix) = name.rsplit_once('_')?;
    let quantity = Quantity::ALL.into_iter().find(|known| known.name() == quantity)?;
    Some((quantity, quantity.unit(suffix)?))
}

/// The quantity a name begins with, though its unit is missing or unknown.
fn nearly(name: &str) -> Option<Quantity> {
    let quantity = name.split_once('_').map_or(name, |(quantity, _)| quantity);
    Quantity::ALL
        .into_iter()
        .find(|known| known.name().eq_ignore_ascii_case(quantity))
}

/// The error for a required quantity without a column: its unit, where a column has its name, else its absence.
fn missing(header: &Header, quantity: Quantity, (file, line): (&str, u64), text: &[u8], holds: Holds) -> DataError {
    match header.names.iter().position(|name| nearly(name) == Some(quantity)) {
        Some(index) => DataError::Unit {
            at: Place::cell(file, line, index, &header.names[index]),
            found: format!("no known unit of {quantity} at the end of the name"),
            known: format!("{} (in lower case)", quantity.known_suffixes()),
        },
        None => DataError::MissingColumn {
            at: Place::line(file, line),
            quantity: quantity.to_string(),
            found: shown(text),
            allowed: holds.layout().into(),
        },
    }
}

fn notices(header: &Header, strangers: &[usize], file: &str) -> Vec<Notice> {
    let converted = header
        .columns
        .iter()
        .filter(|column| !column.unit.is_base())
        .map(|column| {
            let base = column.quantity.base_unit();
            format!(
                "column {} ({}): converted from {} to {}",
                column.index + 1,
                header.names[column.index],
                column.unit.symbol,
                base.symbol
            )
        });
    let ignored = strangers.iter().map(|&index| {
        let name = &header.names[index];
        let why = match nearly(name) {
            Some(quantity) => format!("its name begins as {}", quantity.known_suffixes()),
            None => "not a quantity of a record".to_owned(),
        };
        format!(
            "column {} ({}): ignored; {why}",
            index + 1,
            shown(name.as_bytes()).trim_matches('`')
        )
    });
    converted
        .chain(ignored)
        .map(|text| Notice {
            file: file.to_owned(),
            text,
        })
        .collect()
}
