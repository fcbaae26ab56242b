//! Plain questions to series.

/// Smallest and largest value.
pub fn range(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values
        .into_iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
}

/// Peak to peak of a series; 0 for an empty one.
pub fn peak_to_peak(values: &[f64]) -> f64 {
    let (low, high) = range(values.iter().copied());
    if values.is_empty() { 0.0 } else { high - low }
}

/// Share of a record's drive within which the stage stands still: a plain thousandth of its stroke.
const RESTS: f64 = 1e-3;

/// Fewer samples are no rest: a drive in motion passes through.
const LEAST_REST: usize = 3;

/// Samples of a rest that are looked at: what it drifts in a longer one is the effect itself.
const LONGEST_REST: usize = 200;

/// Samples of the rest with which a drive begins, every so many of the series one; `None` where it begins in motion.
pub fn rest(drive: &[f64], every: usize) -> Option<usize> {
    let (low, high) = range(drive.iter().copied());
    let rests = |v: &&f64| (**v - drive[0]).abs() <= RESTS * (high - low);
    let samples = drive.iter().step_by(every).take_while(rests).take(LONGEST_REST).count();
    (samples >= LEAST_REST).then_some(samples)
}
