//! Text encodings: UTF-8 as it is, UTF-16 to UTF-8 while reading.

use std::io::{self, Read};

/// How a text file is encoded, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// UTF-8 or one of its subsets.
    Utf8,
    /// Not UTF-8: read as Latin-1, in which instruments write `µ` and `°`.
    Latin1,
    /// UTF-16, little end first.
    Utf16Le,
    /// UTF-16, big end first.
    Utf16Be,
}

impl Encoding {
    /// The encoding of a text that begins so; the byte order mark decides, else whether it is UTF-8.
    pub(crate) fn of(head: &[u8]) -> Encoding {
        match head {
            [0xff, 0xfe, ..] => Encoding::Utf16Le,
            [0xfe, 0xff, ..] => Encoding::Utf16Be,
            _ => match std::str::from_utf8(head) {
                Err(error) if error.error_len().is_some() => Encoding::Latin1,
                _ => Encoding::Utf8,
            },
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Encoding::Utf8 => "UTF-8",
            Encoding::Latin1 => "Latin-1",
            Encoding::Utf16Le => "UTF-16, little end first",
            Encoding::Utf16Be => "UTF-16, big end first",
        }
    }
}

/// The text of a line's piece.
pub(crate) fn text(piece: &[u8], encoding: Encoding) -> String {
    match encoding {
        Encoding::Latin1 => piece.iter().map(|&byte| char::from(byte)).collect(),
        _ => String::from_utf8_lossy(piece).into_owned(),
    }
}

/// Gives a source's text as UTF-8 bytes (Latin-1 as it is: only names are decoded, and those by [`text`]).
pub(crate) struct Decoded<R> {
    source: R,
    encoding: Encoding,
    raw: Vec<u8>,
    out: Vec<u8>,
    given: usize,
    /// First half of a character outside the basic plane.
    high: Option<u16>,
}

impl<R: Read> Decoded<R> {
    pub(crate) fn new(source: R, encoding: Encoding) -> Decoded<R> {
        Decoded {
            source,
            encoding,
            raw: Vec::new(),
            out: Vec::new(),
            given: 0,
            high: None,
        }
    }

    /// Decodes the next 16 kB; leaves an odd last byte for the next time.
    fn refill(&mut self) -> io::Result<bool> {
        let mut chunk = [0; 16 * 1024];
        let count = loop {
            match self.source.read(&mut chunk) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                other => break other?,
            }
        };
        self.raw.extend_from_slice(&chunk[..count]);
        self.out.clear();
        self.given = 0;
        let pairs = self.raw.chunks_exact(2);
        let rest = pairs.remainder().to_vec();
        for pair in pairs {
            let unit = match self.encoding {
                Encoding::Utf16Be => u16::from_be_bytes([pair[0], pair[1]]),
                _ => u16::from_le_bytes([pair[0], pair[1]]),
            };
            let units = self.high.take().into_iter().chain([unit]);
            match unit {
                0xd800..0xdc00 => self.high = Some(unit),
                _ => {
                    for character in char::decode_utf16(units) {
                        let character = character.unwrap_or(char::REPLACEMENT_CHARACTER);
                        self.out
                            .extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
                    }
                }
            }
        }
        self.raw = rest;
        Ok(count > 0)
    }
}

impl<R: Read> Read for Decoded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if !matches!(self.encoding, Encoding::Utf16Le | Encoding::Utf16Be) {
            return self.source.read(buffer);
        }
        while self.given == self.out.len() {
            if !self.refill()? {
                return Ok(0);
            }
        }
        let count = buffer.len().min(self.out.len() - self.given);
        buffer[..count].copy_from_slice(&self.out[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, bytes: fn(u16) -> [u8; 2]) -> Vec<u8> {
        text.encode_utf16().flat_map(bytes).collect()
    }

    #[test]
    fn val_encodings_are_told_and_decoded() {
        let text = "\u{feff}Zeit [µs]\r\n1,5\u{1F600}\n";
        for (bytes, expect) in [
            (text.as_bytes().to_vec(), Encoding::Utf8),
            (utf16(text, u16::to_le_bytes), Encoding::Utf16Le),
            (utf16(text, u16::to_be_bytes), Encoding::Utf16Be),
        ] {
            let encoding = Encoding::of(&bytes);
            assert_eq!(encoding, expect);
            let mut found = String::new();
            Decoded::new(bytes.as_slice(), encoding)
                .read_to_string(&mut found)
                .unwrap();
            assert_eq!(found, text);
        }
        assert_eq!(Encoding::of(b"t [\xb5s]"), Encoding::Latin1);
        assert_eq!(super::text(b"t [\xb5s]", Encoding::Latin1), "t [µs]");
        // a head cut inside a character is still UTF-8
        assert_eq!(Encoding::of(&"µ".as_bytes()[..1]), Encoding::Utf8);
    }
}
