//! The noise floor of the position sensor, from the records themselves.

use crate::comparison::{NoiseFloor, NoiseSource};
use crate::missing::hum;
use hysteron_data::{Dataset, Record};
use hysteron_identify::family::peak_to_peak;
use hysteron_identify::period;

/// The noise floor of a dataset: given, from stretches at constant voltage, from the scatter between periods, or from
/// the differences between neighbouring samples, in this order.
pub fn noise_floor(dataset: &Dataset) -> NoiseFloor {
    if let Some(rms_um) = dataset.known.sensor_noise_um {
        return NoiseFloor {
            rms_um,
            source: NoiseSource::Given,
            samples: 0,
        };
    }
    let step_um = code_width(&dataset.records);
    let floor = quiet_stretches(&dataset.records)
        .or_else(|| period_scatter(&dataset.records))
        .unwrap_or_else(|| high_pass(&dataset.records));
    // A resting sensor may stand on one code: then rounding is the noise, q / sqrt(12).
    NoiseFloor {
        rms_um: floor.rms_um.max(step_um / 12f64.sqrt()),
        ..floor
    }
}

/// Samples of a window at constant voltage, short enough that creep is a parabola within it.
const WINDOW: usize = 100;
/// Stretches from which hum is taken out at once, seconds: a line that is missed by 25 mHz keeps its phase in them.
const HUM_S: f64 = 0.5;
/// Windows after a change of voltage that may still ring.
const SETTLING_WINDOWS: usize = 2;
/// Fewest windows to speak of a noise floor.
const FEWEST_WINDOWS: usize = 3;

/// Scatter about a parabola in windows of constant voltage; the median window, so that a jump or a burst does not count.
fn quiet_stretches(records: &[Record]) -> Option<NoiseFloor> {
    let largest = records
        .iter()
        .map(|record| peak_to_peak(&record.voltage_v))
        .fold(0.0, f64::max);
    // Where the sampling is too slow for the mains, hum folds back and looks like noise: such records count only without others.
    let (mut variances, mut slow) = (Vec::new(), Vec::new());
    for record in records {
        let kept = if record.period_s < hum::LONGEST_PERIOD_S {
            &mut variances
        } else {
            &mut slow
        };
        let mut start = 0;
        for k in 1..=record.len() {
            if k < record.len() && (record.voltage_v[k] - record.voltage_v[start]).abs() <= 1e-6 * largest {
                continue;
            }
            // Hum is an effect, and no noise.
            let part = (HUM_S / record.period_s / WINDOW as f64).ceil().max(1.0) as usize * WINDOW;
            let humless: Vec<f64> = record.position_um[start..k]
                .chunks(part)
                .flat_map(|still| hum::taken_out(still, record.period_s))
                .collect();
            let windows = humless.chunks_exact(WINDOW);
            kept.extend(windows.skip(SETTLING_WINDOWS).map(variance_about_parabola));
            start = k;
        }
    }
    if variances.len() < FEWEST_WINDOWS {
        variances.append(&mut slow);
    }
    if variances.len() < FEWEST_WINDOWS {
        return None;
    }
    variances.sort_by(f64::total_cmp);
    // Median of chi-squared with n degrees of freedom is n (1 - 2/(9n))^3 (Wilson, Hilferty 1931).
    let freedom = (WINDOW - 3) as f64;
    let median = variances[variances.len() / 2] / (1.0 - 2.0 / (9.0 * freedom)).powi(3);
    let samples = variances.len() * (WINDOW - 3);
    Some(NoiseFloor {
        rms_um: median.sqrt(),
        source: NoiseSource::QuietRecord,
        samples,
    })
}

/// Variance of the residuals of a least-squares parabola, unbiased.
fn variance_about_parabola(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    // Orthogonal polynomials on an even grid: 1, x, x^2 - mean(x^2).
    let centre = (n - 1.0) / 2.0;
    let mean_square = (n * n - 1.0) / 12.0;
    let bases: [fn(f64, f64) -> f64; 3] = [|_, _| 1.0, |x, _| x, |x, m| x * x - m];
    let grid = || (0..values.len()).map(|k| k as f64 - centre);
    let mut sum: f64 = values.iter().map(|v| v * v).sum();
    // Removing the mean first keeps the difference of squares exact enough for a large offset.
    let mean = values.iter().sum::<f64>() / n;
    sum -= n * mean * mean;
    for base in &bases[1..] {
        let dot: f64 = grid().zip(values).map(|(x, v)| base(x, mean_square) * (v - mean)).sum();
        let norm: f64 = grid().map(|x| base(x, mean_square).powi(2)).sum();
        sum -= dot * dot / norm;
    }
    sum.max(0.0) / (n - 3.0)
}

/// Scatter between the periods of periodic records; the first period is left out where there are three, as it may still
/// be settling.
fn period_scatter(records: &[Record]) -> Option<NoiseFloor> {
    let (mut squares, mut freedom) = (0.0, 0);
    for record in records {
        let Some(periodic) = period::detect(&record.voltage_v) else {
            continue;
        };
        let periods = periodic.count(record.len());
        let first = if periods > 2 { 1 } else { 0 };
        // Counted from the end, where the drive is surely periodic.
        let part = &record.position_um[record.len() - (periods - first) * periodic.samples..];
        let each: Vec<&[f64]> = part.chunks_exact(periodic.samples).collect();
        let count = each.len() as f64;
        for phase in 0..periodic.samples {
            let mean = each.iter().map(|period| period[phase]).sum::<f64>() / count;
            squares += each.iter().map(|period| (period[phase] - mean).powi(2)).sum::<f64>();
        }
        // Slow drift moves whole periods: their means are taken out.
        let grand = part.iter().sum::<f64>() / part.len() as f64;
        let samples = periodic.samples as f64;
        squares -= each
            .iter()
            .map(|period| samples * (period.iter().sum::<f64>() / samples - grand).powi(2))
            .sum::<f64>();
        freedom += (each.len() - 1) * (periodic.samples - 1);
    }
    (freedom > 0).then(|| NoiseFloor {
        rms_um: (squares.max(0.0) / freedom as f64).sqrt(),
        source: NoiseSource::PeriodScatter,
        samples: freedom,
    })
}

/// White noise leaves third differences of 20 times its variance; a smooth position leaves next to none.
fn high_pass(records: &[Record]) -> NoiseFloor {
    let (mut squares, mut samples) = (0.0, 0);
    for record in records {
        for y in record.position_um.windows(4) {
            squares += (y[3] - 3.0 * y[2] + 3.0 * y[1] - y[0]).powi(2);
            samples += 1;
        }
    }
    let variance = if samples > 0 {
        squares / samples as f64 / 20.0
    } else {
        0.0
    };
    NoiseFloor {
        rms_um: variance.sqrt(),
        source: NoiseSource::HighPass,
        samples,
    }
}

/// The sensor's code width, where all positions are multiples of one step; 0 where they are not.
fn code_width(records: &[Record]) -> f64 {
    let steps = || {
        records
            .iter()
            .flat_map(|record| record.position_um.windows(2))
            .map(|y| (y[1] - y[0]).abs())
    };
    let least = steps().filter(|&step| step > 0.0).fold(f64::INFINITY, f64::min);
    // Files round codes to a few digits: a twentieth of a step is that rounding, not another value.
    let on_grid = |step: f64| (step / least - (step / least).round()).abs() < 0.05;
    // Many steps of many sizes lie on a fine enough grid by chance: only small multiples count.
    let (mut small, mut off) = (0u32, 0u32);
    for step in steps().filter(|&step| step <= 8.0 * least) {
        small += 1;
        off += u32::from(!on_grid(step));
    }
    if small >= 100 && off * 100 <= small { least } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_data::Role;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    fn record(voltage_v: Vec<f64>, position_um: Vec<f64>) -> Record {
        Record {
            file: "a.csv".into(),
            role: Role::Identify,
            excitation: String::new(),
            start_s: 0.0,
            period_s: 1e-4,
            voltage_v,
            position_um,
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        }
    }

    fn noise(n: usize, rms: f64) -> Vec<f64> {
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(7);
        let normal = Normal::new(0.0, rms).unwrap();
        (0..n).map(|_| normal.sample(&mut random)).collect()
    }

    fn floor_of(record: Record) -> NoiseFloor {
        noise_floor(&Dataset {
            records: vec![record],
            ..Dataset::default()
        })
    }

    /// 3 standard errors of a standard deviation from n samples: 3 / sqrt(2 n).
    fn near(found: f64, truth: f64, n: usize) -> bool {
        (found / truth - 1.0).abs() < 3.0 / (2.0 * n as f64).sqrt() + 0.02
    }

    #[test]
    fn val_quiet_record_with_drift_and_offset() {
        let y = noise(5000, 0.002)
            .iter()
            .enumerate()
            .map(|(k, e)| 1000.0 + 1e-5 * k as f64 + e)
            .collect();
        let floor = floor_of(record(vec![0.0; 5000], y));
        assert_eq!(floor.source, NoiseSource::QuietRecord);
        assert!(near(floor.rms_um, 0.002, 5000), "{floor:?}");
    }

    #[test]
    fn val_period_scatter() {
        let v: Vec<f64> = (0..5000)
            .map(|k| 10.0 - 10.0 * (f64::from(k) * std::f64::consts::TAU / 500.0).cos())
            .collect();
        let y = v.iter().zip(noise(5000, 0.01)).map(|(v, e)| 0.1 * v + e).collect();
        let floor = floor_of(record(v, y));
        assert_eq!(floor.source, NoiseSource::PeriodScatter);
        assert!(near(floor.rms_um, 0.01, 4000), "{floor:?}");
    }

    #[test]
    fn val_high_pass_on_a_ramp() {
        let v: Vec<f64> = (0..2000).map(f64::from).collect();
        let y = v.iter().zip(noise(2000, 0.01)).map(|(v, e)| 0.1 * v + e).collect();
        let floor = floor_of(record(v, y));
        assert_eq!(floor.source, NoiseSource::HighPass);
        // Neighbouring third differences are correlated: about a quarter of the samples count.
        assert!(near(floor.rms_um, 0.01, 500), "{floor:?}");
    }

    #[test]
    fn val_a_sensor_on_one_code_is_as_noisy_as_its_rounding() {
        let y = (0..4000)
            .map(|k| if k % 37 < 2 { 0.0012 } else { 0.0 })
            .collect::<Vec<_>>();
        let y = y
            .iter()
            .enumerate()
            .map(|(k, &y)| if k > 1000 { 0.0 } else { y })
            .collect();
        let floor = floor_of(record(vec![0.0; 4000], y));
        assert!((floor.rms_um - 0.0012 / 12f64.sqrt()).abs() < 1e-12, "{floor:?}");
    }
}
