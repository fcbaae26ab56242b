//! Every effect of the catalogue added to a model of a stage that has it: the physics of `hysteron_plant` shares no code
//! with the blocks that are fitted. The error must come down to what the same model leaves of the stage without the
//! effect, and the parameters must be the stage's.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its stage fails")]

use hysteron_data::{Dataset, Record, Role};
use hysteron_excitation::{Excitation, Multisine, Sine, with_rise};
use hysteron_identify::control::{RecordedHold, chain_of};
use hysteron_identify::{Added, Adding, EffectId, Family, FitOptions, IdentifyError, Model, add, effects, fit};
use hysteron_plant::hysteresis::{MaxwellSlip, SigmoidPlays};
use hysteron_plant::{
    AmplitudeGain, Asymmetry, Backlash, Creep, CrossCoupling, CurrentLimit, EndStop, Hysteresis, Initial,
    KelvinVoigtElement, MainsHum, Mode, RateDependence, SensorNonlinearity, Stage, StageConfig, Temperature,
    ThermalDrift,
};
use rand::SeedableRng;
use std::f64::consts::TAU;

/// Adds an effect of the catalogue, reckoning with a nanometre of noise.
fn add_effect(
    dataset: &Dataset,
    model: &Model,
    effect: EffectId,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    let adding = Adding {
        noise_um: 1e-3,
        keep_family: false,
    };
    add(dataset, model, &effects::find(effect), adding, progress)
}

const FULL_V: f64 = 100.0;
const STROKE_UM: f64 = 10.0;

/// A stack of twelve Maxwell elements with 1 nm of sensor noise and nothing else.
fn stage() -> StageConfig {
    let slip_v: Vec<f64> = (0..12).map(|i| 5.5 * 1.2_f64.powi(i)).collect();
    let family = hysteron_plant::Family::MaxwellSlip(MaxwellSlip {
        loop_opening: 0.12,
        stiffness: slip_v.iter().map(|_| 1.0).collect(),
        slip_v,
    });
    with_family(family)
}

fn with_family(family: hysteron_plant::Family) -> StageConfig {
    let mut config = StageConfig::bare(Hysteresis {
        stroke_um: STROKE_UM,
        reference_v: FULL_V,
        initial: Initial::Conditioned,
        family,
    });
    config.sensor.noise_rms_um = 1e-3;
    config
}

/// What is played, each from rest at 0 V: name, role, sample period, voltage.
fn programme() -> Vec<(&'static str, Role, f64, Vec<f64>)> {
    let sine = |frequency_hz, high_v, periods, period_s| {
        let sine = Sine {
            frequency_hz,
            low_v: 0.0,
            high_v,
            periods,
        };
        sine.samples(period_s).unwrap()
    };
    let multisine = |seed| {
        let multisine = Multisine {
            low_hz: 10.0,
            high_hz: 2000.0,
            period_s: 0.1,
            periods: 2,
            bias_v: 50.0,
            peak_v: 20.0,
            seed,
        };
        with_rise(&multisine.samples(2e-5).unwrap(), 0.02, 2e-5).unwrap()
    };
    let holds = |levels: &[f64]| levels.iter().flat_map(|&v| vec![v; 2500]).collect::<Vec<_>>();
    use Role::{Identify, Validate};
    vec![
        ("sine-10hz", Identify, 2e-4, sine(10.0, FULL_V, 3.0, 2e-4)),
        ("sine-10hz-a40", Identify, 2e-4, sine(10.0, 40.0, 3.0, 2e-4)),
        ("sine-200hz", Identify, 2e-5, sine(200.0, FULL_V, 10.0, 2e-5)),
        ("multisine", Identify, 2e-5, multisine(1)),
        ("holds", Identify, 2e-3, holds(&[0.0, 90.0, 30.0])),
        ("quiet", Identify, 2e-4, vec![0.0; 5000]),
        ("sine-50hz", Validate, 1e-4, sine(50.0, FULL_V, 5.0, 1e-4)),
        ("sine-400hz-a70", Validate, 2e-5, sine(400.0, 70.0, 15.0, 2e-5)),
        ("multisine-2", Validate, 2e-5, multisine(2)),
        ("holds-2", Validate, 2e-3, holds(&[0.0, 60.0, 10.0])),
    ]
}

/// Records the programme on a stage, with rests at 0 V in between.
fn record(config: &StageConfig) -> Dataset {
    play(config, programme())
}

fn play(config: &StageConfig, programme: Vec<(&'static str, Role, f64, Vec<f64>)>) -> Dataset {
    let mut stage = Stage::new(config, 7).unwrap();
    let with_axis = config.cross_coupling.is_some();
    let records = programme.into_iter().map(|(name, role, period_s, voltage_v)| {
        stage.move_and_rest(FULL_V, 0.05, 0.0).unwrap();
        stage.move_and_rest(0.0, 0.05, 60.0).unwrap();
        // The other axis goes its own way.
        let other: Vec<f64> = (0..voltage_v.len())
            .map(|k| 50.0 + 40.0 * (TAU * 7.3 * k as f64 / voltage_v.len() as f64).sin())
            .collect();
        let run = if with_axis {
            stage.run_two_axes(&voltage_v, &other, period_s).unwrap()
        } else {
            stage.run(&voltage_v, period_s).unwrap()
        };
        Record {
            file: format!("{name}.csv"),
            role,
            excitation: name.to_owned(),
            start_s: 0.0,
            period_s,
            voltage_v,
            position_um: run.position_um,
            reference_um: None,
            temperature_c: run.temperature_c,
            voltage2_v: with_axis.then_some(other),
        }
    });
    Dataset {
        name: "stage".into(),
        records: records.collect(),
        ..Dataset::default()
    }
}

fn start(dataset: &Dataset) -> Model {
    fit(dataset, &FitOptions::new(Family::Pi), &|_| ()).unwrap().model
}

/// The pooled validation error that a model leaves.
fn validation_percent(dataset: &Dataset, model: &Model) -> f64 {
    let errors = hysteron_identify::record_errors(dataset, model);
    let squares: Vec<f64> = errors
        .iter()
        .filter(|e| e.role == Role::Validate)
        .filter_map(|e| e.percent.map(|p| p * p))
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Adds an effect to the stage and to the model; checks the error against the stage without the effect.
fn added(name: EffectId, with: impl Fn(&mut StageConfig)) -> Added {
    added_to(&stage(), &FitOptions::new(Family::Pi), name, &[], with)
}

/// The same with as many plays as the free shape: what fewer leave of the loops takes its part of a bend.
fn added_to_many_plays(name: EffectId, with: impl Fn(&mut StageConfig)) -> Added {
    let many = FitOptions {
        plays: hysteron_identify::family::FREE_PLAYS,
        ..FitOptions::new(Family::Pi)
    };
    added_to(&stage(), &many, name, &[], with)
}

/// The same from another start; `truth` are the effect's parameters where its equation is not quite the stage's, so that
/// even these leave more than the noise.
fn added_to(
    stage: &StageConfig,
    options: &FitOptions,
    name: EffectId,
    truth: &[f64],
    with: impl Fn(&mut StageConfig),
) -> Added {
    let start = |dataset: &Dataset| fit(dataset, options, &|_| ()).unwrap().model;
    let bare = record(stage);
    let mut known = start(&bare);
    let mut floor = validation_percent(&bare, &known);
    let mut config = stage.clone();
    with(&mut config);
    let dataset = record(&config);
    let added = add_effect(&dataset, &start(&dataset), name, &|_| ()).unwrap();
    if !truth.is_empty() {
        known.effects.clone_from(&added.model.effects);
        for (parameter, &value) in known.effects[0].parameters.iter_mut().zip(truth) {
            parameter.value = value;
        }
        floor = floor.max(validation_percent(&dataset, &known));
    }
    let (before, after) = (
        added.before.validate_percent.unwrap(),
        added.after.validate_percent.unwrap(),
    );
    assert!(before > 2.0 * floor, "{name} does not show: {before} {floor}");
    assert!(
        after < 1.5 * floor,
        "{name}: {before} -> {after}, without the effect {floor}"
    );
    added
}

fn value(added: &Added, effect: EffectId, parameter: &str) -> f64 {
    let fitted = added.model.effects.iter().find(|e| e.name == effect).unwrap();
    fitted.parameters.iter().find(|p| p.name == parameter).unwrap().value
}

fn close(found: f64, wanted: f64, share: f64) {
    assert!((found - wanted).abs() <= share * wanted.abs(), "{found} {wanted}");
}

#[test]
fn val_delay() {
    let added = added(EffectId::Delay, |stage| stage.delay_s = 60e-6);
    close(value(&added, EffectId::Delay, "delay"), 60e-6, 0.03);
}

#[test]
fn val_first_order_lag() {
    let added = added(EffectId::FirstOrderLag, |stage| stage.amplifier.lag_s = 80e-6);
    // Before and after the hysteresis differ by less than a hundredth of it: the sum is determined.
    let sum =
        value(&added, EffectId::FirstOrderLag, "amplifier_tau") + value(&added, EffectId::FirstOrderLag, "sensor_tau");
    close(sum, 80e-6, 0.05);
}

/// A lag of 60 us at 0 V that grows by 0.45 us a volt: added once more, it grows, and what is left falls to what the model leaves of the stage without it. A controller's lead grows alike.
#[test]
fn val_a_lag_that_grows_with_the_voltage() {
    let bare = record(&stage());
    let floor = validation_percent(&bare, &start(&bare));
    let mut config = stage();
    (config.amplifier.lag_s, config.amplifier.lag_growth_per_v) = (60e-6, 7.5e-3);
    let dataset = record(&config);
    let constant = add_effect(&dataset, &start(&dataset), EffectId::FirstOrderLag, &|_| ()).unwrap();
    let left = |added: &Added| added.after.validate_percent.unwrap();
    assert!(left(&constant) > 2.0 * floor, "{} {floor}", left(&constant));
    let growing = add_effect(&dataset, &constant.model, EffectId::FirstOrderLag, &|_| ()).unwrap();
    assert!(left(&growing) < 1.5 * floor, "{} {floor}", left(&growing));
    let lag = |parameter| value(&growing, EffectId::FirstOrderLag, parameter);
    close(lag("tau_per_v"), 0.45e-6, 0.1);
    close(lag("amplifier_tau") + lag("sensor_tau"), 60e-6, 0.1);
    let refused = add_effect(&dataset, &growing.model, EffectId::FirstOrderLag, &|_| ());
    assert!(refused.is_err());
    let (chain, _) = chain_of(&growing.model, 2e-5, [0.0, FULL_V], RecordedHold::AccountedFor).unwrap();
    let [about_v, per_v] = chain.linear.lag_growth.unwrap();
    close(about_v, 50.0, 0.1);
    close(per_v * chain.linear.lag_s, 0.45e-6, 0.1);
    close(
        chain.linear.lag_s + chain.around.sensor_lag_s,
        60e-6 + 0.45e-6 * about_v,
        0.1,
    );
}

#[test]
fn val_slew_limit() {
    // A full sine of 200 Hz asks for 63 kV/s.
    let limit = CurrentLimit {
        current_a: 0.099,
        sink_a: None,
        capacitance_uf: 1.8,
    };
    let pi = FitOptions::new(Family::Pi);
    let added = added_to(&stage(), &pi, EffectId::SlewLimit, &[55e3], |stage| {
        stage.amplifier.current_limit = Some(limit)
    });
    close(value(&added, EffectId::SlewLimit, "slew"), 55e3, 0.02);
    assert_eq!(value(&added, EffectId::SlewLimit, "falling"), 0.0);
}

/// An amplifier that takes less current than it gives: one limit helps, added once more it is two.
#[test]
fn val_a_slew_limit_of_unequal_sides() {
    let limit = CurrentLimit {
        current_a: 0.099,
        sink_a: Some(0.063),
        capacitance_uf: 1.8,
    };
    let mut config = stage();
    config.amplifier.current_limit = Some(limit);
    let dataset = record(&config);
    let start = fit(&dataset, &FitOptions::new(Family::Pi), &|_| ()).unwrap().model;
    let equal = add_effect(&dataset, &start, EffectId::SlewLimit, &|_| ()).unwrap();
    let unequal = add_effect(&dataset, &equal.model, EffectId::SlewLimit, &|_| ()).unwrap();
    let slew = |name: &str| value(&unequal, EffectId::SlewLimit, name);
    close(slew("slew"), 55e3, 0.03);
    close(slew("falling"), 35e3, 0.03);
    let left = |added: &Added| added.after.identify_percent.unwrap();
    assert!(
        left(&unequal) < 0.5 * left(&equal),
        "{} {}",
        left(&unequal),
        left(&equal)
    );
    assert!(add_effect(&dataset, &unequal.model, EffectId::SlewLimit, &|_| ()).is_err());
}

#[test]
fn val_saturation_of_the_amplifier() {
    let added = added(EffectId::Saturation, |stage| stage.amplifier.max_v = 88.0);
    close(value(&added, EffectId::Saturation, "rail_high"), 88.0, 0.01);
}

#[test]
fn val_saturation_by_an_end_stop() {
    let stop = EndStop {
        min_um: -1.0,
        max_um: 8.5,
    };
    let added = added(EffectId::Saturation, |stage| stage.end_stop = Some(stop));
    close(value(&added, EffectId::Saturation, "stop_high"), 8.5, 0.01);
}

#[test]
fn val_rate_dependence() {
    let rate = RateDependence::Envelope {
        alpha_s: 50e-6,
        beta_s: 35e-6,
    };
    // The stage widens its irreversible part, all of it; the effect the plays wider than a twentieth of the span.
    let pi = FitOptions::new(Family::Pi);
    let added = added_to(&stage(), &pi, EffectId::RateDependence, &[50e-6, 35e-6], |stage| {
        stage.rate_dependence = Some(rate.clone())
    });
    // Ten plays stand for twelve: the envelope comes out a little off.
    close(value(&added, EffectId::RateDependence, "alpha"), 50e-6, 0.2);
    close(value(&added, EffectId::RateDependence, "beta"), 35e-6, 0.2);
}

#[test]
fn val_asymmetry() {
    let (quadratic, cubic) = (0.06, 0.04);
    let added = added_to_many_plays(EffectId::Asymmetry, |stage| {
        stage.asymmetry = Some(Asymmetry { quadratic, cubic })
    });
    // Against the middle of the voltages, 50 V: b2 = S (c2 / V^2 + 3 c3 50 / V^3).
    let b2 = STROKE_UM * (quadratic + 1.5 * cubic) / FULL_V.powi(2);
    close(value(&added, EffectId::Asymmetry, "quadratic"), b2, 0.05);
    close(
        value(&added, EffectId::Asymmetry, "cubic"),
        STROKE_UM * cubic / FULL_V.powi(3),
        0.2,
    );
}

/// Five plays from nothing in equal steps: what is narrower than 20 V is a straight line to them.
fn coarse() -> FitOptions {
    FitOptions {
        plays: 5,
        placement: hysteron_identify::Placement::Eq16,
        ..FitOptions::new(Family::Pi)
    }
}

#[test]
fn val_amplitude_gain() {
    let mut config = stage();
    config.amplitude_gain = Some(AmplitudeGain {
        gain_at_full_cycle: 0.5,
    });
    // Small strokes, below the tenth of the range where the first play of ten in equal steps stands.
    let small = |high_v, periods| {
        let sine = Sine {
            frequency_hz: 10.0,
            low_v: 0.0,
            high_v,
            periods,
        };
        sine.samples(2e-4).unwrap()
    };
    let mut programme = programme();
    for (name, role, high_v) in [
        ("sine-a4", Role::Identify, 4.0),
        ("sine-a8", Role::Identify, 8.0),
        ("sine-a6", Role::Validate, 6.0),
    ] {
        programme.push((name, role, 2e-4, small(high_v, 3.0)));
    }
    let dataset = play(&config, programme);
    let ten = FitOptions { plays: 10, ..coarse() };
    let model = fit(&dataset, &ten, &|_| ()).unwrap().model;
    let added = add_effect(&dataset, &model, EffectId::AmplitudeGain, &|_| ()).unwrap();
    let plays = added.model.thresholds.len();
    assert!(plays > 14, "{plays}");
    // As many plays where these records exercise them.
    let options = FitOptions {
        plays,
        ..FitOptions::new(Family::Pi)
    };
    let known = validation_percent(&dataset, &fit(&dataset, &options, &|_| ()).unwrap().model);
    let (before, after) = (
        added.before.validate_percent.unwrap(),
        added.after.validate_percent.unwrap(),
    );
    assert!(after < 0.9 * before && after < 1.5 * known, "{before} {after} {known}");
}

#[test]
fn val_hysteresis_shape() {
    let mut rng = rand_pcg::Pcg64::seed_from_u64(3);
    let family = hysteron_plant::Family::SigmoidPlays(SigmoidPlays::random(&mut rng, FULL_V));
    let dataset = record(&with_family(family));
    let added = add_effect(&dataset, &start(&dataset), EffectId::HysteresisShape, &|_| ()).unwrap();
    let options = FitOptions {
        plays: 18,
        ..FitOptions::new(Family::PlayPolynomial)
    };
    let known = fit(&dataset, &options, &|_| ()).unwrap().model;
    let (after, known) = (
        added.after.validate_percent.unwrap(),
        validation_percent(&dataset, &known),
    );
    assert_eq!(added.model.family, Family::PlayPolynomial);
    assert!(after < 1.5 * known && after < 0.5 * added.before.validate_percent.unwrap());
}

#[test]
fn val_creep() {
    let element = |share, time_constant_s| KelvinVoigtElement { share, time_constant_s };
    let added = added(EffectId::Creep, |stage| {
        stage.creep = Some(Creep::KelvinVoigt {
            elements: vec![element(0.03, 0.2), element(0.02, 2.0)],
        });
    });
    // The elements stand a decade apart; which of them are used is the search's choice.
    let first_tau = value(&added, EffectId::Creep, "first_tau");
    for (wanted_share, wanted_tau) in [(0.03, 0.2), (0.02, 2.0)] {
        let shares = (0..4).filter_map(|i| {
            let tau = first_tau * 10f64.powi(i);
            let share = value(&added, EffectId::Creep, &format!("share_{}", i + 1));
            ((tau / wanted_tau).ln().abs() < 0.2).then_some(share)
        });
        close(shares.sum(), wanted_share, 0.1);
    }
}

/// Creep on a sine from its lowest point on, closed forms of one element: from rest it approaches the settled one by its exponential,
/// and the settled one repeats from period to period.
#[test]
fn val_creep_goes_on_from_rest_and_repeats_where_it_has_settled() {
    let (samples, period_s, tau_s, share) = (1000, 1e-3, 0.4, 0.05);
    let w = TAU / (samples as f64 * period_s);
    // Two periods behind a run-in.
    let crept = |rested: bool| {
        let mut position: Vec<f64> = (0..3 * samples)
            .map(|k| 5.0 * (1.0 - (w * k as f64 * period_s).cos()))
            .collect();
        let signals = effects::Signals {
            period_s,
            run_in: samples,
            rested,
            fraction: 0.0,
            at_stack_v: &[],
            temperature_c: None,
            voltage2_v: None,
            own: &[],
        };
        let creep = EffectId::Creep.effect();
        creep.on_position(&[tau_s, share, 0.0, 0.0, 0.0], &signals, &mut position);
        position.split_off(samples)
    };
    // x' = (u - x) / tau for u = 5 (1 - cos w t).
    let settled = |t: f64| 5.0 - 5.0 * ((w * t).cos() + w * tau_s * (w * t).sin()) / (1.0 + (w * tau_s).powi(2));
    for (rested, position) in [(true, crept(true)), (false, crept(false))] {
        for (k, y) in position.iter().enumerate() {
            let t = k as f64 * period_s;
            let start = if rested {
                -settled(0.0) * (-t / tau_s).exp()
            } else {
                0.0
            };
            let wanted = 5.0 * (1.0 - (w * t).cos()) + share * (settled(t) + start);
            assert!((y - wanted).abs() < 1e-5, "{rested} {k}: {y} {wanted}");
        }
    }
}

#[test]
fn val_resonance() {
    let mode = Mode {
        frequency_hz: 800.0,
        damping: 0.02,
        share: 1.0,
    };
    let added = added(EffectId::Resonance, |stage| stage.modes = vec![mode]);
    close(value(&added, EffectId::Resonance, "frequency"), 800.0, 0.005);
    close(value(&added, EffectId::Resonance, "damping"), 0.02, 0.1);
}

#[test]
fn val_cross_coupling() {
    let other = Hysteresis {
        stroke_um: STROKE_UM,
        reference_v: FULL_V,
        initial: Initial::Conditioned,
        family: hysteron_plant::Family::Linear,
    };
    let added = added(EffectId::CrossCoupling, |stage| {
        stage.cross_coupling = Some(CrossCoupling {
            ratio: 0.03,
            lag_s: 0.0,
            hysteresis: other.clone(),
            mode: None,
        });
    });
    let gain = value(&added, EffectId::CrossCoupling, "gain") + value(&added, EffectId::CrossCoupling, "play_weight");
    close(gain, 0.03 * STROKE_UM / FULL_V, 0.03);
}

#[test]
fn val_thermal_drift() {
    let added = added(EffectId::ThermalDrift, |stage| {
        stage.temperature = Some(Temperature {
            start_c: 22.0,
            drift_k_per_h: 2.0,
            warm_up_k: 1.5,
            warm_up_s: 400.0,
            swing_k: 0.0,
            swing_period_s: 600.0,
            noise_rms_k: 0.002,
            resolution_k: 0.001,
        });
        stage.thermal_drift = Some(ThermalDrift {
            position_um_per_k: 0.2,
            gain_percent_per_k: 0.0,
            lag_s: 0.0,
        });
    });
    // The rests before the records take over what the temperature says between them: the shift is what it does within.
    let shift = &added.model.effects[0].parameters[2];
    let error = shift.standard_error.unwrap();
    assert!(error < 0.05 && (shift.value - 0.2).abs() < 2.0 * error, "{shift:?}");
}

/// Where nobody recorded the temperature, what the stage drifts between records shows in the rest before each.
#[test]
fn val_thermal_drift_of_unknown_temperature() {
    let floor = {
        let bare = record(&stage());
        validation_percent(&bare, &start(&bare))
    };
    let mut config = stage();
    config.thermal_drift = Some(ThermalDrift {
        position_um_per_k: 0.2,
        gain_percent_per_k: 0.0,
        lag_s: 0.0,
    });
    config.temperature = Some(Temperature {
        start_c: 22.0,
        drift_k_per_h: 12.0,
        warm_up_k: 0.0,
        warm_up_s: 400.0,
        swing_k: 0.0,
        swing_period_s: 600.0,
        noise_rms_k: 0.002,
        resolution_k: 0.001,
    });
    let mut dataset = record(&config);
    for record in &mut dataset.records {
        record.temperature_c = None;
    }
    let added = add_effect(&dataset, &start(&dataset), EffectId::ThermalDrift, &|_| ()).unwrap();
    let (before, after) = (
        added.before.validate_percent.unwrap(),
        added.after.validate_percent.unwrap(),
    );
    assert!(before > 5.0 * floor, "{before} {floor}");
    assert!(after < 1.5 * floor, "{before} -> {after}, without the effect {floor}");
    close(value(&added, EffectId::ThermalDrift, "rest_share"), 1.0, 0.05);
    let units: Vec<&str> = added.model.effects[0]
        .parameters
        .iter()
        .map(|p| p.unit.as_str())
        .collect();
    assert_eq!(units, ["degC", "s", "um/h", "1/h", ""]);
    let read = Model::from_toml(&added.model.to_toml(), "m.toml").unwrap();
    assert_eq!(read.effects, added.model.effects);
}

#[test]
fn val_mains_hum() {
    for frequency_hz in [50.03, 59.91] {
        let added = added(EffectId::MainsHum, |stage| {
            stage.mains_hum = Some(MainsHum {
                frequency_hz,
                amplitudes_um: vec![0.12, 0.0, 0.05],
            });
        });
        // Half a second of the quiet record resolves 0.05 Hz at this noise.
        assert!((value(&added, EffectId::MainsHum, "frequency") - frequency_hz).abs() < 0.01);
        close(value(&added, EffectId::MainsHum, "amplitude_1"), 0.12, 0.03);
        close(value(&added, EffectId::MainsHum, "amplitude_3"), 0.05, 0.05);
    }
}

#[test]
fn regress_an_envelope_that_imitated_a_lag_gives_way_to_the_lag() {
    let mut lagging = stage();
    lagging.amplifier.lag_s = 120e-6;
    let dataset = record(&lagging);
    let model = fit(&dataset, &FitOptions::new(Family::Mrpi), &|_| {}).unwrap().model;
    let keeping = Adding {
        noise_um: 1e-3,
        keep_family: true,
    };
    let added = add(
        &dataset,
        &model,
        &effects::find(EffectId::FirstOrderLag),
        keeping,
        &|_| {},
    )
    .unwrap();
    let widest = |model: &Model| model.envelope.map(|e| e.alpha_s.max(e.beta_s)).unwrap();
    assert!(widest(&model) > 60e-6, "{:?}", model.envelope);
    // Of less than a sample of 20 us these records do not tell it from the lag.
    assert!(widest(&added.model) < 20e-6, "{:?}", added.model.envelope);
    let (after, before) = (
        added.after.validate_percent.unwrap(),
        added.before.validate_percent.unwrap(),
    );
    assert!(after < 0.25 * before, "{before} {after}");
    // The free shape has no envelope of its own.
    let shaped = add_effect(&dataset, &model, EffectId::HysteresisShape, &|_| {})
        .unwrap()
        .model;
    assert_eq!(shaped.envelope, None);
}

#[test]
fn val_backlash() {
    // Narrow plays of a hysteresis would stand in for it: it is one with one large weight.
    let linear = with_family(hysteron_plant::Family::Linear);
    let added = added_to(&linear, &coarse(), EffectId::Backlash, &[], |stage| {
        stage.backlash = Some(Backlash { width_um: 0.4 });
    });
    close(value(&added, EffectId::Backlash, "width"), 0.4, 0.03);
}

#[test]
fn val_sensor_nonlinearity() {
    let curve = SensorNonlinearity {
        quadratic: 0.05,
        cubic: 0.0,
        full_scale_um: STROKE_UM,
    };
    let added = added_to_many_plays(EffectId::SensorNonlinearity, |stage| {
        stage.sensor.nonlinearity = Some(curve)
    });
    // At the middle of the stroke the reading's slope is 1.05, with which the model's micrometres are scaled.
    close(
        value(&added, EffectId::SensorNonlinearity, "quadratic"),
        0.05 / STROKE_UM,
        0.15,
    );
}

/// Records of a mode of 80 Hz and 3 % with a force beside its straight spring: `force` gets displacement, rate over w and what the force
/// remembers, and gives the force over the stiffness and the memory's slope with the displacement's. From the mode's equation by
/// Runge and Kutta's fourth-order rule, forty steps a sample.
fn within_a_mode(force: impl Fn([f64; 3]) -> [f64; 2]) -> Dataset {
    const FINE: usize = 40;
    let (rate_hz, zeta) = (2000.0, 0.03);
    let angle = TAU * 80.0 / rate_hz / FINE as f64;
    let slopes = |x: [f64; 3], u: f64| {
        let [added, memory] = force(x);
        [x[1], u - x[0] - added - 2.0 * zeta * x[1], memory]
    };
    let add = |x: [f64; 3], d: [f64; 3], h: f64| [x[0] + h * d[0], x[1] + h * d[1], x[2] + h * d[2]];
    let mut rng = rand_pcg::Pcg64::seed_from_u64(3);
    let mut dataset = Dataset::default();
    for (file, role, peak_v, seed) in [
        ("large", Role::Identify, 45.0, 1),
        ("small", Role::Identify, 15.0, 2),
        ("between", Role::Validate, 30.0, 3),
    ] {
        let multisine = Multisine {
            low_hz: 5.0,
            high_hz: 200.0,
            period_s: 1.0,
            periods: 1,
            bias_v: 50.0,
            peak_v,
            seed,
        };
        let played = with_rise(&multisine.samples(1.0 / rate_hz).unwrap(), 0.2, 1.0 / rate_hz).unwrap();
        let voltage_v = [vec![0.0; 100], played].concat();
        let mut x = [0.0; 3];
        let mut position_um = vec![0.0];
        for pair in voltage_v.windows(2) {
            for i in 0..FINE {
                let at = |part: f64| 0.1 * (pair[0] + (pair[1] - pair[0]) * (i as f64 + part) / FINE as f64);
                let a = slopes(x, at(0.0));
                let b = slopes(add(x, a, 0.5 * angle), at(0.5));
                let c = slopes(add(x, b, 0.5 * angle), at(0.5));
                let d = slopes(add(x, c, angle), at(1.0));
                for (n, value) in x.iter_mut().enumerate() {
                    *value += angle / 6.0 * (a[n] + 2.0 * b[n] + 2.0 * c[n] + d[n]);
                }
            }
            position_um.push(x[0]);
        }
        position_um
            .iter_mut()
            .for_each(|y| *y += 1e-3 * (rand::RngExt::random_range(&mut rng, -1.7..1.7_f64)));
        dataset
            .records
            .push(Record::new(file, role, 1.0 / rate_hz, voltage_v, position_um));
    }
    dataset
}

/// The effect added to ten plays, which the stage does not have: what is left must come down to the noise of 1 nm.
fn added_within_a_mode(dataset: &Dataset, add: impl Fn(&Model) -> Added) -> Added {
    let start = fit(dataset, &FitOptions::new(Family::Pi), &|_| ()).unwrap().model;
    let added = add(&start);
    let before = validation_percent(dataset, &start);
    let after = validation_percent(dataset, &added.model);
    assert!(after < 0.05 && before > 20.0 * after, "{before} {after}");
    added
}

#[test]
fn val_nonlinear_stiffness() {
    // 1 at the middle of the stroke, 1.5 at its ends: 0.02 of x^2 about 5 um.
    let dataset = within_a_mode(|[q, ..]| [0.02 / 3.0 * ((q - 5.0).powi(3) + 125.0), 0.0]);
    let added = added_within_a_mode(&dataset, |start| {
        add_effect(&dataset, start, EffectId::NonlinearStiffness, &|_| ()).unwrap()
    });
    let of = |name| value(&added, EffectId::NonlinearStiffness, name);
    close(of("curve") / of("half_stroke").powi(2), 0.02, 0.1);
    close(of("damping"), 0.03, 0.1);
}

#[test]
fn val_friction() {
    let (level, presliding) = (0.3, 0.05);
    let dataset = within_a_mode(|[_, p, z]| [z, level / presliding * p - p.abs() * z / presliding]);
    let added = added_within_a_mode(&dataset, |start| {
        add_effect(&dataset, start, EffectId::Friction, &|_| ()).unwrap()
    });
    let of = |name| value(&added, EffectId::Friction, name);
    close(of("level") * (1.0 + of("sticking")), level, 0.1);
    close(of("frequency"), 80.0, 0.01);
}

#[test]
fn val_mode_hysteresis() {
    let dataset = within_a_mode(|[_, p, z]| [z, 0.8 * p - 0.4 * p.abs() * z + 0.2 * p * z.abs()]);
    let added = added_within_a_mode(&dataset, |start| {
        add_effect(&dataset, start, EffectId::ModeHysteresis, &|_| ()).unwrap()
    });
    let of = |name| value(&added, EffectId::ModeHysteresis, name);
    close(of("stiffness"), 0.8, 0.1);
    close(of("fading"), 0.4, 0.1);
    close(of("lean"), -0.2, 0.15);
}

/// A new effect without a test of its own would stand in no one's way.
#[test]
fn val_every_effect_has_a_test_here() {
    let source = include_str!("effects.rs");
    for id in EffectId::ALL {
        let added = ["added(", "added_to(", "added_to_many_plays(", "add_effect("]
            .iter()
            .flat_map(|call| source.match_indices(call))
            .any(|(at, _)| {
                source[at..]
                    .lines()
                    .next()
                    .is_some_and(|line| line.contains(&format!("EffectId::{id:?},")))
            });
        assert!(added, "{id} is not tested");
    }
}
