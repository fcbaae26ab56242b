//! Which column of a file is which quantity, in which unit.

use super::doubts::{self, Doubt};
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
    /// What a name is recognised by, where that is only a part of it (the last piece of a path); else the names.
    pub(crate) labels: &'a [String],
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
    /// Added after the factor, in the unit.
    pub(crate) offset: f64,
    /// Why it is read so, for the preview.
    pub(crate) told: bool,
}

impl Chosen {
    /// A number of the file in the unit of a record.
    pub(crate) fn to_base(&self, value: f64) -> f64 {
        // adding 0 would make 0 of -0, which is another number to whoever compares files
        let scaled = value * self.factor;
        self.unit.to_base(if self.offset == 0.0 {
            scaled
        } else {
            scaled + self.offset
        })
    }
}

impl Offer<'_> {
    pub(super) fn place(&self, index: usize) -> Place {
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

    pub(super) fn all_listed(&self) -> String {
        self.listed(&(0..self.names.len()).collect::<Vec<_>>())
    }

    /// The unit that the file gives for a column, as it is spelled there.
    pub(super) fn unit_in_file(&self, index: usize) -> Option<String> {
        spelling::read(&with_unit(self, index)).unit
    }

    pub(super) fn has_names(&self) -> bool {
        self.names.iter().any(|name| !name.is_empty())
    }
}

/// Chooses the columns; also says which are ignored. Whatever is not clear is asked for at once.
pub(crate) fn choose(offer: &Offer, options: &ImportOptions) -> Result<(Vec<Chosen>, Vec<String>), DataError> {
    let mut notices = Vec::new();
    let mut indices = told(offer, options)?;
    let mut doubts = Vec::new();
    for quantity in Quantity::ALL {
        let taken = |index: &usize| indices.iter().any(|(_, taken)| taken == index);
        if indices.iter().any(|(known, _)| *known == quantity)
            || (quantity == Quantity::Time && options.rate_hz.is_some())
        {
            continue;
        }
        match find(offer, quantity, taken) {
            Ok(Some(index)) => indices.push((quantity, index)),
            Ok(None) if quantity.is_required() && !(quantity == Quantity::Time && offer.has_clock) => {
                doubts.push(Doubt::Missing(quantity));
            }
            Ok(None) => {}
            Err((first, second)) => doubts.push(Doubt::Twice(quantity, first, second)),
        }
    }
    let mut chosen = Vec::new();
    for &(quantity, index) in &indices {
        let choice = options.choice(quantity);
        match unit(offer, quantity, index, choice, &mut notices) {
            Ok(unit) => chosen.push(Chosen {
                index,
                name: offer.names[index].clone(),
                quantity,
                unit,
                factor: choice.map_or(1.0, |choice| choice.factor),
                offset: choice.map_or(0.0, |choice| choice.offset),
                told: choice.is_some(),
            }),
            Err(spelled) if quantity.is_required() || choice.is_some() => {
                doubts.push(Doubt::Unit(quantity, index, spelled));
            }
            Err(spelled) => notices.push(format!(
                "ignored: {}",
                Doubt::Unit(quantity, index, spelled).error(offer, &[index])
            )),
        }
    }
    if !doubts.is_empty() {
        let taken: Vec<usize> = indices.iter().map(|(_, index)| *index).collect();
        return Err(doubts::refuse(offer, doubts, &taken));
    }
    chosen.sort_by_key(|column| column.quantity);
    let ignored = (0..offer.names.len()).filter(|index| !chosen.iter().any(|column| column.index == *index));
    let ignored: Vec<usize> = ignored.collect();
    if !ignored.is_empty() {
        notices.push(format!("{}s ignored: {}", offer.noun, offer.listed(&ignored)));
    }
    Ok((chosen, notices))
}

/// The columns that the user names, each of one quantity.
fn told(offer: &Offer, options: &ImportOptions) -> Result<Vec<(Quantity, usize)>, DataError> {
    let mut indices: Vec<(Quantity, usize)> = Vec::new();
    for choice in options.columns.iter().filter(|choice| choice.source != Source::Find) {
        let index = locate(offer, choice)?;
        if let Some((other, _)) = indices.iter().find(|(_, taken)| *taken == index) {
            return Err(DataError::Choice {
                found: format!("{} {} is both {other} and {}", offer.noun, index + 1, choice.quantity),
                allowed: format!("give each quantity a {} of its own", offer.noun),
            });
        }
        indices.push((choice.quantity, index));
    }
    Ok(indices)
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
                let (here, label) = (&offer.names[*index], &offer.labels[*index]);
                here.eq_ignore_ascii_case(name)
                    || label.eq_ignore_ascii_case(name)
                    || spelling::read(label).base.eq_ignore_ascii_case(name)
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

/// The column whose name is, or else contains, the quantity's; two of them if there are several.
fn find(offer: &Offer, quantity: Quantity, taken: impl Fn(&usize) -> bool) -> Result<Option<usize>, (usize, usize)> {
    for certainty in [Certainty::Is, Certainty::Contains] {
        let named = |index: &usize| {
            !taken(index) && spelling::read(&with_unit(offer, *index)).quantity == Some((quantity, certainty))
        };
        let mut found = (0..offer.names.len()).filter(named);
        match (found.next(), found.next()) {
            (None, _) => {}
            (Some(one), None) => return Ok(Some(one)),
            (Some(first), Some(second)) => return Err((first, second)),
        }
    }
    Ok(None)
}

/// The column of time of a file that is joined with others; none if there is none, or more than one.
pub(super) fn time(offer: &Offer) -> Option<usize> {
    find(offer, Quantity::Time, |_| false).ok().flatten()
}

/// The column of time as it is read.
pub(super) fn chosen_time(offer: &Offer, index: usize, options: &ImportOptions) -> Result<Chosen, DataError> {
    let choice = options.choice(Quantity::Time);
    match unit(offer, Quantity::Time, index, choice, &mut Vec::new()) {
        Ok(unit) => Ok(Chosen {
            index,
            name: offer.names[index].clone(),
            quantity: Quantity::Time,
            unit,
            factor: choice.map_or(1.0, |choice| choice.factor),
            offset: choice.map_or(0.0, |choice| choice.offset),
            told: choice.is_some(),
        }),
        Err(spelled) => Err(Doubt::Unit(Quantity::Time, index, spelled).error(offer, &[index])),
    }
}

/// The name with the unit of the units line, as a person would write it in one.
fn with_unit(offer: &Offer, index: usize) -> String {
    match offer.units.get(index) {
        Some(unit) if !unit.is_empty() => format!("{} [{unit}]", offer.labels[index]),
        _ => offer.labels[index].clone(),
    }
}

/// The unit of a column: told, or in its name, or (time only) seconds; else what stands for it.
fn unit(
    offer: &Offer,
    quantity: Quantity,
    index: usize,
    choice: Option<&ColumnChoice>,
    notices: &mut Vec<String>,
) -> Result<Unit, Option<String>> {
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
        (None, spelled) => Err(spelled),
    }
}
