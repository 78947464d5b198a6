//! Programs of others against ours: `cantools` reads our DBC files, `mcap-ros2-support` our records, and
//! the drivers `damiao-motor` and `python-cybergear` drive our simulated motors.
//!
//! They run in a [virtual environment](crate::common::python).

use std::process::Command;

use crate::common::scratch;
use serde_json::Value;

mod dbc;
#[cfg(unix)]
mod drivers;
mod others;
mod record;
mod referee;
mod vision;

pub(crate) use crate::common::python::{python, script};

/// Bytes that Python wrote in hex.
fn bytes_of(hex: &Value) -> Vec<u8> {
    let hex = hex.as_str().unwrap();
    let byte = |at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
    (0..hex.len()).step_by(2).map(byte).collect()
}

/// Runs a script of tests/python to its end; what it printed.
fn must_succeed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    String::from_utf8(output.stdout).unwrap()
}
