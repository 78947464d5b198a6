use rc10_time::Micros;

/// The protocol of a serial device: its messages, and how frames are told from garbage.
pub trait Protocol {
    /// The content of a frame.
    type Message;

    /// Room for its longest frame: `heapless::Vec<u8, LONGEST>`.
    type Buffer: Buffer;

    /// The meaning of silence on the line, if it has one.
    const PAUSE: Option<Pause> = None;

    /// Examines the frame that begins with the first of these bytes (at least one), and all that
    /// can be checked. It may not ask for more than the buffer holds.
    fn examine(&self, bytes: &[u8]) -> Found<Self::Message>;
}

/// The result of examining some bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found<M> {
    /// Undecided until this number of bytes is there in all: more than there are now.
    More(usize),
    /// No frame begins here.
    Nothing,
    /// A frame whose contents are not sound, as its checksum. The search goes on a byte behind.
    Damaged,
    /// A frame: its length in bytes, and its message.
    Frame(usize, M),
    /// A whole frame without a message of interest: its length in bytes.
    Other(usize),
}

/// The meaning of a pause of this length or longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pause {
    /// No frame has such a gap: what was begun is no frame, and the next byte begins one.
    Ends(Micros),
    /// The same, for frames without a header: between two pauses all is whole frames, or nothing of
    /// it is believed; judged at the second one.
    Delimits(Micros),
}

impl Pause {
    /// The least time for which the line is silent.
    #[must_use]
    pub const fn length(self) -> Micros {
        match self {
            Self::Ends(length) | Self::Delimits(length) => length,
        }
    }
}

/// Room for a frame. Implemented by `heapless::Vec<u8, N>`.
pub trait Buffer: Default {
    /// Largest number of bytes that it holds.
    const CAPACITY: usize;
    /// The bytes in it.
    fn bytes(&self) -> &[u8];
    /// Puts these at its end; there is room for them.
    fn extend(&mut self, bytes: &[u8]);
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
    fn extend(&mut self, bytes: &[u8]) {
        let _ = self.extend_from_slice(bytes);
    }

    #[inline]
    fn remove(&mut self, count: usize) {
        // Mostly none of them, or all: nothing is moved then.
        if count >= self.len() {
            self.clear();
        } else if count > 0 {
            self.copy_within(count.., 0);
            self.truncate(self.len() - count);
        }
    }
}

/// Counters of the received frames and bytes. Each starts over after 2³².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[must_use]
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

impl Counters {
    fn skip(&mut self, bytes: usize) {
        #[expect(clippy::cast_possible_truncation, reason = "it starts over after 2³²")]
        let bytes = bytes as u32;
        self.skipped = self.skipped.wrapping_add(bytes);
    }
}

/// Finds a protocol's frames in a stream: bounded work per byte, no allocation, no panic.
///
/// ```
/// use rc10_time::Micros;
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
    /// Number of bytes from which on looking for a frame makes sense.
    needed: usize,
    /// Whether bytes are of no use until the line pauses.
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

    /// Bytes came in, the last of them not after `at`; `hear` gets the messages that they complete.
    ///
    /// No bytes: there was no byte at the time `at`. That is the only way to hear a
    /// [`Protocol::PAUSE`]. What it completes came with the bytes before.
    pub fn receive(&mut self, bytes: &[u8], at: Micros, mut hear: impl FnMut(P::Message)) {
        if bytes.is_empty() {
            self.listen_for_pause(at, &mut hear);
            return;
        }
        self.last = Some(at);
        if matches!(P::PAUSE, Some(Pause::Delimits(_))) {
            self.collect(bytes);
            return;
        }
        let mut left = bytes;
        while !left.is_empty() {
            let waiting = self.buffer.bytes().len();
            if waiting == 0 {
                // In place: most frames come whole.
                let (judged, needed) =
                    search(&self.protocol, left, false, &mut self.counters, &mut hear);
                self.buffer.extend(left.get(judged..).unwrap_or_default());
                self.needed = needed;
                return;
            }
            let (now, later) = left.split_at(left.len().min(self.needed.saturating_sub(waiting)));
            self.buffer.extend(now);
            left = later;
            if waiting + now.len() >= self.needed {
                self.search_buffer(false, &mut hear);
            }
        }
    }

    /// Keeps what came since a pause, if it may be frames.
    fn collect(&mut self, bytes: &[u8]) {
        if self.is_lost {
            self.counters.skip(bytes.len());
        } else if self.buffer.bytes().len() + bytes.len() > P::Buffer::CAPACITY {
            self.refuse();
            self.is_lost = true;
            self.counters.skip(bytes.len());
        } else {
            self.buffer.extend(bytes);
        }
    }

    /// The port lost bytes: what was begun is of no use.
    pub fn interrupt(&mut self) {
        self.counters.port_errors = self.counters.port_errors.wrapping_add(1);
        self.forget();
        // Bytes came at an unknown time; and only silence says where the next frame begins.
        self.last = None;
        self.is_lost = matches!(P::PAUSE, Some(Pause::Delimits(_)));
    }

    /// Counters of the frames and bytes so far.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// No byte has come until `at`.
    fn listen_for_pause(&mut self, at: Micros, hear: &mut impl FnMut(P::Message)) {
        let Some(pause) = P::PAUSE else { return };
        let last = *self.last.get_or_insert(at);
        if at.since(last) < pause.length() {
            return;
        }
        match pause {
            Pause::Ends(_) => self.search_buffer(true, hear),
            Pause::Delimits(_) => self.judge(hear),
        }
        self.is_lost = false;
    }

    /// Judges the bytes between two pauses, and takes them out of the buffer.
    fn judge(&mut self, hear: &mut impl FnMut(P::Message)) {
        let bytes = self.buffer.bytes();
        let Some(frames) = whole_frames(&self.protocol, bytes, |_| {}) else {
            self.refuse();
            return;
        };
        whole_frames(&self.protocol, bytes, hear);
        self.counters.frames = self.counters.frames.wrapping_add(frames);
        self.buffer.remove(bytes.len());
    }

    /// Nothing in the buffer is believed.
    fn refuse(&mut self) {
        self.counters.damaged = self.counters.damaged.wrapping_add(1);
        self.forget();
    }

    fn forget(&mut self) {
        let count = self.buffer.bytes().len();
        self.counters.skip(count);
        self.buffer.remove(count);
        self.needed = 1;
    }

    /// Takes from the buffer whatever can be judged: everything, if what was sent `is_over`.
    fn search_buffer(&mut self, is_over: bool, hear: &mut impl FnMut(P::Message)) {
        let Self { protocol, buffer, counters, .. } = self;
        let (judged, needed) = search(protocol, buffer.bytes(), is_over, counters, hear);
        buffer.remove(judged);
        self.needed = needed;
    }
}

/// Looks for frames: the bytes judged (all, if what was sent `is_over`), and those needed next.
fn search<P: Protocol>(
    protocol: &P,
    bytes: &[u8],
    is_over: bool,
    counters: &mut Counters,
    hear: &mut impl FnMut(P::Message),
) -> (usize, usize) {
    let mut from = 0;
    while let Some(left) = bytes.get(from..).filter(|left| !left.is_empty()) {
        match protocol.examine(left) {
            Found::More(needed)
                if !is_over && needed > left.len() && needed <= P::Buffer::CAPACITY =>
            {
                return (from, needed);
            }
            Found::Frame(length, message) => {
                counters.frames = counters.frames.wrapping_add(1);
                hear(message);
                from += length.max(1);
            }
            Found::Other(length) => {
                counters.frames = counters.frames.wrapping_add(1);
                from += length.max(1);
            }
            unsound => {
                if matches!(unsound, Found::Damaged) {
                    counters.damaged = counters.damaged.wrapping_add(1);
                }
                counters.skip(1);
                from += 1;
            }
        }
    }
    (bytes.len(), 1)
}

/// Goes through frames that stand one behind the other; how many, if they fill all of these bytes.
fn whole_frames<P: Protocol>(
    protocol: &P,
    mut bytes: &[u8],
    mut hear: impl FnMut(P::Message),
) -> Option<u32> {
    let mut count = 0;
    while !bytes.is_empty() {
        let length = match protocol.examine(bytes) {
            Found::Frame(length, message) => {
                hear(message);
                length
            }
            Found::Other(length) => length,
            Found::More(_) | Found::Nothing | Found::Damaged => return None,
        };
        bytes = bytes.get(length.max(1)..)?;
        count += 1;
    }
    Some(count)
}
