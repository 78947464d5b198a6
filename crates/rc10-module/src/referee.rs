//! RoboMaster's referee system: what it says over its serial links, and drawings for the operator's screen.
//!
//! | bytes | |
//! |---|---|
//! | 0 | `A5` |
//! | 1, 2 | length of the data, little endian as all that follows |
//! | 3 | sequence number |
//! | 4 | CRC-8 of bytes 0 to 3: polynomial 31, reflected, from FF |
//! | 5, 6 | command |
//! | from 7 | data |
//! | the last two | CRC-16/MCRF4XX of all before |
//!
//! Seasons change the length of commands. So a command may be longer than what is read of it here; a shorter one is
//! [`Said::Short`], never guessed.
//!
//! Source: protocol V1.x (spring 2026) and V2.0.0 (June 2026) as the code of six teams has them; `docs/modules/referee.md`.

mod draw;

use crc::{Algorithm, Crc, NoTable};
use heapless::Vec;
use rc10_time::Micros;

pub use draw::{Colour, DrawError, Figure, Layers, Operation, Shape, erase, figures, text};

use crate::sum::crc;
use crate::{Found, Protocol};

const START: u8 = 0xA5;
const HEAD: usize = 7;
const TAIL: usize = 2;
/// Most bytes of data: what a robot sends to a custom controller (0x0310). Others have up to 118.
pub const DATA: usize = 300;
/// Most bytes of a frame.
pub const LONGEST: usize = HEAD + DATA + TAIL;
/// What is said ten times a second and was not for so long is not known any more.
pub const SILENCE: Micros = Micros::from_millis(300);

const OF_HEAD: Algorithm<u8> = Algorithm {
    width: 8,
    poly: 0x31,
    init: 0xFF,
    refin: true,
    refout: true,
    xorout: 0,
    check: 0x0B,
    residue: 0,
};
const HEAD_CRC: Crc<u8, NoTable> = Crc::<u8, NoTable>::new(&OF_HEAD);

/// The protocol of the referee system: common link 115,200 baud 8N1, video link 921,600.
///
/// ```
/// use rc10_module::referee::{Referee, Said, Tally};
/// use rc10_module::{Stream, rc10_time::Micros};
///
/// let (mut stream, mut tally) = (Stream::new(Referee), Tally::default());
/// let mut buffer = None;
/// let frame = [
///     0xA5, 14, 0, 1, 0x69, 0x02, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 60, 0, 12, 0, 0, 0, 0xDE, 0x65,
/// ];
/// stream.receive(&frame, Micros::ZERO, |packet| {
///     if let Said::Power(power) = tally.hear(&packet) {
///         buffer = Some(power.buffer);
///     }
/// });
/// assert_eq!(buffer, Some(60));
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Referee;

/// A frame as it came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Its number: one more than that of the frame before, modulo 256.
    pub sequence: u8,
    /// Its command.
    pub command: u16,
    /// Its data.
    pub data: Vec<u8, DATA>,
}

impl Protocol for Referee {
    type Message = Packet;
    type Buffer = Vec<u8, LONGEST>;

    fn examine(&self, bytes: &[u8]) -> Found<Packet> {
        let &[START, ..] = bytes else { return Found::Nothing };
        let Some(&[_, low, high, sequence, check]) = bytes.first_chunk() else {
            return Found::More(5);
        };
        let length = usize::from(u16::from_le_bytes([low, high]));
        if HEAD_CRC.checksum(&[START, low, high, sequence]) != check || length > DATA {
            return Found::Nothing;
        }
        let whole = HEAD + length + TAIL;
        let Some((frame, _)) = bytes.split_at_checked(whole) else { return Found::More(whole) };
        // The CRC of all with its own CRC is 0.
        let &[_, _, _, _, _, c0, c1, ref data @ .., _, _] = frame else { return Found::Nothing };
        if crc(frame) != 0 {
            return Found::Damaged;
        }
        let data = Vec::from_slice(data).unwrap_or_default();
        Found::Frame(whole, Packet { sequence, command: u16::from_le_bytes([c0, c1]), data })
    }
}

/// What a frame says.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Said {
    /// 0x0001, at 1 Hz.
    Game(Game),
    /// 0x0104, after a penalty of the own side: its level, and the robot.
    Penalty {
        /// 1 both yellow, 2 yellow, 3 red, 4 the match is lost.
        level: u8,
        /// The robot that was punished; 0 for all.
        robot: u8,
    },
    /// 0x0201, at 10 Hz.
    Robot(Robot),
    /// 0x0202, at 10 Hz and more.
    Power(Power),
    /// 0x0203, at 1 Hz and more.
    Pose(Pose),
    /// 0x0204, at 3 Hz.
    Energy(Energy),
    /// 0x0206, after damage.
    Hurt {
        /// The armour plate or module, 0 to 15.
        part: u8,
        /// 0 a projectile, 1 a module that is gone, 2 to 4 too fast, too hot, too much power, 5 a collision; in the
        /// order of the season's manual.
        reason: u8,
    },
    /// 0x0207, after a shot.
    Shot(Shot),
    /// 0x0208, at 10 Hz.
    Allowance {
        /// Projectiles of 17 mm that may still be shot.
        small: u16,
        /// Of 42 mm.
        large: u16,
        /// Coins of the team.
        coins: u16,
    },
    /// Another command; what it says is in [`Packet::data`].
    Other(u16),
    /// A command with less data than it had in any season: nothing of it is used.
    Short(u16),
}

/// The state of the match (0x0001).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Game {
    /// 1 RMUC, 2 technical challenge, 3 ICRA, 4 RMUL 3v3, 5 RMUL 1v1.
    pub kind: u8,
    /// 0 not begun, 1 preparation, 2 self-check, 3 countdown of 5 s, 4 match, 5 result.
    pub stage: u8,
    /// Rest of this stage, s.
    pub seconds: u16,
}

/// This robot (0x0201).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Robot {
    /// 1 to 9 red, 101 to 109 blue.
    pub id: u8,
    /// 1 to 10.
    pub level: u8,
    /// Hit points now, and at most.
    pub health: [u16; 2],
    /// What a barrel cools in a second.
    pub cooling: u16,
    /// The heat that a barrel may have.
    pub heat_limit: u16,
    /// The power that the chassis may take, W.
    pub power_limit: u16,
    /// Whether the power module supplies gimbal, chassis, shooter.
    pub supplied: [bool; 3],
    /// The greatest speed of a projectile, m/s; `None` from systems before V2.0.0.
    pub speed_limit: Option<f32>,
}

/// Buffer energy and heat (0x0202).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Power {
    /// Energy that the chassis may still take above its limit, J. At 0 the robot is punished.
    pub buffer: u16,
    /// Heat of the barrel of 17 mm.
    pub small_heat: u16,
    /// Heat of the barrel of 42 mm.
    pub large_heat: u16,
}

/// Where the positioning system sees this robot (0x0203).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pose {
    /// m.
    pub x: f32,
    /// m.
    pub y: f32,
    /// Direction of the speed module, degrees; 0 is north.
    pub angle: f32,
}

/// The chassis' energy for the match (0x0204).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Energy {
    /// The step that is reached, per cent of the match's energy: 125, 100, 50, 30, 15, 5, 1, or 0.
    pub at_least: u8,
}

/// A shot (0x0207).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Shot {
    /// 1 of 17 mm, 2 of 42 mm.
    pub kind: u8,
    /// 1 and 2 barrels of 17 mm, 3 of 42 mm.
    pub barrel: u8,
    /// Shots a second.
    pub rate: u8,
    /// m/s.
    pub speed: f32,
}

impl Packet {
    /// What it says, if it is as long as any season has it, or longer.
    #[must_use]
    pub fn said(&self) -> Said {
        let command = self.command;
        self.read().unwrap_or(Said::Short(command))
    }

    /// `None` if it is too short, or has a number that is not finite.
    fn read(&self) -> Option<Said> {
        let data = Fields(&self.data);
        Some(match self.command {
            0x0001 => {
                // A time of day is behind it.
                data.byte(10)?;
                let kind = data.byte(0)?;
                Said::Game(Game { kind: kind & 15, stage: kind >> 4, seconds: data.word(1)? })
            }
            0x0104 => {
                // Their number is behind it.
                data.byte(2)?;
                Said::Penalty { level: data.byte(0)?, robot: data.byte(1)? }
            }
            0x0201 => {
                // V2.0.0 has a speed between the limit and the outputs.
                let is_new = data.0.len() >= 17;
                let outputs = data.byte(if is_new { 16 } else { 12 })?;
                Said::Robot(Robot {
                    id: data.byte(0)?,
                    level: data.byte(1)?,
                    health: [data.word(2)?, data.word(4)?],
                    cooling: data.word(6)?,
                    heat_limit: data.word(8)?,
                    power_limit: data.word(10)?,
                    supplied: [0, 1, 2].map(|bit| outputs >> bit & 1 != 0),
                    speed_limit: if is_new { Some(data.float(12)?) } else { None },
                })
            }
            0x0202 => Said::Power(Power {
                buffer: data.word(8)?,
                small_heat: data.word(10)?,
                large_heat: data.word(12)?,
            }),
            0x0203 => {
                Said::Pose(Pose { x: data.float(0)?, y: data.float(4)?, angle: data.float(8)? })
            }
            0x0204 => {
                let (flags, levels) = (data.byte(7)?, [125, 100, 50, 30, 15, 5, 1]);
                let reached = levels.into_iter().enumerate().find(|(bit, _)| flags >> bit & 1 != 0);
                Said::Energy(Energy { at_least: reached.map_or(0, |(_, level)| level) })
            }
            0x0206 => {
                let hurt = data.byte(0)?;
                Said::Hurt { part: hurt & 15, reason: hurt >> 4 }
            }
            0x0207 => Said::Shot(Shot {
                kind: data.byte(0)?,
                barrel: data.byte(1)?,
                rate: data.byte(2)?,
                speed: data.float(3)?,
            }),
            0x0208 => {
                Said::Allowance { small: data.word(0)?, large: data.word(2)?, coins: data.word(4)? }
            }
            other => Said::Other(other),
        })
    }
}

/// Data of a frame, little endian.
struct Fields<'d>(&'d [u8]);

impl Fields<'_> {
    fn byte(&self, at: usize) -> Option<u8> {
        self.0.get(at).copied()
    }

    fn word(&self, at: usize) -> Option<u16> {
        self.0.get(at..)?.first_chunk().copied().map(u16::from_le_bytes)
    }

    fn float(&self, at: usize) -> Option<f32> {
        let value = f32::from_le_bytes(*self.0.get(at..)?.first_chunk()?);
        value.is_finite().then_some(value)
    }
}

/// Counters of what a link said. Each starts over after 2³².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Tally {
    /// Frames of commands that are not read here.
    pub other: u32,
    /// Frames that are shorter than their command ever was, or have a number that is not finite.
    pub short: u32,
    /// Frames that are missing by their sequence numbers.
    pub missing: u32,
    last: Option<u8>,
}

impl Tally {
    /// Counts a frame, and hands on what it says.
    pub fn hear(&mut self, packet: &Packet) -> Said {
        let said = packet.said();
        match said {
            Said::Other(_) => self.other = self.other.wrapping_add(1),
            Said::Short(_) => self.short = self.short.wrapping_add(1),
            _ => {}
        }
        let before = self.last.replace(packet.sequence);
        let missing = before.map_or(0, |last| packet.sequence.wrapping_sub(last).wrapping_sub(1));
        self.missing = self.missing.wrapping_add(missing.into());
        said
    }
}

/// A frame to send.
///
/// # Errors
/// If there are more than [`DATA`] bytes of data.
pub fn frame(sequence: u8, command: u16, data: &[u8]) -> Result<Vec<u8, LONGEST>, TooLong> {
    let length = data.len();
    let size = u16::try_from(length).ok().filter(|_| length <= DATA).ok_or(TooLong { length })?;
    let [low, high] = size.to_le_bytes();
    let head = [START, low, high, sequence];
    let [c0, c1] = command.to_le_bytes();
    let all =
        head.into_iter().chain([HEAD_CRC.checksum(&head), c0, c1]).chain(data.iter().copied());
    let mut frame: Vec<u8, LONGEST> = all.collect();
    let check = crc(&frame).to_le_bytes();
    frame.extend(check);
    Ok(frame)
}

/// More data than a frame has room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("{length} bytes of data, must be at most {DATA}")]
pub struct TooLong {
    /// Bytes of data.
    pub length: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stream;
    use std::vec;

    fn packet(command: u16, data: &[u8]) -> Packet {
        let mut heard = None;
        let bytes = frame(7, command, data).unwrap();
        Stream::new(Referee).receive(&bytes, Micros::ZERO, |packet| heard = Some(packet));
        heard.unwrap()
    }

    fn said(command: u16, data: &[u8]) -> Said {
        packet(command, data).said()
    }

    /// Made by another program: `tests/python/referee.py` makes them anew.
    #[test]
    fn frames_byte_for_byte() {
        let power = *b"\xa5\x0e\x00\x01\x69\x02\x02\0\0\0\0\0\0\0\0\x3c\0\x0c\0\0\0\xde\x65";
        let robot =
            *b"\xa5\x0d\x00\x02\x6f\x01\x02\x03\x01\xc8\0\xc8\0\x0c\0\x64\0\x37\0\x07\xf7\xf1";
        let (mut stream, mut heard) = (Stream::new(Referee), vec![]);
        stream.receive(&[&power[..], &robot].concat(), Micros::ZERO, |it| heard.push(it.said()));
        let expected = [
            Said::Power(Power { buffer: 60, small_heat: 12, large_heat: 0 }),
            Said::Robot(Robot {
                id: 3,
                level: 1,
                health: [200, 200],
                cooling: 12,
                heat_limit: 100,
                power_limit: 55,
                supplied: [true; 3],
                speed_limit: None,
            }),
        ];
        assert_eq!(heard, expected);
        assert_eq!(&frame(1, 0x0202, &power[7..21]).unwrap()[..], &power);
        assert_eq!(&frame(2, 0x0201, &robot[7..20]).unwrap()[..], &robot);
    }

    #[test]
    fn the_checksum_of_the_head_is_that_of_its_tables() {
        assert_eq!(HEAD_CRC.checksum(b"123456789"), 0x0B);
    }

    /// A season that appends is read; one byte less than the least is short, and counted.
    #[test]
    fn every_command_at_its_least_length_and_longer() {
        for (command, least) in [
            (0x0001, 11),
            (0x0104, 3),
            (0x0201, 13),
            (0x0202, 14),
            (0x0203, 12),
            (0x0204, 8),
            (0x0206, 1),
            (0x0207, 7),
            (0x0208, 6),
        ] {
            let whole = said(command, &vec![0; least]);
            assert!(!matches!(whole, Said::Short(_) | Said::Other(_)), "{command:#06x}");
            let longer = said(command, &vec![0; least + 90]);
            let kind = |it| core::mem::discriminant::<Said>(it);
            assert_eq!(kind(&whole), kind(&longer), "{command:#06x}");
            assert_eq!(said(command, &vec![0; least - 1]), Said::Short(command));
        }
        assert_eq!(said(0x0307, &[1, 2]), Said::Other(0x0307));
    }

    #[test]
    fn fields_lie_where_both_versions_have_them() {
        let mut data = vec![103, 9, 1, 2, 3, 4, 5, 6, 7, 8, 120, 0];
        let Said::Robot(old) = said(0x0201, &[&data[..], &[0b101]].concat()) else { panic!() };
        data.extend(25.5_f32.to_le_bytes());
        let Said::Robot(new) = said(0x0201, &[&data[..], &[0b010, 99]].concat()) else { panic!() };
        for robot in [old, new] {
            assert_eq!((robot.id, robot.level, robot.health), (103, 9, [0x0201, 0x0403]));
            assert_eq!((robot.cooling, robot.heat_limit, robot.power_limit), (0x0605, 0x0807, 120));
        }
        assert_eq!((old.supplied, old.speed_limit), ([true, false, true], None));
        assert_eq!((new.supplied, new.speed_limit), ([false, true, false], Some(25.5)));
        data.truncate(12);
        data.extend(f32::NAN.to_le_bytes());
        assert_eq!(said(0x0201, &[&data[..], &[7]].concat()), Said::Short(0x0201));

        let game = Game { kind: 4, stage: 3, seconds: 0x0201 };
        assert_eq!(said(0x0001, &[0x34, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0]), Said::Game(game));
        assert_eq!(said(0x0104, &[2, 103, 1]), Said::Penalty { level: 2, robot: 103 });
        assert_eq!(said(0x0206, &[0x42]), Said::Hurt { part: 2, reason: 4 });
        let allowance = Said::Allowance { small: 0x0201, large: 0x0403, coins: 0x0605 };
        assert_eq!(said(0x0208, &[1, 2, 3, 4, 5, 6]), allowance);
        let speed = 27.25_f32.to_le_bytes();
        let shot = Shot { kind: 1, barrel: 2, rate: 11, speed: 27.25 };
        assert_eq!(said(0x0207, &[&[1, 2, 11], &speed[..]].concat()), Said::Shot(shot));
        let at_least = |flags| match said(0x0204, &[9, 9, 9, 9, 9, 9, 9, flags]) {
            Said::Energy(Energy { at_least }) => at_least,
            other => panic!("{other:?}"),
        };
        assert_eq!(
            [0x7F, 0x7E, 0x7C, 0x78, 0x70, 0x60, 0x40, 0].map(at_least),
            [125, 100, 50, 30, 15, 5, 1, 0]
        );
    }

    #[test]
    fn what_is_missing_other_and_short_is_counted() {
        let mut tally = Tally::default();
        for (sequence, command) in [(254, 0x0202), (255, 0x0777), (1, 0x0201), (5, 0x0777)] {
            let _ =
                tally.hear(&Packet { sequence, command, data: Vec::from_slice(&[0; 12]).unwrap() });
        }
        assert_eq!((tally.other, tally.short, tally.missing), (2, 2, 1 + 3));
    }

    #[test]
    fn lengths_have_a_limit() {
        assert_eq!(frame(0, 0x0310, &[0; DATA]).unwrap().len(), LONGEST);
        assert_eq!(frame(0, 0x0310, &[0; DATA + 1]), Err(TooLong { length: DATA + 1 }));
        let mut head = [START, 45, 1, 0, 0];
        head[4] = HEAD_CRC.checksum(&head[..4]);
        assert_eq!(Referee.examine(&head), Found::Nothing);
        head[1] = 44;
        head[4] = HEAD_CRC.checksum(&head[..4]);
        assert_eq!(Referee.examine(&head), Found::More(LONGEST));
    }
}
