//! What the real boards' registers are set to, against the reference manuals' figures: RM0433 for the STM32H743, RM0440 for the
//! STM32G474, by the titles of their sections.

use hysteron_converters::ad5683r::{CLOCK_PHASE, CLOCK_POLARITY, MOST_HZ, Update, WORD_BITS, word};
use hysteron_core::codes::DacCode;
use hysteron_firmware::chips::{
    ALL, Chip, G474, H743, TIM3_TRIGGER, WATCHDOG_START_US, WATCHDOG_US, smp_place, watchdog,
};
use hysteron_firmware::monitor::WATCHDOG_SAMPLES;
use hysteron_firmware::{kept, table};

/// RM0433, "PLL description" (input 2 to 16 MHz for the wide VCO of 192 to 836 MHz) and "Clock tree"; DS12110, "General operating
/// conditions" (VOS1: 400 MHz, AHB 200, APB 100).
#[test]
fn val_clock_tree_of_the_h743() {
    assert_eq!(H743.pll_input_hz(), 4_000_000);
    assert_eq!(H743.vco_hz(), 800_000_000);
    assert_eq!(H743.processor_hz(), 400_000_000);
    assert_eq!(H743.ahb_hz(), 200_000_000);
    assert_eq!(H743.apb_hz(), 100_000_000);
    assert!((2_000_000..=16_000_000).contains(&H743.pll_input_hz()));
    assert!((192_000_000..=836_000_000).contains(&H743.vco_hz()));
    // RCC_PLLCKSELR: DIVM1 0 to 63; RCC_PLL1DIVR: DIVN1 3 to 511, DIVP1 odd only (P even, or 1), DIVQ1 0 to 127.
    assert!((1..=63).contains(&H743.pll_m) && (4..=512).contains(&H743.pll_n));
    assert!(H743.pll_system.is_multiple_of(2) && (1..=128).contains(&H743.pll_q));
}

/// RM0440, "PLL" (input 2.66 to 16 MHz, VCO 96 to 344 MHz, PLLN 8 to 127) and "Clocks" (170 MHz in the boost range, APBs the same).
#[test]
fn val_clock_tree_of_the_g474() {
    assert_eq!(G474.pll_input_hz(), 4_000_000);
    assert_eq!(G474.vco_hz(), 340_000_000);
    assert_eq!(G474.processor_hz(), 170_000_000);
    assert_eq!(G474.apb_hz(), 170_000_000);
    assert!((2_660_000..=16_000_000).contains(&G474.pll_input_hz()));
    assert!((96_000_000..=344_000_000).contains(&G474.vco_hz()));
    assert!((8..=127).contains(&G474.pll_n) && (1..=16).contains(&G474.pll_m));
}

/// RM0433 and RM0440, "General-purpose timers (TIM2/TIM3/TIM4/TIM5)", counter clock: `f = clock / ((PSC + 1) (ARR + 1))`; "Clock source for timers": twice the APB's
/// clock where that is divided.
#[test]
fn val_sample_clock_is_50_khz() {
    assert_eq!((H743.timer_hz(), G474.timer_hz()), (200_000_000, 170_000_000));
    assert_eq!(H743.sample_clock(50e3), Some((0, 3999)));
    assert_eq!(G474.sample_clock(50e3), Some((0, 3399)));
    // 200 MHz / (4 x 50 000) and 170 MHz / (3 x 56 666.67): the second is no whole number.
    assert_eq!(H743.sample_clock(1e3), Some((3, 49_999)));
    assert_eq!(G474.sample_clock(1e3), None);
    for chip in ALL {
        for rate_hz in [f32::NAN, 0.0, -5e4, f32::INFINITY, 2e6, 30_001.0] {
            assert_eq!(chip.sample_clock(rate_hz), None, "{} {rate_hz}", chip.board);
        }
        let (prescaler, reload) = chip.sample_clock(table::SAMPLE_RATE_HZ).unwrap_or_default();
        let counts = (u32::from(prescaler) + 1) * (u32::from(reload) + 1);
        assert_eq!(counts * 50_000, chip.timer_hz(), "{}", chip.board);
    }
}

/// RM0433 and RM0440, "PWM mode": the output is high while the counter is below CCR1. 5.5 us at 200 MHz are 1100 counts.
#[test]
fn val_instant_of_the_latch() {
    let of = |chip: Chip, axes, complete| chip.latch(chip.sample_clock(50e3)?, chip.latch_ns(axes, complete)?);
    assert_eq!(of(H743, 1, false), Some(1100));
    assert_eq!(of(H743, 2, true), Some(3500));
    assert_eq!(of(G474, 1, true), Some(3383));
    // Two laws are too many for the one, three axes for either.
    assert_eq!(
        (of(G474, 2, false), of(H743, 3, false), of(H743, 0, false)),
        (None, None, None)
    );
    // Four counts of 200 MHz a count at 1 kHz.
    assert_eq!(H743.latch((3, 49_999), 5_500), Some(275));
    // LDAC is low for 10 counts at least: 3990 would be the last.
    assert_eq!(H743.latch((0, 3999), 19_945), Some(3989));
    assert_eq!(H743.latch((0, 3999), 19_955), None);
    // A period of 5 us has no room for it.
    assert_eq!(H743.latch((0, 999), 5_500), None);
}

/// RM0433 and RM0440, "External triggers for regular channels": adc_ext_trg4 is tim3_trgo, EXTSEL 00100. "ADC sample time
/// registers": SMP 010 is 8.5 cycles on the one, 12.5 on the other, three bits a channel, channel 10 first in the second register.
#[test]
fn val_converter() {
    assert_eq!(TIM3_TRIGGER, 0b00100);
    assert_eq!((H743.smp, H743.sampling_half_cycles), (0b010, 17));
    assert_eq!((G474.smp, G474.sampling_half_cycles), (0b010, 25));
    let places = [H743.adc_channel, G474.adc_channel].map(smp_place);
    assert_eq!(places, [(1, 5), (0, 1)]);
    // Channel 10, of ADC2: the first in the second register.
    assert_eq!(H743.adc_channel_y.map(smp_place), Some((1, 0)));
    assert_eq!(G474.adc_channel_y, None);
    // "ADC common control register": PRESC 0001 divides by 2, 0010 by 4.
    assert_eq!((H743.adc_presc(), G474.adc_presc()), (0b0001, 0b0010));
    assert_eq!((H743.adc_hz(), G474.adc_hz()), (16_000_000, 42_500_000));
    // BOOST 11 of ADC_CR is for up to 50 MHz (RM0433); 60 MHz (DS12288, ADC characteristics).
    assert!(H743.adc_hz() <= 50_000_000 && G474.adc_hz() <= 60_000_000);
    // Sampling and conversion: 17 cycles of 16 MHz, 25 of 42.5 MHz. Both end well before the next trigger.
    let both_s = |half_cycles: u32, hz: u32| 0.5 * f64::from(half_cycles) / f64::from(hz);
    let h743 = both_s(H743.sampling_half_cycles + H743.conversion_half_cycles, H743.adc_hz());
    let g474 = both_s(G474.sampling_half_cycles + G474.conversion_half_cycles, G474.adc_hz());
    assert!((h743 - 1.0625e-6).abs() < 1e-12 && (g474 - 0.588_235e-6).abs() < 1e-11);
    assert_eq!((H743.to_16_bits(), G474.to_16_bits()), (0, 4));
    assert_eq!(0x0fff << G474.to_16_bits(), 0xfff0);
}

/// RM0433, SPI_CFG1: MBR 001 divides by 4. RM0440, SPI_CR1: BR 010 divides by 8. The DAC takes 50 MHz in mode 1.
#[test]
fn val_bus_of_the_dac() {
    assert_eq!((H743.spi_kernel_hz(), G474.spi_kernel_hz()), (100_000_000, 170_000_000));
    assert_eq!((H743.spi_field(), G474.spi_field()), (0b001, 0b010));
    assert_eq!((H743.bus_hz(), G474.bus_hz()), (25_000_000, 21_250_000));
    assert!(ALL.iter().all(|chip| chip.bus_hz() <= MOST_HZ));
    assert_eq!((CLOCK_POLARITY, CLOCK_PHASE), (false, true));
}

/// AD5683R, "Input Shift Register": DB23 to DB20 command, DB19 to DB4 the code, DB3 to DB0 of no matter.
#[test]
fn val_words_of_the_dac() {
    for (code, wanted) in [
        (0, [0x30, 0x00, 0x00]),
        (0x1234, [0x31, 0x23, 0x40]),
        (0x8000, [0x38, 0x00, 0x00]),
        (0xffff, [0x3f, 0xff, 0xf0]),
    ] {
        assert_eq!(word(DacCode(code), Update::AtOnce), wanted, "{code:#x}");
    }
    // "Command Definitions": 0001 writes the input register, 0011 input register and output.
    for (update, command) in [(Update::AtOnce, 0b0011), (Update::ByLdac, 0b0001)] {
        for code in 0..=u16::MAX {
            let [first, second, third] = word(DacCode(code), update);
            let bits = u32::from_be_bytes([0, first, second, third]);
            assert_eq!(bits, command << 20 | u32::from(code) << 4);
            assert!(bits < 1 << WORD_BITS);
        }
    }
}

/// RM0433 and RM0440, "IWDG": 4 x 2^PR x (RL + 1) periods of the 32 kHz oscillator, which is 34 kHz at most (DS12288, LSI).
#[test]
fn val_watchdog() {
    assert_eq!(watchdog(WATCHDOG_US), (0, 15));
    // The same prescaler: only the reload is another once it counts.
    assert_eq!(watchdog(WATCHDOG_START_US), (0, 1599));
    let shortest_s = 4.0 * 16.0 / 34e3;
    let patience_s = f64::from(WATCHDOG_SAMPLES) / f64::from(table::SAMPLE_RATE_HZ);
    assert!(shortest_s > patience_s, "{shortest_s} {patience_s}");
    // The longest of each prescaler, and beyond: 4096 x 4 / 32 kHz is 0.512 s.
    for (us, wanted) in [
        (512_000, (0, 4095)),
        (512_250, (1, 2048)),
        (32_768_000, (6, 4095)),
        (0, (0, 0)),
    ] {
        assert_eq!(watchdog(us), wanted, "{us}");
    }
}

/// What a reset leaves is a code or is none; the way down takes no step above the ramp, and ends.
#[test]
fn val_output_across_a_reset() {
    for code in 0..=u16::MAX {
        assert_eq!(kept::unpack(kept::pack(code)), Some(code));
        assert_eq!(kept::unpack(kept::pack(code) ^ 1 << (code % 32)), None);
    }
    // 20 ms, 1000 samples, for the amplifier's range, as `hysteron export` sets it; the built-in tables' DAC spans twice that.
    let share = (table::OUTPUT_MAX_V - table::OUTPUT_MIN_V) / (table::DAC_TOP_V - table::DAC_MIN_V);
    assert!((0.49..0.51).contains(&share), "{share}");
    let range_v = table::DAC_TOP_V - table::DAC_MIN_V;
    assert_eq!(
        kept::ramp_codes(table::RAMP_V_PER_S, table::SAMPLE_RATE_HZ, range_v),
        32
    );
    for (from, to, most, steps) in [
        (65_535, 0, 65, 1009),
        (0, 65_535, 65, 1009),
        (100, 100, 65, 0),
        (7, 0, 0, 7),
    ] {
        let (mut code, mut taken) = (from, 0);
        while code != to {
            let next = kept::toward(code, to, most);
            assert!(next.abs_diff(code) <= most.max(1) && next.abs_diff(to) < code.abs_diff(to));
            (code, taken) = (next, taken + 1);
        }
        assert_eq!(taken, steps, "{from} to {to}");
    }
}
