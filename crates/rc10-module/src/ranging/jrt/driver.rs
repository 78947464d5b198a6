use core::cell::Cell;

use embassy_time::{Duration, Instant, Timer, with_deadline};
use embedded_io_async::{ErrorType, Read, Write};
use rc10_time::Micros;

use super::{Answer, Command, Jrt};
use crate::{Reception, listen};

/// The speed and precision with which a module measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Speed {
    /// The module's own choice.
    #[default]
    Auto = 0,
    /// Seldom and exactly.
    Slow = 1,
    /// Often.
    Fast = 2,
}

impl Speed {
    /// Silence without measuring: 5 s in `laser_ldj100`; fast ones come ten times a second.
    const fn patience(self) -> Duration {
        match self {
            Self::Auto | Self::Slow => Duration::from_secs(5),
            Self::Fast => Duration::from_secs(1),
        }
    }
}

/// Between two commands, so that the module has done the first. No source names a time.
const PAUSE: Duration = Duration::from_millis(100);

/// Keeps a module measuring for ever and hands each answer and its time to `hear`: stops it,
/// switches its laser on and lets it measure continuously, again after 1 s ([`Speed::Fast`]) or 5 s
/// without an answer. Errors are answers.
///
/// `port` is as for [`listen`], and a `read` of it that is dropped must lose no byte.
pub async fn run(
    port: impl Read + Write,
    speed: Speed,
    reception: &Reception,
    mut hear: impl FnMut(Answer, Micros),
) -> ! {
    let due = Cell::new(Instant::MIN);
    let port = Kept { port, speed, due: &due };
    listen(port, Jrt, reception, |answer, at| {
        due.set(Instant::now() + speed.patience());
        hear(answer, at);
    })
    .await
}

/// A port whose device is started whenever it is due.
struct Kept<'a, P> {
    port: P,
    speed: Speed,
    due: &'a Cell<Instant>,
}

impl<P: Write> Kept<'_, P> {
    async fn start(&mut self) -> Result<(), P::Error> {
        // Beforehand, too: a port that fails must not be tried again at once.
        self.due.set(Instant::now() + self.speed.patience());
        self.port.write_all(&Command::Stop.pack()).await?;
        Timer::after(PAUSE).await;
        self.port.write_all(&Command::LaserOn.pack()).await?;
        Timer::after(PAUSE).await;
        self.port.write_all(&Command::Continuously(self.speed).pack()).await?;
        self.due.set(Instant::now() + self.speed.patience());
        Ok(())
    }
}

impl<P: ErrorType> ErrorType for Kept<'_, P> {
    type Error = P::Error;
}

impl<P: Read + Write> Read for Kept<'_, P> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, P::Error> {
        loop {
            let due = self.due.get();
            if Instant::now() >= due {
                self.start().await?;
            } else if let Ok(result) = with_deadline(due, self.port.read(buffer)).await {
                return result;
            }
        }
    }
}
