//! What must change no verdict, and data that cannot give one.
#![expect(clippy::unwrap_used, reason = "a test that cannot make its case fails")]

use host_tests::hidden::{Example, change, generate, unanswerable};
use hysteron_data::Dataset;
use hysteron_diagnose::Kind;
use hysteron_diagnose::diagnosis::{Diagnosis, Reason};
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

/// Data that cannot answer get no name and a reason; and the record to take next, where another record would help.
#[test]
fn val_no_name_where_data_cannot_answer() {
    let example = case(23, Effect::Delay);
    let data = &example.dataset;
    for (what, dataset, another_helps) in [
        ("one sine", unanswerable::one_sine(data), true),
        ("one second", unanswerable::one_second(data), true),
        // A sensor that shows nothing shows nothing of another record.
        ("all noise", unanswerable::all_noise(data, 1), false),
    ] {
        let answer = diagnosis(&dataset, &example);
        let no_name = ["none", "unknown", "hysteresis-shape"].contains(&answer.verdict.as_str());
        assert!(no_name, "{what}: {} is named", answer.verdict);
        assert!(!answer.cannot_answer.is_empty(), "{what}: no reason is given");
        assert_eq!(answer.next_record.is_some(), another_helps, "{what}");
    }
}

/// Half of the samples stand at the ends of the sensor's range: the other half still shows a strong delay, and its model leaves less than a
/// tenth of the error; that readings are clipped is said beside it.
#[test]
fn val_clipped_records_are_said_beside_the_name() {
    let example = case(23, Effect::Delay);
    let answer = diagnosis(&unanswerable::clipped(&example.dataset), &example);
    assert_eq!(answer.verdict.as_str(), Effect::Delay.name());
    assert!(answer.acquisition.iter().any(|found| found.kind == Kind::Clipped));
    let left = answer.ranking[0].errors.validate_percent.unwrap();
    let before = answer.before.validate_percent.unwrap();
    assert!(left < 0.1 * before, "{left} of {before}");
    assert!(
        answer.cannot_answer.contains(&Reason::Clipped),
        "{:?}",
        answer.cannot_answer
    );
}

/// Roles are no evidence: records are held out by turns where none is kept for judging.
#[test]
fn val_a_name_without_validation_records() {
    let example = case(23, Effect::Delay);
    let answer = diagnosis(&unanswerable::no_validation(&example.dataset), &example);
    assert_eq!(answer.verdict.as_str(), Effect::Delay.name());
    assert!(answer.cannot_answer.is_empty(), "{:?}", answer.cannot_answer);
}
