//! Foxglove in a build without it: asking for it is refused.

use anyhow::{Result, bail};

use super::client::Sample;
use super::plan::Topic;

/// None can be made.
pub enum Foxglove {}

impl Foxglove {
    /// Refuses.
    ///
    /// # Errors
    /// Always.
    pub fn new(_: u16) -> Result<Self> {
        bail!(
            "--foxglove: this program was built without it, for it takes 120 crates more: cargo run \
             --release --features viewers -- live --foxglove"
        )
    }

    /// There is none.
    pub fn address(&self) -> String {
        match *self {}
    }

    /// There is none.
    pub fn meet(&mut self, _: &[Topic]) -> Result<()> {
        match *self {}
    }

    /// There is none.
    pub fn take(&mut self, _: &Sample) {
        match *self {}
    }
}
