//! Accounts of a ring that a circular DMA fills: received and read. Without registers, for tests.

/// Something was wrong with what came in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SerialError {
    /// The UART had no place for a byte: the DMA was too slow, or had stopped.
    #[error("the UART received a byte before the last one was fetched")]
    Overrun,
    /// No stop bit where one belongs: another baud rate, or a disturbance.
    #[error("a byte without stop bit")]
    Framing,
    /// A byte's parity was wrong.
    #[error("a byte of wrong parity")]
    Parity,
    /// The samples of a bit did not agree.
    #[error("a noisy bit")]
    Noise,
    /// The line was held at the level of a start bit for longer than a byte.
    #[error("the line was held in break")]
    Break,
    /// The reader or interrupts were too slow: unread bytes were overwritten, the rest is dropped.
    #[error("bytes were overwritten before they were read")]
    TooSlow,
    /// The DMA could not transfer. It is restarted.
    #[error("a DMA transfer failed")]
    Dma,
}

/// Counters of the errors of a serial port, by kind. Each starts over after 2³².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[must_use]
pub struct SerialCounters {
    /// [`SerialError::Overrun`].
    pub overruns: u32,
    /// [`SerialError::Framing`].
    pub framing: u32,
    /// [`SerialError::Parity`].
    pub parity: u32,
    /// [`SerialError::Noise`].
    pub noise: u32,
    /// [`SerialError::Break`].
    pub breaks: u32,
    /// [`SerialError::TooSlow`]: the occasions.
    pub too_slow: u32,
    /// Bytes received and never read, at least: what [`SerialError::TooSlow`] and
    /// [`SerialError::Dma`] cost, and what lies between two errors of which one is told.
    pub unread: u32,
    /// [`SerialError::Dma`], of both directions.
    pub dma: u32,
}

impl SerialCounters {
    const NEW: Self = Self {
        overruns: 0,
        framing: 0,
        parity: 0,
        noise: 0,
        breaks: 0,
        too_slow: 0,
        unread: 0,
        dma: 0,
    };
}

/// The error flags of a UART.
#[derive(Clone, Copy, Debug, Default)]
pub struct LineFlags {
    pub overrun: bool,
    pub framing: bool,
    pub parity: bool,
    pub noise: bool,
}

/// The next step of the reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Nothing yet.
    Nothing,
    /// Once.
    Error(SerialError),
    /// Some bytes from this position on, modulo the ring's length: maybe in two pieces.
    Bytes { from: u32, count: u32 },
}

/// The accounts of a ring. Positions count received bytes, modulo 2³².
#[derive(Debug)]
pub struct Ring {
    /// A power of two, so that 2³² positions are whole rounds.
    length: u32,
    received: u32,
    /// Up to here no byte was wrong: the reader gets none behind it.
    checked: u32,
    read: u32,
    /// The place of an error for the reader, and the bytes that it does not get, if any.
    hole: Option<Hole>,
    pub counters: SerialCounters,
}

/// `from` is never behind what is read: no error comes before a byte that was offered already.
#[derive(Clone, Copy, Debug)]
struct Hole {
    from: u32,
    to: u32,
    why: SerialError,
}

const fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

impl Ring {
    /// A ring without memory: it never has anything.
    pub const fn new() -> Self {
        Self {
            length: 1,
            received: 0,
            checked: 0,
            read: 0,
            hole: None,
            counters: SerialCounters::NEW,
        }
    }

    /// Gives it memory, of a power of two of bytes.
    pub const fn set_length(&mut self, length: u32) {
        self.length = length;
    }

    const fn unread(&self) -> u32 {
        self.received.wrapping_sub(self.read)
    }

    /// Drops what is unread; the reader gets an error in its stead.
    fn drop_unread(&mut self, why: SerialError) {
        self.counters.unread = self.counters.unread.wrapping_add(self.unread());
        self.read = self.received;
        self.checked = self.received;
        self.hole = Some(Hole { from: self.read, to: self.read, why });
    }

    /// The DMA has `remaining` bytes to go, and passed the half or the end since the last look.
    /// (Flags first: a mark passed in between shows at the next look.)
    pub fn look(&mut self, remaining: u32, half: bool, end: bool) {
        let place = self.length.wrapping_sub(remaining) & (self.length - 1);
        let moved = place.wrapping_sub(self.received) & (self.length - 1);
        self.received = self.received.wrapping_add(moved);
        // A whole round passes both marks. So may a bit more than half, by interrupts as late.
        if (half && end) || self.unread() > self.length {
            count(&mut self.counters.too_slow);
            self.drop_unread(SerialError::TooSlow);
        }
    }

    /// The UART says that until now nothing was wrong.
    pub const fn check(&mut self) {
        self.checked = self.received;
    }

    /// A byte since the last check was wrong, or lost; `wrong` is what there was of it. Nothing
    /// tells where it belongs: all since then go.
    pub fn fail(&mut self, flags: LineFlags, wrong: Option<u8>) {
        let counters = &mut self.counters;
        let mut why = None;
        if flags.overrun {
            count(&mut counters.overruns);
            why = Some(SerialError::Overrun);
        }
        if flags.noise {
            count(&mut counters.noise);
            why = Some(SerialError::Noise);
        }
        if flags.parity {
            count(&mut counters.parity);
            why = Some(SerialError::Parity);
        }
        if flags.framing {
            let (counter, kind) = if wrong == Some(0) {
                (&mut counters.breaks, SerialError::Break)
            } else {
                (&mut counters.framing, SerialError::Framing)
            };
            count(counter);
            why = Some(kind);
        }
        let Some(why) = why else { return };
        let from = self.hole.map_or(self.checked, |hole| hole.from);
        let why = self.hole.map_or(why, |hole| hole.why);
        // Good bytes between two errors go: a slow reader could not tell them apart.
        self.hole = Some(Hole { from, to: self.received, why });
        self.checked = self.received;
    }

    /// Whether the reader has an error to be told.
    pub const fn has_failed(&self) -> bool {
        self.hole.is_some()
    }

    /// The DMA has failed and will begin a new round.
    pub fn restart(&mut self) {
        count(&mut self.counters.dma);
        self.drop_unread(SerialError::Dma);
        self.received = self.received.wrapping_add(self.length - 1) & !(self.length - 1);
        (self.read, self.checked) = (self.received, self.received);
        self.hole = Some(Hole { from: self.read, to: self.read, why: SerialError::Dma });
    }

    /// The next bytes or error for the reader, at most `room` bytes; a hole is passed.
    pub fn next(&mut self, room: u32) -> Next {
        let end = match self.hole {
            Some(hole) if hole.from == self.read => {
                let dropped = hole.to.wrapping_sub(hole.from);
                self.counters.unread = self.counters.unread.wrapping_add(dropped);
                self.read = hole.to;
                self.hole = None;
                return Next::Error(hole.why);
            }
            Some(hole) => hole.from,
            None => self.checked,
        };
        match end.wrapping_sub(self.read).min(room) {
            0 => Next::Nothing,
            count => Next::Bytes { from: self.read, count },
        }
    }

    /// Whether the `count` bytes fetched from `from` are what was received; else they stay unread.
    pub fn take(&mut self, from: u32, count: u32) -> bool {
        if self.read != from {
            return false;
        }
        self.read = self.read.wrapping_add(count);
        true
    }
}
