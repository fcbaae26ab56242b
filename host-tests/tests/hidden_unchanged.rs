//! What must change no verdict, and data that cannot give one.
#![expect(clippy::unwrap_used, reason = "a test that cannot make its case fails")]

use host_tests::hidden::{Example, change, generate, unanswerable};
use hysteron_data::Dataset;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_identify::{FitOptions, fit};
use hysteron_plant::challenge::{Effect, Spec, StageFamily, Strength};

fn case(seed: u64, effect: Effect) -> Example {
    generate(
        seed,
        &Spec {
            family: Some(StageFamily::Preisach),
            ..Spec::one(effect, Strength::Strong)
        },
    )
    .unwrap()
}

fn diagnosis(dataset: &Dataset, example: &Example) -> Diagnosis {
    let model = fit(dataset, &FitOptions::new(example.start), &|_| {}).unwrap().model;
    hysteron_diagnose::diagnose(dataset, &model, &|_, _| {})
}

/// Order and names of the records, the sensor's zero, the units, the noise.
#[test]
fn prop_verdict_stays() {
    for (seed, effect) in [(21, Effect::Delay), (22, Effect::Creep)] {
        let example = case(seed, effect);
        let verdict = |dataset: &Dataset| diagnosis(dataset, &example).verdict;
        let expected = verdict(&example.dataset);
        assert_eq!(expected, effect.name());
        let data = &example.dataset;
        assert_eq!(verdict(&change::reversed(data)), expected, "records in reverse order");
        assert_eq!(verdict(&change::renamed(data)), expected, "records renamed");
        assert_eq!(
            verdict(&change::offset(data, 0.3 * example.truth.stroke_um)),
            expected,
            "offset"
        );
        // Nanometres and kilovolts in columns that say micrometres and volts.
        assert_eq!(verdict(&change::scaled(data, 1000.0, 1e-3)), expected, "other units");
        let spec = Spec {
            family: Some(StageFamily::Preisach),
            noise_seed: 1,
            ..Spec::one(effect, Strength::Strong)
        };
        assert_eq!(
            verdict(&generate(seed, &spec).unwrap().dataset),
            expected,
            "other noise"
        );
    }
}

/// Data that cannot answer get no name, a reason, and the record to take next.
#[test]
fn val_no_name_where_data_cannot_answer() {
    let example = case(23, Effect::Delay);
    let data = &example.dataset;
    for (what, dataset) in [
        ("one sine", unanswerable::one_sine(data)),
        ("one second", unanswerable::one_second(data)),
        ("clipped", unanswerable::clipped(data)),
        ("all noise", unanswerable::all_noise(data, 1)),
        ("no validation", unanswerable::no_validation(data)),
    ] {
        let answer = diagnosis(&dataset, &example);
        let no_name = ["none", "unknown", "hysteresis-shape"].contains(&answer.verdict.as_str());
        assert!(no_name, "{what}: {} is named", answer.verdict);
        assert!(!answer.cannot_answer.is_empty(), "{what}: no reason is given");
        assert!(answer.next_record.is_some(), "{what}: no record is proposed");
    }
}
