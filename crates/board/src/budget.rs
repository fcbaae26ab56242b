//! Cycles, latency and headroom of the loop on real boards, computed from data sheets and from instructions counted in the emulator.
//!
//! Nothing here was measured on a board: `docs/boards/` says how to.

use hysteron_converters::ad5683r::WORD_BITS;
use hysteron_firmware::chips::{self, Chip};
use hysteron_firmware::telemetry::About;

/// One board's figures, each with its source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// The board.
    pub board: &'static str,
    /// Processor clock, hertz.
    pub clock_hz: f64,
    /// Clock of the ADC, hertz.
    pub adc_hz: f64,
    /// Cycles of the ADC's clock in which it samples.
    pub sampling_cycles: f64,
    /// Cycles from the end of sampling to the code.
    pub conversion_cycles: f64,
    /// Clock of the DAC's bus, hertz.
    pub bus_hz: f64,
    /// Instructions of a tick at worst: laws, references, monitors, counted by QEMU, rounded up; without the tick that starts.
    pub tick_instructions: f64,
    /// Axes of the image; the DACs share a bus, and the second one's word comes after the first one's.
    pub axes: u8,
    /// Whether its laws are complete ones, or the paper's.
    pub complete: bool,
    /// From a trigger to the new outputs of the DACs, which the sample timer latches, seconds.
    pub latch_s: f64,
}

/// Cycles for an instruction, as a bound for this code: floating-point arithmetic takes 1 and loads 2 (Cortex-M4 TRM DDI 0439, tables
/// 3-1 and 7-1), a taken branch up to 4 but less than one in eight is one. A Cortex-M7 issues two at once where it can.
const CYCLES_AN_INSTRUCTION: f64 = 2.0;
/// Entering an interrupt and leaving it, with the floating-point registers: 29 cycles and 27 (DDI 0439, section 3.9).
const INTERRUPT_CYCLES: f64 = 56.0;
/// Instructions of the driver around the bus, three bytes with their flags: counted in the disassembly, doubled.
const DRIVER_INSTRUCTIONS: f64 = 150.0;
/// Bits of a word on the bus.
const BUS_BITS: f64 = WORD_BITS as f64;
/// Settling of the AD5683R from a quarter to three quarters of its range, typical (data sheet, AC characteristics).
pub const SETTLING_S: f64 = 5e-6;
/// Period of the loop.
const PERIOD_S: f64 = 20e-6;

/// The boards of `firmware/nucleo` with the paper's law and with a complete one.
///
/// Closed loop, sines, triangle, complex harmonic and steps, the sample timer around the tick (`hysteron board run` prints it): of the
/// paper's law 415 instructions at worst (`mps2-an500`) and 480 (`mps2-an386`), of a complete one 1250 and 1350; of both axes with the
/// paper's laws 870 (`mps2-an500`), with complete ones 2520.
pub const BOARDS: [Budget; 6] = [
    Budget::of(&chips::H743, 420.0, 1, false),
    Budget::of(&chips::H743, 1260.0, 1, true),
    Budget::of(&chips::H743, 880.0, 2, false),
    Budget::of(&chips::H743, 2530.0, 2, true),
    Budget::of(&chips::G474, 490.0, 1, false),
    Budget::of(&chips::G474, 1360.0, 1, true),
];

/// Known delay of a recording of what describes itself so, seconds; where it is one of these.
pub fn known_delay_s(about: &About) -> Option<f64> {
    let law = (about.hello.axes, about.hello.complete);
    let of_it = |budget: &&Budget| budget.board == about.board() && (budget.axes, budget.complete) == law;
    Some(BOARDS.iter().find(of_it)?.known_delay_s())
}

impl Budget {
    /// By the figures that the board's registers are set to.
    const fn of(chip: &Chip, tick_instructions: f64, axes: u8, complete: bool) -> Self {
        let Some(latch_ns) = chip.latch_ns(axes as usize, complete) else {
            panic!("no board runs such laws");
        };
        Self {
            board: chip.board,
            clock_hz: chip.processor_hz() as f64,
            adc_hz: chip.adc_hz() as f64,
            sampling_cycles: 0.5 * chip.sampling_half_cycles as f64,
            conversion_cycles: 0.5 * chip.conversion_half_cycles as f64,
            bus_hz: chip.bus_hz() as f64,
            tick_instructions,
            axes,
            complete,
            latch_s: 1e-9 * latch_ns as f64,
        }
    }

    /// Processor cycles of the interrupt, without the bus.
    pub fn cycles(&self) -> f64 {
        INTERRUPT_CYCLES + CYCLES_AN_INSTRUCTION * (self.tick_instructions + f64::from(self.axes) * DRIVER_INSTRUCTIONS)
    }

    /// Time in the interrupt, seconds: cycles, and the bus, which it waits for.
    pub fn interrupt_s(&self) -> f64 {
        self.cycles() / self.clock_hz + f64::from(self.axes) * BUS_BITS / self.bus_hz
    }

    /// From a trigger to the last word at its DAC, seconds.
    pub fn ready_s(&self) -> f64 {
        (self.sampling_cycles + self.conversion_cycles) / self.adc_hz + self.interrupt_s()
    }

    /// From the end of sampling to the edge of the DACs' outputs, seconds; settling and half a period of hold come on top.
    pub fn latency_s(&self) -> f64 {
        self.latch_s - self.sampling_cycles / self.adc_hz
    }

    /// Known delay of a recording, seconds: latency, half of the settling, half a period of hold.
    pub fn known_delay_s(&self) -> f64 {
        self.latency_s() + 0.5 * SETTLING_S + 0.5 * PERIOD_S
    }

    /// Share of the period that is left.
    pub fn headroom(&self) -> f64 {
        1.0 - self.ready_s() / PERIOD_S
    }

    /// The row of `docs/boards/`.
    pub fn row(&self) -> String {
        format!(
            "| {}{} | {} | {:.0} MHz | {:.2} us | {:.0} | {:.2} us | {:.2} us | {:.1} us | {:.1} us | {:.1} us | {:.0} % |",
            self.board,
            if self.axes > 1 { ", both axes" } else { "" },
            if self.complete { "complete" } else { "paper's" },
            self.clock_hz / 1e6,
            1e6 * (self.sampling_cycles + self.conversion_cycles) / self.adc_hz,
            self.cycles(),
            1e6 * BUS_BITS / self.bus_hz,
            1e6 * self.ready_s(),
            1e6 * self.latch_s,
            1e6 * self.latency_s(),
            1e6 * self.known_delay_s(),
            100.0 * self.headroom()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pages of the boards quote what is computed here.
    #[test]
    fn golden_pages_have_these_figures() {
        for budget in BOARDS {
            let page = format!("{}/../../docs/boards/{}.md", env!("CARGO_MANIFEST_DIR"), budget.board);
            let text = std::fs::read_to_string(&page).unwrap();
            let row = budget.row();
            assert!(text.contains(&row), "{page} should have\n{row}");
            let least = match (budget.board, budget.axes, budget.complete) {
                // What its page warns of: by this bound nothing is left.
                ("nucleo-g474re", _, true) => 0.0,
                (_, 2, true) => 0.1,
                _ => 0.5,
            };
            assert!(budget.headroom() > least, "{budget:?}");
        }
    }

    /// A latch waits for the longest tick, for half a microsecond more than that at the most, and not beyond the next trigger.
    #[test]
    fn val_every_word_is_there_before_its_latch() {
        for budget in BOARDS {
            let waits_s = budget.latch_s - budget.ready_s();
            assert!((0.0..0.6e-6).contains(&waits_s), "{budget:?} {waits_s}");
            assert!(budget.latch_s < PERIOD_S, "{budget:?}");
        }
    }

    /// A board that runs a complete law latches later: at 9.5 us instead of 5.5.
    #[test]
    fn val_known_delay_is_that_of_the_law() {
        let mut about = About::of("nucleo-h743zi");
        let of_the_paper = known_delay_s(&about).unwrap();
        about.hello.complete = true;
        assert!((known_delay_s(&about).unwrap() - of_the_paper - 4.0e-6).abs() < 1e-11);
        assert_eq!(known_delay_s(&About::of("mps2-an386")), None);
    }

    /// By hand: 25 / 42.5 MHz + (56 + 2 x 640) / 170 MHz + 24 / 21.25 MHz, and 10 us less 12.5 / 42.5 MHz.
    #[test]
    fn val_latency_by_hand() {
        let g474 = BOARDS[4];
        assert!((g474.ready_s() - (0.588_235e-6 + 7.858_824e-6 + 1.129_412e-6)).abs() < 1e-11);
        assert!((g474.latency_s() - (10e-6 - 0.294_118e-6)).abs() < 1e-11);
        assert!((g474.known_delay_s() - g474.latency_s() - 12.5e-6).abs() < 1e-15);
    }
}
