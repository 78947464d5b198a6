//! VESC speed controllers on CAN.
//!
//! **Terms.** *Electrical rpm* (eRPM) is the speed of the magnetic field: rotor rpm times *pole
//! pairs* (magnet poles / 2). The *tachometer* counts the six commutation steps of each electrical
//! turn. *Duty* is the share of the supply voltage that the motor sees. *Brake* current acts
//! against the movement, whichever way it goes; *handbrake* current is a still field that keeps a
//! standing shaft where it is.
//!
//! **Identifiers.** All frames are extended: `packet << 8 | id`, with the upper 13 bits zero. VESCs
//! are numbered 0 to 254; what is sent to 255 is for all of them. Commands carry the receiver's id,
//! status frames the sender's, a PONG the id of whoever asked. Factory bit rate: 500 kbit/s, to be
//! set to 1 Mbit/s on a bus with others. Status frames are off until switched on in VESC Tool.
//!
//! **Frames.** Signed, big endian, scaled integers. A command that drives is one `i32`:
//! [`Command`]. A limit that is kept in the VESC is two: [`Setting`]. Status comes as six packets
//! of eight bytes, at two rates: [`Status`]. None of them tells faults: over CAN, a faulted VESC is
//! only seen not to do what it is told.
//!
//! **Rules.**
//! * The length is part of a command. Firmware from 6.00 on takes a `SET_CURRENT` of six or more
//!   bytes for one with a delay, and reads the current from elsewhere: 10 A in eight bytes become
//!   655,360 A.
//! * `SET_RPM` 0 holds nothing. Below a minimum (900 eRPM unless set otherwise) the speed is not
//!   regulated: [`Shaft::regulates`]. Free is `SET_CURRENT` 0, slowing down is `SET_CURRENT_BRAKE`,
//!   standing is `SET_CURRENT_HANDBRAKE` or `SET_POS`; none is ever sent in place of another.
//! * `SET_POS` is an angle within one turn of the encoder the VESC is set up with.
//! * A VESC lets go when commands stop: after 1 s by the firmware's default, 0.5 s by its
//!   documentation. Repeat them at 50 Hz or more.
//! * `STATUS_6` is packet 58, from firmware 6.00 on. Packet 28, as which it is often listed, asks
//!   for an encoder's state.
//!
//! Sources: vedderb/bldc, `comm/comm_can.c`, `datatypes.h`, `motor/mcconf_default.h` (firmware 5.03
//! to 7.01) and `documentation/comm_can.md`.

mod packet;
mod shaft;
pub mod wire;

pub use packet::{Address, Packet, VescId};
pub use shaft::{DEFAULT_MINIMUM, ElectricalRpm, Shaft};
pub use wire::{Command, NotANumber, Reply, Setting, Status, UnpackError, coast, ping, shutdown};
