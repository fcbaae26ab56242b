//! Tracking on stages that share no law with the simulated stage: a campaign on each, a controller from its records, and the true
//! position along references.

mod stage;

use hysteron_control::ControlError;
use hysteron_control::campaign::{Campaign, Command, Protocol};
use hysteron_control::design::prediction::{PREDICTED_HZ, Reckoned, predict};
use hysteron_control::design::{Controller, DesignedLaw, ReferenceKind};
use hysteron_control::expected::half_the_stroke;
use hysteron_control::figures::{Tracked, judge};
use hysteron_control::reference::{RISE_S, Reference, Shape};
use hysteron_core::surroundings::LoopInput;
use hysteron_data::{Dataset, Known, Record, Role};
use rayon::prelude::*;
pub use stage::{Foreign, PERIOD_S, STATED_LATENCY_S, Untold};

/// References, hertz: those that a design expects an error of.
pub const HERTZ: [f64; 4] = PREDICTED_HZ;

/// Seconds of a sine from which a law may learn before it is judged: the gain of 10 Hz, the lag of the frequency that is judged.
const LEARNING_S: f64 = 10.0;

/// Most of the gain that a law may learn, a share.
const GAIN_BOUND: f64 = 0.03;

/// What became of a stage.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Up to where the feedback helps by its design, hertz; none where there is none.
    pub helps_to_hz: Option<f64>,
    /// Rms error of the true position at each of [`HERTZ`], percent of the range, open and closed.
    pub percent: [Vec<f64>; 2],
    /// The same as the designs expect it; none beyond the records.
    pub expected_percent: [Vec<Option<f64>>; 2],
}

impl Outcome {
    /// Each error that was found over the one that was expected.
    pub fn over_expected(&self) -> impl Iterator<Item = f64> {
        let both = self
            .percent
            .iter()
            .flatten()
            .zip(self.expected_percent.iter().flatten());
        both.filter_map(|(found, expected)| expected.map(|expected| found / expected))
    }
}

/// The outcome on a stage.
///
/// # Errors
/// Records from which the stage cannot be identified, a law that the core refuses.
///
/// # Cost
/// Some twenty seconds.
pub fn outcome(seed: u64) -> Result<Outcome, ControlError> {
    let stage = Foreign::new(seed);
    let Campaign { model, .. } = campaign(&stage, seed)?;
    let open = Controller::design(&model, ReferenceKind::Previewed)?.adapting(GAIN_BOUND);
    let closed = open.clone().with_feedback()?;
    let range_um = half_the_stroke(&open);
    let each = |controller: &Controller| -> Result<Vec<f64>, ControlError> {
        let law = controller.law::<f64>()?;
        let learned_from_hz = (stage.untold == Untold::Gain).then_some(10.0);
        let percent = |hz: &f64| tracked_percent(&stage, &law, range_um, *hz, learned_from_hz);
        Ok(HERTZ.iter().map(percent).collect())
    };
    let stroke_um = range_um[1] - range_um[0];
    let expected = |controller: &Controller, of: fn(&Reckoned) -> Option<f64>| -> Result<Vec<_>, ControlError> {
        let predicted = predict(controller, stroke_um, None)?;
        Ok(predicted.iter().map(|at| at.error.as_ref().and_then(of)).collect())
    };
    Ok(Outcome {
        expected_percent: [
            expected(&open, |error| Some(error.open_percent))?,
            expected(&closed, |error| error.closed_percent)?,
        ],
        helps_to_hz: closed.feedback.as_ref().map(|feedback| feedback.rejection_hz),
        percent: [each(&open)?, each(&closed)?],
    })
}

/// Errors at 500 Hz in open loop, percent of the range, of a stage that answers `later_s` later than when it was recorded: as recorded, with
/// that, and once the law has learned it.
///
/// # Errors
/// As [`outcome`].
pub fn learned_lag(seed: u64, later_s: f64) -> Result<[f64; 3], ControlError> {
    let stage = Foreign::new(seed);
    let Campaign { model, .. } = campaign(&stage, seed)?;
    let controller = Controller::design(&model, ReferenceKind::Previewed)?.adapting(GAIN_BOUND);
    let range_um = half_the_stroke(&controller);
    let law = controller.law::<f64>()?;
    let later = stage.clone().later(later_s);
    let at_500_hz = |stage: &Foreign, learned| tracked_percent(stage, &law, range_um, 500.0, learned);
    Ok([
        at_500_hz(&stage, None),
        at_500_hz(&later, None),
        at_500_hz(&later, Some(500.0)),
    ])
}

/// The protocol of a campaign on a stage.
fn campaign(stage: &Foreign, seed: u64) -> Result<Campaign, ControlError> {
    let records = Dataset {
        name: stage.family.name().to_owned(),
        known: Known {
            delay_s: Some(STATED_LATENCY_S + 0.5 * PERIOD_S),
            sensor_bandwidth_hz: stage.sensor_bandwidth_hz(),
            voltage_min_v: Some(0.0),
            voltage_max_v: Some(stage.top_v),
            ..Known::default()
        },
        ..Dataset::default()
    };
    let protocol = Protocol {
        period_s: PERIOD_S,
        top_v: stage.top_v,
        seed,
    };
    let play = |command: Command| {
        let mut running = stage.at_rest(command.period_s, false, command.seed);
        let read = |volts: &f64| {
            let (_, read_um) = running.sample();
            running.step(*volts);
            read_um
        };
        let mut position_um: Vec<f64> = command.voltage_v.iter().map(read).collect();
        let mut voltage_v = command.voltage_v;
        let mut record = Record::new(
            command.file,
            Role::Identify,
            command.period_s,
            voltage_v.split_off(command.skip),
            position_um.split_off(command.skip),
        );
        record.excitation = command.words;
        record.reference_um = command.reference_um;
        record
    };
    let take = |commands: Vec<Command>, _: &dyn Fn(f64)| Ok(commands.into_par_iter().map(play).collect());
    protocol.play::<ControlError>(records, &take, &|_| ())
}

/// Rms error of the true position along a sine, percent of its range, the mean included, once the law has learned from another.
fn tracked_percent(
    stage: &Foreign,
    law: &DesignedLaw<f64>,
    range_um: [f64; 2],
    hz: f64,
    learned_from_hz: Option<f64>,
) -> f64 {
    let shape = |frequency_hz| Shape::Sine { frequency_hz };
    let judged = shape(hz).reference(range_um, PERIOD_S);
    // From the rest to the low end once; where something is to be learned, then whole periods, which end there.
    let rise = (RISE_S / PERIOD_S).round() as usize;
    let learning = learned_from_hz.map_or(0, |_| (LEARNING_S / PERIOD_S) as usize);
    let [low_um, high_um] = range_um;
    let learned_from = shape(learned_from_hz.unwrap_or(hz));
    let before = |k: usize| low_um + (high_um - low_um) * learned_from.share(k as f64 * PERIOD_S);
    let (risen, periods) = judged.samples_um.split_at(rise);
    let reference = Reference {
        samples_um: [risen, &(0..learning).map(before).collect::<Vec<f64>>(), periods].concat(),
        judged_from: judged.judged_from + learning,
        after_um: judged.after_um,
    };
    let mut running = stage.at_rest(PERIOD_S, true, 77);
    let ahead = law.ahead();
    let mut state = law.rest(0.0);
    let mut command = |running: &mut stage::Running, k: usize| {
        let (true_um, read_um) = running.sample();
        let input = LoopInput {
            reference_ahead: reference.at(k),
            measured: read_um,
            ..LoopInput::default()
        };
        running.step(law.step(&mut state, input));
        (true_um, read_um)
    };
    for k in 0..ahead {
        command(&mut running, k);
    }
    let (true_um, measured_um): (Vec<f64>, Vec<f64>) = (0..reference.samples_um.len())
        .map(|k| command(&mut running, k + ahead))
        .unzip();
    let run = Tracked {
        reference_um: reference.samples_um.clone(),
        measured_um,
        true_um,
        ..Tracked::default()
    };
    judge(&run.from(reference.judged_from), PERIOD_S).map_or(f64::NAN, |figures| figures.true_percent)
}

/// The middle one, and the largest.
pub fn median_and_worst(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    [
        sorted.get(middle).copied().unwrap_or(f64::NAN),
        sorted.last().copied().unwrap_or(f64::NAN),
    ]
}
