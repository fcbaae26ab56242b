//! Clocks and pins of nucleo-h743zi.

use super::*;
use crate::ethernet::{Link, Pins};
use embassy_stm32::pac::adc::vals::Pcsel;
use embassy_stm32::pac::rcc::vals::{Pllrge, Pllvcosel};
use embassy_stm32::rcc;

pub const INTERRUPT: Interrupt = Interrupt::ADC;
pub const CHIP: Chip = hysteron_firmware::chips::H743;
pub const WATCHDOG: pac::iwdg::Iwdg = pac::IWDG1;
/// PLS of PWR_CR1: 2.85 V, the highest (RM0433).
const SUPPLY: u8 = 0b110;
/// BOR_LEV of FLASH_OPTSR_CUR: 2.7 V, the highest (RM0433, "FLASH option status register").
const BROWN_OUT: u8 = 0b11;

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

/// Whether the ST-LINK's clock is there; embassy would wait for it.
fn is_clocked() -> bool {
    pac::RCC.cr().modify(|w| w.set_hsebyp(true));
    pac::RCC.cr().modify(|w| w.set_hseon(true));
    (0..CLOCK_LOOKS).any(|_| pac::RCC.cr().read().hserdy())
}

// DIVM1 is M, DIVN1, DIVP1 and DIVQ1 are one less than N, P and Q (RM0433, RCC_PLLCKSELR and RCC_PLL1DIVR).
const DIVM1: rcc::PllPreDiv = rcc::PllPreDiv::from_bits(CHIP.pll_m as u8);
const DIVN1: rcc::PllMul = rcc::PllMul::from_bits(CHIP.pll_n as u16 - 1);
// What `locks` says of the phase detector's frequency.
const _: () = assert!(CHIP.pll_input_hz() >= 4_000_000 && CHIP.pll_input_hz() < 8_000_000);

/// Whether the PLL comes to its frequency; embassy would wait for it.
fn locks() -> bool {
    let registers = pac::RCC;
    registers.pllckselr().modify(|w| {
        w.set_divm(0, DIVM1);
        w.set_pllsrc(rcc::PllSource::HSE);
    });
    registers.pllcfgr().modify(|w| {
        w.set_pllvcosel(0, Pllvcosel::WIDE_VCO);
        w.set_pllrge(0, Pllrge::RANGE4);
    });
    registers.plldivr(0).modify(|w| w.set_plln(DIVN1));
    registers.cr().modify(|w| w.set_pllon(0, true));
    let locks = (0..PLL_LOOKS).any(|_| registers.cr().read().pllrdy(0));
    // Its dividers are set while it is off, which embassy takes for granted.
    registers.cr().modify(|w| w.set_pllon(0, false));
    locks && (0..PLL_LOOKS).any(|_| !registers.cr().read().pllrdy(0))
}

/// From the ST-LINK's 8 MHz, which every revision of the chip takes, or from the internal oscillator; the ADC from the latter.
fn config(clock: Clock) -> Config {
    let mut config = Config::default();
    config.rcc.voltage_scale = rcc::VoltageScale::Scale1;
    config.rcc.mux.adcsel = rcc::mux::Adcsel::PER;
    if clock == Clock::Internal {
        config.rcc.mux.spi123sel = rcc::mux::Saisel::PER;
        return config;
    }
    config.rcc.hse = Some(rcc::Hse {
        freq: Hertz(CHIP.oscillator_hz),
        mode: rcc::HseMode::Bypass,
    });
    config.rcc.pll1 = Some(rcc::Pll {
        source: rcc::PllSource::HSE,
        prediv: DIVM1,
        mul: DIVN1,
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
    config
}

/// What the last reset came from.
pub fn cause() -> Cause {
    let reset = pac::RCC.rsr().read();
    Cause {
        power: reset.porrstf() || reset.borrstf(),
        watchdog: reset.iwdg1rstf(),
    }
}

/// Two of 1 MB: one can be read while the other is written (RM0433, "Read-while-write").
#[cfg(not(feature = "two-axes"))]
pub fn has_two_banks() -> bool {
    true
}

/// Forgets it.
pub fn forget_cause() {
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
}

/// Whether the supply is above [`SUPPLY`].
#[inline(always)]
pub fn supplied() -> bool {
    !pac::PWR.csr1().read().pvdo()
}

/// Whether the chip resets before the converters lose what they hold.
pub fn resets_below_its_converters() -> bool {
    pac::FLASH.optsr_cur().read().bor_lev() == BROWN_OUT
}

/// What is left to start once the outputs are safe.
pub struct Rest {
    pub clock: Clock,
    rcc: Peri<'static, peripherals::RCC>,
    #[cfg(not(feature = "two-axes"))]
    flash: Peri<'static, peripherals::FLASH>,
    timer: Peri<'static, peripherals::TIM3>,
    ldac: Peri<'static, peripherals::PB4>,
    button: Input<'static>,
    adc: Peri<'static, peripherals::ADC1>,
    sensor: Peri<'static, peripherals::PA3>,
    cable: Pins,
    #[cfg(feature = "two-axes")]
    of_y: (Peri<'static, peripherals::ADC2>, Peri<'static, peripherals::PC0>),
}

/// Clocks, supervision of the supply, and the way to the outputs. What embassy waits for here has been there, or the watchdog bounds it.
pub fn start() -> (Outputs, Rest) {
    let clock = if is_clocked() && locks() {
        Clock::Pll
    } else {
        Clock::Internal
    };
    let p = embassy_stm32::init(config(clock));
    pac::PWR.cr1().modify(|w| {
        w.set_pls(SUPPLY);
        w.set_pvde(true);
    });
    let syncs = [
        Output::new(p.PD14, Level::High, Speed::VeryHigh),
        #[cfg(feature = "two-axes")]
        Output::new(p.PD15, Level::High, Speed::VeryHigh),
    ];
    let fault = Output::new(p.PB14, Level::Low, Speed::Low);
    let outputs = outputs((p.SPI1, p.PA5, p.PB5, p.PA6), syncs, fault, clock);
    let rest = Rest {
        clock,
        rcc: p.RCC,
        #[cfg(not(feature = "two-axes"))]
        flash: p.FLASH,
        timer: p.TIM3,
        ldac: p.PB4,
        button: Input::new(p.PC13, Pull::Down),
        adc: p.ADC1,
        sensor: p.PA3,
        cable: Pins {
            mac: p.ETH,
            station: p.ETH_SMA,
            clock: p.PA1,
            mdio: p.PA2,
            mdc: p.PC1,
            carrier: p.PA7,
            rx: (p.PC4, p.PC5),
            tx: (p.PG13, p.PB13),
            enable: p.PG11,
        },
        #[cfg(feature = "two-axes")]
        of_y: (p.ADC2, p.PC0),
    };
    (outputs, rest)
}

impl Rest {
    /// The sensors' converters and the timer.
    ///
    /// # Errors
    /// The first register that is not what `chips` says.
    pub fn start(self) -> Result<Parts, &'static str> {
        if self.clock == Clock::Internal {
            return Err("the clock of the ST-LINK or the PLL");
        }
        // Set up and calibrated by embassy; what it leaves to software conversions is set in `converter`.
        core::mem::forget(Adc::new(self.adc));
        let _pin: AnyAdcChannel<'_, peripherals::ADC1> = self.sensor.degrade_adc();
        sample(pac::ADC1, CHIP.adc_channel);
        #[cfg(feature = "two-axes")]
        {
            let (adc, sensor) = self.of_y;
            core::mem::forget(Adc::new(adc));
            let _pin: AnyAdcChannel<'_, peripherals::ADC2> = sensor.degrade_adc();
            sample(pac::ADC2, const { CHIP.adc_channel_y.expect("a second channel") });
        }
        let timer = sample_clock(self.timer, self.ldac);
        check(&self.rcc, &timer)?;
        Ok(Parts {
            button: self.button,
            timer,
            link: Link::start(self.cable),
            #[cfg(not(feature = "two-axes"))]
            slots: crate::flash::slots(self.flash),
        })
    }
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
