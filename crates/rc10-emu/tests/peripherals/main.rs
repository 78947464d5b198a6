//! The emulated peripherals, by their registers. Offsets and bits are written out: they are the
//! reference manual's, and must not come from the model.

mod chip;
mod clocks;
mod interrupts;
mod pins;
mod refusals;
mod serial;
mod timers;
mod watchdog;
