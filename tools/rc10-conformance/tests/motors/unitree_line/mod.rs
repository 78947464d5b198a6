//! GO-M8010-6 on RS-485: our line against the simulated one.

mod bench;
mod closed_loop;
mod codecs;
mod embassy;
mod faults;
mod safety;
mod traffic;
