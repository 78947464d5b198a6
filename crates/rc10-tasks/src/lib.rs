//! Tasks that every robot has, whatever its motors: they are tested here, and a team only says
//! which switch does what.
//!
//! * [`Common`]: what they share.
//! * [`arming`]: the switches of a remote control arm, disarm and stop; its failsafe in two steps.
//! * [`boards`]: a second board: topics between both, and one arm state.
//! * [`BaseDriver`]: drives a [`DrivenBase`] or a [`DrivenSwerve`] by sticks, by a twist, or along a path.
//! * [`heading`]: which way the robot looks, counted from where it was armed.
//! * [`mod@live`]: shows the robot to a PC, and lets it change gains.
//! * [`robot!`], [`Program`]: a robot, the same on a PC and on the chip.
//! * [`remote`]: what the remote's receiver says.
//! * [`mod@seen`]: what can be seen of motors, buses, lines and the robot.
//! * [`status`]: ten times a second, how the robot is; whether every bus ticks, for a watchdog.
//! * [`status_led`]: the state of the robot on an LED strip.
#![no_std]
#![forbid(unsafe_code)]

pub mod arming;
mod base;
pub mod boards;
mod common;
pub mod heading;
pub mod live;
pub mod program;
pub mod remote;
pub mod seen;
pub mod status;
pub mod status_led;
pub mod supply;

pub use arming::{Arming, ArmingConfig, ArmingError, Axis, SwitchAt, SwitchName};
pub use base::{BaseDriver, BasePower, Drive, DrivenBase, DrivenSwerve, Grant, Limit};
pub use common::{Changes, Common};
pub use program::{Declared, Program};
pub use status::{BusSummary, LineSummary, RobotStatus, TickWatch};
pub use supply::Supply;
#[doc(hidden)]
pub use {embassy_futures, embedded_hal, embedded_io_async, rc10_message, rc10_motor, rc10_time};
