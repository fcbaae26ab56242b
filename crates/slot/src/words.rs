//! The words of a refusal: field, value, and what is allowed.

use crate::short::short;
use crate::{MOST_PLAYS, Refusal, Rule, VERSION};
use core::fmt::{self, Display, Formatter};
use hysteron_core::tracking_law::PLAYS;

/// Part of a refusal's words.
struct Words<'a>(&'a Refusal<'a>, Part);

enum Part {
    Field,
    Value,
    Reason,
}

impl Display for Words<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.1 {
            Part::Field => self.0.write_field(f),
            Part::Value => self.0.write_value(f),
            Part::Reason => self.0.write_reason(f),
        }
    }
}

impl Refusal<'_> {
    /// The field, with the element's number.
    pub fn field(&self) -> impl Display {
        Words(self, Part::Field)
    }

    /// Its value.
    pub fn value(&self) -> impl Display {
        Words(self, Part::Value)
    }

    /// What is allowed, and what to do.
    pub fn reason(&self) -> impl Display {
        Words(self, Part::Reason)
    }

    const fn is_of_core(&self) -> bool {
        matches!(self.rule, Rule::CoreRange | Rule::CoreOrder | Rule::CoreUnbounded)
    }

    fn write_field(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.index {
            _ if self.is_of_core() && self.field.is_empty() => f.write_str(self.against),
            0 => f.write_str(self.field),
            _ if self.is_of_core() => f.write_str(self.field),
            index => write!(f, "{}[{index}]", self.field),
        }
    }

    fn write_value(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (value, [_, second, _]) = (self.value, self.allowed);
        match self.rule {
            Rule::CoreRange | Rule::CoreOrder | Rule::CoreUnbounded => f.write_str("as given"),
            Rule::Plays | Rule::LawPlays | Rule::OtherPlays => write!(f, "{value} values"),
            Rule::NotPolynomial | Rule::OtherFamily => match family(value) {
                Some(name) => f.write_str(name),
                None => write!(f, "{value}"),
            },
            Rule::Flat => write!(f, "flat or turning at {} um", value as f32),
            Rule::BeyondAmplifier => write!(f, "{value}, {second}"),
            Rule::CoveredPair | Rule::BeyondConverters => write!(f, "[{value}, {second}]"),
            Rule::LawMissing => f.write_str("none"),
            Rule::LawPresent | Rule::Heat => f.write_str("present"),
            Rule::Erased => f.write_str("erased"),
            Rule::Magic | Rule::Sum => write!(f, "{:#010x}", value as u32),
            _ => write!(f, "{value}"),
        }
    }

    fn write_reason(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let ([first, second, third], against) = (self.allowed, self.against);
        match self.rule {
                Rule::NotFinite => f.write_str("must be finite in f32"),
                Rule::MustExceed => write!(f, "must exceed {against} = {first}"),
                Rule::Unsorted => write!(
                    f,
                    "must exceed {}[{}] = {first} in f32; sort the thresholds",
                    self.field,
                    self.index.saturating_sub(1)
                ),
                Rule::NotPositive => f.write_str("must be positive"),
                Rule::Below => write!(f, "must not lie below {against}"),
                Rule::Above => write!(f, "must not lie above {against}"),
                Rule::NoSuchTerm => write!(f, "family {against} has no such term; take the line out"),
                Rule::Plays => write!(f, "a table has 1 to {MOST_PLAYS} plays; fit with fewer by --plays"),
                Rule::LawPlays => write!(f, "a complete law has {PLAYS}; export the controller again"),
                Rule::NotPolynomial => f.write_str("the inverse of a complete law is a play-polynomial"),
                Rule::GainsElsewhere => f.write_str(
                    "must be 0 in a table with a [controller]: its gains stand in [controller.feedback]",
                ),
                Rule::SafeElsewhere => {
                    f.write_str("must be 0 in a table with a [controller]: its law begins where the stage rests at 0 V")
                }
                Rule::BeyondInverse => write!(
                    f,
                    "lies {} um above the rest, outside controller.inverse_min_um to controller.inverse_max_um, {} to {} um; \
                     narrow the range with --input-min and --input-max",
                    short(third),
                    short(first),
                    short(second)
                ),
                Rule::CoreRange | Rule::CoreOrder | Rule::CoreUnbounded => self.core_reason(f),
                Rule::Outside => write!(f, "must lie in {first} to {second}"),
                Rule::NegativeError => f.write_str("must not be negative: an rms error"),
                Rule::Flat => f.write_str(
                    "the inverse must rise and fall with its input over the whole range; narrow the range with --input-min and \
                     --input-max, or fit anew",
                ),
                Rule::BeyondAmplifier => write!(
                    f,
                    "asks for {} V at {} um, outside output_min_v to output_max_v; narrow the range with --input-min and --input-max",
                    third as f32, first as f32
                ),
                Rule::CoveredPair => f.write_str("must be two finite numbers, the lower first"),
                Rule::CoveredNegative => f.write_str("must be finite and not negative"),
                Rule::OtherNumber | Rule::OtherPlays => write!(f, "must be {first} as in the image's first table"),
                Rule::OtherFamily => write!(f, "must be {against} as in the image's first table"),
                Rule::LawPresent => f.write_str(
                    "the image's first table has none; give tables with a complete law, or tables without",
                ),
                Rule::LawMissing => f.write_str(
                    "the image's first table has one; give tables with a complete law, or tables without",
                ),
                Rule::Heat => f.write_str("boards have no thermometer; leave it out"),
                _ => self.slot_reason(f),
            }
    }

    /// Of what lies in a slot or comes to it.
    fn slot_reason(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let [first, second, third] = self.allowed;
        match self.rule {
            Rule::BeyondConverters => write!(
                f,
                "must lie within {first} to {third} of the image's {}; export with the image's converters, or record within them",
                self.against
            ),
            Rule::Erased => f.write_str("no table was written here"),
            Rule::Magic => f.write_str("is no table's beginning"),
            Rule::Version => write!(
                f,
                "this image reads version {VERSION}; take the image and `hysteron` of one version"
            ),
            Rule::Length => write!(
                f,
                "must be {first} bytes by the table's own parts, and fit a slot of {second} bytes"
            ),
            Rule::Sum => write!(f, "the contents give {:#010x}", first as u32),
            Rule::Parts => f.write_str("is none that this version knows"),
            Rule::Older => write!(f, "the other slot has {first}, which is newer"),
            Rule::Trapped => f.write_str("reading it reset the board: a word of it is torn; upload again"),
            Rule::Flash => f.write_str("the flash did not take or give it"),
            Rule::NoSlots => f.write_str("this image has no slots; build it with its table"),
            Rule::Running => f.write_str("the loop runs; stop it, and upload at the safe level"),
            Rule::Place => write!(f, "the board waits for byte {first}"),
            _ => Ok(()),
        }
    }

    /// As the core's own words, whoever holds the names.
    fn core_reason(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // The core's words take names that live for ever; the name is put before words without one.
        let unnamed = Refusal {
            field: "",
            against: "",
            ..*self
        };
        let said = Refusal::<'static> {
            rule: unnamed.rule,
            field: "",
            index: unnamed.index,
            value: unnamed.value,
            against: "",
            allowed: unnamed.allowed,
        };
        f.write_str("the core refuses it in f32: ")?;
        match said.core_error() {
            Some(error) => write!(f, "{}{error}", self.against),
            None => Ok(()),
        }
    }
}

/// The name of a family by its number.
fn family(number: f64) -> Option<&'static str> {
    let found = crate::Family::ALL
        .into_iter()
        .find(|family| f64::from(*family as u8) == number);
    found.map(crate::Family::name)
}

impl Display for Refusal<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: {}", self.field(), self.value(), self.reason())
    }
}
