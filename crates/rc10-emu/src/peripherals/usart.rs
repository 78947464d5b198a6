//! USARTs and UARTs with baud timing (RM0468, USART chapter): asynchronous mode, with or without
//! FIFOs of 16, DMA requests.
//!
//! Not modelled, and reported when asked for: synchronous, half-duplex, LIN, infrared and smartcard
//! modes, swapped pins, receiver timeout, FIFO thresholds, automatic baud rate, break characters.
//! Further: inverted levels are taken to be inverted at both ends; parity is right on every byte
//! that comes in; error flags belong to the receiver, not to a byte in the FIFO; no idle frame is
//! sent when the transmitter is switched on.

use std::collections::VecDeque;

use rc10_sim::Nanos;

use super::access::{Refusal, Write};

/// What one UART is called, and how it is wired inside the chip.
#[derive(Debug)]
pub(super) struct Facts {
    /// The number in its name.
    pub number: u8,
    /// 0: clocked from APB1, 1: from APB2.
    pub bus: usize,
    /// Number of its interrupt.
    pub interrupt: usize,
    /// DMAMUX1's number of its receive request; the transmit request is the next one.
    pub receive_request: u32,
}

const fn facts(number: u8, bus: usize, interrupt: usize, receive_request: u32) -> Facts {
    Facts { number, bus, interrupt, receive_request }
}

/// USART1, 2, 3, UART4, 5, USART6, UART7, 8, 9, USART10. Source: stm32-metapac.
pub(super) const USARTS: [Facts; 10] = [
    facts(1, 1, 37, 41),
    facts(2, 0, 38, 43),
    facts(3, 0, 39, 45),
    facts(4, 0, 52, 63),
    facts(5, 0, 53, 65),
    facts(6, 1, 71, 71),
    facts(7, 0, 82, 79),
    facts(8, 0, 83, 81),
    facts(9, 1, 155, 116),
    facts(10, 1, 156, 118),
];

/// A byte that has left at a transmit pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SentByte {
    /// 1 for USART1 ..= 10 for USART10.
    pub uart: u8,
    /// Data bits, 7 to 9 of them, without parity.
    pub value: u16,
    /// Start of its start bit.
    pub start: Nanos,
    /// End of its last stop bit.
    pub end: Nanos,
}

/// A byte on its way in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Incoming {
    pub value: u16,
    pub baud: u32,
    pub start: Nanos,
    pub end: Nanos,
}

// CR1.
const ENABLE: u32 = 1 << 0;
const RECEIVER: u32 = 1 << 2;
const TRANSMITTER: u32 = 1 << 3;
const PARITY: u32 = 1 << 10;
const OVERSAMPLE_8: u32 = 1 << 15;
const FIFOS: u32 = 1 << 29;
/// RTOIE, EOBIE, MME, CMIE.
const CR1_UNMODELLED: u32 = 1 << 26 | 1 << 27 | 1 << 13 | 1 << 14;
/// LBDIE, CLKEN, LINEN, SWAP, ABREN, RTOEN.
const CR2_UNMODELLED: u32 = 1 << 6 | 1 << 11 | 1 << 14 | 1 << 15 | 1 << 20 | 1 << 23;
// CR3.
const ERROR_INTERRUPT: u32 = 1 << 0;
const DMA_RECEIVE: u32 = 1 << 6;
const DMA_TRANSMIT: u32 = 1 << 7;
const OVERRUN_DISABLE: u32 = 1 << 12;
/// IREN, HDSEL, SCEN, RTSE, CTSE, TXFTIE, RXFTIE.
const CR3_UNMODELLED: u32 = 1 << 1 | 1 << 3 | 1 << 5 | 1 << 8 | 1 << 9 | 1 << 23 | 1 << 28;

// ISR.
const FRAMING: u32 = 1 << 1;
const NOISE: u32 = 1 << 2;
const OVERRUN: u32 = 1 << 3;
const IDLE: u32 = 1 << 4;
const RECEIVED: u32 = 1 << 5;
const COMPLETE: u32 = 1 << 6;
const ROOM: u32 = 1 << 7;
const BUSY: u32 = 1 << 16;
const TRANSMIT_ACKNOWLEDGE: u32 = 1 << 21;
const RECEIVE_ACKNOWLEDGE: u32 = 1 << 22;
const TRANSMIT_EMPTY: u32 = 1 << 23;
const RECEIVE_FULL: u32 = 1 << 24;
/// Flags that stay until ICR clears them.
const STICKY: u32 = 1 | FRAMING | NOISE | OVERRUN | IDLE | COMPLETE;

const FIFO_DEPTH: usize = 16;
/// How far a sender's baud rate may be off, in 1/1000. RM0468, tolerance of the receiver: 3.3 to
/// 4.5 %, depending on the settings.
const TOLERANCE: u64 = 35;
/// PRESC.
const PRESCALERS: [u64; 12] = [1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256];

#[derive(Debug)]
pub(super) struct Usart {
    facts: &'static Facts,
    hz: u64,
    control: [u32; 3],
    divisor: u32,
    prescaler: u32,
    /// GTPR, RTOR: only stored.
    stored: [u32; 2],
    flags: u32,
    to_send: VecDeque<u16>,
    sending: Option<SentByte>,
    received: VecDeque<u16>,
    incoming: VecDeque<Incoming>,
    /// When the line will have been idle for a whole frame.
    idle_at: Option<Nanos>,
    /// Whether pins lead to the receiver and from the transmitter.
    pub pins: (bool, bool),
    sent: Vec<SentByte>,
}

impl Usart {
    pub(super) const fn new(facts: &'static Facts) -> Self {
        Self {
            facts,
            hz: 0,
            control: [0; 3],
            divisor: 0,
            prescaler: 0,
            stored: [0; 2],
            flags: COMPLETE,
            to_send: VecDeque::new(),
            sending: None,
            received: VecDeque::new(),
            incoming: VecDeque::new(),
            idle_at: None,
            pins: (false, false),
            sent: Vec::new(),
        }
    }

    /// What is outside stays: its pins, bytes on their way in, bytes that have left.
    pub(super) fn reset(&mut self) {
        let fresh = Self::new(self.facts);
        let old = std::mem::replace(self, fresh);
        self.hz = old.hz;
        self.pins = old.pins;
        self.incoming = old.incoming;
        self.sent = old.sent;
    }

    /// Its kernel clock from now on; 0 if gated. A byte on its way keeps its length.
    pub(super) const fn set_clock(&mut self, hz: u64) {
        self.hz = hz;
    }

    pub(super) fn take_sent(&mut self) -> Vec<SentByte> {
        std::mem::take(&mut self.sent)
    }

    pub(super) fn feed(&mut self, incoming: Incoming) {
        self.incoming.push_back(incoming);
    }

    const fn is(&self, register: usize, bits: u32) -> bool {
        self.control[register - 1] & bits == bits
    }

    fn capacity(&self) -> usize {
        if self.is(1, FIFOS) { FIFO_DEPTH } else { 1 }
    }

    /// Kernel clocks of one bit, times two; `None` if the baud rate is not set.
    fn clocks_of_two_bits(&self) -> Option<u64> {
        let prescaler = PRESCALERS.get(self.prescaler as usize)?;
        let divisor = u64::from(self.divisor);
        let (divider, twice) = if self.is(1, OVERSAMPLE_8) {
            (divisor & 0xFFF0 | (divisor & 7) << 1, 1)
        } else {
            (divisor, 2)
        };
        (divider >= 16 && self.hz != 0).then_some(divider * prescaler * twice)
    }

    fn baud(&self) -> Option<u64> {
        Some(2 * self.hz / self.clocks_of_two_bits()?)
    }

    /// Bits between start and stop, parity included (M0 and M1).
    const fn word(&self) -> u32 {
        match (self.control[0] >> 28 & 1, self.control[0] >> 12 & 1) {
            (0, 0) => 8,
            (0, _) => 9,
            _ => 7,
        }
    }

    fn data_mask(&self) -> u16 {
        let bits = self.word() - u32::from(self.is(1, PARITY));
        (1 << bits) - 1
    }

    /// How long a frame is: start bit, word, stop bits.
    fn frame(&self) -> Option<Nanos> {
        // STOP: 1, 0.5, 2, 1.5 bits.
        let half_stops = [2, 1, 4, 3][(self.control[1] >> 12 & 3) as usize];
        let half_bits = u128::from(2 + 2 * self.word() + half_stops);
        let clocks_times_4 = half_bits * u128::from(self.clocks_of_two_bits()?);
        let nanos = (clocks_times_4 * 1_000_000_000).div_ceil(u128::from(4 * self.hz));
        u64::try_from(nanos).ok().map(Nanos::new)
    }

    /// Starts the next byte, if there is one and the line is free.
    fn send_next(&mut self, now: Nanos) {
        if self.sending.is_some() || !self.is(1, ENABLE | TRANSMITTER) {
            return;
        }
        let Some(frame) = self.frame() else { return };
        if let Some(value) = self.to_send.pop_front() {
            let value = value & self.data_mask();
            let uart = self.facts.number;
            self.sending = Some(SentByte { uart, value, start: now, end: now + frame });
        }
    }

    fn receive(&mut self, incoming: Incoming) {
        if !self.is(1, ENABLE | RECEIVER) || !self.pins.0 {
            return;
        }
        let Some(baud) = self.baud() else { return };
        let theirs = u64::from(incoming.baud);
        let understood = baud.abs_diff(theirs) * 1000 <= baud * TOLERANCE;
        let value = if understood { incoming.value & self.data_mask() } else { 0 };
        if !understood {
            self.flags |= FRAMING;
        }
        if self.received.len() < self.capacity() {
            self.received.push_back(value);
        } else if self.is(3, OVERRUN_DISABLE) {
            self.received.pop_back();
            self.received.push_back(value);
        } else {
            self.flags |= OVERRUN;
        }
        self.idle_at = self.frame().map(|frame| incoming.end + frame);
    }

    pub(super) fn next_event(&self) -> Option<Nanos> {
        let sent = self.sending.map(|byte| byte.end);
        let received = self.incoming.front().map(|byte| byte.end);
        [sent, received, self.idle_at].into_iter().flatten().min()
    }

    pub(super) fn advance(&mut self, now: Nanos) {
        while let Some(at) = self.next_event().filter(|&at| at <= now) {
            if let Some(byte) = self.sending.take_if(|byte| byte.end == at) {
                if self.pins.1 {
                    self.sent.push(byte);
                }
                self.send_next(at);
                if self.sending.is_none() {
                    self.flags |= COMPLETE;
                }
            }
            if self.incoming.front().is_some_and(|byte| byte.end == at)
                && let Some(byte) = self.incoming.pop_front()
            {
                self.receive(byte);
            }
            if let Some(idle) = self.idle_at.take_if(|idle| *idle == at) {
                // Another byte may have begun.
                if self.incoming.front().is_none_or(|next| next.start >= idle) {
                    self.flags |= IDLE;
                }
            }
        }
    }

    fn status(&self, now: Nanos) -> u32 {
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        let on = self.is(1, ENABLE);
        self.flags
            | flag(!self.received.is_empty(), RECEIVED)
            | flag(self.to_send.len() < self.capacity(), ROOM)
            | flag(self.incoming.front().is_some_and(|byte| byte.start <= now), BUSY)
            | flag(on && self.is(1, TRANSMITTER), TRANSMIT_ACKNOWLEDGE)
            | flag(on && self.is(1, RECEIVER), RECEIVE_ACKNOWLEDGE)
            | flag(self.is(1, FIFOS) && self.to_send.is_empty(), TRANSMIT_EMPTY)
            | flag(self.is(1, FIFOS) && self.received.len() == FIFO_DEPTH, RECEIVE_FULL)
    }

    /// Number of its interrupt, if it is asked for.
    pub(super) fn interrupt(&self) -> Option<usize> {
        if !self.is(1, ENABLE) {
            return None;
        }
        let status = self.status(Nanos::ZERO);
        // IDLEIE, RXNEIE, TCIE, TXEIE, PEIE, TXFEIE, RXFFIE with their flags.
        let sources = [
            (4, IDLE),
            (5, RECEIVED | OVERRUN),
            (6, COMPLETE),
            (7, ROOM),
            (8, 1),
            (30, TRANSMIT_EMPTY),
            (31, RECEIVE_FULL),
        ];
        let asked = sources.iter().any(|&(bit, flags)| self.is(1, 1 << bit) && status & flags != 0);
        let errors = self.is(3, ERROR_INTERRUPT) && status & (FRAMING | NOISE | OVERRUN) != 0;
        (asked || errors).then_some(self.facts.interrupt)
    }

    /// Whether it asserts a request of DMAMUX1.
    pub(super) fn requests(&self, request: u32) -> bool {
        let (receive, transmit) = (self.facts.receive_request, self.facts.receive_request + 1);
        self.is(1, ENABLE)
            && (request == receive && self.is(3, DMA_RECEIVE) && !self.received.is_empty()
                || request == transmit
                    && self.is(3, DMA_TRANSMIT)
                    && self.to_send.len() < self.capacity())
    }

    pub(super) fn read(&mut self, offset: u32, now: Nanos) -> Result<u32, Refusal> {
        self.advance(now);
        Ok(match offset {
            0x00 | 0x04 | 0x08 => self.control[offset as usize / 4],
            0x0C => self.divisor,
            0x10 | 0x14 => self.stored[(offset as usize - 0x10) / 4],
            0x1C => self.status(now),
            0x24 => self.received.pop_front().map_or(0, u32::from),
            0x18 | 0x20 | 0x28 => 0,
            0x2C => self.prescaler,
            _ => return Err(Refusal::Unmodelled),
        })
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Result<(), Refusal> {
        self.advance(now);
        match write.offset {
            0x00 | 0x04 | 0x08 => {
                let index = write.offset as usize / 4;
                let was_on = self.is(1, ENABLE);
                self.control[index] = write.over(self.control[index]);
                if was_on && !self.is(1, ENABLE) {
                    // RM0468, UE: current operations are discarded, flags are reset.
                    self.to_send.clear();
                    self.received.clear();
                    self.sending = None;
                    self.idle_at = None;
                    self.flags = COMPLETE;
                }
                self.send_next(now);
                let unmodelled = [CR1_UNMODELLED, CR2_UNMODELLED, CR3_UNMODELLED][index];
                if self.control[index] & unmodelled != 0 {
                    return Err(Refusal::Unmodelled);
                }
            }
            // BRR, PRESC: locked while enabled.
            0x0C | 0x2C if self.is(1, ENABLE) => return Err(Refusal::Protected),
            0x0C => self.divisor = write.over(self.divisor) & 0xFFFF,
            0x2C => self.prescaler = write.over(self.prescaler) & 0xF,
            0x10 | 0x14 => {
                let stored = &mut self.stored[(write.offset as usize - 0x10) / 4];
                *stored = write.over(*stored);
            }
            0x18 => {
                if write.ones() & 1 << 3 != 0 {
                    self.received.clear();
                }
                if write.ones() & 1 << 4 != 0 {
                    self.to_send.clear();
                }
                if write.ones() & 0b111 != 0 {
                    return Err(Refusal::Unmodelled);
                }
            }
            0x20 => self.flags &= !(write.ones() & STICKY),
            0x28 => {
                self.flags &= !COMPLETE;
                if self.to_send.len() == self.capacity() {
                    // The register is overwritten; a full FIFO takes nothing.
                    if self.is(1, FIFOS) {
                        return Err(Refusal::Protected);
                    }
                    self.to_send.clear();
                }
                // Nine bits at most.
                self.to_send.push_back(u16::try_from(write.ones() & 0x1FF).unwrap_or(0));
                self.send_next(now);
            }
            // ISR and RDR cannot be written.
            0x1C | 0x24 => {}
            _ => return Err(Refusal::Unmodelled),
        }
        Ok(())
    }
}
