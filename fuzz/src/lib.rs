//! The fuzz targets: one program each, of one line, and all they do in `targets.rs`, which the
//! check replays the kept corpus with.

pub mod targets;

/// A program that throws bytes at a target.
#[macro_export]
macro_rules! program {
    ($target:ident) => {
        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| rc10_fuzz::targets::$target(bytes));
    };
}
