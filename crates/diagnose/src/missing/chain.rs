//! A hysteresis base with trial effects in their places, as columns of a regression.
//!
//! voltage -> delay -> amplifier (lag, slew, clipping) -> plays (rate) -> structure (resonance) -> sensor (lag); what adds to
//! the position (creep, heat, other axis, end stop) comes as columns of its own.

use crate::missing::filters::{self, Linear};
use crate::missing::traces::Trace;
use crate::missing::user;
use hysteron_identify::effects::UserEffect;
use hysteron_identify::family::range;
use nalgebra::{DMatrix, DVector};

/// An effect with its nonlinear parameters; times in seconds, drive in scaled units.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Effect {
    Delay {
        delay_s: f64,
    },
    LagBefore {
        tau_s: f64,
    },
    LagAfter {
        tau_s: f64,
    },
    Mode {
        frequency_hz: f64,
        zeta: f64,
    },
    Slew {
        per_s: f64,
    },
    ClipDrive {
        low: f64,
        high: f64,
    },
    /// The input of plays wider than `narrow` lags by `up |v'|^exponent` on the way up, by `down ..` on the way down.
    RateShift {
        up: f64,
        down: f64,
        exponent: f64,
        narrow: f64,
    },
    /// The bounds of plays wider than `narrow` move away from the input by `up |v'|` and `down |v'|`, seconds (the paper's eq. 9).
    RateEnvelope {
        up: f64,
        down: f64,
        narrow: f64,
    },
    /// The plays' thresholds grow by this share a decade of the rate.
    RateThreshold {
        growth: f64,
    },
    /// The gain falls with the logarithm of the frequency.
    LogGain,
    Creep {
        taus_s: Vec<f64>,
    },
    Temperature,
    TemperatureGain,
    StartOffset,
    /// The position goes on with the time since the record's start, alike in all records.
    ElapsedTime,
    Cross,
    EndStop {
        low_um: f64,
        high_um: f64,
    },
    /// Second and third power of the position.
    SensorPowers,
    /// Second to fifth power of the drive.
    DrivePowers,
    /// A play of this width behind the position.
    Backlash {
        width_um: f64,
    },
    /// One of the user's own.
    User {
        effect: UserEffect,
        values: Vec<f64>,
    },
}

impl Effect {
    /// Whether it moves the plays' bounds with the rate.
    pub(crate) fn is_rate(&self) -> bool {
        matches!(self, Self::RateShift { .. } | Self::RateEnvelope { .. })
    }

    /// Whether its columns are made from the modelled position.
    pub(crate) fn acts_on_position(&self) -> bool {
        if let Self::User { effect, .. } = self {
            return effect.acts_on_position();
        }
        matches!(
            self,
            Self::Creep { .. }
                | Self::LogGain
                | Self::TemperatureGain
                | Self::EndStop { .. }
                | Self::SensorPowers
                | Self::Backlash { .. }
        )
    }
}

/// What the plays' outputs are turned into.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// g to the fifth order, each play through a cubic.
    Free,
    /// g linear, a weight a play.
    Pi,
    /// g with first and third order about zero volts, a weight a play.
    Mpi,
    /// g to the third order, a weight a play: too stiff to follow a ripple of the reading.
    Stiff,
    /// g to the fifth order, each play through a polynomial of the seventh.
    Plane,
}

/// Polynomials that a play is turned into in [`Shape::Plane`].
const DEGREES: usize = 7;

/// The hysteresis.
#[derive(Debug, Clone)]
pub(crate) struct Base {
    pub shape: Shape,
    /// Scaled units, ascending.
    pub thresholds: Vec<f64>,
    /// Ridge on the scaled columns of the hysteresis.
    pub ridge: f64,
}

/// Plays narrower than this share of the span belong to the linear path: a rate effect on a play without width is a delay.
pub(crate) const NARROW: f64 = 0.05;

impl Base {
    pub(crate) fn columns(&self) -> usize {
        let n = self.thresholds.len();
        match self.shape {
            Shape::Free => 6 + 3 * n,
            Shape::Pi => 2 + n,
            Shape::Mpi => 3 + n,
            Shape::Stiff => 4 + n,
            Shape::Plane => 6 + DEGREES * n,
        }
    }
}

/// Number of columns that effects add.
fn extra_columns(effects: &[Effect]) -> usize {
    effects
        .iter()
        .map(|effect| match effect {
            Effect::Creep { taus_s } => taus_s.len(),
            Effect::LogGain
            | Effect::Temperature
            | Effect::TemperatureGain
            | Effect::StartOffset
            | Effect::ElapsedTime
            | Effect::Backlash { .. }
            | Effect::EndStop { .. } => 1,
            Effect::SensorPowers => 2,
            Effect::DrivePowers => 4,
            Effect::Cross => CROSS_COLUMNS,
            _ => 0,
        })
        .sum()
}

/// All columns of base and effects.
pub(crate) fn width(base: &Base, effects: &[Effect]) -> usize {
    base.columns() + extra_columns(effects)
}

/// Calls `visit(column, series)` for every column of one record, at its `rows`; at its full rate, run-in included, where
/// none are given.
///
/// `reference_um` is the modelled position that creep, heat and stops act on.
fn for_each_column(
    base: &Base,
    effects: &[Effect],
    trace: &Trace,
    reference_um: Option<&[f64]>,
    rows: Option<&[usize]>,
    visit: impl FnMut(usize, &[f64]),
) {
    let input = drive_at_stack(effects, trace);
    let bend = user::Bend::new(effects, trace, reference_um);
    let mut columns = Columns::new(effects, trace, bend, rows, visit);
    columns.hand_on(0, |_| 1.0);
    let powers: &[usize] = match base.shape {
        Shape::Free | Shape::Plane => &[1, 2, 3, 4, 5],
        Shape::Pi => &[1],
        Shape::Mpi => &[1, 3],
        Shape::Stiff => &[1, 2, 3],
    };
    // The family's cubic bends about zero volts, not about the middle of what was driven.
    let zero = match base.shape {
        Shape::Mpi => -trace.scales.middle_v / trace.scales.unit_v,
        Shape::Free | Shape::Pi | Shape::Stiff | Shape::Plane => 0.0,
    };
    columns.pass(1, 1, powers.len(), |k| {
        let mut product = 1.0;
        let all: [f64; filters::LANES] = std::array::from_fn(|_| {
            product *= input[k] - zero;
            product
        });
        std::array::from_fn(|l| powers.get(l).map_or(0.0, |power| all[power - 1]))
    });
    let rates = Rates::new(effects, &input, trace.period_s);
    let mut next = 1 + powers.len();
    for thresholds in base.thresholds.chunks(filters::LANES) {
        let plays = rates.plays(&input, thresholds, trace.fraction);
        let count = thresholds.len();
        if base.shape == Shape::Free {
            // Middle of the play's travel, so that odd and even powers stay apart.
            columns.pass(next, 3, count, |k| plays[k]);
            columns.pass(next + 1, 3, count, |k| plays[k].map(|w| w * w));
            columns.pass(next + 2, 3, count, |k| plays[k].map(|w| w * w * w));
            next += 3 * count;
        } else if base.shape == Shape::Plane {
            for degree in 1..=DEGREES {
                columns.pass(next + degree - 1, DEGREES, count, |k| {
                    plays[k].map(|w| chebyshev(degree, w))
                });
            }
            next += DEGREES * count;
        } else {
            columns.pass(next, 1, count, |k| plays[k]);
            next += count;
        }
    }
    for effect in effects {
        extra(effect, trace, reference_um, &mut |series| {
            columns.hand_on(next, |k| series[k]);
            next += 1;
        });
    }
}

/// Chebyshev's polynomial of the first kind.
fn chebyshev(degree: usize, x: f64) -> f64 {
    let (mut last, mut this) = (1.0, x);
    for _ in 1..degree {
        (last, this) = (this, 2.0 * x * this - last);
    }
    this
}

/// The commanded drive after delay and amplifier.
pub(crate) fn drive_at_stack(effects: &[Effect], trace: &Trace) -> Vec<f64> {
    let mut input = trace.drive.clone();
    for effect in effects {
        if let Effect::Delay { delay_s } = effect {
            input = filters::delayed(&input, delay_s / trace.period_s);
        }
    }
    for effect in effects {
        match *effect {
            Effect::LagBefore { tau_s } => {
                Linear::lag(tau_s, trace.period_s).apply(input.as_chunks_mut::<1>().0);
            }
            Effect::Slew { per_s } => filters::slew(&mut input, per_s * trace.period_s),
            Effect::ClipDrive { low, high } => input.iter_mut().for_each(|v| *v = v.clamp(low, high)),
            _ => {}
        }
    }
    user::on_drive(effects, trace, &mut input);
    input
}

/// The columns on their way through what stands behind the hysteresis, to the rows that are asked for.
struct Columns<'a, V: FnMut(usize, &[f64])> {
    filters: Vec<Linear>,
    bend: Option<user::Bend<'a>>,
    /// Every sample where there are none.
    rows: Option<&'a [usize]>,
    samples: usize,
    side_by_side: Vec<[f64; filters::LANES]>,
    at_rows: Vec<f64>,
    visit: V,
}

impl<'a, V: FnMut(usize, &[f64])> Columns<'a, V> {
    fn new(
        effects: &[Effect],
        trace: &Trace,
        bend: Option<user::Bend<'a>>,
        rows: Option<&'a [usize]>,
        visit: V,
    ) -> Self {
        let filter = |effect: &Effect| match *effect {
            Effect::Mode { frequency_hz, zeta } => Some(Linear::mode(frequency_hz, zeta, trace.period_s)),
            Effect::LagAfter { tau_s } => Some(Linear::lag(tau_s, trace.period_s)),
            _ => None,
        };
        Self {
            filters: effects.iter().filter_map(filter).collect(),
            bend,
            rows,
            samples: trace.len(),
            side_by_side: Vec::new(),
            at_rows: Vec::new(),
            visit,
        }
    }

    /// Takes `count` columns of the hysteresis side by side, given sample by sample; their numbers start at `first` and lie
    /// `apart`.
    fn pass(&mut self, first: usize, apart: usize, count: usize, values: impl Fn(usize) -> [f64; filters::LANES]) {
        let mut lanes = std::mem::take(&mut self.side_by_side);
        lanes.clear();
        let numbers = (0..count).map(|lane| (first + lane * apart, lane));
        match self.rows {
            // Without memory behind the hysteresis the other samples need not be known.
            Some(rows) if self.filters.is_empty() && self.bend.is_none() => {
                lanes.extend(rows.iter().map(|&k| values(k)));
                for (number, lane) in numbers {
                    self.visit(number, lanes.iter().map(|row| row[lane]));
                }
            }
            _ => {
                lanes.extend((0..self.samples).map(values));
                for filter in &self.filters {
                    filter.apply(&mut lanes);
                }
                for (number, lane) in numbers {
                    self.hand_on(number, |k| lanes[k][lane]);
                }
            }
        }
        self.side_by_side = lanes;
    }

    /// Takes a column of the position before the user's own effects.
    fn hand_on(&mut self, number: usize, value: impl Fn(usize) -> f64) {
        let bent = self
            .bend
            .as_ref()
            .map(|bend| bend.of_change(&(0..self.samples).map(&value).collect::<Vec<_>>()));
        let value = |k: usize| bent.as_ref().map_or_else(|| value(k), |bent| bent[k]);
        match self.rows {
            Some(rows) => self.visit(number, rows.iter().map(|&k| value(k))),
            None => self.visit(number, (0..self.samples).map(value)),
        }
    }

    fn visit(&mut self, number: usize, values: impl Iterator<Item = f64>) {
        self.at_rows.clear();
        self.at_rows.extend(values);
        (self.visit)(number, &self.at_rows);
    }
}

/// What rate effects do to the plays.
struct Rates {
    /// Distances by which the left and the right bound lie below and above the input.
    bounds: Option<Vec<[f64; 2]>>,
    widening: Option<Vec<f64>>,
    narrow: f64,
}

impl Rates {
    const STILL: Self = Self {
        bounds: None,
        widening: None,
        narrow: NARROW,
    };

    fn new(effects: &[Effect], input: &[f64], period_s: f64) -> Self {
        let rate = |k: usize| {
            // Central: the command is free of noise, and a backward difference would be half a sample late.
            let (before, after) = (k.saturating_sub(1), (k + 1).min(input.len() - 1));
            if after == before {
                0.0
            } else {
                (input[after] - input[before]) / ((after - before) as f64 * period_s)
            }
        };
        let mut rates = Self::STILL;
        for effect in effects {
            match *effect {
                Effect::RateShift {
                    up,
                    down,
                    exponent,
                    narrow,
                } => {
                    rates.narrow = narrow;
                    let lag = |k: usize| {
                        let rate = rate(k);
                        if rate > 0.0 {
                            up * rate.powf(exponent)
                        } else {
                            -down * (-rate).powf(exponent)
                        }
                    };
                    rates.bounds = Some((0..input.len()).map(|k| [lag(k), -lag(k)]).collect());
                }
                Effect::RateEnvelope { up, down, narrow } => {
                    rates.narrow = narrow;
                    let apart = |k: usize| [up * rate(k).abs(), down * rate(k).abs()];
                    rates.bounds = Some((0..input.len()).map(apart).collect());
                }
                Effect::RateThreshold { growth } => {
                    // One span a second is where a 0.3 Hz full sine peaks: below it growth fades out linearly.
                    let wider = |k: usize| 1.0 + growth * (1.0 + rate(k).abs() / 2.0).log10();
                    rates.widening = Some((0..input.len()).map(wider).collect());
                }
                _ => {}
            }
        }
        rates
    }

    /// Outputs of up to [`filters::LANES`] plays side by side, centred: half its threshold above the lower bound.
    fn plays(&self, input: &[f64], thresholds: &[f64], fraction: f64) -> Vec<[f64; filters::LANES]> {
        let thresholds: [f64; filters::LANES] = std::array::from_fn(|l| thresholds.get(l).copied().unwrap_or(0.0));
        let half = thresholds.map(|threshold| threshold / 2.0);
        let wide = thresholds.map(|threshold| f64::from(u8::from(threshold > self.narrow * 2.0)));
        match (&self.bounds, &self.widening) {
            (Some(bounds), _) => side_by_side(input, thresholds, fraction, |k, l| bounds[k].map(|b| wide[l] * b)),
            (_, Some(widening)) => side_by_side(input, thresholds, fraction, |k, l| {
                [wide[l] * half[l] * (widening[k] - 1.0); 2]
            }),
            _ => side_by_side(input, thresholds, fraction, |_, _| [0.0; 2]),
        }
    }
}

/// Plays whose bounds lie `apart(sample, lane)` further below and above the input.
fn side_by_side(
    input: &[f64],
    thresholds: [f64; filters::LANES],
    fraction: f64,
    apart: impl Fn(usize, usize) -> [f64; 2],
) -> Vec<[f64; filters::LANES]> {
    // A drive between -1 and 1 takes a play no further out than this.
    let lowest = -1.0_f64;
    let mut w = thresholds.map(|threshold| input.first().map_or(0.0, |v| (v - fraction * threshold).max(lowest)));
    let half = thresholds.map(|threshold| threshold / 2.0);
    let mut plays = Vec::with_capacity(input.len());
    for (k, v) in input.iter().enumerate() {
        for l in 0..filters::LANES {
            let [below, above] = apart(k, l);
            w[l] = pushed(v - below - thresholds[l], v + above, w[l]);
        }
        plays.push(std::array::from_fn(|l| w[l] + half[l]));
    }
    plays
}

/// A play's output between its bounds; comparisons compile to selections where `max` and `min` must think of NaN.
#[inline(always)]
fn pushed(low: f64, high: f64, output: f64) -> f64 {
    let output = if output > high { high } else { output };
    if output < low { low } else { output }
}

/// Drive of the other axis: itself, its rate, three plays.
const CROSS_COLUMNS: usize = 5;

/// Columns that an effect adds to the position.
fn extra(effect: &Effect, trace: &Trace, reference_um: Option<&[f64]>, push: &mut dyn FnMut(&[f64])) {
    let n = trace.len();
    let zeros = || vec![0.0; n];
    let reference = || reference_um.map_or_else(zeros, <[f64]>::to_vec);
    match effect {
        Effect::Creep { taus_s } => {
            for &tau_s in taus_s {
                push(&settling(&reference(), trace, tau_s));
            }
        }
        Effect::LogGain => {
            // Two lags a decade from 1 Hz to 1 kHz: a staircase whose ripple is below a tenth of its slope.
            let y = reference();
            let mut sum = zeros();
            for i in 0..7 {
                let tau_s = 1.0 / (std::f64::consts::TAU * 10f64.powf(f64::from(i) / 2.0));
                let slow = settling(&y, trace, tau_s);
                sum.iter_mut()
                    .zip(&slow)
                    .zip(&y)
                    .for_each(|((s, slow), y)| *s += 0.5 * (slow - y));
            }
            push(&sum);
        }
        Effect::Temperature => push(&trace.temperature_c.clone().unwrap_or_else(zeros)),
        Effect::TemperatureGain => {
            let mut column = reference();
            if let Some(temperature_c) = &trace.temperature_c {
                column.iter_mut().zip(temperature_c).for_each(|(y, t)| *y *= t);
                push(&column);
            } else {
                push(&zeros());
            }
        }
        Effect::StartOffset => push(&vec![trace.start_offset_um; n]),
        Effect::ElapsedTime => push(&elapsed_h(trace)),
        Effect::Cross => cross(trace, push),
        Effect::EndStop { low_um, high_um } => {
            let mut column = reference();
            column.iter_mut().for_each(|y| *y = y.clamp(*low_um, *high_um) - *y);
            push(&column);
        }
        Effect::SensorPowers => {
            let y = reference();
            for power in [2, 3] {
                push(&y.iter().map(|y| y.powi(power)).collect::<Vec<_>>());
            }
        }
        Effect::DrivePowers => {
            for power in [2, 3, 4, 5] {
                push(&trace.drive.iter().map(|v| v.powi(power)).collect::<Vec<_>>());
            }
        }
        Effect::Backlash { width_um } => {
            let mut z = None;
            let follow = |&y: &f64| {
                let now = z.map_or(y, |z: f64| (y - width_um / 2.0).max((y + width_um / 2.0).min(z)));
                z = Some(now);
                now - y
            };
            push(&reference().iter().map(follow).collect::<Vec<_>>());
        }
        _ => {}
    }
}

/// Hours since the record's start.
fn elapsed_h(trace: &Trace) -> Vec<f64> {
    let step_h = trace.period_s / 3600.0;
    (0..trace.len())
        .map(|k| (k as f64 - trace.from as f64) * step_h)
        .collect()
}

/// A first-order state that follows the position; at rest before the record, at the mean where the record is in periodic state.
fn settling(position_um: &[f64], trace: &Trace, tau_s: f64) -> Vec<f64> {
    let mut state = position_um.to_vec();
    let (start, from) = if trace.from > 0 && !trace.rested {
        (position_um[..trace.from].iter().sum::<f64>() / trace.from as f64, 0)
    } else {
        (position_um.get(trace.from).copied().unwrap_or(0.0), trace.from)
    };
    let a = (-trace.period_s / tau_s).exp();
    let mut x = start;
    for value in state.iter_mut().skip(from) {
        x = a * x + (1.0 - a) * *value;
        *value = x;
    }
    state
}

fn cross(trace: &Trace, push: &mut dyn FnMut(&[f64])) {
    let Some(drive2) = &trace.drive2 else {
        for _ in 0..CROSS_COLUMNS {
            push(&vec![0.0; trace.len()]);
        }
        return;
    };
    push(drive2);
    let mut rate = vec![0.0; drive2.len()];
    for k in 1..rate.len() {
        rate[k] = (drive2[k] - drive2[k - 1]) / trace.period_s;
    }
    push(&rate);
    let thresholds = [0.1, 0.4, 1.0];
    let plays = Rates::STILL.plays(drive2, &thresholds, 0.0);
    for lane in 0..thresholds.len() {
        push(&plays.iter().map(|w| w[lane]).collect::<Vec<_>>());
    }
}

/// The columns of one record at its rows.
pub(crate) fn matrix(base: &Base, effects: &[Effect], trace: &Trace, reference_um: Option<&[f64]>) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(trace.rows.len(), width(base, effects));
    for_each_column(base, effects, trace, reference_um, Some(&trace.rows), |j, series| {
        matrix.column_mut(j).copy_from_slice(series);
    });
    matrix
}

/// The modelled position of one record at its full rate; `columns` are how many of them take part.
pub(crate) fn simulate(
    base: &Base,
    effects: &[Effect],
    trace: &Trace,
    reference_um: Option<&[f64]>,
    coefficients: &DVector<f64>,
    columns: usize,
) -> Vec<f64> {
    let mut sum = vec![0.0; trace.len()];
    for_each_column(base, effects, trace, reference_um, None, |j, series| {
        if j < columns && j < coefficients.len() {
            let c = coefficients[j];
            sum.iter_mut().zip(series).for_each(|(s, x)| *s += c * x);
        }
    });
    sum
}

/// Largest rate of any drive, scaled units per second.
pub(crate) fn peak_rate(traces: &[Trace]) -> f64 {
    traces
        .iter()
        .map(Trace::on_grid)
        .flat_map(|t| t.drive.windows(2).map(move |v| (v[1] - v[0]).abs() / t.period_s))
        .fold(0.0, f64::max)
}

/// Range of the measured positions.
pub(crate) fn position_range(traces: &[Trace]) -> (f64, f64) {
    range(traces.iter().flat_map(|t| &t.position_um).copied())
}

/// Which coefficients physics does not let be negative.
pub(crate) fn not_negative(base: &Base, effects: &[Effect]) -> Vec<bool> {
    let mut signed = vec![false; base.columns()];
    for effect in effects {
        let of_effect = extra_columns(std::slice::from_ref(effect));
        let positive = matches!(
            effect,
            Effect::Creep { .. } | Effect::LogGain | Effect::EndStop { .. } | Effect::Backlash { .. }
        );
        signed.extend(std::iter::repeat_n(positive, of_effect));
    }
    signed
}
