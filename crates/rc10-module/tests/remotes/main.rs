//! Remotes: parsers beside those of other people, and the driver loops in virtual time.

mod clock;
mod listen;
mod oracles;
mod ports;
