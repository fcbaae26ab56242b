//! The table for the firmware: the direct inverse of a step's hysteresis, for the bench that a person names.

use crate::App;
use crate::error::Refusal;
use crate::session::Session;
use crate::work::{self, Base};
use crate::{folder, jobs};
use hysteron_identify::{Direction, FitOptions, Model};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A table that was made.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Made {
    /// The commands that make it.
    command: String,
    /// What it is and which gain it allows, in words.
    said: String,
}

/// Why a step has no table for the firmware, and what to do; nothing where it has one.
pub(crate) fn no_table(model: &Model) -> Option<String> {
    (!model.effects.is_empty()).then(|| {
        let names: Vec<&str> = model.effects.iter().map(|effect| effect.name.as_str()).collect();
        format!(
            "This step has {}, and a table holds the inverse of the hysteresis alone: the controller does not compensate \
             effects yet. Choose a step without effects on the ladder.",
            names.join(" and ")
        )
    })
}

/// What the bench is, where it is not the paper's; each as the option of `hysteron export` of its name.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Bench {
    /// Lowest and highest reference, micrometres.
    input_min_um: Option<f64>,
    input_max_um: Option<f64>,
    rate_hz: Option<f64>,
    latency_us: Option<f64>,
    mode_hz: Option<f64>,
    damping: Option<f64>,
    /// Volts that the stack may be given.
    amplifier_min_v: Option<f64>,
    amplifier_max_v: Option<f64>,
    /// Volts at the stack of the DAC's lowest code and of full scale.
    dac_min_v: Option<f64>,
    dac_full_v: Option<f64>,
    /// Micrometres of the ADC's lowest code and of full scale.
    adc_min_um: Option<f64>,
    adc_full_um: Option<f64>,
}

impl Bench {
    fn options(&self) -> Result<Vec<String>, Refusal> {
        let single = [
            ("input-min", self.input_min_um),
            ("input-max", self.input_max_um),
            ("rate", self.rate_hz),
            ("latency-us", self.latency_us),
            ("mode", self.mode_hz),
            ("damping", self.damping),
        ];
        let pairs = [
            (
                "amplifier",
                self.amplifier_min_v,
                self.amplifier_max_v,
                "voltage at the stack",
            ),
            ("dac", self.dac_min_v, self.dac_full_v, "end of the DAC"),
            ("adc", self.adc_min_um, self.adc_full_um, "end of the ADC"),
        ];
        if self.mode_hz.is_some() != self.damping.is_some() {
            return Err(Refusal::unusable(
                "give the first mode and its damping ratio, or neither",
            ));
        }
        let mut options: Vec<String> = single
            .into_iter()
            .filter_map(|(name, value)| Some(format!("--{name}={}", value?)))
            .collect();
        for (name, low, high, what) in pairs {
            match (low, high) {
                (Some(low), Some(high)) if low < high => options.push(format!("--{name}={low},{high}")),
                (Some(low), Some(high)) => {
                    return Err(Refusal::unusable(format!(
                        "the lowest {what}, {low}, must lie below the highest, {high}"
                    )));
                }
                (None, None) => {}
                _ => {
                    return Err(Refusal::unusable(format!(
                        "give the lowest and the highest {what}, or neither"
                    )));
                }
            }
        }
        Ok(options)
    }
}

fn inverse_name(number: usize) -> String {
    format!("models/{}-inverse.toml", number + 1)
}

/// Fits the direct inverse of the current step's family to the data, and makes the table for the firmware.
pub(crate) fn make(app: &Arc<App>, bench: &Bench) -> Result<(), Refusal> {
    let base = Base::of(&app.session())?;
    if let Some(why) = no_table(&base.model) {
        return Err(Refusal::conflict(why));
    }
    let options = bench.options()?;
    let own = Arc::clone(app);
    jobs::start(app, "making the table", move |progress| {
        let Base { dataset, number, model } = work::up_to_date(&own, base, progress, 0.4)?;
        let plays = model.thresholds.len();
        let fit = FitOptions {
            plays,
            direction: Direction::Inverse,
            ..FitOptions::new(model.family)
        };
        let fitted = hysteron_identify::fit(&dataset, &fit, &|share| {
            progress.at(0.4 + 0.55 * share, "direct inverse")
        });
        let inverse = fitted.map_err(Refusal::unusable)?.model;
        let (text, said) = (own.table)(&inverse, &options).map_err(Refusal::unusable)?;
        let mut session = own.session();
        let (file, table) = (inverse_name(number), Session::table_name(number));
        inverse.write(&session.folder.join(&file)).map_err(Refusal::unusable)?;
        folder::write_whole(&session.folder.join(&table), text.as_bytes())?;
        let mut command = format!(
            "hysteron fit {} --model {} --plays {plays} --direction inverse -o {file} && hysteron export {file}",
            session.data_word(session.step(number)?.generation),
            model.family.name(),
        );
        for option in options.iter().chain([&format!("-o {table}")]) {
            command.push(' ');
            command.push_str(option);
        }
        session.book.tables.insert(number, Made { command, said });
        session.save()
    })
}
