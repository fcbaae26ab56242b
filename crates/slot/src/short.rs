//! Numbers as people read them.

use core::fmt::{self, Write};

/// Sign, a digit, a point, five digits, `e` and an exponent of four.
const ROOM: usize = 24;

/// Text of a number, without an allocator.
struct Text {
    bytes: [u8; ROOM],
    length: usize,
}

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let end = self.length + text.len();
        let place = self.bytes.get_mut(self.length..end).ok_or(fmt::Error)?;
        place.copy_from_slice(text.as_bytes());
        self.length = end;
        Ok(())
    }
}

/// A number to six digits, which print without the tail that binary fractions leave: a tenth of a nanometre of 99 um.
///
/// # Example
/// ```
/// use hysteron_slot::short;
/// assert_eq!(short(0.65 * 20.0 - 0.15 * 20.0 - 8.7).to_string(), "1.3");
/// assert_eq!(short(1.0 / 20.3e-6).to_string(), "49261.1");
/// ```
pub fn short(value: f64) -> f64 {
    let mut text = Text {
        bytes: [0; ROOM],
        length: 0,
    };
    if write!(text, "{value:.5e}").is_err() {
        return value;
    }
    // What is printed this way is read back, infinities and NaN too.
    let said = text
        .bytes
        .get(..text.length)
        .and_then(|bytes| str::from_utf8(bytes).ok());
    said.and_then(|said| said.parse().ok()).unwrap_or(value)
}
