//! `jrt::run` keeps a module measuring, whatever happens to it.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::pin::pin;

use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use rc10_module::ranging::jrt::{self, Answer, Speed};
use rc10_module::{Counters, Reception};
use rc10_sim::World;
use rc10_time::Micros;

/// A module: what it was told, and whether that made it measure. Written from the protocol's
/// tables, not with the library's encoder.
#[derive(Default)]
struct Module {
    is_off: bool,
    is_lit: bool,
    measures: bool,
    /// Instead of measuring it sends this.
    babble: Option<u8>,
    /// How many times the port fails.
    read_errors: u32,
    write_errors: u32,
    commands: Vec<Told>,
    to_host: VecDeque<u8>,
    next: u64,
}

/// When it was told what.
type Told = (u64, Vec<u8>);
/// An event, and in which millisecond.
type Event = (u64, fn(&mut Module));

const STOP: [u8; 1] = [0x58];
const LASER_ON: [u8; 9] = [0xAA, 0, 0x01, 0xBE, 0, 1, 0, 1, 0xC1];
const CONTINUOUS_FAST: [u8; 9] = [0xAA, 0, 0, 0x20, 0, 1, 0, 6, 0x27];
const CONTINUOUS_AUTO: [u8; 9] = [0xAA, 0, 0, 0x20, 0, 1, 0, 4, 0x25];
/// 1.000 m, quality 80.
const RESULT: [u8; 13] = [0xAA, 0, 0, 0x22, 0, 3, 0, 0, 0x03, 0xE8, 0, 0x50, 0x60];
/// A module that measures every 50 ms.
const PERIOD: u64 = 50_000;

impl Module {
    fn hear(&mut self, bytes: &[u8], now: u64) {
        if self.is_off {
            return;
        }
        self.commands.push((now, bytes.to_vec()));
        match bytes {
            bytes if bytes == STOP => self.measures = false,
            bytes if bytes == LASER_ON => self.is_lit = true,
            bytes if bytes == CONTINUOUS_FAST || bytes == CONTINUOUS_AUTO => self.measures = true,
            other => panic!("an unknown command {other:02X?}"),
        }
        if bytes != STOP {
            self.to_host.extend(bytes); // It repeats what it does.
        }
    }

    fn advance(&mut self, now: u64) {
        if now < self.next {
            return;
        }
        self.next = now + PERIOD;
        match self.babble {
            Some(byte) => self.to_host.extend([byte; 5]),
            None if self.measures && self.is_lit && !self.is_off => self.to_host.extend(RESULT),
            None => {}
        }
    }

    /// The bytes sent by now.
    fn speak(&mut self, buffer: &mut [u8], now: u64) -> Result<usize, ErrorKind> {
        self.advance(now);
        if let Some(left) = self.read_errors.checked_sub(1) {
            self.read_errors = left;
            return Err(ErrorKind::Other);
        }
        let count = buffer.len().min(self.to_host.len());
        for (place, byte) in buffer.iter_mut().zip(self.to_host.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn set_power(&mut self, is_on: bool) {
        self.is_off = !is_on;
        (self.is_lit, self.measures) = (false, false);
    }
}

struct Port<'a>(&'a RefCell<Module>);

impl ErrorType for Port<'_> {
    type Error = ErrorKind;
}

impl Read for Port<'_> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        loop {
            let now = Instant::now().as_micros();
            let count = self.0.borrow_mut().speak(buffer, now)?;
            if count > 0 {
                return Ok(count);
            }
            Timer::after(Duration::from_millis(1)).await;
        }
    }
}

impl Write for Port<'_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        let mut module = self.0.borrow_mut();
        if let Some(left) = module.write_errors.checked_sub(1) {
            module.write_errors = left;
            return Err(ErrorKind::Other);
        }
        module.hear(bytes, Instant::now().as_micros());
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// Runs a module at a speed; at each of these milliseconds something happens to it. Returns the
/// milliseconds at which distances were heard, the commands, and what was counted.
fn run(
    speed: Speed,
    mut module: Module,
    until: u64,
    events: &[Event],
) -> (Vec<u64>, Vec<Told>, Counters) {
    module.commands.clear();
    let module = RefCell::new(module);
    let (heard, reception) = (RefCell::new(Vec::new()), Reception::new());
    let mut world = World::new(1);
    let mut driver = pin!(jrt::run(Port(&module), speed, &reception, |answer, at| {
        assert_eq!(answer, Answer::Result { address: 0, millimetres: 1000, quality: 80 });
        heard.borrow_mut().push(at.get() / 1000);
    }));
    for (at, event) in events.iter().copied().chain([(until, (|_| ()) as fn(&mut Module))]) {
        assert!(world.run(driver.as_mut(), Micros::from_millis(at)).is_pending());
        event(&mut module.borrow_mut());
    }
    (heard.take(), std::mem::take(&mut module.borrow_mut().commands), reception.read())
}

/// How often it was started.
fn starts(commands: &[Told]) -> usize {
    commands.iter().filter(|(_, bytes)| bytes[..] == CONTINUOUS_FAST).count()
}

/// The longest silence between two distances, and from the last to the end.
fn longest_silence(heard: &[u64], until: u64) -> u64 {
    let later = heard.iter().copied().skip(1).chain([until]);
    heard.iter().zip(later).map(|(earlier, later)| later - earlier).max().unwrap_or(until)
}

#[test]
fn it_is_stopped_lit_and_started_once() {
    let (heard, commands, counters) = run(Speed::Auto, Module::default(), 60_000, &[]);
    let bytes: Vec<_> = commands.iter().map(|(_, bytes)| bytes.as_slice()).collect();
    assert_eq!(bytes, [&STOP[..], &LASER_ON, &CONTINUOUS_AUTO]);
    assert!(commands[0].0 < commands[1].0 && commands[1].0 < commands[2].0, "not at once");
    assert!(heard[0] < 300 && longest_silence(&heard, 60_000) < 60, "{heard:?}");
    // The two commands that come back are frames, too.
    let frames = u32::try_from(heard.len()).unwrap() + 2;
    assert_eq!((counters.frames, counters.skipped, counters.port_errors), (frames, 0, 0));
}

/// The module measured before we began: our processor was reset, the module was not.
#[test]
fn a_module_that_measures_already_is_started_anew() {
    let busy = Module { is_lit: true, measures: true, ..Module::default() };
    let (heard, commands, _) = run(Speed::Fast, busy, 5_000, &[]);
    assert_eq!(starts(&commands), 1);
    assert!(longest_silence(&heard, 5_000) < 300);
}

#[test]
fn after_a_power_cut_it_measures_again_by_itself() {
    let cut: [Event; 2] =
        [(2_010, |module| module.set_power(false)), (2_500, |module| module.set_power(true))];
    let (heard, commands, _) = run(Speed::Fast, Module::default(), 10_000, &cut);
    assert_eq!(starts(&commands), 2);
    let back = heard.iter().find(|at| **at > 2_500).unwrap();
    // 1 s of silence, two pauses, a measurement.
    assert!((3_000..3_300).contains(back), "{back}");
    assert!(longest_silence(&heard, 10_000) < 1_300);
}

#[test]
fn a_module_that_is_plugged_in_later_is_found() {
    let off = Module { is_off: true, ..Module::default() };
    let (heard, _, _) = run(Speed::Fast, off, 20_000, &[(15_000, |module| module.set_power(true))]);
    assert!((15_000..16_300).contains(&heard[0]), "{}", heard[0]);
}

/// Noise is no answer, and does not keep it from being started.
#[test]
fn noise_is_taken_for_silence() {
    for byte in [0x00, 0xAA, 0xEE] {
        let noisy = Module { babble: Some(byte), ..Module::default() };
        let quiet: [Event; 1] = [(8_000, |module| module.babble = None)];
        let (heard, commands, counters) = run(Speed::Fast, noisy, 10_000, &quiet);
        assert!((6..=8).contains(&starts(&commands)), "{byte:02X}: {}", starts(&commands));
        assert!((8_000..8_100).contains(&heard[0]), "{byte:02X}");
        assert!(counters.skipped > 500, "{byte:02X}");
    }
}

#[test]
fn a_port_that_fails_is_tried_again_but_not_at_once() {
    let broken = Module { write_errors: 3, ..Module::default() };
    let (heard, commands, counters) = run(Speed::Fast, broken, 10_000, &[]);
    assert_eq!((starts(&commands), counters.port_errors), (1, 3));
    assert!((3_000..3_500).contains(&heard[0]), "{}", heard[0]);
    let errors: [Event; 1] = [(2_000, |module| module.read_errors = 7)];
    let (heard, commands, counters) = run(Speed::Fast, Module::default(), 5_000, &errors);
    assert_eq!((starts(&commands), counters.port_errors), (1, 7));
    assert!(longest_silence(&heard, 5_000) <= 101);
}
