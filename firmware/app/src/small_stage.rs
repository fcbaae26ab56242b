//! A stage in a few lines, of the same arithmetic wherever it is compiled: in the guest beside the controller, or in a process of the
//! host behind the exchange of codes. What both give must agree in every bit, or the exchange changes something.
//!
//! It is no model of anybody's stage; `hysteron-plant` has those.

use crate::law::Law;
use crate::parameters::Parameters;
use crate::wire::{Input, Order};
use hysteron_core::codes::{AdcCode, Converter, DacCode};

/// Share of the range by which the platform hangs back, either way.
const SLACK_SHARE: f32 = 0.03;
/// Share of the way to its target that the platform goes in a sample: a lag of 1.4 samples.
const SAMPLE_SHARE: f32 = 0.5;
/// Largest noise, codes.
const NOISE_CODES: f32 = 2.0;
/// Ticks from the stop to the end: the ramp over the whole range takes 1000 (20 ms at 50 kHz).
const FALL_TICKS: u32 = 1100;

/// Straight line with slack, lag and noise.
#[derive(Debug, Clone, PartialEq)]
pub struct SmallStage {
    dac: Converter<f32>,
    adc: Converter<f32>,
    um_per_v: f32,
    slack_um: f32,
    noise_um: f32,
    hanging_um: f32,
    position_um: f32,
    seed: u32,
}

impl SmallStage {
    /// At rest at 0 V; as steep as the mean of the table's inverse.
    pub fn new<L: Law>(parameters: &Parameters<L>, seed: u32) -> Self {
        let scales = &parameters.scales;
        Self {
            dac: parameters.dac,
            adc: parameters.adc,
            um_per_v: scales.range_um / scales.span_v,
            slack_um: SLACK_SHARE * scales.range_um,
            noise_um: NOISE_CODES * scales.um_per_code,
            hanging_um: 0.0,
            position_um: 0.0,
            // The generator stays at 0.
            seed: seed | 1,
        }
    }

    /// The code and the order of a tick: starts with the first, stops in time to end at the safe level.
    pub fn input(&mut self, number: u32, ticks: u32) -> Input {
        // Marsaglia's xorshift (J. Stat. Softw. 8 (2003) 14); 24 bits are exact in f32.
        self.seed ^= self.seed << 13;
        self.seed ^= self.seed >> 17;
        self.seed ^= self.seed << 5;
        let noise = (self.seed >> 8) as f32 * (2.0 / 16_777_216.0) - 1.0;
        let DacCode(adc) = self.adc.code(self.position_um + self.noise_um * noise);
        let order = match number {
            0 => Order::Start,
            n if n == ticks.saturating_sub(FALL_TICKS) => Order::Stop,
            _ => Order::None,
        };
        Input { adc, order }
    }

    /// Takes the code of a tick.
    pub fn output(&mut self, code: u16) {
        let wanted_um = self.um_per_v * self.dac.volts(AdcCode(code));
        let (low_um, high_um) = (wanted_um - self.slack_um, wanted_um + self.slack_um);
        if self.hanging_um < low_um {
            self.hanging_um = low_um;
        } else if self.hanging_um > high_um {
            self.hanging_um = high_um;
        }
        self.position_um += SAMPLE_SHARE * (self.hanging_um - self.position_um);
    }
}
