//! Firmware of one's own around the core: what belongs in the interrupt of a sample clock, and what is built before it starts.
//!
//! `tick` is the whole interrupt: codes in, code out, no allocation, no panic. Here a PC calls it, with a stage of one line.
//! `cargo run --release -p hysteron-core --example own_firmware`
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::codes::{AdcCode, Converter, DacCode};
use hysteron_core::control_law::{ControlLaw, ControlState};
use hysteron_core::envelope::Envelope;
use hysteron_core::error::ParamError;
use hysteron_core::limiter::Limiter;
use hysteron_core::mpi::MpiCoefficients;
use hysteron_core::mrpi::Mrpi;
use hysteron_core::pi_controller::PiController;
use hysteron_core::thresholds::Thresholds;

const RATE_HZ: f32 = 50e3;
const PLAYS: usize = 2;
type Inverse = Mrpi<f32, PLAYS>;

/// Everything that the interrupt needs.
struct Axis {
    law: ControlLaw<f32, Inverse>,
    state: ControlState<f32, PlayState<f32, PLAYS>>,
    adc: Converter<f32>,
    dac: Converter<f32>,
    um_per_v: f32,
}

impl Axis {
    /// The numbers come from a fit with `--direction inverse`; each constructor refuses what makes no sense.
    fn new() -> Result<Self, ParamError> {
        let bank = PlayBank::new(Thresholds::new([0.3, 1.2])?, 0.0, 10.0, RATE_HZ)?;
        let coefficients = MpiCoefficients {
            offset: 0.0,
            cubic: 0.0,
            linear: 12.0,
            weights: [-1.0, -0.8],
        };
        let inverse = Mrpi::new(
            bank,
            coefficients,
            Envelope {
                alpha_s: 1e-5,
                beta_s: 1e-5,
            },
        )?;
        let law = ControlLaw {
            feedforward: inverse,
            feedback: PiController::new(0.0, 2000.0, RATE_HZ)?,
            limiter: Limiter::new(0.0, 120.0, 50e3, RATE_HZ)?,
        };
        let state = law.start(PlayState::virgin(), 0.0);
        Ok(Self {
            law,
            state,
            adc: Converter::new(0.0, 10.0)?,
            dac: Converter::new(0.0, 120.0)?,
            um_per_v: 1.0,
        })
    }

    /// The interrupt of the sample clock.
    #[inline(always)]
    fn tick(&mut self, reference_um: f32, sensor: AdcCode) -> DacCode {
        let measured_um = self.adc.volts(sensor) * self.um_per_v;
        self.dac.code(self.law.step(&mut self.state, reference_um, measured_um))
    }
}

fn main() -> Result<(), ParamError> {
    let mut axis = Axis::new()?;
    let sensor = Converter::new(0.0_f32, 10.0)?;
    let mut position_um = 0.0;
    for tick in 0..=2500_u32 {
        let reference_um = 5.0 * (tick as f32 / 500.0).min(1.0);
        let command = axis.tick(reference_um, AdcCode(sensor.code(position_um).0));
        position_um = f32::from(command.0) / 65_535.0 * 120.0 / 11.0; // the stage: 11 V a micrometre
        if tick % 500 == 0 {
            println!(
                "{:>4.0} ms  reference {reference_um:.3} um  position {position_um:.3} um",
                tick as f32 / 50.0
            );
        }
    }
    Ok(())
}
