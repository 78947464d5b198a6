//! `rc10 pty`: a simulated bus on a pseudo-terminal, as an [slcan](crate::slcan) adapter.
//!
//! python-can, `SavvyCAN` or a vendor's tool joins the bus as one more node, beside the running robot
//! or (`--alone`) with nothing but the simulated devices. There are two sorts of time.
//!
//! **Real time**: the world's time follows the clock on the wall. What the client does not read is
//! lost and counted. Should the machine be too slow for the world, its time falls behind, and how
//! far is printed at the end.
//!
//! **Lockstep**: the world's time is the client's traffic. Time stands still until a frame of the
//! client is taken, or an empty line while its channel is open; then it goes on by [`STEP`], and
//! everything that was on the wire meanwhile is written before the next line is looked at. Nothing
//! is lost: a client that does not read is not read any more. What the client gets depends on its
//! bytes and the seed, on nothing else: not on how long it waits, nor on how its bytes come in
//! pieces. A client that is quiet is a world that stands still.

#[cfg(unix)]
mod console;
#[cfg(unix)]
mod scene;
#[cfg(unix)]
mod terminal;
#[cfg(unix)]
mod unix;

use std::io::Write;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use rc10_can::Micros;

use crate::robot::Robot;
use crate::run::{seconds, seed};

#[cfg(unix)]
pub use unix::serve;

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

/// Runs until its time is over, or until Ctrl-C.
///
/// # Errors
/// As `serve`.
#[cfg(unix)]
pub fn pty(args: &PtyArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let stop = std::sync::Arc::default();
    for signal in [SIGHUP, SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, std::sync::Arc::clone(&stop))?;
    }
    if args.console {
        return console::serve(args, robot, out, &stop);
    }
    serve(args, robot, out, &stop)
}

/// Only Unix has pseudo-terminals.
///
/// # Errors
/// Always.
#[cfg(not(unix))]
pub fn pty(_: &PtyArgs, _: Robot<'_>, _: &mut dyn Write) -> Result<()> {
    anyhow::bail!("rc10 pty needs a pseudo-terminal, and this system has none: use Linux or macOS")
}
