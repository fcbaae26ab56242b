//! ADC1 on the trigger of TIM6: the registers beyond what embassy sets, which starts conversions by software only.

use crate::board::CHIP;
use embassy_stm32::pac::adc::vals::{Exten, Ovrmod};
use embassy_stm32::pac::timer::vals::Mms;
use embassy_stm32::pac::{ADC1, TIM6};
use embassy_stm32::peripherals;
use embassy_stm32::timer::low_level::Timer;
use hysteron_firmware::chips::TIM6_TRIGGER;

/// One channel on each trigger, an interrupt at the end of its conversion, and the timer that triggers, by its PSC and ARR.
pub fn start(timer: &Timer<'static, peripherals::TIM6>, (prescaler, reload): (u16, u16)) {
    // One conversion (L = 0) of the sensor's channel.
    ADC1.sqr1().modify(|w| {
        w.set_l(0);
        w.set_sq(0, CHIP.adc_channel);
    });
    ADC1.cfgr().modify(|w| {
        w.set_exten(Exten::RISING_EDGE);
        w.set_extsel(TIM6_TRIGGER);
        // A conversion that nobody read is overwritten: the newest counts.
        w.set_ovrmod(Ovrmod::OVERWRITE);
    });
    ADC1.ier().modify(|w| w.set_eocie(true));
    TIM6.psc().write_value(prescaler);
    TIM6.arr().write(|w| w.set_arr(reload));
    // PSC counts from an update on (RM0433 and RM0440, TIMx_PSC).
    timer.generate_update_event();
    TIM6.cr2().modify(|w| w.set_mms(Mms::UPDATE));
    // SAFETY: the handler is there, and what it needs has been written.
    unsafe { cortex_m::peripheral::NVIC::unmask(crate::board::INTERRUPT) };
    ADC1.cr().modify(|w| w.set_adstart(true));
    timer.start();
}

/// The code of the last conversion, 16 bits; reading it clears the interrupt.
#[inline(always)]
pub fn code() -> u16 {
    (ADC1.dr().read().0 as u16) << CHIP.to_16_bits()
}

/// Whether another conversion has ended since [`code`].
#[inline(always)]
pub fn pending() -> bool {
    ADC1.isr().read().eoc()
}
