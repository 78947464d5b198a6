//! What a motor moves, estimated from samples of it, with the error of each number.

pub mod estimate;
#[cfg(test)]
mod tests;
