//! What a motor moves, estimated from samples of it, with the error of each number; and gains for that.

pub mod command;
pub mod estimate;
pub mod gains;
#[cfg(test)]
mod tests;
