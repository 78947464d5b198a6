//! A robot for the tools, and its operator.

pub mod base;
pub mod build;
pub mod description;
pub mod mistake;
pub mod motor;
pub mod operator;
pub mod remote;
pub mod script;
pub mod signal;
pub mod twin;
