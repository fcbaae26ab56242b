//! Effects of the user's own: what no catalogue has is `unknown` without the user's file, and named with it.
#![expect(clippy::expect_used, reason = "a test that cannot run its subject fails")]

use host_tests::hidden::own::{Subject, start};
use host_tests::hidden::{Example, generate};
use hysteron_diagnose::{add_own, compare, diagnose, diagnose_with};
use hysteron_identify::effects::Effect as _;
use hysteron_plant::challenge::{Spec, StageFamily, Strength};

/// What ten plays leave at the least on stages in which nothing is missing.
const COARSE_PERCENT: f64 = 0.24;

fn example(seed: u64, family: StageFamily, spec: Spec) -> Example {
    let spec = Spec {
        family: Some(family),
        ..spec
    };
    generate(seed, &spec).expect("the seed has such a case")
}

/// The validation error of the start model on the same stage with nothing hidden in it, percent of peak to peak.
fn without_effect_percent(seed: u64, family: StageFamily, hidden: &Example) -> f64 {
    let mut control = example(seed, family, Spec::default());
    control.start = hidden.start;
    let model = start(&control).expect("a fit");
    let comparison = compare(&control.dataset, &model, &|_| {});
    comparison.validate.expect("validation records").nrmse_percent
}

/// `diagnose` without and with the file, and `add`.
fn found(seed: u64, family: StageFamily, subject: Subject, unknown_without: bool) {
    let hidden = example(seed, family, Spec::one(subject.hidden(), Strength::Strong));
    let model = start(&hidden).expect("a fit");
    let own = subject.file(&hidden).expect("a file");
    if unknown_without {
        let without = diagnose(&hidden.dataset, &model, &|_, _| {});
        assert_eq!(without.verdict.as_str(), "unknown", "seed {seed}");
    }
    let with = diagnose_with(&hidden.dataset, &model, &[own], &|_, _| {}).expect("no column is missing");
    assert_eq!(
        with.verdict.effect(),
        Some(&own.name()),
        "seed {seed}: {:#?}",
        with.ranking
    );
    let entry = &with.ranking[0];
    assert!(
        entry.effect == own.name() && entry.significant && entry.parameters.len() == 3,
        "{entry:?}"
    );
    let added = add_own(&hidden.dataset, &model, own, &|_| {}).expect("an effect to add");
    let after = added.after.validate_percent.expect("validation records");
    let least = without_effect_percent(seed, family, &hidden);
    assert!(
        after < (1.5 * least).max(COARSE_PERCENT),
        "seed {seed}: {after} % against {least} % on the stage without it"
    );
}

#[test]
fn val_a_ripple_of_the_reading_is_named_with_the_users_file() {
    found(901, StageFamily::SigmoidPlays, Subject::Ripple, true);
}

#[test]
fn val_plays_that_forget_are_named_with_the_users_file() {
    found(901, StageFamily::SigmoidPlays, Subject::ForgetfulPlays, false);
}

/// Both files at once on a stage in which nothing is hidden.
#[test]
fn val_nothing_hidden_no_file_is_named() {
    let control = example(902, StageFamily::MaxwellSlip, Spec::default());
    let own = [Subject::Ripple, Subject::ForgetfulPlays].map(|subject| subject.file(&control).expect("a file"));
    let model = start(&control).expect("a fit");
    let with = diagnose_with(&control.dataset, &model, &own, &|_, _| {}).expect("no column is missing");
    assert!(
        control.truth.accepted_verdicts().contains(&with.verdict.as_str()),
        "{}",
        with.verdict
    );
    for own in own {
        let entry = with.ranking.iter().find(|entry| entry.effect == own.name());
        assert!(entry.is_some_and(|entry| !entry.significant), "{entry:?}");
    }
}
