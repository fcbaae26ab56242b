//! Fields that a person filled in, as the options of a command.

use crate::error::Refusal;

/// The options that were given, in the order of their page.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Given(Vec<String>);

impl Given {
    pub(crate) fn number(&mut self, name: &str, value: Option<f64>) {
        self.0.extend(value.map(|value| format!("--{name}={value}")));
    }

    pub(crate) fn pair(&mut self, name: &str, ends: Option<[f64; 2]>) {
        self.0.extend(ends.map(|[low, high]| format!("--{name}={low},{high}")));
    }

    pub(crate) fn flag(&mut self, name: &str, given: bool) {
        self.0.extend(given.then(|| format!("--{name}")));
    }

    /// As they follow the command.
    pub(crate) fn words(&self) -> String {
        self.0.iter().map(|option| format!(" {option}")).collect()
    }
}

/// The lowest and the highest of something, or neither.
pub(crate) fn pair(what: &str, low: Option<f64>, high: Option<f64>) -> Result<Option<[f64; 2]>, Refusal> {
    match (low, high) {
        (Some(low), Some(high)) if low < high => Ok(Some([low, high])),
        (Some(low), Some(high)) => Err(Refusal::unusable(format!(
            "the lowest {what}, {low}, must lie below the highest, {high}"
        ))),
        (None, None) => Ok(None),
        _ => Err(Refusal::unusable(format!(
            "give the lowest and the highest {what}, or neither"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_what_is_given_follows_the_command() {
        let mut given = Given::default();
        given.pair("volts", Some([-1.5, 20.0]));
        given.number("rate-hz", Some(50e3));
        given.number("margin", None);
        given.flag("open", true);
        assert_eq!(given.words(), " --volts=-1.5,20 --rate-hz=50000 --open");
    }

    #[test]
    fn refuse_half_a_pair_and_one_that_falls() {
        assert_eq!(pair("voltage", None, None), Ok(None));
        assert_eq!(pair("voltage", Some(0.0), Some(1.0)), Ok(Some([0.0, 1.0])));
        for (low, high, words) in [
            (Some(1.0), None, "give the lowest and the highest voltage, or neither"),
            (
                Some(2.0),
                Some(1.0),
                "the lowest voltage, 2, must lie below the highest, 1",
            ),
        ] {
            assert_eq!(
                pair("voltage", low, high).map_err(|refusal| refusal.message),
                Err(words.to_owned())
            );
        }
    }
}
