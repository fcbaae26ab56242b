//! What can be hidden, and how strongly.

/// An effect that can be hidden in a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Effect {
    /// A bend of the displacement common to both branches.
    Asymmetry,
    /// Hysteresis that widens with the rate.
    RateDependence,
    /// The stack goes on moving after the voltage has stopped.
    Creep,
    /// One or two lightly damped modes.
    Resonance,
    /// A first-order lag, in the amplifier or in the sensor.
    FirstOrderLag,
    /// The amplifier's current limit.
    SlewLimit,
    /// A pure delay.
    Delay,
    /// Position or gain that follow the temperature.
    ThermalDrift,
    /// A bent characteristic of the sensor.
    SensorNonlinearity,
    /// Line frequency and its harmonics in the position.
    MainsHum,
    /// Motion of the other axis.
    CrossCoupling,
    /// An amplifier rail or an end stop.
    Saturation,
    /// Lost motion.
    Backlash,
    /// Gain that grows with the amplitude.
    AmplitudeGain,
    /// Outside of the catalogue: the reading jumps between two levels at random times.
    Telegraph,
    /// Outside of the catalogue: the instants of the samples scatter.
    ClockJitter,
    /// Outside of the catalogue: the gain falls from record to record.
    Ageing,
    /// Outside of the catalogue: the reading falls for a few samples, every so many samples.
    DropOut,
    /// Outside of the catalogue: an error periodic in the position, as of an interpolated scale.
    ScaleRipple,
    /// Outside of the catalogue: a lag that depends on the position and is zero on the average.
    BiasLag,
    /// Outside of the catalogue: the hysteresis forgets its turning points.
    MemoryLeak,
    /// Outside of the catalogue: the gain falls with the cycles run and recovers at rest.
    Fatigue,
    /// Outside of the catalogue: a pump or fan shakes the stage at a frequency that is no harmonic of the line.
    Vibration,
}

/// The effects of the catalogue.
pub const CATALOGUE: [Effect; 14] = [
    Effect::Asymmetry,
    Effect::RateDependence,
    Effect::Creep,
    Effect::Resonance,
    Effect::FirstOrderLag,
    Effect::SlewLimit,
    Effect::Delay,
    Effect::ThermalDrift,
    Effect::SensorNonlinearity,
    Effect::MainsHum,
    Effect::CrossCoupling,
    Effect::Saturation,
    Effect::Backlash,
    Effect::AmplitudeGain,
];

/// The effects outside of the catalogue.
pub const OUTSIDE: [Effect; 9] = [
    Effect::Telegraph,
    Effect::ClockJitter,
    Effect::Ageing,
    Effect::DropOut,
    Effect::ScaleRipple,
    Effect::BiasLag,
    Effect::MemoryLeak,
    Effect::Fatigue,
    Effect::Vibration,
];

impl Effect {
    /// The name that verdicts use; for effects outside of the catalogue, a name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Asymmetry => "asymmetry",
            Self::RateDependence => "rate-dependence",
            Self::Creep => "creep",
            Self::Resonance => "resonance",
            Self::FirstOrderLag => "first-order-lag",
            Self::SlewLimit => "slew-limit",
            Self::Delay => "delay",
            Self::ThermalDrift => "thermal-drift",
            Self::SensorNonlinearity => "sensor-nonlinearity",
            Self::MainsHum => "mains-hum",
            Self::CrossCoupling => "cross-coupling",
            Self::Saturation => "saturation",
            Self::Backlash => "backlash",
            Self::AmplitudeGain => "amplitude-gain",
            Self::Telegraph => "telegraph",
            Self::ClockJitter => "clock-jitter",
            Self::Ageing => "ageing",
            Self::DropOut => "drop-out",
            Self::ScaleRipple => "scale-ripple",
            Self::BiasLag => "bias-lag",
            Self::MemoryLeak => "memory-leak",
            Self::Fatigue => "fatigue",
            Self::Vibration => "vibration",
        }
    }

    /// The effect of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        CATALOGUE
            .into_iter()
            .chain(OUTSIDE)
            .find(|effect| effect.name() == name)
    }

    /// Whether no effect of the catalogue explains it.
    pub fn is_outside(self) -> bool {
        OUTSIDE.contains(&self)
    }

    /// Whether a hysteresis of free shape explains it as well: it changes the static loops and nothing else.
    pub fn is_shape(self) -> bool {
        matches!(
            self,
            Self::Asymmetry | Self::SensorNonlinearity | Self::Backlash | Self::AmplitudeGain
        )
    }
}

/// How much an effect adds to the error, rms in percent of peak to peak; see [`super::Hidden::contribution_percent`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Strength {
    /// 0.3 to 0.6 %.
    Weak,
    /// 1 to 2 %.
    Medium,
    /// Above 3 %; 3 to 6 % are drawn.
    Strong,
}

impl Strength {
    /// All of them, weakest first.
    pub const ALL: [Self; 3] = [Self::Weak, Self::Medium, Self::Strong];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Weak => "weak",
            Self::Medium => "medium",
            Self::Strong => "strong",
        }
    }

    /// The strength of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|strength| strength.name() == name)
    }

    /// Smallest and largest contribution, percent.
    pub fn band_percent(self) -> (f64, f64) {
        match self {
            Self::Weak => (0.3, 0.6),
            Self::Medium => (1.0, 2.0),
            Self::Strong => (3.0, 6.0),
        }
    }
}

/// An effect to hide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Asked {
    /// Which.
    pub effect: Effect,
    /// How strongly.
    pub strength: Strength,
}
