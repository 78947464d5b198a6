use rc10_can::Micros;

/// What a serial device says, and how its frames are told from garbage. A new device is this one
/// function; [`Stream`] does the rest.
pub trait Protocol {
    /// What a frame says.
    type Message;

    /// Room for its longest frame: `heapless::Vec<u8, LONGEST>`.
    type Buffer: Buffer;

    /// How silence delimits its frames, if it does: those of a protocol without header.
    const PAUSE: Option<Pause> = None;

    /// What begins with the first of these bytes, of which there is one at least. More than the
    /// buffer holds may not be asked for. Checks everything that can be checked.
    fn examine(&self, bytes: &[u8]) -> Found<Self::Message>;
}

/// What some bytes begin with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found<M> {
    /// It cannot be said before there are so many bytes in all: more than there are.
    More(usize),
    /// No frame begins here.
    Nothing,
    /// Something with a frame's shape whose contents are not sound: a checksum is wrong, say. The
    /// search goes on behind its first byte.
    Damaged,
    /// A frame of so many bytes that says this.
    Frame(usize, M),
    /// A whole frame of so many bytes that says nothing of interest.
    Other(usize),
}

/// Silence that ends a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pause {
    /// Longer silence than this is between two frames, shorter within one.
    pub silence: Micros,
    /// How long a byte takes on the wire, ns.
    pub byte_ns: u32,
}

/// Room for a frame. Implemented by `heapless::Vec<u8, N>`.
pub trait Buffer: Default {
    /// How many bytes it holds.
    const CAPACITY: usize;
    /// What is in it.
    fn bytes(&self) -> &[u8];
    /// Puts a byte at its end; it is not full.
    fn push(&mut self, byte: u8);
    /// Forgets its first bytes.
    fn remove(&mut self, count: usize);
}

impl<const N: usize> Buffer for heapless::Vec<u8, N> {
    const CAPACITY: usize = N;

    #[inline]
    fn bytes(&self) -> &[u8] {
        self
    }

    #[inline]
    fn push(&mut self, byte: u8) {
        let _ = Self::push(self, byte);
    }

    #[inline]
    fn remove(&mut self, count: usize) {
        let count = count.min(self.len());
        self.copy_within(count.., 0);
        self.truncate(self.len() - count);
    }
}

/// What came in so far. Each starts over after 2³².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Counters {
    /// Good frames.
    pub frames: u32,
    /// Frames whose contents were not sound.
    pub damaged: u32,
    /// Bytes that belonged to no good frame.
    pub skipped: u32,
    /// Times the port said that bytes were lost or damaged: overrun, framing, parity, noise, break.
    pub port_errors: u32,
}

/// Finds the frames of a protocol in a stream of bytes, whatever else is in it: bounded work per
/// byte, no allocation, no panic on any input.
///
/// ```
/// use rc10_can::Micros;
/// use rc10_module::{Found, Protocol, Stream};
///
/// /// A byte of 0xAA, and one that says something.
/// struct Pair;
///
/// impl Protocol for Pair {
///     type Message = u8;
///     type Buffer = heapless::Vec<u8, 2>;
///
///     fn examine(&self, bytes: &[u8]) -> Found<u8> {
///         match bytes {
///             [0xAA, value, ..] => Found::Frame(2, *value),
///             [0xAA] => Found::More(2),
///             _ => Found::Nothing,
///         }
///     }
/// }
///
/// let mut stream = Stream::new(Pair);
/// let mut heard = Vec::new();
/// for piece in [&[0x01, 0xAA][..], &[0x07, 0xAA, 0x08]] {
///     stream.receive(piece, Micros::ZERO, |value| heard.push(value));
/// }
/// assert_eq!(heard, [7, 8]);
/// assert_eq!((stream.counters().frames, stream.counters().skipped), (2, 1));
/// ```
#[derive(Debug)]
pub struct Stream<P: Protocol> {
    protocol: P,
    buffer: P::Buffer,
    /// So many bytes must be there before it is worth looking.
    needed: usize,
    /// What comes is of no use until the line pauses.
    is_lost: bool,
    last: Option<Micros>,
    counters: Counters,
}

impl<P: Protocol> Stream<P> {
    /// A stream of which nothing was heard.
    pub fn new(protocol: P) -> Self {
        Self {
            protocol,
            buffer: P::Buffer::default(),
            needed: 1,
            is_lost: false,
            last: None,
            counters: Counters::default(),
        }
    }

    /// Bytes came in, the last of them at `at`; `hear` gets the messages that they complete.
    pub fn receive(&mut self, bytes: &[u8], at: Micros, mut hear: impl FnMut(P::Message)) {
        if bytes.is_empty() {
            return;
        }
        if let Some(pause) = &P::PAUSE {
            self.look_for_pause(pause, bytes.len(), at);
        }
        for &byte in bytes {
            if self.is_lost {
                self.counters.skipped = self.counters.skipped.wrapping_add(1);
                continue;
            }
            self.buffer.push(byte);
            if self.buffer.bytes().len() >= self.needed {
                self.search(&mut hear);
            }
        }
    }

    /// The port lost bytes: what was begun is of no use.
    pub fn interrupt(&mut self) {
        self.counters.port_errors = self.counters.port_errors.wrapping_add(1);
        self.forget();
    }

    /// What came in so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    fn look_for_pause(&mut self, pause: &Pause, count: usize, at: Micros) {
        let took = (count as u64).wrapping_mul(pause.byte_ns.into()) / 1000;
        let began = at.since(Micros::new(took));
        if self.last.is_none_or(|last| began.since(last) > pause.silence) {
            self.forget();
            self.is_lost = false;
        }
        self.last = Some(at);
    }

    fn forget(&mut self) {
        self.skip(self.buffer.bytes().len());
        self.needed = 1;
    }

    fn skip(&mut self, count: usize) {
        #[expect(clippy::cast_possible_truncation, reason = "no more than the buffer holds")]
        let skipped = count as u32;
        self.counters.skipped = self.counters.skipped.wrapping_add(skipped);
        self.buffer.remove(count);
    }

    /// Takes from the buffer whatever can be judged.
    fn search(&mut self, hear: &mut impl FnMut(P::Message)) {
        let mut from = 0;
        while let Some(bytes) = self.buffer.bytes().get(from..).filter(|left| !left.is_empty()) {
            match self.protocol.examine(bytes) {
                Found::More(needed) if needed > bytes.len() && needed <= P::Buffer::CAPACITY => {
                    self.skip(from);
                    self.needed = needed;
                    return;
                }
                Found::Frame(length, message) => {
                    self.counters.frames = self.counters.frames.wrapping_add(1);
                    hear(message);
                    self.skip(from);
                    self.buffer.remove(length.max(1));
                    from = 0;
                }
                Found::Other(length) => {
                    self.counters.frames = self.counters.frames.wrapping_add(1);
                    self.skip(from);
                    self.buffer.remove(length.max(1));
                    from = 0;
                }
                unsound => {
                    if matches!(unsound, Found::Damaged) {
                        self.counters.damaged = self.counters.damaged.wrapping_add(1);
                    }
                    if P::PAUSE.is_some() {
                        // Without a header nothing says where the next frame begins.
                        self.forget();
                        self.is_lost = true;
                        return;
                    }
                    from += 1;
                }
            }
        }
        self.skip(from);
        self.needed = 1;
    }
}
