//! Results of the tests.

use core::fmt::{self, Write as _};

use embassy_time::{Duration, with_timeout};
use embedded_io_async::Write as _;
use heapless::String;
use rc10_bsp::serial::Serial;

/// A test's message, good or bad.
pub type Text = String<96>;
/// Result of a test.
pub type Outcome = Result<Text, Text>;

/// A test that does not end fails.
const LIMIT: Duration = Duration::from_secs(5);

/// A text, cut off where it is too long.
pub fn text(arguments: fmt::Arguments<'_>) -> Text {
    let mut text = Text::new();
    let _ = text.write_fmt(arguments);
    text
}

/// Makes a [`Text`] as `format!` does.
#[macro_export]
macro_rules! say {
    ($($arguments:tt)*) => { $crate::report::text(format_args!($($arguments)*)) };
}

/// Fails the test with a text, unless something holds.
#[macro_export]
macro_rules! want {
    ($what:expr, $($arguments:tt)*) => {
        let holds: bool = $what;
        if !holds {
            return Err($crate::say!($($arguments)*));
        }
    };
}

/// Runs tests and keeps count.
pub struct Report {
    port: Serial,
    passed: u32,
    failed: u32,
}

impl Report {
    pub const fn new(port: Serial) -> Self {
        Self { port, passed: 0, failed: 0 }
    }

    /// Runs a test and says what came of it.
    pub async fn run(&mut self, name: &str, test: impl Future<Output = Outcome>) {
        defmt::info!("begin {}", name);
        let outcome = with_timeout(LIMIT, test).await.unwrap_or_else(|_| Err(say!("no end")));
        let line = match &outcome {
            Ok(what) => say!("{name}: ok, {what}"),
            Err(what) => say!("{name}: FAILED, {what}"),
        };
        self.passed += u32::from(outcome.is_ok());
        self.failed += u32::from(outcome.is_err());
        self.line(&line).await;
    }

    /// The sum of it.
    pub async fn conclude(&mut self) {
        let Self { passed, failed, .. } = *self;
        self.line(&say!("self-test: {passed} passed, {failed} failed")).await;
    }

    async fn line(&mut self, line: &str) {
        defmt::info!("{}", line);
        let line = [line.as_bytes(), b"\r\n"];
        for piece in line {
            if self.port.write_all(piece).await.is_err() {
                defmt::warn!("the line of text does not work");
            }
        }
        let _ = self.port.flush().await;
    }
}
