//! The robot's console on a pseudo-terminal.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;
use rc10_time::Micros;

use crate::commands::pty::PtyArgs;
use crate::commands::pty::terminal::Terminal;
use crate::live::line::RobotConnection;

/// Limit of unread bytes: further ones are lost, as at a port that is not read.
const ROOM: usize = 64 * 1024;

/// Runs the robot in real time until its time is over or `stop` is set. Prints `pty` and the path
/// of the pseudo-terminal first, and what was lost at the end. Fails without a pseudo-terminal.
pub(crate) fn serve(
    args: &PtyArgs,
    (connection, baud): (&mut RobotConnection<'_>, u32),
    out: &mut dyn Write,
    stop: &AtomicBool,
) -> Result<()> {
    let terminal = Terminal::new(args.link.as_deref())?;
    let path = terminal.path.display();
    let name = &connection.name;
    writeln!(
        out,
        "pty {path}\nthe console of {name}, for example:\n  rc10 live {path} --baud {baud}"
    )?;
    // A program that waits for the path shall not wait for the end.
    out.flush()?;
    let end = args.seconds.unwrap_or(Micros::new(u64::MAX));
    let (mut buffer, mut waiting, mut lost) = ([0; 4096], Vec::new(), 0);
    let mut now = Micros::ZERO;
    while now < end && !stop.load(Ordering::Relaxed) {
        let said = terminal.read(&mut buffer)?;
        let heard;
        (heard, now) = connection.source.exchange(said)?;
        waiting.extend(heard);
        terminal.write(&mut waiting)?;
        let too_many = waiting.len().saturating_sub(ROOM);
        waiting.drain(..too_many);
        lost += too_many;
    }
    if lost > 0 {
        writeln!(out, "{lost} bytes lost: they were not read")?;
    }
    Ok(())
}
