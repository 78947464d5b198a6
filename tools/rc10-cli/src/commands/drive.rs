//! `rc10 drive`: the robot's tasks on this PC, on real buses and lines, with the page of `rc10 live`.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use rc10_time::Micros;

use crate::args::{pace, seconds};
use crate::live::page::{LiveArgs, live};
use crate::live::{PlaceArgs, SourceArgs, ViewerArgs};
use crate::robot::remote::Receiver;
use crate::world::environment::Real;
use crate::world::robot::Robot;

/// Arguments of `rc10 drive`.
#[derive(Args, Debug)]
pub struct DriveArgs {
    /// A bus of the robot, and the adapter at it: 1=/dev/ttyACM0, 1=COM3, 1=tcp:HOST:PORT, on Linux 1=can0; again for each bus
    #[arg(long = "bus", value_name = "N=ADAPTER", required_unless_present = "lines", value_parser = adapter)]
    pub buses: Vec<(u8, String)>,
    /// An RS-485 line of the robot, and the serial port of the adapter at it: 1=/dev/ttyUSB0, 1=COM4; again for each line
    #[arg(long = "line", value_name = "N=PORT", value_parser = adapter)]
    pub lines: Vec<(u8, String)>,
    /// The robot's own receiver at a serial port, in place of the page's remote: /dev/ttyUSB1; sbus=/dev/ttyUSB1: another
    /// receiver than the robot names
    #[arg(long, value_name = "[RECEIVER=]PORT", value_parser = receiver)]
    pub remote: Option<(Option<Receiver>, String)>,
    /// The page's port on this PC; 0 is any that is free
    #[arg(long, value_name = "N", default_value_t = 8010)]
    pub page: u16,
    /// Open the page in the browser
    #[arg(long)]
    pub open: bool,
    /// Folder for records
    #[arg(long, value_name = "DIR", default_value = "target/rc10-live")]
    pub out: PathBuf,
    /// File in which the robot keeps its saved parameters; without it they are kept for this run
    #[arg(long, value_name = "FILE")]
    pub kept: Option<PathBuf>,
    /// How fast its time passes, for motors that are simulated by another program
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = pace, hide = true)]
    pub pace: f64,
    /// Ends after this many seconds [default: runs until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<Micros>,
}

fn adapter(text: &str) -> Result<(u8, String)> {
    let both = text.split_once('=').and_then(|(bus, at)| Some((bus.parse().ok()?, at)));
    let (bus, at) = both
        .filter(|(_, at)| !at.is_empty())
        .context("it is to be N=PORT, such as 1=/dev/ttyACM0")?;
    Ok((bus, at.to_owned()))
}

fn receiver(text: &str) -> Result<(Option<Receiver>, String)> {
    let Some((name, at)) = text.split_once('=') else { return Ok((None, text.into())) };
    let named = Receiver::ALL.into_iter().find(|it| it.name().eq_ignore_ascii_case(name));
    Ok((Some(named.context("there is no such receiver: dr16, sbus, crsf or vt03")?), at.into()))
}

/// Drives the robot until Ctrl-C, and leaves its motors without torque. Fails as [`live`] does, for a robot without a
/// remote, and if an adapter cannot be opened.
pub fn drive(args: &DriveArgs, mut robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let of = |all: &[(u8, String)], what: fn(u8) -> Real| -> Vec<_> {
        all.iter().map(|(number, at)| (what(*number), at.clone())).collect()
    };
    let mut real = [of(&args.buses, Real::Bus), of(&args.lines, Real::Line)].concat();
    if let Some((other, at)) = &args.remote {
        other.map_or(Ok(()), |it| robot.set_remote(it))?;
        real.push((Real::Receiver, at.clone()));
    }
    let at = PlaceArgs { place: None, named: SourceArgs { real, ..SourceArgs::default() } };
    let &DriveArgs { page, open, pace, seconds, .. } = args;
    let (out_to, kept, viewers) = (args.out.clone(), args.kept.clone(), ViewerArgs::default());
    let args = LiveArgs {
        at,
        page,
        lan: None,
        open,
        script: false,
        pace,
        out: out_to,
        viewers,
        kept,
        seconds,
    };
    live(&args, robot, out)
}
