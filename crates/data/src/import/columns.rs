//! Which column of a file is which quantity, in which unit.

use super::options::{ColumnChoice, ImportOptions, Source};
use super::spelling::{self, Certainty};
use crate::error::DataError;
use crate::place::{Place, shown};
use crate::units::{Quantity, Unit};

/// What there is to choose from: the columns of a table or the variables of a `.mat` file.
pub(crate) struct Offer<'a> {
    /// `column` or `variable`
    pub(crate) noun: &'static str,
    /// Names; empty for columns without.
    pub(crate) names: &'a [String],
    /// Units from a line of their own (empty where there is none).
    pub(crate) units: &'a [String],
    /// The file, and the line of the names.
    pub(crate) at: Place,
    /// Whether the sample clock is known without a column of time.
    pub(crate) has_clock: bool,
}

/// A column that is read.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chosen {
    pub(crate) index: usize,
    pub(crate) name: String,
    pub(crate) quantity: Quantity,
    pub(crate) unit: Unit,
    pub(crate) factor: f64,
    /// Why it is read so, for the preview.
    pub(crate) told: bool,
}

impl Offer<'_> {
    fn place(&self, index: usize) -> Place {
        let name = self.names.get(index).map_or("", String::as_str);
        if self.noun != "column" {
            return Place::file(&format!("{}, {} {} ({name})", self.at.file, self.noun, index + 1));
        }
        Place {
            column: Some(Box::new((index + 1, name.to_owned()))),
            ..self.at.clone()
        }
    }

    /// Some of the names with their numbers.
    fn listed(&self, indices: &[usize]) -> String {
        const MOST: usize = 12;
        let named = |index: &usize| match self.names[*index].as_str() {
            "" => format!("{}", index + 1),
            name => format!("{} {}", index + 1, shown(name.as_bytes())),
        };
        let mut listed: Vec<String> = indices.iter().take(MOST).map(named).collect();
        if indices.len() > MOST {
            listed.push(format!("and {} more", indices.len() - MOST));
        }
        listed.join(", ")
    }

    fn all_listed(&self) -> String {
        self.listed(&(0..self.names.len()).collect::<Vec<_>>())
    }

    fn has_names(&self) -> bool {
        self.names.iter().any(|name| !name.is_empty())
    }
}

/// Chooses the columns; also says which are ignored.
pub(crate) fn choose(offer: &Offer, options: &ImportOptions) -> Result<(Vec<Chosen>, Vec<String>), DataError> {
    let mut notices = Vec::new();
    let mut indices: Vec<(Quantity, usize)> = Vec::new();
    for choice in &options.columns {
        if choice.source == Source::Find {
            continue;
        }
        let index = locate(offer, choice)?;
        if let Some((other, _)) = indices.iter().find(|(_, taken)| *taken == index) {
            return Err(DataError::Choice {
                found: format!("{} {} is both {other} and {}", offer.noun, index + 1, choice.quantity),
                allowed: format!("give each quantity a {} of its own", offer.noun),
            });
        }
        indices.push((choice.quantity, index));
    }
    for quantity in Quantity::ALL {
        let taken = |index: &usize| indices.iter().any(|(_, taken)| taken == index);
        if indices.iter().any(|(known, _)| *known == quantity)
            || (quantity == Quantity::Time && options.rate_hz.is_some())
        {
            continue;
        }
        match find(offer, quantity, taken)? {
            Some(index) => indices.push((quantity, index)),
            None if quantity.is_required() && !(quantity == Quantity::Time && offer.has_clock) => {
                return Err(missing(offer, quantity));
            }
            None => {}
        }
    }
    let mut chosen = Vec::new();
    for (quantity, index) in indices {
        let choice = options.choice(quantity);
        match unit(offer, quantity, index, choice, &mut notices) {
            Ok(unit) => chosen.push(Chosen {
                index,
                name: offer.names[index].clone(),
                quantity,
                unit,
                factor: choice.map_or(1.0, |choice| choice.factor),
                told: choice.is_some(),
            }),
            Err(error) if quantity.is_required() || choice.is_some() => return Err(error),
            Err(error) => notices.push(format!("ignored: {error}")),
        }
    }
    chosen.sort_by_key(|column| column.quantity);
    let ignored = (0..offer.names.len()).filter(|index| !chosen.iter().any(|column| column.index == *index));
    let ignored: Vec<usize> = ignored.collect();
    if !ignored.is_empty() {
        notices.push(format!("{}s ignored: {}", offer.noun, offer.listed(&ignored)));
    }
    Ok((chosen, notices))
}

/// The column the user names.
fn locate(offer: &Offer, choice: &ColumnChoice) -> Result<usize, DataError> {
    let refuse = |found: String| {
        let allowed = format!("{}s are {}", offer.noun, offer.all_listed());
        Err(DataError::Choice { found, allowed })
    };
    match &choice.source {
        Source::Find => refuse(String::new()),
        Source::Number(number) if (1..=offer.names.len()).contains(number) => Ok(number - 1),
        Source::Number(number) => refuse(format!(
            "{} = {} {number}, of {}",
            choice.quantity,
            offer.noun,
            offer.names.len()
        )),
        Source::Name(name) => {
            let equal: Vec<usize> = (0..offer.names.len())
                .filter(|&index| offer.names[index] == *name)
                .collect();
            let alike = |index: &usize| {
                let here = &offer.names[*index];
                here.eq_ignore_ascii_case(name) || spelling::read(here).base.eq_ignore_ascii_case(name)
            };
            let alike: Vec<usize> = (0..offer.names.len()).filter(alike).collect();
            match (equal.as_slice(), alike.as_slice()) {
                ([one], _) | ([], [one]) => Ok(*one),
                ([], []) => refuse(format!(
                    "{} = `{name}`: there is no such {}",
                    choice.quantity, offer.noun
                )),
                _ => refuse(format!(
                    "{} = `{name}`: several {}s have this name, give its number",
                    choice.quantity, offer.noun
                )),
            }
        }
    }
}

/// The column whose name is, or else contains, the quantity's.
fn find(offer: &Offer, quantity: Quantity, taken: impl Fn(&usize) -> bool) -> Result<Option<usize>, DataError> {
    for certainty in [Certainty::Is, Certainty::Contains] {
        let named = |index: &usize| {
            !taken(index) && spelling::read(&with_unit(offer, *index)).quantity == Some((quantity, certainty))
        };
        let found: Vec<usize> = (0..offer.names.len()).filter(named).collect();
        match found.as_slice() {
            [] => {}
            [one] => return Ok(Some(*one)),
            [first, second, ..] => {
                return Err(DataError::DuplicateColumn {
                    at: offer.place(*second),
                    quantity: quantity.to_string(),
                    first: first + 1,
                    what_to_do: format!(
                        "say which it is, as in `--column {quantity}={}:{}`",
                        first + 1,
                        quantity.base_unit().symbol
                    ),
                });
            }
        }
    }
    Ok(None)
}

/// The name with the unit of the units line, as a person would write it in one.
fn with_unit(offer: &Offer, index: usize) -> String {
    match offer.units.get(index) {
        Some(unit) if !unit.is_empty() => format!("{} [{unit}]", offer.names[index]),
        _ => offer.names[index].clone(),
    }
}

fn missing(offer: &Offer, quantity: Quantity) -> DataError {
    let symbol = quantity.base_unit().symbol;
    let rate = if quantity == Quantity::Time {
        ", or the sample rate with `--rate HZ`"
    } else {
        ""
    };
    if !offer.has_names() {
        return DataError::NoHeader {
            at: offer.at.clone(),
            found: format!("the {} columns have no names", offer.names.len()),
            allowed: format!("say which is {quantity}, as in `--column {quantity}=1:{symbol}`{rate}"),
        };
    }
    DataError::MissingColumn {
        at: offer.at.clone(),
        quantity: quantity.to_string(),
        found: format!("the {}s {}", offer.noun, offer.all_listed()),
        allowed: format!("say which it is, as in `--column {quantity}=1:{symbol}`{rate}"),
    }
}

/// The unit of a column: told, or in its name, or (time only) seconds.
fn unit(
    offer: &Offer,
    quantity: Quantity,
    index: usize,
    choice: Option<&ColumnChoice>,
    notices: &mut Vec<String>,
) -> Result<Unit, DataError> {
    let spelled = spelling::read(&with_unit(offer, index)).unit;
    let named = spelled.as_deref().and_then(|spelled| spelling::unit(quantity, spelled));
    if let Some(told) = choice.and_then(|choice| choice.unit) {
        if let Some(spelled) = spelled.filter(|_| named != Some(told)) {
            notices.push(format!(
                "{} {} `{}`: the file says `{spelled}`, read as {} because told so",
                offer.noun,
                index + 1,
                offer.names[index],
                told.symbol
            ));
        }
        return Ok(told);
    }
    match (named, spelled) {
        (Some(unit), _) => Ok(unit),
        (None, None) if quantity == Quantity::Time => {
            notices.push(format!(
                "{} {} `{}`: no unit given, taken as s",
                offer.noun,
                index + 1,
                offer.names[index]
            ));
            Ok(quantity.base_unit())
        }
        (None, spelled) => Err(DataError::Unit {
            at: offer.place(index),
            found: match spelled {
                Some(spelled) => format!("`{spelled}` is no unit of {quantity}"),
                None => format!("no unit given for {quantity}"),
            },
            known: format!(
                "{}; say which it is, as in `--column {quantity}={}:{}` (with a factor: `{}*20`)",
                spelling::known_units(quantity),
                index + 1,
                quantity.base_unit().symbol,
                quantity.base_unit().symbol
            ),
        }),
    }
}
