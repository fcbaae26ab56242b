//! Clocks and pins of nucleo-g474re.

use super::*;
use embassy_stm32::rcc;

pub const INTERRUPT: Interrupt = Interrupt::ADC1_2;
pub const CHIP: Chip = hysteron_firmware::chips::G474;
pub const WATCHDOG: pac::iwdg::Iwdg = pac::IWDG;
/// PLS of PWR_CR2: 2.9 V, the highest (RM0440).
const SUPPLY: u8 = 0b110;
/// BOR_LEV of FLASH_OPTR, bits 8 to 10: 2.8 V, the highest (RM0440, "Flash option register").
const BROWN_OUT: u32 = 0b100;

// What `config` leaves at its reset value.
const _: () = assert!(CHIP.ahb_divider == 1 && CHIP.apb_divider == 1 && CHIP.pll_system == 2);

// PLLM is one less than M, PLLN is N (RM0440, RCC_PLLCFGR).
const PLLM: rcc::PllPreDiv = rcc::PllPreDiv::from_bits(CHIP.pll_m as u8 - 1);
const PLLN: rcc::PllMul = rcc::PllMul::from_bits(CHIP.pll_n as u8);

/// Whether the PLL comes to its frequency; embassy would wait for it.
fn locks() -> bool {
    let registers = pac::RCC;
    registers.pllcfgr().modify(|w| {
        w.set_pllsrc(pac::rcc::vals::Pllsrc::HSI);
        w.set_pllm(PLLM);
        w.set_plln(PLLN);
    });
    registers.cr().modify(|w| w.set_pllon(true));
    let locks = (0..PLL_LOOKS).any(|_| registers.cr().read().pllrdy());
    registers.cr().modify(|w| w.set_pllon(false));
    locks
}

/// From the 16 MHz oscillator, or that itself.
fn config(clock: Clock) -> Config {
    let mut config = Config::default();
    config.rcc.hsi = true;
    if clock == Clock::Internal {
        return config;
    }
    config.rcc.pll = Some(rcc::Pll {
        source: rcc::PllSource::HSI,
        prediv: PLLM,
        mul: PLLN,
        divp: None,
        divq: None,
        divr: Some(rcc::PllRDiv::DIV2),
    });
    config.rcc.sys = rcc::Sysclk::PLL1_R;
    config.rcc.boost = true;
    config.rcc.mux.adc12sel = rcc::mux::Adcsel::SYS;
    config
}

/// What the last reset came from.
pub fn cause() -> Cause {
    let reset = pac::RCC.csr().read();
    Cause {
        power: reset.borrstf(),
        watchdog: reset.iwdgrstf(),
    }
}

/// DBANK of FLASH_OPTR, as the chip is delivered: a bank can be read while the other one is written (RM0440, "Read-while-write").
pub fn has_two_banks() -> bool {
    pac::FLASH.optr().read().dbank()
}

/// Forgets it.
pub fn forget_cause() {
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
}

/// Whether the supply is above [`SUPPLY`].
#[inline(always)]
pub fn supplied() -> bool {
    !pac::PWR.sr2().read().pvdo()
}

/// Whether the chip resets before the converters lose what they hold.
pub fn resets_below_its_converters() -> bool {
    (pac::FLASH.optr().read().0 >> 8) & 0b111 == BROWN_OUT
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
    sensor: Peri<'static, peripherals::PA0>,
}

/// Clocks, supervision of the supply, and the way to the outputs. What embassy waits for here has been there, or the watchdog bounds it.
pub fn start() -> (Outputs, Rest) {
    let clock = if locks() { Clock::Pll } else { Clock::Internal };
    let p = embassy_stm32::init(config(clock));
    pac::PWR.cr2().modify(|w| {
        w.set_pls(SUPPLY);
        w.set_pvde(true);
    });
    let syncs = [Output::new(p.PB6, Level::High, Speed::VeryHigh)];
    let fault = Output::new(p.PC7, Level::Low, Speed::Low);
    let outputs = outputs((p.SPI1, p.PA5, p.PA7, p.PA6), syncs, fault, clock);
    let rest = Rest {
        clock,
        rcc: p.RCC,
        #[cfg(not(feature = "two-axes"))]
        flash: p.FLASH,
        timer: p.TIM3,
        ldac: p.PB4,
        button: Input::new(p.PC13, Pull::Down),
        adc: p.ADC1,
        sensor: p.PA0,
    };
    (outputs, rest)
}

impl Rest {
    /// The sensor's converter and the timer.
    ///
    /// # Errors
    /// The first register that is not what `chips` says.
    pub fn start(self) -> Result<Parts, &'static str> {
        if self.clock == Clock::Internal {
            return Err("the PLL");
        }
        core::mem::forget(Adc::new(self.adc, Default::default()));
        let _pin: AnyAdcChannel<'_, peripherals::ADC1> = self.sensor.degrade_adc();
        let (register, place) = smp_place(CHIP.adc_channel);
        let time = pac::adc::vals::SampleTime::from_bits(CHIP.smp);
        if register == 0 {
            pac::ADC1.smpr().modify(|w| w.set_smp(place, time));
        } else {
            pac::ADC1.smpr2().modify(|w| w.set_smp(place, time));
        }
        let timer = sample_clock(self.timer, self.ldac);
        check(&self.rcc, &timer)?;
        Ok(Parts {
            button: self.button,
            timer,
            #[cfg(not(feature = "two-axes"))]
            slots: crate::flash::slots(self.flash),
        })
    }
}

pub fn adc_presc() -> u8 {
    pac::ADC12_COMMON.ccr().read().presc().to_bits()
}

pub fn spi_field() -> u8 {
    pac::SPI1.cr1().read().br().to_bits()
}
