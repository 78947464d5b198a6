use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Most signals of a robot.
pub const SIGNALS: usize = 1024;

/// Groups of signals, each with a period of its own.
pub const GROUPS: usize = 4;

/// Most changes in one [`Ask::Set`].
pub const CHANGES: usize = 8;

/// A question of a PC.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Ask {
    /// A sign of the PC: at the beginning, and again and again. [`Tell::Welcome`] is the answer.
    Hello {
        /// The PC's [`VERSION`](crate::VERSION).
        version: u16,
    },
    /// Which signals there are: some [`Tell::Signal`], from this one on.
    Signals {
        /// The first of them.
        first: u16,
    },
    /// Which parameters there are: some [`Tell::Parameter`], from this one on.
    Parameters {
        /// The first of them.
        first: u16,
    },
    /// Sends these signals from now on. No group sends before it has been asked for.
    Watch {
        /// Below [`GROUPS`].
        group: u8,
        /// Time from one sample to the next, ms: 1 to 1000; 0 switches the group off.
        period: u16,
        /// The signals in it; none switches it off, too.
        signals: Bits,
    },
    /// Changes parameters, all of them or none. [`Tell::Answer`] is the answer.
    Set {
        /// The request's number, for its answer.
        id: u16,
        /// Each parameter at most once.
        changes: Vec<Change, CHANGES>,
        /// The robot that is meant: another one refuses.
        declaration: Declaration,
    },
    /// Stops or disarms any robot at any time, also without a [`Hello`](Self::Hello) before.
    Urge {
        /// The request's number, for its answer.
        id: u16,
        /// The order.
        what: Urgent,
    },
    /// Does something to one robot. [`Tell::Answer`] is the answer.
    Act {
        /// The request's number, for its answer.
        id: u16,
        /// The robot that is meant: another one refuses.
        declaration: Declaration,
        /// The newest time that the robot told, µs since its power-on. A [`Jog`](Action::Jog) is refused
        /// if that is older than [`JOG_AGE`](crate::JOG_AGE), or not newer than that of the one before.
        heard: u64,
        /// The action.
        action: Action,
    },
    /// How much the line carries. From then on all else rides on the samples of group 0, while their
    /// period is at most [`RIDES`](crate::RIDES): none of them waits behind a long frame.
    Line {
        /// Bytes in a millisecond; 0: unknown, and each frame is sent by itself.
        bytes: u16,
    },
    /// Which values are kept over a power-off: some [`Tell::Kept`], from this one on.
    Kept {
        /// The first of them.
        first: u16,
    },
}

/// FNV-1a of a robot's declaration: names and places of motors, buses, lines, signals, parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Declaration(pub u32);

impl Default for Declaration {
    fn default() -> Self {
        Self(0x811C_9DC5)
    }
}

impl Declaration {
    /// With some more of it.
    #[must_use]
    #[inline(never)] // Once in flash.
    pub fn with(self, bytes: &[u8]) -> Self {
        // An end, so that parts do not run into each other.
        let bytes = bytes.iter().chain(&[0xFF]);
        Self(bytes.fold(self.0, |sum, byte| (sum ^ u32::from(*byte)).wrapping_mul(0x0100_0193)))
    }
}

/// A parameter, and its new value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// Number of the parameter.
    pub parameter: u16,
    /// The value.
    pub value: f32,
}

/// An order of a PC at once, to any robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Urgent {
    /// Emergency stop of all motors. It stays until a hand has moved the switches of the remote since.
    Stop,
    /// Disarms the robot.
    Disarm,
}

/// An order of a PC to a motor. Motors are told by their numbers in the robot's declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Action {
    /// A motor's angle now is zero from now on. Only while the robot is disarmed.
    Zero(u8),
    /// A motor forgets its fault and goes on.
    ClearFault(u8),
    /// Reads a register of a motor's device: [`Outcome::Register`].
    ReadRegister(u8, u16),
    /// Turns a motor of a disarmed robot, tenths of rpm, for 80 ms: repeat it. Zero ends it.
    Jog(u8, i16),
    /// Keeps all parameters that differ from the robot's table over a power-off, and what was kept for other programs.
    /// Only while the robot is disarmed and at rest.
    Save,
    /// Keeps a value no longer, by its [`id`](Tell::Kept). The parameter has its own from the next start on. The same.
    Forget(u32),
    /// Keeps no value any longer. The same.
    ForgetAll,
    /// Writes four bytes, little endian, into a register of a motor's device until its power is cut. Only while
    /// the robot is disarmed.
    WriteRegister(u8, u16, u32),
    /// A motor's device keeps its registers over a power-off. The same.
    SaveRegisters(u8),
    // The black box.
    /// Sends the chip's black box: some [`Tell::BlackBox`], from this one on. It is answered only if it is refused.
    BlackBox(u16),
}

/// Some of a robot's signals.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bits(Vec<u32, { SIGNALS / 32 }>);

impl Bits {
    /// None of them.
    #[must_use]
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// Adds a signal; whether there is room for its number.
    pub fn insert(&mut self, signal: u16) -> bool {
        let word = usize::from(signal) / 32;
        if self.0.len() <= word && self.0.resize(word + 1, 0).is_err() {
            return false;
        }
        self.0[word] |= 1 << (signal % 32);
        true
    }

    /// Whether a signal is among them.
    #[must_use]
    pub fn contains(&self, signal: u16) -> bool {
        self.word(usize::from(signal) / 32) & (1 << (signal % 32)) != 0
    }

    /// The 32 signals from 32 times this number on, the first in the lowest bit.
    #[inline]
    #[must_use]
    pub fn word(&self, at: usize) -> u32 {
        self.0.get(at).copied().unwrap_or_default()
    }

    /// Whether all of them are below this number, which is a multiple of 32.
    #[must_use]
    pub fn is_below(&self, number: u16) -> bool {
        self.0.len() <= usize::from(number) / 32
    }

    /// Whether it is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|word| *word == 0)
    }

    /// How many they are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Their numbers.
    pub fn iter(&self) -> impl Iterator<Item = u16> {
        (0..u16::MAX).take(SIGNALS).filter(|signal| self.contains(*signal))
    }
}

impl FromIterator<u16> for Bits {
    /// Numbers without room are left out.
    fn from_iter<I: IntoIterator<Item = u16>>(signals: I) -> Self {
        let mut bits = Self::new();
        signals.into_iter().for_each(|signal| {
            bits.insert(signal);
        });
        bits
    }
}

/// The topic of a signal or parameter: a folder and a label, as "motors" and "lift left".
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Topic<'a> {
    /// "motors", "buses", "lines", "robot", "signals", "parameters".
    pub folder: &'a str,
    /// Which of them; empty if there is only one.
    pub label: &'a str,
}

/// A message of a robot. A [sample](crate::samples) has number 0 and is not among them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Tell<'a> {
    /// Number 0 on the wire belongs to samples.
    #[doc(hidden)]
    Sample,
    /// The robot is there.
    Welcome {
        /// The robot's [`VERSION`](crate::VERSION).
        version: u16,
        /// Number of its signals.
        signals: u16,
        /// Number of its parameters.
        parameters: u16,
        /// Time since power-on, µs.
        at: u64,
        /// A count that differs when a parameter has changed, by this PC or another.
        changes: u32,
        /// Bad frames, bytes of no frame, and losses of the port, from the PC.
        damaged: [u32; 3],
        /// Samples that were not taken because those before were not sent yet.
        skipped: u32,
        /// Which robot it is.
        declaration: Declaration,
    },
    /// A signal.
    Signal {
        /// The signal's number.
        index: u16,
        /// The thing that it is about.
        topic: Topic<'a>,
        /// The signal's name there: small letters.
        name: &'a str,
        /// The unit; empty without one.
        unit: &'a str,
        /// If it is a state: the names of its values from 0 on, with commas between.
        states: &'a str,
    },
    /// A parameter.
    Parameter {
        /// The parameter's number.
        index: u16,
        /// The thing that it is about.
        topic: Topic<'a>,
        /// The parameter's name there.
        name: &'a str,
        /// The unit; empty without one.
        unit: &'a str,
        /// The lowest and the highest value that it takes.
        range: [f32; 2],
        /// The value now.
        value: f32,
        /// The value in the robot's table, which it has at power-on unless another one is kept.
        initial: f32,
    },
    /// Answers a request.
    Answer {
        /// The number of the request.
        id: u16,
        /// The outcome of the request.
        outcome: Outcome<'a>,
    },
    /// Number 5 on the wire belongs to [carriers](crate::frame::CARRIER).
    #[doc(hidden)]
    Carrier,
    /// A value that is kept over a power-off.
    Kept {
        /// Its number.
        index: u16,
        /// How many there are. Without any there is one message, whose index is 0, too.
        of: u16,
        /// Tells it from the others, for [`Action::Forget`].
        id: u32,
        /// The name of its parameter, or the end of it.
        text: &'a str,
        /// The value.
        value: f32,
        /// The number of its parameter, of a name that this robot knows.
        parameter: Option<u16>,
        /// Whether unit and range are as they were: else it is not used.
        is_used: bool,
    },
    // The black box.
    /// A piece of the chip's black box, as it lies in memory: [`PIECE`](crate::PIECE) bytes, the last one less.
    BlackBox {
        /// Its number.
        index: u16,
        /// How many there are.
        of: u16,
        /// The bytes.
        bytes: &'a [u8],
    },
}

/// The outcome of a request.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Outcome<'a> {
    /// The request is done.
    Done,
    /// The register's value.
    Register(u32),
    /// The request was refused, and nothing changed.
    Refused {
        /// The parameter, if one was the reason.
        parameter: Option<u16>,
        /// The reason.
        why: &'a str,
        /// More about it; may be empty.
        detail: &'a str,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_declaration_differs_where_its_parts_their_order_or_their_ends_do() {
        let of =
            |parts: &[&[u8]]| parts.iter().fold(Declaration::default(), |sum, part| sum.with(part));
        let one = of(&[b"lift", b"left"]);
        let others: [&[&[u8]]; 6] = [
            &[b"liftl", b"eft"],
            &[b"liftleft"],
            &[b"left", b"lift"],
            &[b"lift", b"left", b""],
            &[b"lift"],
            &[],
        ];
        for other in others {
            assert_ne!(of(other), one, "{other:?}");
        }
        assert_eq!(of(&[b"lift", b"left"]), one);
    }
}
