//! The remote control of a robot: receiver, operator's script and losses of the radio link.

use anyhow::{Context, Result, bail, ensure};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use rc10_emu::fault::{Fault, Kind};
use rc10_sim::remote::{Controls, Crsf, Dr16, Mixer, Ppm, Remote, Sbus, Switch, Vt03};
use rc10_sim::{Nanos, PulsePort, Pulses, Serial, UartPort, World};
use rc10_tasks::Program;
use rc10_tasks::arming::{ArmingConfig, SwitchAt, SwitchName};
use rc10_time::Micros;

pub use rc10_module::remote::{ChannelOrder, Receiver};

/// The remote control of a robot, with its operator's script.
#[derive(Clone, Debug)]
pub struct RemoteControl {
    /// Receiver that is plugged in.
    pub receiver: Receiver,
    /// Which channel of its transmitter is what.
    pub channels: ChannelOrder,
    /// Which switches arm, disarm and stop the robot.
    pub arming: ArmingConfig,
    /// Receivers that the robot supports.
    pub receivers: Vec<Receiver>,
    /// The chip's UART for receivers that send bytes.
    pub uart: u8,
    /// Script of the operator, in the order of time. Before its first line all sticks are at rest.
    pub script: Vec<ScriptLine>,
    /// Period after which the script repeats, if it does.
    pub repeats_after: Option<Micros>,
    /// Times without the transmitter, in order.
    pub lost: Vec<Lost>,
}

/// A line of the operator's script: controls from a time on.
#[derive(Clone, Copy, Debug)]
pub struct ScriptLine {
    /// Time since power-on.
    pub at: Micros,
    /// Label for reports.
    pub label: &'static str,
    /// Positions of all controls.
    pub controls: Controls,
}

impl ScriptLine {
    /// Controls from this many milliseconds on.
    pub const fn new(millis: u64, label: &'static str, controls: Controls) -> Self {
        Self { at: Micros::from_millis(millis), label, controls }
    }
}

/// A time in which a transmitter is off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lost {
    /// Begin.
    pub from: Micros,
    /// End; `None`: it stays off.
    pub until: Option<Micros>,
}

/// The help text of a receiver.
const fn help(receiver: Receiver) -> &'static str {
    match receiver {
        Receiver::Dr16 => "DJI's: 18 bytes every 14 ms",
        Receiver::Sbus => "Futaba, FrSky: 25 bytes every 14 ms, with a failsafe flag",
        Receiver::Crsf => "ExpressLRS, TBS: 150 frames a second, and link statistics",
        Receiver::Ppm => "Pulses of eight channels, every 22 ms",
        Receiver::Vt03 => "DJI's video link: 21 bytes every 14 ms",
    }
}

/// Parser of a receiver's name, in any case.
pub(crate) fn parser() -> impl TypedValueParser<Value = Receiver> {
    let named = |receiver: Receiver| PossibleValue::new(receiver.name()).help(help(receiver));
    PossibleValuesParser::new(Receiver::ALL.map(named)).try_map(|name| {
        let is_named = |receiver: &Receiver| receiver.name().eq_ignore_ascii_case(&name);
        Receiver::ALL.into_iter().find(is_named).context("no receiver")
    })
}

/// The wire of a receiver.
#[derive(Clone)]
pub enum ReceiverWire {
    /// A serial link.
    Serial(Serial),
    /// A line with pulses.
    Pulses(Pulses),
}

impl ReceiverWire {
    /// Puts a receiver's twin at the end of a wire; its first frame comes at a random time.
    pub fn new(receiver: Receiver, world: &mut World, remote: &Remote) -> Self {
        let phase = world.chance(Nanos::new(14_000_000));
        Self::Serial(match receiver {
            Receiver::Dr16 => world.add_serial(Dr16::SERIAL, Dr16::new(remote, phase)),
            Receiver::Sbus => world.add_serial(Sbus::SERIAL, Sbus::new(remote, phase)),
            Receiver::Crsf => world.add_serial(Crsf::SERIAL, Crsf::new(remote, phase)),
            Receiver::Vt03 => world.add_serial(Vt03::SERIAL, Vt03::new(remote, phase)),
            Receiver::Ppm => return Self::Pulses(world.add_pulses(Ppm::new(remote, phase))),
        })
    }

    /// The robot's end of the wire.
    pub fn port(&self) -> ReceiverPort {
        match self {
            Self::Serial(serial) => ReceiverPort::Serial(serial.port()),
            Self::Pulses(pulses) => ReceiverPort::Pulses(pulses.port()),
        }
    }
}

/// The transmitter's set-up that an order of channels needs.
pub fn mixer(order: &ChannelOrder) -> Mixer {
    let [third, fourth] = order.more_switches;
    let sticks = [order.right_x, order.right_y, order.left_x, order.left_y];
    let [right_x, right_y, left_x, left_y] = sticks.map(Some);
    let switches = [order.right_switch, order.left_switch].map(Some);
    [right_x, right_y, left_x, left_y, switches[0], switches[1], third, fourth, order.dial]
        .map(|channel| channel.map_or((0, false), |channel| (channel.number, channel.is_reversed)))
}

/// The robot's end of a receiver's wire.
pub enum ReceiverPort {
    /// A UART.
    Serial(UartPort),
    /// A pulse input.
    Pulses(PulsePort),
}

impl RemoteControl {
    /// Creates a remote for any receiver, at UART5 or the board's input for pulses, whose script may repeat after a period.
    pub fn new(receiver: Receiver, script: &[ScriptLine], repeats_after: Option<Micros>) -> Self {
        Self {
            receiver,
            channels: receiver.channels(),
            arming: ArmingConfig::DEFAULT,
            receivers: Receiver::ALL.into(),
            uart: 5,
            script: script.into(),
            repeats_after,
            lost: Vec::new(),
        }
    }

    /// Creates the remote of a program, as [`new`](Self::new).
    pub fn of<P: Program>(script: &[ScriptLine], repeats_after: Option<Micros>) -> Self {
        let of_receiver = Self::new(P::RECEIVER, script, repeats_after);
        Self { channels: P::CHANNELS, arming: P::ARMING, ..of_receiver }
    }

    /// The remote with its sticks at rest and its switches where they disarm.
    pub fn safe(&self) -> Controls {
        let SwitchAt { switch, position } = self.arming.disarm;
        let position = match position {
            rc10_module::remote::Switch::Up => Switch::Up,
            rc10_module::remote::Switch::Middle => Switch::Middle,
            rc10_module::remote::Switch::Down => Switch::Down,
        };
        let mut controls = Controls::REST;
        *match switch {
            SwitchName::Left => &mut controls.left_switch,
            SwitchName::Right => &mut controls.right_switch,
            SwitchName::Third => &mut controls.more_switches[0],
            SwitchName::Fourth => &mut controls.more_switches[1],
        } = position;
        controls
    }

    /// Sets the losses from a run's faults; fails if one begins before another has ended.
    pub fn lose(&mut self, faults: &[Fault]) -> Result<()> {
        let remote = faults.iter().filter(|fault| fault.kind == Kind::RemoteLost);
        let lost = |fault: &Fault| Lost {
            from: fault.from.micros(),
            until: fault.until.map(Nanos::micros),
        };
        self.lost = remote.map(lost).collect();
        self.lost.sort_by_key(|lost| lost.from);
        for pair in self.lost.windows(2) {
            let [first, second] = [&pair[0], &pair[1]].map(|lost| lost.from.get() as f64 * 1e-6);
            if pair[0].until.is_none_or(|until| until >= pair[1].from) {
                bail!("remote-lost@{second}s: the remote is lost already, since {first} s");
            }
        }
        Ok(())
    }

    /// Plugs in another receiver; fails if the robot cannot listen to it.
    pub fn plug(&mut self, receiver: Receiver) -> Result<()> {
        let names = || self.receivers.iter().map(|one| one.name()).collect::<Vec<_>>().join(", ");
        ensure!(self.receivers.contains(&receiver), "no {receiver}: this robot takes {}", names());
        if self.receiver != receiver {
            (self.receiver, self.channels) = (receiver, receiver.channels());
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests;
