//! Why a figure of ours is what it is, in sentences computed from the result.

use crate::paper::{Bandwidth, Study, TRACKED_HZ, find, first_play_lead_s};
use hysteron_control::figures::{RunFigures, lateness_us};
use hysteron_identify::Family;
use hysteron_identify::family::peak_to_peak;

/// Shares of the squared error below this, percent, are not worth a word.
const WORTH_SAYING: f64 = 10.0;

/// What the error of a run consists of.
pub(super) fn composition(figures: &RunFigures) -> String {
    let mut parts = Vec::new();
    let (late, gain, offset) = (
        figures.late_share_percent,
        figures.gain_share_percent,
        figures.offset_share_percent,
    );
    if late >= WORTH_SAYING {
        let word = if figures.late_us > 0.0 { "late" } else { "early" };
        parts.push(format!("{late:.0} % by being {:.0} us {word}", figures.late_us.abs()));
    }
    if gain >= WORTH_SAYING {
        let word = if figures.gain_percent > 0.0 { "small" } else { "large" };
        parts.push(format!(
            "{gain:.0} % by an amplitude {:.1} % too {word}",
            figures.gain_percent.abs()
        ));
    }
    if offset >= WORTH_SAYING {
        parts.push(format!("{offset:.0} % by its mean"));
    }
    let shape = 100.0 - late - gain - offset;
    if shape >= WORTH_SAYING {
        parts.push(format!("{shape:.0} % by the shape within a period"));
    }
    parts.join(", ")
}

/// The error at 500 Hz of one controller on both stages, against the paper's.
pub(super) fn at_500_hz(studies: &[Study], closed: bool, inverse: Option<Family>, paper: f64) -> Vec<String> {
    let (mut remarks, mut mostly_late) = (Vec::new(), false);
    for study in studies {
        let figures = if closed { &study.closed_loop } else { &study.open_loop };
        let Some(found) = find(figures, inverse, 500.0) else {
            continue;
        };
        let f = &found.figures;
        mostly_late |= f.late_share_percent > 50.0 && f.late_us > 0.0;
        let mut text = format!("{}: of the squared error, {}", study.preset, composition(f));
        if f.true_percent > 1.1 * f.measured_percent {
            text.push_str(&format!(
                "; the platform itself is {:.1} % off, which the sensor does not see",
                f.true_percent
            ));
        }
        if found.limited_percent > 0.0 {
            text.push_str(&format!(
                "; the command meets the amplifier's limits on {:.1} % of samples",
                found.limited_percent
            ));
        }
        remarks.push(text + ".");
    }
    if let (Some(late_us), true) = (lateness_us(paper, 500.0), mostly_late) {
        remarks.push(format!(
            "The paper's {paper} % is what being {late_us:.0} us late gives by itself."
        ));
    }
    remarks
}

/// The same inverse with the other reading of K_j in eq. 17.
pub(super) fn other_counting(studies: &[Study], family: Family) -> Option<String> {
    let of = |study: &Study| {
        let figure = find(&study.open_loop_equal_periods, Some(family), 500.0)?;
        Some(format!("{:.1} % on {}", figure.figures.measured_percent, study.preset))
    };
    let found: Option<Vec<String>> = studies.iter().map(of).collect();
    Some(format!(
        "Eq. 17 does not say how many samples of each sine; ours has as many of each. With as many periods of each, which \
         makes 10 Hz count 50 times as much as 500 Hz, it is {}.",
        found?.join(" and ")
    ))
}

/// What one more sample of computing would do.
pub(super) fn latency(studies: &[Study]) -> Option<String> {
    let found: Option<Vec<String>> = studies
        .iter()
        .map(|study| {
            let late = study.open_loop_one_sample_late?;
            Some(format!("{:.1} % on {}", late.figures.measured_percent, study.preset))
        })
        .collect();
    Some(format!(
        "The loop's latency is that of the records, as on a controller that does both. With one more sample of 20 us it \
         would be {}: the paper's 1.6 % leaves no room for that.",
        found?.join(" and ")
    ))
}

/// Where amplitude pulls the fit both ways.
pub(super) fn gain_against_rate(study: &Study) -> Option<String> {
    let slow = find(&study.open_loop, Some(Family::Mrpi), TRACKED_HZ[0])?.figures;
    let fast = find(&study.open_loop, Some(Family::Mrpi), 500.0)?.figures;
    let opposed = slow.gain_percent * fast.gain_percent < 0.0;
    let heavy = slow.gain_share_percent.min(fast.gain_share_percent) >= 30.0;
    let strokes_um: Vec<f64> = study
        .records
        .records
        .iter()
        .map(|record| peak_to_peak(&record.position_um))
        .collect();
    let lead_s = first_play_lead_s(&study.inverses.get(2)?.model)?;
    (opposed && heavy && strokes_um.len() > 2).then(|| {
        let side = |percent: f64| if percent > 0.0 { "small" } else { "large" };
        format!(
            "{}: the fit compromises on amplitude, which is {:.1} % too {} at 10 Hz ({:.0} % of the squared error there) \
             and {:.1} % too {} at 500 Hz ({:.0} %). From 10 to 500 Hz the stage's own stroke at 26 V changes by {:+.1} %; the \
             inverse's lead of {:.0} us raises its voltage by (w tau)^2 / 2 = {:.1} %.",
            study.preset,
            slow.gain_percent.abs(),
            side(slow.gain_percent),
            slow.gain_share_percent,
            fast.gain_percent.abs(),
            side(fast.gain_percent),
            fast.gain_share_percent,
            100.0 * (strokes_um[2] / strokes_um[0] - 1.0),
            1e6 * lead_s,
            50.0 * (std::f64::consts::TAU * 500.0 * lead_s).powi(2)
        )
    })
}

/// From where on feedback raises the error of an inverse, against the paper's statement on it.
pub(super) fn feedback_helps(study: &Study, family: Family) -> String {
    let error = |closed: bool, hz: f64| {
        let figures = if closed { &study.closed_loop } else { &study.open_loop };
        find(figures, Some(family), hz).map(|found| found.figures.measured_percent)
    };
    let name = family.name().to_uppercase();
    let (mut lower, mut higher) = (Vec::new(), Vec::new());
    for hz in TRACKED_HZ {
        if let (Some(open), Some(closed)) = (error(false, hz), error(true, hz)) {
            let list = if closed < open { &mut lower } else { &mut higher };
            list.push(format!("{hz:.0}"));
        }
    }
    match (lower.is_empty(), higher.is_empty()) {
        (_, true) => format!(
            "{}: feedback lowers the error of {name} at every frequency.",
            study.preset
        ),
        (true, false) => format!(
            "{}: feedback raises the error of {name} at every frequency.",
            study.preset
        ),
        _ => format!(
            "{}: feedback lowers the error of {name} at {} Hz and raises it at {} Hz.",
            study.preset,
            lower.join(", "),
            higher.join(", ")
        ),
    }
}

/// A bandwidth as a latency, and how it depends on the noise's amplitude.
pub(super) fn bandwidth(study: &Study, index: usize) -> Option<String> {
    let own = study.bandwidths.get(index)?;
    let crossing = own.lag_30_deg?;
    let others: Option<Vec<String>> = study
        .other_bandwidths
        .iter()
        .map(|list| Some(hertz(list.get(index)?)))
        .collect();
    let others = others?;
    let gain_db = match own.minus_3_db {
        Some(crossing) => format!("its gain falls to -3 dB at {:.0} Hz", crossing.frequency_hz),
        None => {
            let largest = own.response.gain.iter().copied().fold(0.0, f64::max);
            format!(
                "its gain stays above -3 dB up to 5 kHz and reaches {:.1} dB",
                20.0 * largest.log10()
            )
        }
    };
    Some(format!(
        "{}: as a latency, 1 / (12 f), {:.0} us; coherence {:.2} there; {gain_db}. With noise of 1 % of the range {}, with 15 % {}.",
        study.preset,
        1e6 / (12.0 * crossing.frequency_hz),
        crossing.coherence,
        others[0],
        others[1]
    ))
}

/// A bandwidth, or why there is none.
fn hertz(bandwidth: &Bandwidth) -> String {
    match bandwidth.lag_30_deg {
        Some(crossing) if crossing.coherence > 0.5 => format!("{:.0} Hz", crossing.frequency_hz),
        Some(crossing) => format!(
            "nothing that could be told (coherence {:.2}, command at its limits on {:.1} % of samples)",
            crossing.coherence, bandwidth.limited_percent
        ),
        None => "above 5 kHz".to_owned(),
    }
}
