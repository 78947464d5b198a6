//! Output to the terminal, without control characters that names in it may have.

use std::fmt::Display;
use std::io::{self, Write};

/// A text without control characters, but for tabs and the ends of lines.
fn plain(text: &str) -> String {
    let plain = |letter: char| match letter {
        '\n' | '\t' => letter,
        letter if letter.is_control() => char::REPLACEMENT_CHARACTER,
        letter => letter,
    };
    text.chars().map(plain).collect()
}

/// Prints to stderr; a closed terminal is no error.
pub(crate) fn tell(what: impl Display) {
    let _ = writeln!(io::stderr(), "rc10: {}", plain(&what.to_string()));
}

/// An output for whole texts that removes their control characters.
pub(crate) struct Plain<W>(pub(crate) W);

impl<W: Write> Write for Plain<W> {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        // The first byte of a control character, or of a letter like é.
        let may_be = |byte: &u8| matches!(byte, 0..=8 | 11..=31 | 0x7F | 0xC2);
        if text.iter().any(may_be) {
            self.0.write_all(plain(&String::from_utf8_lossy(text)).as_bytes())?;
        } else {
            self.0.write_all(text)?;
        }
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}
