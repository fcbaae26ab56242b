//! The table of a controller that `hysteron design` wrote.

use super::{Ends, ExportArgs, Format, top};
use crate::commands::simulate::StageName;
use crate::error::CliError;
use hysteron_control::design::Controller;
use hysteron_control::design::prediction::predict;
use hysteron_core::law_numbers::LawNumbers;
use hysteron_core::model::{AtRest as _, Hysteresis as _};
use hysteron_table::{FORMAT, Family, LEAST_TRUST, Table};
use std::fmt::Write;

/// The whole range in five samples at 50 kHz: a sine of 1 kHz over the whole of it has pi thousand ranges a second, and the turns of a
/// triangle of half the stroke, with a mode at 739 Hz undone, more than five thousand: cut to those, they ring (0.4 % of error for 0.07).
pub(crate) const SLEW_RANGES_PER_S: f64 = 1e4;

/// The table, its references by default as far as the inverse stays within the amplifier.
pub(super) fn table(controller: &Controller, args: &ExportArgs) -> Result<(Table, Ends), CliError> {
    for (option, given) in [
        ("--mode and --damping", args.mode.is_some()),
        ("--latency-us", args.latency_us.is_some()),
        ("--rate", args.rate.is_some()),
        ("--integral", args.integral.is_some()),
        ("--proportional", args.proportional != 0.0),
    ] {
        if given {
            return Err(CliError::Option(format!(
                "{option}: the controller has its own rate, latency, modes and feedback; leave the option out, or design again"
            )));
        }
    }
    let numbers = LawNumbers {
        cross_um_per_um: args.cross,
        ..controller.numbers()?
    };
    let stage = args.stage.map(StageName::config);
    let covered = &controller.model.covered;
    // Without a word about the amplifier its limits are those that the controller was designed with.
    let own_v = [numbers.command_min_v, numbers.command_max_v];
    let mut ends = Ends::of(stage.as_ref(), covered, Some(own_v), args)?;
    let (dac_top_v, adc_top_um) = (top(ends.dac_v), top(ends.adc_um));
    let amplifier_v = ends.amplifier_v;
    let output_min_v = numbers.command_min_v.max(amplifier_v[0]).max(ends.dac_v[0]);
    let output_max_v = numbers.command_max_v.min(amplifier_v[1]).min(dac_top_v);
    let [lowest_um, highest_um] = within(
        reach_um(&numbers, [output_min_v, output_max_v])?,
        covered.position_um.filter(|_| !args.beyond_records),
    );
    let input_min_um = args.input_min.unwrap_or(lowest_um);
    let input_max_um = args.input_max.unwrap_or(highest_um);
    let limits = (
        [output_min_v, output_max_v],
        [input_min_um, input_max_um],
        numbers.sample_rate_hz,
    );
    let bare = Table {
        format: FORMAT.to_owned(),
        input_min_um,
        input_max_um,
        covered: ends.covered(covered, limits, args)?,
        output_min_v,
        output_max_v,
        safe_v: 0.0,
        slew_v_per_s: (output_max_v - output_min_v) * SLEW_RANGES_PER_S,
        ramp_v_per_s: (output_max_v - output_min_v) * super::RAMP_RANGES_PER_S,
        feedback_up_to_hz: args
            .feedback_up_to
            .or_else(|| Some(controller.feedback.as_ref()?.helps_to_hz))
            .unwrap_or(0.5 * numbers.sample_rate_hz),
        dac_min_v: ends.dac_v[0],
        dac_top_v,
        adc_min_um: ends.adc_um[0],
        adc_top_um,
        ..super::empty(Family::PlayPolynomial)
    };
    let bound_um = match args.feedback_bound_um {
        Some(bound_um) if bound_um.is_finite() && bound_um > 0.0 => bound_um,
        Some(bound_um) => {
            return Err(CliError::Option(format!(
                "--feedback-bound-um {bound_um} must be positive and finite: micrometres, a few percent of the range"
            )));
        }
        None => needed_um(controller, bare.input_max_um - bare.input_min_um)?,
    };
    let mut table = bare.with_law(&numbers).trusting(bound_um);
    if let Some(part) = &mut table.controller {
        part.model_error_um = controller.model.model_error_um;
    }
    // Where C runs there may be a thermometer.
    if let (Format::C, Some(part)) = (args.format, &mut table.controller) {
        part.heat = numbers.heat;
    }
    Ok((table, ends))
}

/// Rms of an error to what a feedback needs for it: the peak of a sine is 1.4 of it, that of a history's errors three.
const NEED_OF_RMS: f64 = 4.0;

/// What the feedback needs by the design's own prediction of what the feedforward leaves, micrometres.
fn needed_um(controller: &Controller, range_um: f64) -> Result<f64, CliError> {
    let predicted = predict(controller, None)?;
    let worst_percent = predicted.iter().map(|at| at.open_percent).fold(0.0, f64::max);
    Ok(range_um * (NEED_OF_RMS * worst_percent / 100.0).max(LEAST_TRUST))
}

/// Steps of the sweep: the table's own check takes as many.
const STEPS: u32 = 1000;

/// What the voltages reach, as far as the records cover it: a range that nobody asked for leaves nothing.
fn within([lowest_um, highest_um]: [f64; 2], covered_um: Option<[f64; 2]>) -> [f64; 2] {
    let [low_um, high_um] = covered_um.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    [lowest_um.max(low_um), highest_um.min(high_um)]
}

/// References whose voltage at rest is within limits both on the way up and on the way down again, a thousandth of them left free at
/// either end, micrometres.
fn reach_um(numbers: &LawNumbers, [min_v, max_v]: [f64; 2]) -> Result<[f64; 2], CliError> {
    let inverse = numbers
        .inverse
        .inverse::<f64>(numbers.sample_rate_hz)
        .map_err(|error| CliError::Option(format!("the controller's inverse: {error}; design it again")))?;
    let (low, high) = (numbers.inverse.min_um, numbers.inverse.max_um);
    let at = |k: u32| low + (high - low) * f64::from(k) / f64::from(STEPS);
    let mut state = inverse.at_rest(0.0, 0.0);
    // Plays of one side begin all in line after a way down.
    inverse.step(&mut state, high);
    let mut reach = [f64::INFINITY, f64::NEG_INFINITY];
    for k in (0..=STEPS).rev() {
        if inverse.step(&mut state, at(k)) >= min_v {
            reach[0] = at(k);
        } else {
            break;
        }
    }
    (0..=STEPS).map(at).for_each(|x| {
        if inverse.step(&mut state, x) <= max_v {
            reach[1] = x;
        }
    });
    let free = (high - low) / f64::from(STEPS);
    Ok([
        reach[0].max(low) + free + numbers.rest_um,
        reach[1].min(high) - free + numbers.rest_um,
    ])
}

/// How far the feedback may go, in words.
fn bound_said(table: &Table) -> String {
    let trust = table
        .controller
        .as_ref()
        .and_then(|part| part.feedback.as_ref()?.trust.as_ref());
    trust.map_or_else(String::new, |trust| {
        format!(
            ";\nit moves the command by {:.2} V at once and {:.2} V in all, whatever the sensor says; --feedback-bound-um changes that",
            2.0 * trust.quick_v,
            trust.quick_v + trust.slow_v
        )
    })
}

/// How far an open loop may be off, in words.
fn departure_said(table: &Table) -> String {
    let Some(departure_um) = table.open_loop_departure_um() else {
        return String::new();
    };
    let missed_um = table.controller.as_ref().and_then(|part| part.model_error_um);
    let known = missed_um.map_or_else(
        || "the model does not say what it misses on its records".to_owned(),
        |rms_um| format!("the model misses its records by up to {rms_um:.4} um rms"),
    );
    format!(";\n{known}: {departure_um:.4} um off are another stage or sensor, and the board stops")
}

/// What the command says of it.
pub(super) fn said(table: &Table, controller: &Controller) -> String {
    let mut text = format!(
        "complete law: {} plays, {} preview coefficients, reference {} samples ahead, {:.4} to {:.4} um\n",
        table.thresholds_um.len(),
        controller.preview.len(),
        controller.samples_ahead,
        table.input_min_um,
        table.input_max_um
    );
    // Writing to a String does not fail.
    let _ = match &controller.feedback {
        Some(feedback) => writeln!(
            text,
            "feedback {}: integral gain {:.0} V/(um s), on for references up to {:.0} Hz{}",
            feedback.structure,
            feedback.integral_v_per_um_s,
            table.feedback_up_to_hz,
            bound_said(table)
        ),
        None => writeln!(
            text,
            "open loop: the controller has no feedback{}",
            departure_said(table)
        ),
    };
    let taken = table.controller.as_ref().is_some_and(|part| part.heat.is_some());
    if controller.model.around.heat.is_some() && !taken {
        text.push_str("heat is left out: boards have no thermometer; the feedback takes what it can of it\n");
    }
    text
}
