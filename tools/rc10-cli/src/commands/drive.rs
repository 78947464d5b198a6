//! `rc10 drive`: the robot's tasks on this PC, on real buses, with the page of `rc10 live`.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use rc10_time::Micros;

use crate::args::{pace, seconds};
use crate::live::page::{LiveArgs, live};
use crate::live::{PlaceArgs, SourceArgs, ViewerArgs};
use crate::world::robot::Robot;

/// Arguments of `rc10 drive`.
#[derive(Args, Debug)]
pub struct DriveArgs {
    /// A bus of the robot, and the adapter at it: 1=/dev/ttyACM0, 1=COM3, 1=tcp:HOST:PORT, on Linux 1=can0; again for each bus
    #[arg(long = "bus", value_name = "N=ADAPTER", required = true, value_parser = adapter)]
    pub buses: Vec<(u8, String)>,
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
    let (bus, at) = both.filter(|(_, at)| !at.is_empty()).context("it is to be BUS=ADAPTER")?;
    Ok((bus, at.to_owned()))
}

/// Drives the robot until Ctrl-C, and leaves its motors without torque. Fails as [`live`] does, for a robot without a
/// remote, and if an adapter cannot be opened.
pub fn drive(args: &DriveArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let real = args.buses.clone();
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
