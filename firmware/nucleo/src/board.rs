//! Clocks and pins of the two boards.

use crate::ad5683r::Ad5683r;
use embassy_stm32::adc::{Adc, AdcChannel, SampleTime};
use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::interrupt::Interrupt;
use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::{self, Spi, mode::Master};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{RoundTo, Timer};
use embassy_stm32::{Config, peripherals};
use hysteron_firmware::table;

/// What main gets.
pub struct Parts {
    pub dac: Ad5683r<Spi<'static, Blocking, Master>, Output<'static>>,
    pub fault: Output<'static>,
    pub button: Input<'static>,
    pub timer: Timer<'static, peripherals::TIM6>,
}

/// Bus of the DAC, which takes 50 MHz.
const SPI_HZ: u32 = 25_000_000;

fn bus_config() -> spi::Config {
    let mut config = spi::Config::default();
    config.mode = spi::MODE_1;
    config.frequency = Hertz(SPI_HZ);
    config
}

/// The sample clock, which does not run yet.
fn sample_clock(timer: embassy_stm32::Peri<'static, peripherals::TIM6>) -> Timer<'static, peripherals::TIM6> {
    let timer = Timer::new(timer);
    timer.set_frequency(Hertz((table::SAMPLE_RATE_HZ + 0.5) as u32), RoundTo::Faster);
    timer
}

#[cfg(feature = "h743zi")]
mod chip {
    use super::*;
    use embassy_stm32::pac::adc::vals::Pcsel;
    use embassy_stm32::rcc;

    pub const INTERRUPT: Interrupt = Interrupt::ADC;
    /// PA3, on the connector A0, is ADC12_INP15 (data sheet DS12110, pin table).
    pub const CHANNEL: u8 = 15;
    /// The ADC gives 16 bits.
    pub const TO_16_BITS: u32 = 0;

    /// 400 MHz from the ST-LINK's 8 MHz, which every revision of the chip takes; the ADC from the 64 MHz oscillator.
    pub fn start() -> Parts {
        let mut config = Config::default();
        config.rcc.hse = Some(rcc::Hse {
            freq: Hertz(8_000_000),
            mode: rcc::HseMode::Bypass,
        });
        config.rcc.pll1 = Some(rcc::Pll {
            source: rcc::PllSource::HSE,
            prediv: rcc::PllPreDiv::DIV2,
            mul: rcc::PllMul::MUL200,
            fracn: None,
            divp: Some(rcc::PllDiv::DIV2),
            divq: Some(rcc::PllDiv::DIV8),
            divr: None,
        });
        config.rcc.sys = rcc::Sysclk::PLL1_P;
        config.rcc.ahb_pre = rcc::AHBPrescaler::DIV2;
        config.rcc.apb1_pre = rcc::APBPrescaler::DIV2;
        config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
        config.rcc.apb3_pre = rcc::APBPrescaler::DIV2;
        config.rcc.apb4_pre = rcc::APBPrescaler::DIV2;
        config.rcc.voltage_scale = rcc::VoltageScale::Scale1;
        config.rcc.mux.adcsel = rcc::mux::Adcsel::PER;
        let p = embassy_stm32::init(config);
        // Set up and calibrated by embassy; what it leaves to software conversions is set in `converter`.
        core::mem::forget(Adc::new(p.ADC1));
        let _pin = analog(p.PA3);
        let registers = embassy_stm32::pac::ADC1;
        registers
            .pcsel()
            .modify(|w| w.set_pcsel(CHANNEL as usize, Pcsel::PRESELECTED));
        registers
            .smpr(1)
            .modify(|w| w.set_smp(CHANNEL as usize - 10, SampleTime::CYCLES8_5.into()));
        let bus = Spi::new_blocking_txonly(p.SPI1, p.PA5, p.PB5, bus_config());
        Parts {
            dac: Ad5683r::new(bus, Output::new(p.PD14, Level::High, Speed::VeryHigh)),
            fault: Output::new(p.PB14, Level::Low, Speed::Low),
            button: Input::new(p.PC13, Pull::Down),
            timer: sample_clock(p.TIM6),
        }
    }

    fn analog(pin: embassy_stm32::Peri<'static, peripherals::PA3>) -> impl AdcChannel<peripherals::ADC1> {
        pin.degrade_adc()
    }
}

#[cfg(feature = "g474re")]
mod chip {
    use super::*;
    use embassy_stm32::rcc;

    pub const INTERRUPT: Interrupt = Interrupt::ADC1_2;
    /// PA0, on the connector A0, is ADC12_IN1 (data sheet DS12288, pin table).
    pub const CHANNEL: u8 = 1;
    /// The ADC gives 12 bits.
    pub const TO_16_BITS: u32 = 4;

    /// 170 MHz from the 16 MHz oscillator: 16 / 4 x 85 / 2.
    pub fn start() -> Parts {
        let mut config = Config::default();
        config.rcc.hsi = true;
        config.rcc.pll = Some(rcc::Pll {
            source: rcc::PllSource::HSI,
            prediv: rcc::PllPreDiv::DIV4,
            mul: rcc::PllMul::MUL85,
            divp: None,
            divq: None,
            divr: Some(rcc::PllRDiv::DIV2),
        });
        config.rcc.sys = rcc::Sysclk::PLL1_R;
        config.rcc.boost = true;
        config.rcc.mux.adc12sel = rcc::mux::Adcsel::SYS;
        let p = embassy_stm32::init(config);
        core::mem::forget(Adc::new(p.ADC1, Default::default()));
        let _pin = analog(p.PA0);
        embassy_stm32::pac::ADC1
            .smpr()
            .modify(|w| w.set_smp(CHANNEL as usize, SampleTime::CYCLES12_5.into()));
        let bus = Spi::new_blocking_txonly(p.SPI1, p.PA5, p.PA7, bus_config());
        Parts {
            dac: Ad5683r::new(bus, Output::new(p.PB6, Level::High, Speed::VeryHigh)),
            fault: Output::new(p.PC7, Level::Low, Speed::Low),
            button: Input::new(p.PC13, Pull::Down),
            timer: sample_clock(p.TIM6),
        }
    }

    fn analog(pin: embassy_stm32::Peri<'static, peripherals::PA0>) -> impl AdcChannel<peripherals::ADC1> {
        pin.degrade_adc()
    }
}

pub use chip::{CHANNEL, INTERRUPT, TO_16_BITS, start};
