//! Records that lack something: each set ends in an open-loop controller, in a refusal, or in a loop that holds on its own stage and
//! with the stage's modes a tenth off. None ends in a loop that swings.

#![expect(clippy::unwrap_used, reason = "a test that cannot build its subject fails")]

use hysteron_control::design::feedback::{Effort, LARGEST_SENSITIVITY};
use hysteron_control::design::{Controller, OpenLoop, ReferenceKind};
use hysteron_control::reference::Reference;
use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_excitation::{DecayingTriangle, Excitation, Multisine, Sine, with_rise};
use hysteron_identify::control::{RecordedHold, chain_of};
use hysteron_identify::effects::find;
use hysteron_identify::{Adding, EffectId, Family, FitOptions, Model, add, fit};
use hysteron_plant::{Converter, Stage, StageConfig, preset};
use hysteron_tracking::complete;
use rayon::prelude::*;

/// What a set of records lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lacks {
    /// Sines and minor loops over the whole range, and nothing small.
    SmallSignals,
    /// The small signal ends at 200 Hz.
    Band,
    /// One sine of one amplitude beside the small signal.
    Amplitudes,
    /// Records that begin in the middle of a motion.
    Rest,
    /// A sensor that ends at 60 % of the stroke.
    Range,
    /// Converters of 12 and 10 bits.
    Codes,
    /// A sensor with 50 nm of noise.
    Quiet,
    /// Rows at 2 kHz, where the stage has its mode or lag above.
    Rate,
    /// A multisine over most of the range, nothing small.
    Smallness,
    /// Nothing; and the mode is in the model.
    Nothing,
}

const LACKS: [Lacks; 10] = [
    Lacks::SmallSignals,
    Lacks::Band,
    Lacks::Amplitudes,
    Lacks::Rest,
    Lacks::Range,
    Lacks::Codes,
    Lacks::Quiet,
    Lacks::Rate,
    Lacks::Smallness,
    Lacks::Nothing,
];

/// Highest voltage of the records.
const TOP_V: f64 = 180.0;

fn recorded(stage: &StageConfig, lacks: Lacks) -> Dataset {
    let mut stage = stage.clone();
    match lacks {
        Lacks::Range => {
            // A converter that ends where 60 % of the stroke is.
            let end_v = 0.6 * stage.hysteresis.stroke_um / stage.sensor.um_per_v;
            let converter = Converter {
                max_v: end_v,
                ..Converter::BIPOLAR_16_BIT
            };
            stage.sensor.adc = Some(converter);
        }
        Lacks::Codes => {
            stage.dac = Some(Converter {
                bits: 12,
                ..Converter::UNIPOLAR_16_BIT
            });
            stage.sensor.adc = Some(Converter {
                bits: 10,
                ..Converter::BIPOLAR_16_BIT
            });
        }
        Lacks::Quiet => stage.sensor.noise_rms_um = 0.05,
        _ => {}
    }
    let sine = |frequency_hz: f64, low_v: f64, high_v: f64, periods: f64| -> Box<dyn Excitation> {
        Box::new(Sine {
            frequency_hz,
            low_v,
            high_v,
            periods,
        })
    };
    let multisine = |high_hz: f64, peak_v: f64| -> Box<dyn Excitation> {
        Box::new(Multisine {
            low_hz: 20.0,
            high_hz,
            period_s: 0.1,
            periods: 5,
            bias_v: 0.5 * TOP_V,
            peak_v,
            seed: 5,
        })
    };
    let minor: Box<dyn Excitation> = Box::new(DecayingTriangle {
        high_v: TOP_V,
        centre_v: 0.5 * TOP_V,
        decay: 0.85,
        turns: 12,
        slope_v_per_s: 8000.0,
    });
    let small_v = 0.06 * TOP_V;
    let period_s = if lacks == Lacks::Rate {
        5e-4
    } else {
        stage.sample_period_s
    };
    let plan: Vec<Box<dyn Excitation>> = match lacks {
        Lacks::SmallSignals => vec![sine(10.0, 0.0, TOP_V, 2.0), sine(100.0, 0.0, TOP_V, 8.0), minor],
        Lacks::Band => vec![sine(10.0, 0.0, TOP_V, 2.0), minor, multisine(200.0, small_v)],
        Lacks::Amplitudes => vec![sine(11.0, 0.0, TOP_V, 3.0), multisine(4000.0, small_v)],
        Lacks::Rate => vec![sine(10.0, 0.0, TOP_V, 4.0), minor, multisine(450.0, small_v)],
        Lacks::Smallness => vec![sine(10.0, 0.0, TOP_V, 2.0), multisine(4000.0, 0.45 * TOP_V)],
        _ => vec![
            sine(10.0, 0.0, TOP_V, 2.0),
            sine(100.0, 0.0, TOP_V, 8.0),
            minor,
            multisine(4000.0, small_v),
        ],
    };
    let records = plan.iter().enumerate().map(|(number, excitation)| {
        let voltage_v = with_rise(&excitation.samples(period_s).unwrap(), 0.02, period_s).unwrap();
        let run = Stage::new(&stage, number as u64)
            .unwrap()
            .run(&voltage_v, period_s)
            .unwrap();
        // From a third of the record on nobody knows what was before.
        let from = if lacks == Lacks::Rest { voltage_v.len() / 3 } else { 0 };
        Record {
            file: format!("{number}.csv"),
            role: Role::Identify,
            excitation: excitation.description(),
            start_s: 0.0,
            period_s,
            voltage_v: voltage_v[from..].to_vec(),
            position_um: run.position_um[from..].to_vec(),
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        }
    });
    Dataset {
        name: format!("{lacks:?}"),
        known: Known {
            voltage_min_v: Some(0.0),
            voltage_max_v: Some(200.0),
            ..Known::default()
        },
        records: records.collect(),
        ..Dataset::default()
    }
}

/// What became of a set of records.
#[derive(Debug, Clone, PartialEq)]
enum Outcome {
    Refused(String),
    Open(OpenLoop),
    Closed(Box<Controller>),
}

fn words(outcome: &Outcome) -> String {
    match outcome {
        Outcome::Closed(controller) => {
            let feedback = controller.feedback.as_ref().unwrap();
            format!(
                "closed, told to {:.0} Hz, rejects to {:.0} Hz",
                feedback.told_to_hz, feedback.rejection_hz
            )
        }
        Outcome::Open(why) => format!("open, {why:?}"),
        Outcome::Refused(why) => format!("refused, {why}"),
    }
}

fn controller(dataset: &Dataset, model: &Model) -> Outcome {
    let rate_hz = model.covered.sample_rate_hz.unwrap();
    let chain = match chain_of(model, 1.0 / rate_hz, [0.0, 200.0], RecordedHold::InRecords) {
        Ok((chain, _)) => chain,
        Err(refused) => return Outcome::Refused(refused.to_string()),
    };
    let designed = Controller::design(&chain, ReferenceKind::Previewed)
        .and_then(|open| open.with_feedback_within(LARGEST_SENSITIVITY, Effort::Quick));
    match designed {
        Ok(Controller {
            feedback: None,
            open_loop,
            ..
        }) => Outcome::Open(open_loop.unwrap()),
        Ok(closed) => Outcome::Closed(Box::new(closed)),
        Err(refused) => Outcome::Refused(format!("{}: {refused}", dataset.name)),
    }
}

/// Rms about its mean of the last fifth of two thirds of a second at rest in the middle of the range, micrometres.
fn swing_um(stage: &StageConfig, controller: &Controller) -> f64 {
    let model = &controller.model;
    let stage = StageConfig {
        sample_period_s: model.sample_period_s,
        ..stage.clone()
    };
    let middle_um = 0.5 * (model.inverse.input_min_um + model.inverse.input_max_um) + model.around.rest_um;
    let samples = |time_s: f64| (time_s / model.sample_period_s) as usize;
    let mut samples_um: Vec<f64> = (0..samples(0.02))
        .map(|k| middle_um * k as f64 / samples(0.02) as f64)
        .collect();
    samples_um.resize(samples(0.66), middle_um);
    let reference = Reference {
        samples_um,
        ..Reference::default()
    };
    let run = complete::track(&stage, 99, &controller.law::<f64>().unwrap(), &reference).unwrap();
    let last = &run.true_um[samples(0.53)..];
    let mean = last.iter().sum::<f64>() / last.len() as f64;
    (last.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / last.len() as f64).sqrt()
}

fn with_modes(stage: &StageConfig, factor: f64) -> StageConfig {
    let mut changed = stage.clone();
    changed.modes.iter_mut().for_each(|mode| mode.frequency_hz *= factor);
    changed
}

/// Thirty sets of records on three stages. A loop that swings moves by percents of the stroke; noise of a stable one is below 1e-4 of it, and
/// a set with 50 nm of sensor noise passes as much on.
#[test]
fn val_records_that_lack_something_make_no_loop_that_swings() {
    let stages = ["8k", "2.5k", "739"].map(|name| (name, preset::named(name).unwrap()));
    let sets: Vec<(&str, &StageConfig, Lacks)> = stages
        .iter()
        .flat_map(|(name, stage)| LACKS.map(|lacks| (*name, stage, lacks)))
        .collect();
    assert_eq!(sets.len(), 30);
    let outcomes: Vec<Outcome> = sets
        .par_iter()
        .map(|&(_, stage, lacks)| {
            let dataset = recorded(stage, lacks);
            let options = FitOptions {
                plays: 10,
                ..FitOptions::new(if lacks == Lacks::Nothing {
                    Family::PlayPolynomial
                } else {
                    Family::Mpi
                })
            };
            let mut model = fit(&dataset, &options, &|_| ()).unwrap().model;
            if lacks == Lacks::Nothing {
                let adding = Adding {
                    noise_um: 1e-3,
                    keep_family: true,
                };
                for effect in [EffectId::Resonance, EffectId::Delay] {
                    model = add(&dataset, &model, &find(effect), adding, &|_| ()).unwrap().model;
                }
            }
            controller(&dataset, &model)
        })
        .collect();
    let mut closed = 0;
    for ((name, stage, lacks), outcome) in sets.iter().zip(&outcomes) {
        match outcome {
            Outcome::Closed(controller) => {
                closed += 1;
                for factor in [0.9, 1.0, 1.1] {
                    let swing_um = swing_um(&with_modes(stage, factor), controller);
                    assert!(
                        swing_um < 1e-3 * stage.hysteresis.stroke_um,
                        "{name}, lacks {lacks:?}, modes times {factor}: {swing_um} um"
                    );
                }
            }
            Outcome::Open(_) => {}
            // A refusal says what to do.
            Outcome::Refused(why) => assert!(why.contains("; "), "{why}"),
        }
        println!("{name}, lacks {lacks:?}: {}", words(outcome));
        // Without small signals nothing tells where a mode is.
        if matches!(lacks, Lacks::SmallSignals | Lacks::Smallness) {
            let not_told = matches!(outcome, Outcome::Open(OpenLoop::NotTold) | Outcome::Refused(_));
            assert!(not_told, "{name}, {lacks:?}: {outcome:?}");
        }
    }
    // The sets that lack nothing are worth a loop.
    assert!(closed >= 3, "{closed} loops");
}
