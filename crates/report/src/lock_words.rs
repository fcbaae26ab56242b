//! Where a model fails and what an error goes with, in plain sentences.

use crate::number::{percent, significant};
use hysteron_diagnose::diagnosis::{Diagnosis, Lock, LockTo, Verdict, WhereItFails};

/// Share of a squared error from which what it goes with is named.
const NAMED: f64 = 0.1;

/// Things that are named of one error.
const MOST_NAMED: usize = 3;

/// Whether anything can be missing and where the model fails: what stands before the verdict.
pub fn failing_lines(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines = Vec::new();
    let noise = diagnosis.unexplained.noise_percent;
    let judged = [
        (diagnosis.before.validate_percent, "records it was not fitted to"),
        (diagnosis.before.identify_percent, "the records it was fitted to"),
    ];
    if let Some((error, records)) = judged.into_iter().find_map(|(e, records)| Some((e?, records)))
        && noise > 0.0
    {
        lines.push(format!(
            "On {records} the model leaves {} of peak to peak; the sensor's noise alone is {}. Ten plays leave 0.24 to 0.97\u{a0}% \
             on stages in which nothing is missing: what a hysteresis of free shape leaves says more.",
            percent(error),
            percent(noise)
        ));
    }
    let fails = &diagnosis.where_it_fails;
    // An answer that was kept from before this was asked.
    if *fails == WhereItFails::default() {
        return lines;
    }
    let share = |share: f64| format!("{:.0}\u{a0}%", 100.0 * share);
    let linear = format!(
        "One linear filter of the drive takes {} of its squared error",
        share(fails.linear_in_drive)
    );
    lines.push(match (fails.repeats_with_drive, fails.nonlinear_in_drive) {
        (Some(repeats), Some(nonlinear)) => format!(
            "{linear}. In {} {} repeats with the drive, {} repeats and is not linear.",
            match fails.periodic_records {
                1 => "the one periodic record".to_owned(),
                n => format!("{n} periodic records"),
            },
            share(repeats),
            share(nonlinear),
        ),
        _ => format!("{linear}; no drive repeats in these records."),
    });
    match locked(&fails.locked_to) {
        Some(names) => lines.push(format!("The error goes with {names}.")),
        None => lines.push("The error goes with nothing that was looked at by more than a tenth.".to_owned()),
    }
    lines
}

/// What is left unexplained goes with, and, where that is all there is to say, where to look.
pub(crate) fn left_line(diagnosis: &Diagnosis) -> Option<String> {
    let locks = &diagnosis.unexplained.locked_to;
    let names = locked(locks)?;
    let look = locks
        .first()
        .filter(|_| diagnosis.verdict == Verdict::Unknown)
        .map_or(String::new(), |lock| format!(": {}", where_to_look(lock)));
    Some(format!("The unexplained error goes with {names}{look}."))
}

fn locked(locks: &[Lock]) -> Option<String> {
    let named: Vec<String> = locks
        .iter()
        .filter(|lock| lock.share > NAMED)
        .take(MOST_NAMED)
        .map(|lock| format!("{} ({:.0}\u{a0}%)", lock_in_words(lock), 100.0 * lock.share))
        .collect();
    match named.split_last()? {
        (last, []) => Some(last.clone()),
        (last, others) => Some(format!("{} and {last}", others.join(", "))),
    }
}

/// A quantity as a part of a sentence.
pub fn lock_in_words(lock: &Lock) -> String {
    let value = |name: &str| lock.parameters.iter().find(|p| p.name == name).map(|p| p.value);
    let name = match lock.to {
        LockTo::PositionAndSpeed => "position and speed together",
        LockTo::CycleCount => "the cycle count",
        LockTo::RecordOrder => "the order of the records",
        LockTo::Record => "single records",
        LockTo::SampleClock => "the sample clock",
        LockTo::OtherAxis => "the other axis",
        LockTo::Time | LockTo::Position | LockTo::Speed | LockTo::Temperature => lock.to.as_str(),
    };
    if let Some(hz) = value("frequency") {
        format!("{name}, a line at {}\u{a0}Hz", significant(hz))
    } else if let Some(s) = value("jitter_rms") {
        format!("{name}, a jitter of {}\u{a0}us rms", significant(1e6 * s))
    } else if let Some(samples) = value("every") {
        format!("{name}, every {samples:.0} samples")
    } else {
        name.to_owned()
    }
}

/// What makes an error that goes with a quantity and has no effect in the catalogue.
fn where_to_look(lock: &Lock) -> &'static str {
    match lock.to {
        LockTo::Time if !lock.parameters.is_empty() => "a vibration, of a fan, a pump, the floor or another loop",
        LockTo::Time => "it changes with time, whatever the drive does",
        LockTo::Position => "a function of the position, as of a scale's interpolation or a linearisation table",
        LockTo::Speed => {
            "a function of the speed, of another form than the catalogue's delays, lags and rate dependence"
        }
        LockTo::PositionAndSpeed => "a lag or a friction that depends on the position",
        LockTo::CycleCount => {
            "the gain changes with the cycles that were run, as of heating by its own losses or fatigue"
        }
        LockTo::RecordOrder => {
            "the gain or the zero changes from record to record, as of ageing, depolarisation or warming up"
        }
        LockTo::Record => "gain or zero of single records differ",
        LockTo::SampleClock => {
            "instants scatter or samples are lost: look at the trigger and the buffers of the recorder"
        }
        LockTo::Temperature => "it follows the temperature by another law than a drift of position or gain",
        LockTo::OtherAxis => "it follows the other axis by another law than a cross-coupling in proportion",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_diagnose::diagnosis::EffectParameter;

    #[test]
    fn golden_locks_read_as_words() {
        let lock = |to: LockTo, share: f64, parameters: Vec<EffectParameter>| Lock { to, share, parameters };
        let frequency = EffectParameter {
            name: "frequency".to_owned(),
            value: 173.24,
            unit: "Hz".to_owned(),
        };
        let locks = [
            lock(LockTo::Time, 0.82, vec![frequency]),
            lock(LockTo::RecordOrder, 0.4, Vec::new()),
            lock(LockTo::Speed, 0.09, Vec::new()),
        ];
        assert_eq!(
            locked(&locks).as_deref(),
            Some("time, a line at 173\u{a0}Hz (82\u{a0}%) and the order of the records (40\u{a0}%)")
        );
        assert_eq!(locked(&locks[2..]), None);
    }
}
