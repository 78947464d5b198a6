//! Remotes: parsers beside those of other people, and the driver loops in virtual time.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod clock;
mod listen;
mod oracles;
mod ports;
