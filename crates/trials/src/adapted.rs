//! What a law learned while it ran on a board or in the emulator, in the units of the host's.

use hysteron_board::Learned;
use hysteron_control::adapted::Adapted;

/// Of a table of this rate.
pub(crate) fn adapted(learned: Option<Learned>, rate_hz: f32) -> Option<Adapted> {
    learned.map(|learned| Adapted {
        gain_percent: 100.0 * f64::from(learned.gain),
        zero_um: learned.zero_um.into(),
        lag_us: 1e6 * f64::from(learned.lag_samples) / f64::from(rate_hz),
    })
}
