//! Each vendor's motor against its simulated device: two codecs that agree, closed loops, unplug,
//! restart, faults; the signal tables against the codecs.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![allow(clippy::float_cmp, reason = "exact is meant")]

mod cybergear;
mod damiao;
mod damiao_values;
mod dji;
mod index;
mod lk;
mod odrive;
mod unitree_line;
mod unitree_module;
mod vesc;
mod vesc_values;
