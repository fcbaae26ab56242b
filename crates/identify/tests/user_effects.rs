//! Effects from effect files: they do what their equations say, and nothing that a file may hold makes a panic or a NaN.
#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]

use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::effects::{Effect, Signals, UserEffect};
use hysteron_identify::{Added, Adding, EffectId, FitOptions, IdentifyError, Model, add, check_own_effect, fit};
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Adds an effect of the user's own, reckoning with a nanometre of noise.
fn add_own_effect(
    dataset: &Dataset,
    model: &Model,
    effect: UserEffect,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    check_own_effect(effect, dataset)?;
    let adding = Adding {
        noise_um: 1e-3,
        keep_family: false,
    };
    add(dataset, model, &effect.effect(), adding, progress)
}

const LAG: &str = r#"
name = "my-lag"
place = "structure"
summary = "The target follows the stage through a soft joint."
output = "z"
source = "the joint's stiffness over its damping"
[[parameter]]
name = "tau"
unit = "s"
what = "time constant"
min = 1e-9
max = 1e4
[[state]]
name = "z"
at_rest = "u"
rate = "(u - z) / tau"
"#;

const RIPPLE: &str = r#"
name = "encoder-ripple"
place = "sensor"
summary = "The encoder interpolates unevenly between its lines."
output = "u + a * sin(2 * pi * u / pitch) + b * cos(2 * pi * u / pitch)"
[[parameter]]
name = "a"
unit = "um"
what = "sine part"
min = -0.5
max = 0.5
[[parameter]]
name = "b"
unit = "um"
what = "cosine part"
min = -0.5
max = 0.5
[[parameter]]
name = "pitch"
unit = "um"
what = "distance of the lines"
min = 0.5
max = 5.0
neutral = 1.0
"#;

fn effect(text: &str) -> Arc<dyn Effect> {
    UserEffect::from_toml(text, "my.toml").unwrap().effect()
}

fn signals(period_s: f64, run_in: usize) -> Signals<'static> {
    Signals {
        period_s,
        run_in,
        rested: false,
        fraction: 0.0,
        at_stack_v: &[],
        temperature_c: None,
        voltage2_v: None,
        own: &[],
    }
}

/// Closed form of a lag behind a sine, from the first sample on: slow and fast ones, and one a hundredth of the sample
/// period long, which must follow the input and neither explode nor ring. Straight lines between 200 samples a period cost
/// (w T)^2 / 12 = 8e-5 of the amplitude, the integrator's second order (w T)^2 / 12 of its own; both together 3e-4.
#[test]
fn val_a_state_is_in_its_periodic_steady_state_from_the_first_sample() {
    let (n, w) = (200, TAU / 200.0);
    for tau in [0.01, 3.0, 40.0, 2000.0] {
        let mut y: Vec<f64> = (0..3 * n).map(|k| 2.0 + (w * k as f64).sin()).collect();
        effect(LAG).on_position(&[tau], &signals(1.0, n), &mut y);
        for (k, y) in y.iter().enumerate() {
            let wanted = 2.0 + (w * k as f64 - (w * tau).atan()).sin() / (1.0 + (w * tau).powi(2)).sqrt();
            assert!((y - wanted).abs() < 3e-4, "tau {tau}, sample {k}: {y} {wanted}");
        }
    }
}

/// A step from rest: 1 - exp(-t / tau) at tau of ten samples; the first sample is at rest. The step is a ramp of one sample
/// on straight lines, whose closed form is taken.
#[test]
fn val_a_state_at_rest_answers_a_step() {
    let (tau, n) = (10.0, 100);
    let mut y: Vec<f64> = (0..n).map(|k| if k < 5 { 1.0 } else { 4.0 }).collect();
    effect(LAG).on_position(&[tau], &signals(1.0, 0), &mut y);
    let ramp = |t: f64| if t > 0.0 { t - tau * -(-t / tau).exp_m1() } else { 0.0 };
    for (k, y) in y.iter().enumerate() {
        let t = k as f64 - 4.0;
        let wanted = 1.0 + 3.0 * (ramp(t) - ramp(t - 1.0));
        // Third order a step: 3 x (T/tau)^3 / 12 a step, over tau/T steps.
        assert!((y - wanted).abs() < 3e-3, "{k}: {y} {wanted}");
    }
}

/// Two states: a damped mode against the catalogue's resonance, which is exact on straight lines.
#[test]
fn val_two_states_make_a_mode() {
    let mode = r#"
name = "my-mode"
place = "structure"
summary = "A mass on a spring."
output = "x"
[[parameter]]
name = "f"
unit = "Hz"
what = "frequency"
min = 1.0
max = 5000.0
[[parameter]]
name = "damping"
unit = ""
what = "damping ratio"
min = 0.0
max = 1.0
[[state]]
name = "x"
at_rest = "u"
rate = "speed"
[[state]]
name = "speed"
at_rest = "0"
rate = "(2*pi*f)^2 * (u - x) - 2 * damping * 2*pi*f * speed"
"#;
    let record = |k: usize| 3.0 * (1.0 - (TAU * k as f64 / 500.0).cos());
    let mut own: Vec<f64> = (0..1000).map(record).collect();
    effect(mode).on_position(&[1000.0, 0.05], &signals(2e-5, 500), &mut own);
    let (mut y, w, w0) = (own.iter().enumerate(), TAU * 100.0, TAU * 1000.0);
    let (re, im) = (w0 * w0 - w * w, 2.0 * 0.05 * w0 * w);
    // Closed form at 100 Hz; 50 samples a period of the mode: second order costs (w0 T)^2 / 12 = 0.1 % of what it adds.
    assert!(y.all(|(k, y)| {
        let wanted = 3.0 - 3.0 * w0 * w0 / re.hypot(im) * (w * k as f64 * 2e-5 - im.atan2(re)).cos();
        (y - wanted).abs() < 3e-4
    }));
}

/// A play given by its new value at each sample is the catalogue's backlash, bit for bit.
#[test]
fn val_a_play_is_the_catalogues_backlash() {
    let play = r#"
name = "my-play"
place = "sensor"
summary = "Lost motion."
output = "z"
[[parameter]]
name = "width"
unit = "um"
what = "lost motion"
min = 0.0
max = 1.0
[[state]]
name = "z"
at_rest = "u + width / 2"
next = "max(u - width / 2, min(u + width / 2, z))"
"#;
    let y: Vec<f64> = (0..400)
        .map(|k| (TAU * f64::from(k) / 90.0).sin() * f64::from(k) / 400.0)
        .collect();
    let (mut own, mut wanted) = (y.clone(), y);
    let backlash = EffectId::Backlash.effect();
    effect(play).on_position(&[0.25], &signals(1e-3, 0), &mut own);
    backlash.on_position(&[0.25], &signals(1e-3, 0), &mut wanted);
    assert!(own.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-12));
}

/// Slopes by differences against the catalogue's analytic ones, for a memoryless output and through a state.
#[test]
fn val_changes_go_through_as_the_slope_says() {
    let bend = r#"
name = "my-bend"
place = "sensor"
summary = "A bend."
output = "u + c2 * u^2 + c3 * u^3"
[[parameter]]
name = "c2"
unit = "1/um"
what = "second order"
min = -0.1
max = 0.1
[[parameter]]
name = "c3"
unit = "1/um^2"
what = "third order"
min = -0.1
max = 0.1
"#;
    let y: Vec<f64> = (0..300).map(|k| 4.0 * (TAU * f64::from(k) / 90.0).sin()).collect();
    let change: Vec<f64> = (0..300).map(|k| (f64::from(k) * 0.1).cos()).collect();
    let (mut own, mut wanted) = (change.clone(), change.clone());
    let signals = signals(1e-3, 0);
    let curve = EffectId::SensorNonlinearity.effect();
    effect(bend).on_change(&[0.02, -0.003], &signals, &y, &mut own);
    curve.on_change(&[0.0, 0.02, -0.003], &signals, &y, &mut wanted);
    assert!(own.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-5));
    // A lag is linear: a change goes through as the position does.
    let (mut own, mut wanted) = (change.clone(), change);
    effect(LAG).on_change(&[5e-3], &signals, &y, &mut own);
    effect(LAG).on_position(&[5e-3], &signals, &mut wanted);
    assert!(own.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-6));
}

/// What is not finite counts as 0, wherever it comes up.
#[test]
fn prop_no_equation_makes_a_nan() {
    for (rate, output) in [
        ("1 / (u - u)", "z"),
        ("exp(1e5 * z)", "z + u"),
        ("ln(-1 - z^2)", "sqrt(-1 - z^2)"),
        ("z^2 * 1e30 + gain", "u + 1e308 * z * z"),
        ("-z^3 * 1e12", "1 / z"),
        ("tan(z) * 1e9", "gain * u / (t - t)"),
    ] {
        let text = LAG
            .replace("(u - z) / tau", rate)
            .replace("output = \"z\"", &format!("output = \"{output} + 0 * (tau + z)\""))
            .replace("gain", "tau");
        for (run_in, period_s) in [(0, 1e-3), (40, 1e-3), (40, 1e3)] {
            for input in [0.0, 1.0, f64::MAX, f64::NAN] {
                let mut y: Vec<f64> = (0..80).map(|k| input * f64::from(k % 40)).collect();
                let place = signals(period_s, run_in);
                effect(&text).on_position(&[1e4], &place, &mut y);
                assert!(y.iter().all(|y| y.is_finite()), "{rate}, {output}: {y:?}");
            }
        }
    }
}

fn record(file: &str, role: Role, voltage: impl Fn(f64) -> f64, bend: &dyn Fn(f64) -> f64) -> Record {
    let period_s = 1e-3;
    let voltage_v: Vec<f64> = (0..1000).map(|k| voltage(f64::from(k) * period_s)).collect();
    // Plays of their own, coarser than the fitted ones, with 1 nm of a fixed pattern as noise.
    let mut plays = [2.0, 7.0, 15.0, 30.0].map(|r| (r, 0.0_f64));
    let position_um = voltage_v
        .iter()
        .enumerate()
        .map(|(k, &v)| {
            let mut y = 0.06 * v;
            for (r, z) in &mut plays {
                *z = (v - *r).max(z.min(v));
                y += 0.01 * *z;
            }
            bend(y) + 1e-3 * (k as f64 * 1.9).sin()
        })
        .collect();
    Record::new(file.to_owned(), role, period_s, voltage_v, position_um)
}

fn stage(bend: &dyn Fn(f64) -> f64) -> Dataset {
    let sine = |hz: f64, full: f64| move |t: f64| 0.5 * full * (1.0 - (TAU * hz * t).cos());
    Dataset {
        name: "stage".to_owned(),
        records: vec![
            record("a.csv", Role::Identify, sine(2.0, 100.0), bend),
            record("b.csv", Role::Identify, sine(3.0, 60.0), bend),
            record("c.csv", Role::Validate, sine(2.0, 80.0), bend),
        ],
        ..Dataset::default()
    }
}

/// Amplitude, phase and pitch of a ripple in the reading come out of the fit, from starts spread over the bounds; the model
/// file holds the definition and gives the same answers when it comes back.
#[test]
fn val_a_hidden_ripple_is_found_by_the_fit() {
    let (amplitude, pitch, phase) = (0.12, 1.37, 0.8);
    let dataset = stage(&|y| y + amplitude * (TAU * y / pitch + phase).sin());
    let options = FitOptions::new(hysteron_identify::Family::Mpi);
    let model = fit(&dataset, &options, &|_| {}).unwrap().model;
    let ripple = UserEffect::from_toml(RIPPLE, "ripple.toml").unwrap();
    let added = add_own_effect(&dataset, &model, ripple, &|_| {}).unwrap();
    let value = |i: usize| added.model.effects[0].parameters[i].value;
    assert!((value(2) - pitch).abs() < 0.005, "{:?}", added.model.effects);
    assert!(
        (value(0).hypot(value(1)) - amplitude).abs() < 0.006,
        "{:?}",
        added.model.effects
    );
    assert!(added.after.validate_percent.unwrap() < 0.2 * added.before.validate_percent.unwrap());
    let back = Model::from_toml(&added.model.to_toml(), "model.toml").unwrap();
    assert_eq!(back, added.model);
    let record = &dataset.records[2];
    assert_eq!(back.simulate(record).output, added.model.simulate(record).output);
    // Once is enough, and a definition that was tampered with is refused with the file.
    assert!(
        add_own_effect(&dataset, &back, ripple, &|_| {})
            .unwrap_err()
            .to_string()
            .contains("has it already")
    );
    let tampered = added.model.to_toml().replace("output = \"u +", "output = \"w +");
    let error = Model::from_toml(&tampered, "model.toml").unwrap_err().to_string();
    assert!(
        error.contains("model.toml") && error.contains("unknown name `w`"),
        "{error}"
    );
}

#[test]
fn refuse_what_a_file_may_not_say() {
    for (from, to, says) in [
        (
            "name = \"my-lag\"",
            "name = \"delay\"",
            "name = \"delay\" is taken by the catalogue",
        ),
        (
            "name = \"my-lag\"",
            "name = \"My Lag\"",
            "allowed are lower-case letters, digits and hyphens",
        ),
        ("\"structure\"", "\"hysteresis\"", "the plays have a memory"),
        (
            "\"structure\"",
            "\"here\"",
            "place = \"here\"; allowed are delay, amplifier",
        ),
        (
            "output = \"z\"",
            "output = \"z + y\"",
            "output = \"z + y\": column 5: unknown name `y`; known here are u, du, t, v,",
        ),
        ("output = \"z\"", "", "missing field `output`"),
        ("output = \"z\"", "output = \"u\"", "`z` moves nothing"),
        ("output = \"z\"", "ouput = \"z\"", "line 5"),
        (
            "min = 1e-9",
            "min = 1e5",
            "parameter `tau`: min = 100000 must be below max = 10000",
        ),
        ("min = 1e-9", "min = nan", "parameter `tau`: min = NaN; allowed is"),
        ("max = 1e4", "max = inf", "parameter `tau`: max = inf; allowed is"),
        (
            "max = 1e4",
            "max = 1e4\nneutral = 2e4",
            "parameter `tau`: neutral = 20000; allowed is min to max",
        ),
        ("max = 1e4", "max = 1e4\nstarts = []", "starts has 0 values"),
        (
            "max = 1e4",
            "max = 1e4\nstarts = [0.5, -1]",
            "parameter `tau`: starts = -1; allowed is min to max",
        ),
        ("name = \"tau\"", "name = \"sin\"", "`sin` means something else"),
        ("name = \"tau\"", "name = \"z\"", "`z` stands twice"),
        (
            "name = \"tau\"",
            "name = \"Tau\"",
            "`Tau` cannot be a parameter's or a state's name",
        ),
        ("rate = \"(u - z) / tau\"", "", "state `z` needs one of the two"),
        (
            "rate = \"(u",
            "next = \"z\"\nrate = \"(u",
            "state `z` needs one of the two",
        ),
        (
            "at_rest = \"u\"",
            "at_rest = \"z\"",
            "state `z`: at_rest = \"z\": column 1: unknown name `z`",
        ),
        (
            "summary = \"The target follows the stage through a soft joint.\"",
            "summary = \" \"",
            "summary is empty",
        ),
    ] {
        let error = UserEffect::from_toml(&LAG.replacen(from, to, 1), "my.toml")
            .unwrap_err()
            .to_string();
        assert!(error.starts_with("my.toml: ") && error.contains(says), "{to}: {error}");
    }
    let before = LAG.replace("structure", "amplifier").replace("(u - z)", "(v - z)");
    let error = UserEffect::from_toml(&before, "my.toml").unwrap_err().to_string();
    assert!(error.contains("its input is u"), "{error}");
    let dataset = stage(&|y| y);
    for (variable, column) in [
        ("temperature", "temperature column"),
        ("v2", "voltage of the other axis"),
    ] {
        let text = LAG.replace("output = \"z\"", &format!("output = \"z + {variable}\""));
        let effect = UserEffect::from_toml(&text, "my.toml").unwrap();
        let error = check_own_effect(effect, &dataset).unwrap_err().to_string();
        assert!(error.contains("my-lag") && error.contains(column), "{error}");
        let model = fit(&dataset, &FitOptions::new(hysteron_identify::Family::Pi), &|_| {})
            .unwrap()
            .model;
        let error = add_own_effect(&dataset, &model, effect, &|_| {})
            .unwrap_err()
            .to_string();
        assert!(error.contains(column), "{error}");
    }
}

/// Two thousand seeded mutations of good files: bytes changed, lines lost, doubled and swapped, pieces of other files put in.
/// None panics, all that are accepted run to finite numbers, and every refusal names the file.
#[test]
fn prop_no_mutation_of_a_file_panics() {
    let mut rng = rand_pcg::Pcg64::seed_from_u64(20);
    let pieces = [
        "u", "z", "^", "(", ")", "*", "-", "1e300", "tau", "exp(", ",", "0", "nan", "[", "\"", "µ", "max(", "v2",
    ];
    let mut accepted = 0;
    for round in 0..2000 {
        let text = if round % 2 == 0 { LAG } else { RIPPLE };
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        for _ in 0..rng.random_range(1..4) {
            let (i, j) = (rng.random_range(0..lines.len()), rng.random_range(0..lines.len()));
            match rng.random_range(0..6) {
                0 => drop(lines.remove(i)),
                1 => lines.swap(i, j),
                2 => lines.insert(i, lines[j].clone()),
                _ => {
                    let places: Vec<usize> = lines[i].char_indices().map(|(at, _)| at).collect();
                    if !places.is_empty() {
                        let at = places[rng.random_range(0..places.len())];
                        if rng.random_bool(0.5) {
                            lines[i].remove(at);
                        }
                        lines[i].insert_str(at, pieces[rng.random_range(0..pieces.len())]);
                    }
                }
            }
        }
        match UserEffect::from_toml(&lines.join("\n"), "mutant.toml") {
            Err(error) => assert!(error.to_string().starts_with("mutant.toml: "), "{error}"),
            Ok(mutant) => {
                accepted += 1;
                let effect = mutant.effect();
                let mut y: Vec<f64> = (0..60).map(|k| f64::from(k % 20)).collect();
                let values = vec![0.3; effect.description().parameters.len()];
                let signals = signals(1e-3, 20);
                effect.on_voltage(&values, &signals, &mut y);
                let position = y.clone();
                effect.on_position(&values, &signals, &mut y);
                assert!(y.iter().all(|y| y.is_finite()));
                effect.on_change(&values, &signals, &position, &mut y);
                assert!(y.iter().all(|y| y.is_finite()));
            }
        }
    }
    // Otherwise the mutations would test the TOML reader alone.
    assert!(accepted > 50, "{accepted}");
}
