//! Records sampled so slowly that their drive bends between the samples: judged on the grid on which `add` fits them.
#![expect(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod records;

use hysteron_data::{Record, Role};
use hysteron_diagnose::{compare, diagnose};
use hysteron_identify::{EffectId, Family, FitOptions, fit};
use hysteron_plant::{Stage, StageConfig};
use records::term;
use std::f64::consts::TAU;

/// Samples of a period, and steps of the stage a sample.
const PERIOD: usize = 512;
const STEPS: usize = 16;

/// 1600 samples a second.
const SAMPLE_S: f64 = 1.0 / 1600.0;

/// The last line, of 512 samples a period: 375 Hz, 4.3 samples a period of it.
const LAST_LINE: usize = 120;

fn stage() -> StageConfig {
    StageConfig {
        delay_s: 150e-6,
        // 0.02 % of the stroke, a good capacitive sensor.
        ..records::stage(vec![term(15.0, 0.2, 1.0)], 0.002)
    }
}

/// Amplitude of each line, volts: together they reach 45 V.
const LINE_V: f64 = 1.8;

/// Two periods in the periodic state of a sum of lines, their phases drawn.
fn record(i: usize) -> Record {
    let mut seed = i as u64 + 1;
    let phases: Vec<f64> = (0..LAST_LINE)
        .map(|_| {
            // Knuth's generator: enough for phases.
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 * TAU
        })
        .collect();
    let drive = |k: usize| -> f64 {
        let turn = TAU * (k % (PERIOD * STEPS)) as f64 / (PERIOD * STEPS) as f64;
        let lines = phases.iter().enumerate();
        50.0 + LINE_V
            * lines
                .map(|(l, phase)| (turn * (l + 1) as f64 + phase).cos())
                .sum::<f64>()
    };
    let voltage_v: Vec<f64> = (0..3 * PERIOD * STEPS).map(drive).collect();
    let mut stage = Stage::new(&stage(), 7 + i as u64).unwrap();
    let run = stage.run(&voltage_v, SAMPLE_S / STEPS as f64).unwrap();
    let recorded = |series: &[f64]| series[PERIOD * STEPS..].iter().step_by(STEPS).copied().collect();
    let role = if i < 4 { Role::Identify } else { Role::Validate };
    records::record(
        &i.to_string(),
        role,
        SAMPLE_S,
        recorded(&voltage_v),
        recorded(&run.position_um),
    )
}

/// On the samples alone the plays turn where the drive does not, and a delay by a fifth of a sample is interpolated on four
/// samples a period: fitted again there, the model is off by several times what it forecasts.
#[test]
fn regress_a_model_is_judged_on_the_grid_on_which_it_was_fitted() {
    let dataset = records::dataset((0..6).map(record));
    let bare = fit(&dataset, &FitOptions::new(Family::Pi), &|_| ()).unwrap().model;

    let model = hysteron_diagnose::add(&dataset, &bare, EffectId::Delay, &|_| ())
        .unwrap()
        .model;
    let compared = compare(&dataset, &model, &|_| ());
    let (fitted, forecast) = (compared.identify.unwrap(), compared.validate.unwrap());
    let found = diagnose(&dataset, &model, &|_, _| {});
    let told = [found.before.identify_percent, found.before.validate_percent].map(Option::unwrap);
    for (told, compared) in told.into_iter().zip([fitted.nrmse_percent, forecast.nrmse_percent]) {
        assert!((told - compared).abs() < 1e-9, "{told} {compared}");
    }
    // A free shape has all that the model's plays have; its ridge may cost it a tenth.
    let again = found.free_shape.identify_percent.unwrap();
    assert!(again < 1.1 * fitted.nrmse_percent, "{again} {}", fitted.nrmse_percent);
    assert!(
        matches!(found.verdict.as_str(), "none" | "hysteresis-shape"),
        "{} {:#?}",
        found.verdict,
        found.ranking
    );
}
