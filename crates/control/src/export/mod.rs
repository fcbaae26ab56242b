//! The firmware's table of a controller: the complete law, between the ends of the bench that it runs on.

mod ends;

pub use ends::{Ends, top};

use crate::design::Controller;
use crate::design::prediction::{PREDICTED_HZ, reckon};
use crate::error::ControlError;
use crate::message::{Message, Setting};
use hysteron_core::law_numbers::LawNumbers;
use hysteron_core::model::{AtRest as _, Hysteresis as _};
use hysteron_table::{FORMAT, Family, LEAST_TRUST, Table};

/// The whole range in five samples at 50 kHz: a sine of 1 kHz over the whole of it has pi thousand ranges a second, and the turns of a
/// triangle of half the stroke, with a mode at 739 Hz undone, more than five thousand: cut to those, they ring (0.4 % of error for 0.07).
pub const SLEW_RANGES_PER_S: f64 = 1e4;

/// The whole range in 20 ms: many periods of every mode above 200 Hz, which it then does not excite.
pub const RAMP_RANGES_PER_S: f64 = 50.0;

/// Converters and amplifier of a built-in stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageEnds {
    /// Volts that the stack may be given.
    pub amplifier_v: [f64; 2],
    /// Volts at the stack of the DAC's lowest code and of full scale.
    pub dac_v: [f64; 2],
    /// Micrometres of the ADC's lowest code and of full scale.
    pub adc_um: [f64; 2],
}

/// The bench that a table is made for; what is left out comes from the built-in stage, the records or the controller.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Bench {
    /// The file that the table is made of, for messages.
    pub source: String,
    /// A built-in stage.
    pub stage: Option<StageEnds>,
    /// Volts that the stack may be given.
    pub amplifier_v: Option<[f64; 2]>,
    /// Volts at the stack of the DAC's lowest code and of full scale, one step above its highest.
    pub dac_v: Option<[f64; 2]>,
    /// Micrometres of the ADC's lowest code and of full scale, one step above its highest.
    pub adc_um: Option<[f64; 2]>,
    /// Lowest reference, micrometres.
    pub input_min_um: Option<f64>,
    /// Highest reference, micrometres.
    pub input_max_um: Option<f64>,
    /// Feedback is whole up to this frequency of the reference and none from twice it, hertz.
    pub feedback_up_to_hz: Option<f64>,
    /// How far the feedback may take the platform from where the feedforward has it, micrometres.
    pub feedback_bound_um: Option<f64>,
    /// What of the other axis' motion reaches this one, micrometres per micrometre.
    pub cross_um_per_um: Option<f64>,
    /// Whether what the records cover may be left; the table remembers it.
    pub beyond_records: bool,
    /// Whether a thermometer stands where the law runs.
    pub thermometer: bool,
}

/// A controller's table, and where its ends come from.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// The table.
    pub table: Table,
    /// Where converters and amplifier come from and what leaves the records, a line each.
    pub told: Vec<Message>,
}

/// The table of a controller, its references by default as far as the inverse stays within the amplifier.
///
/// # Errors
/// [`ControlError::Wish`] for a bench that nothing tells, or that leaves the records; numbers that the core refuses.
pub fn export(controller: &Controller, bench: &Bench) -> Result<Exported, ControlError> {
    let numbers = LawNumbers {
        cross_um_per_um: bench.cross_um_per_um,
        ..controller.numbers()?
    };
    let covered = &controller.model.covered;
    // Without a word about the amplifier its limits are those that the controller was designed with.
    let own_v = [numbers.command_min_v, numbers.command_max_v];
    let mut ends = Ends::of(bench, covered, Some(own_v))?;
    let (dac_top_v, adc_top_um) = (top(ends.dac_v), top(ends.adc_um));
    let amplifier_v = ends.amplifier_v;
    let output_min_v = numbers.command_min_v.max(amplifier_v[0]).max(ends.dac_v[0]);
    let output_max_v = numbers.command_max_v.min(amplifier_v[1]).min(dac_top_v);
    let [lowest_um, highest_um] = within(
        reach_um(&numbers, [output_min_v, output_max_v])?,
        covered.position_um.filter(|_| !bench.beyond_records),
    );
    let input_min_um = bench.input_min_um.unwrap_or(lowest_um);
    let input_max_um = bench.input_max_um.unwrap_or(highest_um);
    let limits = (
        [output_min_v, output_max_v],
        [input_min_um, input_max_um],
        numbers.sample_rate_hz,
    );
    let bare = Table {
        format: FORMAT.to_owned(),
        input_min_um,
        input_max_um,
        covered: ends.covered(covered, limits, bench.beyond_records)?,
        output_min_v,
        output_max_v,
        safe_v: 0.0,
        slew_v_per_s: (output_max_v - output_min_v) * SLEW_RANGES_PER_S,
        ramp_v_per_s: (output_max_v - output_min_v) * RAMP_RANGES_PER_S,
        feedback_up_to_hz: bench
            .feedback_up_to_hz
            .or_else(|| Some(controller.feedback.as_ref()?.helps_to_hz))
            .unwrap_or(0.5 * numbers.sample_rate_hz),
        dac_min_v: ends.dac_v[0],
        dac_top_v,
        adc_min_um: ends.adc_um[0],
        adc_top_um,
        ..Table::empty(Family::PlayPolynomial)
    };
    let bound_um = match bench.feedback_bound_um {
        Some(bound_um) if bound_um.is_finite() && bound_um > 0.0 => bound_um,
        Some(bound_um) => {
            return Err(ControlError::Wish(Message::from(Setting::FeedbackBoundUm).and(
                format!(" {bound_um} must be positive and finite: micrometres, a few percent of the range"),
            )));
        }
        None => needed_um(controller, bare.input_max_um - bare.input_min_um)?,
    };
    let mut table = bare.with_law(&numbers).trusting(bound_um);
    if let Some(part) = &mut table.controller {
        part.model_error_um = controller.model.model_error_um;
    }
    // Where C runs there may be a thermometer.
    if let (true, Some(part)) = (bench.thermometer, &mut table.controller) {
        part.heat = numbers.heat;
    }
    Ok(Exported { table, told: ends.told })
}

/// Rms of an error to what a feedback needs for it: the peak of a sine is 1.4 of it, that of a history's errors three.
const NEED_OF_RMS: f64 = 4.0;

/// What the feedback needs by the design's own prediction of what the feedforward leaves, micrometres.
fn needed_um(controller: &Controller, range_um: f64) -> Result<f64, ControlError> {
    let mut worst_percent = 0.0_f64;
    for hz in PREDICTED_HZ {
        worst_percent = worst_percent.max(reckon(controller, hz, None)?.open_percent);
    }
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
fn reach_um(numbers: &LawNumbers, [min_v, max_v]: [f64; 2]) -> Result<[f64; 2], ControlError> {
    let inverse = numbers
        .inverse
        .inverse::<f64>(numbers.sample_rate_hz)
        .map_err(|error| ControlError::Wish(format!("the controller's inverse: {error}; design it again").into()))?;
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
