//! The tests of this crate, in one program.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod bases;
mod cascade;
mod mechanisms;
mod odometry;
mod oracle_bases;
mod oracle_paths;
mod oracle_pid;
mod oracle_profiles;
mod paths;
mod power;
mod profiles;
mod random;
mod swerve;
mod walk;
mod walks;
