//! Selection of the next transmit buffer, and its outcome (RM0468, "Tx handling").
//!
//! A request takes effect at once; the registers tell it later. While the controller scans for its
//! most urgent buffer, further requests stay in TXBAR ("the bits remain set until the Tx scan
//! process has completed") and are not in TXBRP. A cancellation has to cross to the kernel clock:
//! until it is done the buffer is in TXBCR and TXBRP, and a new request for it is lost.

use rc10_can::CanFrame;
use rc10_sim::Nanos;

use super::controller::Controller;
use super::ram::{self, MessageRam};
use super::registers::{at, cccr, ir};
use super::ring::EVENTS;
use crate::peripherals::registers::field;
use crate::time::time_of;

const BUFFERS: u32 = 32;
/// Periods of a scan for each buffer: a word of the message RAM. Our estimate.
const SCAN: u64 = 4;

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
    requested: [Nanos; BUFFERS as usize],
    /// The FIFO's get index, counted from its first buffer, and its elements in use.
    head: u32,
    used: u32,
    offered: Option<Candidate>,
    on_wire: Option<Candidate>,
}

impl Transmit {
    pub const fn is_sending(&self) -> bool {
        self.on_wire.is_some()
    }

    pub fn next_event(&self) -> Option<Nanos> {
        (self.cancelling != 0).then_some(self.cancel_ends)
    }

    /// TXBRP.
    pub const fn told_pending(&self) -> u32 {
        self.pending & !self.adding | self.cancelling
    }

    /// TXBCR: buffers whose cancellation is not done, or waits for their transmission.
    pub fn being_cancelled(&self) -> u32 {
        let sending = self.on_wire.filter(|sending| sending.cancelled);
        self.cancelling | sending.map_or(0, |sending| 1 << sending.buffer)
    }

    /// The FIFO's get index moves on over buffers that are done; the flag that this raises in IR.
    fn release(&mut self, layout: Layout) -> u32 {
        let before = self.used;
        while self.used > 0 && self.pending >> layout.element(self.head, 0) & 1 == 0 {
            self.head = (self.head + 1) % layout.shared;
            self.used -= 1;
        }
        if self.used == 0 && before > 0 { ir::TFE } else { 0 }
    }
}

impl Controller {
    fn layout(&self) -> Layout {
        let dedicated = self.registers.field(at::TXBC, 16, 6).min(BUFFERS);
        let shared = self.registers.field(at::TXBC, 24, 6).min(BUFFERS - dedicated);
        Layout { dedicated, shared, is_queue: self.registers.has(at::TXBC, 1 << 30) }
    }

    /// CCCR.CCE was set: requests are dropped.
    pub fn reset_transmit(&mut self) {
        let dropped = std::mem::take(&mut self.transmit).pending;
        self.counters.cancelled += u64::from(dropped.count_ones());
    }

    /// TXBRP is held in reset (bus monitoring): requests are dropped.
    pub fn drop_requests(&mut self) {
        let dropped = std::mem::take(&mut self.transmit.pending);
        self.counters.cancelled += u64::from(dropped.count_ones());
        self.transmit.release(self.layout());
    }

    /// Duration of a scan for the most urgent buffer.
    fn scan(&self) -> Nanos {
        if self.kernel_hz == 0 {
            return Nanos::ZERO;
        }
        let buffers = u64::from(self.layout().all().count_ones());
        time_of(SCAN * buffers, self.kernel_hz)
    }

    /// Does everything that is due by now.
    pub fn settle_transmit(&mut self) {
        if self.transmit.adding != 0 && self.now >= self.transmit.scan_ends {
            self.transmit.adding = 0;
            // They start the next one.
            self.transmit.scan_ends = self.transmit.scan_ends + self.scan();
        }
        if self.transmit.cancelling != 0 && self.now >= self.transmit.cancel_ends {
            let done = std::mem::take(&mut self.transmit.cancelling);
            self.finish_cancellation(done);
        }
    }

    pub fn request(&mut self, bits: u32) {
        let (layout, scan, now) = (self.layout(), self.scan(), self.now);
        let transmit = &mut self.transmit;
        let new = bits & layout.all() & !transmit.pending & !transmit.cancelling;
        if now < transmit.scan_ends {
            transmit.adding |= new;
        } else if new != 0 {
            transmit.scan_ends = now + scan;
        }
        for (buffer, requested) in transmit.requested.iter_mut().enumerate() {
            if new >> buffer & 1 != 0 {
                *requested = now;
            }
        }
        transmit.pending |= new;
        transmit.occurred &= !new;
        transmit.cancelled &= !new;
        if !layout.is_queue {
            while transmit.used < layout.shared
                && transmit.pending >> layout.element(transmit.head, transmit.used) & 1 != 0
            {
                transmit.used += 1;
            }
        }
        self.counters.requests_ignored += u64::from((bits & !new).count_ones());
    }

    /// TXBCR; it is told at `done`.
    pub fn cancel(&mut self, bits: u32, done: Nanos) {
        let (layout, transmit) = (self.layout(), &mut self.transmit);
        let mut now = bits & layout.all();
        if let Some(sending) = &mut transmit.on_wire
            && now >> sending.buffer & 1 != 0
        {
            // It is over when the transmission is, one way or the other.
            sending.cancelled = true;
            now &= !(1 << sending.buffer);
        }
        self.counters.cancelled += u64::from((transmit.pending & now).count_ones());
        transmit.pending &= !now;
        transmit.adding &= !now;
        if now != 0 {
            transmit.cancelling |= now;
            transmit.cancel_ends = done;
        }
        self.flags |= transmit.release(layout);
    }

    fn finish_cancellation(&mut self, bits: u32) {
        self.transmit.cancelled |= bits;
        if bits & self.registers.value(at::TXBCIE) != 0 {
            self.flags |= ir::TCF;
        }
    }

    /// TXFQS.
    pub fn queue_status(&self) -> u32 {
        let (layout, &Transmit { head, used, pending, .. }) = (self.layout(), &self.transmit);
        if layout.shared == 0 {
            return 0;
        }
        if layout.is_queue {
            let free = layout.all() & !Layout::below(layout.dedicated) & !pending;
            return if free == 0 { 1 << 21 } else { free.trailing_zeros() << 16 };
        }
        let full = u32::from(used == layout.shared);
        (layout.shared - used)
            | layout.element(head, 0) << 8
            | layout.element(head, used) << 16
            | full << 21
    }

    fn buffer_address(&self, buffer: u32) -> u32 {
        let words = ram::element_words(self.registers.field(at::TXESC, 0, 3));
        self.start_word(at::TXBC) + buffer * words
    }

    fn candidate(&self, buffer: u32, ram: &mut MessageRam) -> Candidate {
        let address = self.buffer_address(buffer);
        let (header, control) = (ram.load(address), ram.load(address + 1));
        Candidate { buffer, header, control, timestamp: 0, age: Nanos::ZERO, cancelled: false }
    }

    /// The most urgent frame: lowest identifier of the dedicated buffers and the FIFO's head, or of
    /// all with a queue, then lowest buffer. CAN FD frames that it meets are cancelled.
    pub fn most_urgent(&mut self, ram: &mut MessageRam) -> Option<CanFrame> {
        let layout = self.layout();
        loop {
            let mut eligible = self.transmit.pending & layout.all();
            if !layout.is_queue {
                eligible &= Layout::below(layout.dedicated);
                if self.transmit.used > 0 {
                    eligible |= 1 << layout.element(self.transmit.head, 0);
                }
            }
            let best = (0..BUFFERS)
                .filter(|buffer| eligible >> buffer & 1 != 0)
                .map(|buffer| self.candidate(buffer, ram))
                .min_by_key(|candidate| (ram::urgency(candidate.header), candidate.buffer));
            self.transmit.offered = best;
            let candidate = best?;
            if candidate.control & FD_FORMAT == 0 || !self.registers.has(at::CCCR, cccr::FDOE) {
                let address = self.buffer_address(candidate.buffer);
                let data = [ram.load(address + 2), ram.load(address + 3)];
                return Some(ram::frame(candidate.header, candidate.control, data));
            }
            self.counters.fd_refused += 1;
            self.give_up(candidate.buffer);
        }
    }

    /// The offered frame is on the wire since now.
    pub fn sending(&mut self, start: Nanos) {
        let timestamp = self.stamp(start);
        let Transmit { requested, offered, on_wire, .. } = &mut self.transmit;
        *on_wire = offered.take().map(|offered| {
            let age = start.since(requested[offered.buffer as usize % requested.len()]);
            Candidate { timestamp, age, ..offered }
        });
    }

    pub fn lost_arbitration(&mut self) {
        let offered = self.transmit.offered.take();
        if let Some(offered) = offered.filter(|_| self.registers.has(at::CCCR, cccr::DAR)) {
            self.give_up(offered.buffer);
        }
    }

    /// The controller stops in mid-frame; what it sent stays pending unless it was cancelled.
    pub fn abort(&mut self) {
        if let Some(sending) = self.transmit.on_wire.take().filter(|sending| sending.cancelled) {
            self.give_up(sending.buffer);
        }
    }

    fn give_up(&mut self, buffer: u32) {
        self.transmit.pending &= !(1 << buffer);
        self.counters.cancelled += 1;
        self.finish_cancellation(1 << buffer);
        self.flags |= self.transmit.release(self.layout());
    }

    pub fn failed(&mut self) {
        let Some(sending) = self.transmit.on_wire.take() else { return };
        self.counters.failed += 1;
        if sending.cancelled || self.registers.has(at::CCCR, cccr::DAR) {
            self.give_up(sending.buffer);
        }
    }

    pub fn succeeded(&mut self, ram: &mut MessageRam) {
        let Some(sending) = self.transmit.on_wire.take() else { return };
        let bit = 1 << sending.buffer;
        self.counters.sent += 1;
        self.counters.oldest_sent = self.counters.oldest_sent.max(sending.age);
        self.transmit.pending &= !bit;
        self.transmit.occurred |= bit;
        if bit & self.registers.value(at::TXBTIE) != 0 {
            self.flags |= ir::TC;
        }
        if sending.cancelled {
            self.finish_cancellation(bit);
        }
        self.flags |= self.transmit.release(self.layout());
        if sending.control & EVENT != 0 {
            self.tell(sending, ram);
        }
    }

    /// Puts a transmission into the event FIFO.
    fn tell(&mut self, sent: Candidate, ram: &mut MessageRam) {
        let Some(index) = self.put(EVENTS) else {
            self.counters.events_lost += 1;
            return;
        };
        let in_spite = sent.cancelled || self.registers.has(at::CCCR, cccr::DAR);
        let kind = if in_spite { SENT_IN_SPITE } else { SENT };
        let marker = field(sent.control, 24, 8) << 24;
        let address = self.start_word(at::TXEFC) + 2 * index;
        ram.store(address, sent.header);
        ram.store(address + 1, marker | kind | sent.control & 0xF << 16 | sent.timestamp);
    }
}
