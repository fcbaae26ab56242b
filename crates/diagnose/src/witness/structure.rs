//! What noise does not do: go on from sample to sample, come in outliers.

use crate::witness::traces::Traces;

/// Lag-one autocorrelation from which a residual is more than white noise; its standard error over a thousand samples is 0.03.
const CORRELATED: f64 = 0.3;

/// Kurtosis from which a residual has outliers; that of normal noise is 3 with a standard error of 0.15 over a thousand samples.
const OUTLIERS: f64 = 8.0;

/// Whether the residuals of at least half of the moving records are something else than white noise without outliers.
pub(crate) fn more_than_noise(traces: &Traces, residuals: &[Vec<f64>]) -> bool {
    let (mut more, mut all) = (0, 0);
    for (trace, residual) in traces.each.iter().zip(residuals).filter(|(t, _)| t.stroke_um > 0.0) {
        let own = &residual[trace.from..];
        let n = own.len() as f64;
        let mean = own.iter().sum::<f64>() / n;
        let moment = |power: i32| own.iter().map(|r| (r - mean).powi(power)).sum::<f64>() / n;
        let variance = moment(2).max(f64::MIN_POSITIVE);
        let lagged = own.windows(2).map(|r| (r[0] - mean) * (r[1] - mean)).sum::<f64>() / n;
        all += 1;
        more += usize::from(lagged / variance > CORRELATED || moment(4) / variance.powi(2) > OUTLIERS);
    }
    2 * more > all
}
