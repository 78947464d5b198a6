use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use rc10_can::{CanFrame, CanPort, ErrorState, Health, Mailboxes, Queued, Submitted};
use rc10_time::Micros;

use crate::formats::slcan::{BELL, Lines, SlcanCommand, write_frame};

/// What an adapter is told first: whatever was on its line ends, then 1 Mbit/s, no times, and open.
pub const OPEN: &[u8] = b"\r\rC\rS8\rZ0\rO\r";
/// What it is told last.
pub const CLOSE: &[u8] = b"C\r";
/// The answers of some adapters to a frame that they took: no letters of a frame.
const TAKEN: &[u8] = b"zZ";
/// Frames that wait to be read by the robot: more than come in 50 ms of a full bus.
const RECEIVED: usize = 512;

/// Counters of a bus behind an adapter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HostCounts {
    /// Frames that the adapter has heard.
    pub heard: u64,
    /// Frames that it was given to send.
    pub sent: u64,
    /// Frames that it refused, by a bell: its queue is full, or nothing acknowledges.
    pub refused: u64,
    /// Lines of it that are no frames: bytes were lost.
    pub malformed: u64,
}

/// A bus of a robot that runs on this PC, behind an adapter: a state machine without input, output and clock.
#[derive(Default)]
struct Host {
    lines: Lines,
    received: VecDeque<(CanFrame, Micros)>,
    unsent: Mailboxes<32>,
    health: Health,
    counts: HostCounts,
}

/// The port to a bus behind an adapter: for the robot a [`CanPort`], for who moves the bytes the adapter's other end.
///
/// As long as the adapter is gone the bus is off. An adapter tells no errors of its bus: one that hears nothing may be
/// alone there.
#[derive(Clone, Default)]
pub struct HostPort(Rc<RefCell<Host>>);

impl HostPort {
    /// Takes bytes of the adapter, which came at this time.
    pub fn hear(&self, bytes: &[u8], at: Micros) {
        let Host { lines, received, health, counts, .. } = &mut *self.0.borrow_mut();
        counts.refused += bytes.iter().filter(|byte| **byte == BELL).count() as u64;
        let is_of_frame = |byte: &u8| *byte != BELL && !TAKEN.contains(byte);
        let bytes: Vec<u8> = bytes.iter().copied().filter(is_of_frame).collect();
        for line in lines.take(&bytes) {
            match line {
                Ok(SlcanCommand::Send(frame)) if received.len() < RECEIVED => {
                    received.push_back((frame, at));
                    counts.heard += 1;
                }
                Ok(SlcanCommand::Send(_)) => health.receive_lost += 1,
                Ok(_) => {}
                Err(_) => counts.malformed += 1,
            }
        }
    }

    /// Writes all frames that are to leave, the most urgent first.
    pub fn write(&self, out: &mut Vec<u8>) {
        let Host { unsent, counts, .. } = &mut *self.0.borrow_mut();
        while let Some(Queued { frame, .. }) = unsent.pop() {
            write_frame(out, &frame, None);
            counts.sent += 1;
        }
    }

    /// The adapter is there, or gone.
    pub fn plug(&self, is_there: bool) {
        let Host { lines, health, unsent, .. } = &mut *self.0.borrow_mut();
        let state = if is_there { ErrorState::Active } else { ErrorState::BusOff };
        if state == ErrorState::BusOff && health.state != state {
            health.bus_offs += 1;
        }
        health.state = state;
        (*lines, *unsent) = (Lines::default(), Mailboxes::new());
    }

    /// The counters so far.
    pub fn counts(&self) -> HostCounts {
        self.0.borrow().counts
    }
}

impl CanPort for HostPort {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        self.0.borrow_mut().received.pop_front()
    }

    fn submit_as(&mut self, frame: &CanFrame, stream: u32) -> Submitted {
        let Host { unsent, health, .. } = &mut *self.0.borrow_mut();
        if health.state == ErrorState::BusOff {
            return Submitted::Refused;
        }
        unsent.put(Queued { frame: *frame, stream })
    }

    fn cancel_pending(&mut self) -> u8 {
        let unsent = &mut self.0.borrow_mut().unsent;
        let count = std::iter::from_fn(|| unsent.pop()).count();
        count.try_into().unwrap_or(u8::MAX)
    }

    fn health(&self) -> Health {
        self.0.borrow().health
    }
}

#[cfg(test)]
mod tests {
    use rc10_can::embedded_can::StandardId;

    use super::*;

    fn frame(id: u16, data: &[u8]) -> CanFrame {
        CanFrame::data_frame(StandardId::new(id).unwrap(), data).unwrap()
    }

    #[test]
    fn frames_of_the_adapter_are_heard_beside_its_answers() {
        let mut port = HostPort::default();
        // Answers to opening, one of a frame that was taken, and one that was refused; a frame in two pieces.
        port.hear(b"\r\rz\rt2012A", Micros::new(5));
        assert_eq!(port.receive(), None);
        port.hear(b"BCD\r\x07T000005011\rno frame\rt20181", Micros::new(9));
        assert_eq!(port.receive(), Some((frame(0x201, &[0xAB, 0xCD]), Micros::new(9))));
        assert_eq!(port.receive(), None);
        let counts = HostCounts { heard: 1, refused: 1, malformed: 2, ..HostCounts::default() };
        assert_eq!(port.counts(), counts);
    }

    #[test]
    fn only_the_newest_frame_of_a_stream_leaves_and_none_to_an_adapter_that_is_gone() {
        let mut port = HostPort::default();
        let mut out = Vec::new();
        assert_eq!(port.submit(&frame(0x200, &[1])), Submitted::Queued);
        assert_eq!(port.submit(&frame(0x1FF, &[])), Submitted::Queued);
        assert_eq!(port.submit(&frame(0x200, &[2])), Submitted::Replaced);
        port.write(&mut out);
        assert_eq!(out, b"t1FF0\rt200102\r");
        let _ = port.submit(&frame(0x200, &[3]));
        port.plug(false);
        port.plug(false);
        assert_eq!(port.submit(&frame(0x200, &[4])), Submitted::Refused);
        assert_eq!((port.health().state, port.health().bus_offs), (ErrorState::BusOff, 1));
        port.plug(true);
        out.clear();
        port.write(&mut out);
        assert!(out.is_empty() && port.health().state == ErrorState::Active);
        assert_eq!(port.counts().sent, 2);
    }

    #[test]
    fn what_the_robot_does_not_read_is_counted() {
        let mut port = HostPort::default();
        for _ in 0..RECEIVED + 3 {
            port.hear(b"t2010\r", Micros::ZERO);
        }
        assert_eq!(port.health().receive_lost, 3);
        assert_eq!(std::iter::from_fn(|| port.receive()).count(), RECEIVED);
    }
}
