//! Lines of a text file, one at a time through a buffer of fixed size.
//!
//! The `csv` crate is not used for this because every error must name the exact line (also after preambles, blank
//! lines and CRLF) and because a line without end must not fill the memory: here a line longer than
//! [`LONGEST_LINE`] is an error after that many bytes.

use std::io::{self, Read};

/// The longest line that is read, bytes: some 4000 columns of numbers, far above any record.
pub(crate) const LONGEST_LINE: usize = 64 * 1024;

/// Size of the buffer, bytes: a line of the longest kind and a good-sized read.
const BUFFER: usize = 4 * LONGEST_LINE;

/// Why no further line can be given.
#[derive(Debug)]
pub(crate) enum LineFault {
    /// The system says no.
    Io(io::Error),
    /// No line end within [`LONGEST_LINE`] bytes.
    TooLong {
        /// The line.
        line: u64,
    },
}

/// Reads lines.
pub(crate) struct Lines<R> {
    source: R,
    buffer: Box<[u8]>,
    begin: usize,
    end: usize,
    line: u64,
    bytes: u64,
    at_end: bool,
}

impl<R: Read> Lines<R> {
    pub(crate) fn new(source: R) -> Lines<R> {
        Lines {
            source,
            buffer: vec![0; BUFFER].into_boxed_slice(),
            begin: 0,
            end: 0,
            line: 0,
            bytes: 0,
            at_end: false,
        }
    }

    /// Bytes taken from the source so far.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The next line with its number (from 1), without its line end (LF or CRLF), or `None` at the end.
    pub(crate) fn next_line(&mut self) -> Result<Option<(u64, &[u8])>, LineFault> {
        let mut searched = 0;
        loop {
            if let Some(at) = memchr::memchr(b'\n', &self.buffer[self.begin + searched..self.end]) {
                let from = self.begin;
                let to = from + searched + at;
                self.begin = to + 1;
                return self.give(from, to);
            }
            searched = self.end - self.begin;
            if self.at_end {
                if searched == 0 {
                    return Ok(None);
                }
                let (from, to) = (self.begin, self.end);
                self.begin = self.end;
                return self.give(from, to);
            }
            if searched > LONGEST_LINE {
                return Err(LineFault::TooLong { line: self.line + 1 });
            }
            self.fill().map_err(LineFault::Io)?;
        }
    }

    fn give(&mut self, from: usize, to: usize) -> Result<Option<(u64, &[u8])>, LineFault> {
        self.line += 1;
        if to - from > LONGEST_LINE {
            return Err(LineFault::TooLong { line: self.line });
        }
        let line = &self.buffer[from..to];
        Ok(Some((self.line, line.strip_suffix(b"\r").unwrap_or(line))))
    }

    /// Moves the unfinished line to the front and reads on.
    fn fill(&mut self) -> io::Result<()> {
        self.buffer.copy_within(self.begin..self.end, 0);
        self.end -= self.begin;
        self.begin = 0;
        loop {
            match self.source.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.at_end = true,
                Ok(count) => {
                    self.end += count;
                    self.bytes += count as u64;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            }
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives one byte a read: the worst a source may do.
    struct Trickle<'a>(&'a [u8]);

    impl Read for Trickle<'_> {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            match self.0.split_first() {
                Some((first, rest)) => {
                    out[0] = *first;
                    self.0 = rest;
                    Ok(1)
                }
                None => Ok(0),
            }
        }
    }

    fn all(source: impl Read) -> Vec<(u64, Vec<u8>)> {
        let mut lines = Lines::new(source);
        let mut out = Vec::new();
        while let Some((number, line)) = lines.next_line().unwrap() {
            out.push((number, line.to_vec()));
        }
        out
    }

    #[test]
    fn val_lines_and_their_numbers() {
        for (text, expect) in [
            ("", vec![]),
            ("a", vec![(1, "a")]),
            ("a\n", vec![(1, "a")]),
            ("a\r\n\r\nb", vec![(1, "a"), (2, ""), (3, "b")]),
            ("\n\nc\n", vec![(1, ""), (2, ""), (3, "c")]),
        ] {
            let expect: Vec<_> = expect.into_iter().map(|(n, l)| (n, l.as_bytes().to_vec())).collect();
            assert_eq!(all(text.as_bytes()), expect, "{text:?}");
            assert_eq!(all(Trickle(text.as_bytes())), expect, "{text:?} byte by byte");
        }
    }

    #[test]
    fn refuse_a_line_without_end() {
        let mut lines = Lines::new(io::repeat(b'x'));
        assert!(matches!(lines.next_line(), Err(LineFault::TooLong { line: 1 })));
        assert!(lines.bytes() <= BUFFER as u64);
        let long = [b"ok\n".as_slice(), &vec![b'x'; LONGEST_LINE + 1], b"\n"].concat();
        let mut lines = Lines::new(long.as_slice());
        assert!(lines.next_line().unwrap().is_some());
        assert!(matches!(lines.next_line(), Err(LineFault::TooLong { line: 2 })));
    }
}
