//! `rc10 dbc`: the layout of a robot's frames, as one DBC file for each bus.
//!
//! The files are made of the [`Message`] tables beside the codecs of `rc10-motor`. Each motor is a
//! node; `Robot` is our own.
//!
//! * An identifier of one motor is a message of its own, with the motor's label before its name.
//! * An identifier of several motors (DJI's command frames, feedback of devices that share one) is
//!   one message, in which each signal has its motor's label. Signals that all share appear once.
//! * A DBC file cannot give bits two meanings at once: the second meaning is left out and listed,
//!   here and in the file's comment, with what the vendors' tables leave out.
//!
//! Names longer than the 32 characters of the format are cut; the whole name is an attribute
//! (`SystemMessageLongSymbol`), which tools show instead. Text is Windows-1252.

pub(crate) mod model;
pub(crate) mod names;
pub(crate) mod print;

use std::io::Write;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use rc10_motor::signals::Message;

use crate::files::{make_folder, write_file};
use crate::robot::description::Description;
use crate::robot::motor::{Motor, Place};

pub use crate::formats::dbc::model::{Dbc, Frame, NamedSignal};
pub use crate::formats::dbc::names::Name;

/// Arguments of `rc10 dbc`.
#[derive(Args, Debug)]
pub struct DbcArgs {
    /// Folder for bus1.dbc, bus2.dbc ...
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// A device on a bus, as its DBC file names and describes it.
#[derive(Clone, Debug)]
pub struct Node {
    /// Label of the motor.
    pub label: String,
    /// Model and identifier of the motor.
    pub comment: String,
    /// The messages in the device's frames.
    pub messages: Vec<Message>,
    /// Facts about the device's messages that a DBC file cannot express: a sentence each.
    pub not_in_dbc: &'static [&'static str],
}

impl From<&Motor> for Node {
    fn from(motor: &Motor) -> Self {
        let (label, comment) = (motor.label.to_owned(), motor.name().to_string());
        let (messages, not_in_dbc) = motor.frames();
        Self { label, comment, messages, not_in_dbc }
    }
}

/// The DBC file of a bus.
pub fn of_bus(description: &Description, bus: u8) -> Dbc {
    let nodes: Vec<_> = description.on_bus(bus).map(Node::from).collect();
    Dbc::new(&format!("bus {bus}"), &nodes)
}

/// Writes a DBC file for each bus of a robot, and prints what is in it and what is left out; fails
/// if it cannot.
pub fn dbc(args: &DbcArgs, description: &Description, out: &mut dyn Write) -> Result<()> {
    make_folder(&args.out)?;
    for bus in 1..=description.buses {
        let dbc = of_bus(description, bus);
        let name = format!("bus{bus}.dbc");
        write_file(&args.out, &name, &dbc.to_bytes())?;
        let signals: usize = dbc.frames.iter().map(|frame| frame.signals.len()).sum();
        let (messages, devices) = (dbc.frames.len(), dbc.nodes.len() - 1);
        let path = args.out.join(name);
        let path = path.display();
        writeln!(out, "{path}  {messages} messages, {signals} signals of {devices} devices")?;
        for line in &dbc.left_out {
            writeln!(out, "  not in it: {line}")?;
        }
    }
    for motor in description.motors.iter().filter(|motor| matches!(motor.on, Place::Line(_))) {
        writeln!(out, "not in any: {}, {} on {}: no CAN", motor.label, motor.name(), motor.on)?;
    }
    Ok(())
}
