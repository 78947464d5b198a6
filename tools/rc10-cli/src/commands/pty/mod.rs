//! `rc10 pty`: a simulated bus on a pseudo-terminal, as an [slcan](crate::formats::slcan) adapter.
//!
//! python-can, `SavvyCAN` or a vendor's tool joins the bus as one more node, beside the running
//! robot or (`--alone`) with nothing but the simulated devices. There are two modes of time.
//!
//! **Real time**: virtual time follows the clock. What the client does not read is lost and
//! counted. If the machine is too slow, virtual time falls behind; the end of the run says how far.
//!
//! **Lockstep**: virtual time stands still until the client sends a frame, or an empty line while
//! its channel is open. Then it advances by [`STEP`], and all frames of that step are written
//! before the next line is read. Nothing is lost; client's bytes and seed alone decide the result.

mod args;
#[cfg(unix)]
pub(crate) mod console;
#[cfg(unix)]
pub(crate) mod terminal;
#[cfg(unix)]
pub(crate) mod unix;

use std::io::Write;

use anyhow::Result;

#[cfg(unix)]
use crate::live::{RunningArgs, SourceArgs};
use crate::world::robot::Robot;

pub use crate::commands::pty::args::{PtyArgs, STEP};
#[cfg(unix)]
pub use crate::commands::pty::unix::serve;

/// Runs until its time is over or Ctrl-C; fails as `serve` does.
#[cfg(unix)]
pub fn pty(args: &PtyArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let stop = crate::live::session::stop()?;
    if args.console {
        let place = SourceArgs {
            sim: args.emu.is_none(),
            emu: args.emu.clone(),
            running: RunningArgs { port: None, baud: args.baud },
            seed: args.seed,
            ..SourceArgs::default()
        };
        let baud = place.running.baud_of(&robot);
        let mut way = place.open(robot, Some(1.0))?;
        return console::serve(args, (&mut way, baud), out, &stop);
    }
    serve(args, robot, out, &stop)
}

/// Fails always: only Unix has pseudo-terminals.
#[cfg(not(unix))]
pub fn pty(_: &PtyArgs, _: Robot<'_>, _: &mut dyn Write) -> Result<()> {
    anyhow::bail!("rc10 pty needs a pseudo-terminal, and this system has none: use Linux or macOS")
}
