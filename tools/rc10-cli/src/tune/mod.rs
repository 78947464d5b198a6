//! What a motor moves, estimated from samples of it, with the error of each number; and gains for that.

pub mod command;
pub mod estimate;
mod experiment;
pub mod gains;
mod page;
pub mod response;
#[cfg(test)]
mod tests;
