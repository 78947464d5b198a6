//! LK-TECH drives: MF (direct drive), MG (with gearbox), MS (open loop).
//!
//! *Terms.* A *drive* is the motor with its controller. *iq* is the torque current. *Open loop* is
//! a voltage without current measurement, which only MS drives have. Angles and speeds on the wire
//! are the rotor's, in front of the gearbox of an MG, and count up clockwise (manual V2.3).
//!
//! *Identifiers.* A drive set to 1 ..= 32 takes commands at standard `0x140 + id` and answers each
//! with one frame of the same identifier. 1 Mbit/s; eight bytes, always; little endian.
//!
//! *Frames.* Byte 0 is the command, also in the answer: an echo (off, stop, run), a measurement (to
//! a move and `9C`: temperature, iq, speed, encoder), or what was asked for (`9A` health, `9D`
//! phase currents, `92` and `94` angles).
//!
//! *Multi-motor frame.* `0x280` carries the iq of drives 1 ..= 4, two bytes each. It has to be
//! switched on with the vendor's tool, and then no single command is obeyed any more.
//!
//! *Rules.*
//! * The current step is the model's, the encoder's width the device's: [`Model`]. The manual's
//!   ±2000 = ±32 A and ±2048 = ±33 A are one step, 33 / 2048 A on an MG; MF drives have half of it.
//! * A drive may act one frame late (XDU librm): off and run are to be sent until they are echoed.
//! * The encoder of an 18 bit device is reported by its upper 16 bits.
//!
//! *Motor.* [`Lk`] commands torque currents; all loops run here. It keeps a drive off (`80`) unless
//! it may drive, repeats "run" (`88`) until the echo, and asks for errors (`9A`) every 100 ticks.
//!
//! ```
//! use rc10_app::{Cascade, FeedForward, PidConfig, Rpm, RpmPerSecond};
//! use rc10_motor::lk::{Config, Lk, models};
//! use rc10_motor::{ArmSwitch, MotorBus, Safety, Target};
//! use rc10_time::Micros;
//!
//! // Amperes for rpm at the output shaft, 5 A at most.
//! let cascade = Cascade {
//!     speed: PidConfig::within(5.0).kp(0.2).ki(2.0),
//!     angle: PidConfig::within(200.0).kp(3.0),
//!     outer_divider: 5,
//!     acceleration: RpmPerSecond::new(1000.0),
//!     feed_forward: FeedForward::NONE,
//! };
//! let mut joint = Lk::new(Config::new(models::MG4010E_I10, 1, cascade))?;
//! let switch = ArmSwitch::new();
//! let mut bus = MotorBus::new(&switch);
//! let joint = bus.attach(&mut joint, Safety::HOLD)?;
//! bus.command(joint, Target::Speed(Rpm::new(60.0)), Micros::ZERO)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sources: LK CAN manual V2.3; XDU-IRobot librm `lk_motor.hpp` (lag of commands, all error bits).

mod config;
mod motor;
pub mod signals;
pub mod wire;

pub use crate::not_a_number::NotANumber;
pub use config::{Commands, Config, EncoderBits, Model, models};
pub use motor::Lk;
pub use wire::{
    CENTIDEGREES, Command, DriveId, Errors, Health, MULTI_MOTOR_ID, Motion, PhaseCurrents, Reply,
    SpinDirection, pack_multi_motor,
};
