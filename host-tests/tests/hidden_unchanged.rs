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

/// Order and names of the records, the sensor's zero, the units, the noise: two at a time on one stage, all of them on another.
#[test]
fn prop_verdict_stays() {
    let expected = Effect::Delay.name();
    let example = case(21, Effect::Delay);
    let data = &example.dataset;
    let verdict = |dataset: &Dataset| diagnosis(dataset, &example).verdict.to_string();
    assert_eq!(verdict(data), expected);
    let turned = change::renamed(&change::reversed(data));
    assert_eq!(verdict(&turned), expected, "records renamed, in reverse order");
    // Nanometres and kilovolts in columns that say micrometres and volts.
    let moved = change::scaled(&change::offset(data, 0.3 * example.truth.stroke_um), 1000.0, 1e-3);
    assert_eq!(verdict(&moved), expected, "offset, other units");
    let other = other_noise(21, Effect::Delay);
    assert_eq!(verdict(&other), expected, "other noise");

    let example = case(22, Effect::Creep);
    assert_eq!(
        diagnosis(&example.dataset, &example).verdict.as_str(),
        Effect::Creep.name()
    );
    let other = change::offset(&other_noise(22, Effect::Creep), -0.2 * example.truth.stroke_um);
    let all = change::scaled(&change::renamed(&change::reversed(&other)), 1e-3, 10.0);
    assert_eq!(
        diagnosis(&all, &example).verdict.as_str(),
        Effect::Creep.name(),
        "all at once"
    );
}

/// The same stage measured again.
fn other_noise(seed: u64, effect: Effect) -> Dataset {
    let spec = Spec {
        family: Some(StageFamily::Preisach),
        noise_seed: 1,
        ..Spec::one(effect, Strength::Strong)
    };
    generate(seed, &spec).unwrap().dataset
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
