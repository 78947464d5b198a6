//! The boards, and a robot's program on one of them.
//!
//! | feature | board | chip | crystal |
//! |---|---|---|---|
//! | `h723zg` | the team's: `docs/wiring.md` | STM32H723ZG | 25 MHz |
//! | `dm-mc02` | Damiao DM-MC02: `docs/dm-mc02.md` | STM32H723VG | 24 MHz |
//!
//! * [`program!`]: the whole program of a robot.
//! * [`board`](mod@board): pins, crystal, soldered parts. [`robot`](mod@robot): every robot's work
//!   on them, for programs that need more than [`program!`].
//!
//! The memory map comes with this crate; the rest is in a program's `.cargo/config.toml`.
#![no_std]

#[cfg(feature = "dm-mc02")]
pub mod dm_mc02;
#[cfg(feature = "h723zg")]
pub mod h723zg;
mod note;
mod parts;
mod program;
pub mod robot;

use embassy_stm32::Peri;
use embassy_stm32::peripherals::{PA11, PA12, USB_OTG_HS};

/// The board of this program.
#[cfg(feature = "dm-mc02")]
pub use dm_mc02 as board;
#[cfg(feature = "h723zg")]
pub use h723zg as board;

/// USB OTG HS with its own full-speed transceiver.
pub struct UsbParts {
    /// The controller.
    pub peripheral: Peri<'static, USB_OTG_HS>,
    /// D+.
    pub plus: Peri<'static, PA12>,
    /// D-.
    pub minus: Peri<'static, PA11>,
}

/// An output of supply that the program switches, of a board that has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// DM-MC02: the supply, 12 to 24 V, at the XT30 with CAN1: 5 A.
    First,
    /// DM-MC02: the same at the XT30 with CAN2: 5 A.
    Second,
    /// DM-MC02: 5 V for servos, UART7, USART10 and the socket of CAN3: 2 A, of the supply only.
    FiveVolts,
}

impl Output {
    /// All of them.
    pub const ALL: &'static [Self] = &[Self::First, Self::Second, Self::FiveVolts];
}

#[doc(hidden)]
pub use {
    cortex_m_rt, embassy_executor, embassy_stm32, embassy_time, rc10_bsp, rc10_message, rc10_motor,
    rc10_tasks, static_cell,
};

use defmt_rtt as _;
