//! A robot as the tools see it: what it is, and who drives it.

pub mod base;
pub mod description;
pub mod mistake;
pub mod motor;
pub mod operator;
pub mod remote;
pub mod script;
pub mod signal;
pub mod twin;
