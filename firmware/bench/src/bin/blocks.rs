//! Instructions of the complete law, block by block and as a whole, counted in QEMU; every effect in it.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use counting::{Console, measure};
use hysteron_core::biquad::{Biquad, BiquadState};
use hysteron_core::codes::{AdcCode, Converter};
use hysteron_core::corner_polynomial::CornerPolynomial;
use hysteron_core::corners::CornerState;
use hysteron_core::effects::Block as _;
use hysteron_core::effects::coupling::{Coupling, CouplingState};
use hysteron_core::effects::creep::{CreepInverse, CreepInverseState};
use hysteron_core::effects::hum_canceller::{HumCanceller, HumCancellerState};
use hysteron_core::effects::lag::{HeldLagInverse, Lag, LagState};
use hysteron_core::error::ParamError;
use hysteron_core::law_numbers::{HumNumbers, LawNumbers};
use hysteron_core::limiter::{Limiter, LimiterState};
use hysteron_core::model::{AtRest as _, Hysteresis as _};
use hysteron_core::preview::{Preview, PreviewState};
use hysteron_core::surroundings::{CompleteLaw, CompleteState, HARMONICS, LoopInput, SensorInverse};
use hysteron_core::tracking_law::{CREEP_FAST, CREEP_SLOW, Feedback, FeedbackState, PLAYS, TAPS};
use hysteron_firmware::table;
use mps2::semihosting;

/// The table's law, with the effects that its stage does not have: sizes as of a stage that does.
const EVERYTHING: LawNumbers = LawNumbers {
    coupling: Some([0.0005, -1e-8, 0.0001, 10.0]),
    cross_um_per_um: Some(0.01),
    hum: Some(HumNumbers {
        frequency_hz: 50.0,
        sensitivity: [[1.0, 0.1], [0.9, 0.1], [0.8, 0.2], [0.7, 0.2], [0.6, 0.3]],
        learning_s: 0.3,
        largest_um: 0.1,
    }),
    sensor: Some([8.0, 1e-3, 1e-5]),
    sensor_lag_s: 20e-6,
    ..table::NUMBERS
};

/// The table's law as one of two axes.
const DESIGNED: LawNumbers = LawNumbers {
    cross_um_per_um: Some(0.01),
    ..table::NUMBERS
};

/// A law, a state of it, and the converters.
#[derive(Clone, Copy)]
struct Axis {
    law: CompleteLaw<f32>,
    state: CompleteState<f32>,
    adc: Converter<f32>,
    dac: Converter<f32>,
    /// Command of the other axis.
    other_v: f32,
}

impl Axis {
    fn new(numbers: &LawNumbers) -> Result<Self, ParamError> {
        let law = numbers.law()?;
        let parameters = table::parameters()?;
        Ok(Self {
            law,
            state: law.rest(0.0),
            adc: parameters.adc,
            dac: parameters.dac,
            other_v: 0.0,
        })
    }

    /// Two of them in a tick, each beside the command of the other.
    #[inline(never)]
    extern "C" fn both(axes: &mut [Self; 2], code: u16, reference_um: f32) -> u16 {
        let [x, y] = axes;
        let (of_x, of_y) = (x.tick(code, reference_um), y.tick(code ^ 1, reference_um));
        core::mem::swap(&mut x.other_v, &mut y.other_v);
        of_x ^ of_y
    }

    /// As the application calls it.
    #[inline(never)]
    extern "C" fn tick(&mut self, code: u16, reference_um: f32) -> u16 {
        let input = LoopInput {
            reference_ahead: reference_um,
            measured: self.adc.volts(AdcCode(code)),
            voltage2_ahead: self.other_v,
            motion2_ahead: reference_um,
            temperature_c: 0.0,
        };
        let command_v = self.law.step(&mut self.state, input);
        self.other_v = command_v;
        self.dac.code(command_v).0
    }
}

/// A state of the generated C, of unknown fields.
#[derive(Clone, Copy)]
#[repr(C, align(8))]
struct Generated([u32; GENERATED_WORDS]);

/// Words that a state of the generated C may have.
const GENERATED_WORDS: usize = 2048;

/// A law that `export --format c` made of the table: its state at rest, and its tick.
macro_rules! generated {
    ($($name:ident: $sizes:ident, $begin:ident, $tick:ident;)*) => {
        mod generated {
            // SAFETY: as `law_tick.c` defines them; they read and write the state alone.
            unsafe extern "C" {
                $(
                    safe static $sizes: [u32; 2];
                    safe fn $begin(state: &mut super::Generated);
                    pub safe fn $tick(state: &mut super::Generated, code: u16, reference_um: f32) -> u16;
                )*
            }

            $(
                /// At rest; `None` where a state is larger than what is kept for it.
                pub fn $name() -> Option<super::Generated> {
                    let [bytes, alignment] = $sizes;
                    let fits = bytes as usize <= size_of::<super::Generated>()
                        && alignment as usize <= align_of::<super::Generated>();
                    let mut state = super::Generated([0; super::GENERATED_WORDS]);
                    fits.then(|| $begin(&mut state))?;
                    Some(state)
                }
            )*
        }
    };
}
generated! {
    exact: law_exact_sizes, law_exact_begin, law_exact_tick;
    fused: law_fused_sizes, law_fused_begin, law_fused_tick;
}

/// A block and what it remembers.
#[derive(Clone, Copy)]
struct Part<B, M> {
    block: B,
    memory: M,
}

/// What stands for the result of a block.
fn digest(value: f32) -> u16 {
    (value.to_bits() >> 8) as u16
}

/// One function a block: what it takes of a tick's code and reference, and what it gives.
macro_rules! parts {
    ($($name:ident($block:ty, $memory:ty), |$b:ident, $m:ident, $code:ident, $reference:ident| $result:expr;)*) => {$(
        #[inline(never)]
        extern "C" fn $name(part: &mut Part<$block, $memory>, $code: u16, $reference: f32) -> u16 {
            let Part { block: $b, memory: $m } = part;
            $result
        }
    )*};
}

type Converters = [Converter<f32>; 2];

/// The error that feedback and hum get: the order of magnitude is enough, they have no branches on it but for their limits.
fn error_um(code: u16, reference_um: f32) -> f32 {
    reference_um - code as f32 * 1e-3
}

parts! {
    preview(Preview<f32, TAPS>, PreviewState<f32, TAPS>), |b, m, _code, reference| digest(b.step(m, reference));
    second_mode(Biquad<f32>, BiquadState<f32>), |b, m, _code, reference| digest(b.step(m, reference));
    creep(CreepInverse<f32, CREEP_FAST, CREEP_SLOW>, CreepInverseState<f32, CREEP_FAST, CREEP_SLOW>),
        |b, m, _code, reference| digest(b.step(m, reference));
    hysteresis(CornerPolynomial<f32, PLAYS>, CornerState<f32, PLAYS>), |b, m, _code, reference| digest(b.step(m, reference));
    lead(HeldLagInverse<f32>, f32), |b, m, _code, reference| digest(b.step(m, reference));
    coupling(Coupling<f32>, CouplingState<f32>), |b, m, code, _reference| digest(b.step(m, code as f32 * 1e-3));
    hum(HumCanceller<f32, HARMONICS>, HumCancellerState<f32, HARMONICS>), |b, m, code, reference| {
        let predicted = m.predicted();
        b.learn(m, error_um(code, reference));
        digest(predicted)
    };
    sensor(SensorInverse<f32>, ()), |b, _m, _code, reference| digest(b.position(reference));
    sensor_lag(Lag<f32>, LagState<f32>), |b, m, _code, reference| digest(b.step(m, reference));
    feedback(Feedback<f32>, FeedbackState<f32>), |b, m, code, reference| {
        let asked = b.ask(m, error_um(code, reference));
        b.take(m, asked, 0.0);
        digest(asked.output)
    };
    limiter(Limiter<f32>, LimiterState<f32>), |b, m, code, _reference| digest(b.step(m, code as f32 * 1e-3));
    codes(Converters, ()), |b, _m, code, _reference| b[1].code(b[0].volts(AdcCode(code))).0;
}

/// Measures every block, then the law of one axis and of both.
fn all(console: &mut Console) -> Result<(), ParamError> {
    let (axis, designed) = (Axis::new(&EVERYTHING)?, Axis::new(&DESIGNED)?);
    let law = &axis.law;
    let forward = &law.tracking.feedforward;
    let around = &law.surroundings;
    macro_rules! measured {
        ($name:literal, $part:ident, $block:expr, $memory:expr) => {
            let part = Part {
                block: $block,
                memory: $memory,
            };
            measure(console, $name, $part, || part);
        };
    }
    measured!("preview 1", preview, forward.preview, forward.preview.rest_at(0.0));
    measured!(
        "second-mode 1",
        second_mode,
        forward.second_mode,
        BiquadState::default()
    );
    measured!("creep 1", creep, forward.creep, forward.creep.rest_at(0.0));
    measured!(
        "hysteresis 1",
        hysteresis,
        forward.hysteresis,
        forward.hysteresis.at_rest(0.0, 0.0)
    );
    measured!("lead 1", lead, forward.lead, 0.0);
    if let Some(block) = around.coupling {
        measured!("coupling 1", coupling, block, block.rest_at(0.0));
    }
    if let Some(block) = around.hum {
        measured!("hum 1", hum, block, block.start());
    }
    if let Some(block) = around.sensor {
        measured!("sensor-curve 1", sensor, block, ());
    }
    if let Some(block) = around.sensor_lag {
        measured!("sensor-lag 1", sensor_lag, block, block.rest_at(0.0));
    }
    if let Some(block) = law.tracking.feedback {
        measured!("feedback 1", feedback, block, FeedbackState::default());
    }
    let limits = law.tracking.limiter;
    measured!("limiter 1", limiter, limits, limits.start_at(0.0));
    measured!("codes 1", codes, [axis.adc, axis.dac], ());
    measure(console, "one-axis 1", Axis::tick, || axis);
    measure(console, "both-axes 2", Axis::both, || [axis; 2]);
    let alone = Axis::new(&table::NUMBERS)?;
    measure(console, "table-axis 1", Axis::tick, || alone);
    if let (Some(exact), Some(fused)) = (generated::exact(), generated::fused()) {
        measure(console, "c-exact-axis 1", generated::law_exact_tick, || exact);
        measure(console, "c-axis 1", generated::law_fused_tick, || fused);
    }
    measure(console, "designed-axis 1", Axis::tick, || designed);
    measure(console, "designed-axes 2", Axis::both, || [designed; 2]);
    Ok(())
}

#[entry]
fn main() -> ! {
    let mut console = Console::open();
    let done = all(&mut console).is_ok();
    semihosting::exit(done);
}
