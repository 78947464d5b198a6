//! Xiaomi CyberGear and RobStride RS00 to RS06: one protocol, and a [table](models) of ranges.
//!
//! Terms: the **host** is whoever commands, with an identifier of its own; the **type** of a frame
//! stands in bits 28 to 24 of its identifier. Extended identifiers, eight bytes, 1 Mbit/s.
//!
//! | identifier bits | 28–24 | 23–8 | 7–0 |
//! |---|---|---|---|
//! | to a motor | type | host, or the torque | motor |
//! | from a motor | type | mode, faults, motor | host |
//!
//! | type | what | bytes |
//! |---|---|---|
//! | 0 | [`wire::identify`] | its answer: the chip's number |
//! | 1 | [`wire::motion`] | position, velocity, kp, kd, u16 big endian; torque in the identifier |
//! | 2, 24 | [`wire::Feedback`], answered or (RobStride) every 10 ms | position, velocity, torque, temperature · 0.1 °C, u16 big endian |
//! | 3, 4 | [`wire::enable`], [`wire::stop`] | first byte 1 in a stop: [`wire::clear_faults`] |
//! | 6 | [`wire::set_zero`] | first byte 1 |
//! | 7 | [`wire::set_id`] | first byte 1; the new one in bits 23–16 |
//! | 17, 18 | [`wire::read`], [`wire::write_real`], [`wire::write_byte`] | index u16, two zeros, value; little endian |
//! | 21 | [`wire::FaultReport`] | faults, warnings: u32, taken as little endian, as parameters are |
//!
//! * The torque is part of the identifier: a newer command does not have an older one's.
//! * Bit rate (22), saving and switching the reports on are left to the vendor's tool: RobStride
//!   gives type 22 another meaning than CyberGear.
//! * Range-mapped fields are those of [`mit`](crate::damiao::mit).
//!
//! Sources: CyberGear manual and its samples, `CyberGearDriver` 0.2.0 (Python); RobStride manuals
//! RS00 to RS06 (260428).

pub mod models;
pub mod wire;

pub use crate::damiao::mit::{Limits, Setpoint};
pub use models::{Faults, Model};
pub use wire::{Address, Reply};
