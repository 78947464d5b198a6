//! Arguments of `rc10 pty`.

use std::path::PathBuf;

use clap::Args;
use rc10_time::Micros;

use crate::args::{seconds, seed};

/// The virtual time for one frame of the client in lockstep: 1 ms.
pub const STEP: Micros = Micros::from_millis(1);

/// Arguments of `rc10 pty`.
#[derive(Args, Debug, Default)]
#[command(allow_negative_numbers = true)]
pub struct PtyArgs {
    /// Which bus of the robot; the first is 1
    #[arg(long, value_name = "N", required_unless_present = "console")]
    pub bus: Option<u8>,
    /// The robot's console instead of a bus: rc10 live at the pseudo-terminal is as at a real one
    #[arg(long, conflicts_with_all = ["bus", "alone", "lockstep"])]
    pub console: bool,
    /// With --console: that of the firmware on the emulated chip; without ELF it is built first
    #[arg(long, value_name = "ELF", num_args = 0..=1, requires = "console")]
    pub emu: Option<Option<PathBuf>>,
    /// With --console: its bits a second [default: what this robot's firmware has]
    #[arg(long, value_name = "N", requires = "console")]
    pub baud: Option<u32>,
    /// Ends after this many seconds of virtual time, up to 3600 [default: runs until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<Micros>,
    /// Time stands still but for 1 ms after each frame of the client (or empty line): for tests
    #[arg(long)]
    pub lockstep: bool,
    /// Without the robot's program: only the simulated devices are on the wire, and the client
    #[arg(long)]
    pub alone: bool,
    /// Also makes a symbolic link to the pseudo-terminal here, and removes it at the end
    #[arg(long, value_name = "PATH")]
    pub link: Option<PathBuf>,
    /// Seed of everything random in the world
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = seed)]
    pub seed: u64,
    /// Run even if the motors of a bus do not fit on it
    #[arg(long)]
    pub force: bool,
}
