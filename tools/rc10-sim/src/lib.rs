//! A robot's buses without the robot: simulated ESCs and motors of many vendors, CAN wires with true
//! arbitration and bit lengths, RS-485 lines, a base on wheels, and virtual time behind `embassy-time`.
//!
//! * [`World`]: holds everything and lets time pass. [`World::run`] runs a future, as the robot's
//!   own tasks are; [`World::advance`] is for a plain loop.
//! * [`Bus`] and its [`SimPort`]: one wire, and its faults. The port implements
//!   [`rc10_can::CanPort`].
//! * [`Controller`]: what takes the port's place on a wire, an emulated chip for example.
//! * [`Esc`]: a device with its motor on a wire: its true state, power, and faults. Its electronics
//!   are a [`Device`]; its motor is a [`Plant`].
//! * [`Line`]: an RS-485 line. [`Serial`]: a serial link in full duplex to one [`SerialDevice`]. The
//!   host of either has a [`UartPort`].
//!   [`Pulses`] and its [`PulsePort`]: a line on which one [`PulseDevice`] sends pulses.
//! * [`Contact`]: a switch or marker that a motor's shaft closes, and the input that it pulls low.
//! * [`Servo`], [`Voltage`]: what a servo is told, and what is measured.
//! * [`fault`]: what goes wrong, as a user writes it; [`Faults`] does it to buses and lines.
//! * [`remote`]: remote controls with their receivers. [`imu`]: which way a base looks.
//! * [`ArmLink`]: links that hang on each other, each on a motor.
//! * [`Base`]: motors under a body that rolls and slides, on wheels of any kind ([`Chassis`]).
//!
//! | vendor | devices |
//! |---|---|
//! | DJI | [`Bus::add_esc`] of an [`EscConfig`]: C620, C610, GM6020 in either mode |
//! | VESC | [`vesc::Vesc`] |
//! | Unitree | [`unitree_module::UnitreeModule`] on CAN, [`unitree_line::GoM8010`] on a line |
//! | Damiao | [`damiao::Damiao`] |
//! | Xiaomi, RobStride | [`cybergear::CyberGear`] |
//! | LK-TECH | [`lk::Drive`] |
//! | `ODrive` | [`odrive::Axis`] |
//!
//! One of your own: implement [`Device`] from its manual and give it to [`Bus::add`].
//!
//! **An independent witness.** The ESCs decode commands and encode feedback with code of their
//! own. This crate knows no motor library and no robot: a scale error in theirs does not cancel
//! itself out here.
//!
//! **The same seed gives the same run**, to the bit, on one machine. Time is an integer count of
//! nanoseconds, of which ports and `embassy-time` see whole microseconds, and nothing reads a wall
//! clock. Two machines may differ in the last bit of a sine or an exponential.
//!
//! The crate brings the host's `embassy-time` driver (1 MHz) and critical section: a program that
//! links it must not bring others.
//!
//! ```
//! use rc10_can::{CanFrame, CanPort, embedded_can::StandardId};
//! use rc10_time::Micros;
//! use rc10_sim::{BusConfig, EscConfig, Model, World};
//!
//! let mut world = World::new(42);
//! let bus = world.add_bus(BusConfig::default());
//! let wheel = bus.add_esc(EscConfig::new(Model::C620, 1))?;
//! let mut port = bus.port();
//! for millisecond in 1..=100 {
//!     world.advance(Micros::from_millis(millisecond));
//!     while let Some((_frame, _arrived)) = port.receive() {}
//!     // 2 A to motor 1.
//!     let command = CanFrame::eight_bytes(
//!         StandardId::new(0x200).unwrap(),
//!         [0x06, 0x66, 0, 0, 0, 0, 0, 0],
//!     );
//!     let _ = port.submit(&command);
//! }
//! assert!(wheel.state().output_rpm > 50.0);
//! # Ok::<(), rc10_sim::IdOutOfRange>(())
//! ```
//!
//! Not simulated: start-up time of an ESC, protections of DJI's (the others' trip when told to,
//! [`Esc::inject`], or as their modules say), clock drift, measurement noise; error counters and bus-off of an ESC, which repeats a frame until it is
//! heard or a newer one takes its place; suspended transmission and passive error frames.
#![forbid(unsafe_code)]

mod arm;
mod base;
mod contact;
mod controller;
mod crc;
pub mod cybergear;
pub mod damiao;
mod device;
mod dji;
pub mod fault;
mod faults;
mod handles;
mod host;
pub mod imu;
mod line;
pub mod lk;
mod motor;
mod occupancy;
pub mod odrive;
mod pins;
mod plant;
mod pulses;
mod random;
pub mod referee;
pub mod remote;
mod segment;
mod serial;
mod tasks;
mod time;
mod uart;
pub mod unitree_line;
pub mod unitree_module;
pub mod vesc;
mod wire;
mod world;

pub use arm::ArmLink;
pub use base::{Chassis, Mounting, Pose, Steering, Tread, Twist, Wheel, WheelError, WheelMotors};
pub use contact::{Closed, Contact, NoRange};
pub use controller::{Activity, Controller, Nanos, Outcome, tolerance_ppm};
pub use device::{Beyond, Device, Encoder, EscFault, EscState, NoDevice, Outbox, Taken, Winding};
pub use dji::{EscConfig, FeedbackRate, IdOutOfRange, Model};
pub use fault::Fault;
pub use faults::{Faults, Parts};
pub use handles::{Base, Bus, Esc, SimPort};
pub use line::{Heard, Line, LineConfig, LineCounters, LineEntry};
pub use motor::Shaft;
pub use pins::{Servo, Voltage};
pub use plant::{Nonlinear, Plant, Scale};
pub use pulses::{PulseDevice, PulseEnd, PulsePort, Pulses};
pub use random::Random;
pub use serial::{Serial, SerialConfig, SerialCounters, SerialDevice};
pub use tasks::{Running, TaskName, Tasks};
pub use time::now;
pub use uart::{SerialEnd, UartFault, UartPort};
pub use wire::{BusConfig, BusCounters, TraceEntry};
pub use world::World;
