//! What the real boards' registers are set to, as constants and the reference manuals' formulas: `firmware/nucleo` writes them, the
//! host tests them. RM0433 is the STM32H743's manual, RM0440 the STM32G474's.

use hysteron_converters::ad5683r::LDAC_LOW_NS;

/// Clock tree, sample clock, converter and bus of one board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chip {
    /// The board.
    pub board: &'static str,
    /// The oscillator that a reset starts by itself.
    pub internal_hz: u32,
    /// The PLL's source: the ST-LINK's 8 MHz, or the internal oscillator.
    pub oscillator_hz: u32,
    /// M: divides the source.
    pub pll_m: u32,
    /// N: multiplies it.
    pub pll_n: u32,
    /// P or R: divides the VCO for the processor.
    pub pll_system: u32,
    /// Q: divides the VCO for the bus of the DAC; 0 where that runs on the APB's clock.
    pub pll_q: u32,
    /// Divides the processor's clock for the AHB.
    pub ahb_divider: u32,
    /// Divides the AHB's clock for the APBs.
    pub apb_divider: u32,
    /// Clock that the ADC is given, hertz.
    pub adc_kernel_hz: u32,
    /// Divides it, PRESC of ADC_CCR.
    pub adc_prescaler: u32,
    /// Divides it once more inside of the chip.
    pub adc_fixed_divider: u32,
    /// The sensor's channel of ADC1.
    pub adc_channel: u8,
    /// The second axis' sensor's channel of ADC2, which samples with ADC1; none where two laws are too many for the processor.
    pub adc_channel_y: Option<u8>,
    /// Half cycles of the ADC's clock in which it samples.
    pub sampling_half_cycles: u32,
    /// Half cycles from the end of sampling to the code.
    pub conversion_half_cycles: u32,
    /// SMP of that channel.
    pub smp: u8,
    /// Bits of a code; shifted to the upper ones of 16.
    pub adc_bits: u32,
    /// Divides the bus's clock: a power of two from 2 to 256.
    pub spi_divider: u32,
    /// From a trigger to the new outputs of the DACs, nanoseconds: of the paper's law and of a complete one, by the number of axes.
    /// Beyond the longest tick found, at two cycles an instruction (`hysteron_board::budget`).
    pub latches_ns: &'static [[u32; 2]],
}

/// STM32H743ZI. 400 MHz and not 480, which only revision V reaches (DS12110, general operating conditions).
pub const H743: Chip = Chip {
    board: "nucleo-h743zi",
    internal_hz: 64_000_000,
    oscillator_hz: 8_000_000,
    pll_m: 2,
    pll_n: 200,
    pll_system: 2,
    pll_q: 8,
    ahb_divider: 2,
    apb_divider: 2,
    // per_ck: the 64 MHz oscillator (RM0433, "Peripheral clock distribution", ADC).
    adc_kernel_hz: 64_000_000,
    adc_prescaler: 2,
    // From revision V on; revision Y has none, and converts twice as fast (RM0433, "ADC clocks").
    adc_fixed_divider: 2,
    // PA3, on the connector A0, is ADC12_INP15 (DS12110, pin table).
    adc_channel: 15,
    // PC0, on the connector A1, is ADC123_INP10 (DS12110, pin table).
    adc_channel_y: Some(10),
    sampling_half_cycles: 17,
    // N / 2 + 1/2 for 16 bits (DS12110, ADC characteristics).
    conversion_half_cycles: 17,
    smp: 0b010,
    adc_bits: 16,
    spi_divider: 4,
    latches_ns: &[[5_500, 9_500], [9_500, 17_500]],
};

/// STM32G474RE at its highest clock.
pub const G474: Chip = Chip {
    board: "nucleo-g474re",
    internal_hz: 16_000_000,
    oscillator_hz: 16_000_000,
    pll_m: 4,
    pll_n: 85,
    pll_system: 2,
    pll_q: 0,
    ahb_divider: 1,
    apb_divider: 1,
    adc_kernel_hz: 170_000_000,
    adc_prescaler: 4,
    adc_fixed_divider: 1,
    // PA0, on the connector A0, is ADC12_IN1 (DS12288, pin table).
    adc_channel: 1,
    // A tick of both axes takes up to 2720 instructions (`mps2-an386`), at two cycles each 5440 of the 3400 that a period has.
    adc_channel_y: None,
    sampling_half_cycles: 25,
    // 12 bits (DS12288, ADC characteristics).
    conversion_half_cycles: 25,
    smp: 0b010,
    adc_bits: 12,
    spi_divider: 8,
    latches_ns: &[[10_000, 19_900]],
};

/// Both.
pub const ALL: [Chip; 2] = [H743, G474];

/// EXTSEL of the ADC: `adc_ext_trg4` is TIM3's TRGO on both chips (RM0433 and RM0440, "External triggers for regular channels").
pub const TIM3_TRIGGER: u8 = 4;

/// Reset after this long without a tick: twice what the monitor calls a hung interrupt, and long enough for the fastest LSI.
pub const WATCHDOG_US: u32 = 2000;

/// The same from a reset to the first tick: clocks, converters' calibration and tables take some 20 ms, and each step on the way to the
/// safe level feeds it.
pub const WATCHDOG_START_US: u32 = 200_000;

/// The same while a slot of flash is erased and written, with the sample clock stopped.
pub const WATCHDOG_FLASH_US: u32 = 10_000_000;

// The loop's time is set by RL alone, while the watchdog counts.
const _: () = assert!(watchdog(WATCHDOG_US).0 == watchdog(WATCHDOG_START_US).0);

/// The low-speed oscillator's nominal clock, which the watchdog counts.
pub const LSI_HZ: u32 = 32_000;

impl Chip {
    /// What the PLL's phase detector compares.
    pub const fn pll_input_hz(&self) -> u32 {
        self.oscillator_hz / self.pll_m
    }

    /// The PLL's oscillator.
    pub const fn vco_hz(&self) -> u32 {
        self.pll_input_hz() * self.pll_n
    }

    /// The processor.
    pub const fn processor_hz(&self) -> u32 {
        self.vco_hz() / self.pll_system
    }

    /// AHB, memories and DMA.
    pub const fn ahb_hz(&self) -> u32 {
        self.processor_hz() / self.ahb_divider
    }

    /// The APBs.
    pub const fn apb_hz(&self) -> u32 {
        self.ahb_hz() / self.apb_divider
    }

    /// TIM3: the APB's clock, doubled where that is a divided one (RM0433 and RM0440, "Clock source for timers", TIMPRE = 0).
    pub const fn timer_hz(&self) -> u32 {
        if self.apb_divider == 1 {
            self.apb_hz()
        } else {
            2 * self.apb_hz()
        }
    }

    /// PSC and ARR of TIM3: `rate = timer / ((PSC + 1) (ARR + 1))`, with the smallest PSC whose ARR fits 16 bits. `None` where no pair
    /// gives the rate to a part in a million: the clock's error would be the trajectory's.
    pub fn sample_clock(&self, sample_rate_hz: f32) -> Option<(u16, u16)> {
        // A NaN fails this.
        if !(sample_rate_hz >= 1.0 && sample_rate_hz <= 1e6) {
            return None;
        }
        let counts = (self.timer_hz() as f32 / sample_rate_hz + 0.5) as u32;
        let prescaler = counts.saturating_sub(1) / 65_536;
        let reload = counts / (prescaler + 1);
        let made_hz = self.timer_hz() as f32 / ((prescaler + 1) * reload) as f32;
        let close = (made_hz - sample_rate_hz).abs() <= 1e-6 * sample_rate_hz;
        match (u16::try_from(prescaler), u16::try_from(reload.saturating_sub(1))) {
            (Ok(prescaler), Ok(reload)) if close => Some((prescaler, reload)),
            _ => None,
        }
    }

    /// From a trigger to the new outputs of so many DACs, nanoseconds; none where the laws are too many for the processor.
    pub const fn latch_ns(&self, axes: usize, complete: bool) -> Option<u32> {
        if axes == 0 || axes > self.latches_ns.len() {
            return None;
        }
        Some(self.latches_ns[axes - 1][complete as usize])
    }

    /// CCR1 of TIM3, whose channel is LDAC: high below it, low from it to the end of a period. `None` where that is too short for the
    /// DAC.
    pub fn latch(&self, (prescaler, reload): (u16, u16), latch_ns: u32) -> Option<u16> {
        let count_hz = u64::from(self.timer_hz() / (u32::from(prescaler) + 1));
        let counts = |ns: u32| u64::from(ns) * count_hz / 1_000_000_000;
        let latch = counts(latch_ns);
        if latch + counts(LDAC_LOW_NS) > u64::from(reload) {
            return None;
        }
        u16::try_from(latch).ok()
    }

    /// The ADC's clock.
    pub const fn adc_hz(&self) -> u32 {
        self.adc_kernel_hz / self.adc_prescaler / self.adc_fixed_divider
    }

    /// PRESC of ADC_CCR: 0, 1, 2, 3 for 1, 2, 4, 6 (RM0433 and RM0440, "ADC common control register").
    pub const fn adc_presc(&self) -> u8 {
        match self.adc_prescaler {
            1 => 0,
            even => (even / 2) as u8,
        }
    }

    /// Shift that makes an ADC code one of 16 bits.
    pub const fn to_16_bits(&self) -> u32 {
        16 - self.adc_bits
    }

    /// What SPI1 divides.
    pub const fn spi_kernel_hz(&self) -> u32 {
        match self.pll_q {
            0 => self.apb_hz(),
            q => self.vco_hz() / q,
        }
    }

    /// The bus of the DAC.
    pub const fn bus_hz(&self) -> u32 {
        self.spi_kernel_hz() / self.spi_divider
    }

    /// MBR of SPI_CFG1 (RM0433) or BR of SPI_CR1 (RM0440): 0 divides by 2, 7 by 256.
    pub const fn spi_field(&self) -> u8 {
        self.spi_divider.trailing_zeros() as u8 - 1
    }
}

/// Where SMP of a channel is: the register, and the place in it (RM0433 and RM0440, ADC_SMPR1 and ADC_SMPR2).
pub const fn smp_place(channel: u8) -> (usize, usize) {
    ((channel / 10) as usize, (channel % 10) as usize)
}

/// PR and RL of the independent watchdog: `t = 4 2^PR (RL + 1) / LSI` (RM0433 and RM0440, "IWDG").
pub const fn watchdog(timeout_us: u32) -> (u8, u16) {
    let mut field = 0;
    loop {
        let counts = (timeout_us as u64 * LSI_HZ as u64 / 1_000_000) >> (2 + field);
        if counts <= 4096 || field == 6 {
            return (field, (if counts == 0 { 0 } else { counts - 1 }) as u16 & 0xfff);
        }
        field += 1;
    }
}
