//! `vision::run` tells the gimbal in time and loses nothing of what comes.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::pin::pin;

use embassy_time::{Instant, Timer};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use rc10_module::vision::{self, Gimbal};
use rc10_module::{Counters, Reception};
use rc10_sim::World;
use rc10_time::Micros;

/// A packet of the PC whose yaw is 1, else zeros.
const PACKET: [u8; 48] = {
    let mut packet = [0; 48];
    (packet[0], packet[16], packet[17]) = (0xA5, 0x80, 0x3F);
    (packet[46], packet[47]) = (0xE2, 0x67);
    packet
};
/// Period of the PC, µs.
const PICTURES: u64 = 7_300;

/// A PC at the other end.
#[derive(Default)]
struct Pc {
    to_robot: VecDeque<u8>,
    next: u64,
    /// When it was told what.
    heard: Vec<(u64, Vec<u8>)>,
    /// What cannot be sent.
    write_errors: u32,
}

impl Pc {
    /// In pieces, as a port has them.
    fn speak(&mut self, buffer: &mut [u8]) -> usize {
        if Instant::now().as_micros() >= self.next {
            self.next += PICTURES;
            self.to_robot.extend(PACKET);
        }
        let count = self.to_robot.len().min(5).min(buffer.len());
        buffer.iter_mut().zip(self.to_robot.drain(..count)).for_each(|(to, it)| *to = it);
        count
    }
}

struct Port<'p>(&'p RefCell<Pc>);

impl ErrorType for Port<'_> {
    type Error = ErrorKind;
}

impl Read for Port<'_> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        loop {
            let count = self.0.borrow_mut().speak(buffer);
            if count > 0 {
                return Ok(count);
            }
            Timer::after_micros(300).await;
        }
    }
}

impl Write for Port<'_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        let mut pc = self.0.borrow_mut();
        if let Some(left) = pc.write_errors.checked_sub(1) {
            pc.write_errors = left;
            return Err(ErrorKind::Other);
        }
        pc.heard.push((Instant::now().as_micros(), bytes.to_vec()));
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// A second of both; the times at which targets were heard, the counters, and the PC.
fn run(write_errors: u32) -> (Vec<u64>, Counters, Pc) {
    let pc = RefCell::new(Pc { write_errors, ..Pc::default() });
    let (heard, reception) = (RefCell::new(Vec::new()), Reception::new());
    let mut pictures = 0.0;
    let gimbal = || {
        pictures += 1.0;
        Gimbal { attitude: [0.0, 0.0, pictures], ..Gimbal::default() }
    };
    let hear = |target: vision::Target, at: Micros| {
        assert_eq!((target.yaw, target.is_tracked), (1.0, false));
        heard.borrow_mut().push(at.get());
    };
    let period = Micros::from_millis(10);
    let mut world = World::new(1);
    {
        let mut driver = pin!(vision::run(Port(&pc), period, &reception, hear, gimbal));
        assert!(world.run(driver.as_mut(), Micros::from_millis(1000)).is_pending());
    }
    (heard.take(), reception.read(), pc.into_inner())
}

#[test]
fn each_target_is_heard_and_the_gimbal_is_told_every_period() {
    let (heard, counters, pc) = run(0);
    assert_eq!(heard.len() as u64, 1 + 999_000 / PICTURES);
    assert!(heard.iter().zip(0..).all(|(at, count)| at - count * PICTURES < 1_000), "{heard:?}");
    assert_eq!((counters.skipped, counters.damaged, counters.port_errors), (0, 0, 0));
    assert_eq!(pc.heard.len(), 101);
    for ((at, bytes), count) in pc.heard.iter().zip(0_u16..) {
        assert!(at.abs_diff(u64::from(count) * 10_000) < 1_000, "{at} {count}");
        let yaw = f32::from_le_bytes(bytes[10..14].try_into().unwrap());
        assert_eq!((bytes.len(), yaw), (28, f32::from(count + 1)));
    }
}

#[test]
fn a_port_that_cannot_send_still_hears() {
    let (heard, counters, pc) = run(5);
    assert_eq!((counters.port_errors, counters.damaged), (5, 0));
    assert_eq!(heard.len() as u64, 1 + 999_000 / PICTURES);
    assert!((95..=97).contains(&pc.heard.len()), "{}", pc.heard.len());
}
