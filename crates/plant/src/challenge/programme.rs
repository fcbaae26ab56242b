//! The fifteen records of a user who knows the trade: sines from 1 to 500 Hz at two amplitudes, a complex harmonic, minor loops, steps, a multisine, noise, rest.

use rand::RngExt;
use rand_pcg::Pcg64;

use super::case::Use;
use super::laboratory::Laboratory;
use crate::error::StageError;
use hysteron_excitation::{BandNoise, DecayingTriangle, Excitation, MultiHarmonic, Multisine, Sine, with_rise};

/// One record before it is taken.
#[derive(Debug, Clone)]
pub(super) struct Planned {
    pub(super) name: String,
    pub(super) role: Use,
    pub(super) excitation: String,
    pub(super) period_s: f64,
    pub(super) voltage_v: Vec<f64>,
    pub(super) voltage2_v: Option<Vec<f64>>,
    /// Rest at 0 V before it, seconds.
    pub(super) rest_s: f64,
}

/// Frequencies, amplitudes, lengths: drawn from the seed, within what the trade does.
pub(super) fn plan(laboratory: &Laboratory, rng: &mut Pcg64) -> Result<Vec<Planned>, StageError> {
    let mut plan = Plan {
        full_v: laboratory.full_v,
        records: Vec::with_capacity(15),
    };
    // Round frequencies, or ones that keep clear of the line's harmonics.
    let hz = if rng.random_bool(0.5) {
        [10.0, 50.0, 100.0, 200.0, 500.0]
    } else {
        [11.0, 47.0, 97.0, 193.0, 503.0]
    };
    plan.sine(Use::Identify, 1.0, 1.0, 4, 1e-3)?;
    plan.sine(Use::Identify, hz[0], 1.0, 6, 2e-4)?;
    plan.sine(Use::Identify, hz[0], rng.random_range(0.30..0.50), 5, 2e-4)?;
    plan.sine(Use::Validate, hz[1], 1.0, 8, 1e-4)?;
    plan.sine(Use::Identify, hz[2], 1.0, 10, 5e-5)?;
    plan.sine(Use::Validate, hz[2], rng.random_range(0.30..0.50), 10, 5e-5)?;
    plan.sine(Use::Validate, hz[3], 1.0, 12, 2e-5)?;
    plan.sine(Use::Identify, hz[4], 1.0, 25, 2e-5)?;
    plan.multi_harmonic(hz[0] * f64::from(rng.random_range(1..=2)))?;
    plan.triangle(rng)?;
    plan.holds(rng);
    plan.multisine(rng)?;
    plan.noise(rng)?;
    plan.add("quiet", Use::Identify, "constant 0 V".to_owned(), 2e-4, vec![0.0; 5000]);
    let pause_s = [20.0, 60.0][rng.random_range(0..2_usize)];
    for record in &mut plan.records {
        record.rest_s = pause_s * rng.random_range(0.7..1.5);
        // Commands come in steps of 0.1 mV.
        record.voltage_v.iter_mut().for_each(|v| *v = (*v * 1e4).round() / 1e4);
        let other = other_axis(record, laboratory.full_v, rng);
        record.voltage2_v = laboratory.has_other_axis.then_some(other);
    }
    Ok(plan.records)
}

struct Plan {
    full_v: f64,
    records: Vec<Planned>,
}

impl Plan {
    fn add(&mut self, name: &str, role: Use, excitation: String, period_s: f64, voltage_v: Vec<f64>) {
        let name = name.to_owned();
        self.records.push(Planned {
            name,
            role,
            excitation,
            period_s,
            voltage_v,
            voltage2_v: None,
            rest_s: 0.0,
        });
    }

    fn sine(&mut self, role: Use, hz: f64, share: f64, periods: u32, period_s: f64) -> Result<(), StageError> {
        let sine = Sine {
            frequency_hz: hz,
            low_v: 0.0,
            high_v: share * self.full_v,
            periods: f64::from(periods),
        };
        let percent = (100.0 * share).round();
        let suffix = if share < 1.0 {
            format!("-a{percent}")
        } else {
            String::new()
        };
        let words = format!("sine {hz} Hz, 0 to {percent} % of full voltage, {periods} periods");
        self.add(
            &format!("sine-{hz:03}hz{suffix}"),
            role,
            words,
            period_s,
            sine.samples(period_s)?,
        );
        Ok(())
    }

    fn multi_harmonic(&mut self, frequency_hz: f64) -> Result<(), StageError> {
        let harmonic = MultiHarmonic {
            frequency_hz,
            full_v: self.full_v,
            periods: (frequency_hz / 2.0).round(),
        };
        let words = format!("0.25 sin x + 0.3 sin 3x + 0.5, {frequency_hz} Hz, after a 20 ms rise");
        let voltage_v = with_rise(&harmonic.samples(1e-4)?, 0.02, 1e-4)?;
        self.add("multiharmonic", Use::Validate, words, 1e-4, voltage_v);
        Ok(())
    }

    fn triangle(&mut self, rng: &mut Pcg64) -> Result<(), StageError> {
        let (decay, turns): (f64, i32) = (rng.random_range(0.84..0.92), 24);
        // At decay / (1 + decay) the second turning point is at 0 V; below it would be negative.
        let centre = rng.random_range(decay / (1.0 + decay)..0.60);
        // Full voltage first, then legs of d (1 + q), d (1 + q) q, ...: three seconds in all.
        let legs: f64 = (0..turns - 1)
            .map(|k| (1.0 - centre) * (1.0 + decay) * decay.powi(k))
            .sum();
        let triangle = DecayingTriangle {
            high_v: self.full_v,
            centre_v: centre * self.full_v,
            decay,
            turns: turns as u32,
            slope_v_per_s: self.full_v * (1.0 + legs) / 3.0,
        };
        let words = "decaying triangle, constant slope, minor loops".to_owned();
        self.add("triangle-decay", Use::Identify, words, 5e-4, triangle.samples(5e-4)?);
        Ok(())
    }

    fn holds(&mut self, rng: &mut Pcg64) {
        let (hold_s, hold2_s) = (rng.random_range(10.0..16.0), rng.random_range(18.0..28.0));
        let levels = [
            rng.random_range(0.45..0.75),
            rng.random_range(0.80..1.0),
            rng.random_range(0.20..0.40),
        ];
        let words = format!("steps of 30 ms and holds of {hold_s:.1} s");
        let voltage_v = held(self.full_v, &levels, hold_s);
        self.add("step-hold", Use::Identify, words, HOLD_PERIOD_S, voltage_v);
        let words = format!("one 30 ms step, hold {hold2_s:.1} s");
        let voltage_v = held(self.full_v, &[rng.random_range(0.50..0.90)], hold2_s);
        self.add("step-hold-2", Use::Validate, words, HOLD_PERIOD_S, voltage_v);
    }

    fn multisine(&mut self, rng: &mut Pcg64) -> Result<(), StageError> {
        let high_hz = [1500.0, 4000.0][rng.random_range(0..2_usize)];
        let multisine = Multisine {
            low_hz: 20.0,
            high_hz,
            period_s: 0.05,
            periods: 6,
            bias_v: rng.random_range(0.40..0.60) * self.full_v,
            peak_v: rng.random_range(0.08..0.25) * self.full_v,
            seed: rng.random(),
        };
        let words = format!("multisine 20 Hz to {high_hz} Hz, period 50 ms, after a 30 ms rise");
        self.add(
            "multisine",
            Use::Identify,
            words,
            5e-5,
            with_rise(&multisine.samples(5e-5)?, 0.03, 5e-5)?,
        );
        Ok(())
    }

    fn noise(&mut self, rng: &mut Pcg64) -> Result<(), StageError> {
        let noise = BandNoise {
            bandwidth_hz: 400.0,
            duration_s: 0.57,
            rms_v: rng.random_range(0.10..0.18) * self.full_v,
            low_v: 0.02 * self.full_v,
            high_v: 0.98 * self.full_v,
            seed: rng.random(),
        };
        let words = "band-limited random to 400 Hz, not periodic in the record, after a 30 ms rise".to_owned();
        self.add(
            "noise-400hz",
            Use::Validate,
            words,
            1e-4,
            with_rise(&noise.samples(1e-4)?, 0.03, 1e-4)?,
        );
        Ok(())
    }
}

const HOLD_PERIOD_S: f64 = 5e-3;

/// A quarter of a second at 0 V, then levels (shares of the full voltage) reached within 30 ms along half a cosine and held.
fn held(full_v: f64, levels: &[f64], hold_s: f64) -> Vec<f64> {
    const RISE_S: f64 = 0.03;
    let mut voltage_v = vec![0.0; (0.25 / HOLD_PERIOD_S) as usize];
    let mut from = 0.0;
    for &to in levels {
        for n in 1..=((RISE_S + hold_s) / HOLD_PERIOD_S) as usize {
            let part = (n as f64 * HOLD_PERIOD_S / RISE_S).min(1.0);
            voltage_v.push(full_v * (from + (to - from) * 0.5 * (1.0 - (std::f64::consts::PI * part).cos())));
        }
        from = to;
    }
    voltage_v
}

/// What the other axis does meanwhile: whole cycles of its own, from rest to rest, in no simple ratio to the record.
fn other_axis(record: &Planned, full_v: f64, rng: &mut Pcg64) -> Vec<f64> {
    let samples = record.voltage_v.len();
    let share = if rng.random_bool(0.15) {
        0.0
    } else {
        rng.random_range(0.3..1.0)
    };
    // Odd primes share no factor with the 4 to 25 periods of the sines but 5, which is left out.
    let cycles = [7.0, 11.0, 13.0, 17.0, 19.0, 23.0][rng.random_range(0..6_usize)];
    let (slower, depth) = ([2.0, 3.0][rng.random_range(0..2_usize)], rng.random_range(0.2..0.5));
    let value = |n: usize| {
        let turn = std::f64::consts::TAU * n as f64 / (samples - 1).max(1) as f64;
        let wave = 0.5 * (1.0 - (cycles * turn).cos());
        let envelope = 1.0 - depth * 0.5 * (1.0 - (slower * turn).cos());
        (share * full_v * wave * envelope * 1e4).round() / 1e4
    };
    (0..samples).map(value).collect()
}
