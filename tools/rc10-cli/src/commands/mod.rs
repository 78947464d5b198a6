//! The commands of `rc10` that run, read or write something once.

pub mod board_test;
pub mod decode;
pub mod doctor;
pub mod drive;
pub mod emulate;
pub mod faults;
pub mod new;
pub mod plan;
pub mod pty;
pub mod report;
pub mod run;
