//! How a scenario has ended, against how it must.

use crate::host::Axis;
use crate::processor::Failure;
use crate::rig::Rig;
use crate::scenarios::{End, Scenario, Steps, Wrong};
use hysteron_board::Mode;

/// What came of a scenario on one image.
pub(crate) struct Row {
    /// The scenario.
    pub(crate) name: &'static str,
    /// Milliseconds and codes that are allowed.
    pub(crate) at_most: String,
    /// Those that it took.
    pub(crate) took: String,
    /// How it ended.
    pub(crate) end: String,
    /// Whether all of it is as it must be.
    pub(crate) is_right: bool,
}

/// Runs a scenario from power on.
pub(crate) fn judge(rig: &mut Rig, scenario: &Scenario) -> Result<Row, Failure> {
    rig.power_on()?;
    let ran = (scenario.run)(rig);
    let after_ms = rig.ms(rig.way.settled - rig.way.since);
    let (step, most_step) = steps(rig, scenario.steps);
    let checks = [
        (rig.is_safe(), Wrong::Unsafe),
        (!rig.is_safe() || after_ms <= scenario.at_most_ms, Wrong::Late),
        (step <= most_step, Wrong::Step),
        (has_ended(rig, scenario.end), Wrong::End),
        (rig.counts.different == 0 && rig.counts.silent == 0, Wrong::Codes),
        (!rig.unwritten_read, Wrong::Memory),
        (!rig.unguarded, Wrong::Unguarded),
        (ran.is_ok(), Wrong::Way),
    ];
    let wrong: Vec<Wrong> = checks
        .iter()
        .filter(|(holds, _)| !holds)
        .map(|&(_, what)| what)
        .collect();
    let (known, why) = scenario.open.unwrap_or((&[], ""));
    // Of an open one, not all of it need be so on every board.
    let is_right = wrong.is_empty() == known.is_empty() && wrong.iter().all(|what| known.contains(what));
    let end = if !is_right {
        let at = format!("{:?}, {:?}, {} resets", rig.mode(), rig.fault(), rig.counts.bites);
        let reason = ran.err().map_or_else(String::new, |error| format!("; {error}"));
        format!("WRONG: {wrong:?}, not {known:?} ({at}{reason})")
    } else if known.is_empty() {
        scenario.end.words(rig)
    } else {
        format!("OPEN: {why}")
    };
    let after = if rig.is_safe() {
        format!("{after_ms:.1}")
    } else {
        "never".to_owned()
    };
    Ok(Row {
        name: scenario.name,
        at_most: format!("{:.0}, {most_step}", scenario.at_most_ms),
        took: format!("{after}, {step}"),
        end,
        is_right,
    })
}

/// The largest step that counts, and the largest that may be, codes.
fn steps(rig: &Rig, steps: Steps) -> (u16, u16) {
    let most = |codes: fn(&Axis) -> u16| rig.axes.iter().map(codes).max().unwrap_or_default();
    // The limiter counts in volts: a code more by rounding.
    match steps {
        Steps::Ramp => (rig.way.largest_step, most(Axis::ramp) + 1),
        Steps::RampAfterLaw => (rig.way.largest_after_law, most(Axis::ramp) + 1),
        Steps::RampAfterLate => (rig.way.largest_after_law, most(Axis::ramp) + 1 + rig.way.largest_of_law),
        Steps::Law => (rig.way.largest_step, most(Axis::slew) + 1),
    }
}

fn has_ended(rig: &Rig, end: End) -> bool {
    let waits = rig.is_looping() && rig.mode() == Mode::Off && rig.counts.bites <= 1;
    match end {
        End::Waiting(fault) => waits && rig.fault() == fault,
        End::WaitingForSensor => waits && rig.fault().is_some_and(|fault| fault.is_of_the_sensor()),
        End::Resetting => rig.counts.bites >= 2,
    }
}

impl End {
    fn words(self, rig: &Rig) -> String {
        match (self, rig.fault()) {
            (Self::Resetting, _) => "resets again and again, safe".to_owned(),
            (_, None) => "waits, no fault".to_owned(),
            (_, Some(fault)) => format!("waits, fault {} latched", fault as u8),
        }
    }
}
