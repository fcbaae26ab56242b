//! A bend behind a sum of plays: one-sided dead zones, `x + sum s_j max(x - d_j, 0)`.

/// Levels and slopes; none is the straight line.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct DeadZones {
    levels: Vec<f64>,
    slopes: Vec<f64>,
}

impl DeadZones {
    /// Levels that divide a range into equal parts, slopes of 0.
    pub(super) fn over([low, high]: [f64; 2], count: usize) -> Self {
        let level = |j: usize| low + (high - low) * (j + 1) as f64 / (count + 1) as f64;
        Self {
            levels: (0..count).map(level).collect(),
            slopes: vec![0.0; count],
        }
    }

    pub(super) fn slopes(&self) -> &[f64] {
        &self.slopes
    }

    pub(super) fn set_slopes(&mut self, slopes: &[f64]) {
        self.slopes.copy_from_slice(slopes);
    }

    /// What each zone passes of x.
    pub(super) fn passed(&self, x: f64) -> impl Iterator<Item = f64> + '_ {
        self.levels.iter().map(move |level| (x - level).max(0.0))
    }

    pub(super) fn output(&self, x: f64) -> f64 {
        x + self.passed(x).zip(&self.slopes).map(|(p, s)| p * s).sum::<f64>()
    }

    /// Derivative of [`Self::output`].
    pub(super) fn slope(&self, x: f64) -> f64 {
        let passes = |(level, slope): (&f64, &f64)| if x > *level { *slope } else { 0.0 };
        1.0 + self.levels.iter().zip(&self.slopes).map(passes).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: levels 1, 2, 3 over 0 to 4.
    #[test]
    fn val_bend_by_hand() {
        let mut zones = DeadZones::over([0.0, 4.0], 3);
        assert_eq!((zones.output(2.5), zones.slope(2.5)), (2.5, 1.0));
        zones.set_slopes(&[0.5, -1.0, 2.0]);
        for (x, y, slope) in [(0.5, 0.5, 1.0), (1.5, 1.75, 1.5), (2.5, 2.75, 0.5), (4.0, 5.5, 2.5)] {
            assert_eq!((zones.output(x), zones.slope(x)), (y, slope), "{x}");
        }
    }
}
