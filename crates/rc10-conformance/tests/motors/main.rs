//! Each vendor's motor against its simulated device: two codecs that agree, closed loops, unplug,
//! restart, faults; the signal tables against the codecs.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![allow(clippy::float_cmp, reason = "exact is meant")]

mod cybergear;
mod damiao;
mod damiao_values;
mod dji;
//OFF mod index;
//OFF mod lk;
//OFF mod odrive;
mod unitree_line;
mod unitree_module;
//OFF mod vesc;
//OFF mod vesc_values;
