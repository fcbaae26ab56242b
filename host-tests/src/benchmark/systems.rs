//! Three systems whose nonlinearity sits inside an oscillator, with records to learn from and records to judge on.

use hysteron_data::{Dataset, Known, Record, Role};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// A system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum System {
    /// Noel and Schoukens (2016): `m y'' + c y' + k y + z = u`, `z' = alpha y' - beta (gamma |y'| |z|^(nu-1) z + delta y' |z|^nu)`.
    BoucWen,
    /// As the Silverbox of Wigren and Schoukens (2013): a mode with a cubic spring.
    Duffing,
    /// A positioning drive on a flexure: Coulomb's friction with Stribeck's bump.
    Friction,
}

/// Records of a system.
#[derive(Debug, Clone)]
pub struct Benchmark {
    /// Train records with role `identify`, test records with role `validate`; the drive in the column of the voltage.
    pub dataset: Dataset,
    /// Noise on the train records, micrometres rms; the test records have none.
    pub noise_um: f64,
}

impl System {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::BoucWen, Self::Duffing, Self::Friction];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::BoucWen => "bouc-wen",
            Self::Duffing => "duffing",
            Self::Friction => "friction",
        }
    }

    /// Sample rate of the records, hertz, and steps of the integration a sample.
    fn rates(self) -> (f64, usize) {
        match self {
            // 15 kHz, every twentieth kept.
            Self::BoucWen => (750.0, 20),
            Self::Duffing => (610.35, 20),
            Self::Friction => (1000.0, 40),
        }
    }

    /// Derivatives of position (metres), speed and, of Bouc and Wen's, the hysteretic force.
    fn slopes(self, x: [f64; 3], u: f64) -> [f64; 3] {
        let [y, v, z] = x;
        match self {
            Self::BoucWen => {
                let (mass, damping, stiffness) = (2.0, 10.0, 5e4);
                let (alpha, beta, gamma, delta) = (5e4, 1e3, 0.8, -1.1);
                // nu = 1.
                let dz = alpha * v - beta * (gamma * v.abs() * z + delta * v * z.abs());
                [v, (u - damping * v - stiffness * y - z) / mass, dz]
            }
            Self::Duffing => {
                // 68 Hz, 5 % of critical damping; the spring doubles at 0.3 mm.
                let omega = TAU * 68.0;
                let cubic = omega * omega / 9e-8;
                [v, u - 0.1 * omega * v - omega * omega * y - cubic * y.powi(3), 0.0]
            }
            Self::Friction => {
                let (mass, damping, stiffness) = (0.5, 60.0, 2e4);
                // 1.2 N when sliding, half as much again at rest, over a smooth sign of 50 um/s.
                let friction = (1.2 + 0.6 * (-(v / 2e-3).powi(2)).exp()) * (v / 5e-5).tanh();
                [v, (u - damping * v - stiffness * y - friction) / mass, 0.0]
            }
        }
    }

    /// The position in micrometres under a force, from rest, by Runge and Kutta's fourth-order rule.
    pub fn respond(self, force: &[f64]) -> Vec<f64> {
        let (rate, fine) = self.rates();
        let h = 1.0 / rate / fine as f64;
        let mut x = [0.0; 3];
        let mut out = Vec::with_capacity(force.len());
        let add = |x: [f64; 3], d: [f64; 3], h: f64| [x[0] + h * d[0], x[1] + h * d[1], x[2] + h * d[2]];
        for (k, &u0) in force.iter().enumerate() {
            out.push(1e6 * x[0]);
            let u1 = force.get(k + 1).copied().unwrap_or(u0);
            for i in 0..fine {
                let at = |part: f64| u0 + (u1 - u0) * (i as f64 + part) / fine as f64;
                let a = self.slopes(x, at(0.0));
                let b = self.slopes(add(x, a, 0.5 * h), at(0.5));
                let c = self.slopes(add(x, b, 0.5 * h), at(0.5));
                let d = self.slopes(add(x, c, h), at(1.0));
                for (n, value) in x.iter_mut().enumerate() {
                    *value += h / 6.0 * (a[n] + 2.0 * b[n] + 2.0 * c[n] + d[n]);
                }
            }
        }
        out
    }

    /// The records of a seed.
    pub fn benchmark(self, seed: u64) -> Benchmark {
        let mut rng = Pcg64::seed_from_u64(seed);
        let (rate, _) = self.rates();
        let period_s = 1.0 / rate;
        // Band of the drive in hertz, its rms, noise in micrometres.
        let (band, rms, noise_um) = match self {
            Self::BoucWen => ([5.0, 150.0], 50.0, 8.0),
            Self::Duffing => ([1.0, 200.0], 6.0, 0.05),
            Self::Friction => ([0.5, 60.0], 3.0, 0.1),
        };
        let mut records = Vec::new();
        let rest = (REST_S * rate) as usize;
        let mut add = |file: &str, role: Role, played: Vec<f64>, rng: &mut Pcg64| {
            let force = [vec![0.0; rest], played].concat();
            let mut position_um = self.respond(&force);
            if role == Role::Identify {
                position_um.iter_mut().for_each(|y| *y += noise_um * gaussian(rng));
            }
            records.push(Record {
                file: format!("{file}.csv"),
                role,
                excitation: file.to_owned(),
                start_s: 0.0,
                period_s,
                voltage_v: force,
                position_um,
                reference_um: None,
                temperature_c: None,
                voltage2_v: None,
            });
        };
        for n in 0..4 {
            let force = multisine(8192, 8192, rate, band, rms, &mut rng);
            add(&format!("train-multisine-{n}"), Role::Identify, force, &mut rng);
        }
        let force = multisine(8192, 8192, rate, band, rms, &mut rng);
        add("test-multisine", Role::Validate, force, &mut rng);
        let second = match self {
            // From 20 to 50 Hz, 40 N, as the benchmark's second test, three times as fast.
            Self::BoucWen => sweep(45_000, rate, [20.0, 50.0], 40.0),
            // Noise whose size grows, as the Silverbox' arrow.
            Self::Duffing => {
                let grow = |(k, u): (usize, f64)| 1.2 * u * k as f64 / 40_000.0;
                multisine(40_000, 40_000, rate, band, rms, &mut rng)
                    .into_iter()
                    .enumerate()
                    .map(grow)
                    .collect()
            }
            Self::Friction => sweep(20_000, rate, [0.5, 20.0], 3.5),
        };
        add("test-other", Role::Validate, second, &mut rng);
        Benchmark {
            dataset: Dataset {
                name: self.name().to_owned(),
                description: "force in newtons in the voltage's column".to_owned(),
                // The test records have none: a rest of theirs would tell a sensor without noise.
                known: Known {
                    sensor_noise_um: Some(noise_um),
                    ..Known::default()
                },
                records,
                notices: Vec::new(),
            },
            noise_um,
        }
    }
}

/// Every record begins at rest, without a force.
const REST_S: f64 = 0.2;

/// Odd and even lines of a band with phases by chance; rms as wanted.
fn multisine(n: usize, repeat: usize, rate: f64, band: [f64; 2], rms: f64, rng: &mut Pcg64) -> Vec<f64> {
    let step = rate / repeat as f64;
    // At most 300 lines: more tell nothing more, and take long to sum.
    let count = ((band[1] - band[0]) / step).floor().min(300.0) as usize;
    let lines: Vec<[f64; 2]> = (0..count)
        .map(|k| {
            let hz = band[0] + (band[1] - band[0]) * k as f64 / count as f64;
            [(hz / step).round() * step, rng.random_range(0.0..TAU)]
        })
        .collect();
    let size = rms * (2.0 / count as f64).sqrt();
    (0..n)
        .map(|k| {
            size * lines
                .iter()
                .map(|[hz, phase]| (TAU * hz * k as f64 / rate + phase).sin())
                .sum::<f64>()
        })
        .collect()
}

/// A sine whose frequency rises evenly.
fn sweep(n: usize, rate: f64, band: [f64; 2], amplitude: f64) -> Vec<f64> {
    let length_s = n as f64 / rate;
    let phase = |t: f64| TAU * (band[0] * t + 0.5 * (band[1] - band[0]) * t * t / length_s);
    (0..n).map(|k| amplitude * phase(k as f64 / rate).sin()).collect()
}

fn gaussian(rng: &mut Pcg64) -> f64 {
    let (a, b): (f64, f64) = (rng.random_range(f64::MIN_POSITIVE..1.0), rng.random_range(0.0..1.0));
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Far below the mode a small force moves by force over stiffness: Bouc and Wen's by 1 / (k + alpha).
    #[test]
    fn val_small_forces_move_by_the_stiffness() {
        let slow = |system: System, force: f64| {
            let rise = |k: usize| force * (k as f64 / 6000.0).min(1.0);
            let out = system.respond(&(0..8000).map(rise).collect::<Vec<_>>());
            out[7999]
        };
        let bouc_wen = slow(System::BoucWen, 0.1);
        assert!((bouc_wen - 1e6 * 0.1 / 1e5).abs() < 0.01, "{bouc_wen}");
        let duffing = slow(System::Duffing, 0.5);
        assert!((duffing - 1e6 * 0.5 / (TAU * 68.0).powi(2)).abs() < 0.01, "{duffing}");
    }

    /// Friction holds a small force nearly at rest, and leaves an offset behind a large one.
    #[test]
    fn val_friction_leaves_an_offset() {
        let there_and_back = |k: usize| 6.0 * (1.0 - ((k as f64 - 2000.0) / 2000.0).abs()).max(0.0);
        let out = System::Friction.respond(&(0..4400).map(there_and_back).collect::<Vec<_>>());
        assert!(out[4000] > 5.0, "{}", out[4000]);
    }

    /// The rms is as wanted, the lines are whole numbers of periods, and the seed decides the phases.
    #[test]
    fn prop_multisines_are_of_their_rms() {
        let of = |seed| multisine(2048, 1024, 500.0, [5.0, 60.0], 3.0, &mut Pcg64::seed_from_u64(seed));
        let force = of(1);
        let rms = (force.iter().map(|u| u * u).sum::<f64>() / 2048.0).sqrt();
        assert!((rms - 3.0).abs() < 1e-6, "{rms}");
        assert!(
            force[..1024]
                .iter()
                .zip(&force[1024..])
                .all(|(a, b)| (a - b).abs() < 1e-8)
        );
        assert_eq!(force, of(1));
        assert_ne!(force, of(2));
    }
}
