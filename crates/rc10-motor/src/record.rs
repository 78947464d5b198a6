//! What reaches the ticks of a robot's buses, and the state that they leave, as a record: on the chip a ring in memory,
//! in simulation a file. `rc10 replay` runs the same buses with it, and compares.
//!
//! A record is words of 32 bits, little endian. Each entry begins with one: kind (bits 0 to 7), place (8 to 15: bus 1 is
//! 0, line 1 is 8), number of words that follow (16 to 23), and a byte that depends on the kind (24 to 31). The page
//! `docs/replay.md` has the table. A text in postcard's format fills whole words, with zeros behind it.

#![expect(
    clippy::cast_possible_truncation,
    reason = "halves of words, and numbers of at most 15 motors"
)]

mod code;
pub mod pages;
pub mod ring;

use core::cell::Cell;
#[cfg(not(target_os = "none"))]
use core::fmt;

use postcard::ser_flavors::Flavor;
use rc10_can::{CanFrame, Health};
use rc10_time::Micros;
use serde::Serialize;

/// The place to which entries go.
pub trait Sink: Sync {
    /// Takes an entry, whole.
    fn put(&self, entry: &[u32]);

    /// Whether all is recorded that proves a replay: what was [`SENT`], and the [`STATE`] after every tick. Otherwise a
    /// [`KEYFRAME`] proves it, now and then.
    fn is_proof(&self) -> bool;
}

/// A bus begins: the time of its first tick, and a hash of its motors as they are before.
pub const START: u8 = 1;
/// A half of a tick begins: its time. The byte is the arm switch's state.
pub const TICK: u8 = 2;
/// A frame is taken: time (low word), key, data. The byte is its length.
pub const FRAME: u8 = 3;
/// The arm switch has another state than at the begin of this half: the byte.
pub const ARM: u8 = 4;
/// The port tells another health: postcard.
pub const HEALTH: u8 = 5;
/// The bus was asked to come back.
pub const RECOVER: u8 = 6;
/// A motor (the byte) gets a target and what is withheld from it: postcard.
pub const COMMAND: u8 = 7;
/// A motor (the byte) gets a request: postcard.
pub const REQUEST: u8 = 8;
/// The first half has taken this time, µs.
pub const TOOK: u8 = 9;
/// A frame is handed to the port: key, data. The byte: length, and in bits 4 and 5 what the port did.
pub const SENT: u8 = 10;
/// The same, of a task.
pub const OUTGOING: u8 = 11;
/// Hash of the state after the tick: low word, high word, and for each motor the low word of its own.
pub const STATE: u8 = 12;
/// The state of a motor (the byte), or of the bus without its motors (255): postcard.
pub const KEYFRAME: u8 = 13;
/// A line is polled: the time (low word), and the command's words if one is sent.
pub const POLL: u8 = 14;
/// Bytes come from a line: the time (low word), bytes. The byte is their number.
pub const BYTES: u8 = 15;
/// The port of a line fails.
pub const FAILED: u8 = 16;
/// As many words are missing.
pub const LOST: u8 = 17;

/// Ticks in which each motor of a bus has a keyframe, and with each of them the bus.
const KEYFRAMES_WITHIN: u32 = 448;
/// Ticks that a keyframe waits for a quiet moment.
const PATIENCE: u32 = 8;
/// The place of the first line.
pub const FIRST_LINE: u8 = 8;
/// Longest entry, words.
const LONGEST: usize = 256;
/// The motor's number in a keyframe of the bus without its motors.
pub const BUS: u8 = 0xFF;

/// The first word of an entry.
#[inline]
#[must_use]
pub const fn head(kind: u8, place: u8, words: u8, more: u8) -> u32 {
    u32::from_le_bytes([kind, place, words, more])
}

/// The two words of a number.
#[inline]
const fn halves(number: u64) -> [u32; 2] {
    [number as u32, (number >> 32) as u32]
}

/// Writes a state in postcard's format, piece by piece.
pub fn save(it: &impl Serialize, to: &mut dyn FnMut(&[u8])) {
    // The only error is an error by a configuration, which no state holds.
    let _ = postcard::serialize_with_flavor(it, Pieces(to));
}

struct Pieces<'a>(&'a mut dyn FnMut(&[u8]));

impl Flavor for Pieces<'_> {
    type Output = ();

    #[inline]
    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        (self.0)(&[byte]);
        Ok(())
    }

    #[inline]
    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        (self.0)(bytes);
        Ok(())
    }

    fn finalize(self) -> postcard::Result<()> {
        Ok(())
    }
}

/// A 64-bit hash of a state: FNV-1a, a piece of up to four bytes at once. One changed bit always changes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hash(u64);

impl Hash {
    /// Of nothing.
    pub const NEW: Self = Self(0xCBF2_9CE4_8422_2325);

    /// Adds a piece.
    #[inline]
    pub fn add(&mut self, bytes: &[u8]) {
        for piece in bytes.chunks(4) {
            let word = piece.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
            self.0 = (self.0 ^ word).wrapping_mul(0x0100_0000_01B3);
        }
    }

    /// The number.
    #[must_use]
    pub const fn get(self) -> u64 {
        self.0
    }
}

/// A state that is recorded: of a bus with its motors.
pub trait Recorded {
    /// Number of its motors.
    fn motors(&self) -> u8;

    /// Begins anew: the first tick is due then.
    fn start_at(&mut self, first: Micros);

    /// Writes the state of a motor with its supervision, or of the rest ([`BUS`]).
    fn save(&self, part: u8, to: &mut dyn FnMut(&[u8]));

    /// Takes back what [`save`](Self::save) has written; false for something else.
    fn load(&mut self, part: u8, from: &[u8]) -> bool;

    /// The same as a text, a field a line.
    #[cfg(not(target_os = "none"))]
    fn show(&self, part: u8, to: &mut dyn fmt::Write) -> fmt::Result;
}

/// The hash of a state, and the low word of each motor's own.
pub fn hash(of: &dyn Recorded, mut each: impl FnMut(u8, u32)) -> u64 {
    let mut whole = Hash::NEW;
    of.save(BUS, &mut |bytes| whole.add(bytes));
    for motor in 0..of.motors() {
        let mut own = Hash::NEW;
        of.save(motor, &mut |bytes| own.add(bytes));
        whole.add(&own.get().to_le_bytes());
        each(motor, halves(own.get())[0]);
    }
    whole.get()
}

/// A hash of a place's motors before the first tick: together with those of the others a fingerprint of the program.
pub fn print(place: u8, of: &dyn Recorded) -> u32 {
    let mut whole = Hash::NEW;
    whole.add(&[place]);
    (0..of.motors()).for_each(|motor| of.save(motor, &mut |bytes| whole.add(bytes)));
    let [low, high] = halves(whole.get());
    low ^ high
}

/// A sink, and the place that writes into it.
pub(crate) type To = Option<(&'static dyn Sink, u8)>;

/// A bus's pen: without a sink it writes nothing.
pub(crate) struct Recorder {
    sink: Option<&'static dyn Sink>,
    place: u8,
    /// As recorded last.
    arm: u8,
    health: Option<Health>,
    /// Number of those so far.
    keyframes: Cell<u32>,
}

impl Recorder {
    pub(crate) const fn new(to: To) -> Self {
        let (sink, place) = match to {
            Some((sink, place)) => (Some(sink), place),
            None => (None, 0),
        };
        Self { sink, place, arm: 0, health: None, keyframes: Cell::new(0) }
    }

    /// An entry; its first word lacks place and length.
    #[inline]
    fn put<const N: usize>(&self, kind: u8, more: u8, mut entry: [u32; N]) {
        const { assert!(N <= 8) };
        if let Some(sink) = self.sink {
            entry[0] = head(kind, self.place, N as u8 - 1, more);
            sink.put(&entry);
        }
    }

    #[inline(never)]
    fn put_text(&self, kind: u8, more: u8, text: &impl Serialize) {
        self.put_bytes::<24>(kind, more, None, |to| save(text, to));
    }

    /// Bytes behind a word of time, if there is one; more than fit are left out, which no text has.
    fn put_bytes<const MOST: usize>(
        &self,
        kind: u8,
        more: u8,
        at: Option<u32>,
        write: impl FnOnce(&mut dyn FnMut(&[u8])),
    ) {
        let Some(sink) = self.sink else { return };
        let mut entry = [0_u32; MOST];
        let mut len = 4;
        if let Some(at) = at {
            (entry[1], len) = (at, 8);
        }
        write(&mut |bytes| {
            for byte in bytes {
                if let Some(word) = entry.get_mut(len / 4) {
                    *word |= u32::from(*byte) << (len % 4 * 8);
                    len += 1;
                }
            }
        });
        let words = len.div_ceil(4);
        entry[0] = head(kind, self.place, (words - 1) as u8, more);
        sink.put(&entry[..words]);
    }

    pub(crate) fn start(&self, of: &dyn Recorded, first: Micros) {
        if self.sink.is_some() {
            let [low, high] = halves(first.get());
            self.put(START, 0, [0, low, high, print(self.place, of)]);
        }
    }

    #[inline]
    pub(crate) fn tick(&mut self, now: Micros, arm: u8) {
        self.arm = arm;
        let [low, high] = halves(now.get());
        self.put(TICK, arm, [0, low, high]);
    }

    #[inline]
    pub(crate) fn frame(&self, frame: &CanFrame, at: Micros) {
        let [key, low, high] = words(frame);
        self.put(FRAME, frame.len() as u8, [0, halves(at.get())[0], key, low, high]);
    }

    #[inline]
    pub(crate) fn arm(&mut self, arm: u8) {
        if self.arm != arm {
            self.arm = arm;
            self.put(ARM, arm, [0]);
        }
    }

    #[inline]
    pub(crate) fn health(&mut self, health: &Health, is_asked: bool) {
        if self.health.as_ref() != Some(health) {
            self.health = Some(*health);
            self.put_text(HEALTH, 0, health);
        }
        if is_asked {
            self.put(RECOVER, 0, [0]);
        }
    }

    #[inline]
    pub(crate) fn given(&self, kind: u8, motor: usize, what: &impl Serialize) {
        self.put_text(kind, motor as u8, what);
    }

    pub(crate) fn took(&self, took: Micros) {
        self.put(TOOK, 0, [0, halves(took.get())[0]]);
    }

    #[inline]
    pub(crate) fn sent(&self, kind: u8, frame: &CanFrame, outcome: u8) {
        // What was sent is known from what came in, unless a test bench wants to see it.
        if kind == OUTGOING || outcome != 0 || self.sink.is_some_and(Sink::is_proof) {
            let [key, low, high] = words(frame);
            self.put(kind, frame.len() as u8 | outcome << 4, [0, key, low, high]);
        }
    }

    /// The state after a tick.
    pub(crate) fn state(&self, of: &dyn Recorded, ticks: u32) {
        let Some(sink) = self.sink else { return };
        if sink.is_proof() {
            let mut entry = [0; 32];
            let whole = hash(of, |motor, own| entry[usize::from(motor) + 3] = own);
            entry[0] = head(STATE, self.place, of.motors() + 2, 0);
            entry[1..3].copy_from_slice(&halves(whole));
            sink.put(&entry[..usize::from(of.motors()) + 3]);
        }
        self.keyframe(of, ticks, false);
    }

    /// The next part of the state, if it is due: in a quiet moment, or as there is none.
    pub(crate) fn keyframe(&self, of: &dyn Recorded, ticks: u32, is_quiet: bool) {
        let (count, motors) = (self.keyframes.get(), u32::from(of.motors().max(1)));
        let due = count / 2 * (KEYFRAMES_WITHIN / motors) + count % 2;
        if self.sink.is_some() && ticks > due && (is_quiet || ticks > due + PATIENCE) {
            self.keyframes.set(count + 1);
            // The bus's own first: with it a motor goes on as it did.
            let part = if count % 2 == 0 { BUS } else { (count / 2 % motors) as u8 };
            if part == BUS || part < of.motors() {
                self.put_bytes::<LONGEST>(KEYFRAME, part, None, |to| of.save(part, to));
            }
        }
    }

    pub(crate) fn polled(&self, now: Micros, command: &[u8]) {
        self.put_bytes::<8>(POLL, 0, Some(halves(now.get())[0]), |to| to(command));
    }

    pub(crate) fn bytes(&self, bytes: &[u8], now: Micros) {
        self.put_bytes::<24>(BYTES, bytes.len() as u8, Some(halves(now.get())[0]), |to| to(bytes));
    }

    pub(crate) fn failed(&self) {
        self.put(FAILED, 0, [0]);
    }
}

/// Key and data of a frame.
#[inline]
fn words(frame: &CanFrame) -> [u32; 3] {
    let mut data = [0; 8];
    data[..frame.bytes().len()].copy_from_slice(frame.bytes());
    let [a, b, c, d, e, f, g, h] = data;
    [frame.key(), u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])]
}

/// What stands in a motor's fields of its table until they are taken over from the motor that is there.
pub(crate) mod any {
    use core::num::NonZeroU8;

    use embedded_can::StandardId;
    use rc10_app::{Amps, Gear};

    use crate::{cybergear, damiao, dji, lk, odrive, vesc};

    pub(crate) const fn id() -> StandardId {
        StandardId::ZERO
    }
    pub(crate) const fn dji() -> &'static dji::Model {
        &dji::M3508
    }
    pub(crate) const fn damiao() -> damiao::Model {
        damiao::models::J4310
    }
    pub(crate) const fn cybergear() -> cybergear::Model {
        cybergear::models::CYBERGEAR
    }
    pub(crate) const fn lk() -> lk::Model {
        lk::models::MF9025
    }
    pub(crate) const fn drive() -> lk::DriveId {
        lk::DriveId::new(1).expect("1 to 32")
    }
    pub(crate) const fn odrive() -> odrive::Firmware {
        odrive::Firmware::V0_5
    }
    pub(crate) fn vesc() -> vesc::Config {
        let none = Amps::ZERO;
        let currents = vesc::Currents { limit: none, brake: none, handbrake: none };
        vesc::Config::new(1, vesc::ElectricalScale::new(NonZeroU8::MIN, Gear::DIRECT), currents)
    }
}
