//! Excitations as they are written on the command line: `sine:hz=100,high_v=26`.

use hysteron_excitation::{
    BandNoise, DecayingTriangle, Excitation, MultiHarmonic, Multisine, Sine, Steps, Sweep, SweepLaw, Triangle,
};
use std::str::FromStr;

/// The kinds with their values and defaults, in the order of [`ExcitationChoice::build`].
const KINDS: [(&str, &[(&str, f64)]); 9] = [
    (
        "sine",
        &[("hz", 100.0), ("low_v", 0.0), ("high_v", 26.0), ("periods", 5.0)],
    ),
    (
        "triangle",
        &[("hz", 10.0), ("low_v", 0.0), ("high_v", 26.0), ("periods", 3.0)],
    ),
    ("complex-harmonic", &[("hz", 100.0), ("full_v", 26.0), ("periods", 5.0)]),
    (
        "decaying-triangle",
        &[
            ("high_v", 26.0),
            ("centre_v", 13.0),
            ("decay", 0.85),
            ("turns", 12.0),
            ("slope_v_per_s", 2000.0),
        ],
    ),
    (
        "staircase",
        &[
            ("high_v", 26.0),
            ("levels", 5.0),
            ("hold_s", 0.1),
            ("transition_s", 0.001),
        ],
    ),
    ("rest", &[("v", 13.0), ("seconds", 0.2)]),
    (
        "sweep",
        &[
            ("from_hz", 10.0),
            ("to_hz", 500.0),
            ("seconds", 1.0),
            ("low_v", 0.0),
            ("high_v", 26.0),
        ],
    ),
    (
        "multisine",
        &[
            ("low_hz", 5.0),
            ("high_hz", 500.0),
            ("period_s", 0.2),
            ("periods", 3.0),
            ("bias_v", 13.0),
            ("peak_v", 12.0),
        ],
    ),
    (
        "noise",
        &[
            ("band_hz", 300.0),
            ("seconds", 0.5),
            ("rms_v", 4.0),
            ("low_v", 0.0),
            ("high_v", 26.0),
        ],
    ),
];

/// An excitation with all of its values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ExcitationChoice {
    kind: &'static str,
    values: Vec<f64>,
}

impl FromStr for ExcitationChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, settings) = text.split_once(':').unwrap_or((text, ""));
        let Some(&(kind, defaults)) = KINDS.iter().find(|(kind, _)| *kind == name) else {
            let kinds: Vec<&str> = KINDS.iter().map(|(kind, _)| *kind).collect();
            return Err(format!("`{name}` is no excitation; there are {}", kinds.join(", ")));
        };
        let mut values: Vec<f64> = defaults.iter().map(|(_, value)| *value).collect();
        for setting in settings.split(',').filter(|setting| !setting.is_empty()) {
            let keys = || defaults.iter().map(|(key, _)| *key).collect::<Vec<_>>().join(", ");
            let Some((key, value)) = setting.split_once('=') else {
                return Err(format!("`{setting}` must be KEY=VALUE; {kind} has {}", keys()));
            };
            let Some(place) = defaults.iter().position(|(known, _)| *known == key) else {
                return Err(format!("{kind} has no `{key}`; it has {}", keys()));
            };
            values[place] = match value.parse::<f64>() {
                Ok(value) if value.is_finite() => value,
                _ => return Err(format!("{key}={value}: give a finite number")),
            };
        }
        if let Some(place) = defaults.iter().position(|(key, _)| ["turns", "levels"].contains(key)) {
            whole(defaults[place].0, values[place])?;
        }
        if kind == "multisine" {
            whole("periods", values[3])?;
        }
        Ok(Self { kind, values })
    }
}

fn whole(key: &str, value: f64) -> Result<(), String> {
    if value.fract() == 0.0 && (1.0..=1e6).contains(&value) {
        Ok(())
    } else {
        Err(format!("{key}={value}: give a whole number from 1 to 1000000"))
    }
}

impl ExcitationChoice {
    /// A file's name for it.
    pub(crate) fn stem(&self) -> String {
        match self.kind {
            "sine" | "triangle" | "complex-harmonic" => format!("{}-{}hz", self.kind, self.values[0]),
            kind => kind.to_owned(),
        }
    }

    /// Whether it repeats, so that a record of it can start in periodic state.
    pub(crate) fn is_periodic(&self) -> bool {
        match self.kind {
            "sine" | "triangle" | "complex-harmonic" => {
                self.values.last().is_some_and(|periods| periods.fract() == 0.0)
            }
            kind => kind == "multisine",
        }
    }

    /// The excitation. Values out of range are refused when it is played.
    pub(crate) fn build(&self, seed: u64) -> Box<dyn Excitation + Sync> {
        let x = |index: usize| self.values.get(index).copied().unwrap_or(f64::NAN);
        // Checked to be whole and in range where they are read.
        let count = |index: usize| x(index) as u32;
        match self.kind {
            "sine" => Box::new(Sine {
                frequency_hz: x(0),
                low_v: x(1),
                high_v: x(2),
                periods: x(3),
            }),
            "triangle" => Box::new(Triangle {
                frequency_hz: x(0),
                low_v: x(1),
                high_v: x(2),
                periods: x(3),
            }),
            "complex-harmonic" => Box::new(MultiHarmonic {
                frequency_hz: x(0),
                full_v: x(1),
                periods: x(2),
            }),
            "decaying-triangle" => Box::new(DecayingTriangle {
                high_v: x(0),
                centre_v: x(1),
                decay: x(2),
                turns: count(3),
                slope_v_per_s: x(4),
            }),
            "staircase" => Box::new(Steps::staircase(x(0), count(1), x(2), x(3))),
            "rest" => Box::new(Steps {
                levels_v: vec![x(0)],
                hold_s: x(1),
                transition_s: 0.0,
            }),
            "sweep" => Box::new(Sweep {
                start_hz: x(0),
                end_hz: x(1),
                law: SweepLaw::Logarithmic,
                duration_s: x(2),
                low_v: x(3),
                high_v: x(4),
            }),
            "multisine" => Box::new(Multisine {
                low_hz: x(0),
                high_hz: x(1),
                period_s: x(2),
                periods: count(3),
                bias_v: x(4),
                peak_v: x(5),
                seed,
            }),
            _ => Box::new(BandNoise {
                bandwidth_hz: x(0),
                duration_s: x(1),
                rms_v: x(2),
                low_v: x(3),
                high_v: x(4),
                seed,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_defaults_and_settings() {
        let sine: ExcitationChoice = "sine:hz=97,periods=4".parse().unwrap();
        assert_eq!(sine.values, [97.0, 0.0, 26.0, 4.0]);
        assert_eq!(sine.stem(), "sine-97hz");
        for (kind, _) in KINDS {
            let choice: ExcitationChoice = kind.parse().unwrap();
            let samples = choice.build(1).samples(20e-6).unwrap();
            assert!(samples.len() > 10, "{kind}");
        }
    }

    #[test]
    fn refuse_with_what_is_allowed() {
        for (text, message) in [
            (
                "saw:hz=1",
                "`saw` is no excitation; there are sine, triangle, complex-harmonic, decaying-triangle, staircase, rest, sweep, multisine, noise",
            ),
            ("sine:f=1", "sine has no `f`; it has hz, low_v, high_v, periods"),
            ("sine:hz", "`hz` must be KEY=VALUE; sine has hz, low_v, high_v, periods"),
            ("sine:hz=fast", "hz=fast: give a finite number"),
            (
                "staircase:levels=2.5",
                "levels=2.5: give a whole number from 1 to 1000000",
            ),
            (
                "multisine:periods=0",
                "periods=0: give a whole number from 1 to 1000000",
            ),
        ] {
            assert_eq!(text.parse::<ExcitationChoice>().unwrap_err(), message);
        }
    }
}
