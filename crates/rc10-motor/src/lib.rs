//! Motors on CAN and RS-485, and what keeps them safe. `no_std`, no allocation, no I/O.
//!
//! * A [`Motor`] takes a [`Target`] and tells its [`Feedback`]; a [`CanMotor`] also has [`CanIds`].
//! * A [`MotorBus`] owns up to eight, whose wirings may not clash. Every tick it decides whether
//!   each may run, or goes to its [`SafeState`]: expired command, lost link, or the [`ArmSwitch`].
//! * A [`Rs485Bus`](unitree::Rs485Bus) is the same for motors on RS-485.
//! * A [`Fault`] in words keeps a motor from running until [`Request::ClearFault`]; a [`Condition`]
//!   says more. A [`Request`] may wait for the device ([`Response`]).
//! * With feature `embassy`, [`run_bus`](embassy::run_bus) does this every millisecond on any
//!   [`CanPort`](rc10_can::CanPort), [`run_rs485`](embassy::run_rs485) on a serial port, and tasks talk
//!   to the motors through a [`BusPort`](embassy::BusPort) or [`Rs485Port`](embassy::Rs485Port).
//!
//! | module | motors | link |
//! |---|---|---|
//! | [`dji`] | M3508 with C620, M2006 with C610, GM6020 in current and voltage mode | CAN |
//! | [`vesc`] | VESC speed controllers | CAN, extended |
//! | [`unitree`] | GO-M8010-6 | RS-485; or CAN, extended, by Unitree's module |
//! | [`damiao`] | DM-J, -H, -G, -S in MIT, position-velocity, velocity and force-position mode | CAN |
//! | [`cybergear`] | Xiaomi CyberGear, RobStride RS00 to RS06 | CAN, extended |
//! | [`lk`] | LK-TECH MF and MG, single commands or the multi-motor frame | CAN |
//! | [`odrive`] | `ODrive`, `CANSimple` of firmware 0.5 and 0.6 | CAN |
//!
//! Each has its codec (`wire`; [`dji::RawFeedback`]), its motor, and its [`signals`] for DBC files.
//! Shared are [`servo`], for devices that take an effort, and its [`Cascade`](rc10_app::cascade).
//!
//! None of them has been driven for real yet; `docs/motors` in the repository says what each was
//! tested with. Without embassy a bus is plain functions in a loop of your own:
//!
//! ```
//! use rc10_can::CanFrame;
//! use rc10_time::Micros;
//! use rc10_motor::dji::{self, Dji, M3508};
//! use rc10_motor::{ArmSwitch, MotorBus, Safety, Target, TxBatch};
//! use rc10_app::{Rpm, Seconds};
//!
//! let switch = ArmSwitch::new();
//! let mut wheel = Dji::new(dji::Config::new(&M3508, 1))?;
//! let mut bus = MotorBus::new(&switch);
//! let wheel = bus.attach(&mut wheel, Safety::COAST)?;
//!
//! switch.arm()?;
//! // Every millisecond: frames in, newest target in, frames out.
//! # let received: [CanFrame; 0] = [];
//! let now = Micros::from_millis(1);
//! for frame in &received {
//!     bus.on_frame(frame, now);
//! }
//! bus.command(wheel, Target::Speed(Rpm::new(120.0)), now)?;
//! let mut tx = TxBatch::new();
//! bus.tick(now, Seconds::new(0.001), &mut tx)?;
//! assert_eq!(tx.frames()[0].to_string(), "200#0000000000000000"); // no feedback yet: safe
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

// First of all: what it defines is for those behind it.
#[macro_use]
mod handed_on;

mod arm;
mod batch;
mod bus;
mod can_ids;
pub mod cybergear;
pub mod damiao;
pub mod declaration;
pub mod dji;
#[cfg(feature = "embassy")]
pub mod embassy;
mod feedback;
mod goal;
pub mod lk;
mod load;
pub mod mit;
mod motor;
mod motors;
mod not_a_number;
pub mod odrive;
pub mod pending;
pub mod plan;
#[cfg(feature = "record")]
pub mod record;
mod request;
pub mod servo;
pub mod shaft;
mod side;
pub mod signals;
mod supervision;
mod table;
mod target;
pub mod unitree;
pub mod vesc;

pub use arm::{ArmError, ArmState, ArmSwitch, Unfit};
pub use batch::{TxBatch, TxFull};
pub use bus::{BusCounters, Dispatch, MotorBus};
pub use can_ids::{CanIds, Clash, Frames, Guard, MotorName, Ownership, Rate};
pub use declaration::{
    Device, Entry, MOST_BUSES, MOST_LINES, Names, OtherDevice, Place, SetupError, Slot, Started,
    Unsound, Wiring, numbers,
};
pub use feedback::{Condition, Fault, Feedback};
pub use load::{BusLoad, Verdict};
pub use motor::{
    CanMotor, DriveMode, FrameError, FrameKind, Heard, Link, Loops, Motor, SafeState, Tick, Tuning,
    Withheld,
};
pub use motors::{AttachError, CommandError, MotorId, Motors};
pub use request::{Gains, Request, RequestError, Response};
pub use supervision::{MotorCounters, MotorStatus, Refusals, Safety};
pub use target::{Impedance, Motion, Target, TargetError, TargetKind, TargetSet};
// Whose types stand in the signatures of the above: who uses the crate needs no other.
pub use {rc10_app, rc10_can, rc10_time};

/// The parts of [`motors!`](crate::motors) that its expansion names.
#[doc(hidden)]
pub mod __declaration {
    pub use crate::declaration::check::{assert_sound, is_same, late};
    pub use crate::declaration::slots::{
        Held, Placed, label, label_length, place, places, prepare, slots,
    };
}
