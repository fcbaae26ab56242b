//! A loop of one's own on a PC: a direct inverse alone, then with feedback, against a play that the inverse knows only roughly.
//!
//! `cargo run --release -p hysteron-core --example own_loop`
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::control_law::ControlLaw;
use hysteron_core::error::ParamError;
use hysteron_core::limiter::Limiter;
use hysteron_core::mpi::{Mpi, MpiCoefficients};
use hysteron_core::pi_controller::PiController;
use hysteron_core::play::two_sided;
use hysteron_core::thresholds::Thresholds;

const RATE_HZ: f64 = 10e3;

/// Rms error over the last of five periods of a 10 Hz sine, micrometres.
fn run(feedback: PiController<f64>) -> Result<f64, ParamError> {
    let bank = PlayBank::new(Thresholds::new([0.45])?, -1.0, 11.0, RATE_HZ)?;
    let coefficients = MpiCoefficients {
        offset: 0.0,
        cubic: 0.0,
        linear: 12.0,
        weights: [-2.0],
    };
    let law = ControlLaw {
        feedforward: Mpi::new(bank, coefficients)?,
        feedback,
        limiter: Limiter::new(-10.0, 130.0, 1e6, RATE_HZ)?,
    };
    let mut state = law.start(PlayState::virgin(), 0.0);
    let (mut play_v, mut position_um, mut squares) = (0.0, 0.0, 0.0);
    let period = (RATE_HZ / 10.0) as u32;
    for k in 0..5 * period {
        let reference_um = 5.0 - 5.0 * (std::f64::consts::TAU * f64::from(k) / f64::from(period)).cos();
        let command_v = law.step(&mut state, reference_um, position_um);
        // The stage: 0.08 um/V, and a play of 5 V that adds 0.02 um/V.
        play_v = two_sided(command_v, play_v, 5.0);
        position_um = 0.08 * command_v + 0.02 * play_v;
        if k >= 4 * period {
            squares += (reference_um - position_um).powi(2);
        }
    }
    Ok((squares / f64::from(period)).sqrt())
}

fn main() -> Result<(), ParamError> {
    let open_um = run(PiController::none())?;
    let closed_um = run(PiController::new(0.0, 3000.0, RATE_HZ)?)?;
    println!("inverse alone        {open_um:.4} um rms");
    println!("inverse and feedback {closed_um:.4} um rms");
    Ok(())
}
