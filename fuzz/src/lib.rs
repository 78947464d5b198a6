//! The fuzz targets: one program each, of one line, and all they do in `targets.rs`, which the
//! check replays the kept corpus with. What is known of serial protocols is that of the tests of
//! their parsers.

#[path = "../../crates/rc10-module/tests/streams/observed.rs"]
pub mod observed;
// By path: all of rc10-cli would be a hundred crates more.
#[path = "../../tools/rc10-cli/src/live/request.rs"]
pub mod request;
pub mod streams;
pub mod targets;
pub mod tools;
#[path = "../../crates/rc10-module/tests/streams/wire.rs"]
pub mod wire;
#[path = "../../crates/rc10-module/tests/streams/wires.rs"]
pub mod wires;

/// A program that throws bytes at a target.
#[macro_export]
macro_rules! program {
    ($target:ident) => {
        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| rc10_fuzz::targets::$target(bytes));
    };
}
