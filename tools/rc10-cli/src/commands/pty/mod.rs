//! `rc10 pty`: a simulated bus on a pseudo-terminal, as an [slcan](crate::formats::slcan) adapter.
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

mod args;
#[cfg(unix)]
pub(crate) mod console;
#[cfg(unix)]
pub(crate) mod scene;
#[cfg(unix)]
pub(crate) mod terminal;
#[cfg(unix)]
pub(crate) mod unix;

use crate::live::SourceArgs;
use std::io::Write;

use anyhow::Result;

use crate::world::robot::Robot;

pub use crate::commands::pty::args::{PtyArgs, STEP};
#[cfg(unix)]
pub use crate::commands::pty::unix::serve;

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
        let place = SourceArgs {
            sim: args.emu.is_none(),
            emu: args.emu.clone(),
            baud: args.baud,
            seed: args.seed,
            ..SourceArgs::default()
        };
        let baud = place.baud_of(&robot);
        let mut way = place.open(robot, true)?;
        return console::serve(args, (&mut way, baud), out, &stop);
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
