//! What a user brings back of a plan: files under other names, in another order, in one piece, spoiled; the stage is a lag and a creep.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its plan fails")]

use hysteron_acquisition::Kind;
use hysteron_control::campaign::Protocol;
use hysteron_control::plan::doubts::{Doubt, doubts};
use hysteron_control::plan::drift::drifts;
use hysteron_control::plan::matching::{Returned, matched};
use hysteron_control::plan::told::{Remark, Wrong};
use hysteron_control::plan::{self, Plan, Planned};
use hysteron_data::{Record, Role};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::OnceLock;

const RATE_HZ: f64 = 50e3;

fn the_plan() -> &'static Plan {
    static PLAN: OnceLock<Plan> = OnceLock::new();
    PLAN.get_or_init(|| {
        let protocol = Protocol {
            period_s: 1.0 / RATE_HZ,
            top_v: 150.0,
            seed: 1,
        };
        Plan::new(&protocol, RATE_HZ, Some(20.0)).unwrap()
    })
}

fn records() -> &'static [Planned] {
    &the_plan().passes[0].records
}

/// A stage of the test's own: 0.1 um/V behind a lag of 60 us, with a hundredth of it creeping in 0.5 s, and a sensor.
#[derive(Clone, Copy)]
struct Rig {
    gain: f64,
    zero_um: f64,
    noise_um: f64,
    /// Position at the start above that of rest, which creeps away.
    crept_um: f64,
    seed: u64,
}

const RIG: Rig = Rig {
    gain: 1.0,
    zero_um: -3.2,
    noise_um: 1e-3,
    crept_um: 0.0,
    seed: 7,
};

impl Rig {
    fn play(self, voltage_v: &[f64], period_s: f64) -> Vec<f64> {
        let mut random = Pcg64Mcg::seed_from_u64(self.seed);
        let keep = |tau_s: f64| (-period_s / tau_s).exp();
        let (fast, slow) = (keep(60e-6), keep(0.5));
        let (mut here, mut crept) = (0.0, self.crept_um);
        let each = voltage_v.iter().map(|v| {
            let noise = self.noise_um * 3_f64.sqrt() * random.random_range(-1.0..=1.0);
            let read = self.zero_um + self.gain * (here + crept) + noise;
            here = fast * here + (1.0 - fast) * 0.1 * v;
            crept = slow * crept + (1.0 - slow) * 0.01 * here;
            read
        });
        each.collect()
    }

    fn record(self, file: &str, planned: &Planned) -> Record {
        let position_um = self.play(&planned.voltage_v, planned.period_s());
        Record::new(
            file,
            Role::Identify,
            planned.period_s(),
            planned.voltage_v.clone(),
            position_um,
        )
    }
}

/// A recording of each command under its name, each with noise of its own.
fn all() -> Vec<Record> {
    let each = (0..).zip(records());
    each.map(|(seed, planned)| Rig { seed, ..RIG }.record(&format!("{}.csv", planned.name), planned))
        .collect()
}

/// The same, made once.
fn usual() -> Vec<Record> {
    static ALL: OnceLock<Vec<Record>> = OnceLock::new();
    ALL.get_or_init(all).clone()
}

fn names(returned: &Returned) -> Vec<&str> {
    returned
        .taken
        .iter()
        .map(|taken| taken.record.file.trim_end_matches(".csv"))
        .collect()
}

fn planned_names() -> Vec<&'static str> {
    records().iter().map(|planned| planned.name.as_str()).collect()
}

/// The voltages of `all.csv`, as a user plays them.
fn sequence_v() -> Vec<f64> {
    let text = plan::sequence_csv(the_plan(), &the_plan().passes[0]);
    let rows = text.lines().skip(1);
    rows.map(|row| row.split_once(',').unwrap().1.parse().unwrap())
        .collect()
}

#[test]
fn val_the_plan_says_what_it_is_and_its_first_record_comes_again() {
    let records = records();
    let (first, last) = (&records[0], &records[records.len() - 1]);
    assert_eq!(
        (first.name.as_str(), last.name.as_str()),
        ("frf-small", "frf-small-again")
    );
    assert_eq!(first.voltage_v, last.voltage_v);
    for pair in records.windows(2) {
        // At the sequence's rate a hold is fifty times as long.
        let step = (RATE_HZ / pair[0].rate_hz).round() as usize;
        let rest = pair[1].begins_at - pair[0].begins_at - step * pair[0].samples;
        assert_eq!(rest as f64, pair[1].rest_before_s * RATE_HZ);
        assert!(pair[1].rest_before_s >= 4.0);
    }
    assert!(
        records
            .iter()
            .all(|planned| planned.voltage_v[..planned.lead()].iter().all(|v| *v == 0.0))
    );
    let voltage_v = sequence_v();
    assert_eq!(voltage_v.len(), the_plan().passes[0].samples);
    for planned in records {
        let step = (RATE_HZ / planned.rate_hz).round() as usize;
        let there = voltage_v[planned.begins_at..]
            .iter()
            .step_by(step)
            .take(planned.samples);
        assert!(there.eq(planned.voltage_v.iter()), "{}", planned.name);
    }
    // Cycled to the highest voltage of any record before the first.
    let highest = voltage_v[..first.begins_at].iter().copied().fold(0.0, f64::max);
    assert!(
        (highest - the_plan().cycle_to_v).abs() < 1e-3 && highest >= 112.0,
        "{highest}"
    );
}

#[test]
fn val_a_plan_is_read_back_and_a_changed_command_refused() {
    let folder = tempfile::tempdir().unwrap();
    let plan = the_plan();
    for planned in records() {
        std::fs::write(folder.path().join(&planned.file), plan::csv(planned)).unwrap();
    }
    let toml = plan.to_toml().unwrap();
    let file = folder.path().join(plan::FILE);
    std::fs::write(&file, &toml).unwrap();
    assert_eq!(&Plan::read(folder.path()).unwrap(), plan);
    let refused = |change: &dyn Fn(&str) -> String| {
        std::fs::write(&file, change(&toml)).unwrap();
        Plan::read(folder.path()).unwrap_err().to_string()
    };
    for (from, to, said) in [
        (
            "format = 1",
            "format = 7",
            "format 7 is not known, this version reads 1",
        ),
        ("seed = 1", "seed = \"one\"", "write the plan again"),
        ("rate_hz = 50000.0", "rate_hz = nan", "rate_hz = NaN"),
        ("top_v = 150.0", "top_v = -1.0", "top_v = -1: allowed are 0 to 10000 V"),
        ("begins_at = ", "begins_at = 9", "it ends beyond the"),
        ("counts_from = ", "counts_from = 9", "counts_from = 9"),
        (
            "file = \"hold.csv\"",
            "file = \"large-noise.csv\"",
            "not the command of hold",
        ),
        ("file = \"hold.csv\"", "file = \"nowhere.csv\"", "nowhere.csv"),
    ] {
        let reason = refused(&|toml| toml.replace(from, to));
        assert!(reason.contains(said), "{said}: {reason}");
    }
    std::fs::write(&file, &toml).unwrap();
    let hold = folder.path().join("hold.csv");
    let text = std::fs::read_to_string(&hold).unwrap();
    std::fs::write(&hold, text.replacen("75.000000", "75.000001", 1)).unwrap();
    let reason = Plan::read(folder.path()).unwrap_err().to_string();
    assert!(
        reason.contains("hold.csv: this is not the command of hold that the plan has"),
        "{reason}"
    );
    std::fs::write(&hold, "time_s,voltage_v\n0.0\n").unwrap();
    let reason = Plan::read(folder.path()).unwrap_err().to_string();
    assert!(
        reason.contains("line 2: `0.0` is no row of time_s,voltage_v"),
        "{reason}"
    );
    let nowhere = Plan::read(&folder.path().join("nowhere")).unwrap_err().to_string();
    assert!(nowhere.contains("`folder` names the folder"), "{nowhere}");
}

/// Under names of an instrument, backwards, one behind a trigger, one behind a monitor with noise and half a percent: all are known.
#[test]
fn val_renamed_and_reordered_recordings_are_known_by_their_voltage() {
    let mut recorded = usual();
    for (number, record) in recorded.iter_mut().enumerate() {
        record.file = format!("CH1_{number:03}.csv");
    }
    let late = &mut recorded[4];
    late.voltage_v.splice(0..0, vec![0.0; 2500]);
    late.position_um.splice(0..0, vec![-3.2; 2500]);
    let monitor = &mut recorded[2];
    let noise = |k: usize| 0.1 * ((k * 7919) % 100) as f64 / 100.0;
    monitor
        .voltage_v
        .iter_mut()
        .enumerate()
        .for_each(|(k, v)| *v = 1.005 * *v + noise(k));
    monitor.voltage_v.extend([0.0; 300]);
    monitor.position_um.extend([0.0; 300]);
    // The two recordings of one command stay in the order in which they were taken.
    recorded[1..7].reverse();
    let returned = matched(the_plan(), &recorded);
    assert_eq!(returned.wrong, []);
    assert_eq!(names(&returned), planned_names());
    let begins = Remark::Begins {
        from: "CH1_004.csv".to_owned(),
        name: records()[4].name.clone(),
        samples: 2500,
        seconds: 0.05,
        exact: true,
    };
    assert!(returned.remarks.contains(&begins), "{:?}", returned.remarks);
    let pairs = ["CH1_000.csv", "CH1_007.csv"].map(str::to_owned);
    let pairs = pairs
        .into_iter()
        .zip(["frf-small", "frf-small-again"].map(str::to_owned))
        .collect();
    assert!(
        returned.remarks.contains(&Remark::InOrder { pairs }),
        "{:?}",
        returned.remarks
    );
    assert_eq!(returned.remarks.len(), 2);
    for (taken, own) in returned.taken.iter().zip(usual()) {
        let planned = &records()[taken.at.1];
        assert_eq!(taken.record.position_um, own.position_um[planned.counts_from..]);
        assert_eq!(taken.record.voltage_v, planned.voltage_v[planned.counts_from..]);
        assert_eq!(taken.rest_um.len(), planned.lead());
    }
}

/// One is missing and one is foreign: each is said once, with the command's file and with the nearest record. Where none is missing, a
/// foreign one does no harm.
#[test]
fn refuse_a_missing_and_a_foreign_recording_once() {
    let mut recorded = usual();
    let foreign = &mut recorded[5];
    foreign.file = "other.csv".to_owned();
    // Close to a record of 23 Hz, in no unit it.
    let wave = |k: usize| 60.0 - 40.0 * (std::f64::consts::TAU * 24.0 * k as f64 / RATE_HZ).cos();
    foreign.voltage_v = (0..13_000).map(wave).collect();
    foreign.position_um = (0..13_000).map(|k| 0.1 * wave(k)).collect();
    let foreign = foreign.clone();
    let returned = matched(the_plan(), &recorded);
    let said: Vec<String> = returned.wrong.iter().map(ToString::to_string).collect();
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(
        said[0].starts_with("other.csv: its voltage is that of no planned record; the nearest is large-"),
        "{said:?}"
    );
    assert!(said[0].contains("% of its range off, rms; allowed are 2 %"), "{said:?}");
    let missing = &records()[5];
    assert_eq!(
        said[1],
        format!(
            "{}: not there; play {} of the plan and record the position",
            missing.name, missing.file
        )
    );
    let mut recorded = usual();
    recorded.push(foreign);
    recorded.push(Record {
        file: "twice.csv".to_owned(),
        ..recorded[5].clone()
    });
    let returned = matched(the_plan(), &recorded);
    assert_eq!(returned.wrong, []);
    assert!(
        matches!(&returned.remarks[..], [Remark::Twice { .. }, Remark::LeftOut(_)]),
        "{:?}",
        returned.remarks
    );
    // Nothing of a drift, and nothing else lost with it.
    let returned = matched(the_plan(), &usual()[..7]);
    assert_eq!(returned.wrong, []);
    assert!(
        matches!(&returned.remarks[..], [Remark::NoDrift { .. }]),
        "{:?}",
        returned.remarks
    );
}

/// What is wrong with a recording is said of the record that it is of, whatever its name.
#[test]
fn refuse_recordings_that_are_of_no_use() {
    let said = |number: usize, change: &dyn Fn(&mut Record)| -> String {
        let mut recorded = usual();
        recorded[number].file = "scope.csv".to_owned();
        change(&mut recorded[number]);
        let wrong = matched(the_plan(), &recorded).wrong;
        assert_eq!(wrong.len(), 1, "{wrong:?}");
        wrong[0].to_string()
    };
    let cut = |record: &mut Record, from: usize, to: usize| {
        record.voltage_v = record.voltage_v[from..to].to_vec();
        record.position_um = record.position_um[from..to].to_vec();
    };
    let all = records()[4].samples;
    for (words, change) in [
        (
            "0.0500 times the command's",
            &(|r: &mut Record| r.voltage_v.iter_mut().for_each(|v| *v *= 0.05)) as &dyn Fn(&mut Record),
        ),
        ("-1.0000 times the command's", &|r| {
            r.voltage_v.iter_mut().for_each(|v| *v *= -1.0)
        }),
        ("lacks the last 777", &|r| cut(r, 0, all - 777)),
        ("lacks the first 777", &|r| cut(r, 777, all)),
        ("the position stands still", &|r| r.position_um.fill(1.0)),
        ("sampled every 0.0001 s and played every 0.00002 s", &|r| {
            r.voltage_v = r.voltage_v.iter().step_by(5).copied().collect();
            r.position_um = r.position_um.iter().step_by(5).copied().collect();
            r.period_s *= 5.0;
        }),
    ] {
        let said = said(4, change);
        let of = format!("scope.csv ({}): ", records()[4].name);
        assert!(said.starts_with(&of) && said.contains(words), "{words}: {said}");
    }
    // A multisine of another seed is no copy, however alike the rise before it is.
    let other = Protocol {
        period_s: 1.0 / RATE_HZ,
        top_v: 150.0,
        seed: 2,
    };
    let other = Plan::new(&other, RATE_HZ, None).unwrap();
    let mut recorded = usual();
    recorded[0] = RIG.record("frf-small.csv", &other.passes[0].records[0]);
    let wrong = matched(the_plan(), &recorded).wrong;
    assert!(
        matches!(&wrong[..], [Wrong::Stranger { nearest: Some((name, _)), .. }, Wrong::Missing { .. }] if name.starts_with("frf")
        || name.starts_with("large")),
        "{wrong:?}"
    );
}

/// A clock that is 50 ppm off stretches a multisine of 3.6 s by nine samples; a tenth of that is below one.
#[test]
fn bva_a_recording_by_another_clock_is_said() {
    let stretched = |ppm: f64| {
        let mut recorded = usual();
        let series = &records()[0].voltage_v;
        let late = |k: usize| {
            let at = k as f64 / (1.0 + 1e-6 * ppm);
            let (first, share) = (at as usize, at.fract());
            let next = series[(first + 1).min(series.len() - 1)];
            series[first] + share * (next - series[first])
        };
        recorded[0].voltage_v = (0..series.len()).map(late).collect();
        matched(the_plan(), &recorded).wrong
    };
    assert_eq!(stretched(5.0), []);
    let wrong = stretched(50.0);
    let [Wrong::Clock { ppm, .. }] = &wrong[..] else {
        panic!("{wrong:?}")
    };
    assert!((ppm - 50.0).abs() < 15.0, "{ppm}");
}

/// One long file that begins 1234 samples before the sequence, with a noisy monitor of the voltage: every record is cut at its place.
#[test]
fn val_one_long_recording_is_cut() {
    let mut voltage_v = vec![0.0; 1234];
    voltage_v.extend(sequence_v());
    let position_um = RIG.play(&voltage_v, 1.0 / RATE_HZ);
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let measured: Vec<f64> = voltage_v.iter().map(|v| v + random.random_range(-0.1..=0.1)).collect();
    let long = |voltage_v: &[f64], position_um: &[f64], period_s: f64| {
        let record = Record::new(
            "scope.csv",
            Role::Identify,
            period_s,
            voltage_v.to_vec(),
            position_um.to_vec(),
        );
        matched(the_plan(), &[record])
    };
    let period_s = 1.0 / RATE_HZ;
    let returned = long(&measured, &position_um, period_s);
    assert_eq!(returned.wrong, []);
    assert_eq!(names(&returned), planned_names());
    let cut = |samples: isize, exact: bool| Remark::Cut {
        from: "scope.csv".to_owned(),
        records: records().len(),
        samples,
        seconds: samples as f64 * period_s,
        exact,
    };
    assert_eq!(returned.remarks, [cut(1234, false)]);
    for (taken, planned) in returned.taken.iter().zip(records()) {
        let step = (RATE_HZ / planned.rate_hz).round() as usize;
        let there = position_um[1234 + planned.begins_at..]
            .iter()
            .step_by(step)
            .take(planned.samples);
        assert!(
            there.skip(planned.counts_from).eq(&taken.record.position_um),
            "{}",
            planned.name
        );
    }
    let found = doubts(the_plan(), &returned);
    assert_eq!(found.doubts, []);
    assert!(
        drifts(the_plan(), &returned)
            .iter()
            .all(|drift| !drift.of_gain() && !drift.of_zero())
    );
    // The command itself, and begun 30 000 samples late, in the cycles before the first record.
    let returned = long(&voltage_v[31_234..], &position_um[31_234..], period_s);
    assert_eq!((returned.wrong, returned.remarks), (vec![], vec![cut(-30_000, true)]));
    // Ended early: what was recorded is cut, the rest is asked for.
    let last = &records()[records().len() - 2];
    let end = 1234 + last.begins_at;
    let returned = long(&voltage_v[..end], &position_um[..end], period_s);
    let (name, file) = (last.name.clone(), last.file.clone());
    assert_eq!(returned.wrong, [Wrong::Missing { name, file }]);
    // Every fifth sample of it, and every sample by a clock that is 100 ppm off, are said once each.
    let fifth = |series: &[f64]| -> Vec<f64> { series.iter().step_by(5).copied().collect() };
    let returned = long(&fifth(&voltage_v), &fifth(&position_um), 5.0 * period_s);
    let said: Vec<String> = returned.wrong.iter().map(ToString::to_string).collect();
    assert!(
        said.len() == 1 && said[0].contains("sampled every 0.0001 s"),
        "{said:?}"
    );
    let slow: Vec<f64> = (0..voltage_v.len())
        .map(|k| voltage_v[(k as f64 / 1.0001) as usize])
        .collect();
    let returned = long(&slow, &position_um, period_s);
    let said: Vec<String> = returned.wrong.iter().map(ToString::to_string).collect();
    assert!(
        said.len() == 1 && said[0].contains("the command runs 100 ppm slower there"),
        "{said:?}"
    );
}

#[test]
fn val_a_drift_of_the_gain_is_told_and_none_is_not() {
    for (gain, drifted) in [(1.02, true), (1.0, false)] {
        let mut recorded = usual();
        let last = recorded.len() - 1;
        recorded[last] = Rig {
            gain,
            zero_um: -3.2,
            seed: 99,
            ..RIG
        }
        .record("last.csv", &records()[last]);
        let returned = matched(the_plan(), &recorded);
        let found = drifts(the_plan(), &returned);
        let [drift] = &found[..] else { panic!("{found:?}") };
        assert_eq!(drift.name, "frf-small-again");
        assert_eq!((drift.of_gain(), drift.of_zero()), (drifted, false), "{drift:?}");
        assert!(
            (drift.gain_percent.value - 100.0 * (gain - 1.0)).abs() < 0.05,
            "{drift:?}"
        );
    }
    let mut recorded = usual();
    recorded[7] = Rig {
        zero_um: -3.1,
        seed: 99,
        ..RIG
    }
    .record("last.csv", &records()[7]);
    let found = drifts(the_plan(), &matched(the_plan(), &recorded));
    assert!(
        found[0].of_zero() && !found[0].of_gain() && (found[0].zero_um.value - 0.1).abs() < 1e-3,
        "{found:?}"
    );
}

/// Played right after another: the position still creeps when the record begins. And the sensor has shifted before another record.
#[test]
fn bva_rests_that_were_too_short_are_told() {
    let quiet = doubts(the_plan(), &matched(the_plan(), &usual()));
    assert_eq!(quiet.doubts, []);
    assert!((quiet.zero_um.unwrap() + 3.2).abs() < 1e-4, "{:?}", quiet.zero_um);
    let mut returned = matched(the_plan(), &usual());
    returned.count_from(quiet.zero_um.unwrap());
    let again = doubts(the_plan(), &returned);
    assert!(again.zero_um.unwrap().abs() < 1e-9 && again.doubts.is_empty());
    assert!((returned.taken[2].record.position_um[0]).abs() < 0.01);
    assert!(quiet.signs.is_empty() && quiet.following.is_some());
    let told = |rig: Rig| {
        let mut recorded = usual();
        recorded[3] = rig.record("large-007hz.csv", &records()[3]);
        doubts(the_plan(), &matched(the_plan(), &recorded)).doubts
    };
    // The first is refused, the second may be the sensor's.
    assert!(told(Rig { crept_um: 0.5, ..RIG })[0].is_a_short_rest());
    assert!(!told(Rig { zero_um: -3.0, ..RIG })[0].is_a_short_rest());
    let [
        Doubt::NotAtRest {
            name,
            planned_s,
            percent,
            ..
        },
    ] = &told(Rig { crept_um: 0.5, ..RIG })[..]
    else {
        panic!("not told")
    };
    assert_eq!((name.as_str(), *planned_s), ("large-007hz", 4.0));
    assert!((2.0..8.0).contains(percent), "{percent}");
    // A hundredth of it is below what matters, 0.5 % of 11 um.
    assert_eq!(told(Rig { crept_um: 0.005, ..RIG }), []);
    let [Doubt::AnotherZero { off_um, .. }] = &told(Rig { zero_um: -3.0, ..RIG })[..] else {
        panic!("not told")
    };
    assert!((off_um - 0.2).abs() < 1e-3);
    assert_eq!(told(Rig { zero_um: -3.16, ..RIG }), []);
}

#[test]
fn refuse_a_sign_that_is_reversed() {
    let turned = |which: &dyn Fn(usize) -> bool| {
        let mut recorded = usual();
        for (_, record) in recorded.iter_mut().enumerate().filter(|(number, _)| which(*number)) {
            record.position_um.iter_mut().for_each(|y| *y = -*y);
        }
        let found = doubts(the_plan(), &matched(the_plan(), &recorded));
        found.signs.iter().map(|finding| finding.kind).collect::<Vec<_>>()
    };
    assert_eq!(turned(&|_| true), [Kind::NegativeGain]);
    assert_eq!(turned(&|number| number > 4), [Kind::SignByRecord]);
    assert_eq!(turned(&|_| false), []);
}
