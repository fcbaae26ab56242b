//! What both boards have of clocks, bus and watchdog, from the figures of [`hysteron_firmware::chips`].

use crate::Dac;
#[cfg(not(feature = "two-axes"))]
use crate::flash::Memory;
use crate::image::AXES;
use embassy_stm32::adc::{Adc, AdcChannel, AnyAdcChannel};
use embassy_stm32::gpio::OutputType;
use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::interrupt::Interrupt;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::{Config, Peri, pac, peripherals, timer};
use hysteron_converters::ad5683r::{self, Ad5683r};
use hysteron_converters::ad5683r::{CLOCK_PHASE, CLOCK_POLARITY};
use hysteron_core::codes::DacCode;
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
    pub timer: Timer<'static, peripherals::TIM3>,
    /// The cable, where its PHY gives a clock.
    #[cfg(feature = "h743zi")]
    pub link: Option<crate::ethernet::Link>,
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

/// SPI1 with the pins of SCLK, SDI and the converters' SDO.
type Bus<Sdi> = (
    Peri<'static, peripherals::SPI1>,
    Peri<'static, peripherals::PA5>,
    Peri<'static, Sdi>,
    Peri<'static, peripherals::PA6>,
);

/// The outputs, after their converters were asked what they hold.
fn outputs(
    (mut spi, mut sclk, mut sdi, mut sdo): Bus<impl spi::MosiPin<peripherals::SPI1>>,
    mut syncs: [Output<'static>; AXES],
    fault: Output<'static>,
    clock: Clock,
) -> Outputs {
    let mut ask = |pull| {
        let mut config = bus_config(clock);
        config.frequency = Hertz(clock.bus_hz() / READ_SLOWER);
        config.miso_pull = pull;
        let (sclk, sdi, sdo) = (sclk.reborrow(), sdi.reborrow(), sdo.reborrow());
        let mut bus = Spi::new_blocking(spi.reborrow(), sclk, sdi, sdo, config);
        ad5683r::held(&mut bus, &mut syncs).ok()
    };
    // Whichever way their line is pulled, converters that are connected answer alike.
    let (up, down) = (ask(Pull::Up), ask(Pull::Down));
    Outputs {
        held: up.filter(|_| up == down),
        dac: Ad5683r::new(Spi::new_blocking_txonly(spi, sclk, sdi, bus_config(clock)), syncs),
        fault,
    }
}

/// The sample clock, with its first channel on LDAC's pin. Nothing drives that pin before: it is pulled low, and words count at once.
fn sample_clock(
    timer: Peri<'static, peripherals::TIM3>,
    ldac: Peri<'static, peripherals::PB4>,
) -> Timer<'static, peripherals::TIM3> {
    let timer = Timer::new(timer);
    // One that is dropped lets go of its pin.
    core::mem::forget(PwmPin::<peripherals::TIM3, timer::Ch1>::new(ldac, OutputType::PushPull));
    timer
}

/// Whether the registers that embassy works out by itself hold what `chips` says; names the first that does not. Those of the watchdog
/// read as set only once it runs (RM0433 and RM0440, IWDG_SR).
fn check(rcc: &Peri<'static, peripherals::RCC>, timer: &Timer<'static, peripherals::TIM3>) -> Result<(), &'static str> {
    let processor = embassy_stm32::rcc::clocks(rcc).sys.to_hertz();
    let held = [
        ("processor clock", processor == Some(Hertz(CHIP.processor_hz()))),
        ("clock of TIM3", timer.get_clock_frequency() == Hertz(CHIP.timer_hz())),
        ("prescaler of the ADC", chip::adc_presc() == CHIP.adc_presc()),
        ("divider of SPI1", chip::spi_field() == CHIP.spi_field()),
    ];
    held.iter()
        .find(|(_, held)| !held)
        .map_or(Ok(()), |(name, _)| Err(*name))
}

#[cfg(all(feature = "g474re", feature = "two-axes"))]
compile_error!(
    "two-axes is for h743zi: a tick of both axes takes up to 2720 instructions, at two cycles each 5440 of the 3400 that g474re has"
);

#[cfg(feature = "g474re")]
mod g474re;
#[cfg(feature = "h743zi")]
mod h743zi;
#[cfg(feature = "g474re")]
use g474re as chip;
#[cfg(feature = "h743zi")]
use h743zi as chip;

#[cfg(not(feature = "two-axes"))]
pub use chip::has_two_banks;
pub use chip::{CHIP, INTERRUPT, cause, forget_cause, resets_below_its_converters, start, supplied};
