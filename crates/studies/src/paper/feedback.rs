//! The gains K_p = 1 and K_i = 6000, whose units the paper does not state.

use super::tracking::{Bandwidth, Bench, NOISE_SHARE, TrackingFigure, of};
use hysteron_control::reference::Shape;
use hysteron_tracking::TrackingError;
use hysteron_tracking::experiment::Reading;
use hysteron_tracking::run::PiGains;
use rayon::prelude::*;

/// The paper's bandwidth of the PI controller, hertz.
pub const PUBLISHED_PI_HZ: f64 = 36.1;

/// PI control under one reading of the gains' units.
#[derive(Debug, Clone, PartialEq)]
pub struct PiReading {
    /// The reading.
    pub reading: Reading,
    /// The gains under it.
    pub gains: PiGains,
    /// The response to noise.
    pub bandwidth: Bandwidth,
    /// The 500 Hz sine.
    pub at_500_hz: Option<TrackingFigure>,
}

impl PiReading {
    /// The bandwidth, if the loop holds it: a loop that swings from limit to limit has none.
    pub fn bandwidth_hz(&self) -> Option<f64> {
        let crossing = self.bandwidth.lag_30_deg?;
        (self.bandwidth.limited_percent == 0.0 && crossing.coherence > 0.5).then_some(crossing.frequency_hz)
    }
}

pub(super) fn readings(bench: &Bench<'_>) -> Result<Vec<PiReading>, TrackingError> {
    Reading::ALL
        .par_iter()
        .map(|&reading| {
            let gains = reading.gains(bench.stage);
            let named = of(None, Some(gains));
            Ok(PiReading {
                reading,
                gains,
                bandwidth: bench.bandwidth(&named, NOISE_SHARE)?,
                at_500_hz: bench.figure(&named, Shape::Sine { frequency_hz: 500.0 })?,
            })
        })
        .collect()
}

/// The reading whose bandwidth has the smallest ratio to the published 36.1 Hz, either way; the first where none has one.
pub fn chosen_reading(readings: &[PiReading]) -> usize {
    let distance = |reading: &PiReading| {
        reading
            .bandwidth_hz()
            .map_or(f64::INFINITY, |hz| (hz / PUBLISHED_PI_HZ).ln().abs())
    };
    (0..readings.len())
        .min_by(|&a, &b| distance(&readings[a]).total_cmp(&distance(&readings[b])))
        .unwrap_or(0)
}
