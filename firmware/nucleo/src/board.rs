//! Clocks and pins of the two boards, from the figures of [`hysteron_firmware::chips`].

use crate::Dac;
use crate::ad5683r::Ad5683r;
use embassy_stm32::adc::{Adc, AdcChannel, AnyAdcChannel};
use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::interrupt::Interrupt;
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Config, Peri, pac, peripherals};
use hysteron_firmware::ad5683r::{CLOCK_PHASE, CLOCK_POLARITY};
use hysteron_firmware::chips::{Chip, WATCHDOG_US, smp_place};

/// What main gets.
pub struct Parts {
    pub dac: Dac,
    pub fault: Output<'static>,
    pub button: Input<'static>,
    pub timer: Timer<'static, peripherals::TIM6>,
    pub watchdog: IndependentWatchdog<'static, Watchdog>,
    /// What the reset came from.
    pub reset: Reset,
}

/// What the last reset came from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Reset {
    /// Power was off: memory holds nothing, and the DAC began at its own zero.
    pub power: bool,
    /// The watchdog.
    pub watchdog: bool,
}

/// Mode of the DAC's bus.
const MODE: spi::Mode = spi::MODE_1;
const _: () = assert!(matches!(MODE.polarity, spi::Polarity::IdleHigh) == CLOCK_POLARITY);
const _: () = assert!(matches!(MODE.phase, spi::Phase::CaptureOnSecondTransition) == CLOCK_PHASE);

fn bus_config() -> spi::Config {
    let mut config = spi::Config::default();
    config.mode = MODE;
    config.frequency = Hertz(CHIP.bus_hz());
    config
}

/// Whether the registers that embassy works out by itself hold what `chips` says; names the first that does not. Those of the watchdog
/// read as set only once it runs (RM0433 and RM0440, IWDG_SR).
fn check(rcc: &Peri<'static, peripherals::RCC>, timer: &Timer<'static, peripherals::TIM6>) -> Result<(), &'static str> {
    let processor = embassy_stm32::rcc::clocks(rcc).sys.to_hertz();
    let held = [
        ("processor clock", processor == Some(Hertz(CHIP.processor_hz()))),
        ("clock of TIM6", timer.get_clock_frequency() == Hertz(CHIP.timer_hz())),
        ("prescaler of the ADC", chip::adc_presc() == CHIP.adc_presc()),
        ("divider of SPI1", chip::spi_field() == CHIP.spi_field()),
    ];
    held.iter()
        .find(|(_, held)| !held)
        .map_or(Ok(()), |(name, _)| Err(*name))
}

#[cfg(feature = "h743zi")]
mod chip {
    use super::*;
    use embassy_stm32::pac::adc::vals::Pcsel;
    use embassy_stm32::rcc;

    pub const INTERRUPT: Interrupt = Interrupt::ADC;
    pub const CHIP: Chip = hysteron_firmware::chips::H743;
    pub const WATCHDOG: pac::iwdg::Iwdg = pac::IWDG1;
    pub type Watchdog = peripherals::IWDG1;

    const fn ahb(divider: u32) -> rcc::AHBPrescaler {
        match divider {
            1 => rcc::AHBPrescaler::DIV1,
            2 => rcc::AHBPrescaler::DIV2,
            _ => panic!("no such AHB divider here"),
        }
    }

    const fn apb(divider: u32) -> rcc::APBPrescaler {
        match divider {
            1 => rcc::APBPrescaler::DIV1,
            2 => rcc::APBPrescaler::DIV2,
            _ => panic!("no such APB divider here"),
        }
    }

    /// From the ST-LINK's 8 MHz, which every revision of the chip takes; the ADC from the 64 MHz oscillator.
    fn config() -> Config {
        let mut config = Config::default();
        config.rcc.hse = Some(rcc::Hse {
            freq: Hertz(CHIP.oscillator_hz),
            mode: rcc::HseMode::Bypass,
        });
        // DIVM1 is M, DIVN1, DIVP1 and DIVQ1 are one less than N, P and Q (RM0433, RCC_PLLCKSELR and RCC_PLL1DIVR).
        config.rcc.pll1 = Some(rcc::Pll {
            source: rcc::PllSource::HSE,
            prediv: rcc::PllPreDiv::from_bits(CHIP.pll_m as u8),
            mul: rcc::PllMul::from_bits(CHIP.pll_n as u16 - 1),
            fracn: None,
            divp: Some(rcc::PllDiv::from_bits(CHIP.pll_system as u8 - 1)),
            divq: Some(rcc::PllDiv::from_bits(CHIP.pll_q as u8 - 1)),
            divr: None,
        });
        config.rcc.sys = rcc::Sysclk::PLL1_P;
        config.rcc.ahb_pre = const { ahb(CHIP.ahb_divider) };
        config.rcc.apb1_pre = const { apb(CHIP.apb_divider) };
        config.rcc.apb2_pre = const { apb(CHIP.apb_divider) };
        config.rcc.apb3_pre = const { apb(CHIP.apb_divider) };
        config.rcc.apb4_pre = const { apb(CHIP.apb_divider) };
        config.rcc.voltage_scale = rcc::VoltageScale::Scale1;
        config.rcc.mux.adcsel = rcc::mux::Adcsel::PER;
        config
    }

    /// Clocks, pins, converter and bus.
    ///
    /// # Errors
    /// The first register that is not what `chips` says.
    pub fn start() -> Result<Parts, &'static str> {
        let reset = pac::RCC.rsr().read();
        pac::RCC.rsr().modify(|w| w.set_rmvf(true));
        let p = embassy_stm32::init(config());
        // Set up and calibrated by embassy; what it leaves to software conversions is set in `converter`.
        core::mem::forget(Adc::new(p.ADC1));
        let _pin: AnyAdcChannel<'_, peripherals::ADC1> = p.PA3.degrade_adc();
        sample(pac::ADC1, CHIP.adc_channel);
        #[cfg(feature = "two-axes")]
        {
            core::mem::forget(Adc::new(p.ADC2));
            let _pin: AnyAdcChannel<'_, peripherals::ADC2> = p.PC0.degrade_adc();
            sample(pac::ADC2, const { CHIP.adc_channel_y.expect("a second channel") });
        }
        let bus = Spi::new_blocking_txonly(p.SPI1, p.PA5, p.PB5, bus_config());
        let parts = Parts {
            dac: Ad5683r::new(
                bus,
                [
                    Output::new(p.PD14, Level::High, Speed::VeryHigh),
                    #[cfg(feature = "two-axes")]
                    Output::new(p.PD15, Level::High, Speed::VeryHigh),
                ],
            ),
            fault: Output::new(p.PB14, Level::Low, Speed::Low),
            button: Input::new(p.PC13, Pull::Down),
            timer: Timer::new(p.TIM6),
            watchdog: IndependentWatchdog::new(p.IWDG1, WATCHDOG_US),
            reset: Reset {
                power: reset.porrstf(),
                watchdog: reset.iwdg1rstf(),
            },
        };
        check(&p.RCC, &parts.timer).map(|()| parts)
    }

    /// The channel's input and sampling time.
    fn sample(adc: pac::adc::Adc, channel: u8) {
        adc.pcsel().modify(|w| w.set_pcsel(channel.into(), Pcsel::PRESELECTED));
        let (register, place) = smp_place(channel);
        adc.smpr(register).modify(|w| {
            w.set_smp(place, pac::adc::vals::SampleTime::from_bits(CHIP.smp));
        });
    }

    pub fn adc_presc() -> u8 {
        pac::ADC12_COMMON.ccr().read().presc().to_bits()
    }

    pub fn spi_field() -> u8 {
        pac::SPI1.cfg1().read().mbr().to_bits()
    }
}

#[cfg(all(feature = "g474re", feature = "two-axes"))]
compile_error!(
    "two-axes is for h743zi: a tick of both axes takes up to 2440 instructions, at two cycles each 4880 of the 3400 that g474re has"
);

#[cfg(feature = "g474re")]
mod chip {
    use super::*;
    use embassy_stm32::rcc;

    pub const INTERRUPT: Interrupt = Interrupt::ADC1_2;
    pub const CHIP: Chip = hysteron_firmware::chips::G474;
    pub const WATCHDOG: pac::iwdg::Iwdg = pac::IWDG;
    pub type Watchdog = peripherals::IWDG;

    // What `config` leaves at its reset value.
    const _: () = assert!(CHIP.ahb_divider == 1 && CHIP.apb_divider == 1 && CHIP.pll_system == 2);

    /// From the 16 MHz oscillator.
    fn config() -> Config {
        let mut config = Config::default();
        config.rcc.hsi = true;
        // PLLM is one less than M, PLLN is N (RM0440, RCC_PLLCFGR).
        config.rcc.pll = Some(rcc::Pll {
            source: rcc::PllSource::HSI,
            prediv: rcc::PllPreDiv::from_bits(CHIP.pll_m as u8 - 1),
            mul: rcc::PllMul::from_bits(CHIP.pll_n as u8),
            divp: None,
            divq: None,
            divr: Some(rcc::PllRDiv::DIV2),
        });
        config.rcc.sys = rcc::Sysclk::PLL1_R;
        config.rcc.boost = true;
        config.rcc.mux.adc12sel = rcc::mux::Adcsel::SYS;
        config
    }

    /// Clocks, pins, converter and bus.
    ///
    /// # Errors
    /// The first register that is not what `chips` says.
    pub fn start() -> Result<Parts, &'static str> {
        let reset = pac::RCC.csr().read();
        pac::RCC.csr().modify(|w| w.set_rmvf(true));
        let p = embassy_stm32::init(config());
        core::mem::forget(Adc::new(p.ADC1, Default::default()));
        let _pin: AnyAdcChannel<'_, peripherals::ADC1> = p.PA0.degrade_adc();
        let (register, place) = smp_place(CHIP.adc_channel);
        let time = pac::adc::vals::SampleTime::from_bits(CHIP.smp);
        if register == 0 {
            pac::ADC1.smpr().modify(|w| w.set_smp(place, time));
        } else {
            pac::ADC1.smpr2().modify(|w| w.set_smp(place, time));
        }
        let bus = Spi::new_blocking_txonly(p.SPI1, p.PA5, p.PA7, bus_config());
        let parts = Parts {
            dac: Ad5683r::new(bus, [Output::new(p.PB6, Level::High, Speed::VeryHigh)]),
            fault: Output::new(p.PC7, Level::Low, Speed::Low),
            button: Input::new(p.PC13, Pull::Down),
            timer: Timer::new(p.TIM6),
            watchdog: IndependentWatchdog::new(p.IWDG, WATCHDOG_US),
            reset: Reset {
                power: reset.borrstf(),
                watchdog: reset.iwdgrstf(),
            },
        };
        check(&p.RCC, &parts.timer).map(|()| parts)
    }

    pub fn adc_presc() -> u8 {
        pac::ADC12_COMMON.ccr().read().presc().to_bits()
    }

    pub fn spi_field() -> u8 {
        pac::SPI1.cr1().read().br().to_bits()
    }
}

pub use chip::{CHIP, INTERRUPT, WATCHDOG, Watchdog, start};
