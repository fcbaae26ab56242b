//! Converters, amplifier and rate of a table: where each comes from, and what the records behind it cover.

use super::ExportArgs;
use crate::error::CliError;
use hysteron_control::design::beyond::{self, Asked};
use hysteron_identify::Covered;
use hysteron_identify::covered::ToldBy;
use hysteron_plant::{Amplifier, Converter, Sensor, StageConfig};
use std::fmt::Write;

/// Converters and amplifier, in volts at the stack and micrometres.
pub(super) struct Ends {
    pub amplifier_v: [f64; 2],
    pub dac_v: [f64; 2],
    pub adc_um: [f64; 2],
    /// Where each comes from, a line each.
    told: Vec<String>,
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
    /// From the options, else the stage, else the records; `own_v` are the limits that a controller was designed with.
    pub(super) fn of(
        stage: Option<&StageConfig>,
        covered: &Covered,
        own_v: Option<[f64; 2]>,
        args: &ExportArgs,
    ) -> Result<Self, CliError> {
        let of_stage = stage.map(|stage| {
            let (dac_v, adc_um) = full_scales(stage.dac, &stage.amplifier, &stage.sensor);
            ([stage.amplifier.min_v, stage.amplifier.max_v], dac_v, adc_um)
        });
        let sources = [
            [
                args.amplifier,
                of_stage.map(|(amplifier, ..)| amplifier),
                covered.amplifier_v,
                own_v,
            ],
            [args.dac, of_stage.map(|(_, dac, _)| dac), covered.dac_v, None],
            [args.adc, of_stage.map(|(.., adc)| adc), covered.adc_um, None],
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
                        "{} {low} to {high} {unit}, from {from}",
                        name.trim_start_matches('-')
                    ));
                }
                None => missing.push(format!("{option}, {what} ({known} in [known])")),
            }
        }
        if !missing.is_empty() {
            return Err(CliError::Option(format!(
                "{}: neither the options nor the records say what the table runs on; give {}; or write them into dataset.toml and \
                 fit again; --stage NAME has those of a simulated stage",
                args.model.display(),
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

    /// Rate of an inverse alone.
    pub(super) fn rate_hz(
        &mut self,
        stage: Option<&StageConfig>,
        covered: &Covered,
        args: &ExportArgs,
    ) -> Result<f64, CliError> {
        let sources = [
            (args.rate, "--rate"),
            (stage.map(|stage| 1.0 / stage.sample_period_s), "--stage"),
            (covered.sample_rate_hz, "the records"),
        ];
        let Some((rate_hz, from)) = sources.into_iter().find_map(|(rate, from)| Some((rate?, from))) else {
            return Err(CliError::Option(format!(
                "{}: the model does not say at what rate its records were taken; give the rate of the control loop: --rate HZ",
                args.model.display()
            )));
        };
        self.told.push(format!("rate {rate_hz} Hz, from {from}"));
        Ok(rate_hz)
    }

    /// What a table says of its records; refuses to leave them.
    pub(super) fn covered(
        &mut self,
        covered: &Covered,
        (commands_v, references_um, rate_hz): ([f64; 2], [f64; 2], f64),
        args: &ExportArgs,
    ) -> Result<Option<hysteron_table::Covered>, CliError> {
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
            args.beyond_records,
        )?;
        let told_by = kept.told_by().map(|by| match by {
            ToldBy::Record(file) => file.to_owned(),
            ToldBy::User => "--rigid, the user's word".to_owned(),
        });
        let table = hysteron_table::Covered {
            voltage_v: kept.voltage_v,
            position_um: kept.position_um,
            slew_v_per_s: kept.slew_v_per_s,
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

    /// Where everything comes from.
    pub(super) fn said(&self) -> String {
        let mut text = String::new();
        for line in &self.told {
            // Writing to a String does not fail.
            let _ = writeln!(text, "{line}");
        }
        text
    }
}

/// Ends of both converters: volts at the stack, micrometres.
pub(crate) fn full_scales(dac: Option<Converter>, amplifier: &Amplifier, sensor: &Sensor) -> ([f64; 2], [f64; 2]) {
    let scaled = |converter: Option<Converter>, factor: f64| {
        let converter = converter.unwrap_or(Converter::BIPOLAR_16_BIT);
        [converter.min_v * factor, converter.max_v * factor]
    };
    (scaled(dac, amplifier.gain), scaled(sensor.adc, sensor.um_per_v))
}

/// Position of the highest of 65536 codes.
pub(crate) fn top([low, full_scale]: [f64; 2]) -> f64 {
    full_scale - (full_scale - low) / 65_536.0
}
