//! ADC1 on the trigger of TIM3, whose first channel is the DACs' LDAC, and ADC2 with it where there are two axes: the registers beyond what embassy sets, which starts
//! conversions by software only.

use crate::board::CHIP;
use crate::image::AXES;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::{Exten, Ovrmod};
use embassy_stm32::pac::timer::vals::Mms;
use embassy_stm32::pac::{ADC1, TIM3};
#[cfg(feature = "two-axes")]
use embassy_stm32::pac::{ADC2, ADC12_COMMON, adccommon::vals::Dual};
use embassy_stm32::peripherals;
use embassy_stm32::timer::Channel;
use embassy_stm32::timer::low_level::{OutputCompareMode, Timer};
use hysteron_firmware::chips::TIM3_TRIGGER;

/// What the timer counts.
#[derive(Clone, Copy)]
pub struct Times {
    /// Its PSC and ARR: a period.
    pub clock: (u16, u16),
    /// Its CCR1: from a trigger to the fall of LDAC.
    pub latch: u16,
}

impl Times {
    /// Of a sample rate and a number of laws.
    pub fn new(sample_rate_hz: f32, complete: bool) -> Option<Self> {
        let clock = CHIP.sample_clock(sample_rate_hz)?;
        let latch = CHIP.latch(clock, CHIP.latch_ns(AXES, complete)?)?;
        Some(Self { clock, latch })
    }
}

/// One channel on each trigger, an interrupt at the end of its conversion, and the timer that triggers and latches.
pub fn start(timer: &Timer<'static, peripherals::TIM3>, times: Times) {
    let (prescaler, reload) = times.clock;
    #[cfg(feature = "two-axes")]
    couple();
    one_conversion(ADC1, CHIP.adc_channel);
    #[cfg(feature = "two-axes")]
    one_conversion(ADC2, const { CHIP.adc_channel_y.expect("a second channel") });
    ADC1.cfgr().modify(|w| {
        w.set_exten(Exten::RISING_EDGE);
        w.set_extsel(TIM3_TRIGGER);
    });
    ADC1.ier().modify(|w| w.set_eocie(true));
    TIM3.psc().write_value(prescaler);
    TIM3.arr().write(|w| w.set_arr(reload));
    // LDAC is high below CCR1, and falls there (RM0433 and RM0440, "PWM mode", mode 1).
    timer.set_compare_value(Channel::Ch1, times.latch);
    timer.set_output_compare_mode(Channel::Ch1, OutputCompareMode::PwmMode1);
    timer.enable_channel(Channel::Ch1, true);
    // PSC counts from an update on (RM0433 and RM0440, TIMx_PSC).
    timer.generate_update_event();
    TIM3.cr2().modify(|w| w.set_mms(Mms::UPDATE));
    // SAFETY: the handler is there, and what it needs has been written.
    unsafe { cortex_m::peripheral::NVIC::unmask(crate::board::INTERRUPT) };
    ADC1.cr().modify(|w| w.set_adstart(true));
    timer.start();
}

/// One (L = 0) of a sensor's channel a trigger.
fn one_conversion(adc: Adc, channel: u8) {
    adc.sqr1().modify(|w| {
        w.set_l(0);
        w.set_sq(0, channel);
    });
    // A conversion that nobody read is overwritten: the newest counts.
    adc.cfgr().modify(|w| w.set_ovrmod(Ovrmod::OVERWRITE));
}

/// ADC2 samples when ADC1 does, whose trigger is both's ("Dual ADC modes", RM0433: regular simultaneous). DUAL is written while both are
/// disabled; a calibration stays. The watchdog ends both waits: the loop's 2 ms count already.
#[cfg(feature = "two-axes")]
fn couple() {
    for adc in [ADC1, ADC2] {
        adc.cr().modify(|w| w.set_addis(true));
        while adc.cr().read().aden() {}
    }
    ADC12_COMMON.ccr().modify(|w| w.set_dual(Dual::DUAL_R));
    for adc in [ADC1, ADC2] {
        adc.isr().write(|w| w.set_adrdy(true));
        adc.cr().modify(|w| w.set_aden(true));
        while !adc.isr().read().adrdy() {}
    }
}

/// The converters of the axes, the one that interrupts first. Both take as long.
#[cfg(not(feature = "two-axes"))]
const CONVERTERS: [Adc; AXES] = [ADC1];
#[cfg(feature = "two-axes")]
const CONVERTERS: [Adc; AXES] = [ADC1, ADC2];

/// The codes of the last conversions, 16 bits; reading the first clears the interrupt.
#[inline(always)]
pub fn codes() -> [u16; AXES] {
    CONVERTERS.map(|adc| (adc.dr().read().0 as u16) << CHIP.to_16_bits())
}

/// Whether LDAC has fallen since this period's trigger.
#[inline(always)]
pub fn latched() -> bool {
    TIM3.cnt().read().cnt() >= TIM3.ccr(0).read().ccr()
}

/// Whether another conversion has ended since [`codes`].
#[inline(always)]
pub fn pending() -> bool {
    ADC1.isr().read().eoc()
}
