//! Very many plays, each with its own sigmoid output: a discrete Preisach operator in Krejci's form.

use rand::RngExt;

use super::between;
use crate::error::{StageError, within};

/// `y = sum_i w_i S_i(F_ri[v])`, `S_i(x) = b z / sqrt(1 + z^2)`, `z = (x - c_i) / b_i`.
///
/// The sigmoid makes the gain of each play fall away from its own centre: loops are asymmetric and minor loops depend on the bias.
///
/// # Cost
/// Two comparisons an operator; a square root and a division for those that move.
///
/// # Reference
/// Krejci, *Hysteresis, Convexity and Dissipation in Hyperbolic Equations* (1996), chapter II.3: Preisach operators as integrals of
/// functions of plays.
#[derive(Debug, Clone, PartialEq)]
pub struct SigmoidPlays {
    /// Loop opening of the reference cycle, a fraction.
    pub loop_opening: f64,
    /// The operators.
    pub plays: Vec<SigmoidPlay>,
}

/// One play and its output curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SigmoidPlay {
    /// Threshold r, volts.
    pub threshold_v: f64,
    /// Weight w (its gain at the centre), any positive unit.
    pub weight: f64,
    /// Centre c of the sigmoid, volts.
    pub centre_v: f64,
    /// Half width b of the sigmoid, volts.
    pub width_v: f64,
}

impl SigmoidPlays {
    /// Draws 120 plays for inputs from 0 V to `range_v`.
    ///
    /// # Range
    /// Loop opening 0.10 to 0.20; thresholds log-spaced from 0.2 to 50 % of the range; weights r^p, p = -0.2 to 0.3, each by a factor 0.7 to 1.3;
    /// centres drift smoothly with the threshold between 10 and 90 % of the range; half widths 0.5 to 1.5 ranges.
    pub fn random(rng: &mut impl RngExt, range_v: f64) -> Self {
        const PLAYS: usize = 120;
        let power = rng.random_range(-0.2..0.3);
        let (first_centre, last_centre) = (rng.random_range(0.1..0.9), rng.random_range(0.1..0.9));
        let width = rng.random_range(0.5..1.5);
        let plays = (0..PLAYS)
            .map(|i| {
                let place = i as f64 / (PLAYS - 1) as f64;
                let threshold = 0.002 * 250_f64.powf(place);
                SigmoidPlay {
                    threshold_v: range_v * threshold,
                    weight: threshold.powf(power) * rng.random_range(0.7..1.3),
                    centre_v: range_v * (first_centre + place * (last_centre - first_centre)),
                    width_v: range_v * width,
                }
            })
            .collect();
        Self {
            loop_opening: rng.random_range(0.10..0.20),
            plays,
        }
    }

    pub(crate) fn validate(&self) -> Result<(), StageError> {
        if self.plays.is_empty() {
            return Err(StageError::Length {
                name: "hysteresis.sigmoid_plays.plays".to_owned(),
                found: 0,
                wanted: "1 or more".to_owned(),
                advice: "use Family::Linear for a stage without hysteresis",
            });
        }
        for (i, play) in self.plays.iter().enumerate() {
            let name = |field: &str| format!("hysteresis.sigmoid_plays.plays[{i}].{field}");
            within(
                &name("threshold_v"),
                play.threshold_v,
                0.0,
                1e6,
                "thresholds are not negative",
            )?;
            within(&name("weight"), play.weight, 0.0, 1e9, "weights are not negative")?;
            within(
                &name("centre_v"),
                play.centre_v,
                -1e6,
                1e6,
                "centres lie near the voltage range",
            )?;
            within(&name("width_v"), play.width_v, 1e-3, 1e9, "widths are positive")?;
        }
        Ok(())
    }
}

/// Plays that are worked on together: one vector register or two.
const LANES: usize = 4;

/// A few plays in motion and the sum of their outputs.
#[derive(Debug, Clone)]
struct Group {
    threshold_v: [f64; LANES],
    play_v: [f64; LANES],
    centre_v: [f64; LANES],
    per_width: [f64; LANES],
    scale: [f64; LANES],
    sum: f64,
}

impl Group {
    fn new(plays: &[SigmoidPlay]) -> Self {
        // Missing lanes weigh nothing.
        let column = |pick: fn(&SigmoidPlay) -> f64| std::array::from_fn(|i| plays.get(i).map_or(0.0, pick));
        let mut group = Self {
            threshold_v: column(|play| play.threshold_v),
            play_v: [0.0; LANES],
            centre_v: column(|play| play.centre_v),
            per_width: column(|play| 1.0 / play.width_v),
            scale: column(|play| play.weight * play.width_v),
            sum: 0.0,
        };
        group.sum = group.output();
        group
    }

    #[inline]
    fn output(&self) -> f64 {
        let sigmoid: [f64; LANES] = std::array::from_fn(|i| {
            let z = (self.play_v[i] - self.centre_v[i]) * self.per_width[i];
            self.scale[i] * z / (1.0 + z * z).sqrt()
        });
        sigmoid.iter().sum()
    }

    #[inline]
    fn advance(&mut self, input_v: f64, threshold_scale: f64) -> f64 {
        let moved: [f64; LANES] = std::array::from_fn(|i| {
            let threshold_v = self.threshold_v[i] * threshold_scale;
            between(self.play_v[i], input_v - threshold_v, input_v + threshold_v)
        });
        if moved != self.play_v {
            self.play_v = moved;
            self.sum = self.output();
        }
        self.sum
    }
}

/// All plays in motion.
#[derive(Debug, Clone)]
pub(crate) struct SigmoidPlaysState {
    groups: Vec<Group>,
}

impl SigmoidPlaysState {
    pub(crate) fn new(config: &SigmoidPlays) -> Self {
        Self {
            groups: config.plays.chunks(LANES).map(Group::new).collect(),
        }
    }

    #[inline]
    pub(crate) fn advance(&mut self, input_v: f64, threshold_scale: f64) -> f64 {
        self.groups
            .iter_mut()
            .map(|group| group.advance(input_v, threshold_scale))
            .sum()
    }
}
