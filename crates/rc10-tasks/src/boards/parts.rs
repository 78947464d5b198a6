//! Values of topics as frames: up to four of them, each with a number and seven bytes.

use rc10_time::Micros;

/// Bytes of a value in a frame; the first byte is the [head](head).
pub(super) const BYTES: usize = 7;
/// Most bytes of a value.
pub const LONGEST: usize = 4 * BYTES;
/// Values are numbered up to this.
const NUMBERS: u8 = 64;
/// As many values may be missed and still be counted.
const MISSED: u64 = 24;

/// The first byte of a frame: the value's number, and in the upper bits one less than its frames.
const fn head(number: u8, frames: usize) -> u8 {
    (number % NUMBERS) | (((frames - 1) as u8) << 6)
}

/// A value that is told.
#[derive(Clone, Copy)]
pub(super) struct Outgoing {
    pub(super) bytes: [u8; LONGEST],
    len: u8,
    number: u8,
    is_new: bool,
    /// From then on the next one may leave.
    next: Micros,
}

impl Outgoing {
    pub(super) const NEW: Self =
        Self { bytes: [0; LONGEST], len: 0, number: 0, is_new: false, next: Micros::ZERO };

    pub(super) fn set(&mut self, bytes: &[u8]) {
        self.bytes[..bytes.len()].copy_from_slice(bytes);
        (self.len, self.is_new) = (bytes.len() as u8, true);
    }

    /// The value, if there is a new one and it may leave now.
    pub(super) fn due(&mut self, period: Micros, now: Micros) -> Option<Self> {
        if !self.is_new || now < self.next {
            return None;
        }
        // On a grid, so that a late look does not make it slower.
        let is_late_look = now.since(self.next) < Micros::from_millis(1);
        self.next = if is_late_look { self.next + period } else { now + period };
        (self.is_new, self.number) = (false, self.number.wrapping_add(1) % NUMBERS);
        Some(*self)
    }

    /// Its frames: number and data.
    pub(super) fn frames(&self) -> impl Iterator<Item = (u8, heapless::Vec<u8, 8>)> {
        let bytes = &self.bytes[..usize::from(self.len)];
        let frames = bytes.len().div_ceil(BYTES).max(1);
        (0..frames).map(move |frame| {
            let piece = bytes.get(frame * BYTES..).unwrap_or_default();
            let mut data = heapless::Vec::new();
            let _ = data.push(head(self.number, frames));
            let _ = data.extend_from_slice(&piece[..piece.len().min(BYTES)]);
            (frame as u8, data)
        })
    }
}

/// A value that is heard.
#[derive(Clone, Copy)]
pub(super) struct Incoming {
    /// The value whose frames come: its head, a bit for each that has come, and the bytes.
    head: u8,
    come: u8,
    bytes: [u8; LONGEST],
    len: usize,
    /// The newest whole one.
    whole: [u8; LONGEST],
    whole_len: usize,
    at: Option<Micros>,
    number: u8,
    /// Whether the next number follows that.
    is_numbered: bool,
    pub(super) lost: u32,
}

impl Incoming {
    pub(super) const NEW: Self = Self {
        head: 0,
        come: 0,
        bytes: [0; LONGEST],
        len: 0,
        whole: [0; LONGEST],
        whole_len: 0,
        at: None,
        number: 0,
        is_numbered: false,
        lost: 0,
    };

    pub(super) const fn lost(&self) -> u32 {
        self.lost
    }

    pub(super) fn newest(&self) -> Option<(&[u8], Micros)> {
        Some((&self.whole[..self.whole_len], self.at?))
    }

    /// The other board is heard anew. Behind its start, and many periods without a value, its numbers say nothing.
    pub(super) fn start(&mut self, may_be_new: bool, period: Micros, at: Micros) {
        let values = self.at.map_or(0, |since| at.since(since).get() / period.get());
        self.is_numbered &= !may_be_new && values < MISSED;
        self.come = 0;
    }

    /// Takes a frame. A second one of the same, and one of a value that is whole already, changes nothing.
    pub(super) fn take(&mut self, frame: u8, data: &[u8], at: Micros) {
        let Some((head, piece)) = data.split_first() else { return };
        let (number, frames) = (head % NUMBERS, (head >> 6) + 1);
        let is_last = frame + 1 == frames;
        if frame >= frames || !is_last && piece.len() != BYTES || piece.len() > BYTES {
            return;
        }
        // It comes twice, or from before.
        let ahead = number.wrapping_sub(self.number) % NUMBERS;
        if self.is_numbered && (ahead == 0 || ahead > NUMBERS / 2) {
            return;
        }
        if *head != self.head {
            (self.head, self.come, self.len) = (*head, 0, 0);
        }
        let from = usize::from(frame) * BYTES;
        self.bytes[from..from + piece.len()].copy_from_slice(piece);
        self.come |= 1 << frame;
        if is_last {
            self.len = from + piece.len();
        }
        if self.come == (1_u8 << frames) - 1 {
            if self.is_numbered {
                self.lost = self.lost.saturating_add(u32::from(ahead) - 1);
            }
            (self.whole, self.whole_len) = (self.bytes, self.len);
            (self.number, self.is_numbered) = (number, true);
            (self.at, self.come) = (Some(at), 0);
        }
    }
}
