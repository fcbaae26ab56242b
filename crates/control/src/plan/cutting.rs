//! Records cut from what came back: one command a file, or all of them in one.

use super::likeness::{self, Likeness};
use super::matching::{Returned, SAME_VOLTAGE, Taken, same_period};
use super::told::{Remark, Wrong};
use super::{Pass, Plan, Planned, sequence};
use crate::campaign::PERIODS_KEPT;
use crate::usable::usable;
use hysteron_data::Record;

/// A voltage that differs by no more than a file's last digits is the command itself.
const EXACT: f64 = 1e-4;
/// A factor beyond this is another unit or an amplifier that was forgotten, not a monitor's tolerance.
const SAME_GAIN: f64 = 0.05;
/// How far a command is looked for around its place in a sequence, samples: 100 ppm over a minute at 50 kHz are 300.
const MARGIN: usize = 2000;
/// Likeness of a sequence as a whole from which on it is looked at record by record.
const SEQUENCE: f64 = 0.9;
/// How far the last period of a multisine may be from its place, samples: one is a rounding of the shift.
const STRETCH: isize = 2;
/// Samples by which an amplifier's lag shifts one command more than another at most.
const LAGS: isize = 8;
/// How far it is looked for.
const STRETCH_REACH: usize = 20;

/// A record of a command from its first sample on, cut to what counts.
pub(super) fn one(planned: &Planned, at: (usize, usize), record: &Record, like: Likeness, returned: &mut Returned) {
    if take(planned, at, record, like, returned) && like.shift > 0 {
        returned.remarks.push(Remark::Begins {
            from: record.file.clone(),
            name: planned.name.clone(),
            samples: like.shift.unsigned_abs(),
            seconds: like.shift as f64 * record.period_s,
            exact: like.off < EXACT,
        });
    }
}

/// Takes what counts of a record, or says what is wrong with it; whether it was taken.
fn take(planned: &Planned, at: (usize, usize), record: &Record, like: Likeness, returned: &mut Returned) -> bool {
    match of_file(planned, record, like) {
        Ok((cut, rest_um)) => returned.taken.push(Taken {
            at,
            record: cut,
            rest_um,
            from: record.file.clone(),
        }),
        Err(wrong) => {
            returned.wrong.push(wrong);
            return false;
        }
    }
    true
}

fn of_file(planned: &Planned, record: &Record, like: Likeness) -> Result<(Record, Vec<f64>), Wrong> {
    let (from, name) = (record.file.clone(), planned.name.clone());
    if !same_period(planned.period_s(), record.period_s) {
        let period_s = [record.period_s, planned.period_s()];
        return Err(Wrong::Rate { from, name, period_s });
    }
    if like.off > SAME_VOLTAGE || (like.gain - 1.0).abs() > SAME_GAIN {
        return Err(Wrong::Gain {
            from,
            name,
            gain: like.gain,
        });
    }
    let begins = like.shift.max(0).unsigned_abs();
    let lacks = [
        like.shift.min(0).unsigned_abs(),
        (begins + planned.samples).saturating_sub(record.len() + like.shift.min(0).unsigned_abs()),
    ];
    if lacks != [0, 0] {
        return Err(Wrong::CutOff {
            from,
            name,
            lacks,
            of: planned.samples,
        });
    }
    if let Some(ppm) = stretched(planned, &record.voltage_v, like.shift) {
        return Err(Wrong::Clock { from, name, ppm });
    }
    checked(planned, piece(record, begins, planned.samples, 1))
}

/// The part that counts, and the position over the rest before it.
fn checked(planned: &Planned, whole: Record) -> Result<(Record, Vec<f64>), Wrong> {
    let rest_um = whole.position_um[..planned.lead()].to_vec();
    let from = whole.file.clone();
    match usable(&planned.command(), &whole) {
        Ok(record) => Ok((record, rest_um)),
        Err(reason) => Err(Wrong::Position {
            from,
            name: planned.name.clone(),
            reason,
        }),
    }
}

/// Samples of a record from one on, every so many.
fn piece(record: &Record, from: usize, samples: usize, step: usize) -> Record {
    let part = |series: &[f64]| -> Vec<f64> { series.iter().skip(from).step_by(step).take(samples).copied().collect() };
    Record {
        start_s: 0.0,
        period_s: step as f64 * record.period_s,
        voltage_v: part(&record.voltage_v),
        position_um: part(&record.position_um),
        temperature_c: record.temperature_c.as_deref().map(part),
        reference_um: None,
        voltage2_v: None,
        ..record.clone()
    }
}

/// One of the periods of a multisine in a recording, where its command begins at sample `shift` by the rest of it: its place by itself, and
/// how like it is.
pub(super) fn period(planned: &Planned, recorded_v: &[f64], shift: isize, number: usize) -> Likeness {
    let samples = (planned.samples - planned.counts_from) / PERIODS_KEPT;
    let from = planned.counts_from + number * samples;
    let part = planned.voltage_v.get(from..from + samples).unwrap_or_default();
    let found = likeness::near(part, recorded_v, shift + from as isize, STRETCH_REACH);
    Likeness {
        shift: found.shift - from as isize,
        ..found
    }
}

/// By how much longer a multisine is than it was played, parts in a million; none where it is not.
fn stretched(planned: &Planned, recorded_v: &[f64], shift: isize) -> Option<f64> {
    if !planned.role.is_small() {
        return None;
    }
    let place = |number| period(planned, recorded_v, shift, number).shift;
    let longer = place(PERIODS_KEPT - 1) - place(0);
    let apart = (planned.samples - planned.counts_from) * (PERIODS_KEPT - 1) / PERIODS_KEPT;
    (longer.abs() >= STRETCH).then(|| 1e6 * longer as f64 / apart as f64)
}

/// Cuts a recording of all commands of a pass; whether it is one.
pub(super) fn sequence(plan: &Plan, record: &Record, returned: &mut Returned) -> bool {
    let duration_s = record.len() as f64 * record.period_s;
    let long = |pass: &&Pass| duration_s > 0.5 * pass.samples as f64 / plan.rate_hz;
    for (number, pass) in plan.passes.iter().enumerate().filter(|(_, pass)| long(pass)) {
        let period_s = 1.0 / plan.rate_hz;
        let command = sequence::voltages(plan, pass);
        let same = same_period(period_s, record.period_s);
        let command = if same {
            command
        } else {
            likeness::resampled(&command, period_s, record.period_s)
        };
        let Some((guess, every)) = likeness::coarse(&command, &record.voltage_v) else {
            continue;
        };
        if guess.correlation.abs() < SEQUENCE {
            continue;
        }
        let found = if same {
            Sequence {
                plan,
                pass,
                number,
                record,
            }
            .cut(guess.shift, every, returned)
        } else {
            let (from, name) = (record.file.clone(), pass.sequence.clone());
            Err(Wrong::Rate {
                from,
                name,
                period_s: [record.period_s, period_s],
            })
        };
        if let Err(wrong) = found {
            returned.wrong.push(Wrong::Sequence {
                pass: number,
                wrong: Box::new(wrong),
            });
        }
        return true;
    }
    false
}

/// A recording of all commands of a pass.
struct Sequence<'a> {
    plan: &'a Plan,
    pass: &'a Pass,
    number: usize,
    record: &'a Record,
}

impl Sequence<'_> {
    /// Cuts it where the plan has its records, from a first guess of where it begins, good to `reach` samples.
    fn cut(&self, guess: isize, reach: usize, returned: &mut Returned) -> Result<(), Wrong> {
        let recorded_v = &self.record.voltage_v;
        let places = self.places(guess, reach);
        let Some(&(_, first, start)) = places.first() else {
            return Ok(());
        };
        if let Some(ppm) = self.drifted(&places) {
            let (from, name) = (self.record.file.clone(), self.pass.sequence.clone());
            return Err(Wrong::Clock { from, name, ppm });
        }
        let exact = likeness::at(&first.voltage_v, recorded_v, start + first.begins_at as isize, 0).off < EXACT;
        let before = returned.taken.len();
        for (number, planned) in self.pass.records.iter().enumerate() {
            self.record_of((self.number, number), planned, start, returned);
        }
        returned.remarks.push(Remark::Cut {
            from: self.record.file.clone(),
            records: returned.taken.len() - before,
            samples: start,
            seconds: start as f64 * self.record.period_s,
            exact,
        });
        Ok(())
    }

    /// Where the sequence begins by each of its records that is there, at its own rate and whole.
    fn places(&self, guess: isize, reach: usize) -> Vec<(usize, &Planned, isize)> {
        let recorded_v = &self.record.voltage_v;
        let margin = (MARGIN + reach) as isize;
        let at_its_rate = |(_, planned): &(usize, &Planned)| sequence::step_of(planned, self.plan.rate_hz) == 1;
        let each = self.pass.records.iter().enumerate().filter(at_its_rate);
        each.filter_map(|(number, planned)| {
            let from = (guess + planned.begins_at as isize - margin).max(0);
            let to = guess + (planned.begins_at + planned.samples) as isize + margin;
            let to = to.clamp(0, recorded_v.len() as isize);
            let around = recorded_v.get(from.unsigned_abs()..to.unsigned_abs())?;
            let found = likeness::best(&planned.voltage_v, around);
            let whole = found.overlap == planned.samples && found.correlation > SEQUENCE;
            whole.then_some((number, planned, found.shift + from - planned.begins_at as isize))
        })
        .collect()
    }

    /// By how much longer the sequence is than it was played, parts in a million, by the first and the last of its records of one command,
    /// so that a lag of the voltage counts for nothing; none where it is not.
    fn drifted(&self, places: &[(usize, &Planned, isize)]) -> Option<f64> {
        let (_, first, start) = places.first()?;
        let same = places.iter().rfind(|(_, planned, _)| planned.check == first.check);
        let (_, last, later) = match same.filter(|(_, planned, _)| planned.begins_at > first.begins_at) {
            Some(same) => same,
            None => places.last().filter(|(_, _, later)| (later - start).abs() >= LAGS)?,
        };
        let longer = (later - start) as f64 / (last.begins_at - first.begins_at).max(1) as f64;
        // Half a sample over a record is a phase of a quarter turn at the highest line.
        (longer.abs() * first.samples as f64 >= 0.5).then_some(1e6 * longer)
    }

    /// Cuts one record; what is not there is missed by whoever asks for it.
    fn record_of(&self, at: (usize, usize), planned: &Planned, start: isize, returned: &mut Returned) {
        let step = sequence::step_of(planned, self.plan.rate_hz);
        let from = start + planned.begins_at as isize;
        let to = from + (planned.samples * step) as isize;
        if from < 0 || to > self.record.len() as isize + step as isize - 1 {
            return;
        }
        let whole = piece(self.record, from.unsigned_abs(), planned.samples, step);
        let like = likeness::at(&planned.voltage_v, &whole.voltage_v, 0, 0);
        take(planned, at, &whole, like, returned);
    }
}
