//! The control law of the core, and the one in C with the same numbers.

use hysteron_core::bank::PlayBank;
use hysteron_core::codes::{AdcCode, Converter};
use hysteron_core::control_law::{ControlLaw, ControlState};
use hysteron_core::corner_mrpi::CornerMrpi;
use hysteron_core::envelope::Envelope;
use hysteron_core::error::ParamError;
use hysteron_core::limiter::Limiter;
use hysteron_core::model::{AtRest, Hysteresis};
use hysteron_core::mpi::MpiCoefficients;
use hysteron_core::pi_controller::PiController;
use hysteron_core::plays_sum;
use hysteron_core::thresholds::Thresholds;
use hysteron_firmware::table;

/// Plays of the larger bank.
pub const MANY: usize = 100;

/// The core's law between codes.
#[derive(Clone, Copy)]
pub struct RustTick<I: Hysteresis<f32>> {
    law: ControlLaw<f32, I>,
    state: ControlState<f32, I::State>,
    adc: Converter<f32>,
    dac: Converter<f32>,
}

impl<I: Hysteresis<f32>> RustTick<I> {
    #[inline(never)]
    pub extern "C" fn tick(&mut self, code: u16, reference_um: f32) -> u16 {
        let measured_um = self.adc.volts(AdcCode(code));
        self.dac
            .code(self.law.step(&mut self.state, reference_um, measured_um))
            .0
    }

    fn new(inverse: I, plays: I::State) -> Result<Self, ParamError> {
        let parameters = table::parameters()?;
        let law = ControlLaw {
            feedforward: inverse,
            feedback: PiController::new(
                table::PROPORTIONAL_V_PER_UM,
                table::INTEGRAL_V_PER_UM_S,
                table::SAMPLE_RATE_HZ,
            )?,
            limiter: Limiter::new(
                table::OUTPUT_MIN_V,
                table::OUTPUT_MAX_V,
                table::SLEW_V_PER_S,
                table::SAMPLE_RATE_HZ,
            )?,
        };
        let state = law.start(plays, parameters.safe_v);
        Ok(Self {
            law,
            state,
            adc: parameters.adc,
            dac: parameters.dac,
        })
    }
}

/// The table's law, N = 10.
pub fn ten() -> Result<RustTick<table::Inverse>, ParamError> {
    let inverse = table::inverse()?;
    RustTick::new(inverse, inverse.at_rest(table::INPUT_MIN_UM, table::INPUT_MIN_UM))
}

/// A law with many plays: thresholds evenly over the range, the weights' sum that of the table.
pub fn hundred() -> Result<RustTick<CornerMrpi<f32, MANY>>, ParamError> {
    let thresholds = Thresholds::new(many_thresholds())?;
    let bank = PlayBank::new(
        thresholds,
        table::INPUT_MIN_UM,
        table::INPUT_MAX_UM,
        table::SAMPLE_RATE_HZ,
    )?;
    let coefficients = MpiCoefficients {
        offset: table::OFFSET_V,
        cubic: table::CUBIC_V_PER_UM3,
        linear: table::LINEAR_V_PER_UM,
        weights: many_weights(),
    };
    let envelope = Envelope {
        alpha_s: table::ALPHA_S,
        beta_s: table::BETA_S,
    };
    let inverse = CornerMrpi::new(bank, coefficients, envelope)?;
    RustTick::new(inverse, inverse.at_rest(table::INPUT_MIN_UM, table::INPUT_MIN_UM))
}

fn many_thresholds() -> [f32; MANY] {
    core::array::from_fn(|i| i as f32 * ((table::INPUT_MAX_UM - table::INPUT_MIN_UM) / MANY as f32))
}

fn many_weights() -> [f32; MANY] {
    let sum: f32 = table::WEIGHTS_V_PER_UM.iter().sum();
    [sum / MANY as f32; MANY]
}

/// `struct tick` of `c/tick.c`; `B` is two more than `N`.
#[repr(C)]
pub struct CTick<const N: usize, const B: usize> {
    thresholds: [f32; N],
    weights: [f32; N],
    offset: f32,
    cubic: f32,
    linear: f32,
    alpha: f32,
    beta: f32,
    input_min: f32,
    input_max: f32,
    proportional: f32,
    integral_a_sample: f32,
    output_min: f32,
    output_max: f32,
    largest_change: f32,
    usual_change: f32,
    dac_min: f32,
    codes_per_v: f32,
    adc_min: f32,
    um_per_code: f32,
    outputs: [f32; N],
    sums: [f32; B],
    last_input: f32,
    integral: f32,
    last_command: f32,
    asked: f32,
    fault: u32,
}

impl<const N: usize, const B: usize> CTick<N, B> {
    fn new(thresholds: [f32; N], weights: [f32; N]) -> Self {
        const { assert!(B == N + 2, "the offset and 0 lie behind the sums") };
        let largest_change = table::SLEW_V_PER_S / table::SAMPLE_RATE_HZ;
        let outputs = [table::INPUT_MIN_UM; N];
        let mut sums = [0.0; B];
        sums[..N].copy_from_slice(&plays_sum::sums(table::OFFSET_V, &weights, &outputs));
        (sums[N], sums[N + 1]) = plays_sum::behind(N, table::OFFSET_V);
        Self {
            thresholds,
            weights,
            offset: table::OFFSET_V,
            cubic: table::CUBIC_V_PER_UM3,
            linear: table::LINEAR_V_PER_UM,
            alpha: table::ALPHA_S * table::SAMPLE_RATE_HZ,
            beta: table::BETA_S * table::SAMPLE_RATE_HZ,
            input_min: table::INPUT_MIN_UM,
            input_max: table::INPUT_MAX_UM,
            proportional: table::PROPORTIONAL_V_PER_UM,
            integral_a_sample: table::INTEGRAL_V_PER_UM_S / table::SAMPLE_RATE_HZ,
            output_min: table::OUTPUT_MIN_V,
            output_max: table::OUTPUT_MAX_V,
            largest_change,
            // As the core's limiter has it for a range of this size.
            usual_change: largest_change - 2.0 * f32::EPSILON * table::OUTPUT_MAX_V,
            dac_min: table::DAC_MIN_V,
            codes_per_v: 65_535.0 / (table::DAC_TOP_V - table::DAC_MIN_V),
            adc_min: table::ADC_MIN_UM,
            um_per_code: (table::ADC_TOP_UM - table::ADC_MIN_UM) / 65_535.0,
            outputs,
            sums,
            last_input: table::INPUT_MIN_UM,
            integral: 0.0,
            last_command: table::SAFE_V,
            asked: table::SAFE_V,
            fault: 0,
        }
    }
}

/// The table's.
pub type Few = CTick<{ table::PLAYS }, { table::PLAYS + 2 }>;
/// [`hundred`]'s.
pub type Many = CTick<MANY, { MANY + 2 }>;

impl Few {
    pub fn ten() -> Self {
        Self::new(table::THRESHOLDS_UM, table::WEIGHTS_V_PER_UM)
    }
}

impl Many {
    pub fn hundred() -> Self {
        Self::new(many_thresholds(), many_weights())
    }
}

macro_rules! from_c {
    ($($name:ident: $state:ty),*) => {
        mod c {
            // SAFETY: as `tick.c` defines them; they read and write the struct alone.
            unsafe extern "C" {
                $(pub safe fn $name(state: &mut $state, code: u16, reference_um: f32) -> u16;)*
            }
        }
    };
}
from_c!(
    c_10: super::Few, c_10_exact: super::Few, c_10_fast: super::Few, c_10_prefix: super::Few, c_10_prefix_exact: super::Few,
    c_100: super::Many, c_100_prefix: super::Many, c_100_prefix_exact: super::Many
);

type CCall<S> = extern "C" fn(&mut S, u16, f32) -> u16;

/// With their names in the table.
pub const C_10: [(&str, CCall<Few>); 5] = [
    ("c 10", c::c_10),
    ("c-exact 10", c::c_10_exact),
    ("c-fast-math 10", c::c_10_fast),
    ("c-prefix 10", c::c_10_prefix),
    ("c-prefix-exact 10", c::c_10_prefix_exact),
];
pub const C_100: [(&str, CCall<Many>); 3] = [
    ("c 100", c::c_100),
    ("c-prefix 100", c::c_100_prefix),
    ("c-prefix-exact 100", c::c_100_prefix_exact),
];
