//! The remote control of a robot, and its operator: a script of what he does, and when the
//! radio link breaks.

mod operator;
mod watch;

use anyhow::{Context, Result, bail, ensure};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use rc10_can::Micros;
use rc10_emu::fault::{Fault, Kind};
use rc10_sim::remote::{Controls, Crsf, Dr16, Ppm, Remote, Sbus, Vt03};
use rc10_sim::{Nanos, PulsePort, Pulses, Serial, UartPort, World};

pub use operator::Operator;
pub use rc10_module::remote::Receiver;
pub use watch::{Loss, RemoteSample, RemoteTrack, Sight, Watch};

/// The remote control of a robot, with its operator's script.
#[derive(Clone, Debug)]
pub struct RemoteControl {
    /// The receiver that is plugged in.
    pub receiver: Receiver,
    /// Receivers that the robot supports.
    pub receivers: Vec<Receiver>,
    /// The chip's UART for those that speak bytes.
    pub uart: u8,
    /// The chip's pin for those that send pulses.
    pub pulse_pin: (char, usize),
    /// Script of the operator, in the order of time. Before that all sticks are at rest.
    pub script: Vec<Line>,
    /// After how long, counted from power-on, the script begins again, if it does.
    pub repeats_after: Option<Micros>,
    /// Times without its transmitter, in the order of time.
    pub lost: Vec<Lost>,
}

/// A line of the operator's script: controls from a time on.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// From when on, since power-on.
    pub at: Micros,
    /// Label for reports.
    pub label: &'static str,
    /// Positions of all controls.
    pub controls: Controls,
}

/// A time in which a transmitter is off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lost {
    /// From when on.
    pub from: Micros,
    /// Until when; `None`: for ever.
    pub until: Option<Micros>,
}

/// The text of the command line on a receiver.
const fn help(receiver: Receiver) -> &'static str {
    match receiver {
        Receiver::Dr16 => "DJI's: 18 bytes every 14 ms",
        Receiver::Sbus => "Futaba, FrSky: 25 bytes every 14 ms, with a failsafe flag",
        Receiver::Crsf => "ExpressLRS, TBS: 150 frames a second, and link statistics",
        Receiver::Ppm => "Pulses of eight channels, every 22 ms",
        Receiver::Vt03 => "DJI's video link: 21 bytes every 14 ms",
    }
}

/// Reads the name of a receiver, in small letters or capitals.
pub(crate) fn parser() -> impl TypedValueParser<Value = Receiver> {
    let named = |receiver: Receiver| PossibleValue::new(receiver.name()).help(help(receiver));
    PossibleValuesParser::new(Receiver::ALL.map(named)).try_map(|name| {
        let is_named = |receiver: &Receiver| receiver.name().eq_ignore_ascii_case(&name);
        Receiver::ALL.into_iter().find(is_named).context("no receiver")
    })
}

/// The port that a receiver is plugged into.
#[derive(Clone)]
pub enum ReceiverWire {
    /// One that speaks bytes.
    Serial(Serial),
    /// One that sends pulses.
    Pulses(Pulses),
}

impl ReceiverWire {
    /// Puts a receiver's twin at the end of a wire; its first frame comes at a time of chance.
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

    /// The robot's end.
    #[must_use]
    pub fn port(&self) -> ReceiverPort {
        match self {
            Self::Serial(serial) => ReceiverPort::Serial(serial.port()),
            Self::Pulses(pulses) => ReceiverPort::Pulses(pulses.port()),
        }
    }
}

/// The robot's end of a receiver's wire.
pub enum ReceiverPort {
    /// Bytes.
    Serial(UartPort),
    /// Pulses.
    Pulses(PulsePort),
}

impl RemoteControl {
    /// Of a robot that listens to any receiver, at UART5 and PF8 of the board, and an operator whose
    /// script begins again after `repeats_after`, if it does.
    #[must_use]
    pub fn new(receiver: Receiver, script: &[Line], repeats_after: Option<Micros>) -> Self {
        Self {
            receiver,
            receivers: Receiver::ALL.into(),
            uart: 5,
            pulse_pin: ('F', 8),
            script: script.into(),
            repeats_after,
            lost: Vec::new(),
        }
    }

    /// The faults of a run that concern the remote: when its transmitter is off.
    ///
    /// # Errors
    /// If one begins before another has ended.
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

    /// Plugs another receiver in.
    ///
    /// # Errors
    /// If the robot cannot listen to it.
    pub fn plug(&mut self, receiver: Receiver) -> Result<()> {
        let names = || self.receivers.iter().map(|one| one.name()).collect::<Vec<_>>().join(", ");
        ensure!(self.receivers.contains(&receiver), "no {receiver}: this robot takes {}", names());
        self.receiver = receiver;
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use rc10_sim::remote::Switch;

    use super::*;

    pub(crate) fn control() -> RemoteControl {
        let line = |millis, right_switch| Line {
            at: Micros::from_millis(millis),
            label: "",
            controls: Controls { right_switch, ..Controls::REST },
        };
        RemoteControl {
            receiver: Receiver::Dr16,
            receivers: vec![Receiver::Dr16, Receiver::Ppm],
            uart: 5,
            pulse_pin: ('F', 8),
            script: vec![line(0, Switch::Down), line(100, Switch::Up)],
            repeats_after: Some(Micros::from_millis(1000)),
            lost: Vec::new(),
        }
    }

    pub(crate) fn faults(texts: &[&str]) -> Vec<Fault> {
        texts.iter().map(|text| text.parse().unwrap()).collect()
    }

    #[test]
    fn what_cannot_be_is_refused_in_words() {
        let mut control = control();
        let lose = |control: &mut RemoteControl, texts: &[&str]| {
            control.lose(&faults(texts)).map_err(|error| error.to_string())
        };
        for twice in
            [["remote-lost@1s", "remote-lost@2s"], ["remote-lost@2s", "remote-lost@1s..2s"]]
        {
            let error = lose(&mut control, &twice).unwrap_err();
            assert_eq!(error, "remote-lost@2s: the remote is lost already, since 1 s");
        }
        assert_eq!(lose(&mut control, &["remote-lost@2.1s", "remote-lost@1s..2s"]), Ok(()));
        let error = control.plug(Receiver::Sbus).unwrap_err().to_string();
        assert_eq!(error, "no sbus: this robot takes dr16, ppm");
        control.plug(Receiver::Ppm).unwrap();
        assert_eq!(control.receiver, Receiver::Ppm);
    }
}
