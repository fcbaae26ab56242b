//! What a file leaves unclear about its columns, asked for in one message with the options that settle it.

use super::columns::Offer;
use super::spelling;
use crate::error::DataError;
use crate::place::shown;
use crate::units::{Quantity, Unit};

/// One thing that is not clear.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Doubt {
    /// No column is the quantity.
    Missing(Quantity),
    /// Two columns are: the first two of them.
    Twice(Quantity, usize, usize),
    /// The column's unit is not known; what stands for it.
    Unit(Quantity, usize, Option<String>),
}

impl Doubt {
    fn quantity(&self) -> Quantity {
        match self {
            Doubt::Missing(quantity) | Doubt::Twice(quantity, ..) | Doubt::Unit(quantity, ..) => *quantity,
        }
    }

    /// The option that would settle it, with a column that is free for it.
    fn option(&self, offer: &Offer, taken: &mut Vec<usize>) -> String {
        let quantity = self.quantity();
        let index = match self {
            Doubt::Missing(_) => likely(offer, quantity, taken),
            Doubt::Twice(_, first, _) => Some(*first),
            Doubt::Unit(_, index, _) => Some(*index),
        };
        let Some(index) = index else {
            // nothing is left that it could be
            return format!("--column {quantity}=NAME:{}", typed(quantity.base_unit()));
        };
        taken.push(index);
        format!("--column {quantity}={}:{}", index + 1, suffix(offer, quantity, index))
    }

    /// It alone, as an error.
    pub(crate) fn error(self, offer: &Offer, taken: &[usize]) -> DataError {
        let option = self.option(offer, &mut taken.to_vec());
        match self {
            Doubt::Missing(quantity) if !offer.has_names() => DataError::NoHeader {
                at: offer.at.clone(),
                found: format!("the {} {}s have no names", offer.names.len(), offer.noun),
                allowed: format!("say which is {quantity}, as in `{option}`{}", rate(quantity)),
            },
            Doubt::Missing(quantity) => DataError::MissingColumn {
                at: offer.at.clone(),
                quantity: quantity.to_string(),
                found: format!("the {}s {}", offer.noun, offer.all_listed()),
                allowed: format!("say which it is, as in `{option}`{}", rate(quantity)),
            },
            Doubt::Twice(quantity, first, second) => DataError::DuplicateColumn {
                at: offer.place(second),
                quantity: quantity.to_string(),
                first: first + 1,
                what_to_do: format!("say which it is, as in `{option}`"),
            },
            Doubt::Unit(quantity, index, spelled) => DataError::Unit {
                at: offer.place(index),
                found: no_unit(quantity, spelled.as_deref()),
                known: format!(
                    "{}; say which it is, as in `{option}` (with a gain: `{}*20`)",
                    spelling::known_units(quantity),
                    suffix(offer, quantity, index)
                ),
            },
        }
    }

    /// It among others, in a few words.
    fn words(&self, offer: &Offer) -> String {
        let column = |index: usize| {
            let name = shown(offer.names[index].as_bytes());
            format!("{} {} {name}", offer.noun, index + 1)
        };
        match self {
            Doubt::Missing(quantity) => format!("no {quantity}"),
            Doubt::Twice(quantity, first, second) => {
                format!("{quantity} may be {} or {}", column(*first), column(*second))
            }
            Doubt::Unit(quantity, index, spelled) => {
                format!("{} ({})", no_unit(*quantity, spelled.as_deref()), column(*index))
            }
        }
    }
}

/// The error for all that is not clear.
pub(crate) fn refuse(offer: &Offer, mut doubts: Vec<Doubt>, taken: &[usize]) -> DataError {
    if doubts.len() == 1 {
        return doubts.remove(0).error(offer, taken);
    }
    doubts.sort_by_key(Doubt::quantity);
    let mut taken = taken.to_vec();
    // columns whose units are asked for are theirs; what is missing gets others
    let (missing, here): (Vec<&Doubt>, Vec<&Doubt>) =
        doubts.iter().partition(|doubt| matches!(doubt, Doubt::Missing(_)));
    // Too few columns for all: the time is none of them.
    let timeless = doubts.contains(&Doubt::Missing(Quantity::Time)) && offer.names.len() < taken.len() + doubts.len();
    let mut options: Vec<(Quantity, String)> = here
        .into_iter()
        .chain(missing)
        .filter(|doubt| !(timeless && **doubt == Doubt::Missing(Quantity::Time)))
        .map(|doubt| (doubt.quantity(), doubt.option(offer, &mut taken)))
        .collect();
    options.sort_by_key(|(quantity, _)| *quantity);
    let mut options: Vec<String> = options.into_iter().map(|(_, option)| option).collect();
    if timeless {
        options.insert(0, "--rate HZ".to_owned());
    }
    let time = doubts.contains(&Doubt::Missing(Quantity::Time));
    let words: Vec<String> = doubts.iter().map(|doubt| doubt.words(offer)).collect();
    DataError::Unclear {
        at: offer.at.clone(),
        found: words.join(", "),
        columns: if offer.has_names() {
            format!("the {}s are {}", offer.noun, offer.all_listed())
        } else {
            format!("the {} {}s have no names", offer.names.len(), offer.noun)
        },
        what_to_do: format!(
            "say which they are, as in `{}`{}",
            options.join(" "),
            rate(if time && !timeless {
                Quantity::Time
            } else {
                Quantity::Voltage
            })
        ),
    }
}

fn rate(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => ", or the sample rate with `--rate HZ`",
        _ => "",
    }
}

fn no_unit(quantity: Quantity, spelled: Option<&str>) -> String {
    match spelled {
        Some(spelled) => format!("{} is no unit of {quantity}", shown(spelled.as_bytes())),
        None => format!("no unit given for {quantity}"),
    }
}

/// The unit that the column's name gives where it is one of the quantity; else the quantity's own, as it is typed.
fn suffix(offer: &Offer, quantity: Quantity, index: usize) -> &'static str {
    let unit = offer
        .unit_in_file(index)
        .and_then(|spelled| spelling::unit(quantity, &spelled));
    typed(unit.unwrap_or(quantity.base_unit()))
}

/// A unit as it is typed.
fn typed(unit: Unit) -> &'static str {
    match unit.suffix {
        "v" => "V",
        "mv" => "mV",
        "kv" => "kV",
        "c" => "C",
        suffix => suffix,
    }
}

/// A column that may be meant: free and with a unit of the quantity, else free and without a unit, else free.
fn likely(offer: &Offer, quantity: Quantity, taken: &[usize]) -> Option<usize> {
    let free = || (0..offer.names.len()).filter(|index| !taken.contains(index));
    let fits = |index: &usize| {
        offer
            .unit_in_file(*index)
            .is_some_and(|spelled| spelling::unit(quantity, &spelled).is_some())
    };
    free()
        .find(fits)
        .or_else(|| free().find(|index| offer.unit_in_file(*index).is_none()))
        .or_else(|| free().next())
}
