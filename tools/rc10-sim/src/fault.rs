//! Faults of a scenario, as a user writes them: `cut:2@0.3s..0.5s`. [`Faults`](crate::Faults) causes
//! those of wires and devices.

use std::convert::Infallible;
use std::fmt;
use std::str::FromStr;

use crate::Nanos;

/// Place of a fault; the first of each sort is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wire {
    /// A CAN bus: `1` is the first.
    Bus(usize),
    /// An RS-485 line: `L1` is the first.
    Line(usize),
}

impl fmt::Display for Wire {
    /// The text, as a user writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(bus) => write!(f, "{}", bus + 1),
            Self::Line(line) => write!(f, "L{}", line + 1),
        }
    }
}

/// Defects of a part beside the motors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    /// `cut:NAME`: the plug of a part on a UART is out, or that of a motor.
    Cut,
    /// `noise:NAME`: the character that it sends, or the next one, is damaged. Has no end.
    Noise,
    /// `power:NAME`: it has no power, or a motor has none.
    Power,
    /// `stuck:NAME`: a contact stays closed, as a switch that jams while it is pressed.
    Stuck,
    /// `torn:NAME`: the wire of a contact is torn: open, or closed where it is wired by the contact that opens.
    Torn,
    /// `mute:NAME`: a motor's feedback stays away. It hears, and drives on.
    Mute,
    /// `frozen:NAME`: a motor's encoder stands still, whatever its shaft does.
    Frozen,
    /// `flipped:NAME`: a motor's encoder counts the other way.
    Flipped,
    /// `bounces:NAME`: a contact opens and closes for 10 ms at each of its edges.
    Bounces,
}

impl Defect {
    const ALL: [(&str, Self); 9] = [
        ("cut", Self::Cut),
        ("noise", Self::Noise),
        ("power", Self::Power),
        ("stuck", Self::Stuck),
        ("torn", Self::Torn),
        ("bounces", Self::Bounces),
        ("mute", Self::Mute),
        ("frozen", Self::Frozen),
        ("flipped", Self::Flipped),
    ];

    /// Whether it is one of a contact, and not of a part on a UART.
    pub const fn is_of_contact(self) -> bool {
        matches!(self, Self::Stuck | Self::Torn | Self::Bounces)
    }

    /// Whether it is one of a motor alone.
    pub const fn is_of_motor(self) -> bool {
        matches!(self, Self::Mute | Self::Frozen | Self::Flipped)
    }
}

impl fmt::Display for Defect {
    /// The text, as a user writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(_, defect)| defect == self).map(|(name, _)| *name);
        f.write_str(name.unwrap_or_default())
    }
}

/// Whether a part is meant by a name as a user writes it: its label, with `-` for spaces.
pub fn is_called(label: &str, name: &str) -> bool {
    label.replace(' ', "-").eq_ignore_ascii_case(&name.replace(' ', "-"))
}

/// Kinds of fault; `O` are those of something else than wires and devices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind<O = Infallible> {
    /// A defect of a part on a UART, by its label, or of a contact, by that of its motor.
    Part(Defect, String),
    /// `cut:BUS`, `cut:LINE`: the plug is out of the board. On a bus nothing acknowledges what the
    /// chip sends; on a line both ends hear nothing.
    Cut(Wire),
    /// `short:BUS`: CANH touches CANL. Every sender fails with its first bit.
    Short(usize),
    /// `dominant:BUS`: something holds the bus dominant.
    Dominant(usize),
    /// `noise:BUS`, `noise:LINE`: the frame on the bus, or the next one, is destroyed; on a line one
    /// bit of the next answer is wrong. Has no end.
    Noise(Wire),
    /// `power:BUS`, `power:LINE`: its motors have no power.
    Power(Wire),
    /// `load:BUS`: another node fills the bus up to more than 99 %, with repetitions of the least
    /// urgent feedback.
    Load(usize),
    /// `babble:BUS`: another node sends without a pause, more urgent than all others.
    Babble(usize),
    /// `remote-lost`: the remote's transmitter is off, or out of reach. Its receiver does then what
    /// such receivers do.
    RemoteLost,
    /// A fault that the simulator cannot cause.
    Other(O),
}

/// Faults that the simulator reads and does not cause: those of an emulated chip, for example.
pub trait Others: Clone + PartialEq + fmt::Display {
    /// The names, as a user writes them; each with a space before it.
    const NAMES: &str = "";

    /// Reads a name and what stands behind its colon; `None` if there is no such fault.
    fn read(_name: &str, _argument: Option<&str>) -> Option<Result<Self, String>> {
        None
    }

    /// Whether it happens at one moment and cannot be taken back.
    fn is_sudden(&self) -> bool {
        false
    }

    /// Why it is written without a time, if it is there from power-on.
    fn untimed(&self) -> Option<&'static str> {
        None
    }
}

/// No others.
impl Others for Infallible {}

impl<O: Others> Kind<O> {
    fn is_sudden(&self) -> bool {
        match self {
            Self::Noise(_) | Self::Part(Defect::Noise, _) => true,
            Self::Other(other) => other.is_sudden(),
            _ => false,
        }
    }

    fn untimed(&self) -> Option<&'static str> {
        match self {
            Self::Other(other) => other.untimed(),
            _ => None,
        }
    }
}

impl<O> Kind<O> {
    /// The bus or line it concerns.
    pub const fn wire(&self) -> Option<Wire> {
        match self {
            Self::Cut(wire) | Self::Noise(wire) | Self::Power(wire) => Some(*wire),
            Self::Short(bus) | Self::Dominant(bus) | Self::Load(bus) | Self::Babble(bus) => {
                Some(Wire::Bus(*bus))
            }
            Self::RemoteLost | Self::Part(..) | Self::Other(_) => None,
        }
    }
}

impl<O: fmt::Display> fmt::Display for Kind<O> {
    /// The text, as a user writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Cut(_) => "cut",
            Self::Short(_) => "short",
            Self::Dominant(_) => "dominant",
            Self::Noise(_) => "noise",
            Self::Power(_) => "power",
            Self::Load(_) => "load",
            Self::Babble(_) => "babble",
            Self::RemoteLost => "remote-lost",
            Self::Part(defect, name) => return write!(f, "{defect}:{}", name.replace(' ', "-")),
            Self::Other(other) => return other.fmt(f),
        };
        match self.wire() {
            Some(wire) => write!(f, "{name}:{wire}"),
            None => f.write_str(name),
        }
    }
}

/// A fault and its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault<O = Infallible> {
    /// The kind.
    pub kind: Kind<O>,
    /// The time at which it begins, counted from power-on.
    pub from: Nanos,
    /// The time at which all is well again; `None`: never, or it has no end.
    pub until: Option<Nanos>,
}

impl<O: Others> fmt::Display for Fault<O> {
    /// The text, as a user writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, from, until } = self;
        let time = |time: &Nanos| time.to_string().replace(' ', "");
        match until {
            _ if kind.untimed().is_some() => write!(f, "{kind}"),
            Some(until) => write!(f, "{kind}@{}..{}", time(from), time(until)),
            None => write!(f, "{kind}@{}", time(from)),
        }
    }
}

/// An error: why a text cannot be a fault, or a robot cannot have it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NoFault(pub(crate) String);

impl<O: Others> FromStr for Fault<O> {
    type Err = NoFault;

    fn from_str(text: &str) -> Result<Self, NoFault> {
        let wrong = |why: String| NoFault(format!("`{text}`: {why}"));
        let Some((kind, times)) = text.split_once('@') else {
            return match kind_of(text) {
                Ok(kind) if kind.untimed().is_some() => {
                    Ok(Self { kind, from: Nanos::ZERO, until: None })
                }
                _ => Err(wrong("write KIND@TIME or KIND@TIME..TIME, as cut:2@0.3s..0.5s".into())),
            };
        };
        let kind: Kind<O> = kind_of(kind).map_err(wrong)?;
        if let Some(why) = kind.untimed() {
            return Err(wrong(why.into()));
        }
        let (from, until) = parts(times, "..");
        let from = time_of(from).map_err(wrong)?;
        let until = until.map(time_of).transpose().map_err(wrong)?;
        if until.is_some_and(|until| until <= from) {
            return Err(wrong("it ends when or before it begins".into()));
        }
        if until.is_some() && kind.is_sudden() {
            return Err(wrong("such a fault has a beginning, and no end".into()));
        }
        Ok(Self { kind, from, until })
    }
}

/// What stands before a mark, and what behind it.
fn parts<'a>(text: &'a str, mark: &str) -> (&'a str, Option<&'a str>) {
    text.split_once(mark).map_or((text, None), |(before, behind)| (before, Some(behind)))
}

fn kind_of<O: Others>(text: &str) -> Result<Kind<O>, String> {
    let (name, argument) = parts(text, ":");
    if let Some(other) = O::read(name, argument) {
        return other.map(Kind::Other);
    }
    let bus = || match argument.map(str::parse::<usize>) {
        Some(Ok(number @ 1..=3)) => Ok(number - 1),
        _ => Err(format!("`{name}` needs a bus, 1 to 3: {name}:2")),
    };
    let wire = || match argument.and_then(|text| text.strip_prefix('L')).map(str::parse::<usize>) {
        Some(Ok(number @ 1..=9)) => Ok(Wire::Line(number - 1)),
        Some(_) => Err(format!("`{name}` needs a line, L1 to L9, or a bus: {name}:L1")),
        None => bus().map(Wire::Bus),
    };
    let defect = Defect::ALL.iter().find(|(of, _)| *of == name).map(|(_, defect)| *defect);
    match (defect, argument.unwrap_or_default()) {
        (Some(defect), "") if defect.is_of_contact() || defect.is_of_motor() => {
            return Err(format!("`{name}` needs the label of a motor: {name}:feeder"));
        }
        (Some(defect), part) if defect.is_of_contact() || is_name(part) => {
            return Ok(Kind::Part(defect, part.to_owned()));
        }
        _ => {}
    }
    match name {
        "cut" => wire().map(Kind::Cut),
        "short" => bus().map(Kind::Short),
        "dominant" => bus().map(Kind::Dominant),
        "noise" => wire().map(Kind::Noise),
        "power" => wire().map(Kind::Power),
        "load" => bus().map(Kind::Load),
        "babble" => bus().map(Kind::Babble),
        "remote-lost" => alone(name, argument).map(|()| Kind::RemoteLost),
        _ => Err(format!(
            "there is no such fault; there are: cut:BUS short:BUS dominant:BUS noise:BUS power:BUS \
             load:BUS babble:BUS remote-lost{}; cut, noise and power also of a LINE, or of a part on a UART by \
             its label; cut, power, mute, frozen and flipped of a motor by its label; stuck:NAME torn:NAME bounces:NAME of a contact by its motor's",
            O::NAMES
        )),
    }
}

/// Whether nothing stands behind a name that takes nothing. Fails with the reason, if something
/// does.
pub fn alone(name: &str, argument: Option<&str>) -> Result<(), String> {
    match argument {
        None => Ok(()),
        Some(_) => Err(format!("`{name}` takes nothing behind a colon: {name}@0.5s")),
    }
}

/// Whether it is the label of a part, and no number of a bus or a line.
fn is_name(text: &str) -> bool {
    !is_digits(text) && !text.strip_prefix('L').is_some_and(is_digits)
}

fn is_digits(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}

/// `1.5s`, `300ms`, `20us`, exactly.
fn time_of(text: &str) -> Result<Nanos, String> {
    let wrong = || format!("`{text}` is no time: write 0.5s, 500ms or 20us, at most an hour");
    let units = [("ms", 1_000_000), ("us", 1_000), ("s", 1_000_000_000_u64)];
    let (number, unit) = units
        .iter()
        .find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit)))
        .ok_or_else(wrong)?;
    let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
    if whole.is_empty() || !is_digits(whole) || !is_digits(fraction) || fraction.len() > 9 {
        return Err(wrong());
    }
    let whole: u64 = whole.parse().map_err(|_| wrong())?;
    // Nine digits after the point are whole nanoseconds of a second.
    let fraction: u64 = format!("{fraction:0<9}").parse().map_err(|_| wrong())?;
    let nanos = whole
        .checked_mul(unit)
        .and_then(|nanos| nanos.checked_add(fraction * unit / 1_000_000_000))
        .filter(|&nanos| nanos <= 3_600_000_000_000)
        .ok_or_else(wrong)?;
    Ok(Nanos::new(nanos))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_written_as_the_help_says() {
        let fault: Fault = "cut:2@0.3s..500ms".parse().unwrap();
        assert_eq!(fault.kind, Kind::Cut(Wire::Bus(1)));
        assert_eq!(fault.from, Nanos::new(300_000_000));
        assert_eq!(fault.until, Some(Nanos::new(500_000_000)));
        let fault: Fault = "short:1@20us..25us".parse().unwrap();
        assert_eq!((fault.kind, fault.from), (Kind::Short(0), Nanos::new(20_000)));
    }

    #[test]
    fn kinds_are_shown_as_they_are_written() {
        let kinds = "cut:1 short:2 dominant:3 noise:1 power:2 load:3 remote-lost cut:L1 noise:L2 \
                     power:L9 cut:IMU noise:wall-left power:IMU stuck:feeder torn:lift-left \
                     bounces:feeder babble:2 mute:feeder frozen:feeder flipped:lift-left";
        for kind in kinds.split(' ') {
            assert_eq!(kind_of::<Infallible>(kind).unwrap().to_string(), kind);
        }
    }

    #[test]
    fn faults_are_shown_as_they_are_written() {
        for text in ["cut:2@0.3s..500ms", "load:1@1.000001s", "noise:L1@20us"] {
            let fault: Fault = text.parse().unwrap();
            assert_eq!(fault.to_string().parse(), Ok(fault));
        }
    }

    #[test]
    fn what_cannot_be_a_fault_is_told_why() {
        for (text, why) in [
            ("cut:2", "KIND@TIME"),
            ("cut@1s", "needs a bus"),
            ("cut:4@1s", "needs a bus"),
            ("cut:0@1s", "needs a bus"),
            ("cut:L0@1s", "needs a line"),
            ("power:L@1s", "needs a line"),
            ("short:L1@1s", "needs a bus"),
            ("remote-lost:1@1s", "remote-lost@0.5s"),
            ("flood@1s", "cut:BUS"),
            ("panic@1s", "no such fault"),
            ("stuck@1s", "label of a motor"),
            ("mute@1s", "label of a motor"),
            ("babble:L1@1s", "needs a bus"),
            ("torn:@1s", "label of a motor"),
            ("noise:IMU@1s..2s", "no end"),
            ("short:1@1", "is no time"),
            ("short:1@1e3s", "is no time"),
            ("short:1@-1s", "is no time"),
            ("short:1@3601s", "is no time"),
            ("short:1@99999999999999999999s", "is no time"),
            ("short:1@2s..1s", "before it begins"),
            ("short:1@1s..1s", "when or before it begins"),
        ] {
            let error = text.parse::<Fault>().unwrap_err().to_string();
            assert!(error.contains(why) && error.contains(text), "{error}");
        }
    }
}
