//! Converters, amplifier and rate of a table: where each comes from, and what the records behind it cover.

use super::Bench;
use crate::design::beyond::{self, Asked};
use crate::error::ControlError;
use crate::message::{Message, Setting};
use hysteron_identify::Covered;
use hysteron_identify::covered::ToldBy;
use hysteron_table::short;

/// Converters and amplifier, in volts at the stack and micrometres.
#[derive(Debug, Clone, PartialEq)]
pub struct Ends {
    /// Volts that the stack may be given.
    pub amplifier_v: [f64; 2],
    /// Volts at the stack of the DAC's lowest code and of full scale.
    pub dac_v: [f64; 2],
    /// Micrometres of the ADC's lowest code and of full scale.
    pub adc_um: [f64; 2],
    /// Where each comes from, a line each.
    pub told: Vec<Message>,
}

/// What is asked for: its name, its setting, what it is, its key in `[known]`, its unit.
const ASKED: [(&str, Setting, &str, &str, &str); 3] = [
    (
        "amplifier",
        Setting::Amplifier,
        "the volts that the stack may be given",
        "voltage_min_v and voltage_max_v",
        "V",
    ),
    (
        "dac",
        Setting::Dac,
        "volts at the stack of the DAC's lowest code and of full scale",
        "dac_v",
        "V",
    ),
    (
        "adc",
        Setting::Adc,
        "micrometres of the ADC's lowest code and of full scale",
        "adc_um",
        "um",
    ),
];

impl Ends {
    /// From what is given, else the built-in stage, else the records; `own_v` are the limits that a controller was designed with.
    ///
    /// # Errors
    /// [`ControlError::Wish`] where nothing says what the table runs on.
    pub fn of(bench: &Bench, covered: &Covered, own_v: Option<[f64; 2]>) -> Result<Self, ControlError> {
        let stage = bench.stage.as_ref();
        let sources = [
            [
                bench.amplifier_v,
                stage.map(|stage| stage.amplifier_v),
                covered.amplifier_v,
                own_v,
            ],
            [bench.dac_v, stage.map(|stage| stage.dac_v), covered.dac_v, None],
            [bench.adc_um, stage.map(|stage| stage.adc_um), covered.adc_um, None],
        ];
        let mut told = Vec::new();
        let mut missing: Option<Message> = None;
        let mut found = [[0.0; 2]; 3];
        for ((ends, sources), asked) in found.iter_mut().zip(sources).zip(ASKED) {
            let (name, setting, what, known, unit) = asked;
            let from = [
                Message::from(setting),
                Setting::Stage.into(),
                "[known] of the dataset".into(),
                "the controller's own limits".into(),
            ];
            match sources
                .into_iter()
                .zip(from)
                .find_map(|(ends, from)| Some((ends?, from)))
            {
                Some(([low, high], from)) => {
                    *ends = [low, high];
                    told.push(from.behind(format!("{name} {} to {} {unit}, from ", short(low), short(high))));
                }
                None => {
                    let list = missing.map_or_else(
                        || {
                            Message::from(format!(
                                "{}: neither you nor the records say what the table runs on; give ",
                                bench.source
                            ))
                        },
                        |list| list.and("; "),
                    );
                    missing = Some(list.naming(setting).and(format!(", {what} ({known} in [known])")));
                }
            }
        }
        if let Some(missing) = missing {
            return Err(ControlError::Wish(
                missing
                    .and("; or write them into dataset.toml and fit again; ")
                    .naming(Setting::Stage)
                    .and(" has those of a simulated stage"),
            ));
        }
        let [amplifier_v, dac_v, adc_um] = found;
        Ok(Self {
            amplifier_v,
            dac_v,
            adc_um,
            told,
        })
    }

    /// What a table says of its records; refuses to leave them.
    ///
    /// # Errors
    /// [`ControlError::Wish`] for what leaves them without being granted.
    pub fn covered(
        &mut self,
        covered: &Covered,
        (commands_v, references_um, rate_hz): ([f64; 2], [f64; 2], f64),
        beyond_records: bool,
    ) -> Result<Option<hysteron_table::Covered>, ControlError> {
        if *covered == Covered::default() {
            self.told
                .push("the model does not say what its records cover; nothing of that is checked".into());
            return Ok(None);
        }
        let mut kept = covered.clone();
        beyond::granted(
            &mut kept,
            &[
                Asked::voltage(&commands_v, Setting::Amplifier),
                Asked::position(&references_um, Setting::Inputs),
                Asked::rate(rate_hz, Setting::TableRate),
            ],
            beyond_records,
        )?;
        let told_by = kept.told_by().map(|by| match by {
            ToldBy::Record(file) => file.to_owned(),
            ToldBy::User => "the user's word".to_owned(),
        });
        let table = hysteron_table::Covered {
            voltage_v: kept.voltage_v,
            position_um: kept.position_um,
            slew_v_per_s: kept.slew_v_per_s,
            swing_hz: kept.swing_hz,
            temperature_c: kept.temperature_c,
            sample_rate_hz: kept.sample_rate_hz,
            told_to_hz: kept.told_to_hz(),
            told_by,
            beyond: kept.beyond.iter().map(ToString::to_string).collect(),
        };
        self.told.extend(
            table
                .beyond
                .iter()
                .map(|beyond| format!("BEYOND THE RECORDS: {beyond}").into()),
        );
        Ok(Some(table))
    }
}

/// Position of the highest of 65536 codes.
pub fn top([low, full_scale]: [f64; 2]) -> f64 {
    full_scale - (full_scale - low) / 65_536.0
}
