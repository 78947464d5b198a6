//! Selection of the next transmit buffer, and its outcome (RM0468, "Tx handling").
//!
//! A request takes effect at once; the registers tell it later. While the controller scans for its
//! most urgent buffer, further requests stay in TXBAR ("the bits remain set until the Tx scan
//! process has completed") and are not in TXBRP. A cancellation has to cross to the kernel clock:
//! until it is done the buffer is in TXBCR and TXBRP, and a new request for it is lost.

use rc10_can::CanFrame;
use rc10_sim::Nanos;

use super::counters::Counters;
use super::ram::{self, MessageRam};
use super::registers::{Registers, at, cccr, field, ir};
use super::ring::{Put, Ring, Shape};

const BUFFERS: u32 = 32;
/// Elements of the transmit event FIFO at most.
const LARGEST_EVENT_FIFO: u32 = 32;

/// TXEFC's event type: sent, or sent in spite of cancellation (always so without retransmission).
const SENT: u32 = 1 << 22;
const SENT_IN_SPITE: u32 = 2 << 22;
/// Second word of a buffer: a CAN FD frame.
const FD_FORMAT: u32 = 1 << 21;
/// Second word of a buffer: its transmission is an event.
const EVENT: u32 = 1 << 23;

/// Division of the buffers by TXBC: dedicated ones first, then FIFO or queue.
#[derive(Clone, Copy)]
struct Layout {
    dedicated: u32,
    shared: u32,
    is_queue: bool,
}

impl Layout {
    fn new(registers: &Registers) -> Self {
        let dedicated = registers.field(at::TXBC, 16, 6).min(BUFFERS);
        Self {
            dedicated,
            shared: registers.field(at::TXBC, 24, 6).min(BUFFERS - dedicated),
            is_queue: registers.has(at::TXBC, 1 << 30),
        }
    }

    /// A bit for each buffer below this one.
    fn below(buffer: u32) -> u32 {
        1_u32.checked_shl(buffer).map_or(u32::MAX, |bit| bit - 1)
    }

    fn all(self) -> u32 {
        Self::below(self.dedicated + self.shared)
    }

    /// Buffer number of the FIFO's element at this offset from `head`.
    const fn element(self, head: u32, offset: u32) -> u32 {
        self.dedicated + (head + offset) % self.shared
    }
}

/// A buffer as it was read for arbitration.
#[derive(Clone, Copy)]
struct Candidate {
    buffer: u32,
    header: u32,
    control: u32,
    /// Timestamp counter at its start of frame.
    timestamp: u32,
    /// Age of its request then.
    age: Nanos,
    /// Not to be repeated if it fails.
    cancelled: bool,
}

#[derive(Default)]
pub(super) struct Transmit {
    /// TXBRP, TXBTO, TXBCF.
    pub pending: u32,
    pub occurred: u32,
    pub cancelled: u32,
    /// TXBAR: requests that came during a scan, and when it ends.
    pub adding: u32,
    scan_ends: Nanos,
    /// Cancellations on their way, and when they are done.
    cancelling: u32,
    cancel_ends: Nanos,
    /// Time of each buffer's last request.
    requested: [Nanos; BUFFERS as usize],
    /// The FIFO's get index, counted from its first buffer, and its elements in use.
    head: u32,
    used: u32,
    events: Ring,
    offered: Option<Candidate>,
    on_wire: Option<Candidate>,
}

/// All functions that end a request return the flags they raise in IR.
impl Transmit {
    /// CCCR.CCE was set; returns the number of requests that were dropped.
    pub fn reset(&mut self) -> u64 {
        u64::from(std::mem::take(self).pending.count_ones())
    }

    /// TXBRP is held in reset (bus monitoring); the number of requests that were dropped.
    pub fn drop_requests(&mut self, registers: &Registers) -> u64 {
        let dropped = std::mem::take(&mut self.pending).count_ones();
        self.release(Layout::new(registers));
        u64::from(dropped)
    }

    pub const fn is_sending(&self) -> bool {
        self.on_wire.is_some()
    }

    /// Does everything that is due by now; `scan` is the time of a scan. Returns flags of IR.
    pub fn settle(&mut self, now: Nanos, scan: Nanos, registers: &Registers) -> u32 {
        if self.adding != 0 && now >= self.scan_ends {
            self.adding = 0;
            // They start the next one.
            self.scan_ends = self.scan_ends + scan;
        }
        if self.cancelling == 0 || now < self.cancel_ends {
            return 0;
        }
        let done = std::mem::take(&mut self.cancelling);
        self.finish_cancellation(done, registers)
    }

    /// Time at which a cancellation is done.
    pub fn next_event(&self) -> Option<Nanos> {
        (self.cancelling != 0).then_some(self.cancel_ends)
    }

    /// TXBRP.
    pub const fn told_pending(&self) -> u32 {
        self.pending & !self.adding | self.cancelling
    }

    /// Number of buffers to scan.
    pub fn buffers(registers: &Registers) -> u64 {
        u64::from(Layout::new(registers).all().count_ones())
    }

    /// TXBAR; `scan` is the time of a scan. Returns the number of requests without effect.
    pub fn request(&mut self, bits: u32, now: Nanos, scan: Nanos, registers: &Registers) -> u64 {
        let layout = Layout::new(registers);
        let new = bits & layout.all() & !self.pending & !self.cancelling;
        if now < self.scan_ends {
            self.adding |= new;
        } else if new != 0 {
            self.scan_ends = now + scan;
        }
        for (buffer, requested) in self.requested.iter_mut().enumerate() {
            if new >> buffer & 1 != 0 {
                *requested = now;
            }
        }
        self.pending |= new;
        self.occurred &= !new;
        self.cancelled &= !new;
        if !layout.is_queue {
            while self.used < layout.shared
                && self.pending >> layout.element(self.head, self.used) & 1 != 0
            {
                self.used += 1;
            }
        }
        u64::from((bits & !new).count_ones())
    }

    /// TXBCR; it is told at `done`.
    pub fn cancel(
        &mut self,
        bits: u32,
        done: Nanos,
        registers: &Registers,
        counters: &mut Counters,
    ) -> u32 {
        let layout = Layout::new(registers);
        let mut now = bits & layout.all();
        if let Some(sending) = &mut self.on_wire
            && now >> sending.buffer & 1 != 0
        {
            // It is over when the transmission is, one way or the other.
            sending.cancelled = true;
            now &= !(1 << sending.buffer);
        }
        counters.cancelled += u64::from((self.pending & now).count_ones());
        self.pending &= !now;
        self.adding &= !now;
        if now != 0 {
            self.cancelling |= now;
            self.cancel_ends = done;
        }
        self.release(layout)
    }

    fn finish_cancellation(&mut self, bits: u32, registers: &Registers) -> u32 {
        self.cancelled |= bits;
        if bits & registers.at(at::TXBCIE) != 0 { ir::TCF } else { 0 }
    }

    /// TXBCR: the buffers whose cancellation is not done, and those that are over only when their
    /// transmission is.
    pub fn being_cancelled(&self) -> u32 {
        let sending = self.on_wire.filter(|sending| sending.cancelled);
        self.cancelling | sending.map_or(0, |sending| 1 << sending.buffer)
    }

    /// The FIFO's get index moves on over buffers that are done.
    fn release(&mut self, layout: Layout) -> u32 {
        let before = self.used;
        while self.used > 0 && self.pending >> layout.element(self.head, 0) & 1 == 0 {
            self.head = (self.head + 1) % layout.shared;
            self.used -= 1;
        }
        if self.used == 0 && before > 0 { ir::TFE } else { 0 }
    }

    /// TXFQS.
    pub fn status(&self, registers: &Registers) -> u32 {
        let layout = Layout::new(registers);
        if layout.shared == 0 {
            return 0;
        }
        if layout.is_queue {
            let free = layout.all() & !Layout::below(layout.dedicated) & !self.pending;
            return if free == 0 { 1 << 21 } else { free.trailing_zeros() << 16 };
        }
        let full = u32::from(self.used == layout.shared);
        (layout.shared - self.used)
            | layout.element(self.head, 0) << 8
            | layout.element(self.head, self.used) << 16
            | full << 21
    }

    fn read(&self, buffer: u32, registers: &Registers, ram: &mut MessageRam) -> Candidate {
        let address = Self::address(buffer, registers);
        let (header, control) = (ram.load(address), ram.load(address + 1));
        Candidate { buffer, header, control, timestamp: 0, age: Nanos::ZERO, cancelled: false }
    }

    fn address(buffer: u32, registers: &Registers) -> u32 {
        let words = ram::element_words(registers.field(at::TXESC, 0, 3));
        registers.start_word(at::TXBC) + buffer * words
    }

    /// The most urgent frame: lowest identifier of the dedicated buffers and the FIFO's head, or
    /// of all buffers with a queue; of equal ones, the lowest buffer. CAN FD frames that it meets
    /// are cancelled: returns the flags of that too.
    pub fn offer(
        &mut self,
        registers: &Registers,
        ram: &mut MessageRam,
        counters: &mut Counters,
    ) -> (Option<CanFrame>, u32) {
        let layout = Layout::new(registers);
        let mut flags = 0;
        loop {
            let mut eligible = self.pending & layout.all();
            if !layout.is_queue {
                eligible &= Layout::below(layout.dedicated);
                if self.used > 0 {
                    eligible |= 1 << layout.element(self.head, 0);
                }
            }
            let best = (0..BUFFERS)
                .filter(|buffer| eligible >> buffer & 1 != 0)
                .map(|buffer| self.read(buffer, registers, ram))
                .min_by_key(|candidate| (ram::urgency(candidate.header), candidate.buffer));
            self.offered = best;
            let Some(candidate) = best else { return (None, flags) };
            if candidate.control & FD_FORMAT == 0 || !registers.has(at::CCCR, cccr::FDOE) {
                let address = Self::address(candidate.buffer, registers);
                let data = [ram.load(address + 2), ram.load(address + 3)];
                let frame = ram::frame(candidate.header, candidate.control, data);
                return (Some(frame), flags);
            }
            counters.fd_refused += 1;
            flags |= self.give_up(candidate.buffer, registers, counters);
        }
    }

    /// The offered frame is on the wire since now.
    pub fn start(&mut self, timestamp: u32, now: Nanos) {
        self.on_wire = self.offered.take().map(|offered| {
            let age = now.since(self.requested[offered.buffer as usize % self.requested.len()]);
            Candidate { timestamp, age, ..offered }
        });
    }

    /// The offered frame lost arbitration.
    pub fn lost_arbitration(&mut self, registers: &Registers, counters: &mut Counters) -> u32 {
        match self.offered.take() {
            Some(offered) if registers.has(at::CCCR, cccr::DAR) => {
                self.give_up(offered.buffer, registers, counters)
            }
            _ => 0,
        }
    }

    /// The controller stops in mid-frame; what it sent stays pending unless it was cancelled.
    pub fn abort(&mut self, registers: &Registers, counters: &mut Counters) -> u32 {
        match self.on_wire.take() {
            Some(sending) if sending.cancelled => self.give_up(sending.buffer, registers, counters),
            _ => 0,
        }
    }

    /// A request ends without its frame having been sent.
    fn give_up(&mut self, buffer: u32, registers: &Registers, counters: &mut Counters) -> u32 {
        self.pending &= !(1 << buffer);
        counters.cancelled += 1;
        self.finish_cancellation(1 << buffer, registers) | self.release(Layout::new(registers))
    }

    /// The frame on the wire failed.
    pub fn failed(&mut self, registers: &Registers, counters: &mut Counters) -> u32 {
        let Some(sending) = self.on_wire.take() else { return 0 };
        counters.failed += 1;
        if sending.cancelled || registers.has(at::CCCR, cccr::DAR) {
            self.give_up(sending.buffer, registers, counters)
        } else {
            0
        }
    }

    /// The frame on the wire was acknowledged.
    pub fn succeeded(
        &mut self,
        registers: &Registers,
        ram: &mut MessageRam,
        counters: &mut Counters,
    ) -> u32 {
        let Some(sending) = self.on_wire.take() else { return 0 };
        let bit = 1 << sending.buffer;
        counters.sent += 1;
        counters.oldest_sent = counters.oldest_sent.max(sending.age);
        self.pending &= !bit;
        self.occurred |= bit;
        let mut flags = if bit & registers.at(at::TXBTIE) != 0 { ir::TC } else { 0 };
        if sending.cancelled {
            flags |= self.finish_cancellation(bit, registers);
        }
        flags |= self.release(Layout::new(registers));
        if sending.control & EVENT != 0 {
            flags |= self.tell(sending, registers, ram, counters);
        }
        flags
    }

    fn tell(
        &mut self,
        sent: Candidate,
        registers: &Registers,
        ram: &mut MessageRam,
        counters: &mut Counters,
    ) -> u32 {
        let shape = Self::event_shape(registers);
        let Put::Kept(index) = self.events.put(shape) else {
            counters.events_lost += 1;
            return ir::TEFL;
        };
        let in_spite = sent.cancelled || registers.has(at::CCCR, cccr::DAR);
        let kind = if in_spite { SENT_IN_SPITE } else { SENT };
        let marker = field(sent.control, 24, 8) << 24;
        let address = registers.start_word(at::TXEFC) + 2 * index;
        ram.store(address, sent.header);
        ram.store(address + 1, marker | kind | sent.control & 0xF << 16 | sent.timestamp);
        let level = self.events.level();
        let watermark = if level == shape.watermark { ir::TEFW } else { 0 };
        let full = if level == shape.size { ir::TEFF } else { 0 };
        ir::TEFN | watermark | full
    }

    fn event_shape(registers: &Registers) -> Shape {
        // Bit 31 is reserved in TXEFC and reads as 0: no overwriting.
        Shape::new(registers.at(at::TXEFC), LARGEST_EVENT_FIFO)
    }

    /// TXEFS without its element-lost bit.
    pub fn event_status(&self, registers: &Registers) -> u32 {
        self.events.status(Self::event_shape(registers))
    }

    /// TXEFA; `false` if that event is not in the FIFO.
    pub fn acknowledge_event(&mut self, index: u32, registers: &Registers) -> bool {
        self.events.acknowledge(index & 0x1F, Self::event_shape(registers))
    }
}
