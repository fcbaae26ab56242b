//! What a straight line reaches: the model of a stage without hysteresis, to hold every other model against.

use crate::compare::{Errors, pool};
use crate::comparison::{Pooled, RecordComparison};
use hysteron_data::Role;

/// The line `output = offset + slope input`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StraightLine {
    offset: f64,
    slope: f64,
}

impl StraightLine {
    /// Least squares over the records with role `identify`, or all where none has it. `None` where the input stands still.
    pub(crate) fn fit(records: &[RecordComparison]) -> Option<Self> {
        let any = records.iter().any(|record| record.role == Role::Identify);
        let fitted = || {
            let records = records.iter().filter(|record| !any || record.role == Role::Identify);
            records.flat_map(|record| record.series.input.iter().zip(&record.series.measured))
        };
        let n = fitted().count() as f64;
        let (input_mean, output_mean) = fitted().fold((0.0, 0.0), |(u, y), (a, b)| (u + a / n, y + b / n));
        let (spread, slope) = fitted().fold((0.0, 0.0), |(spread, product), (u, y)| {
            let u = u - input_mean;
            (spread + u * u, product + u * (y - output_mean))
        });
        (spread > 0.0).then(|| Self {
            offset: output_mean - slope / spread * input_mean,
            slope: slope / spread,
        })
    }

    /// Its errors on the records of a role, pooled.
    pub(crate) fn pooled(self, records: &[RecordComparison], role: Role, clipped: &[f64]) -> Option<Pooled> {
        let errors = records.iter().filter(|record| record.role == role).map(|record| {
            let series = &record.series;
            let moves = record.nrmse_percent.is_some();
            Errors::new(
                (&series.measured, clipped),
                series.input.iter().map(|u| self.offset + self.slope * u),
                moves,
            )
        });
        pool(errors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::Series;

    fn record(role: Role, input: &[f64], measured: &[f64]) -> RecordComparison {
        RecordComparison {
            file: "a.csv".to_owned(),
            role,
            nrmse_percent: Some(0.0),
            fit_percent: Some(100.0),
            rms_um: 0.0,
            max_um: 0.0,
            noise_ratio: 0.0,
            samples: input.len(),
            initial_state: String::new(),
            start_estimated: false,
            series: Series {
                start_s: 0.0,
                period_s: 1.0,
                input: input.to_vec(),
                measured: measured.to_vec(),
                modelled: measured.to_vec(),
            },
        }
    }

    /// A parallelogram of width 0.2 about y = 1 + 2 u is half its width off everywhere, by hand.
    #[test]
    fn val_line_through_a_loop() {
        let input = [0.0, 1.0, 1.0, 0.0];
        let there = record(Role::Identify, &input, &[1.1, 3.1, 2.9, 0.9]);
        let other = record(Role::Validate, &[0.0, 2.0], &[1.0, 5.4]);
        let records = [there, other];
        let line = StraightLine::fit(&records).unwrap();
        assert!((line.offset - 1.0).abs() < 1e-12 && (line.slope - 2.0).abs() < 1e-12);
        let fitted = line.pooled(&records, Role::Identify, &[]).unwrap();
        assert!((fitted.rms_um - 0.1).abs() < 1e-12 && (fitted.nrmse_percent - 100.0 * 0.1 / 2.2).abs() < 1e-9);
        let validated = line.pooled(&records, Role::Validate, &[]).unwrap();
        assert!((validated.rms_um - 0.4 / 2.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn refuse_an_input_that_stands_still() {
        assert_eq!(
            StraightLine::fit(&[record(Role::Identify, &[1.0, 1.0], &[0.0, 0.1])]),
            None
        );
    }
}
