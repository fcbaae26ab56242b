//! The loop opening: one number for how wide a hysteresis loop is.

use crate::error::{StageError, all_finite, within};

/// Loop opening of a periodic record: the vertical width of the loop at mid voltage over the peak-to-peak displacement.
///
/// `h = |y_down - y_up| / (max y - min y)`, y_up and y_down the mean displacements where the voltage passes (max v + min v) / 2 upwards and downwards,
/// interpolated between samples. For a sine behind a pure phase lag phi it is h = sin phi. The paper does not say how it measures its hysteresis
/// percent; this is the reading under which its three figures are a straight line of phase against frequency.
///
/// # Errors
/// - columns of different length, below 4 samples, or with values that are not finite;
/// - a voltage that does not pass its middle in both directions, a displacement that does not move.
///
/// # Example
/// ```
/// let x: Vec<f64> = (0..1000).map(|n| std::f64::consts::TAU * f64::from(n) / 1000.0).collect();
/// let voltage_v: Vec<f64> = x.iter().map(|x| 13.0 - 13.0 * x.cos()).collect();
/// let position_um: Vec<f64> = x.iter().map(|x| 1.3 - 1.3 * (x - 0.2).cos()).collect();
/// let h = hysteron_plant::opening::loop_opening(&voltage_v, &position_um)?;
/// assert!((h - 0.2_f64.sin()).abs() < 1e-5);
/// # Ok::<(), hysteron_plant::StageError>(())
/// ```
pub fn loop_opening(voltage_v: &[f64], position_um: &[f64]) -> Result<f64, StageError> {
    if voltage_v.len() < 4 || voltage_v.len() != position_um.len() {
        return Err(StageError::Length {
            name: "position_um".to_owned(),
            found: position_um.len(),
            wanted: format!("as many as voltage_v ({}), at least 4", voltage_v.len()),
            advice: "give one whole period of both columns",
        });
    }
    all_finite("voltage_v", voltage_v, f64::MAX, "give volts")?;
    all_finite("position_um", position_um, f64::MAX, "give micrometres")?;
    let (low_v, high_v) = range(voltage_v);
    let (low_um, high_um) = range(position_um);
    within(
        "peak to peak of position_um",
        high_um - low_um,
        f64::MIN_POSITIVE,
        f64::MAX,
        "the stage must move",
    )?;
    let middle_v = 0.5 * (low_v + high_v);
    let (mut up, mut down) = (Mean::default(), Mean::default());
    for (v, y) in voltage_v.windows(2).zip(position_um.windows(2)) {
        let (before, after) = (v[0] - middle_v, v[1] - middle_v);
        if (before < 0.0) == (after < 0.0) {
            continue;
        }
        let crossing_um = y[0] + (y[1] - y[0]) * before / (before - after);
        if after > before {
            up.add(crossing_um)
        } else {
            down.add(crossing_um)
        }
    }
    match (up.value(), down.value()) {
        (Some(up_um), Some(down_um)) => Ok((down_um - up_um).abs() / (high_um - low_um)),
        _ => Err(StageError::Conflict {
            what: format!(
                "voltage_v passes its middle, {middle_v} V, {} times upwards and {} times downwards",
                up.count, down.count
            ),
            advice: "give at least one whole period",
        }),
    }
}

fn range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
            (low.min(x), high.max(x))
        })
}

#[derive(Default)]
struct Mean {
    sum: f64,
    count: u32,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    fn value(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / f64::from(self.count))
    }
}
