//! Temperature, and what it does to position and gain.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use crate::error::{StageError, within};
use crate::linear::Lag;

/// The temperature beside the stage, and the sensor that records it.
///
/// `T = start + drift t + warm_up (1 - exp(-t / tau)) + swing [sin(2 pi t / period + phi) - sin phi]`, the phase drawn from the seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Temperature {
    /// At time zero, degrees Celsius.
    pub start_c: f64,
    /// Steady drift, kelvin per hour.
    pub drift_k_per_h: f64,
    /// Warm-up of the electronics or the room, kelvin.
    pub warm_up_k: f64,
    /// Time constant of the warm-up, seconds.
    pub warm_up_s: f64,
    /// Amplitude of a slow swing (air conditioning), kelvin.
    pub swing_k: f64,
    /// Its period, seconds.
    pub swing_period_s: f64,
    /// Noise of the recorded temperature, kelvin rms.
    pub noise_rms_k: f64,
    /// Step of the recorded temperature, kelvin (0 for none).
    pub resolution_k: f64,
}

/// What the temperature does to the stage, counted from the temperature at time zero.
///
/// The stage follows the temperature beside it with a first-order lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalDrift {
    /// Shift of the position, micrometres per kelvin.
    pub position_um_per_k: f64,
    /// Change of the displacement's gain, percent per kelvin.
    pub gain_percent_per_k: f64,
    /// Lag of the stage behind the recorded temperature, seconds (0 for none).
    pub lag_s: f64,
}

impl Default for Temperature {
    /// A quiet laboratory: 22 degrees, 0.1 K of swing in 15 minutes, a sensor with 2 mK of noise in steps of 1 mK.
    fn default() -> Self {
        Self {
            start_c: 22.0,
            drift_k_per_h: 0.0,
            warm_up_k: 0.0,
            warm_up_s: 1800.0,
            swing_k: 0.1,
            swing_period_s: 900.0,
            noise_rms_k: 0.002,
            resolution_k: 0.001,
        }
    }
}

impl Temperature {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "temperature.start_c",
            self.start_c,
            -273.15,
            1e3,
            "a laboratory has 20 to 25",
        )?;
        within(
            "temperature.drift_k_per_h",
            self.drift_k_per_h,
            -1e4,
            1e4,
            "rooms drift by 0.1 to 1",
        )?;
        within(
            "temperature.warm_up_k",
            self.warm_up_k,
            -1e3,
            1e3,
            "electronics warm up by 1 to 10",
        )?;
        within(
            "temperature.warm_up_s",
            self.warm_up_s,
            1e-3,
            1e7,
            "warming up takes 5 to 60 minutes",
        )?;
        within(
            "temperature.swing_k",
            self.swing_k,
            -1e3,
            1e3,
            "air conditioning swings by 0.1 to 1",
        )?;
        within(
            "temperature.swing_period_s",
            self.swing_period_s,
            1e-3,
            1e8,
            "air conditioning swings in 5 to 60 minutes",
        )?;
        within(
            "temperature.noise_rms_k",
            self.noise_rms_k,
            0.0,
            100.0,
            "sensors have 0.001 to 0.05",
        )?;
        within(
            "temperature.resolution_k",
            self.resolution_k,
            0.0,
            100.0,
            "sensors have 0.001 to 0.1",
        )
    }
}

impl ThermalDrift {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "thermal_drift.position_um_per_k",
            self.position_um_per_k,
            -100.0,
            100.0,
            "0.001 to 1.2 um/K",
        )?;
        within(
            "thermal_drift.gain_percent_per_k",
            self.gain_percent_per_k,
            -20.0,
            20.0,
            "0.05 to 0.5 %/K",
        )?;
        within(
            "thermal_drift.lag_s",
            self.lag_s,
            0.0,
            1e6,
            "stages follow within seconds to an hour",
        )
    }
}

/// The temperature and its effect in motion.
#[derive(Debug, Clone)]
pub(crate) struct ThermalState {
    temperature: Temperature,
    drift: Option<ThermalDrift>,
    phase_rad: f64,
    noise: Pcg64,
    lag: Option<Lag>,
    before_k: f64,
    stage_k: f64,
}

impl ThermalState {
    pub(crate) fn new(temperature: &Temperature, drift: Option<ThermalDrift>, seed: u64) -> Self {
        let mut noise = Pcg64::seed_from_u64(seed);
        let phase_rad = noise.random_range(0.0..std::f64::consts::TAU);
        let lag = drift
            .filter(|drift| drift.lag_s > 0.0)
            .map(|drift| Lag::new(drift.lag_s));
        Self {
            temperature: temperature.clone(),
            drift,
            phase_rad,
            noise,
            lag,
            before_k: 0.0,
            stage_k: 0.0,
        }
    }

    pub(crate) fn set_step(&mut self, step_s: f64) {
        if let Some(lag) = &mut self.lag {
            lag.set_step(step_s);
        }
    }

    fn rise_k(&self, time_s: f64) -> f64 {
        let t = &self.temperature;
        let swing = (std::f64::consts::TAU * time_s / t.swing_period_s + self.phase_rad).sin() - self.phase_rad.sin();
        t.drift_k_per_h * time_s / 3600.0 - t.warm_up_k * (-time_s / t.warm_up_s).exp_m1() + t.swing_k * swing
    }

    /// The stage's own temperature moves on to `time_s`.
    pub(crate) fn advance(&mut self, time_s: f64) {
        if self.drift.is_none() {
            return;
        }
        let now_k = self.rise_k(time_s);
        self.stage_k = match &mut self.lag {
            None => now_k,
            Some(lag) => lag.advance(self.before_k, now_k),
        };
        self.before_k = now_k;
    }

    /// Factor on the stack's displacement.
    #[inline]
    pub(crate) fn gain(&self) -> f64 {
        self.drift
            .map_or(1.0, |drift| 1.0 + 0.01 * drift.gain_percent_per_k * self.stage_k)
    }

    /// Shift of the position.
    #[inline]
    pub(crate) fn shift_um(&self) -> f64 {
        self.drift.map_or(0.0, |drift| drift.position_um_per_k * self.stage_k)
    }

    /// What the temperature sensor records.
    pub(crate) fn read_c(&mut self, time_s: f64) -> f64 {
        let normal: f64 = StandardNormal.sample(&mut self.noise);
        let t = &self.temperature;
        let raw_c = t.start_c + self.rise_k(time_s) + t.noise_rms_k * normal;
        if t.resolution_k > 0.0 {
            (raw_c / t.resolution_k).round() * t.resolution_k
        } else {
            raw_c
        }
    }
}
