//! Converters, amplifier and rate of a table: where each comes from, and what the records behind it cover.

use super::Bench;
use crate::design::beyond::{self, Asked};
use crate::error::ControlError;
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
    pub told: Vec<String>,
}

/// Of what is asked for, the option's text, what it is, and its key in `[known]`.
const ASKED: [(&str, &str, &str); 3] = [
    (
        "--amplifier LOW,HIGH",
        "the volts that the stack may be given",
        "voltage_min_v and voltage_max_v",
    ),
    (
        "--dac LOW,HIGH",
        "volts at the stack of the DAC's lowest code and of full scale",
        "dac_v",
    ),
    (
        "--adc LOW,HIGH",
        "micrometres of the ADC's lowest code and of full scale",
        "adc_um",
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
        let mut missing = Vec::new();
        let mut found = [[0.0; 2]; 3];
        for (((ends, sources), asked), unit) in found.iter_mut().zip(sources).zip(ASKED).zip(["V", "V", "um"]) {
            let (option, what, known) = asked;
            let name = option.split(' ').next().unwrap_or(option);
            let from = [name, "--stage", "[known] of the dataset", "the controller's own limits"];
            match sources
                .into_iter()
                .zip(from)
                .find_map(|(ends, from)| Some((ends?, from)))
            {
                Some(([low, high], from)) => {
                    *ends = [low, high];
                    told.push(format!(
                        "{} {} to {} {unit}, from {from}",
                        name.trim_start_matches('-'),
                        short(low),
                        short(high)
                    ));
                }
                None => missing.push(format!("{option}, {what} ({known} in [known])")),
            }
        }
        if !missing.is_empty() {
            return Err(ControlError::Wish(format!(
                "{}: neither the options nor the records say what the table runs on; give {}; or write them into dataset.toml and \
                 fit again; --stage NAME has those of a simulated stage",
                bench.source,
                missing.join("; ")
            )));
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
                .push("the model does not say what its records cover; nothing of that is checked".to_owned());
            return Ok(None);
        }
        let mut kept = covered.clone();
        beyond::granted(
            &mut kept,
            &[
                Asked::voltage(&commands_v, "--amplifier LOW,HIGH"),
                Asked::position(&references_um, "--input-min and --input-max"),
                Asked::rate(rate_hz, "--rate HZ"),
            ],
            beyond_records,
        )?;
        let told_by = kept.told_by().map(|by| match by {
            ToldBy::Record(file) => file.to_owned(),
            ToldBy::User => "--rigid, the user's word".to_owned(),
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
                .map(|beyond| format!("BEYOND THE RECORDS: {beyond}")),
        );
        Ok(Some(table))
    }
}

/// Position of the highest of 65536 codes.
pub fn top([low, full_scale]: [f64; 2]) -> f64 {
    full_scale - (full_scale - low) / 65_536.0
}
