//! The stages and recordings of `host_tests::users` are what they say they are.

use host_tests::users::case::{Case, Kind, Spec};
use host_tests::users::harmless::Harmless;
use host_tests::users::loops::Loops;
use host_tests::users::{Effect, Family, Hidden, Programme};
use hysteron_data::Role;
use rand::SeedableRng;
use rand_pcg::Pcg64;

fn loops(family: Family, opening: f64, seed: u64) -> Loops {
    Loops::draw(family, opening, &mut Pcg64::seed_from_u64(seed))
}

/// Every family opens as wide as it is asked to, rises everywhere, and closes its full loop.
#[test]
fn val_loops_open_as_wanted() {
    for family in Family::ALL {
        for (seed, opening) in [(1, 0.08), (2, 0.12), (3, 0.16), (4, 0.2), (5, 0.1)] {
            let mut stage = loops(family, opening, seed);
            let found = stage.opening();
            assert!(
                (found - opening).abs() < 0.002,
                "{} {seed}: {found} for {opening}",
                family.name()
            );
            let slope = stage.least_slope();
            assert!(slope > 0.05, "{} {seed}: the least slope is {slope}", family.name());
            let (low, high) = (stage.go(-1.0), stage.go(1.0));
            assert!(
                low.abs() < 1e-3 && (high - 1.0).abs() < 1e-3,
                "{} {seed}: {low} to {high}",
                family.name()
            );
            let reversible = stage.reversible_slope();
            assert!(
                (0.1..0.6).contains(&reversible),
                "{} {seed}: {reversible}",
                family.name()
            );
        }
    }
}

/// A family with memory of turning points forgets a minor loop that is passed; Bouc and Wen's does not close it.
#[test]
fn prop_minor_loops_close_where_the_family_says_so() {
    for family in Family::ALL {
        let mut stage = loops(family, 0.15, 7);
        stage.go(1.0);
        stage.go(-0.2);
        let before = stage.go(-0.3);
        stage.go(0.2);
        let after = stage.go(-0.3);
        let open = (after - before).abs();
        match family {
            Family::RambergOsgood | Family::SkewedEverett | Family::GeneralisedPlay => {
                assert!(open < 1e-6, "{}: {open}", family.name());
            }
            Family::BoucWen | Family::Dahl | Family::ColemanHodgdon | Family::SemilinearDuhem => {
                assert!(open > 1e-4, "{}: {open}", family.name());
            }
        }
    }
}

fn spec(programme: Programme, kind: Kind) -> Spec {
    Spec {
        programme: Some(programme),
        kind: Some(kind),
        ..Spec::default()
    }
}

/// The records are those of a rig: finite, inside the range of the voltage, two of them held out, the columns that go with the programme.
#[test]
fn val_programmes_keep_inside_their_limits() {
    for (n, programme) in Programme::ALL.into_iter().enumerate() {
        let case = Case::generate(40 + n as u64, &spec(programme, Kind::Nothing));
        let name = programme.name();
        assert_eq!(case.held_out.records.len(), 2, "{name}");
        assert!(
            case.held_out.records.iter().all(|record| record.role == Role::Validate),
            "{name}"
        );
        let [low, high] = case.limits.range_v;
        let slack = 0.02 * (high - low);
        for record in case.dataset.records.iter().chain(&case.held_out.records) {
            assert!(
                record.len() >= 700 && record.len() < 50_000,
                "{name} {}: {}",
                record.file,
                record.len()
            );
            assert_eq!(record.position_um.len(), record.len(), "{name} {}", record.file);
            assert!(
                record.period_s >= case.limits.period_s * 0.999,
                "{name} {}",
                record.file
            );
            for (v, y) in record.voltage_v.iter().zip(&record.position_um) {
                assert!(
                    (low - slack..=high + slack).contains(v),
                    "{name} {}: {v} V",
                    record.file
                );
                assert!(
                    y.is_finite() && y.abs() < 1.5 * case.truth.stroke_um,
                    "{name} {}: {y} um",
                    record.file
                );
            }
            assert_eq!(
                record.reference_um.is_some(),
                record.file.starts_with("loop"),
                "{name} {}",
                record.file
            );
        }
        let bare = case.truth.bare_percent;
        assert!(bare < 3.5, "{name}: nothing is hidden, and {bare} % are left");
    }
}

/// The same seed is the same case, another seed another.
#[test]
fn prop_a_seed_is_a_case() {
    let of = |seed| Case::generate(seed, &spec(Programme::Scope, Kind::One));
    let (one, again, other) = (of(5), of(5), of(6));
    assert_eq!(one.dataset, again.dataset);
    assert_eq!(one.held_out, again.held_out);
    assert_eq!(one.truth, again.truth);
    assert_ne!(one.dataset, other.dataset);
}

/// Every effect can be hidden somewhere, and adds what it is asked to add to what a start model leaves.
#[test]
fn val_effects_add_what_they_are_asked_to() {
    for (n, effect) in Effect::ALL.into_iter().enumerate() {
        let spec = Spec {
            programme: Some(Programme::Fifteen),
            effect: Some(effect),
            adds_percent: Some(2.0),
            ..Spec::default()
        };
        let case = Case::generate(70 + n as u64, &spec);
        let [part] = case.truth.parts.as_slice() else {
            panic!("{}: {:?}", effect.name(), case.truth.parts);
        };
        assert_eq!(part.hidden, Hidden::Effect(effect));
        assert!(
            (1.6..2.5).contains(&part.adds_percent),
            "{}: {}",
            effect.name(),
            part.adds_percent
        );
        assert_eq!(case.truth.accepted(), [effect.name()]);
    }
}

/// Another record on the true stage: at the rig's own instruments, with the columns that the others have.
#[test]
fn val_another_record_can_be_played() {
    let case = Case::generate(9, &spec(Programme::Raster, Kind::Nothing));
    let [low, high] = case.limits.range_v;
    let volts: Vec<f64> = (0..2000)
        .map(|k| low + (high - low) * f64::from(k % 500) / 500.0)
        .collect();
    let record = case.play("next.csv", 1e-4, volts, None);
    assert_eq!(record.len(), 2000);
    assert!(record.voltage2_v.is_some());
    let (least, most) = record
        .position_um
        .iter()
        .fold((f64::MAX, f64::MIN), |(a, b), &y| (a.min(y), b.max(y)));
    assert!(most - least > 0.8 * case.truth.stroke_um, "{least} {most}");
}

/// Harmless changes keep what they say they keep.
#[test]
fn val_harmless_changes_are_harmless() {
    let case = Case::generate(3, &spec(Programme::Repeats, Kind::Nothing));
    let samples = |dataset: &hysteron_data::Dataset| dataset.records.iter().map(|record| record.len()).sum::<usize>();
    for change in Harmless::ALL {
        let changed = change.apply(&case).unwrap_or_else(|| panic!("{}", change.words()));
        let (before, after) = (samples(&case.dataset), samples(&changed));
        match change {
            Harmless::EverySecond | Harmless::FewerPeriods => {
                assert!(
                    (0.4..0.75).contains(&(after as f64 / before as f64)),
                    "{}: {after} of {before}",
                    change.words()
                );
            }
            _ => assert_eq!(before, after, "{}", change.words()),
        }
        let records = case.dataset.records.len() + usize::from(change == Harmless::Split);
        assert_eq!(changed.records.len(), records, "{}", change.words());
        for record in &changed.records {
            assert_eq!(record.voltage_v.len(), record.position_um.len(), "{}", change.words());
        }
    }
}
