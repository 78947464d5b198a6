//! VESC speed controllers on CAN.
//!
//! **Terms.** *Electrical rpm* (eRPM) is the field's speed: rotor rpm times *pole pairs* (magnet
//! poles / 2). The *tachometer* counts six steps of each electrical turn. *Duty* is the share of
//! the supply voltage. *Brake* current acts against any movement; *handbrake* current is a still
//! field that keeps a standing shaft where it is.
//!
//! **Identifiers.** All frames are extended: `packet << 8 | id`, with the upper 13 bits zero. VESCs
//! are numbered 0 to 254; a frame to 255 is for all of them. Commands carry the receiver's id, status
//! frames the sender's, a PONG the id of the sender of the PING. Factory bit rate: 500 kbit/s, to be
//! set to 1 Mbit/s on a bus with others. Status frames are off until switched on in VESC Tool.
//!
//! **Frames.** Signed, big endian, scaled. A command that drives is one `i32`: [`Command`]; a limit
//! that is kept is two: [`Setting`]. Status comes as six packets of eight bytes, at two rates:
//! [`Status`]. No frame tells faults: a faulted VESC is only seen not to do what it is told.
//!
//! **Rules.**
//! * The length is part of a command: firmware from 6.00 on takes six or more bytes for a delayed
//!   `SET_CURRENT`, and 10 A in eight bytes become 655,360 A.
//! * `SET_RPM` 0 holds nothing. Below a minimum (900 eRPM unless set otherwise) the speed is not
//!   regulated: [`ElectricalScale::regulates`]. Free is `SET_CURRENT` 0, slowing down is `SET_CURRENT_BRAKE`,
//!   standing is `SET_CURRENT_HANDBRAKE` or `SET_POS`; none is ever sent in place of another.
//! * `SET_POS` is an angle within one turn of the encoder the VESC is set up with.
//! * A VESC lets go when commands stop (1 s by default, 0.5 s by its documentation): 50 Hz or more.
//! * `STATUS_6` is packet 58, from firmware 6.00 on; packet 28 asks for an encoder's state.
//!
//! **As a motor.** A [`Vesc`] repeats one command frame at the rate of its [`Config`], and sends a
//! new one at once in place of one that waits. What each target and safe state does, and what each
//! [`Condition`](crate::Condition) tells: `docs/motors/vesc.md`.
//!
//! ```
//! use core::num::NonZeroU8;
//! use rc10_app::{Amps, Gear};
//! use rc10_motor::vesc::{Config, Currents, ElectricalScale, Vesc};
//! use rc10_motor::{ArmSwitch, MotorBus, Safety};
//!
//! let seven = NonZeroU8::new(7).unwrap();
//! let scale = ElectricalScale::new(seven, Gear::new(3, 1).unwrap());
//! let currents =
//!     Currents { limit: Amps::new(40.0), brake: Amps::new(15.0), handbrake: Amps::new(10.0) };
//! let mut wheel = Vesc::new(Config::new(1, scale, currents))?;
//! let switch = ArmSwitch::new();
//! let mut bus = MotorBus::new(&switch);
//! bus.attach(&mut wheel, Safety::BRAKE)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sources: vedderb/bldc 5.03 to 7.01: `comm_can.c`, `datatypes.h`, `mcconf_default.h`, docs.

mod config;
mod hold;
mod motor;
pub mod signals;
mod watch;
pub mod wire;

pub use crate::not_a_number::NotANumber;
pub use config::{CONTROL_HZ, Config, Currents, DEFAULT_MINIMUM, ElectricalScale, StatusRates};
pub use motor::Vesc;
pub use rc10_app::ElectricalRpm;
pub use wire::{Address, Command, Packet, Reply, Setting, Status, VescId, coast, ping, shutdown};
