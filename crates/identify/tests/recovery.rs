//! Fits that must come back: known parameters, the swarm's optimum, the simulated stage, files.
#![expect(clippy::unwrap_used, reason = "a test that cannot build its subject fails")]

mod stage;

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::envelope::Envelope;
use hysteron_core::model::Hysteresis;
use hysteron_core::mpi::MpiCoefficients;
use hysteron_core::mrpi::Mrpi;
use hysteron_core::thresholds::Thresholds;
use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::objective::measured_opening;
use hysteron_identify::{Direction, Family, FitOptions, Method, Model, Placement, fit};
use std::f64::consts::TAU;

const N: usize = 4;

fn truth(period_s: f64) -> Mrpi<f64, N> {
    // The thresholds that eq. 16 places for a span of 8 V, without the one of zero width: 2, 4, 6 of 0, 2, 4, 6.
    let bank = PlayBank::new(
        Thresholds::new([0.0, 2.0, 4.0, 6.0]).unwrap(),
        -100.0,
        100.0,
        1.0 / period_s,
    )
    .unwrap();
    let coefficients = MpiCoefficients {
        offset: 0.3,
        cubic: -0.002,
        linear: 0.5,
        weights: [0.05, 0.2, 0.1, 0.15],
    };
    Mrpi::new(
        bank,
        coefficients,
        Envelope {
            alpha_s: 8e-5,
            beta_s: 5e-5,
        },
    )
    .unwrap()
}

/// Sines of 0 to 8 V through a known MRPI, from the virgin state, two and a half periods.
fn known(frequencies_hz: &[f64]) -> Dataset {
    let period_s = 2e-5;
    let records = frequencies_hz.iter().map(|&f| {
        let samples = (2.5 / f / period_s) as usize;
        let voltage_v: Vec<f64> = (0..samples)
            .map(|k| 4.0 - 4.0 * (TAU * f * k as f64 * period_s).cos())
            .collect();
        let (model, mut state) = (truth(period_s), PlayState::virgin());
        Record {
            file: format!("{f}.csv"),
            role: Role::Identify,
            excitation: String::new(),
            start_s: 0.0,
            period_s,
            position_um: voltage_v.iter().map(|&v| model.step(&mut state, v)).collect(),
            voltage_v,
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        }
    });
    Dataset {
        name: "known".into(),
        records: records.collect(),
        ..Dataset::default()
    }
}

fn parameter(model: &Model, name: &str) -> f64 {
    model.parameters().iter().find(|p| p.name == name).unwrap().value
}

#[test]
fn val_known_parameters_come_back() {
    let options = FitOptions {
        plays: N,
        placement: Placement::Eq16,
        ..FitOptions::new(Family::Mrpi)
    };
    let model = fit(&known(&[10.0, 200.0, 500.0]), &options, &|_| ()).unwrap().model;
    // Noise-free: what is left is the search's own tolerance (1e-4 of alpha and beta).
    for (name, value, tolerance) in [
        ("alpha", 8e-5, 2e-7),
        ("beta", 5e-5, 2e-7),
        ("offset", 0.3, 1e-3),
        ("cubic", -0.002, 1e-5),
        ("linear", 0.5, 5e-3),
        ("weight[2]", 0.2, 1e-3),
        ("weight[4]", 0.15, 1e-3),
    ] {
        let found = parameter(&model, name);
        assert!((found - value).abs() < tolerance, "{name} = {found}, truth {value}");
    }
}

#[test]
fn val_separable_reaches_no_higher_than_the_swarm() {
    // Short records: the swarm walks over them 80 000 times.
    let dataset = stage::sines(&hysteron_plant::preset::paper_delay(), &[200.0, 500.0], Some(300));
    let of = |method| {
        fit(
            &dataset,
            &FitOptions {
                method,
                ..FitOptions::paper(Family::Mrpi)
            },
            &|_| (),
        )
        .unwrap()
        .objective
    };
    let (separable, swarm) = (of(Method::Separable), of(Method::Mpso));
    assert!(separable <= swarm, "separable {separable}, swarm {swarm}");
}

#[test]
fn val_openings_of_the_presets_are_the_papers() {
    for config in [
        hysteron_plant::preset::paper_rate(),
        hysteron_plant::preset::paper_delay(),
    ] {
        let dataset = stage::sines(&config, &[10.0, 100.0, 500.0], None);
        for (record, paper) in dataset.records.iter().zip([16.44, 22.56, 45.51]) {
            let found = measured_opening(record).unwrap();
            // This definition takes the widest place of the loop, the presets' calibration its middle.
            assert!(
                (found - paper).abs() < 0.5,
                "{}: {found} %, paper {paper} %",
                record.file
            );
        }
    }
}

#[test]
fn val_every_family_explains_the_stage_both_ways() {
    let dataset = stage::sines(&hysteron_plant::preset::paper_rate(), &[10.0, 100.0], Some(2000));
    for direction in [Direction::Forward, Direction::Inverse] {
        for family in Family::ALL {
            let options = FitOptions {
                direction,
                ..FitOptions::new(family)
            };
            let report = fit(&dataset, &options, &|_| ());
            if (family, direction) == (Family::Duhem, Direction::Inverse) {
                let refused = report.unwrap_err().to_string();
                assert!(
                    refused.starts_with("`duhem` runs from voltage to position alone"),
                    "{refused}"
                );
                continue;
            }
            let report = report.unwrap();
            // The objective is the sum over two records of the squared relative error; a straight line leaves 6 % each.
            let relative = (report.objective / 2.0).sqrt();
            assert!(relative < 0.03, "{family} {direction:?}: {relative}");
        }
    }
}

#[test]
fn val_twin_columns_are_said() {
    let dataset = known(&[10.0]);
    let options = FitOptions {
        plays: N,
        placement: Placement::Eq16,
        ..FitOptions::new(Family::Mpi)
    };
    let model = fit(&dataset, &options, &|_| ()).unwrap().model;
    assert_eq!(
        model.notices[0],
        "the data determine only a combination of linear, weight[1]; each alone means nothing"
    );
    let errors: Vec<_> = model
        .parameters()
        .into_iter()
        .filter(|p| p.standard_error.is_none())
        .map(|p| p.name)
        .collect();
    assert_eq!(errors, ["linear", "weight[1]"]);
}

#[test]
fn val_a_start_in_mid_cycle_and_remanence_are_found() {
    // From within the second period on, one and a half periods: the plays stand where the first left them.
    let mut dataset = known(&[10.0, 200.0, 500.0]);
    for record in &mut dataset.records {
        let cut = record.len() * 4 / 10;
        record.voltage_v.drain(..cut);
        record.position_um.drain(..cut);
    }
    let options = FitOptions {
        plays: N,
        placement: Placement::Eq16,
        ..FitOptions::new(Family::Mrpi)
    };
    let model = fit(&dataset, &options, &|_| ()).unwrap().model;
    let alpha = parameter(&model, "alpha");
    assert!((alpha - 8e-5).abs() < 2e-6, "alpha = {alpha}");
    assert!(
        model
            .notices
            .iter()
            .any(|notice| notice.contains("a state that the file does not give")),
        "{:?}",
        model.notices
    );
}

#[test]
fn val_model_files_come_back_bit_for_bit() {
    let dataset = stage::sines(&hysteron_plant::preset::paper_rate(), &[100.0], Some(1200));
    for family in Family::ALL {
        let model = fit(&dataset, &FitOptions::new(family), &|_| ()).unwrap().model;
        let back = Model::from_toml(&model.to_toml(), "model.toml").unwrap();
        assert_eq!(back, model);
        assert_eq!(back.to_toml(), model.to_toml());
        let bits = |m: &Model| m.coefficients.iter().map(|c| c.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&back), bits(&model));
    }
}

#[test]
fn refuse_model_files_that_are_not_models() {
    let dataset = stage::sines(&hysteron_plant::preset::paper_rate(), &[100.0], Some(600));
    let good = fit(
        &dataset,
        &FitOptions {
            plays: 2,
            ..FitOptions::new(Family::Pi)
        },
        &|_| (),
    )
    .unwrap()
    .model
    .to_toml();
    let check = |from: &str, to: &str, message: &str| {
        assert!(good.contains(from), "{from} is not in\n{good}");
        let error = Model::from_toml(&good.replacen(from, to, 1), "m.toml")
            .unwrap_err()
            .to_string();
        assert!(error.starts_with("m.toml: ") && error.contains(message), "{error}");
    };
    check("format = 1", "format = 2", "format = 2; this version reads format 1");
    check(
        "input_unit = \"V\"",
        "input_unit = \"um\"",
        "a model of direction forward has \"V\"",
    );
    check(
        "name = \"weight[2]\"",
        "name = \"weight[3]\"",
        "parameter `weight[3]` in um/V stands where `weight[2]`",
    );
    check(
        "family = \"pi\"",
        "family = \"mpi\"",
        "4 parameters; mpi with 2 thresholds has 5",
    );
    check("family = \"pi\"", "family = \"po\"", "unknown variant `po`");
    check("thresholds = [", "thresholds = [1e300, ", "must exceed");
}

#[test]
fn refuse_what_cannot_be_fitted() {
    let check = |dataset: &Dataset, options: FitOptions, message: &str| {
        assert_eq!(fit(dataset, &options, &|_| ()).unwrap_err().to_string(), message);
    };
    let pi = FitOptions::new(Family::Pi);
    let mut dataset = known(&[500.0]);
    check(
        &dataset,
        FitOptions { plays: 0, ..pi },
        "0 plays asked for; allowed are 1 to 64",
    );
    let swarm = FitOptions {
        method: Method::Mpso,
        ..FitOptions::new(Family::PlayPolynomial)
    };
    let message =
        "the method mpso fits pi, mpi, wrpi and mrpi as the paper does; for `play-polynomial` use the method separable";
    check(&dataset, swarm, message);
    dataset.records[0].voltage_v.truncate(10);
    dataset.records[0].position_um.truncate(10);
    check(
        &dataset,
        pi,
        "10 samples cannot determine 12 parameters; take fewer plays or longer records",
    );
    dataset.records[0].voltage_v.fill(1.0);
    let message =
        "the voltage stands still in every record with role `identify`; a hysteresis model needs records that move";
    check(&dataset, pi, message);
    dataset.records[0].role = Role::Validate;
    let message = "the dataset has no record with role `identify`; give at least one record that role in dataset.toml";
    check(&dataset, pi, message);
}
