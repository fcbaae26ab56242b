//! The capacitive sensor and its converter.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use crate::converter::Converter;
use crate::error::{StageError, within};
use crate::linear::Lag;

/// The position sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// Displacement for each volt of sensor output, micrometres per volt; the paper's has +-25 um on +-10 V.
    pub um_per_v: f64,
    /// Corner frequency of the sensor's first-order filter, hertz.
    pub bandwidth_hz: Option<f64>,
    /// Curvature of the characteristic.
    pub nonlinearity: Option<SensorNonlinearity>,
    /// White noise of one sample, micrometres rms.
    pub noise_rms_um: f64,
    /// The converter; none leaves the reading unrounded.
    pub adc: Option<Converter>,
}

/// A characteristic `y + F (c2 (y / F)^2 + c3 (y / F)^3)`, F the sensor's full scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNonlinearity {
    /// c2, a fraction of full scale.
    pub quadratic: f64,
    /// c3, a fraction of full scale.
    pub cubic: f64,
    /// F, micrometres.
    pub full_scale_um: f64,
}

impl Default for Sensor {
    /// The paper's: +-25 um on +-10 V, 16 bits, 0.8 nm rms (its data sheet: below 1 nm), bandwidth not limited.
    fn default() -> Self {
        Self {
            um_per_v: 2.5,
            bandwidth_hz: None,
            nonlinearity: None,
            noise_rms_um: 0.8e-3,
            adc: Some(Converter::BIPOLAR_16_BIT),
        }
    }
}

impl Sensor {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "sensor.um_per_v",
            self.um_per_v,
            1e-4,
            1e4,
            "the paper's sensor has 2.5",
        )?;
        within(
            "sensor.noise_rms_um",
            self.noise_rms_um,
            0.0,
            10.0,
            "capacitive sensors have 1e-4 to 3e-3",
        )?;
        if let Some(bandwidth_hz) = self.bandwidth_hz {
            within(
                "sensor.bandwidth_hz",
                bandwidth_hz,
                1.0,
                1e6,
                "sensor filters have 1 to 100 kHz; None for no filter",
            )?;
        }
        if let Some(curve) = &self.nonlinearity {
            within(
                "sensor.nonlinearity.quadratic",
                curve.quadratic,
                -0.1,
                0.1,
                "capacitive sensors have up to 1e-3",
            )?;
            within(
                "sensor.nonlinearity.cubic",
                curve.cubic,
                -0.1,
                0.1,
                "capacitive sensors have up to 1e-3",
            )?;
            within(
                "sensor.nonlinearity.full_scale_um",
                curve.full_scale_um,
                1e-3,
                1e5,
                "full scale is the stroke or the sensor's range",
            )?;
        }
        self.adc.map_or(Ok(()), |adc| adc.validate("sensor.adc"))
    }
}

/// What the sensor says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reading {
    pub(crate) position_um: f64,
    pub(crate) code: u32,
}

/// The sensor in motion.
#[derive(Debug, Clone)]
pub(crate) struct SensorState {
    config: Sensor,
    lag: Option<Lag>,
    input_um: f64,
    noise: Pcg64,
}

impl SensorState {
    pub(crate) fn new(config: &Sensor, seed: u64) -> Self {
        let lag = config
            .bandwidth_hz
            .map(|hz| Lag::new(1.0 / (std::f64::consts::TAU * hz)));
        Self {
            config: config.clone(),
            lag,
            input_um: 0.0,
            noise: Pcg64::seed_from_u64(seed),
        }
    }

    pub(crate) fn set_step(&mut self, step_s: f64) {
        if let Some(lag) = &mut self.lag {
            lag.set_step(step_s);
        }
    }

    /// The position moves on.
    #[inline]
    pub(crate) fn advance(&mut self, to_um: f64) {
        if let Some(lag) = &mut self.lag {
            lag.advance(self.input_um, to_um);
        }
        self.input_um = to_um;
    }

    /// One sample, with its own noise.
    pub(crate) fn read(&mut self) -> Reading {
        let seen_um = self.lag.as_ref().map_or(self.input_um, |lag| lag.output);
        let bent_um = match &self.config.nonlinearity {
            None => seen_um,
            Some(curve) => {
                let x = seen_um / curve.full_scale_um;
                seen_um + curve.full_scale_um * x * x * (curve.quadratic + curve.cubic * x)
            }
        };
        let normal: f64 = StandardNormal.sample(&mut self.noise);
        let noisy_um = bent_um + self.config.noise_rms_um * normal;
        match &self.config.adc {
            None => Reading {
                position_um: noisy_um,
                code: 0,
            },
            Some(adc) => {
                let code = adc.code_from_v(noisy_um / self.config.um_per_v);
                Reading {
                    position_um: adc.v_from_code(code) * self.config.um_per_v,
                    code,
                }
            }
        }
    }
}
