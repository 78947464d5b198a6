//! A stand-in for Foxglove in a build without it.

use anyhow::{Result, bail};

use super::client::Sample;
use super::plan::Topic;

/// A type without a value.
pub enum Foxglove {}

impl Foxglove {
    /// Fails always.
    pub fn new(_: u16) -> Result<Self> {
        bail!(
            "--foxglove: this program was built without it, for it takes 120 crates more: cargo run \
             --features viewers -- live --foxglove"
        )
    }

    /// Never called.
    pub fn address(&self) -> String {
        match *self {}
    }

    /// Never called.
    pub fn meet(&mut self, _: &[Topic]) -> Result<()> {
        match *self {}
    }

    /// Never called.
    pub fn take(&mut self, _: &Sample) {
        match *self {}
    }
}
