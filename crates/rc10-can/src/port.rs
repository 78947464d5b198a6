use core::fmt;

use embedded_can::nb::Can;
use embedded_can::{Error, ErrorKind, Frame};
use heapless::{Deque, Vec};

use crate::{BusError, CanFrame, Health, IdPattern};
use rc10_time::Micros;

/// A non-blocking port to one CAN bus.
///
/// No method waits. A port keeps **at most one unsent frame per stream** (one identifier, unless
/// the sender says otherwise): nothing stale leaves. Losses are in [`Health`].
pub trait CanPort {
    /// The oldest received frame with its time, where known of its first bit on the wire.
    fn receive(&mut self) -> Option<(CanFrame, Micros)>;

    /// Hands a frame over to be sent instead of an unsent one of the same `stream`, and no other.
    ///
    /// A stream is a [key](CanFrame::key) of the sender's own, an identifier of no other node: for
    /// identifiers that say what is commanded, not only to whom.
    fn submit_as(&mut self, frame: &CanFrame, stream: u32) -> Submitted;

    /// Hands a frame over for sending: the stream is that of its identifier.
    #[inline]
    fn submit(&mut self, frame: &CanFrame) -> Submitted {
        self.submit_as(frame, frame.key())
    }

    /// Takes back every frame that has not been sent yet; says how many.
    fn cancel_pending(&mut self) -> u8;

    /// The state of the bus and of the controller.
    fn health(&self) -> Health;

    /// Says which frames are wanted from now on. A port may drop others, but never one that is
    /// wanted. The default receives everything.
    fn accept(&mut self, _patterns: &[IdPattern]) {}

    /// Goes back on the bus after bus-off: takes back what is unsent, then takes part again. Does
    /// nothing while the bus is not off, and nothing more while it is on its way back. When to
    /// call it is the caller's [`BusOffPolicy`](crate::BusOffPolicy). The default does nothing, for
    /// drivers that go back by themselves.
    fn recover(&mut self) {}
}

impl<P: CanPort + ?Sized> CanPort for &mut P {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        (**self).receive()
    }
    fn submit_as(&mut self, frame: &CanFrame, stream: u32) -> Submitted {
        (**self).submit_as(frame, stream)
    }
    fn cancel_pending(&mut self) -> u8 {
        (**self).cancel_pending()
    }
    fn health(&self) -> Health {
        (**self).health()
    }
    fn accept(&mut self, patterns: &[IdPattern]) {
        (**self).accept(patterns);
    }
    fn recover(&mut self) {
        (**self).recover();
    }
}

/// Outcome of submitting a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use = "a refused frame is lost unless the caller counts or repeats it"]
pub enum Submitted {
    /// The frame will be sent.
    Queued,
    /// The frame will be sent instead of an older one of the same stream.
    Replaced,
    /// There is no room, or the bus is off: it will not be sent.
    Refused,
}

/// A frame, and the stream whose newest one it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Queued {
    /// The frame.
    pub frame: CanFrame,
    /// The frame's stream: a newer frame of it replaces it while unsent ([`CanPort::submit_as`]).
    pub stream: u32,
}

/// One unsent frame per stream, `N` streams; the most urgent in arbitration leaves first.
#[derive(Clone, Debug, Default)]
pub struct Mailboxes<const N: usize> {
    frames: Vec<Queued, N>,
}

impl<const N: usize> Mailboxes<N> {
    /// No frames.
    #[must_use]
    pub const fn new() -> Self {
        Self { frames: Vec::new() }
    }

    /// Stores a frame; an older one of the same stream is replaced.
    pub fn put(&mut self, queued: Queued) -> Submitted {
        if let Some(older) = self.find(queued.stream) {
            *older = queued;
            return Submitted::Replaced;
        }
        match self.frames.push(queued) {
            Ok(()) => Submitted::Queued,
            Err(_) => Submitted::Refused,
        }
    }

    /// Stores a frame given back: [`Submitted::Refused`] without room, or with a newer one there.
    pub fn put_back(&mut self, queued: Queued) -> Submitted {
        match self.find(queued.stream) {
            Some(_) => Submitted::Refused,
            None => self.put(queued),
        }
    }

    /// The most urgent frame.
    #[must_use]
    pub fn peek(&self) -> Option<&Queued> {
        self.most_urgent(|_| true).map(|index| &self.frames[index])
    }

    /// The most urgent frame of those that may leave.
    pub fn peek_if(&self, may: impl Fn(&Queued) -> bool) -> Option<&Queued> {
        self.most_urgent(may).map(|index| &self.frames[index])
    }

    /// Takes the most urgent frame out.
    pub fn pop(&mut self) -> Option<Queued> {
        self.pop_if(|_| true)
    }

    /// Takes the most urgent frame out of those that may leave.
    pub fn pop_if(&mut self, may: impl Fn(&Queued) -> bool) -> Option<Queued> {
        self.most_urgent(may).map(|index| self.frames.swap_remove(index))
    }

    /// Forgets all frames; says how many there were.
    pub fn clear(&mut self) -> u8 {
        let count = self.frames.len();
        self.frames.clear();
        u8::try_from(count).unwrap_or(u8::MAX)
    }

    /// Whether a frame of the stream waits.
    #[must_use]
    pub fn holds(&self, stream: u32) -> bool {
        self.frames.iter().any(|waiting| waiting.stream == stream)
    }

    /// Number of frames that wait.
    #[must_use]
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether no frame waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    fn find(&mut self, stream: u32) -> Option<&mut Queued> {
        self.frames.iter_mut().find(|waiting| waiting.stream == stream)
    }

    fn most_urgent(&self, may: impl Fn(&Queued) -> bool) -> Option<usize> {
        // `Id`'s order is arbitration order; a data frame goes before a remote one of the same id.
        let urgency = |&index: &usize| {
            let frame = &self.frames[index].frame;
            (frame.id(), frame.is_remote())
        };
        (0..self.frames.len()).filter(|&index| may(&self.frames[index])).min_by_key(urgency)
    }
}

/// A [`CanPort`] on any HAL that implements [`embedded_can::nb::Can`].
///
/// It has no arrival times, no way to take a frame back, no error counters: the time is that of
/// [`receive`](CanPort::receive), [`Health`] knows only returned errors, and a frame in the driver
/// stays. `N` frames wait here, newest per stream, until the next `receive` or `submit`; one
/// refused by an error is dropped and counted ([`Health::transmit_lost`]).
pub struct NbPort<C, const N: usize = 16> {
    can: C,
    now: fn() -> Micros,
    waiting: Mailboxes<N>,
    /// The newest frames given to the driver, `N`: it may give one back without its stream.
    handed: Deque<Queued, N>,
    health: Health,
}

impl<C: Can, const N: usize> NbPort<C, N> {
    /// A port on `can`; `now` reads the clock that the bus is ticked by.
    pub const fn new(can: C, now: fn() -> Micros) -> Self {
        Self { can, now, waiting: Mailboxes::new(), handed: Deque::new(), health: Health::NEW }
    }

    /// The driver inside, for what the port does not offer.
    pub const fn driver(&mut self) -> &mut C {
        &mut self.can
    }

    /// Sends what waits, until the driver is full.
    fn flush(&mut self) {
        while let Some(&queued) = self.waiting.peek() {
            let Some(raw) = to_driver::<C>(&queued.frame) else {
                // The driver's frame type cannot hold it: it can never be sent.
                self.drop_first();
                continue;
            };
            match self.can.transmit(&raw) {
                Ok(evicted) => {
                    self.waiting.pop();
                    self.remember(queued);
                    if let Some(evicted) = evicted {
                        match from_driver::<C>(&evicted) {
                            // A newer frame of that stream may wait already: it wins.
                            Some(evicted) => {
                                let stream = self.stream_of(&evicted);
                                let _ = self.waiting.put_back(Queued { frame: evicted, stream });
                            }
                            None => count(&mut self.health.transmit_lost),
                        }
                        // The driver is full and only trades: go on at the next call.
                        return;
                    }
                }
                Err(nb::Error::WouldBlock) => return,
                Err(nb::Error::Other(error)) => {
                    self.note(&error);
                    // Offered again, it could be refused for ever, and with it all that wait.
                    self.drop_first();
                }
            }
        }
    }

    fn remember(&mut self, queued: Queued) {
        if self.handed.is_full() {
            self.handed.pop_front();
        }
        let _ = self.handed.push_back(queued);
    }

    /// The stream of a frame that the driver was given.
    fn stream_of(&self, frame: &CanFrame) -> u32 {
        let handed = self.handed.iter().rev().find(|handed| handed.frame == *frame);
        handed.map_or(frame.key(), |handed| handed.stream)
    }

    /// Gives up the most urgent frame.
    fn drop_first(&mut self) {
        self.waiting.pop();
        count(&mut self.health.transmit_lost);
    }

    fn note(&mut self, error: &C::Error) {
        self.health.last_error = match error.kind() {
            ErrorKind::Overrun => {
                count(&mut self.health.receive_lost);
                Some(BusError::Overrun)
            }
            ErrorKind::Bit => Some(BusError::Bit),
            ErrorKind::Stuff => Some(BusError::Stuff),
            ErrorKind::Crc => Some(BusError::Crc),
            ErrorKind::Form => Some(BusError::Form),
            ErrorKind::Acknowledge => Some(BusError::Acknowledge),
            _ => self.health.last_error,
        };
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

fn to_driver<C: Can>(frame: &CanFrame) -> Option<C::Frame> {
    if frame.is_remote() {
        C::Frame::new_remote(frame.id(), frame.len())
    } else {
        C::Frame::new(frame.id(), frame.bytes())
    }
}

fn from_driver<C: Can>(frame: &C::Frame) -> Option<CanFrame> {
    if frame.is_remote_frame() {
        CanFrame::new_remote(frame.id(), frame.dlc())
    } else {
        CanFrame::new(frame.id(), frame.data())
    }
}

impl<C: Can, const N: usize> CanPort for NbPort<C, N> {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        self.flush();
        // An overrun may be told before frames behind it; errors alone must not hold up the caller.
        for _ in 0..8 {
            match self.can.receive() {
                Ok(frame) => match from_driver::<C>(&frame) {
                    Some(frame) => return Some((frame, (self.now)())),
                    // More than eight bytes, or an id that no classic frame has.
                    None => count(&mut self.health.receive_lost),
                },
                Err(nb::Error::WouldBlock) => return None,
                Err(nb::Error::Other(error)) => self.note(&error),
            }
        }
        None
    }

    fn submit_as(&mut self, frame: &CanFrame, stream: u32) -> Submitted {
        let submitted = self.waiting.put(Queued { frame: *frame, stream });
        self.flush();
        submitted
    }

    fn cancel_pending(&mut self) -> u8 {
        self.waiting.clear()
    }

    fn health(&self) -> Health {
        self.health
    }
}

impl<C, const N: usize> fmt::Debug for NbPort<C, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("NbPort").field("waiting", &self.waiting).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::collections::VecDeque;
    use std::vec;
    use std::vec::Vec as StdVec;

    use embedded_can::StandardId;

    fn frame(id: u16, byte: u8) -> CanFrame {
        CanFrame::data_frame(StandardId::new(id).unwrap(), &[byte]).unwrap()
    }

    fn of_stream(frame: CanFrame, stream: u32) -> Queued {
        Queued { frame, stream }
    }

    #[test]
    fn a_newer_frame_replaces_the_older_of_its_stream_and_the_lowest_id_leaves_first() {
        let mut mailboxes = Mailboxes::<2>::new();
        let by_id = |frame: CanFrame| of_stream(frame, frame.key());
        assert_eq!(mailboxes.put(by_id(frame(0x200, 1))), Submitted::Queued);
        assert_eq!(mailboxes.put(by_id(frame(0x1FF, 2))), Submitted::Queued);
        assert_eq!(mailboxes.put(by_id(frame(0x200, 3))), Submitted::Replaced);
        assert_eq!(mailboxes.put(by_id(frame(0x201, 4))), Submitted::Refused);
        // A stream may change its identifier, and one identifier may serve two streams.
        assert_eq!(mailboxes.put(of_stream(frame(0x100, 5), 0x1FF)), Submitted::Replaced);
        assert_eq!(mailboxes.put_back(of_stream(frame(0x001, 6), 0x200)), Submitted::Refused);
        assert_eq!(mailboxes.pop(), Some(of_stream(frame(0x100, 5), 0x1FF)));
        assert_eq!(mailboxes.put(of_stream(frame(0x200, 7), 0x201)), Submitted::Queued);
        assert_eq!(mailboxes.len(), 2);
        assert_eq!(mailboxes.pop(), Some(by_id(frame(0x200, 3))));
        assert_eq!(mailboxes.pop(), Some(of_stream(frame(0x200, 7), 0x201)));
        assert_eq!(mailboxes.pop(), None);
    }

    /// A driver with `room` transmit buffers that, like bxCAN, trades its least urgent frame for
    /// a more urgent one when full.
    struct Trader {
        room: usize,
        held: StdVec<CanFrame>,
        arrived: VecDeque<CanFrame>,
    }

    impl Can for Trader {
        type Frame = CanFrame;
        type Error = ErrorKind;

        fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
            if self.held.len() < self.room {
                self.held.push(*frame);
                return Ok(None);
            }
            let least = (0..self.held.len()).max_by_key(|&index| self.held[index].id());
            match least {
                Some(index) if self.held[index].id() > frame.id() => {
                    let evicted = core::mem::replace(&mut self.held[index], *frame);
                    Ok(Some(evicted))
                }
                _ => Err(nb::Error::WouldBlock),
            }
        }

        fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
            self.arrived.pop_front().ok_or(nb::Error::WouldBlock)
        }
    }

    #[test]
    fn a_frame_the_driver_evicts_is_not_lost() {
        let driver =
            Trader { room: 1, held: vec![], arrived: VecDeque::from(vec![frame(0x201, 9)]) };
        let mut port = NbPort::<_, 4>::new(driver, || Micros::new(7));
        assert_eq!(port.submit(&frame(0x300, 1)), Submitted::Queued);
        assert_eq!(port.submit(&frame(0x100, 2)), Submitted::Queued);
        assert_eq!(port.driver().held, [frame(0x100, 2)]);
        port.driver().held.clear();
        assert_eq!(port.receive(), Some((frame(0x201, 9), Micros::new(7))));
        assert_eq!(port.driver().held, [frame(0x300, 1)]);
    }

    #[test]
    fn an_evicted_frame_does_not_displace_a_newer_one() {
        let mut port =
            NbPort::<_, 4>::new(Trader { room: 1, held: vec![], arrived: VecDeque::new() }, || {
                Micros::ZERO
            });
        let _ = port.submit(&frame(0x300, 1));
        let _ = port.submit(&frame(0x300, 2)); // waits: the driver is full
        let _ = port.submit(&frame(0x100, 3)); // evicts 300#01 from the driver
        port.driver().held.clear();
        assert_eq!(port.receive(), None);
        assert_eq!(port.driver().held, [frame(0x300, 2)]);
        port.driver().held.clear();
        assert_eq!(port.receive(), None);
        assert_eq!(port.driver().held, []);
    }

    #[test]
    fn an_evicted_frame_keeps_its_stream() {
        let driver = Trader { room: 1, held: vec![], arrived: VecDeque::new() };
        let mut port = NbPort::<_, 4>::new(driver, || Micros::ZERO);
        let _ = port.submit_as(&frame(0x300, 1), 7);
        let _ = port.submit(&frame(0x100, 2)); // evicts 300#01
        assert_eq!(port.submit_as(&frame(0x400, 3), 7), Submitted::Replaced);
    }

    /// A driver that refuses one identifier for ever.
    struct Picky(StdVec<CanFrame>);

    impl Can for Picky {
        type Frame = CanFrame;
        type Error = ErrorKind;

        fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
            if frame.raw_id() == 0x100 {
                return Err(nb::Error::Other(ErrorKind::Form));
            }
            self.0.push(*frame);
            Ok(None)
        }

        fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
            Err(nb::Error::WouldBlock)
        }
    }

    #[test]
    fn a_frame_the_driver_refuses_is_counted_and_holds_no_other_up() {
        let mut port = NbPort::<_, 4>::new(Picky(vec![]), || Micros::ZERO);
        let _ = port.submit(&frame(0x100, 1));
        let _ = port.submit(&frame(0x300, 2));
        assert_eq!(port.driver().0, [frame(0x300, 2)]);
        assert_eq!((port.health().transmit_lost, port.cancel_pending()), (1, 0));
        assert_eq!(port.health().last_error, Some(BusError::Form));
    }
}
