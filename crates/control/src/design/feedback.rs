//! Feedback on what the feedforward leaves, designed for a stated robustness on the identified linear part.

use super::evolution;
use super::preview::fraction;
use hysteron_core::biquad::Biquad;
use hysteron_core::law_numbers::FeedbackNumbers;
use hysteron_identify::control::{ControlModel, LinearPart, ModeOfStage};
use hysteron_identify::simplex::{self, Vertex};
use rayon::prelude::*;
use realfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Largest peak of the sensitivity that is allowed where nobody asks for another: the loop stays half of its own size away from the
/// critical point.
pub const LARGEST_SENSITIVITY: f64 = 2.0;
/// By how much the modes may be off: a tenth either way is a fifth of the mass.
pub(super) const MODE_FACTORS: [f64; 3] = [0.9, 1.0, 1.1];
/// By how much the loop gain differs from its mean: slope after a turn against slope in mid-branch.
pub(super) const GAIN_FACTORS: [f64; 3] = [0.6, 1.0, 1.3];
/// Rms that a nanometre of white sensor noise may leave in the position, nanometres: with the converters' share below 0.4.
const LARGEST_NOISE: f64 = 0.3;
/// Rms that a nanometre of white sensor noise may make of the command, nanometres at the stage's mean gain: more would
/// shake the hysteresis out of the state that the feedforward counts on.
const LARGEST_EFFORT: f64 = 3.5;
/// What the feedforward leaves is looked at from here, hertz: slower errors any integral takes away.
const FROM_HZ: f64 = 1.0;
/// Its power in an octave falls with the fourth root of the frequency (creep and drift at the slow end, hysteresis at
/// the fast one) up to here, hertz, and with its square above. Steeper, the search gives up a half of what is rejected at 10 Hz.
const TO_HZ: f64 = 1000.0;
/// Exponent of its power.
const SLOW_END: f64 = 0.25;

/// The designed feedback.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeedbackDesign {
    /// Which of the structures came out best: `integral`, `notch`, `two-biquads`, `damping`.
    pub structure: String,
    /// Integral gain, volts per micrometre and second.
    pub integral_v_per_um_s: f64,
    /// Sections in series with the integral: b0, b1, b2, a1, a2.
    pub series: [[f64; 5]; 2],
    /// Damping filter beside it.
    pub damping: [f64; 5],
    /// Largest peak of the sensitivity over modes +-10 % and loop gain 0.6 to 1.3.
    pub peak_sensitivity: f64,
    /// Disturbances are halved in power (sensitivity below -3 dB) up to here, hertz; nominal.
    pub rejection_hz: f64,
    /// Sensitivity first exceeds 1 here, hertz, nominal: above, feedback adds to the error. Not beyond where the stage is told.
    pub helps_to_hz: f64,
    /// Up to where the stage is told, hertz: above, a mode may be anywhere, and the loop gain is so low that none can make it swing.
    pub told_to_hz: f64,
    /// Rms of the position for a nanometre of white sensor noise, nanometres; nominal.
    pub noise_nm: f64,
}

impl FeedbackDesign {
    /// The numbers that the core's block is made of.
    pub fn numbers(&self) -> FeedbackNumbers {
        FeedbackNumbers {
            integral_v_per_um_s: self.integral_v_per_um_s,
            series: self.series,
            damping: self.damping,
            // A table's, which is made for a range; a simulated stage has no other sensor.
            trust: None,
        }
    }
}

/// Least damping ratio of a section's poles: the grid of frequencies must see what the section does, and a modes' tenth either
/// way leaves no use for anything narrower.
const NARROWEST_POLE: f64 = 0.1;
/// Least damping ratio of its zeros.
const NARROWEST_ZERO: f64 = 0.02;

/// Nothing beside the integral.
const NO_DAMPING: [f64; 5] = [0.0; 5];
/// Nothing in series with it.
const THROUGH: [f64; 5] = [1.0, 0.0, 0.0, 0.0, 0.0];

/// A structure with the parameters that the search varies; logarithms where they are positive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Structure {
    Integral,
    Notch,
    TwoBiquads,
    Damping,
}

/// Integral gain (normalised to the plant's, per second) and sections.
struct Candidate {
    integral_per_s: f64,
    series: [[f64; 5]; 2],
    damping: [f64; 5],
}

impl Structure {
    const ALL: [Self; 4] = [Self::Integral, Self::Notch, Self::TwoBiquads, Self::Damping];

    fn name(self) -> &'static str {
        match self {
            Self::Integral => "integral",
            Self::Notch => "notch",
            Self::TwoBiquads => "two-biquads",
            Self::Damping => "damping",
        }
    }

    /// What the search varies, lowest and highest: logarithms where they are positive.
    fn bounds(self, mode_hz: f64, rate_hz: f64) -> Vec<(f64, f64)> {
        let log = |low: f64, high: f64| (low.ln(), high.ln());
        let gain = log(0.002 * mode_hz, mode_hz);
        let highest = (0.4 * rate_hz).max(2.0 * mode_hz);
        // A section swaps a damped pair about the mode for one anywhere above.
        let section = [
            log(0.3 * mode_hz, 4.0 * mode_hz),
            log(NARROWEST_ZERO, 2.0),
            log(0.3 * mode_hz, highest),
            log(NARROWEST_POLE, 4.0),
        ];
        let mut bounds = vec![gain];
        match self {
            Self::Integral => {}
            Self::Notch => bounds.extend(&[
                log(0.7 * mode_hz, 1.4 * mode_hz),
                log(NARROWEST_ZERO, 1.0),
                log(NARROWEST_POLE, 4.0),
            ]),
            Self::TwoBiquads => bounds.extend(section.iter().chain(&section)),
            // Derivative, position and acceleration feedback, either sign, and mixtures.
            Self::Damping => {
                bounds.extend([log(0.3 * mode_hz, highest), log(NARROWEST_POLE, 4.0)]);
                bounds.extend([(-1.5, 1.5); 3]);
            }
        }
        bounds
    }

    /// How often it is searched: on a slow mode two kinds of loops are the best of their kind, and one search ends in either.
    fn searches(self, mode_hz: f64, rate_hz: f64) -> u64 {
        (self.bounds(mode_hz, rate_hz).len() as u64).min(MOST_SEARCHES)
    }

    fn candidate(self, p: &[f64], rate_hz: f64) -> Option<Candidate> {
        let coefficients = |biquad: Biquad<f64>| {
            let (b, a) = biquad.coefficients();
            [b[0], b[1], b[2], a[0], a[1]]
        };
        let notch = |q: &[f64]| {
            if q[1] < NARROWEST_ZERO.ln() || q[2] < NARROWEST_POLE.ln() {
                return None;
            }
            let biquad = Biquad::<f64>::notch(q[0].exp(), q[1].exp(), q[2].exp(), rate_hz);
            biquad.ok().map(coefficients)
        };
        let free = |q: &[f64]| {
            if q[1] < NARROWEST_ZERO.ln() || q[3] < NARROWEST_POLE.ln() {
                return None;
            }
            let biquad = Biquad::<f64>::mode_swap([q[0].exp(), q[1].exp()], [q[2].exp(), q[3].exp()], rate_hz);
            biquad.ok().map(coefficients)
        };
        let (mut series, mut damping) = ([THROUGH; 2], NO_DAMPING);
        match self {
            Self::Integral => {}
            Self::Notch => series[0] = notch(&p[1..4])?,
            Self::TwoBiquads => series = [free(&p[1..5])?, free(&p[5..9])?],
            Self::Damping => damping = free_section(p[1].exp(), p[2].exp(), [p[3], p[4], p[5]], rate_hz)?,
        }
        // Two notches' damping, and a corner below half the rate, are kept sane by the core's own refusals.
        Some(Candidate {
            integral_per_s: TAU * p[0].exp(),
            series,
            damping,
        })
    }
}

/// `(d2 s^2 + d1 w s + d0 w^2) / (s^2 + 2 z w s + w^2)` by the bilinear transformation, its middle kept in place.
fn free_section(frequency_hz: f64, damping: f64, [d2, d1, d0]: [f64; 3], rate_hz: f64) -> Option<[f64; 5]> {
    if !(frequency_hz > 1.0 && frequency_hz < 0.45 * rate_hz && damping > NARROWEST_POLE && damping < 5.0) {
        return None;
    }
    let k = (PI * frequency_hz / rate_hz).tan();
    let norm = 1.0 / (1.0 + 2.0 * damping * k + k * k);
    Some([
        (d2 + d1 * k + d0 * k * k) * norm,
        2.0 * (d0 * k * k - d2) * norm,
        (d2 - d1 * k + d0 * k * k) * norm,
        2.0 * (k * k - 1.0) * norm,
        (1.0 - 2.0 * damping * k + k * k) * norm,
    ])
}

/// The controller `I B_1 B_2 + D`.
struct Blocks {
    integral_a_sample: f64,
    series: [Biquad<f64>; 2],
    damping: Biquad<f64>,
}

impl Blocks {
    fn new(integral_per_s: f64, series: [[f64; 5]; 2], damping: [f64; 5], period_s: f64) -> Option<Self> {
        let biquad = |c: [f64; 5]| Biquad::<f64>::new([c[0], c[1], c[2]], [c[3], c[4]]).ok();
        Some(Self {
            integral_a_sample: integral_per_s * period_s,
            series: [biquad(series[0])?, biquad(series[1])?],
            damping: biquad(damping)?,
        })
    }

    /// Its response where a sample's delay is `z`.
    fn response(&self, z: Complex64) -> Complex64 {
        // Over one denominator: a division takes as long as all the rest.
        let [(first, below_first), (second, below_second)] = self.series.each_ref().map(|part| fraction(part, z));
        let (damping, below_damping) = fraction(&self.damping, z);
        let below = (1.0 - z) * below_first * below_second;
        (self.integral_a_sample * first * second * below_damping + damping * below) / (below * below_damping)
    }
}

/// Cost of a loop that is not stable with every plant, above all that are; the faster, the more.
const UNSTABLE: f64 = 1e6;
/// Searches for each structure, if it has as many parameters.
const MOST_SEARCHES: u64 = 6;

/// How long the best feedback is searched for. What a loop must hold is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// Some seconds on two cores.
    Whole,
    /// A second or less: a loop that holds, and rejects somewhat less.
    Quick,
}

impl Effort {
    fn searches(self) -> u64 {
        match self {
            Self::Whole => MOST_SEARCHES,
            Self::Quick => 1,
        }
    }

    /// Generations of a search.
    fn generations(self) -> usize {
        match self {
            Self::Whole => 200,
            Self::Quick => 12,
        }
    }
}

/// What a rejection farther by a factor of e is worth, as a share of the disturbances: between loops that leave about the same, the
/// one that rejects farther.
const WORTH_OF_REJECTION: f64 = 0.05;
/// Up to this share of the first mode: a loop that rejects farther pays with what it rejects where creep and hysteresis are.
const FAR_ENOUGH: f64 = 0.5;

/// 1 where the way from `from` to `to` crosses the negative real axis turning left, -1 turning right, 0 elsewhere.
fn crossing(from: Complex64, to: Complex64) -> i32 {
    if (from.im < 0.0) == (to.im < 0.0) {
        return 0;
    }
    let crosses_at = from.re + (to.re - from.re) * from.im / (from.im - to.im);
    match (crosses_at < 0.0, to.im < 0.0) {
        (false, _) => 0,
        (true, true) => 1,
        (true, false) => -1,
    }
}

/// Least damping ratio that a mode nobody has seen is reckoned with: the lightest of what piezo stages are built with (0.01 to 0.03).
pub(super) const UNSEEN_DAMPING: f64 = 0.01;
/// Share of the displacement that a mode above those of the model has at most: of equal masses `(f1 / f)^2`, and not above this.
const HIGHER_SHARE: f64 = 0.05;

/// What may be where nothing is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Unseen {
    /// From here on a mode may be anywhere, hertz.
    pub from_hz: f64,
    /// The first mode, where the model has it and it is told.
    pub first_hz: Option<f64>,
}

impl Unseen {
    /// None where nothing is told at all.
    pub(super) fn of(model: &ControlModel) -> Option<Self> {
        let from_hz = model.covered.told_to_hz()?;
        let first_hz = model.linear.modes.first().map(|mode| mode.frequency_hz);
        Some(Self {
            from_hz,
            first_hz: first_hz.filter(|hz| *hz <= from_hz),
        })
    }

    /// Share of the displacement that a mode at `hz` may have: all of it where it would be the first.
    pub(super) fn share(&self, hz: f64) -> f64 {
        self.first_hz
            .map_or(1.0, |first| (first / hz).powi(2).min(HIGHER_SHARE))
    }

    /// The linear part with such a mode.
    pub(super) fn linear(&self, linear: &LinearPart, hz: f64) -> LinearPart {
        let share = self.share(hz);
        let mut with = linear.clone();
        with.modes.iter_mut().for_each(|mode| mode.share *= 1.0 - share);
        with.modes.push(ModeOfStage {
            frequency_hz: hz,
            damping: UNSEEN_DAMPING,
            share,
        });
        with
    }
}

/// The plants that a loop has to hold with, on one grid of frequencies.
struct Plants {
    omega: Vec<f64>,
    /// `e^(-j w T)` at each.
    delay: Vec<Complex64>,
    /// Weight of each frequency in an integral over log frequency, of the disturbances assumed.
    disturbance: Vec<f64>,
    /// Weight of each frequency in the mean over the band of the sensor's noise.
    noise: Vec<f64>,
    /// Plant without gain, for each factor on the modes, the nominal one second; then with a mode where nothing is told.
    responses: Vec<Vec<Complex64>>,
    /// Most that a mode nobody has seen adds to the plant, at each frequency.
    unseen: Vec<f64>,
    /// First mode, or where the first may be; a tenth of the sample rate at most.
    mode_hz: f64,
    told_to_hz: f64,
    period_s: f64,
}

impl Plants {
    fn new(model: &ControlModel, unseen: Unseen) -> Self {
        let period_s = model.sample_period_s;
        let half_rate_hz = 0.5 / period_s;
        let mut hz: Vec<f64> = (0..=400)
            .map(|n| (0.9999 * half_rate_hz).powf(f64::from(n) / 400.0))
            .collect();
        // A mode of 2 % damping is 4 % wide: twenty points over each width, wherever it may lie.
        let first_unseen = unseen.first_hz.is_none().then_some(unseen.from_hz);
        for mode_hz in model
            .linear
            .modes
            .iter()
            .map(|mode| mode.frequency_hz)
            .chain(first_unseen)
        {
            hz.extend((-80..=80).map(|n| mode_hz * (1.0 + 0.002 * f64::from(n))));
        }
        hz.retain(|f| *f >= 1.0 && *f < half_rate_hz);
        hz.sort_by(f64::total_cmp);
        let omega: Vec<f64> = hz.iter().map(|f| TAU * f).collect();
        let width = |n: usize| {
            let (below, above) = (n.saturating_sub(1), (n + 1).min(hz.len() - 1));
            (0.5 * (hz[above] - hz[below]), 0.5 * (hz[above] / hz[below]).ln())
        };
        let disturbance = (0..hz.len())
            .map(|n| match hz[n] {
                f if f < FROM_HZ => 0.0,
                f if f <= TO_HZ => width(n).1 * (TO_HZ / f).powf(SLOW_END),
                f => width(n).1 * (TO_HZ / f).powi(2),
            })
            .collect();
        let noise = (0..hz.len()).map(|n| width(n).0 / half_rate_hz).collect();
        let through = |linear: &LinearPart| -> Vec<Complex64> {
            let at = |&w: &f64| {
                let half = 0.5 * w * period_s;
                Complex64::from_polar(half.sin() / half, -w * model.latency_s) * linear.response(w) * sensor(model, w)
            };
            omega.iter().map(at).collect()
        };
        let factors = MODE_FACTORS.iter().map(|&factor| {
            let mut linear = model.linear.clone();
            linear.modes.iter_mut().for_each(|mode| mode.frequency_hz *= factor);
            linear
        });
        let with_unseen = first_unseen.map(|hz| unseen.linear(&model.linear, hz));
        let responses = factors.chain(with_unseen).map(|linear| through(&linear)).collect();
        let rigid = LinearPart {
            modes: Vec::new(),
            ..model.linear
        };
        let unseen_at = |(w, response): (&f64, Complex64)| match w / TAU {
            hz if hz < unseen.from_hz => 0.0,
            hz => response.norm() * unseen.share(hz) / (2.0 * UNSEEN_DAMPING),
        };
        let unseen_gain = omega.iter().zip(through(&rigid)).map(unseen_at).collect();
        let known_hz = unseen.first_hz.unwrap_or(unseen.from_hz);
        Self {
            delay: omega
                .iter()
                .map(|w| Complex64::from_polar(1.0, -w * period_s))
                .collect(),
            omega,
            disturbance,
            noise,
            responses,
            unseen: unseen_gain,
            mode_hz: known_hz.min(0.1 / period_s),
            told_to_hz: unseen.from_hz.min(half_rate_hz),
            period_s,
        }
    }

    fn controller(&self, candidate: &Candidate) -> Vec<Complex64> {
        let Candidate {
            integral_per_s,
            series,
            damping,
        } = *candidate;
        let Some(blocks) = Blocks::new(integral_per_s, series, damping, self.period_s) else {
            return vec![Complex64::new(f64::INFINITY, 0.0); self.omega.len()];
        };
        self.delay.iter().map(|&z| blocks.response(z)).collect()
    }

    /// Peak of the sensitivity over all plants; infinite where one of the loops is not stable.
    fn peak_sensitivity(&self, controller: &[Complex64]) -> f64 {
        // Roots of squares: the care that `hypot` takes of the largest numbers is most of a design's time.
        let size = |at: Complex64| at.norm_sqr().sqrt();
        // A mode that was not seen may turn what it adds against the rest.
        let most_added: Vec<f64> = controller
            .iter()
            .zip(&self.unseen)
            .map(|(c, unseen)| size(*c) * unseen)
            .collect();
        let mut peak: f64 = 0.0;
        for response in &self.responses {
            let around: Vec<Complex64> = controller.iter().zip(response).map(|(c, p)| c * p).collect();
            for gain in GAIN_FACTORS {
                let (mut turns, mut nearest) = (0, f64::INFINITY);
                let mut before: Option<Complex64> = None;
                let mut first = Complex64::default();
                for (once, added) in around.iter().zip(&most_added) {
                    let distance = 1.0 + gain * once;
                    nearest = nearest.min((size(distance) - gain * added).max(0.0));
                    if let Some(before) = before {
                        turns += crossing(before, distance);
                    } else {
                        first = distance;
                    }
                    before = Some(distance);
                }
                let last = before.unwrap_or_default();
                let turned = last.arg() - first.arg() + TAU * f64::from(turns);
                // From -j infinity (the integral) to the real axis: a quarter turn, whole turns more or less are poles outside.
                if (turned - FRAC_PI_2).abs() > 0.5 || !turned.is_finite() {
                    return f64::INFINITY;
                }
                peak = peak.max(1.0 / nearest);
            }
        }
        peak
    }

    fn sensitivity(&self, controller: &[Complex64]) -> Vec<Complex64> {
        controller
            .iter()
            .zip(&self.responses[1])
            .map(|(c, p)| 1.0 / (1.0 + c * p))
            .collect()
    }

    /// Up to where the sensitivity stays below `limit`, hertz, between the points of the grid.
    fn stays_below(&self, limit: f64, sensitivity: &[Complex64]) -> f64 {
        let above = sensitivity.iter().position(|s| s.norm_sqr() > limit * limit);
        let hz = |n: usize| self.omega[n] / TAU;
        match above {
            None => hz(self.omega.len() - 1),
            Some(0) => hz(0),
            Some(n) => {
                let (before, after) = (sensitivity[n - 1].norm(), sensitivity[n].norm());
                hz(n - 1) + (limit - before) / (after - before) * (hz(n) - hz(n - 1))
            }
        }
    }

    /// Up to where disturbances are halved in power, hertz.
    fn rejection_hz(&self, sensitivity: &[Complex64]) -> f64 {
        self.stays_below(0.5_f64.sqrt(), sensitivity)
    }

    fn noise(&self, sensitivity: &[Complex64]) -> f64 {
        let squares = sensitivity
            .iter()
            .zip(&self.noise)
            .map(|(s, w)| (1.0 - s).norm_sqr() * w);
        squares.sum::<f64>().sqrt()
    }

    fn effort(&self, controller: &[Complex64], sensitivity: &[Complex64]) -> f64 {
        let each = controller.iter().zip(sensitivity).zip(&self.noise);
        each.map(|((c, s), w)| (c * s).norm_sqr() * w).sum::<f64>().sqrt()
    }

    /// What the search minimises: the share of the assumed disturbances that is left, with walls where the loop is not
    /// robust or too noisy.
    fn cost(&self, candidate: Option<Candidate>, largest_sensitivity: f64) -> f64 {
        let Some(candidate) = candidate else {
            return 1e9;
        };
        let controller = self.controller(&candidate);
        let peak = self.peak_sensitivity(&controller);
        if !peak.is_finite() {
            return UNSTABLE + candidate.integral_per_s;
        }
        let sensitivity = self.sensitivity(&controller);
        let left: f64 = sensitivity
            .iter()
            .zip(&self.disturbance)
            .map(|(s, w)| s.norm_sqr() * w)
            .sum();
        let all: f64 = self.disturbance.iter().sum();
        let rejection_hz = self.rejection_hz(&sensitivity).min(FAR_ENOUGH * self.mode_hz);
        let wall = |value: f64, limit: f64| 100.0 * (value / limit - 1.0).max(0.0);
        left / all - WORTH_OF_REJECTION * rejection_hz.ln()
            + wall(peak, largest_sensitivity)
            + wall(self.noise(&sensitivity), LARGEST_NOISE)
            + wall(self.effort(&controller, &sensitivity), LARGEST_EFFORT)
    }
}

/// Designs the feedback: of four structures, the one that leaves least of the disturbances within the robustness asked for.
///
/// `None` where no structure is: the sensitivity, over modes +-10 %, loop gain 0.6 to 1.3 and a mode wherever nothing is told, must stay
/// below `largest_sensitivity`; and where nothing is told at all.
///
/// # Cost
/// About 150 000 loops of some 600 frequencies and nine plants, on all cores: some seconds on two.
pub fn design(model: &ControlModel, largest_sensitivity: f64, effort: Effort) -> Option<FeedbackDesign> {
    let rate_hz = 1.0 / model.sample_period_s;
    let plants = Plants::new(model, Unseen::of(model)?);
    let mode_hz = plants.mode_hz;
    let searches: Vec<(Structure, u64)> = Structure::ALL
        .into_iter()
        .flat_map(|structure| {
            (1..=structure.searches(mode_hz, rate_hz).min(effort.searches())).map(move |seed| (structure, seed))
        })
        .collect();
    let search = |(structure, seed): (Structure, u64)| {
        let cost = |p: &[f64]| plants.cost(structure.candidate(p, rate_hz), largest_sensitivity);
        let (found, _) = evolution::minimum(&structure.bounds(mode_hz, rate_hz), effort.generations(), seed, cost);
        let polish = |start: &[f64]| simplex::minimum(start, 0.1, 150, |_| false, cost);
        // Once more from where it stopped: the simplex may have collapsed on the walls.
        (structure, polish(&polish(&found).0))
    };
    let found: Vec<(Structure, Vertex)> = searches.into_par_iter().map(search).collect();
    let (structure, (parameters, _)) = found.into_iter().min_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    let candidate = structure.candidate(&parameters, rate_hz)?;
    let controller = plants.controller(&candidate);
    let peak_sensitivity = plants.peak_sensitivity(&controller);
    // The walls are steep, not infinite.
    if peak_sensitivity > 1.02 * largest_sensitivity {
        return None;
    }
    let sensitivity = plants.sensitivity(&controller);
    let per_gain = 1.0 / mean_gain_um_per_v(model);
    let [b0, b1, b2, a1, a2] = candidate.damping;
    Some(FeedbackDesign {
        structure: structure.name().to_owned(),
        integral_v_per_um_s: candidate.integral_per_s * per_gain,
        series: candidate.series,
        damping: [b0 * per_gain, b1 * per_gain, b2 * per_gain, a1, a2],
        peak_sensitivity,
        rejection_hz: plants.rejection_hz(&sensitivity).min(plants.told_to_hz),
        helps_to_hz: plants.stays_below(1.0, &sensitivity).min(plants.told_to_hz),
        told_to_hz: plants.told_to_hz,
        noise_nm: plants.noise(&sensitivity),
    })
}

/// The sensor's own lag.
fn sensor(model: &ControlModel, omega: f64) -> Complex64 {
    1.0 / Complex64::new(1.0, omega * model.around.sensor_lag_s)
}

/// What the loop's error shows of a disturbance of the position: the sensitivity behind the sensor's lag; that lag alone without
/// feedback.
pub(crate) fn sensitivity(model: &ControlModel, design: Option<&FeedbackDesign>, omega: f64) -> Complex64 {
    let around = design.map_or_else(Complex64::default, |design| around(model, design, omega));
    sensor(model, omega) / (1.0 + around)
}

/// Once around the loop, from the sensor's reading back to it.
pub(super) fn around(model: &ControlModel, design: &FeedbackDesign, omega: f64) -> Complex64 {
    let (period_s, half) = (model.sample_period_s, 0.5 * omega * model.sample_period_s);
    let z = Complex64::from_polar(1.0, -omega * period_s);
    let blocks = Blocks::new(design.integral_v_per_um_s, design.series, design.damping, period_s);
    let controller = blocks.map_or_else(Complex64::default, |blocks| blocks.response(z));
    let plant = mean_gain_um_per_v(model)
        * Complex64::from_polar(half.sin() / half, -omega * model.latency_s)
        * model.linear.response(omega)
        * sensor(model, omega);
    controller * plant
}

/// Displacement over voltage over the whole identified range, micrometres per volt.
pub(super) fn mean_gain_um_per_v(model: &ControlModel) -> f64 {
    if let Some(fading) = &model.fading {
        return fading.mean_gain_um_per_v();
    }
    let inverse = &model.inverse;
    let x = inverse.input_max_um;
    let of_input = inverse.input_function.iter().rev().fold(0.0, |sum, c| (sum + c) * x);
    let of_plays: f64 = (0..inverse.thresholds_um.len())
        .map(|i| {
            let w = (x - inverse.thresholds_um[i]).max(0.0);
            ((inverse.cubic[i] * w + inverse.quadratic[i]) * w + inverse.linear[i]) * w
        })
        .sum();
    x / (inverse.offset_v + of_input + of_plays)
}
