//! Writes the page of a comparison on a made-up stage, to be looked at: a static hysteresis behind a lag of 93 us, 15
//! records of which one has a million samples, and a rate-independent model fitted to it.
//!
//! `cargo run --release -p hysteron-report --example comparison_page -- page.html [mrpi]`

use std::f64::consts::TAU;

use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_diagnose::compare;
use hysteron_identify::{Family, FitOptions, fit};
use hysteron_report::{Context, comparison_page};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const PERIOD_S: f64 = 5e-5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("say where to write the page")?;
    let mrpi = std::env::args().nth(2).is_some_and(|name| name == "mrpi");
    let family = if mrpi { Family::Mrpi } else { Family::Pi };
    let dataset = dataset();
    let model = fit(&dataset, &FitOptions::new(family), &|_| ())?.model;
    let comparison = compare(&dataset, &model, &|_| ());
    let facts = [
        ("Data", "made-up stage, 15 records".to_owned()),
        ("Model", format!("{family:?}, {} plays", model.thresholds.len())),
    ];
    let command = "cargo run --release -p hysteron-report --example comparison_page -- page.html";
    let context = Context {
        facts: &facts,
        command,
        version: env!("CARGO_PKG_VERSION"),
    };
    std::fs::write(
        path,
        comparison_page("Model against measurement: made-up stage", &comparison, &context),
    )?;
    Ok(())
}

fn dataset() -> Dataset {
    let mut random = Pcg64::seed_from_u64(7);
    let mut records = Vec::new();
    for (role, frequencies) in [
        (Role::Identify, [1.0, 10.0, 30.0, 100.0, 300.0]),
        (Role::Validate, [5.0, 20.0, 50.0, 200.0, 500.0]),
    ] {
        for hz in frequencies {
            let samples = (4.0 / (hz * PERIOD_S)).round().max(4000.0) as usize;
            let drive = (0..samples)
                .map(|k| 65.0 - 60.0 * (TAU * hz * k as f64 * PERIOD_S).cos())
                .collect();
            records.push(record(format!("sine-{hz}hz.csv"), role, drive, &mut random));
        }
    }
    let decaying = (0..20_000)
        .map(|k| {
            let phase = (k as f64 / 2000.0).fract();
            65.0 + 60.0 * (1.0 - k as f64 / 20_000.0) * (1.0 - 4.0 * (phase - 0.5).abs())
        })
        .collect();
    records.push(record(
        "decaying-triangle.csv".into(),
        Role::Identify,
        decaying,
        &mut random,
    ));
    let steps = (0..20_000)
        .map(|k| 5.0 + 20.0 * f64::from((k / 2500 * 3) % 7))
        .collect();
    records.push(record("staircase.csv".into(), Role::Validate, steps, &mut random));
    records.push(record(
        "quiet.csv".into(),
        Role::Validate,
        vec![40.0; 8000],
        &mut random,
    ));
    for (name, role, samples) in [
        ("multisine-short.csv", Role::Identify, 20_000),
        (
            "multisine-one-million-samples-with-a-rather-long-name.csv",
            Role::Validate,
            1_000_000,
        ),
    ] {
        let phases: Vec<f64> = (0..30).map(|_| TAU * random.random::<f64>()).collect();
        let drive = (0..samples)
            .map(|k| {
                let tones = phases.iter().enumerate().map(|(i, phase)| {
                    (TAU * (2 * i + 1) as f64 * 10.0 * k as f64 * PERIOD_S + phase).sin() / (1 + i) as f64
                });
                65.0 + 22.0 * tones.sum::<f64>()
            })
            .collect();
        records.push(record(name.into(), role, drive, &mut random));
    }
    Dataset {
        name: "made-up stage".to_owned(),
        description: String::new(),
        known: Known::default(),
        records,
        notices: Vec::new(),
    }
}

/// Twenty plays with falling weights, a lag of 93 us after them, 2 nm of noise.
fn record(file: String, role: Role, voltage_v: Vec<f64>, random: &mut Pcg64) -> Record {
    let mut plays: Vec<f64> = vec![5.0; 20];
    let mut lagged: Option<f64> = None;
    let share = 1.0 - (-PERIOD_S / 93e-6f64).exp();
    let position_um = voltage_v
        .iter()
        .map(|v| {
            let mut y = 0.12 * v;
            for (index, play) in plays.iter_mut().enumerate() {
                let threshold = 2.0 * index as f64;
                *play = play.clamp(v - threshold, v + threshold);
                y += 0.006 * (-(index as f64) / 10.0).exp() * *play;
            }
            let before = lagged.unwrap_or(y);
            let now = before + share * (y - before);
            lagged = Some(now);
            // The sum of twelve uniform numbers less six is close to normal with unit variance.
            let noise: f64 = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
            now + 0.002 * noise
        })
        .collect();
    Record::new(file, role, PERIOD_S, voltage_v, position_um)
}
