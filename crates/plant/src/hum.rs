//! Mains hum: the amplifier's ripple and ground loops move the stage at the line frequency and its harmonics.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::error::{StageError, within};

/// Hum, `sum_k a_k sin(2 pi k f t + phi_k)`, phases drawn from the seed.
#[derive(Debug, Clone, PartialEq)]
pub struct MainsHum {
    /// Line frequency, hertz: 50 or 60, off by up to 0.1.
    pub frequency_hz: f64,
    /// Amplitudes of the first, second, ... harmonic, micrometres.
    pub amplitudes_um: Vec<f64>,
}

impl MainsHum {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "mains_hum.frequency_hz",
            self.frequency_hz,
            1.0,
            1e3,
            "lines run at 50 or 60 Hz",
        )?;
        for (k, &amplitude_um) in self.amplitudes_um.iter().enumerate() {
            let name = format!("mains_hum.amplitudes_um[{k}]");
            within(&name, amplitude_um, 0.0, 1e3, "hum is 1e-4 to 0.1 um")?;
        }
        Ok(())
    }
}

/// The hum with its phases.
#[derive(Debug, Clone)]
pub(crate) struct HumState {
    lines: Vec<Line>,
}

#[derive(Debug, Clone, Copy)]
struct Line {
    omega_rad_per_s: f64,
    amplitude_um: f64,
    phase_rad: f64,
}

impl HumState {
    pub(crate) fn new(config: &MainsHum, seed: u64) -> Self {
        let mut rng = Pcg64::seed_from_u64(seed);
        let lines = config
            .amplitudes_um
            .iter()
            .enumerate()
            .map(|(k, &amplitude_um)| Line {
                omega_rad_per_s: std::f64::consts::TAU * config.frequency_hz * (k + 1) as f64,
                amplitude_um,
                phase_rad: rng.random_range(0.0..std::f64::consts::TAU),
            })
            .collect();
        Self { lines }
    }

    pub(crate) fn at(&self, time_s: f64) -> f64 {
        self.lines
            .iter()
            .map(|line| line.amplitude_um * (line.omega_rad_per_s * time_s + line.phase_rad).sin())
            .sum()
    }
}
