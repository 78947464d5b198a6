//! Unitree GO-M8010-6, with controller and gearbox, on RS-485 or behind a CAN-to-485 module.
//!
//! **Terms.** The *rotor* turns 6.33 times while the *output shaft* turns once. The wire speaks of
//! the rotor, this crate of the output shaft; [`wire::RotorScale`] is the only place where one
//! becomes the other. The controller runs one law: torque = τ + `k_pos` (θ − θ measured) + `k_spd` (ω − ω
//! measured), with all five numbers from the command. `k_pos` is a *stiffness*, `k_spd` a *damping*:
//! together an [`Impedance`](wire::Impedance). θ counts on over many turns.
//!
//! [`GoM8010`] is such a motor on RS-485, and [`Rs485Bus`] what a bus is to motors on CAN.
//!
//! **Identifiers.** 15 motors on a line, 0 ..= 14 (15: all); four modules on a bus, 0 ..= 3.
//!
//! **RS-485** ([`wire::line`]): 4 Mbit/s, 8N1: 17 bytes out, 16 back, with CRC-16/KERMIT.
//!
//! **CAN** ([`wire::module`]): extended, eight bytes, 1 Mbit/s (500 kbit/s with switch 4 on),
//! little endian. The identifier holds module, direction, motor and, in replies, temperature and
//! faults. A module keeps stiffness and damping until it loses power: send them first. [`GoModule`]
//! is a motor behind one.
//!
//! **Rules.** [`Status::CALIBRATE`](wire::Status::CALIBRATE) makes the motor turn by itself for
//! about five seconds, in which nothing may be sent. Protection at 90 °C ends only with the
//! supply. What motor and module do when commands stop is not documented.
//!
//! Sources: GO-M8010-6 user manual v1.2, data manual, module manual V1.0, `unitree_actuator_sdk`.

mod bus;
mod config;
pub mod module;
mod motor;
mod rs485;
pub mod signals;
pub mod wire;

pub use bus::{Rs485Bus, Rs485Counters, Step};
pub use config::{CASCADE, LARGEST_TORQUE, LineConfig, ModuleConfig};
pub use module::GoModule;
pub use rs485::GoM8010;
