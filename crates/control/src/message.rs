//! Sentences for a person that name what can be given otherwise, so that each front end names it as its own person gives it.

use core::fmt::{self, Display, Formatter};

/// What a person can give, leave out or allow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Setting {
    /// Highest voltage of a campaign.
    TopV,
    /// Rate of the controller.
    RateHz,
    /// Latency of the controller, from reading to command.
    LatencyUs,
    /// Bandwidth of the sensor.
    SensorBandwidthHz,
    /// Seed of excitations that are random.
    Seed,
    /// Rest before each record that a board plays.
    RestS,
    /// That records that began while the stage moved are taken.
    ShortRests,
    /// That what lies there is replaced.
    Overwrite,
    /// The folder of a campaign's plan.
    Plan,
    /// What writes a campaign's plan.
    Planning,
    /// That a recording's position is turned by -1 when it is imported.
    TurnedPosition,
    /// That what the records cover is left.
    BeyondRecords,
    /// Limits of the command.
    Volts,
    /// Lowest and highest reference.
    Range,
    /// The user's own reference.
    Reference,
    /// Largest peak of the sensitivity.
    Margin,
    /// The user's word that the stage is rigid up to a frequency.
    RigidHz,
    /// By how much the gain may be learned.
    AdaptPercent,
    /// That the reference is known as it comes only.
    Live,
    /// That the reference is known ahead.
    Previewed,
    /// Volts that the stack may be given.
    Amplifier,
    /// Ends of the DAC.
    Dac,
    /// Ends of the ADC.
    Adc,
    /// Lowest and highest reference of a table.
    Inputs,
    /// Rate of a table or of a unit.
    TableRate,
    /// A simulated stage.
    Stage,
    /// How far the feedback may take the platform.
    FeedbackBoundUm,
    /// How long an answer of a process is waited for.
    Timeout,
}

impl Setting {
    /// All of them.
    pub const ALL: [Self; 28] = [
        Self::TopV,
        Self::RateHz,
        Self::LatencyUs,
        Self::SensorBandwidthHz,
        Self::Seed,
        Self::RestS,
        Self::ShortRests,
        Self::Overwrite,
        Self::Plan,
        Self::Planning,
        Self::TurnedPosition,
        Self::BeyondRecords,
        Self::Volts,
        Self::Range,
        Self::Reference,
        Self::Margin,
        Self::RigidHz,
        Self::AdaptPercent,
        Self::Live,
        Self::Previewed,
        Self::Amplifier,
        Self::Dac,
        Self::Adc,
        Self::Inputs,
        Self::TableRate,
        Self::Stage,
        Self::FeedbackBoundUm,
        Self::Timeout,
    ];

    /// Its field where this crate asks for it, else what it is.
    pub fn field(self) -> &'static str {
        match self {
            Self::TopV => "`top_v`",
            Self::RateHz | Self::TableRate => "`rate_hz`",
            Self::LatencyUs => "`latency_us`",
            Self::SensorBandwidthHz => "`sensor_bandwidth_hz`",
            Self::Seed => "`seed`",
            Self::RestS => "`rest_s`",
            Self::ShortRests => "`short_rests`",
            Self::Overwrite => "`overwrite`",
            Self::Plan => "`folder`",
            Self::Planning => "`Plan::files`",
            Self::TurnedPosition => "the position times -1",
            Self::BeyondRecords => "`beyond_records`",
            Self::Volts => "`volts`",
            Self::Range => "`range_um`",
            Self::Reference => "another reference",
            Self::Margin => "`margin`",
            Self::RigidHz => "`rigid_hz`",
            Self::AdaptPercent => "`adapt_percent`",
            Self::Live => "a live `reference`",
            Self::Previewed => "a previewed `reference`",
            Self::Amplifier => "`amplifier_v`",
            Self::Dac => "`dac_v`",
            Self::Adc => "`adc_um`",
            Self::Inputs => "`input_min_um` and `input_max_um`",
            Self::Stage => "`stage`",
            Self::FeedbackBoundUm => "`feedback_bound_um`",
            Self::Timeout => "`timeout`",
        }
    }
}

impl Display for Setting {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.field())
    }
}

/// How a front end names a setting.
pub type Naming = fn(Setting) -> &'static str;

#[derive(Debug, Clone, PartialEq, Eq)]
enum Part {
    Words(String),
    Setting(Setting),
}

/// A sentence that names settings. As it is displayed they have the names of [`Setting::field`].
///
/// # Example
/// ```
/// use hysteron_control::message::{Message, Setting};
/// let message = Message::from("the latency is not known: give ").naming(Setting::LatencyUs);
/// assert_eq!(message.to_string(), "the latency is not known: give `latency_us`");
/// assert_eq!(message.worded(|_| "the latency's field"), "the latency is not known: give the latency's field");
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message(Vec<Part>);

impl Message {
    /// Goes on with the name of a setting.
    #[must_use]
    pub fn naming(mut self, setting: Setting) -> Self {
        self.0.push(Part::Setting(setting));
        self
    }

    /// Goes on with words.
    #[must_use]
    pub fn and(mut self, words: impl Into<String>) -> Self {
        self.0.push(Part::Words(words.into()));
        self
    }

    /// The same behind a word on where it is said of.
    #[must_use]
    pub fn behind(mut self, words: impl Into<String>) -> Self {
        self.0.insert(0, Part::Words(words.into()));
        self
    }

    /// The sentence in a front end's names.
    pub fn worded(&self, name: Naming) -> String {
        let words = self.0.iter().map(|part| match part {
            Part::Words(words) => words,
            Part::Setting(setting) => name(*setting),
        });
        words.collect()
    }
}

impl From<String> for Message {
    fn from(words: String) -> Self {
        Self(vec![Part::Words(words)])
    }
}

impl From<&str> for Message {
    fn from(words: &str) -> Self {
        Self::from(words.to_owned())
    }
}

impl From<Setting> for Message {
    fn from(setting: Setting) -> Self {
        Self(vec![Part::Setting(setting)])
    }
}

impl Display for Message {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.worded(Setting::field))
    }
}
