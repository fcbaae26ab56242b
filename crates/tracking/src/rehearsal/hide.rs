//! What can be hidden in a stage, and how strong.

use hysteron_identify::EffectId;
use hysteron_plant::{Creep, CrossCoupling, Hysteresis, MainsHum, Mode, StageConfig};
use rand::RngExt;
use rand_pcg::Pcg64;

/// What can be hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hidden {
    /// Everything comes late: 60 to 200 us.
    Delay,
    /// The amplifier's lag: 80 to 300 us.
    FirstOrderLag,
    /// A mode at 600 to 1500 Hz, damping ratio 0.01 to 0.04.
    Resonance,
    /// 2 to 4 % a decade.
    Creep,
    /// 3 to 8 % of another axis' motion.
    CrossCoupling,
    /// 0.5 to 1.5 % of the stroke at 50 or 60 Hz, and harmonics.
    MainsHum,
}

impl Hidden {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Delay,
        Self::FirstOrderLag,
        Self::Resonance,
        Self::Creep,
        Self::CrossCoupling,
        Self::MainsHum,
    ];

    /// A model's effect for it.
    pub fn effect(self) -> EffectId {
        match self {
            Self::Delay => EffectId::Delay,
            Self::FirstOrderLag => EffectId::FirstOrderLag,
            Self::Resonance => EffectId::Resonance,
            Self::Creep => EffectId::Creep,
            Self::CrossCoupling => EffectId::CrossCoupling,
            Self::MainsHum => EffectId::MainsHum,
        }
    }

    /// The name of that effect.
    pub fn name(self) -> &'static str {
        self.effect().name()
    }

    /// The one of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|hidden| hidden.name() == name)
    }
}

/// Hides an effect; what it is in words.
pub(super) fn hide(hidden: Hidden, stage: &mut StageConfig, other: Hysteresis, rng: &mut Pcg64) -> String {
    match hidden {
        Hidden::Delay => {
            stage.delay_s = rng.random_range(60e-6..200e-6);
            format!("delay of {:.1} us", 1e6 * stage.delay_s)
        }
        Hidden::FirstOrderLag => {
            stage.amplifier.lag_s = rng.random_range(80e-6..300e-6);
            format!("amplifier's lag of {:.1} us", 1e6 * stage.amplifier.lag_s)
        }
        Hidden::Resonance => {
            let mode = Mode {
                frequency_hz: rng.random_range(600.0..1500.0),
                damping: rng.random_range(0.01..0.04),
                share: 1.0,
            };
            stage.modes = vec![mode];
            format!("mode at {:.1} Hz, damping ratio {:.4}", mode.frequency_hz, mode.damping)
        }
        Hidden::Creep => {
            let percent = rng.random_range(2.0..4.0);
            stage.creep = Some(Creep::Log {
                percent_per_decade: percent,
                from_s: 0.01,
                to_s: 1000.0,
            });
            format!("creep of {percent:.2} % a decade")
        }
        Hidden::CrossCoupling => {
            let ratio = rng.random_range(0.03..0.08) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            stage.cross_coupling = Some(CrossCoupling {
                ratio,
                lag_s: 0.0,
                hysteresis: other,
                mode: None,
            });
            format!("{:.2} % of the other axis", 100.0 * ratio)
        }
        Hidden::MainsHum => {
            let line_hz = if rng.random_bool(0.5) { 50.0 } else { 60.0 };
            let frequency_hz = line_hz + rng.random_range(-0.03..0.03);
            let first = stage.hysteresis.stroke_um * rng.random_range(0.005..0.015);
            let third = first * rng.random_range(0.1..0.4);
            stage.mains_hum = Some(MainsHum {
                frequency_hz,
                amplitudes_um: vec![first, 0.0, third],
            });
            format!(
                "{:.3} um at {frequency_hz:.3} Hz, {third:.3} um at three times that",
                first
            )
        }
    }
}
