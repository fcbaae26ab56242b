//! The output across a reset: the DAC holds its code, and memory the word that says which, so that the way down begins there.

/// A code and its complement, in memory that a reset leaves alone.
#[inline(always)]
pub const fn pack(code: u16) -> u32 {
    (code as u32) << 16 | (!code) as u32
}

/// The code of a word; `None` where it is none, as after power was off (all but one word in 65 536).
pub const fn unpack(word: u32) -> Option<u16> {
    let code = (word >> 16) as u16;
    if word as u16 == !code { Some(code) } else { None }
}

/// The next code on the way to another, at most `most` away, and at least one.
pub const fn toward(from: u16, to: u16, most: u16) -> u16 {
    let most = if most == 0 { 1 } else { most };
    if from.abs_diff(to) <= most {
        to
    } else if from < to {
        from + most
    } else {
        from - most
    }
}

/// Codes that a ramp goes a sample, where the converter has so many volts between its lowest and its highest code.
pub fn ramp_codes(ramp_v_per_s: f32, sample_rate_hz: f32, range_v: f32) -> u16 {
    let v_per_code = range_v / 65_535.0;
    (ramp_v_per_s / sample_rate_hz / v_per_code) as u16
}
