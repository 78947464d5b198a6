//! The accounts of a ring that a DMA fills: whatever the reader and the interrupts do, nothing wrong
//! is read, and nothing is lost without a word.
#![cfg(test)]

#[path = "../src/stm32h723/serial/ring.rs"]
mod ring;

use ring::{LineFlags, Next, Ring, SerialError};

const LENGTH: u32 = 64;

/// A DMA as the manual has it, that writes 0, 1, 2 .. into its ring.
struct Dma {
    ring: Ring,
    memory: [u64; LENGTH as usize],
    written: u64,
    half: bool,
    end: bool,
}

impl Dma {
    fn new() -> Self {
        let mut ring = Ring::new();
        ring.set_length(LENGTH);
        Self { ring, memory: [u64::MAX; LENGTH as usize], written: 0, half: false, end: false }
    }

    fn write(&mut self, count: u64) {
        for _ in 0..count {
            let place = self.written % u64::from(LENGTH);
            self.memory[usize::try_from(place).unwrap()] = self.written;
            self.written += 1;
            self.half |= place + 1 == u64::from(LENGTH / 2);
            self.end |= place + 1 == u64::from(LENGTH);
        }
    }

    fn look(&mut self) {
        self.look_only();
        self.ring.check();
    }

    /// While the UART does not tell of errors.
    fn look_only(&mut self) {
        let remaining = LENGTH - u32::try_from(self.written % u64::from(LENGTH)).unwrap();
        let [half, end] = [core::mem::take(&mut self.half), core::mem::take(&mut self.end)];
        self.ring.look(remaining, half, end);
    }

    /// A write that asks for an interrupt gets one.
    fn write_and_look(&mut self, count: u64) {
        for _ in 0..count {
            self.write(1);
            if self.half || self.end {
                self.look();
            }
        }
    }

    /// Reads like the driver, with `meanwhile` bytes written while it copies.
    fn read(&mut self, room: u32, meanwhile: u64) -> Option<Result<Vec<u64>, SerialError>> {
        let (from, count) = match self.ring.next(room) {
            Next::Nothing => return None,
            Next::Error(error) => return Some(Err(error)),
            Next::Bytes { from, count } => (from, count),
        };
        self.write_and_look(meanwhile);
        let place = |position: u32| (from.wrapping_add(position) % LENGTH) as usize;
        let bytes = (0..count).map(|position| self.memory[place(position)]).collect();
        self.look_only();
        if self.ring.take(from, count) { Some(Ok(bytes)) } else { self.read(room, 0) }
    }
}

fn all(dma: &mut Dma) -> (Vec<u64>, Vec<SerialError>) {
    let (mut bytes, mut errors) = (Vec::new(), Vec::new());
    while let Some(result) = dma.read(16, 0) {
        match result {
            Ok(piece) => bytes.extend(piece),
            Err(error) => errors.push(error),
        }
    }
    (bytes, errors)
}

const FRAMING: LineFlags = LineFlags { overrun: false, framing: true, parity: false, noise: false };

#[test]
fn bytes_come_out_in_order_round_after_round() {
    let mut dma = Dma::new();
    for round in 0..100 {
        dma.write_and_look(LENGTH.into());
        dma.look();
        let (bytes, errors) = all(&mut dma);
        let first = round * u64::from(LENGTH);
        assert!(bytes.into_iter().eq(first..first + u64::from(LENGTH)) && errors.is_empty());
    }
    assert_eq!(dma.ring.counters, ring::SerialCounters::default());
}

#[test]
fn one_byte_too_many_is_noticed_and_none_too_early() {
    let mut dma = Dma::new();
    dma.write_and_look(10);
    dma.look();
    all(&mut dma);
    dma.write_and_look(LENGTH.into());
    dma.look();
    assert_eq!(all(&mut dma), ((10..10 + u64::from(LENGTH)).collect(), vec![]));
    dma.write_and_look(u64::from(LENGTH) + 1);
    dma.look();
    assert_eq!(all(&mut dma), (vec![], vec![SerialError::TooSlow]));
    let counters = dma.ring.counters;
    assert_eq!((counters.too_slow, counters.unread), (1, LENGTH + 1));
    dma.write_and_look(3);
    dma.look();
    let next = dma.written - 3;
    assert_eq!(all(&mut dma), ((next..next + 3).collect(), vec![]));
}

/// Interrupts were masked: whole rounds went by unseen.
#[test]
fn rounds_that_were_not_seen_are_noticed() {
    for already in 0..u64::from(LENGTH) {
        for rounds in 1..4 {
            let mut dma = Dma::new();
            dma.write_and_look(already);
            dma.look();
            all(&mut dma);
            dma.write(rounds * u64::from(LENGTH));
            dma.look();
            assert_eq!(all(&mut dma), (vec![], vec![SerialError::TooSlow]), "{already} {rounds}");
        }
    }
}

#[test]
fn what_is_overwritten_while_it_is_copied_is_not_read() {
    for meanwhile in 0..3 * u64::from(LENGTH) {
        let mut dma = Dma::new();
        dma.write_and_look(40);
        dma.look();
        match dma.read(64, meanwhile).unwrap() {
            Ok(bytes) => {
                assert!(bytes.into_iter().eq(0..40), "{meanwhile}");
                assert!(meanwhile <= u64::from(LENGTH) - 40, "{meanwhile}");
            }
            Err(error) => {
                assert_eq!(error, SerialError::TooSlow);
                assert!(meanwhile > u64::from(LENGTH) - 40, "{meanwhile}");
            }
        }
    }
}

#[test]
fn an_error_is_told_once_at_its_place_and_costs_nothing_else() {
    let mut dma = Dma::new();
    dma.write_and_look(5);
    dma.look();
    dma.ring.fail(FRAMING, None);
    dma.write_and_look(5);
    dma.look();
    assert_eq!(dma.read(16, 0), Some(Ok((0..5).collect())));
    assert_eq!(dma.read(16, 0), Some(Err(SerialError::Framing)));
    assert_eq!(dma.read(16, 0), Some(Ok((5..10).collect())));
    assert_eq!(dma.read(16, 0), None);
    // Twice before the reader comes: the first is told, what is between them is not read.
    dma.ring.fail(FRAMING, Some(0));
    dma.write_and_look(5);
    dma.look();
    let noise_and_parity = LineFlags { noise: true, parity: true, ..LineFlags::default() };
    dma.ring.fail(noise_and_parity, Some(1));
    dma.write_and_look(2);
    dma.look();
    assert_eq!(all(&mut dma), (vec![15, 16], vec![SerialError::Break]));
    let counters = dma.ring.counters;
    assert_eq!((counters.framing, counters.breaks), (1, 1));
    assert_eq!((counters.noise, counters.parity), (1, 1));
    dma.ring.fail(LineFlags { overrun: true, ..LineFlags::default() }, Some(1));
    assert_eq!(all(&mut dma), (vec![], vec![SerialError::Overrun]));
    assert_eq!(dma.ring.counters.overruns, 1);
}

#[test]
fn after_a_failed_transfer_the_ring_begins_anew() {
    for already in 0..2 * u64::from(LENGTH) {
        let mut dma = Dma::new();
        dma.write_and_look(already.min(20));
        dma.look();
        all(&mut dma);
        dma.write_and_look(already.saturating_sub(20).min(30));
        dma.look();
        dma.ring.restart();
        // Numbers that fit the new round.
        dma.written = dma.written.next_multiple_of(LENGTH.into());
        let first = dma.written;
        dma.write_and_look(12);
        dma.look();
        assert_eq!(all(&mut dma), ((first..first + 12).collect(), vec![SerialError::Dma]));
        assert_eq!(dma.ring.counters.dma, 1);
    }
}

/// Random pieces, reads and late interrupts: what is read was written, in order, and every gap was
/// announced.
#[test]
fn nothing_is_lost_without_a_word() {
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    let mut random = |below: u64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state % below
    };
    let mut dma = Dma::new();
    let (mut expected, mut announced, mut announcements) = (0, false, 0);
    for _ in 0..200_000 {
        match random(8) {
            0..3 => dma.write_and_look(random(40)),
            3 => dma.write(random(150)),
            4 => dma.look(),
            5 if random(10) == 0 => dma.ring.fail(FRAMING, Some(0x55)),
            _ => {
                let (room, meanwhile) = (1 + random(40), random(30));
                match dma.read(u32::try_from(room).unwrap(), meanwhile) {
                    Some(Ok(bytes)) => {
                        let first = bytes[0];
                        assert!(first == expected || announced && first > expected);
                        assert!(bytes.windows(2).all(|pair| pair[1] == pair[0] + 1));
                        expected = first + bytes.len() as u64;
                        announced = false;
                    }
                    Some(Err(_)) => {
                        announced = true;
                        announcements += 1;
                    }
                    None => {}
                }
            }
        }
    }
    assert!(announcements > 1000 && dma.written > 1_000_000);
    let counters = dma.ring.counters;
    assert!(counters.too_slow > 1000 && counters.framing > 1000, "{counters:?}");
}

#[test]
fn what_lies_between_two_errors_and_is_dropped_is_counted() {
    let mut dma = Dma::new();
    dma.write_and_look(3);
    dma.look();
    assert!(!dma.ring.has_failed());
    dma.ring.fail(FRAMING, Some(1));
    assert!(dma.ring.has_failed());
    dma.write_and_look(5);
    dma.look();
    dma.ring.fail(FRAMING, Some(1));
    dma.write_and_look(2);
    dma.look();
    assert_eq!(all(&mut dma), (vec![0, 1, 2, 8, 9], vec![SerialError::Framing]));
    assert_eq!((dma.ring.counters.framing, dma.ring.counters.unread), (2, 5));
    // An error behind the first one, and a reader who is too slow: each byte counts once.
    dma.ring.fail(FRAMING, Some(1));
    dma.write_and_look(4);
    dma.look();
    dma.ring.fail(FRAMING, Some(1));
    dma.write_and_look(70);
    dma.look();
    let (bytes, errors) = all(&mut dma);
    assert_eq!(errors, [SerialError::TooSlow]);
    let counted = u64::from(dma.ring.counters.unread) + bytes.len() as u64;
    assert_eq!(counted, dma.written - 5);
}

/// Bytes that the UART has not been asked about are not read; if something was wrong with them,
/// they go.
#[test]
fn bytes_are_read_when_the_uart_has_said_that_they_are_whole() {
    let mut dma = Dma::new();
    dma.write(3);
    dma.look();
    dma.write(4);
    dma.look_only();
    assert_eq!(dma.read(10, 0), Some(Ok(vec![0, 1, 2])));
    assert_eq!(dma.read(10, 0), None);
    dma.ring.fail(LineFlags { parity: true, ..LineFlags::default() }, None);
    dma.write(2);
    dma.look();
    assert_eq!(dma.read(10, 0), Some(Err(SerialError::Parity)));
    assert_eq!(dma.read(10, 0), Some(Ok(vec![7, 8])));
    assert_eq!((dma.ring.counters.parity, dma.ring.counters.unread), (1, 4));
}
