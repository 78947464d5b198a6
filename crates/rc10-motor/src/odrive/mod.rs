//! `ODrive` controllers that speak `CANSimple`.
//!
//! *Terms.* A *node* is an axis, 0 ..= 63. A *turn* is one of the encoder's shaft. *Iq* is the
//! torque current. An axis follows inputs in the *state* ([`AxisState`]) closed-loop control only.
//!
//! *Identifiers.* Standard, `node << 5 | message`. Little endian, f32 as in IEEE 754.
//!
//! *From the axis:* `01` heartbeat (error word, state), `09` estimates (turns, turns/s), `14` Iq
//! (wanted, measured), `15` temperatures (°C, 0.6), `17` supply (V, A), at rates set on it; 0.5
//! sends all but `01` and `09` only on a remote frame.
//!
//! *To the axis,* not answered: `07` state, `0B` modes, `0C` position, `0D` velocity, `0E` torque,
//! `0F` limits, `18` clear errors.
//!
//! *Rules.*
//! * Commands have eight bytes, as in the vendor's DBC; clearing errors has no byte.
//! * A position's feed-forwards have 16 bits, 0.001 turns/s and 0.001 N m; all else is f32.
//! * Error bits and heartbeat bytes 5 ..= 7 differ between 0.5 and 0.6: [`Firmware`].
//!
//! *Motor.* [`ODrive`] keeps an axis idle, then tells its modes, a neutral input, and to follow,
//! until the heartbeat says so. Loops run here or in the axis ([`Control`]).
//!
//! ```
//! use rc10_app::{Cascade, FeedForward, Gear, PidConfig, Rpm, RpmPerSecond};
//! use rc10_time::Micros;
//! use rc10_motor::odrive::{Config, Control, Firmware, ODrive, Rates};
//! use rc10_motor::{ArmSwitch, MotorBus, Safety, Target};
//!
//! // Newton metres for rpm at the output shaft, 8 N m at most.
//! let cascade = Cascade {
//!     speed: PidConfig::within(8.0).kp(0.1).ki(1.0),
//!     angle: PidConfig::within(250.0).kp(3.0),
//!     outer_divider: 5,
//!     acceleration: RpmPerSecond::new(1500.0),
//!     feed_forward: FeedForward::NONE,
//! };
//! // Estimates at 500 Hz, heartbeats at 50 Hz, as set in the axis.
//! let config = Config::new(3, Firmware::V0_6, Control::Torque(cascade), Rates::new(500, 50))
//!     .with_gear(Gear::new(8, 1).ok_or("gear")?);
//! let mut wheel = ODrive::new(config)?;
//! let switch = ArmSwitch::new();
//! let mut bus = MotorBus::new(&switch);
//! let wheel = bus.attach(&mut wheel, Safety::COAST)?;
//! bus.command(wheel, Target::Speed(Rpm::new(60.0)), Micros::ZERO)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sources: firmware 0.5.6 (`can_simple.cpp`, `odrive-interface.yaml`), `odrive-can`, DBC files.

mod config;
mod motor;
pub mod signals;
pub mod wire;

pub use crate::not_a_number::NotANumber;
pub use config::{Config, Control, Firmware, Limits, Rates};
pub use motor::ODrive;
pub use wire::{
    AxisState, Command, ControlMode, Currents, Estimates, Heartbeat, InputMode, Message, Node,
    Query, Supply, Temperatures,
};
