//! The protocols, as their descriptions have them.

#[path = "wires/action.rs"]
mod action;
#[path = "wires/crsf.rs"]
mod crsf;
#[path = "wires/dbus.rs"]
mod dbus;
#[path = "wires/jrt.rs"]
mod jrt;
#[path = "wires/rc9.rs"]
mod rc9;
#[path = "wires/referee.rs"]
mod referee;
#[path = "wires/rm_vision.rs"]
mod rm_vision;
#[path = "wires/sbus.rs"]
mod sbus;
#[path = "wires/stp23l.rs"]
mod stp23l;
#[path = "wires/tfmini.rs"]
mod tfmini;
#[path = "wires/vt03.rs"]
mod vt03;
#[path = "wires/wit.rs"]
mod wit;

pub use action::Action;
pub use crsf::Crsf;
pub use dbus::Dbus;
pub use jrt::Jrt;
pub use rc9::Rc9;
pub use referee::Referee;
pub use rm_vision::RmVision;
pub use sbus::Sbus;
pub use stp23l::Stp23l;
pub use tfmini::TfMini;
pub use vt03::Vt03;
pub use wit::Wit;
