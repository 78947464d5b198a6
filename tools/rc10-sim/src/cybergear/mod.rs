//! Xiaomi CyberGear and RobStride motors from the device's side: one protocol, eight models.
//!
//! * [`wire`]: the frames, as the device reads and writes them.
//! * [`Parameters`]: what types 17 and 18 reach.
//! * [`CyberGear`]: the device: modes, loops, faults, time-out.
//! * [`Model`]: ranges, defaults and the motor of each.
//!
//! Sources: CyberGear manual; RobStride manuals RS00, RS04, RS05 (types 17, 18, 21, 22, 24, parameter
//! table). Where neither says what happens, the comment says *assumed*.

mod device;
mod models;
mod parameters;
pub mod wire;

pub use device::{CyberGear, Mode};
pub use models::{ALL, CYBERGEAR, Model, RS00, RS01, RS02, RS03, RS04, RS05, RS06};
pub use parameters::Parameters;
