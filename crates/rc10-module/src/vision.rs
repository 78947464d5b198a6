//! Auto-aim on a PC beside the robot: the packets of `rm_vision`, as many `RoboMaster` teams have them.
//!
//! | from the PC: bytes | | to the PC: bytes | |
//! |---|---|---|---|
//! | 0 | `A5` | 0 | `5A` |
//! | 1 | bit 0 tracking, 1 to 3 number, 4 to 6 armours | 1 | bit 0 its colour is blue, bit 1 reset |
//! | 2 to 13 | place, m | 2 to 13 | the gimbal's roll, pitch, yaw, rad |
//! | 14 to 17 | yaw, rad | 14 to 25 | where it aims, m |
//! | 18 to 33 | velocity, m/s, and rate of the yaw, rad/s | 26, 27 | CRC-16/MCRF4XX of all before |
//! | 34 to 45 | two radii and a difference of heights, m | | |
//! | 46, 47 | CRC-16/MCRF4XX of all before | | |
//!
//! Numbers are `f32`, little endian. The PC tracks; what is shot at, when, and at which angle is the robot's.
//! Axes: from the gimbal's centre, x where it looked at power-on, y to the left, z up.
//!
//! Source: `rm_serial_driver` of `rm_vision` (Chen Jun, 2022 and 2023), its `packet.hpp`; of armours the tracker of `rm_auto_aim`.
//! Teams change their copies: `docs/modules/vision.md`.

use core::array;
use core::f32::consts::TAU;

use embassy_time::{Duration, Instant, with_deadline};
use embedded_io_async::{ErrorType, Read, Write};
use rc10_app::Seconds;
use rc10_app::maths::sin_cos;
use rc10_time::Micros;

use crate::sum::crc;
use crate::{Found, Protocol, Reception, listen};

const FROM_PC: u8 = 0xA5;
const TO_PC: u8 = 0x5A;
/// Bytes of a packet from the PC.
const LEN: usize = 48;
/// Bytes of a packet to the PC.
pub const TO_PC_LEN: usize = 28;
/// The bytes of two radii that have their signs.
const SIGNS_OF_RADII: [usize; 2] = [37, 41];
/// Bytes of the checksum, at the end of both.
const TAIL: usize = 2;

/// The protocol of `rm_vision`; 115,200 baud 8N1 as it is configured there.
///
/// ```
/// use rc10_module::vision::RmVision;
/// use rc10_module::{Stream, rc10_time::Micros};
///
/// let mut packet = vec![0xA5, 0b100_011_1];
/// for number in [3.0_f32, 0.5, 0.1, 0.2, 1.0, 0.0, 0.0, 2.0, 0.25, 0.3, 0.05] {
///     packet.extend(number.to_le_bytes());
/// }
/// packet.extend(0x9848_u16.to_le_bytes());
/// let (mut stream, mut target) = (Stream::new(RmVision), None);
/// stream.receive(&packet, Micros::ZERO, |it| target = Some(it));
/// let target = target.unwrap();
/// assert_eq!((target.is_tracked, target.number, target.armours), (true, 3, 4));
/// assert_eq!(target.place, [3.0, 0.5, 0.1]);
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct RmVision;

/// A robot, outpost or base that the PC tracks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Target {
    /// Whether it is tracked; else the rest says nothing.
    pub is_tracked: bool,
    /// Its number: 1 to 5 as on the robot, 0 an outpost, 6 a sentry, 7 a base.
    pub number: u8,
    /// Its armour plates: 4, or 2 of a balancing robot, 3 of an outpost.
    pub armours: u8,
    /// Place in m: of the axis in x and y, of the armour that [`yaw`](Self::yaw) is of in z.
    pub place: [f32; 3],
    /// Yaw of that armour, in rad: it faces against x at 0.
    pub yaw: f32,
    /// Velocity of the axis, in m/s.
    pub velocity: [f32; 3],
    /// Rate of the yaw, in rad/s.
    pub yaw_rate: f32,
    /// Distances of the armours from the axis, in m: of that one and the one behind it, and of the others.
    pub radii: [f32; 2],
    /// The others are so much higher, in m.
    pub rise: f32,
}

impl Target {
    /// Place of an armour, in m, after this time; 0 is the one that [`yaw`](Self::yaw) is of, the next is farther round to
    /// the left.
    #[must_use]
    pub fn armour(&self, number: u8, after: Seconds) -> [f32; 3] {
        let is_other = self.armours == 4 && number % 2 == 1;
        let (radius, rise) =
            if is_other { (self.radii[1], self.rise) } else { (self.radii[0], 0.0) };
        let [x, y, z] = array::from_fn(|axis| self.place[axis] + self.velocity[axis] * after.get());
        let between = TAU / f32::from(self.armours.max(1));
        let yaw = self.yaw + self.yaw_rate * after.get() + between * f32::from(number);
        let (sin, cos) = sin_cos(yaw);
        [x - radius * cos, y - radius * sin, z + rise]
    }
}

/// The robot's gimbal, as the PC is to know it: as often as it takes pictures, or more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Gimbal {
    /// Whether the opponent is blue, else red.
    pub aims_at_blue: bool,
    /// Whether the tracker is to begin anew.
    pub resets: bool,
    /// Roll, pitch and yaw in rad, by REP 103: a positive pitch looks down.
    pub attitude: [f32; 3],
    /// The point that it aims at, in m: shown on the PC.
    pub aim: [f32; 3],
}

impl Gimbal {
    /// The packet for the PC.
    #[must_use]
    pub fn packet(&self) -> [u8; TO_PC_LEN] {
        let mut packet = [0; TO_PC_LEN];
        packet[0] = TO_PC;
        packet[1] = u8::from(self.aims_at_blue) | u8::from(self.resets) << 1;
        let all = self.attitude.iter().chain(&self.aim);
        for (bytes, number) in packet[2..].as_chunks_mut().0.iter_mut().zip(all) {
            *bytes = number.to_le_bytes();
        }
        let sum = crc(&packet[..TO_PC_LEN - TAIL]);
        packet[TO_PC_LEN - TAIL..].copy_from_slice(&sum.to_le_bytes());
        packet
    }
}

impl Protocol for RmVision {
    type Message = Target;
    type Buffer = heapless::Vec<u8, LEN>;

    fn examine(&self, bytes: &[u8]) -> Found<Target> {
        let &[FROM_PC, ..] = bytes else { return Found::Nothing };
        let Some(packet) = bytes.first_chunk::<LEN>() else { return Found::More(LEN) };
        let (said, sum) = packet.split_at(LEN - TAIL);
        // No radius is negative: garbage is known by that before its checksum is made.
        if SIGNS_OF_RADII.iter().any(|at| said[*at] & 0x80 != 0) {
            return Found::Nothing;
        }
        if crc(said).to_le_bytes() != sum {
            return Found::Damaged;
        }
        let numbers: [f32; 11] =
            array::from_fn(|at| f32::from_le_bytes(array::from_fn(|byte| said[2 + 4 * at + byte])));
        if !numbers.iter().all(|it| it.is_finite()) {
            return Found::Damaged;
        }
        let [x, y, z, yaw, vx, vy, vz, yaw_rate, near, other, rise] = numbers;
        let target = Target {
            is_tracked: said[1] & 1 != 0,
            number: said[1] >> 1 & 7,
            armours: said[1] >> 4 & 7,
            place: [x, y, z],
            yaw,
            velocity: [vx, vy, vz],
            yaw_rate,
            radii: [near, other],
            rise,
        };
        Found::Frame(LEN, target)
    }
}

/// Speaks with the PC for ever: hands each target and its time to `hear`, and tells the gimbal at once and then in each
/// period. What cannot be sent counts in [`Counters::port_errors`](crate::Counters::port_errors), and may cost the
/// packet that is on its way here.
///
/// `port` is as for [`listen`], and a `read` of it that is dropped must lose no byte.
///
/// ```
/// use embedded_io_async::{Read, Write};
/// use rc10_message::Latest;
/// use rc10_module::rc10_time::Micros;
/// use rc10_module::vision::{self, Gimbal, Target};
/// use rc10_module::Reception;
///
/// /// What the PC sees; with `TARGET.newer_than(..)` nothing that is older.
/// static TARGET: Latest<Target, 1> = Latest::new();
///
/// async fn see(port: impl Read + Write, reception: &Reception, gimbal: impl Fn() -> Gimbal) -> ! {
///     let period = Micros::from_millis(10);
///     vision::run(port, period, reception, |target, at| TARGET.set(target, at), gimbal).await
/// }
/// ```
pub async fn run(
    port: impl Read + Write,
    period: Micros,
    reception: &Reception,
    hear: impl FnMut(Target, Micros),
    gimbal: impl FnMut() -> Gimbal,
) -> ! {
    let period = Duration::from_micros(period.get());
    let port = Telling { port, gimbal, period, due: Instant::MIN };
    listen(port, RmVision, reception, hear).await
}

/// A port at which the gimbal is told beside what is read.
struct Telling<P, G> {
    port: P,
    gimbal: G,
    period: Duration,
    due: Instant,
}

impl<P: ErrorType, G> ErrorType for Telling<P, G> {
    type Error = P::Error;
}

impl<P: Read + Write, G: FnMut() -> Gimbal> Read for Telling<P, G> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, P::Error> {
        loop {
            let now = Instant::now();
            if now >= self.due {
                // Beforehand: a port that fails must not be tried again at once.
                self.due = now + self.period;
                self.port.write_all(&(self.gimbal)().packet()).await?;
                // However long that took, it reads then.
                self.due = self.due.max(Instant::now() + Duration::from_millis(1));
            } else if let Ok(result) = with_deadline(self.due, self.port.read(buffer)).await {
                return result;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;
    use crate::Stream;

    #[test]
    fn armours_stand_round_the_axis_and_go_on_with_it() {
        let target = Target {
            armours: 4,
            place: [3.0, 1.0, 0.1],
            velocity: [1.0, -2.0, 0.5],
            yaw_rate: TAU / 4.0,
            radii: [0.25, 0.3],
            rise: 0.05,
            ..Target::default()
        };
        let near = |is: [f32; 3], wanted: [f32; 3]| {
            assert!(is.iter().zip(wanted).all(|(is, it)| (is - it).abs() < 1e-5), "{is:?}");
        };
        near(target.armour(0, Seconds::ZERO), [2.75, 1.0, 0.1]);
        near(target.armour(1, Seconds::ZERO), [3.0, 0.7, 0.15]);
        near(target.armour(2, Seconds::ZERO), [3.25, 1.0, 0.1]);
        near(target.armour(3, Seconds::ZERO), [3.0, 1.3, 0.15]);
        // A quarter of a turn, on its way.
        near(target.armour(0, Seconds::new(1.0)), [4.0, -1.25, 0.6]);
        let outpost = Target { armours: 3, ..target };
        near(outpost.armour(1, Seconds::ZERO), [3.125, 1.0 - 0.216_506, 0.1]);
        let balancing = Target { armours: 2, ..target };
        near(balancing.armour(1, Seconds::ZERO), [3.25, 1.0, 0.1]);
        // A number that no target has is no panic.
        near(Target { armours: 0, ..target }.armour(0, Seconds::ZERO), [2.75, 1.0, 0.1]);
    }

    #[test]
    fn what_is_no_number_is_not_heard() {
        let mut packet = [0; LEN];
        packet[0] = FROM_PC;
        packet[2..6].copy_from_slice(&f32::INFINITY.to_le_bytes());
        let sum = crc(&packet[..LEN - TAIL]);
        packet[LEN - TAIL..].copy_from_slice(&sum.to_le_bytes());
        let (mut stream, mut heard) = (Stream::new(RmVision), Vec::new());
        stream.receive(&packet, Micros::ZERO, |it| heard.push(it));
        assert_eq!((heard.len(), stream.counters().damaged), (0, 1));
    }

    #[test]
    fn the_gimbal_s_packet_byte_for_byte() {
        let gimbal = Gimbal {
            aims_at_blue: true,
            resets: true,
            attitude: [0.5, -1.0, 2.0],
            aim: [3.0, 0.0, -0.25],
        };
        let floats = [0x3F00_0000_u32, 0xBF80_0000, 0x4000_0000, 0x4040_0000, 0, 0xBE80_0000];
        let mut wanted = std::vec![0x5A, 0b11];
        wanted.extend(floats.iter().flat_map(|it| it.to_le_bytes()));
        assert_eq!(gimbal.packet()[..26], wanted[..]);
        assert_eq!(Gimbal::default().packet()[1], 0);
        assert_eq!(Gimbal { resets: true, ..Gimbal::default() }.packet()[1], 0b10);
    }
}
