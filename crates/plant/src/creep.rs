//! Creep: the stack goes on moving after the voltage has stopped.

use crate::error::{StageError, ordered, within};
use crate::linear::Lag;

/// The law of the creep.
#[derive(Debug, Clone, PartialEq)]
pub enum Creep {
    /// After a step the displacement grows by the same share in every decade of time:
    /// `y(t) = y0 [1 + gamma log10(t / t_from)]` between `from_s` and `to_s`.
    ///
    /// Made of first-order states, two a decade, their times at the centres of half decades; the slope of the sum differs from gamma by less than
    /// 4 % at any one time and by nothing over whole half decades.
    Log {
        /// gamma, percent for each decade.
        percent_per_decade: f64,
        /// Time after a step when the creep sets in, seconds.
        from_s: f64,
        /// Time when it ends, seconds.
        to_s: f64,
    },
    /// A chain of Kelvin-Voigt elements (spring and damper in parallel) in series with the stack.
    KelvinVoigt {
        /// The elements.
        elements: Vec<KelvinVoigtElement>,
    },
}

/// One Kelvin-Voigt element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KelvinVoigtElement {
    /// What it adds after a long time, as a share of the immediate displacement.
    pub share: f64,
    /// Its time constant, seconds.
    pub time_constant_s: f64,
}

impl Creep {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        match self {
            Self::Log {
                percent_per_decade,
                from_s,
                to_s,
            } => {
                within(
                    "creep.log.percent_per_decade",
                    *percent_per_decade,
                    0.0,
                    20.0,
                    "piezo ceramics creep by 1 to 2",
                )?;
                check_states("creep.log", *from_s, *to_s).map(|_| ())
            }
            Self::KelvinVoigt { elements } => {
                for (i, element) in elements.iter().enumerate() {
                    let name = |field: &str| format!("creep.kelvin_voigt.elements[{i}].{field}");
                    within(&name("share"), element.share, -0.5, 1.0, "shares are 0.005 to 0.05")?;
                    within(
                        &name("time_constant_s"),
                        element.time_constant_s,
                        1e-5,
                        1e7,
                        "times are 0.01 to 1000 s",
                    )?;
                }
                Ok(())
            }
        }
    }
}

/// Time constants, two a decade, at the centres of equal parts of `from_s..to_s` on a log scale.
pub(crate) fn check_states(name: &str, from_s: f64, to_s: f64) -> Result<Vec<f64>, StageError> {
    within(&format!("{name}.from_s"), from_s, 1e-7, 1e6, "0.1 ms to 0.1 s is usual")?;
    within(&format!("{name}.to_s"), to_s, 1e-7, 1e8, "10 s to an hour is usual")?;
    ordered(&format!("{name}.from_s"), from_s, "to_s", to_s)?;
    let states = (2.0 * (to_s / from_s).log10()).round().max(1.0);
    Ok((0..states as usize)
        .map(|i| from_s * (to_s / from_s).powf((i as f64 + 0.5) / states))
        .collect())
}

/// The creep in motion: `y = u + sum_j c_j x_j`, `tau_j x_j' = u - x_j`.
#[derive(Debug, Clone)]
pub(crate) struct CreepState {
    states: Vec<(f64, Lag)>,
    added: f64,
}

impl CreepState {
    pub(crate) fn new(config: &Creep) -> Result<Self, StageError> {
        config.validate()?;
        let states = match config {
            Creep::Log {
                percent_per_decade,
                from_s,
                to_s,
            } => {
                let times = check_states("creep.log", *from_s, *to_s)?;
                let share = 0.01 * percent_per_decade * (to_s / from_s).log10() / times.len() as f64;
                times.into_iter().map(|time_s| (share, Lag::new(time_s))).collect()
            }
            Creep::KelvinVoigt { elements } => elements
                .iter()
                .map(|element| (element.share, Lag::new(element.time_constant_s)))
                .collect(),
        };
        Ok(Self { states, added: 0.0 })
    }

    pub(crate) fn set_step(&mut self, step_s: f64) {
        self.states.iter_mut().for_each(|(_, lag)| lag.set_step(step_s));
    }

    /// One step: the two ends in, the two ends with creep out.
    #[inline]
    pub(crate) fn advance(&mut self, from: f64, to: f64) -> (f64, f64) {
        let start = from + self.added;
        self.added = 0.0;
        for (share, lag) in &mut self.states {
            self.added += *share * lag.advance(from, to);
        }
        (start, to + self.added)
    }
}

#[cfg(test)]
mod tests {
    use super::{Creep, CreepState, KelvinVoigtElement};

    fn after_step(config: &Creep, times_s: &[f64]) -> Vec<f64> {
        times_s
            .iter()
            .map(|&time_s| {
                let mut state = CreepState::new(config).unwrap();
                state.set_step(time_s);
                state.advance(1.0, 1.0).1
            })
            .collect()
    }

    /// 1.5 % per decade: over whole decades well inside the range the slope is gamma; two states a decade leave a ripple of the
    /// running value of at most 0.02 decades (0.0003), the neighbours' tails included.
    #[test]
    fn val_log_slope_per_decade() {
        let config = Creep::Log {
            percent_per_decade: 1.5,
            from_s: 2e-4,
            to_s: 1e3,
        };
        let y = after_step(&config, &[0.01, 0.1, 1.0, 10.0]);
        for pair in y.windows(2) {
            assert!((pair[1] - pair[0] - 0.015).abs() < 3e-4, "{y:?}");
        }
    }

    #[test]
    fn val_kelvin_voigt_closed_form() {
        let elements = vec![
            KelvinVoigtElement {
                share: 0.02,
                time_constant_s: 1.0,
            },
            KelvinVoigtElement {
                share: 0.03,
                time_constant_s: 10.0,
            },
        ];
        let y = after_step(&Creep::KelvinVoigt { elements }, &[2.0]);
        let exact = 1.0 + 0.02 * (1.0 - (-2.0_f64).exp()) + 0.03 * (1.0 - (-0.2_f64).exp());
        assert!((y[0] - exact).abs() < 1e-12);
    }
}
