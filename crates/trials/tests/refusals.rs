//! References beyond the records are refused or left out before a board is asked for anything and before an image is built.
#![expect(clippy::unwrap_used, reason = "what cannot be made fails the test")]

use hysteron_board::{BoardError, Machine};
use hysteron_control::design::{Controller, ReferenceKind, beyond};
use hysteron_data::{Dataset, Record, Role};
use hysteron_excitation::{DecayingTriangle, Excitation, Sine};
use hysteron_identify::control::{RecordedHold, chain_of};
use hysteron_identify::covered::Field;
use hysteron_identify::{Family, FitOptions, fit};
use hysteron_plant::{Stage, preset};
use hysteron_tracking::bench::Bench;
use hysteron_trials::{TrialError, on_board, on_chip};
use std::path::Path;

/// A controller whose records go to 100 V, half of what the stage can do, and how far that is, micrometres.
fn controller() -> (Controller, f64) {
    let stage = preset::tracking_8k();
    let period_s = 20e-6;
    let sine = |frequency_hz| Sine {
        frequency_hz,
        low_v: 0.0,
        high_v: 100.0,
        periods: 3.0,
    };
    let triangle = DecayingTriangle {
        high_v: 100.0,
        centre_v: 50.0,
        decay: 0.88,
        turns: 24,
        slope_v_per_s: 8000.0,
    };
    let excitations: [&dyn Excitation; 3] = [&sine(10.0), &sine(50.0), &triangle];
    let records = excitations.map(|excitation| {
        let voltage_v = excitation.samples(period_s).unwrap();
        let run = Stage::new(&stage, 1).unwrap().run(&voltage_v, period_s).unwrap();
        Record::new(
            excitation.description(),
            Role::Identify,
            period_s,
            voltage_v,
            run.position_um,
        )
    });
    let dataset = Dataset {
        records: records.into(),
        ..Dataset::default()
    };
    let model = fit(&dataset, &FitOptions::new(Family::PlayPolynomial), &|_| ())
        .unwrap()
        .model;
    let (chain, _) = chain_of(&model, period_s, [0.0, 100.0], RecordedHold::AccountedFor).unwrap();
    let top_um = chain.covered.position_um.unwrap()[1];
    (Controller::design(&chain, ReferenceKind::Previewed).unwrap(), top_um)
}

/// Nobody listens on this port: what is not refused before fails there.
const NOBODY: &str = "localhost:1";

#[test]
fn refuse_references_beyond_the_records_on_a_board() {
    let (controller, top_um) = controller();
    let asked = |high_um: f64, beyond_records| on_board::Asked {
        from: NOBODY,
        bank: 0,
        range_um: [0.3 * top_um, high_um],
        beyond_records,
        iterations: None,
    };
    let run = |high_um, beyond_records| on_board::track(&controller, &asked(high_um, beyond_records), &|_, _| ());
    let beyond = run(1.2 * top_um, false).unwrap_err();
    assert!(matches!(beyond, TrialError::Control(_)), "{beyond:?}");
    let said = beyond.to_string();
    for part in ["the records cover", "`range_um`", "`beyond_records`"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // Records that swing to 5 Hz have none of the references.
    let slower = swinging_to(&controller, 5.0);
    let error = on_board::track(&slower, &asked(0.9 * top_um, false), &|_, _| ()).unwrap_err();
    let said = error.to_string();
    for part in [
        "reference frequency 10 Hz; the records cover 0 to 5 Hz",
        "nothing is known there",
        "record a sine over half the range at that frequency",
        "no reference is slow enough",
        "`beyond_records`",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // These records swing to 58 Hz, and 10 Hz is within that: the board is asked, and where all is granted.
    for (controller, high_um, beyond_records) in [
        (&controller, 0.9 * top_um, false),
        (&slower, 0.9 * top_um, true),
        (&controller, 1.2 * top_um, true),
    ] {
        let error = on_board::track(controller, &asked(high_um, beyond_records), &|_, _| ()).unwrap_err();
        assert!(
            matches!(error, TrialError::Board(BoardError::Source { .. })),
            "{error:?}"
        );
    }
}

/// A controller whose records swing as far as this.
fn swinging_to(controller: &Controller, swing_hz: f64) -> Controller {
    let mut controller = controller.clone();
    controller.model.covered.swing_hz = Some(swing_hz);
    controller
}

/// Sines of 10, 100, 500, 503 and 1000 Hz, a complex harmonic whose third, 300 Hz, swings over two thirds of the range, and a triangle: each
/// is played where the records swing as fast, one percent is rounding.
#[test]
fn bva_a_real_stage_plays_what_the_records_cover() {
    let (controller, top_um) = controller();
    let range_um = [0.3 * top_um, 0.9 * top_um];
    let all = [
        "10",
        "100",
        "500",
        "503",
        "1000",
        "complex-harmonic-100",
        "triangle-100",
    ];
    for (swing_hz, left_out) in [
        (990.2, &[][..]),
        (989.9, &["1000"]),
        (503.0, &["1000"]),
        (499.0, &["1000"]),
        (300.0, &["500", "503", "1000"]),
        (296.0, &["500", "503", "1000", "complex-harmonic-100"]),
        (99.1, &["500", "503", "1000", "complex-harmonic-100"]),
        (
            98.9,
            &["100", "500", "503", "1000", "complex-harmonic-100", "triangle-100"],
        ),
    ] {
        let programme = beyond::real(&swinging_to(&controller, swing_hz), range_um, false).unwrap();
        let played: Vec<&str> = programme.played.iter().map(|(name, _)| *name).collect();
        let not_played: Vec<&str> = programme.not_played.iter().map(|left| left.reference).collect();
        assert_eq!(not_played, left_out, "{swing_hz} Hz");
        let others: Vec<&str> = all.into_iter().filter(|name| !left_out.contains(name)).collect();
        assert_eq!(played, others, "{swing_hz} Hz");
        assert!(programme.granted.is_empty());
        for left in &programme.not_played {
            assert_eq!(
                (left.beyond.field, left.beyond.covered),
                (Field::Frequency, [0.0, swing_hz])
            );
        }
    }
    let granted = beyond::real(&swinging_to(&controller, 503.0), range_um, true).unwrap();
    assert_eq!((granted.played.len(), granted.not_played.len()), (7, 0));
    assert_eq!(granted.granted.len(), 1);
    assert_eq!(granted.granted[0].value, 1000.0);
}

#[test]
fn refuse_references_beyond_the_records_in_the_emulator() {
    let (controller, top_um) = controller();
    let stage = preset::tracking_8k();
    let run = |high_um: f64, beyond_records| {
        let bench = Bench {
            stage: &stage,
            seed: 1,
            range_um: [0.3 * top_um, high_um],
            first_mode_hz: None,
        };
        let asked = on_chip::Asked {
            machine: Machine::Mps2An386,
            // No sources: an image would be built from them.
            firmware: Path::new("no-such-folder"),
            beyond_records,
            iterations: None,
            measured_shares: [0.0; 2],
        };
        on_chip::track(&controller, &bench, &asked, &|_, _| ()).unwrap_err()
    };
    let beyond = run(1.2 * top_um, false);
    assert!(matches!(beyond, TrialError::Control(_)), "{beyond:?}");
    assert!(beyond.to_string().contains("the records cover"), "{beyond}");
    for (high_um, beyond_records) in [(0.9 * top_um, false), (1.2 * top_um, true)] {
        let error = run(high_um, beyond_records);
        assert!(
            matches!(error, TrialError::Board(BoardError::NoFirmware(_))),
            "{error:?}"
        );
    }
}

/// What is granted is remembered: field, value, and what is covered.
#[test]
fn val_what_was_granted_is_remembered() {
    let (controller, top_um) = controller();
    let within = hysteron_control::design::beyond::references(&controller, [0.0, top_um], true).unwrap();
    assert!(within.is_empty(), "{within:?}");
    let left = hysteron_control::design::beyond::references(&controller, [0.0, 1.2 * top_um], true).unwrap();
    assert_eq!(left.len(), 1);
    assert_eq!((left[0].field, left[0].value), (Field::Position, 1.2 * top_um));
    assert_eq!(left[0].covered[1], top_um);
}
