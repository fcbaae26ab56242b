//! What a designed controller is, in words: what was identified, undone and expected, and what it costs.

use hysteron_control::ControlError;
use hysteron_control::design::beyond::unknown;
use hysteron_control::design::prediction::{cost, predict, whole_stroke_um};
use hysteron_control::design::source::Designed;
use hysteron_control::design::{Controller, OpenLoop};
use hysteron_control::plan::drift::Drift;
use hysteron_identify::Covered;
use hysteron_identify::control::{ControlModel, Undone};
use hysteron_identify::covered::ToldBy;
use std::fmt::Write;

/// A designed controller; `margin` is the largest peak of the sensitivity that was asked for.
///
/// # Errors
/// Modes that the core refuses.
pub fn design_text(source: &Designed, margin: f64) -> Result<String, ControlError> {
    let controller = &source.controller;
    let mut text = String::new();
    effects(&mut text, source);
    identified(&mut text, source);
    feedforward(&mut text, controller)?;
    text.push_str("FEEDBACK\n");
    text.push_str(&feedback(controller, margin));
    learned(&mut text, controller);
    expected(&mut text, source, controller)?;
    covered(&mut text, &controller.model.covered);
    drifted(&mut text, &source.drifts);
    Ok(text)
}

/// What changed while the records were taken.
fn drifted(text: &mut String, drifts: &[Drift]) {
    for drift in drifts {
        // Writing to a String does not fail.
        let _ = writeln!(text, "WHILE IT WAS RECORDED  {drift}");
        for warning in drift.warnings() {
            let _ = writeln!(text, "  WARNING: {warning}");
        }
    }
}

/// What is learned while the law runs.
fn learned(text: &mut String, controller: &Controller) {
    if let Some(part) = &controller.adaptation {
        // Writing to a String does not fail.
        let _ = writeln!(text, "LEARNED WHILE IT RUNS");
        let _ = writeln!(text, "  gain, at most              {:8.2} %", 100.0 * part.gain_bound);
        let _ = writeln!(text, "  zero, at most              {:8.3} um", part.zero_bound_um);
        let _ = writeln!(text, "  time constant              {:8.1} s", part.time_s);
    }
}

/// The chain.
fn identified(text: &mut String, source: &Designed) {
    let model = &source.controller.model;
    // Writing to a String does not fail.
    let _ = writeln!(text, "IDENTIFIED");
    let _ = writeln!(text, "  latency                    {:8.2} us", 1e6 * model.latency_s);
    let _ = writeln!(text, "  amplifier's lag            {:8.2} us", 1e6 * model.linear.lag_s);
    if let Some([about_v, per_v]) = model.linear.lag_growth {
        let _ = writeln!(
            text,
            "    grows by                 {:8.2} % a volt about {about_v:.1} V",
            100.0 * per_v
        );
    }
    for (i, mode) in model.linear.modes.iter().enumerate() {
        let _ = writeln!(
            text,
            "  mode {}                     {:8.1} Hz, damping ratio {:.4}, share {:.3}",
            i + 1,
            mode.frequency_hz,
            mode.damping,
            mode.share
        );
    }
    let shares = &model.creep.shares;
    let mean = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
    let decades =
        (model.creep.tau_s.last().copied().unwrap_or(1.0) / model.creep.tau_s.first().copied().unwrap_or(1.0)).log10()
            / (shares.len().max(2) - 1) as f64;
    if mean > 0.0 && source.undone.is_empty() {
        let _ = writeln!(
            text,
            "  creep                      {:8.2} % a decade",
            100.0 * mean / decades
        );
    } else if mean > 0.0 {
        let sum = shares.iter().sum::<f64>();
        let _ = writeln!(
            text,
            "  creep                      {:8.2} % in the long run",
            100.0 * sum
        );
    }
    let by = model.fading.as_ref().map_or("", |_| ", by fading elements");
    let _ = writeln!(
        text,
        "  inverse of the hysteresis  {:8.3} % of the command's range missed on the records{by}",
        model.misfit_percent
    );
}

/// What becomes of a reference that is not known ahead.
pub(crate) const LIVE: &str = "smooth ones are extrapolated by as much,\n  corners and noise are amplified";

/// What is said where the model does not know its own error.
pub(crate) const NO_MODEL_ERROR: &str =
    "the model's own error is not in the file and not counted; hysteron compare or add measures it";

/// What undoes latency and modes ahead.
fn feedforward(text: &mut String, controller: &Controller) -> Result<(), ControlError> {
    let quality = controller.preview_quality()?;
    // Writing to a String does not fail.
    let _ = writeln!(text, "FEEDFORWARD");
    let _ = writeln!(
        text,
        "  reference {} samples ahead; latency and modes undone within {:.2} % to 500 Hz, {:.2} % to 1 kHz; 3 dB and 30 degrees to {:.0} Hz",
        controller.samples_ahead,
        100.0 * quality.worst_to_500_hz,
        100.0 * quality.worst_to_1_khz,
        quality.bandwidth_hz
    );
    if controller.samples_ahead == 0 {
        let latency_s = controller.model.latency_s;
        let _ = writeln!(
            text,
            "  known no earlier than due, a reference is {:.0} us late: 30 degrees at {:.0} Hz; {LIVE}",
            1e6 * latency_s,
            1.0 / (12.0 * latency_s)
        );
    }
    Ok(())
}

/// The loop, or why there is none.
pub(crate) fn feedback(controller: &Controller, margin: f64) -> String {
    match &controller.feedback {
        Some(feedback) => format!(
            "  integral and {}, {:.0} V/um/s; peak sensitivity {:.2} over modes +-10 %, loop gain 0.6 to 1.3 and a mode wherever\n  \
             nothing is told: {}; run in time on each of these, it comes to rest;\n  \
             disturbances below -3 dB to {:.0} Hz, helps to {:.0} Hz; {:.2} nm at rest for 1 nm of white sensor noise\n",
            feedback.structure,
            feedback.integral_v_per_um_s,
            feedback.peak_sensitivity,
            told(feedback.told_to_hz, &controller.model.covered),
            feedback.rejection_hz,
            feedback.helps_to_hz,
            feedback.noise_nm
        ),
        None => without_feedback(margin, controller),
    }
}

/// From where on nothing is told, and by whom below.
pub(crate) fn told(to_hz: f64, covered: &Covered) -> String {
    format!("above {to_hz:.0} Hz, by {}", told_by(covered))
}

/// Who tells the stage up to the highest frequency.
fn told_by(covered: &Covered) -> String {
    match covered.told_by() {
        Some(ToldBy::Record(file)) => format!("the record {file}"),
        Some(ToldBy::User) | None => "--rigid, your word".to_owned(),
    }
}

/// Why there is no feedback, and what would allow it.
fn without_feedback(margin: f64, controller: &Controller) -> String {
    match controller.open_loop {
        Some(OpenLoop::NotAsked) | None => "  none: not asked for\n".to_owned(),
        Some(OpenLoop::NotTold) => format!(
            "  none: no record of small signals tells up to where the stage does what the model says; a mode may be anywhere, and a\n  \
             loop makes it swing. Record one beside the others and fit again, such as\n    {}\n  \
             or give your word that there is no mode below HZ but those of the model: --rigid HZ\n",
            small_multisine(&controller.model)
        ),
        Some(OpenLoop::NoneRobust) => format!(
            "  none: no loop keeps its peak sensitivity below {margin} over modes +-10 %, loop gain 0.6 to 1.3 and a mode above\n  \
             {:.0} Hz, where nothing is told; a larger --margin, or a record of small signals to higher frequencies, may allow one\n",
            controller.model.covered.told_to_hz().unwrap_or(f64::NAN)
        ),
        Some(OpenLoop::Swings) => "  none: every loop that was designed swings when it is run in time on the model with modes +-10 % and loop gain \
             0.6 to 1.3;\n  a smaller --margin may give one that holds\n"
            .to_owned(),
    }
}

/// The record that would allow a loop, as an excitation: 3 % of the range about its middle, to an eighth of the controller's rate.
fn small_multisine(model: &ControlModel) -> String {
    let [low_v, high_v] = model
        .covered
        .voltage_v
        .unwrap_or([model.voltage_min_v, model.voltage_max_v]);
    format!(
        "multisine:low_hz=20,high_hz={:.0},period_s=0.1,periods=8,bias_v={:.4},peak_v={:.3}",
        0.125 / model.sample_period_s,
        0.5 * (low_v + high_v),
        0.03 * (high_v - low_v)
    )
}

/// What the records cover, and what leaves them.
fn covered(text: &mut String, covered: &Covered) {
    // Writing to a String does not fail.
    let _ = writeln!(text, "COVERED by the records: {}", covered_line(covered));
    for beyond in &covered.beyond {
        let _ = writeln!(text, "  BEYOND THE RECORDS: {beyond}");
    }
}

/// What the records cover.
pub(crate) fn covered_line(covered: &Covered) -> String {
    let pair = |ends: Option<[f64; 2]>, unit: &str| {
        ends.map_or_else(
            || "not known".to_owned(),
            |[low, high]| format!("{low:.4} to {high:.4} {unit}"),
        )
    };
    let one = |value: Option<f64>, unit: &str| {
        value.map_or_else(|| "not known".to_owned(), |value| format!("{value:.0} {unit}"))
    };
    format!(
        "{}, {}; slew to {}, rate {}, large references to {}, small signals to {}",
        pair(covered.voltage_v, "V"),
        pair(covered.position_um, "um"),
        one(covered.slew_v_per_s, "V/s"),
        one(covered.sample_rate_hz, "Hz"),
        one(covered.swing_hz, "Hz"),
        one(covered.small_signal.as_ref().map(|band| band.up_to_hz), "Hz")
    )
}

/// What undoes a part of the model, and why not or within what limits.
pub(crate) fn compensator(undone: &Undone) -> (&'static str, &'static str) {
    (undone.by.unwrap_or("LEFT OUT"), undone.note)
}

/// Each effect of the model with its compensator, or why it has none.
fn effects(text: &mut String, source: &Designed) {
    if source.undone.is_empty() {
        return;
    }
    text.push_str("EFFECTS\n");
    for undone in &source.undone {
        let (by, note) = compensator(undone);
        let _ = writeln!(text, "  {:<26} {by}: {note}", undone.part);
    }
}

/// What the controller will reach, what limits it, and what it costs.
fn expected(text: &mut String, source: &Designed, controller: &Controller) -> Result<(), ControlError> {
    text.push_str("EXPECTED, sine over the whole range, % of peak to peak\n");
    // What is not known is not taken for nothing.
    let known = source.model_percent.is_some() || !controller.model.held_out.is_empty();
    let least = if known { "" } else { "at least " };
    for at in predict(controller, whole_stroke_um(controller), source.model_percent)? {
        // Writing to a String does not fail.
        let _ = write!(text, "  {:>5} Hz  ", at.frequency_hz);
        let _ = match (at.error, at.beyond) {
            (Some(error), _) => writeln!(
                text,
                "open {least}{:.3}, closed {}; most of it from {}",
                error.open_percent,
                error
                    .closed_percent
                    .map_or_else(|| "-".to_owned(), |percent| format!("{least}{percent:.3}")),
                error.limited_by
            ),
            (None, Some(beyond)) => writeln!(text, "beyond the records: {}", unknown(&beyond)),
            (None, None) => writeln!(text, "-"),
        };
    }
    if let (None, Some(rms_um)) = (&controller.feedback, controller.model.model_error_um) {
        let _ = writeln!(
            text,
            "  the model misses its records by up to {rms_um:.4} um rms, which a board allows for before it takes the stage for another"
        );
    }
    if !known {
        let _ = writeln!(text, "  {NO_MODEL_ERROR}");
    }
    let costs = cost(controller);
    let total: usize = costs.iter().map(|cost| cost.operations).sum();
    let _ = writeln!(text, "COST A TICK  {total} multiply-adds and compares");
    for cost in &costs {
        let _ = writeln!(text, "  {:<36} {:>4}", cost.block, cost.operations);
    }
    Ok(())
}
