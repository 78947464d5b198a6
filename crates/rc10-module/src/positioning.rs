//! Positioning systems, which tell where a robot is, and frames between boards.

pub mod action;
pub mod rc9;

pub use action::Action;
pub use rc9::Rc9;
