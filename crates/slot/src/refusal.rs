//! Why a table is refused, as data that a board can send: a rule, the field, its value and what is allowed.

use hysteron_core::error::ParamError;

/// Which rule a value breaks. The numbers are those on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
#[expect(missing_docs, reason = "each one's words are in `Refusal::reason`")]
pub enum Rule {
    NotFinite = 0,
    MustExceed = 1,
    Unsorted = 2,
    NotPositive = 3,
    Below = 4,
    Above = 5,
    NoSuchTerm = 6,
    Plays = 7,
    LawPlays = 8,
    NotPolynomial = 9,
    GainsElsewhere = 10,
    SafeElsewhere = 11,
    BeyondInverse = 12,
    CoreRange = 13,
    CoreOrder = 14,
    CoreUnbounded = 15,
    Outside = 16,
    NegativeError = 17,
    Flat = 18,
    BeyondAmplifier = 19,
    CoveredPair = 20,
    CoveredNegative = 21,
    OtherNumber = 22,
    OtherFamily = 23,
    OtherPlays = 24,
    LawMissing = 25,
    LawPresent = 26,
    Heat = 27,
    BeyondConverters = 28,
    Erased = 29,
    Magic = 30,
    Version = 31,
    Length = 32,
    Sum = 33,
    Parts = 34,
    Older = 35,
    Trapped = 36,
    Flash = 37,
    NoSlots = 38,
    Running = 39,
    Place = 40,
}

impl Rule {
    /// All of them, by their numbers.
    pub const ALL: [Self; 41] = [
        Self::NotFinite,
        Self::MustExceed,
        Self::Unsorted,
        Self::NotPositive,
        Self::Below,
        Self::Above,
        Self::NoSuchTerm,
        Self::Plays,
        Self::LawPlays,
        Self::NotPolynomial,
        Self::GainsElsewhere,
        Self::SafeElsewhere,
        Self::BeyondInverse,
        Self::CoreRange,
        Self::CoreOrder,
        Self::CoreUnbounded,
        Self::Outside,
        Self::NegativeError,
        Self::Flat,
        Self::BeyondAmplifier,
        Self::CoveredPair,
        Self::CoveredNegative,
        Self::OtherNumber,
        Self::OtherFamily,
        Self::OtherPlays,
        Self::LawMissing,
        Self::LawPresent,
        Self::Heat,
        Self::BeyondConverters,
        Self::Erased,
        Self::Magic,
        Self::Version,
        Self::Length,
        Self::Sum,
        Self::Parts,
        Self::Older,
        Self::Trapped,
        Self::Flash,
        Self::NoSlots,
        Self::Running,
        Self::Place,
    ];
}

/// A field whose value cannot be used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refusal<'a> {
    /// Which rule it breaks.
    pub rule: Rule,
    /// The field, or fields.
    pub field: &'a str,
    /// The element's number from 1 in a list; 0 for all of it.
    pub index: u16,
    /// The value.
    pub value: f64,
    /// What it is held against: a field, a family, a parameter of the core.
    pub against: &'a str,
    /// What is allowed, as the rule says.
    pub allowed: [f64; 3],
}

impl<'a> Refusal<'a> {
    /// Of a field.
    #[cold]
    pub const fn new(rule: Rule, field: &'a str, value: f64) -> Self {
        Self {
            rule,
            field,
            index: 0,
            value,
            against: "",
            allowed: [0.0; 3],
        }
    }

    /// Held against something.
    #[must_use]
    pub const fn against(self, against: &'a str) -> Self {
        Self { against, ..self }
    }

    /// With what is allowed.
    #[must_use]
    pub const fn allowed(self, allowed: [f64; 3]) -> Self {
        Self { allowed, ..self }
    }

    /// Of an element, by its number from 1.
    #[must_use]
    pub const fn at(self, index: usize) -> Self {
        Self {
            index: index as u16,
            ..self
        }
    }
}

impl Refusal<'static> {
    /// What the core refuses of a field; of the whole table where `field` is empty.
    #[cold]
    pub fn of_core(field: &'static str, error: ParamError) -> Self {
        match error {
            ParamError::OutOfRange {
                name,
                index,
                value,
                min,
                max,
            } => Self::new(Rule::CoreRange, field, value)
                .against(name)
                .at(index.unwrap_or(0))
                .allowed([min, max, 0.0]),
            ParamError::NotIncreasing {
                name,
                index,
                value,
                previous,
            } => Self::new(Rule::CoreOrder, field, value)
                .against(name)
                .at(index)
                .allowed([previous, 0.0, 0.0]),
            ParamError::Unbounded { name, input } => Self::new(Rule::CoreUnbounded, field, input).against(name),
        }
    }

    /// The core's own words, where the core refuses.
    pub fn core_error(&self) -> Option<ParamError> {
        let name = self.against;
        let [first, second, _] = self.allowed;
        match self.rule {
            Rule::CoreRange => Some(ParamError::OutOfRange {
                name,
                index: (self.index > 0).then_some(usize::from(self.index)),
                value: self.value,
                min: first,
                max: second,
            }),
            Rule::CoreOrder => Some(ParamError::NotIncreasing {
                name,
                index: usize::from(self.index),
                value: self.value,
                previous: first,
            }),
            Rule::CoreUnbounded => Some(ParamError::Unbounded {
                name,
                input: self.value,
            }),
            _ => None,
        }
    }
}
