//! What channels that are not sampled at once, and a filter of the sensor, do to a controller: no record tells them from a lag.

use core::fmt::{self, Display, Formatter};
use hysteron_identify::control::ControlModel;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// The frequency that the consequence is said for, hertz.
const SAID_AT_HZ: f64 = 500.0;

/// The lag that was identified, of which any part may be a skew between voltage and position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Skew {
    /// The lag, seconds.
    pub lag_s: f64,
    /// Sample period of the records, seconds.
    pub sample_s: f64,
    /// Whether the sensor's filter is known, and undone by itself.
    pub sensor_known: bool,
}

impl Skew {
    /// Of a chain that was identified; none where there is no lag.
    pub fn of(model: &ControlModel) -> Option<Self> {
        let lag_s = model.linear.lag_s;
        (lag_s > 0.0).then_some(Self {
            lag_s,
            sample_s: model.sample_period_s,
            sensor_known: model.around.sensor_lag_s > 0.0,
        })
    }

    /// Rms of the error that a skew of one sample makes of a sine, percent of peak to peak: `sin(w T / 2) / sqrt 2`.
    pub fn percent_a_sample(&self) -> f64 {
        100.0 * FRAC_1_SQRT_2 * (PI * SAID_AT_HZ * self.sample_s).sin()
    }
}

/// Rms of the error that a filter of first order in front of the reading makes of a sine, percent of peak to peak.
fn filter_percent(bandwidth_hz: f64) -> f64 {
    let phase = (SAID_AT_HZ / bandwidth_hz).atan();
    100.0 * 0.5 * FRAC_1_SQRT_2 * phase.sin()
}

impl Display for Skew {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the records have a lag of {:.1} us, which the controller undoes as the amplifier's; a skew between the channels of voltage and \
             position cannot be told from it. Each sample of skew, {:.1} us, is an error of {:.1} % of peak to peak at {SAID_AT_HZ} Hz. \
             Sample both at once; one signal in both channels shows whether they are",
            1e6 * self.lag_s,
            1e6 * self.sample_s,
            self.percent_a_sample()
        )?;
        if self.sensor_known {
            return Ok(());
        }
        write!(
            f,
            ". Nor can a filter of the sensor, which is not known: one of 20 kHz is an error of {:.1} % there; give its bandwidth in hertz, from \
             its data sheet",
            filter_percent(20e3)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// One sample late, by the definition: rms of the difference of two sines over the peak to peak of one.
    #[test]
    fn val_a_sample_of_skew_is_so_large_an_error() {
        for sample_s in [20e-6, 100e-6] {
            let skew = Skew {
                lag_s: 70e-6,
                sample_s,
                sensor_known: true,
            };
            let at = |time_s: f64| (TAU * SAID_AT_HZ * time_s).sin();
            let squares = (0..1000).map(|k| {
                let time_s = f64::from(k) / SAID_AT_HZ / 1000.0;
                (at(time_s) - at(time_s - sample_s)).powi(2)
            });
            let percent = 100.0 * (squares.sum::<f64>() / 1000.0).sqrt() / 2.0;
            assert!((skew.percent_a_sample() - percent).abs() < 1e-9, "{percent}");
        }
        let said = Skew {
            lag_s: 71.6e-6,
            sample_s: 20e-6,
            sensor_known: false,
        };
        let words = said.to_string();
        assert!(
            words.contains("a lag of 71.6 us") && words.contains("20.0 us, is an error of 2.2 %"),
            "{words}"
        );
        assert!(words.contains("one of 20 kHz is an error of 0.9 % there"), "{words}");
        let known = Skew {
            sensor_known: true,
            ..said
        };
        assert!(!known.to_string().contains("20 kHz"), "{known}");
    }

    /// A sine less the same behind a filter, over a period, by the filter's closed form.
    #[test]
    fn val_a_filter_is_so_large_an_error() {
        let ratio = SAID_AT_HZ / 20e3;
        let gain = 1.0 / 1.0_f64.hypot(ratio);
        let squares = (0..1000).map(|k| {
            let phase = TAU * f64::from(k) / 1000.0;
            (phase.sin() - gain * (phase - ratio.atan()).sin()).powi(2)
        });
        let percent = 100.0 * (squares.sum::<f64>() / 1000.0).sqrt() / 2.0;
        assert!((filter_percent(20e3) - percent).abs() < 1e-9, "{percent}");
    }

    #[test]
    fn val_no_lag_is_no_skew() {
        let mut model = crate::design::stands::tests::rigid();
        assert_eq!(Skew::of(&model), None);
        model.linear.lag_s = 60e-6;
        assert_eq!(Skew::of(&model).map(|skew| skew.lag_s), Some(60e-6));
    }
}
