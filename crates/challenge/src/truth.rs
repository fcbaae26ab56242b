//! What is sealed.

use hysteron_plant::challenge::Truth;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// The truth of a challenge, complete enough to make it again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealedTruth {
    /// What is hidden; nothing in a control.
    pub hidden: Vec<SealedEffect>,
    /// Verdicts of one name that are right.
    pub accepted: Vec<String>,
    /// Family of the stage's hysteresis.
    pub family: String,
    /// Stroke, micrometres.
    pub stroke_um: f64,
    /// Full voltage, volts.
    pub full_v: f64,
    /// Noise of the sensor, micrometres rms.
    pub noise_rms_um: f64,
    /// The seed that it was made from.
    pub seed: u64,
}

/// A hidden effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealedEffect {
    /// Its name.
    pub effect: String,
    /// Whether the catalogue lacks it.
    pub outside_of_the_catalogue: bool,
    /// `weak`, `medium`, `strong`.
    pub strength: String,
    /// What it alone adds to the error, rms in percent of peak to peak.
    pub contribution_percent: f64,
    /// What it is in numbers.
    pub parameters: Vec<SealedParameter>,
}

/// A number of a hidden effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealedParameter {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its unit.
    pub unit: String,
}

impl SealedTruth {
    pub(crate) fn new(truth: &Truth, seed: u64) -> Self {
        let effect = |hidden: &hysteron_plant::challenge::Hidden| SealedEffect {
            effect: hidden.effect.name().to_owned(),
            outside_of_the_catalogue: hidden.effect.is_outside(),
            strength: hidden.strength.name().to_owned(),
            contribution_percent: hidden.contribution_percent,
            parameters: hidden
                .parameters
                .iter()
                .map(|p| SealedParameter {
                    name: p.name.clone(),
                    value: p.value,
                    unit: p.unit.to_owned(),
                })
                .collect(),
        };
        Self {
            hidden: truth.hidden.iter().map(effect).collect(),
            accepted: truth.accepted_verdicts().into_iter().map(str::to_owned).collect(),
            family: truth.family.name().to_owned(),
            stroke_um: truth.stroke_um,
            full_v: truth.full_v,
            noise_rms_um: truth.noise_rms_um,
            seed,
        }
    }

    /// The truth for people.
    pub fn text(&self) -> String {
        let mut text = String::new();
        if self.hidden.is_empty() {
            text.push_str("hidden: nothing\n");
        }
        for hidden in &self.hidden {
            // Writing to a String does not fail.
            let _ = writeln!(
                text,
                "hidden: {}{}, {}: adds {:.2} % of peak to peak to the error",
                hidden.effect,
                if hidden.outside_of_the_catalogue {
                    " (outside of the catalogue)"
                } else {
                    ""
                },
                hidden.strength,
                hidden.contribution_percent
            );
            for parameter in &hidden.parameters {
                let _ = writeln!(text, "  {} {:.4e} {}", parameter.name, parameter.value, parameter.unit);
            }
        }
        let _ = writeln!(
            text,
            "stage: {} hysteresis, stroke {:.2} um at {:.0} V, sensor noise {:.2e} um rms, seed {}",
            self.family, self.stroke_um, self.full_v, self.noise_rms_um, self.seed
        );
        text
    }
}
