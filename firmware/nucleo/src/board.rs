//! Clocks and pins of the two boards, from the figures of [`hysteron_firmware::chips`].

use crate::Dac;
use crate::ad5683r::{self, Ad5683r};
#[cfg(not(feature = "two-axes"))]
use crate::flash::Memory;
use crate::image::AXES;
use embassy_stm32::adc::{Adc, AdcChannel, AnyAdcChannel};
use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::interrupt::Interrupt;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::{Config, Peri, pac, peripherals};
use hysteron_core::codes::DacCode;
use hysteron_firmware::ad5683r::{CLOCK_PHASE, CLOCK_POLARITY};
#[cfg(not(feature = "two-axes"))]
use hysteron_firmware::chips::WATCHDOG_FLASH_US;
use hysteron_firmware::chips::{Chip, WATCHDOG_START_US, WATCHDOG_US, smp_place, watchdog};
use hysteron_firmware::start::Cause;
#[cfg(not(feature = "two-axes"))]
use hysteron_slot::Slots;

/// What the chip runs on.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// The PLL, as [`CHIP`] says.
    Pll,
    /// The oscillator that a reset starts by itself: for the way down, where nothing else has come.
    Internal,
}

impl Clock {
    /// What the processor counts.
    pub fn processor_hz(self) -> u32 {
        match self {
            Self::Pll => CHIP.processor_hz(),
            Self::Internal => CHIP.internal_hz,
        }
    }

    /// The DAC's bus, whose divider is the same on either.
    fn bus_hz(self) -> u32 {
        match self {
            Self::Pll => CHIP.bus_hz(),
            Self::Internal => CHIP.internal_hz / CHIP.spi_divider,
        }
    }
}

/// What main has of the board first.
pub struct Outputs {
    pub dac: Dac,
    pub fault: Output<'static>,
    /// What the converters say they hold; nothing where their SDO is not connected.
    pub held: Option<[DacCode; AXES]>,
}

/// What it has once the outputs are safe.
pub struct Parts {
    pub button: Input<'static>,
    pub timer: Timer<'static, peripherals::TIM6>,
    /// Where tables lie in flash, if they may be written there.
    #[cfg(not(feature = "two-axes"))]
    pub slots: Option<Slots<Memory>>,
}

/// Looks at the ST-LINK's clock: 2 ms and more at 64 MHz, of a signal that is there from power-on or not at all.
#[cfg(feature = "h743zi")]
const CLOCK_LOOKS: u32 = 50_000;
/// Looks at the PLL, at 64 MHz 300 us and more: it locks within 150 us (DS12110 and DS12288, PLL characteristics).
const PLL_LOOKS: u32 = 10_000;
/// Looks at the watchdog's registers, which take five of its clocks (RM0433 and RM0440, IWDG_SR): 160 us, at 64 MHz 10 000 cycles.
const WATCHDOG_LOOKS: u32 = 10_000;

/// Starts the watchdog, with the time that a start may take.
pub fn guard_the_start() {
    chip::WATCHDOG.kr().write(|w| w.set_key(Key::START));
    guard(WATCHDOG_START_US);
}

/// While a slot is written: a sector of the STM32H743 takes up to 4 s to erase (DS12110, "Flash memory programming").
#[cfg(not(feature = "two-axes"))]
pub fn guard_the_flash() {
    guard(WATCHDOG_FLASH_US);
}

/// From here on it is the loop that must go on.
pub fn guard_the_loop() {
    guard(WATCHDOG_US);
}

fn guard(timeout_us: u32) {
    let (prescaler, reload) = watchdog(timeout_us);
    let registers = chip::WATCHDOG;
    registers.kr().write(|w| w.set_key(Key::ENABLE));
    registers.pr().write(|w| w.set_pr(Pr::from_bits(prescaler)));
    registers.rlr().write(|w| w.set_rl(reload));
    // Where its clock does not run, nothing of this is taken over, and there is no watchdog: no reason to wait for one.
    for _ in 0..WATCHDOG_LOOKS {
        if registers.sr().read().0 == 0 {
            break;
        }
    }
    feed();
}

/// Starts the watchdog's count anew.
#[inline(always)]
pub fn feed() {
    chip::WATCHDOG.kr().write(|w| w.set_key(Key::RESET));
}

/// Mode of the DAC's bus.
const MODE: spi::Mode = spi::MODE_1;
const _: () = assert!(matches!(MODE.polarity, spi::Polarity::IdleHigh) == CLOCK_POLARITY);
const _: () = assert!(matches!(MODE.phase, spi::Phase::CaptureOnSecondTransition) == CLOCK_PHASE);

fn bus_config(clock: Clock) -> spi::Config {
    let mut config = spi::Config::default();
    config.mode = MODE;
    config.frequency = Hertz(clock.bus_hz());
    config
}

/// Converters are read by a bus so much slower than the one that writes them.
const READ_SLOWER: u32 = 32;
/// Whichever way the line of the answers is pulled, converters that are connected answer alike.
const PULLS: [Pull; 2] = [Pull::Up, Pull::Down];

fn reading_config(clock: Clock, pull: Pull) -> spi::Config {
    let mut config = bus_config(clock);
    config.frequency = Hertz(clock.bus_hz() / READ_SLOWER);
    config.miso_pull = pull;
    config
}

/// What was answered under each of [`PULLS`], where that is the same.
fn alike<E>([up, down]: [Result<[DacCode; AXES], E>; 2]) -> Option<[DacCode; AXES]> {
    let (up, down) = (up.ok()?, down.ok()?);
    (up == down).then_some(up)
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
        // Its dividers are set while it is off.
        registers.cr().modify(|w| w.set_pllon(0, false));
        locks
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
        timer: Peri<'static, peripherals::TIM6>,
        button: Input<'static>,
        adc: Peri<'static, peripherals::ADC1>,
        sensor: Peri<'static, peripherals::PA3>,
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
        let mut syncs = [
            Output::new(p.PD14, Level::High, Speed::VeryHigh),
            #[cfg(feature = "two-axes")]
            Output::new(p.PD15, Level::High, Speed::VeryHigh),
        ];
        let (mut spi, mut sck, mut mosi, mut miso) = (p.SPI1, p.PA5, p.PB5, p.PA6);
        let held = alike(PULLS.map(|pull| {
            let (sck, mosi, miso) = (sck.reborrow(), mosi.reborrow(), miso.reborrow());
            let mut bus = Spi::new_blocking(spi.reborrow(), sck, mosi, miso, reading_config(clock, pull));
            ad5683r::held(&mut bus, &mut syncs)
        }));
        let bus = Spi::new_blocking_txonly(spi, sck, mosi, bus_config(clock));
        let outputs = Outputs {
            held,
            dac: Ad5683r::new(bus, syncs),
            fault: Output::new(p.PB14, Level::Low, Speed::Low),
        };
        let rest = Rest {
            clock,
            rcc: p.RCC,
            #[cfg(not(feature = "two-axes"))]
            flash: p.FLASH,
            timer: p.TIM6,
            button: Input::new(p.PC13, Pull::Down),
            adc: p.ADC1,
            sensor: p.PA3,
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
            let timer = Timer::new(self.timer);
            check(&self.rcc, &timer)?;
            Ok(Parts {
                button: self.button,
                timer,
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
}

#[cfg(all(feature = "g474re", feature = "two-axes"))]
compile_error!(
    "two-axes is for h743zi: a tick of both axes takes up to 2720 instructions, at two cycles each 5440 of the 3400 that g474re has"
);

#[cfg(feature = "g474re")]
mod chip {
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

    /// As the other board's.
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
        timer: Peri<'static, peripherals::TIM6>,
        button: Input<'static>,
        adc: Peri<'static, peripherals::ADC1>,
        sensor: Peri<'static, peripherals::PA0>,
    }

    /// As the other board's; it has no clock from outside.
    pub fn start() -> (Outputs, Rest) {
        let clock = if locks() { Clock::Pll } else { Clock::Internal };
        let p = embassy_stm32::init(config(clock));
        pac::PWR.cr2().modify(|w| {
            w.set_pls(SUPPLY);
            w.set_pvde(true);
        });
        let mut syncs = [Output::new(p.PB6, Level::High, Speed::VeryHigh)];
        let (mut spi, mut sck, mut mosi, mut miso) = (p.SPI1, p.PA5, p.PA7, p.PA6);
        let held = alike(PULLS.map(|pull| {
            let (sck, mosi, miso) = (sck.reborrow(), mosi.reborrow(), miso.reborrow());
            let mut bus = Spi::new_blocking(spi.reborrow(), sck, mosi, miso, reading_config(clock, pull));
            ad5683r::held(&mut bus, &mut syncs)
        }));
        let bus = Spi::new_blocking_txonly(spi, sck, mosi, bus_config(clock));
        let outputs = Outputs {
            held,
            dac: Ad5683r::new(bus, syncs),
            fault: Output::new(p.PC7, Level::Low, Speed::Low),
        };
        let rest = Rest {
            clock,
            rcc: p.RCC,
            #[cfg(not(feature = "two-axes"))]
            flash: p.FLASH,
            timer: p.TIM6,
            button: Input::new(p.PC13, Pull::Down),
            adc: p.ADC1,
            sensor: p.PA0,
        };
        (outputs, rest)
    }

    impl Rest {
        /// As the other board's.
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
            let timer = Timer::new(self.timer);
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
}

#[cfg(not(feature = "two-axes"))]
pub use chip::has_two_banks;
pub use chip::{CHIP, INTERRUPT, cause, forget_cause, resets_below_its_converters, start, supplied};
