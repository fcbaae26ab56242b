//! The law of a controller for hosts that call C: load, reset, step, free.
//!
//! The law is the core's in `f32`, as on the chip. `include/hysteron.h` is made from this file by cbindgen; the tests hold the two
//! together, and call the library from C and from Python.
#![expect(unsafe_code, reason = "a C interface takes pointers")]

use hysteron_control::design::Controller;
use hysteron_core::surroundings::{DesignedLaw, DesignedState, LoopInput};
use hysteron_table::Table;
use std::ffi::{CStr, c_char};
use std::path::Path;

/// A law with its state. Two threads must not use one at a time.
pub struct HysteronLaw {
    law: DesignedLaw<f32>,
    state: DesignedState<f32>,
    sample_rate_hz: f64,
}

/// What a law takes in at every sample. What the controller has no use for may be anything, 0 for instance.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct HysteronInput {
    /// Reference, micrometres, `hysteron_samples_ahead` samples before it is due.
    pub reference_um: f32,
    /// Reading of the sensor, micrometres.
    pub measured_um: f32,
    /// Command of the other axis, volts, as early as the reference.
    pub voltage2_v: f32,
    /// Motion of the other axis, micrometres, as early as the reference.
    pub motion2_um: f32,
    /// Temperature of the stage, degrees Celsius.
    pub temperature_c: f32,
}

/// Loads a `controller.toml`, or a table with a complete law. The law rests at 0 V and 0 degrees Celsius.
///
/// Gives NULL where the file is none or cannot be read; `message` then has the reason, cut to `size` bytes with its closing zero.
/// `message` may be NULL. What is loaded is freed by `hysteron_free`.
///
/// # Safety
/// `path` points to a string that ends in zero, in UTF-8. `message` is NULL or has room for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hysteron_load(path: *const c_char, message: *mut c_char, size: usize) -> *mut HysteronLaw {
    let loaded = if path.is_null() {
        Err("path is NULL; give the path of a controller.toml".to_owned())
    } else {
        // SAFETY: the caller gives a string that ends in zero.
        let path = unsafe { CStr::from_ptr(path) };
        match path.to_str() {
            Ok(path) => load(Path::new(path)),
            Err(error) => Err(format!("path: {error}; give it in UTF-8")),
        }
    };
    match loaded {
        Ok(law) => Box::into_raw(Box::new(law)),
        Err(reason) => {
            if !message.is_null() && size > 0 {
                let kept = cut(&reason, size - 1);
                // SAFETY: the caller gives room for `size` bytes; `kept` has fewer, and its zero follows.
                unsafe {
                    std::ptr::copy_nonoverlapping(kept.as_ptr(), message.cast(), kept.len());
                    message.add(kept.len()).write(0);
                }
            }
            std::ptr::null_mut()
        }
    }
}

/// Frees a law. NULL is let be.
///
/// # Safety
/// `law` is NULL or comes from `hysteron_load`, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hysteron_free(law: *mut HysteronLaw) {
    if !law.is_null() {
        // SAFETY: made by `Box::into_raw` in `hysteron_load`, and given back once.
        drop(unsafe { Box::from_raw(law) });
    }
}

/// Brings a law back to rest at 0 V, at a temperature of the stage. NULL is let be.
///
/// # Safety
/// `law` is NULL or comes from `hysteron_load`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hysteron_reset(law: *mut HysteronLaw, temperature_c: f32) {
    // SAFETY: NULL, or a law that nobody else uses meanwhile.
    if let Some(law) = unsafe { law.as_mut() } {
        law.state = law.law.rest(temperature_c);
    }
}

/// Takes in a sample, and gives the command, volts at the actuator. It is finite, whatever comes in; of NULL it is 0.
///
/// # Safety
/// `law` is NULL or comes from `hysteron_load`; `input` is NULL or points to an input.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hysteron_step(law: *mut HysteronLaw, input: *const HysteronInput) -> f32 {
    // SAFETY: NULL, or a law that nobody else uses meanwhile, and an input.
    let (Some(law), Some(input)) = (unsafe { law.as_mut() }, unsafe { input.as_ref() }) else {
        return 0.0;
    };
    law.law.step(
        &mut law.state,
        LoopInput {
            reference_ahead: input.reference_um,
            measured: input.measured_um,
            voltage2_ahead: input.voltage2_v,
            motion2_ahead: input.motion2_um,
            temperature_c: input.temperature_c,
        },
    )
}

/// The reference that is due now, micrometres: what the position is compared with. Of NULL it is 0.
///
/// # Safety
/// `law` is NULL or comes from `hysteron_load`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hysteron_due_um(law: *const HysteronLaw) -> f32 {
    // SAFETY: NULL, or a law that nobody else uses meanwhile.
    unsafe { law.as_ref() }.map_or(0.0, |law| law.state.due())
}

/// Whether the last command met a limit.
///
/// # Safety
/// `law` is NULL or comes from `hysteron_load`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hysteron_limited(law: *const HysteronLaw) -> bool {
    // SAFETY: NULL, or a law that nobody else uses meanwhile.
    unsafe { law.as_ref() }.is_some_and(|law| law.state.limited())
}

/// Samples that the reference comes before it is due. Of NULL it is 0.
///
/// # Safety
/// `law` is NULL or comes from `hysteron_load`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hysteron_samples_ahead(law: *const HysteronLaw) -> usize {
    // SAFETY: NULL, or a law that nobody else uses meanwhile.
    unsafe { law.as_ref() }.map_or(0, |law| law.law.ahead())
}

/// Sample rate that `hysteron_step` is to be called at, hertz. Of NULL it is 0.
///
/// # Safety
/// `law` is NULL or comes from `hysteron_load`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hysteron_sample_rate_hz(law: *const HysteronLaw) -> f64 {
    // SAFETY: NULL, or a law that nobody else uses meanwhile.
    unsafe { law.as_ref() }.map_or(0.0, |law| law.sample_rate_hz)
}

/// The law of a file, at rest.
fn load(path: &Path) -> Result<HysteronLaw, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let (law, sample_rate_hz) = if Table::is_one(&text) {
        of_table(&text).map_err(|error| format!("{}: {error}", path.display()))?
    } else {
        let controller = Controller::read(path).map_err(|error| error.to_string())?;
        let law = controller.law::<f32>();
        let law = law.map_err(|error| format!("{}: {error}", path.display()))?;
        (law, 1.0 / controller.model.sample_period_s)
    };
    Ok(HysteronLaw {
        state: law.rest(0.0),
        law,
        sample_rate_hz,
    })
}

/// The law of a table and its sample rate, hertz.
fn of_table(text: &str) -> Result<(DesignedLaw<f32>, f64), String> {
    let table = Table::parse(text).map_err(|error| error.to_string())?;
    let numbers = table.law_numbers().map_err(|error| error.to_string())?;
    let numbers = numbers.ok_or("a table without a complete law; make it from a controller.toml")?;
    let rate_hz = numbers.sample_rate_hz;
    let law = numbers.designed(None).map_err(|error| error.to_string())?;
    Ok((law, rate_hz))
}

/// The beginning of a text in at most so many bytes, no character cut.
fn cut(text: &str, most: usize) -> &str {
    let mut end = most.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    &text[..end]
}
