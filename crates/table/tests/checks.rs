//! Tables that are taken, and those that are refused with the field's name.

#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

use hysteron_table::{Family, Table, hash};

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
            "thresholds_um = 0 values: a table has 1 to 32 plays",
        ),
        (
            refusal(|t| t.linear_v_per_um = -t.linear_v_per_um),
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
