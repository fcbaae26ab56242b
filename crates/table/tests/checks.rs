//! Tables that are taken, and those that are refused with the field's name.

#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

use hysteron_core::bank::PlayState;
use hysteron_core::model::Hysteresis;
use hysteron_core::surroundings::LoopInput;
use hysteron_table::{Controller, Family, MOST_BANKS, Table, constants_of_banks, hash};

const GOOD: &str = include_str!("../../../firmware/tables/paper-rate-mrpi.toml");

fn refusal(change: impl Fn(&mut Table)) -> String {
    let mut table = Table::parse(GOOD).unwrap();
    change(&mut table);
    table.check().unwrap_err().to_string()
}

#[test]
fn val_a_table_comes_back() {
    let table = Table::parse(GOOD).unwrap();
    assert_eq!(Table::parse(&table.to_toml().unwrap()).unwrap(), table);
}

#[test]
fn val_constants_are_the_nearest_f32() {
    let table = Table::parse(GOOD).unwrap();
    let source = table.constants(GOOD).unwrap();
    let line = source
        .lines()
        .find(|line| line.starts_with("pub const ALPHA_S"))
        .unwrap();
    let written = line.split(['=', ';']).nth(1).unwrap().trim();
    assert_eq!(written.parse::<f32>().unwrap(), table.alpha_s as f32);
}

#[test]
fn val_one_changed_digit_changes_the_hash() {
    assert_ne!(hash(GOOD.as_bytes().escape_ascii().to_string().as_str()), hash(GOOD));
    assert_ne!(hash(&GOOD.replacen('1', "2", 1)), hash(GOOD));
}

/// Tables of one image: what they may not differ in is refused by its name, and what is each one's own is taken.
#[test]
fn refuse_tables_that_do_not_fit_together() {
    let first = Table::parse(GOOD).unwrap();
    let refused = |change: &dyn Fn(&mut Table)| {
        let mut other = first.clone();
        change(&mut other);
        other.fits(&first).unwrap_err().to_string()
    };
    assert_eq!(
        refused(&|table| table.family = Family::Wrpi),
        "family = wrpi: must be mrpi as in the image's first table"
    );
    assert_eq!(
        refused(&|table| table.thresholds_um.truncate(9)),
        "thresholds_um = 9 values: must be 10 as in the image's first table"
    );
    assert_eq!(
        refused(&|table| table.controller = Table::parse(COMPLETE).unwrap().controller),
        "controller = present: the image's first table has none; give tables with a complete law, or tables without"
    );
    type Field = fn(&mut Table) -> &mut f64;
    let fields: [(&str, Field); 10] = [
        ("sample_rate_hz", |table| &mut table.sample_rate_hz),
        ("output_min_v", |table| &mut table.output_min_v),
        ("output_max_v", |table| &mut table.output_max_v),
        ("safe_v", |table| &mut table.safe_v),
        ("slew_v_per_s", |table| &mut table.slew_v_per_s),
        ("ramp_v_per_s", |table| &mut table.ramp_v_per_s),
        ("dac_min_v", |table| &mut table.dac_min_v),
        ("dac_top_v", |table| &mut table.dac_top_v),
        ("adc_min_um", |table| &mut table.adc_min_um),
        ("adc_top_um", |table| &mut table.adc_top_um),
    ];
    for (name, field) in fields {
        let said = refused(&|table| *field(table) += 0.5);
        let its = *field(&mut first.clone());
        assert_eq!(
            said,
            format!("{name} = {}: must be {its} as in the image's first table", its + 0.5)
        );
    }
    const OTHER: &str = include_str!("../../../firmware/tables/paper-delay-mrpi.toml");
    let other = Table::parse(OTHER).unwrap();
    let both = [(first.clone(), GOOD), (other, OTHER)];
    let source = constants_of_banks(&both).unwrap();
    for text in [GOOD, OTHER] {
        assert!(source.contains(&format!("HASH: [u8; 32] = {:?};", hash(text))));
    }
    let bad = Table {
        safe_v: 1.0,
        ..first.clone()
    };
    let (place, error) = constants_of_banks(&[(first.clone(), GOOD), (bad, GOOD)]).unwrap_err();
    assert_eq!(
        (place, error.to_string().as_str()),
        (1, "safe_v = 1: must be 0 as in the image's first table")
    );
    let (_, error) = constants_of_banks(&vec![(first, GOOD); MOST_BANKS + 1]).unwrap_err();
    assert_eq!(error.to_string(), "tables = 9: an image has room for 8");
}

/// The table with each play split into `parts`, evenly up to the next threshold, of equal weights.
fn finer(parts: usize) -> Table {
    let mut table = Table::parse(GOOD).unwrap();
    let (thresholds, weights) = (table.thresholds_um.clone(), table.weights_v_per_um.clone());
    let ends = thresholds[1..].iter().copied().chain([2.8]);
    let split = |f: &dyn Fn(f64) -> f64| (0..parts).map(|k| f(k as f64 / parts as f64)).collect::<Vec<_>>();
    table.thresholds_um = thresholds
        .iter()
        .zip(ends)
        .flat_map(|(&from, to)| split(&|share| from + share * (to - from)))
        .collect();
    table.weights_v_per_um = weights
        .iter()
        .flat_map(|&weight| split(&|_| weight / parts as f64))
        .collect();
    table
}

/// Up to a hundred plays, of which the chip touches few or remembers corners; one more is refused.
#[test]
fn val_many_plays() {
    for (parts, inverse) in [
        (1, "quick_mrpi::QuickMrpi<"),
        (2, "quick_mrpi::QuickMrpi<"),
        (3, "corner_mrpi::CornerMrpi<"),
        (10, "corner_mrpi::CornerMrpi<"),
    ] {
        let table = finer(parts);
        let source = table.constants(&table.to_toml().unwrap()).unwrap();
        assert!(source.contains(inverse), "{parts}");
        assert!(source.contains(&format!("pub const PLAYS: usize = {};", 10 * parts)));
    }
    let error = finer(11).check().unwrap_err().to_string();
    assert!(error.contains("110 values: a table has 1 to 100 plays"), "{error}");
}

/// The inverse with room for the table's plays and with more gives the same bits.
fn more_room_changes_nothing<const PLAYS: usize, const MORE: usize>(table: &Table) {
    let (few, many) = (
        table.inverse::<PLAYS>(false).unwrap().1,
        table.inverse::<MORE>(false).unwrap().1,
    );
    let (mut of_few, mut of_many) = (PlayState::virgin(), PlayState::virgin());
    for k in 0..2000_u32 {
        let input = 0.1 + 2.2 * ((k * k % 997) as f32 / 997.0);
        assert_eq!(
            few.step(&mut of_few, input).to_bits(),
            many.step(&mut of_many, input).to_bits(),
            "{k}"
        );
    }
}

/// Plays that a table does not have change nothing.
#[test]
fn val_room_for_more_plays_changes_nothing() {
    more_room_changes_nothing::<10, 100>(&Table::parse(GOOD).unwrap());
}

/// The same of an odd number, as the image has it: the host has room for ten.
#[test]
fn val_room_for_more_than_seven_plays_changes_nothing() {
    let mut table = Table::parse(GOOD).unwrap();
    table.thresholds_um.truncate(7);
    table.weights_v_per_um.truncate(7);
    more_room_changes_nothing::<7, 10>(&table);
}

#[test]
fn refuse_a_bad_table_naming_the_field() {
    let mut cases: Vec<(String, &str)> = vec![
        (refusal(|t| t.thresholds_um.swap(2, 3)), "thresholds_um[4] ="),
        // 1 um plus 1e-9 um is 1 um in f32.
        (
            refusal(|t| {
                t.thresholds_um[5] = 1.0;
                t.thresholds_um[6] = 1.0 + 1e-9;
            }),
            "thresholds_um[7] = 1.000000001: must exceed thresholds_um[6] = 1 in f32",
        ),
        (
            refusal(|t| t.weights_v_per_um[2] = f64::NAN),
            "weights_v_per_um[3] = NaN: must be finite in f32",
        ),
        (refusal(|t| t.cubic_v_per_um3 = 1e39), "cubic_v_per_um3 = "),
        (
            refusal(|t| t.weights_v_per_um.truncate(9)),
            "weights_v_per_um = 9 values: there are 10 thresholds",
        ),
        (
            refusal(|t| {
                t.weights_v_per_um.clear();
                t.thresholds_um.clear();
            }),
            "thresholds_um = 0 values: a table has 1 to 100 plays",
        ),
        (
            // Within the amplifier, but falling.
            refusal(|t| (t.linear_v_per_um, t.offset_v) = (-t.linear_v_per_um, 190.0)),
            "linear_v_per_um, cubic_v_per_um3, weights_v_per_um = ",
        ),
        (refusal(|t| t.output_max_v = 20.0), "input_min_um, input_max_um = "),
        (
            refusal(|t| t.output_max_v = 500.0),
            "output_max_v = 500: must not lie above dac_top_v",
        ),
        (
            refusal(|t| t.alpha_s = -1e-3),
            "the core refuses the table in f32: alpha_s = -0.001",
        ),
        (
            refusal(|t| t.slew_v_per_s = 0.1),
            "the core refuses the table in f32: slew_per_s = 0.1",
        ),
        (
            refusal(|t| t.format = "other".to_owned()),
            "format = other: this version reads",
        ),
        (
            refusal(|t| t.quintic_v_per_um5 = 1e-3),
            "quintic_v_per_um5 = 0.001: family mrpi has no such term; take the line out",
        ),
        (refusal(|t| t.family = Family::Wrpi), "alpha_s = "),
        (
            refusal(|t| {
                (t.family, t.alpha_s, t.beta_s) = (Family::Wrpi, 0.0, 0.0);
                t.rate_weights_v_s_per_um2 = vec![0.0; 3];
            }),
            "rate_weights_v_s_per_um2 = 3 values: there are 10 thresholds; give each play one weight",
        ),
        (
            refusal(|t| t.safe_v = -1.0),
            "safe_v = -1: must not lie below output_min_v",
        ),
    ];
    cases.push((
        Table::parse(&GOOD.replace("alpha_s", "alfa_s"))
            .unwrap_err()
            .to_string(),
        "unknown field `alfa_s`",
    ));
    for (message, wanted) in cases {
        assert!(message.contains(wanted), "`{message}` should say `{wanted}`");
    }
}

const COMPLETE: &str = include_str!("../../../firmware/tables/tracking-739.toml");

/// The numbers of a complete law go into a file and come out of it unchanged, and both number types are built of them.
#[test]
fn val_a_complete_law_comes_back() {
    let table = Table::parse(COMPLETE).unwrap();
    let numbers = table.law_numbers().unwrap().unwrap();
    assert_eq!(table.clone().with_law(&numbers), table);
    let again = Table::parse(&table.to_toml().unwrap()).unwrap();
    assert_eq!(again.law_numbers().unwrap().unwrap(), numbers);
    let source = table.constants(COMPLETE).unwrap();
    assert!(source.contains("pub const NUMBERS: LawNumbers = LawNumbers { sample_rate_hz: "));
    assert!(
        Table::parse(GOOD).unwrap().law_numbers().unwrap().is_none(),
        "a table of an inverse alone"
    );
}

/// The chip's `f32` gives the commands of the host's `f64` to half a code of the converter rms, and in no tick is it off by what moves the
/// stage by its sensor's noise of a nanometre (20 um at 200 V: 10 mV); along a sine of 100 Hz with a position that is off by 1 %.
#[test]
fn val_f32_follows_f64() {
    let table = Table::parse(COMPLETE).unwrap();
    let numbers = table.law_numbers().unwrap().unwrap();
    let (single, double) = (numbers.law::<f32>().unwrap(), numbers.law::<f64>().unwrap());
    let (mut of_single, mut of_double) = (single.rest(0.0), double.rest(0.0));
    let code_v = (table.dac_top_v - table.dac_min_v) / 65_535.0;
    let (mut sum, mut most) = (0.0, 0.0_f64);
    let ticks = 20_000;
    for k in 0..ticks {
        let phase = std::f64::consts::TAU * f64::from(k) / 500.0;
        // Numbers that both types hold.
        let reference = (5.0 - 5.0 * phase.cos()) as f32;
        let measured = 0.99 * reference;
        let input = LoopInput {
            reference_ahead: reference,
            measured,
            ..LoopInput::default()
        };
        let chip = f64::from(single.step(&mut of_single, input));
        let host = double.step(
            &mut of_double,
            LoopInput {
                reference_ahead: f64::from(reference),
                measured: f64::from(measured),
                ..LoopInput::default()
            },
        );
        sum += (chip - host).powi(2);
        most = most.max((chip - host).abs());
    }
    let rms = (sum / f64::from(ticks)).sqrt();
    assert!(
        rms < 0.5 * code_v && most < 0.01,
        "{rms} V rms, at most {most} V; a code is {code_v} V"
    );
}

/// In open loop: four times what the model is known to miss, at least 3.75 % of the range, at most a fifth of it. With feedback what the
/// model misses changes nothing.
#[test]
fn bva_what_a_model_misses_is_no_departure_in_open_loop() {
    let with = |model_error_um: Option<f64>, feedback: bool| {
        let mut table = Table::parse(COMPLETE).unwrap();
        let part = table.controller.as_mut().unwrap();
        part.model_error_um = model_error_um;
        part.feedback = part.feedback.take().filter(|_| feedback);
        let text = table.to_toml().unwrap();
        let table = Table::parse(&text).unwrap();
        let constants = table.constants(&text).unwrap();
        let departure_v = table.departure_v(&table.sweep().unwrap());
        let line = format!("pub const DEPARTURE_V: f32 = {:?};", departure_v as f32);
        assert!(constants.contains(&line), "{line}");
        (table, departure_v)
    };
    let range_um = with(None, false).0.input_max_um - with(None, false).0.input_min_um;
    for (missed, share) in [
        (None, 0.0375),
        (Some(0.0), 0.0375),
        (Some(0.0093), 0.0375),
        (Some(0.0095), 0.038),
        (Some(0.03), 0.12),
        (Some(0.0499), 0.1996),
        (Some(0.0501), 0.2),
        (Some(1e3), 0.2),
    ] {
        let (table, departure_v) = with(missed.map(|share| share * range_um), false);
        let departure_um = table.open_loop_departure_um().unwrap();
        assert!((departure_um / range_um - share).abs() < 1e-9, "{missed:?}");
        let slope_v_per_um = table.sweep().unwrap().slopes_v_per_um[0];
        assert!((departure_v / slope_v_per_um - departure_um).abs() < 1e-9, "{missed:?}");
        let (closed, departure_v) = with(missed.map(|share| share * range_um), true);
        assert_eq!(closed.open_loop_departure_um(), None);
        assert_eq!(departure_v, with(None, true).1, "{missed:?}");
    }
}

#[test]
fn refuse_a_bad_complete_law_naming_the_field() {
    let refusal = |change: &dyn Fn(&mut Table, &mut Controller)| {
        let mut table = Table::parse(COMPLETE).unwrap();
        let mut part = table.controller.take().unwrap();
        change(&mut table, &mut part);
        table.controller = Some(part);
        table.check().unwrap_err().to_string()
    };
    let cases: [(String, &str); 17] = [
        (
            refusal(&|_, c| c.preview.truncate(31)),
            "controller.preview = 31 values: a complete law has 32",
        ),
        (
            refusal(&|_, c| c.preview[3] = f64::NAN),
            "controller.preview[4] = NaN: must be finite in f32",
        ),
        (
            refusal(&|_, c| c.preview[0] += 0.5),
            "controller.preview, controller.samples_ahead = as given: the core refuses it in f32: sum of the preview coefficients",
        ),
        (refusal(&|_, c| c.samples_ahead = 32), "controller.samples_ahead"),
        (
            refusal(&|_, c| c.second_mode[4] = 1.5),
            "controller.second_mode = as given: the core refuses it in f32: a[2] = 1.5",
        ),
        (
            refusal(&|_, c| c.creep_shares[1] = -0.1),
            "controller.creep_shares, controller.creep_tau_s",
        ),
        (
            refusal(&|_, c| c.creep_tau_s.truncate(3)),
            "controller.creep_tau_s = 3 values",
        ),
        (refusal(&|_, c| c.lag_s = -1e-6), "controller.lag_s"),
        (refusal(&|_, c| c.sensor_lag_s = -1e-6), "controller.sensor_lag_s"),
        (
            refusal(&|_, c| c.cross_um_per_um = Some(0.9)),
            "controller.cross_um_per_um = 0.9: must lie in -0.5 to 0.5",
        ),
        (
            refusal(&|_, c| c.model_error_um = Some(-1e-3)),
            "controller.model_error_um = -0.001: must not be negative",
        ),
        (
            refusal(&|_, c| c.model_error_um = Some(f64::NAN)),
            "controller.model_error_um = NaN: must be finite in f32",
        ),
        (refusal(&|_, c| c.sensor = Some([1e7, 0.0, 0.0])), "controller.sensor"),
        (
            refusal(&|_, c| c.feedback.as_mut().unwrap().damping[3] = 2.5),
            "controller.feedback.damping",
        ),
        (
            refusal(&|t, _| t.integral_v_per_um_s = 1.0),
            "integral_v_per_um_s = 1: must be 0 in a table with a [controller]",
        ),
        (
            refusal(&|t, _| t.safe_v = 1.0),
            "safe_v = 1: must be 0 in a table with a [controller]",
        ),
        (
            refusal(&|t, _| t.input_max_um = 15.5),
            "input_max_um = 15.5: lies 15.5 um above the rest, outside controller.inverse_min_um",
        ),
    ];
    for (message, wanted) in cases {
        assert!(message.contains(wanted), "`{message}` should say `{wanted}`");
    }
    let misspelt = COMPLETE.replace("samples_ahead", "samples_ahaed");
    let message = Table::parse(&misspelt).unwrap_err().to_string();
    assert!(message.contains("unknown field `samples_ahaed`"), "{message}");
}
