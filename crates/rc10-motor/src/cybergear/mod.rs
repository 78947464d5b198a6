//! Xiaomi CyberGear and RobStride RS00 to RS06: one protocol, and a [table](models) of ranges.
//!
//! Terms: the **host** sends commands; a frame's **type** is bits 28 to 24. Extended, 1 Mbit/s.
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
//! * Type 22 saves ([`wire::save`]) on a RobStride, but sets the bit rate of a CyberGear.
//! * Range-mapped fields are those of [`mit`](crate::mit).
//!
//! ```
//! use rc10_time::Micros;
//! use rc10_motor::cybergear::{Config, Address, CyberGear, models};
//! use rc10_motor::{ArmSwitch, MotorBus, Safety, Target, TxBatch};
//! use rc10_app::{Rpm, Seconds};
//!
//! let switch = ArmSwitch::new();
//! // Set to identifier 1 with the vendor's tool; 0xFD is what such tools call themselves.
//! let mut joint = CyberGear::new(Config::new(&models::CYBERGEAR, Address { motor: 1, host: 0xFD }))?;
//! let mut bus = MotorBus::new(&switch);
//! let joint = bus.attach(&mut joint, Safety::HOLD)?;
//! bus.command(joint, Target::Speed(Rpm::new(60.0)), Micros::ZERO)?;
//! let mut tx = TxBatch::new();
//! bus.tick(Micros::from_millis(1), Seconds::new(0.001), &mut tx)?;
//! assert_eq!(tx.frames()[0].to_string(), "0400FD01#0000000000000000"); // not armed: stop
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sources: CyberGear manual and samples, `CyberGearDriver` 0.2.0, RobStride manuals (260428).

mod config;
mod motor;
pub mod signals;
pub mod wire;

pub use crate::mit::{Limits, Setpoint};
pub use config::{Config, Model, models};
pub use motor::CyberGear;
pub use wire::{Address, Reply};
