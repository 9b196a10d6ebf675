//! Lines of a text file of any size, in constant memory.

use std::io::{self, BufRead, Read};

/// Longest line that is read, in bytes.
const LONGEST: usize = 4096;

/// A file line by line, without their ends.
#[derive(Debug)]
pub(super) struct Lines<'a, F> {
    file: &'a mut F,
    line: Vec<u8>,
    number: usize,
    ended: bool,
}

impl<'a, F: BufRead> Lines<'a, F> {
    pub(super) const fn new(file: &'a mut F) -> Self {
        Self { file, line: Vec::new(), number: 0, ended: true }
    }

    /// The next line and its number, counted from 1; `None` at the end.
    ///
    /// # Errors
    /// The file cannot be read; a line is longer than [`LONGEST`], so that it is no such file.
    pub(super) fn next_line(&mut self) -> io::Result<Option<(usize, &[u8])>> {
        self.line.clear();
        let len = Read::take(&mut *self.file, LONGEST as u64 + 1).read_until(b'\n', &mut self.line)?;
        if len == 0 {
            return Ok(None);
        }
        self.number += 1;
        self.ended = self.line.ends_with(b"\n");
        match self.line.strip_suffix(b"\n") {
            Some(line) => Ok(Some((self.number, line))),
            None if len <= LONGEST => Ok(Some((self.number, &self.line))),
            None => {
                let text = format!("line {} is longer than {LONGEST} bytes", self.number);
                Err(io::Error::new(io::ErrorKind::InvalidData, text))
            }
        }
    }

    /// Whether the last line that was read has its end.
    pub(super) const fn ended(&self) -> bool {
        self.ended
    }
}
