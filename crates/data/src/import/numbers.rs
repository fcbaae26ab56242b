//! Numbers of binary files.

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stored {
    Signed(usize),
    Unsigned(usize),
    Half,
    Single,
    Double,
}

impl Stored {
    /// Bytes of a number.
    pub(crate) fn width(self) -> usize {
        match self {
            Stored::Signed(width) | Stored::Unsigned(width) => width,
            Stored::Half => 2,
            Stored::Single => 4,
            Stored::Double => 8,
        }
    }

    /// The number that the bytes, as many as it has, stand for.
    pub(crate) fn number(self, bytes: &[u8], big_endian: bool) -> f64 {
        let mut word = [0; 8];
        let width = bytes.len().min(8);
        for (place, to) in word.iter_mut().take(width).enumerate() {
            *to = if big_endian {
                bytes[width - 1 - place]
            } else {
                bytes[place]
            };
        }
        let bits = u64::from_le_bytes(word);
        match self {
            Stored::Unsigned(_) => bits as f64,
            Stored::Signed(_) => {
                let unused = 64 - 8 * width.max(1) as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
            Stored::Half => half(bits as u16),
            Stored::Single => f64::from(f32::from_bits(bits as u32)),
            Stored::Double => f64::from_bits(bits),
        }
    }

    /// The numbers of bytes that lie side by side.
    pub(crate) fn numbers(self, bytes: &[u8], big_endian: bool) -> impl Iterator<Item = f64> {
        bytes
            .chunks_exact(self.width())
            .map(move |bytes| self.number(bytes, big_endian))
    }
}

/// A number of half precision (IEEE 754 binary16).
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

/// A little reader of bytes that never reads beyond them.
#[derive(Debug, Clone)]
pub(crate) struct Bytes<'a> {
    bytes: &'a [u8],
    pub(crate) big_endian: bool,
}

/// The bytes end before what they should hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Ends;

impl<'a> Bytes<'a> {
    pub(crate) fn new(bytes: &'a [u8], big_endian: bool) -> Bytes<'a> {
        Bytes { bytes, big_endian }
    }

    /// Bytes that are left.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len()
    }

    /// The next bytes.
    pub(crate) fn take(&mut self, count: u64) -> Result<&'a [u8], Ends> {
        let count = usize::try_from(count).map_err(|_| Ends)?;
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or(Ends)?;
        self.bytes = rest;
        Ok(taken)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Ends> {
        let bytes: [u8; 4] = self.take(4)?.try_into().map_err(|_| Ends)?;
        Ok(if self.big_endian {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    pub(crate) fn u64(&mut self) -> Result<u64, Ends> {
        let bytes: [u8; 8] = self.take(8)?.try_into().map_err(|_| Ends)?;
        Ok(if self.big_endian {
            u64::from_be_bytes(bytes)
        } else {
            u64::from_le_bytes(bytes)
        })
    }

    /// A text with its length before it.
    pub(crate) fn text(&mut self) -> Result<String, Ends> {
        let length = self.u32()?;
        Ok(String::from_utf8_lossy(self.take(u64::from(length))?).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_numbers_of_every_type() {
        for (stored, bytes, expect) in [
            (Stored::Signed(1), &[0xfe_u8][..], -2.0),
            (Stored::Unsigned(1), &[0xfe], 254.0),
            (Stored::Signed(2), &(-300_i16).to_le_bytes(), -300.0),
            (Stored::Unsigned(4), &4_000_000_000_u32.to_le_bytes(), 4e9),
            (Stored::Signed(8), &(-5_i64).to_le_bytes(), -5.0),
            (Stored::Single, &0.25_f32.to_le_bytes(), 0.25),
            (Stored::Double, &1e-300_f64.to_le_bytes(), 1e-300),
            // IEEE 754: 1, -2, the smallest, the largest
            (Stored::Half, &[0x00, 0x3c], 1.0),
            (Stored::Half, &[0x00, 0xc0], -2.0),
            (Stored::Half, &[0x01, 0x00], 5.960_464_477_539_063e-8),
            (Stored::Half, &[0xff, 0x7b], 65504.0),
        ] {
            assert_eq!(stored.number(bytes, false), expect, "{stored:?}");
            let turned: Vec<u8> = bytes.iter().rev().copied().collect();
            assert_eq!(stored.number(&turned, true), expect, "{stored:?}, big end first");
        }
    }
}
