//! Captures of an oscilloscope: two monitor outputs, a header, a trigger, 12 bits, noise.

use hysteron_excitation::{Excitation, MultiHarmonic, Sine, Triangle};
use hysteron_plant::{Stage, StageError, preset};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::fmt::Write;

/// Volts at the actuator a volt of the amplifier's monitor.
const AMPLIFIER_V_PER_V: f64 = 10.0;
/// Micrometres a volt of the sensor's monitor.
const SENSOR_UM_PER_V: f64 = 2.0;
/// Full scale of both channels, volts, in 12 bits.
const FULL_SCALE_V: f64 = 4.0;
/// Noise of the sensor's channel, volts rms.
const NOISE_V: f64 = 2e-3;
/// Sample period, seconds.
const PERIOD_S: f64 = 50e-6;
/// Time before the trigger, seconds.
const BEFORE_TRIGGER_S: f64 = 0.02;

/// What was simulated, in words.
pub(super) const TRUTH: &str = "the paper's stage, 2.6 um at 26 V; CH1 is the amplifier's monitor, 1 V for 10 V; CH2 is the \
    sensor's, 1 V for 2 um, with 4 nm of noise";

/// Command and arguments that import the captures of a folder.
pub fn import_command(folder: &str) -> String {
    format!(
        "import {folder}/slow.csv {folder}/fast.csv --validate {folder}/mixed.csv \
         --column 'voltage=CH1:V*{AMPLIFIER_V_PER_V}' --column 'position=CH2:um*{SENSOR_UM_PER_V}' -o stage"
    )
}

/// The files: name and text. `progress` gets the share done.
pub(super) fn captures(seed: u64, progress: &dyn Fn(f64)) -> Result<Vec<(String, String)>, StageError> {
    let triangle = Triangle {
        frequency_hz: 13.0,
        low_v: 0.0,
        high_v: 26.0,
        periods: 4.0,
    };
    let sine = Sine {
        frequency_hz: 170.0,
        low_v: 4.0,
        high_v: 24.0,
        periods: 40.0,
    };
    let mixed = MultiHarmonic {
        frequency_hz: 37.0,
        full_v: 24.0,
        periods: 9.0,
    };
    let plan: [(&str, &dyn Excitation); 3] = [("slow", &triangle), ("fast", &sine), ("mixed", &mixed)];
    let mut files = Vec::new();
    for (number, (name, excitation)) in plan.into_iter().enumerate() {
        let text = capture(excitation, seed.wrapping_add(number as u64))?;
        files.push((format!("{name}.csv"), text));
        progress((number + 1) as f64 / plan.len() as f64);
    }
    Ok(files)
}

fn capture(excitation: &dyn Excitation, seed: u64) -> Result<String, StageError> {
    let command_v = excitation.samples(PERIOD_S)?;
    let mut stage = Stage::new(&preset::paper_rate(), seed)?;
    // One pass unseen: the capture begins in periodic state, as with a generator that runs freely.
    let rise = hysteron_excitation::with_rise(&command_v, BEFORE_TRIGGER_S, PERIOD_S)?;
    stage.run(&rise, PERIOD_S)?;
    let run = stage.run(&command_v, PERIOD_S)?;
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut noise_v = || NOISE_V * standard(&mut rng);
    let step_v = FULL_SCALE_V / 4096.0;
    let to_12_bits = |volts: f64| (volts / step_v).round() * step_v;
    let mut text = format!(
        "Model,DSO-12,\nSample Interval,{PERIOD_S:.3E},s\nRecord Length,{},points\nVertical Units,V,V\nProbe Attenuation,1,1\n,,\n\
         TIME,CH1,CH2\n",
        command_v.len()
    );
    for (k, (command, position)) in command_v.iter().zip(&run.position_um).enumerate() {
        let time_s = k as f64 * PERIOD_S - BEFORE_TRIGGER_S;
        let ch1 = to_12_bits(command / AMPLIFIER_V_PER_V);
        let ch2 = to_12_bits(position / SENSOR_UM_PER_V + noise_v());
        // Writing to a String does not fail.
        let _ = writeln!(text, "{time_s:.5E},{ch1:.5},{ch2:.5}");
    }
    Ok(text)
}

/// A draw of the standard normal distribution.
fn standard(rng: &mut Pcg64) -> f64 {
    StandardNormal.sample(rng)
}
