//! `ODrive` controllers that speak `CANSimple`.
//!
//! *Terms.* A *node* is an axis on the bus, 0 ..= 63. A *turn* is one of the shaft the encoder sits
//! on. *Iq* is the torque current. An axis is in one *state* at a time ([`AxisState`]); it follows
//! inputs only in closed-loop control.
//!
//! *Identifiers.* Standard, `node << 5 | message`. Little endian, f32 as in IEEE 754.
//!
//! *From the axis:* `01` heartbeat (error word, state), `09` estimates (turns, turns/s), `14` Iq
//! (wanted, measured), `17` supply (V, A). How often is set on the device, heartbeat and estimates
//! on all of them; the others are sent by old firmware (0.5) only on request, a remote frame.
//!
//! *To the axis,* not answered: `07` state, `0B` modes, `0C` position, `0D` velocity, `0E` torque,
//! `0F` limits, `18` clear errors.
//!
//! *Rules.*
//! * Commands have eight bytes whatever they carry, as in the vendor's DBC; only clearing errors
//!   has none.
//! * The feed-forwards of a position have 16 bits, 0.001 turns/s and 0.001 N m a step; everything
//!   else is f32.
//! * The bits of the error word, and bytes 5 ..= 7 of the heartbeat, differ between firmware 0.5
//!   and 0.6: [`Firmware`].
//!
//! Sources: `ODrive` firmware 0.5.6 (`can_simple.cpp`, `odrive-interface.yaml`), `odrive-can` with
//! the DBC of 0.5.6 and 0.6.10.

pub mod wire;

pub use crate::not_a_number::NotANumber;
pub use wire::{
    AxisState, Command, ControlMode, Currents, Estimates, Firmware, Heartbeat, InputMode, Message,
    MessageError, Node, Query, Supply,
};
