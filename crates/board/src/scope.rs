//! The last ticks of a board, as an oscilloscope shows them.

use crate::live::AxisStatus;
use crate::telemetry::Step;
use hysteron_core::codes::{AdcCode, Converter};
use hysteron_firmware::telemetry::{About, Sample};
use hysteron_firmware::wire::Mode;
use std::collections::VecDeque;

/// Ticks that are kept of an axis: 2.6 s at 50 kHz, 3 MB.
pub const KEPT: usize = 1 << 17;
/// Share of a window before its trigger.
const BEFORE_TRIGGER: usize = 10;

/// What a trigger looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// The reference, micrometres.
    Reference,
    /// The sensor's reading, micrometres.
    Position,
    /// The command, volts.
    Command,
}

/// Which ticks are wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// How many.
    pub ticks: usize,
    /// Where a channel last rose through a level; the newest ticks without.
    pub trigger: Option<(Channel, f64)>,
}

/// Ticks in a row; those that were lost are none.
#[derive(Debug, Clone, PartialEq)]
pub struct Scope {
    /// Number of the first.
    pub first: u32,
    /// Between two.
    pub period_s: f64,
    /// Whether a trigger that was asked for was found.
    pub triggered: bool,
    /// One value a tick.
    pub reference_um: Vec<f64>,
    /// One value a tick.
    pub position_um: Vec<f64>,
    /// One value a tick.
    pub command_v: Vec<f64>,
    /// Whether the loop ran on its reference.
    pub running: Vec<bool>,
}

/// What a scope's ticks come to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// Ticks on which the loop ran; the errors are of these.
    pub ticks: usize,
    /// Root mean square of reference less position, micrometres.
    pub rms_um: f64,
    /// Largest of it.
    pub most_um: f64,
    /// From the lowest to the highest reference, micrometres.
    pub span_um: f64,
}

impl Scope {
    /// Reference less position, micrometres.
    pub fn errors_um(&self) -> impl Iterator<Item = f64> + '_ {
        self.reference_um.iter().zip(&self.position_um).map(|(r, y)| r - y)
    }

    /// The errors while the loop ran; nothing where it did not.
    pub fn figures(&self) -> Option<Figures> {
        let ran = self
            .errors_um()
            .zip(&self.running)
            .filter(|(error, running)| **running && !error.is_nan());
        let (mut ticks, mut sum, mut most_um) = (0, 0.0, 0.0);
        for (error, _) in ran {
            ticks += 1;
            sum += error * error;
            most_um = f64::max(most_um, error.abs());
        }
        let followed = self
            .reference_um
            .iter()
            .zip(&self.running)
            .filter(|(_, running)| **running);
        let [low, high] = followed.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (r, _)| {
            [low.min(*r), high.max(*r)]
        });
        (ticks > 0).then(|| Figures {
            ticks,
            rms_um: (sum / ticks as f64).sqrt(),
            most_um,
            span_um: high - low,
        })
    }
}

/// The last samples of an axis.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    samples: VecDeque<Sample>,
    came: u64,
    lost: u64,
    restarts: u64,
}

impl Kept {
    pub(crate) fn push(&mut self, sample: Sample) {
        match self
            .samples
            .back()
            .map(|last| Step::of(last.frame.number, sample.frame.number))
        {
            Some(Step::Anew) => {
                self.restarts += 1;
                self.samples.clear();
            }
            Some(Step::Gap(step)) => self.lost += u64::from(step) - 1,
            Some(Step::Follows) | None => {}
        }
        self.came += 1;
        if self.samples.len() >= KEPT {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
    }

    /// Samples that came.
    pub(crate) fn samples(&self) -> u64 {
        self.came
    }

    pub(crate) fn status(&self) -> Option<AxisStatus> {
        let frame = self.samples.back()?.frame;
        Some(AxisStatus {
            mode: frame.mode(),
            fault: frame.fault(),
            bank: frame.bank(),
            samples: self.came,
            lost: self.lost,
            restarts: self.restarts,
        })
    }

    pub(crate) fn scope(&self, about: &About, window: &Window) -> Option<Scope> {
        let [adc, dac] = [about.adc_um, about.dac_v].map(|[min, top]| Converter::new(f64::from(min), f64::from(top)));
        let (adc, dac) = (adc.ok()?, dac.ok()?);
        let position_um = |sample: &Sample| adc.volts(AdcCode(sample.adc));
        let command_v = |sample: &Sample| dac.volts(AdcCode(sample.frame.dac));
        let reference_um = |sample: &Sample| f64::from(sample.frame.reference_um);
        let last = self.samples.back()?.frame.number;
        let ticks = window.ticks.clamp(2, KEPT);
        let newest = last.wrapping_sub(ticks as u32 - 1);
        let triggered = window.trigger.and_then(|(channel, level)| {
            let value: &dyn Fn(&Sample) -> f64 = match channel {
                Channel::Reference => &reference_um,
                Channel::Position => &position_um,
                Channel::Command => &command_v,
            };
            self.trigger(ticks, level, value)
        });
        let first = triggered.unwrap_or(newest);
        let mut scope = Scope {
            first,
            period_s: 1.0 / f64::from(about.hello.sample_rate_hz),
            triggered: triggered.is_some(),
            reference_um: vec![f64::NAN; ticks],
            position_um: vec![f64::NAN; ticks],
            command_v: vec![f64::NAN; ticks],
            running: vec![false; ticks],
        };
        let oldest = self.samples.front()?.frame.number;
        // The number of a sample is at most so far from its place as ticks were lost.
        let from = (first.wrapping_sub(oldest) as usize).saturating_sub(self.lost_among_kept());
        for sample in self.samples.range(from.min(self.samples.len())..) {
            let place = sample.frame.number.wrapping_sub(first) as usize;
            if place < ticks {
                scope.reference_um[place] = reference_um(sample);
                scope.position_um[place] = position_um(sample);
                scope.command_v[place] = command_v(sample);
                scope.running[place] = sample.frame.mode() == Mode::Running;
            }
        }
        Some(scope)
    }

    fn lost_among_kept(&self) -> usize {
        match (self.samples.front(), self.samples.back()) {
            (Some(first), Some(last)) => {
                (last.frame.number.wrapping_sub(first.frame.number) as usize + 1).saturating_sub(self.samples.len())
            }
            _ => 0,
        }
    }

    /// Number of the first tick of the newest whole window whose trigger lies a tenth behind its beginning.
    fn trigger(&self, ticks: usize, level: f64, value: &dyn Fn(&Sample) -> f64) -> Option<u32> {
        let before = ticks / BEFORE_TRIGGER;
        let last = self.samples.len().checked_sub(ticks - before)?;
        let rises = |k: &usize| {
            let [was, is] = [k - 1, *k].map(|k| self.samples.get(k).map_or(f64::NAN, value));
            was < level && is >= level
        };
        let k = (before.max(1)..=last).rev().find(rises)?;
        Some(self.samples[k].frame.number.wrapping_sub(before as u32))
    }
}
