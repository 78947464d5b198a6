//! Damiao motors: DM-J, -H, -G and -S series.
//!
//! Terms: **`CAN_ID`** is what a motor listens to, **`MST_ID`** what it answers with. A **mode** is
//! a way of control (register 10). **Limits** (PMAX, VMAX, TMAX, registers 21 to 23) are the ends
//! of range-mapped fields: others than the motor's give wrong values and no error, so they are
//! always given, from a [`Model`] or by hand.
//!
//! Standard identifiers, 1 Mbit/s as sold; it answers only. Rad, rad/s and N m at the output.
//!
//! | frame | identifier | bytes |
//! |---|---|---|
//! | [`wire::mit`] | `CAN_ID` | position 16 bits, velocity, kp, kd, torque 12 bits each, big endian |
//! | [`wire::position_velocity`] | 0x100 + `CAN_ID` | two f32, little endian |
//! | [`wire::velocity`] | 0x200 + `CAN_ID` | one f32; four bytes |
//! | [`wire::force_position`] | 0x300 + `CAN_ID` | f32, velocity u16 · 0.01 rad/s, current u16 · 0.0001 |
//! | [`wire::operate`] | as the mode | seven 0xFF; 0xFC enable, 0xFD disable, 0xFE store zero, 0xFB clear error |
//! | [`Access`](registers::Access) | 0x7FF | `CAN_ID` u16, operation, register, value |
//! | [`Feedback`] | `MST_ID` | error and low four bits of `CAN_ID`, position, velocity, torque, two temperatures |
//!
//! * It reacts to **every** standard frame with its `CAN_ID` in the low byte, of any motor.
//! * Only four bits of `CAN_ID` fit into feedback: several motors on one `MST_ID` need 1 to 15.
//! * A setpoint with all fields at their ends would be an operation; [`wire::mit`] never sends one.
//! * What a mode's frame does while the motor is in another mode is not documented.
//! * Storing the zero takes effect at once and lasts: only while disabled.
//!
//! A [`Damiao`] enables its motor when it is driven, and compares its registers with the
//! configuration before: `docs/motors/damiao.md` has its targets, requests and faults.
//!
//! ```
//! use rc10_motor::rc10_app::{Cascade, FeedForward};
//! use rc10_motor::damiao::{Config, Control, Damiao, models};
//! use rc10_motor::rc10_app::{PidConfig, RpmPerSecond};
//!
//! // A J4310 under an arm of 0.02 kg m², driven in MIT mode. 1 rpm is 0.105 rad/s: with
//! // kp = 0.063 N m/rpm the speed follows in 0.02 / (0.063 · 9.55) s = 33 ms.
//! let cascade = Cascade {
//!     speed: PidConfig::within(7.0).kp(0.063).ki(0.5),
//!     angle: PidConfig::within(150.0).kp(1.3),
//!     outer_divider: 1,
//!     acceleration: RpmPerSecond::new(1000.0),
//!     feed_forward: FeedForward::NONE,
//! };
//! let arm = Damiao::new(Config::new(models::J4310, 0x11, 0x31, Control::Mit(cascade)))?;
//! // The same low byte twice: it would answer itself.
//! assert!(Config::new(models::J4310, 0x11, 0x111, Control::Velocity).validate().is_err());
//! # Ok::<(), rc10_motor::rc10_app::ConfigError>(())
//! ```
//!
//! Sources: manuals of J4310, J4340, J6006, J8009, J10010L and S3519; the vendor's
//! `dm_motor_drv.c`, `DM_CAN` and dm-tools; `openarm_can`, damiao-motor 1.0.6. Where they disagree:
//! 0xFD disables, a write is acknowledged with 0x55 or 0x33, a velocity has four bytes.

mod config;
mod motor;
pub mod registers;
pub mod signals;
pub mod wire;

pub use crate::mit::{Limits, Setpoint};
pub use config::{Config, Control, Model, models};
pub use motor::Damiao;
pub use wire::{DeviceId, Feedback, Mode, Operation, State};
