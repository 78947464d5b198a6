//! Output to the terminal, without control characters that names in it may have; its width, its colours, and the
//! progress of long work.

use std::fmt::{Display, Write as _};
use std::io::{self, IsTerminal as _, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anstyle::{AnsiColor, Style};
use rc10_time::Micros;

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

/// An output that paints verdicts; beneath a [`Plain`] one, as colours are control characters.
pub(crate) struct Painted<W>(pub(crate) W);

impl<W: Write> Write for Painted<W> {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        match std::str::from_utf8(text) {
            Ok(verdict) if verdict.starts_with(['✓', '✗']) => {
                self.0.write_all(painted(verdict).as_bytes())?;
            }
            _ => self.0.write_all(text)?,
        }
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

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

/// Width of the terminal in letters, if it is known: by COLUMNS, or by the terminal itself.
pub(crate) fn width() -> Option<usize> {
    let told = std::env::var("COLUMNS").ok().and_then(|it| it.parse().ok());
    #[cfg(any(unix, windows))]
    let seen = || Some(usize::from(terminal_size::terminal_size_of(io::stdout())?.0.0));
    // A web page.
    #[cfg(not(any(unix, windows)))]
    let seen = || None;
    told.or_else(seen).filter(|width| *width >= 20)
}

/// A text whose lines end at words within the terminal; what follows is set in by two more.
pub(crate) fn wrapped(text: &str) -> String {
    let Some(width) = width() else { return text.into() };
    let mut all = String::new();
    for line in text.split_inclusive('\n') {
        let indent = line.len() - line.trim_start_matches(' ').len();
        let mut used = 0;
        for word in line.split_inclusive(' ') {
            let length = word.trim_end().chars().count();
            if used > indent && used + length > width {
                all.truncate(all.trim_end_matches(' ').len());
                let _ = write!(all, "\n{:1$}", "", indent + 2);
                used = indent + 2;
            }
            all += word;
            used += word.chars().count();
        }
    }
    all
}

/// A text whose lines with ✓ are green, and those with ✗ red. Where colours are not wanted, the output removes them.
pub(crate) fn painted(text: &str) -> String {
    let line = |line: &str| {
        let colour = match line.chars().next() {
            Some('✓') => AnsiColor::Green,
            Some('✗') => AnsiColor::Red,
            _ => return line.to_owned(),
        };
        let style = Style::new().bold().fg_color(Some(colour.into()));
        format!("{style}{line}{style:#}")
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// Whether commands tell how far they are.
static TELLS: AtomicBool = AtomicBool::new(false);

/// Lets commands tell how far they are, if there is a terminal.
pub(crate) fn tell_progress() {
    TELLS.store(io::stderr().is_terminal(), Ordering::Relaxed);
}

/// How far long work is: a line on the terminal, which is gone at the end.
pub(crate) struct Progress {
    told: Instant,
    is_shown: bool,
}

impl Progress {
    const OFTEN: Duration = Duration::from_millis(500);

    pub(crate) fn new() -> Self {
        Self { told: Instant::now(), is_shown: false }
    }

    pub(crate) fn tell(&mut self, now: Micros, end: Micros) {
        self.tell_of(now.get() / 1_000_000, end.get() as f64 / 1e6, "s");
    }

    pub(crate) fn tell_of(&mut self, done: u64, all: f64, unit: &str) {
        if !TELLS.load(Ordering::Relaxed) || self.told.elapsed() < Self::OFTEN {
            return;
        }
        let percent = (100.0 * done as f64 / all.max(1.0)) as u64;
        let _ = write!(io::stderr(), "\r{percent:3} %  {done} of {all} {unit}");
        (self.told, self.is_shown) = (Instant::now(), true);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.is_shown {
            let _ = write!(io::stderr(), "\r\x1b[K");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_are_painted_and_nothing_else() {
        let mut out = Vec::new();
        for text in ["a ✗ table\n", "✗ 1 problem\n  feeder: lost\n✓ no\n"] {
            Painted(&mut out).write_all(text.as_bytes()).unwrap();
        }
        let red = "\u{1b}[1m\u{1b}[31m✗ 1 problem\u{1b}[0m\n  feeder: lost\n";
        let wanted = format!("a ✗ table\n{red}\u{1b}[1m\u{1b}[32m✓ no\u{1b}[0m\n");
        assert_eq!(String::from_utf8(out).unwrap(), wanted);
    }
}
