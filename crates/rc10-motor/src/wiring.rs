use core::fmt;

use embedded_can::Id;
use heapless::Vec;
use rc10_can::{CanFrame, IdPattern, LengthBounds, Micros};

/// Everything a motor occupies on its bus, declared once. The clash check, the receive table, the
/// load figure and the link timeout all follow from it.
#[derive(Clone, Debug)]
pub struct CanIds {
    name: MotorName,
    receive: Vec<RxFrames, 8>,
    transmit: Vec<TxFrames, 8>,
    listens: Vec<IdPattern, 2>,
}

/// What a motor is called in errors and tables: its model and the identifier set on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorName {
    /// Model, as the vendor writes it.
    pub model: &'static str,
    /// The identifier set on the device.
    pub id: u16,
}

impl fmt::Display for MotorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} id {}", self.model, self.id)
    }
}

/// How often a frame comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// So many times a second, by the device's own clock.
    Hz(u16),
    /// Once every tick of the bus (1 ms): commands, and the replies to them.
    EveryTick,
    /// Now and then (set-up, enabling): it does not count towards the load.
    Rare,
}

impl Rate {
    /// Frames a second; ticks are 1 ms.
    #[must_use]
    pub const fn per_second(self) -> u32 {
        match self {
            Self::Hz(hz) => hz as u32,
            Self::EveryTick => 1000,
            Self::Rare => 0,
        }
    }
}

/// Frames that a device sends to us.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RxFrames {
    /// Their identifiers.
    pub pattern: IdPattern,
    /// Data bytes.
    pub len: u8,
    /// How often.
    pub rate: Rate,
    /// For devices that share an identifier: what the payload of this one's frames looks like.
    pub guard: Option<Guard>,
}

/// A test on one byte of a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guard {
    /// Which byte, 0 ..= 7.
    pub byte: u8,
    /// The bits that count.
    pub mask: u8,
    /// What they must be.
    pub value: u8,
}

impl Guard {
    /// Whether a frame passes; a byte it does not have never does.
    #[must_use]
    pub fn passes(self, frame: &CanFrame) -> bool {
        frame
            .bytes()
            .get(usize::from(self.byte))
            .is_some_and(|byte| byte & self.mask == self.value & self.mask)
    }

    /// Whether no payload passes both.
    const fn excludes(self, other: Self) -> bool {
        let common = self.mask & other.mask;
        self.byte == other.byte && (self.value ^ other.value) & common != 0
    }
}

/// Frames that we send to a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TxFrames {
    /// Their identifiers.
    pub pattern: IdPattern,
    /// Data bytes.
    pub len: u8,
    /// How often.
    pub rate: Rate,
    /// Whose the frame is.
    pub share: Ownership,
}

/// How much of a frame that we send is one device's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ownership {
    /// All of it.
    Whole,
    /// Some of its bytes, bit n for byte n: several devices are commanded by one frame.
    Lane(u8),
    /// All of it, if the payload says so: several devices are commanded with one identifier.
    Guard(Guard),
}

impl Ownership {
    /// Whether two devices can have their shares of frames with one identifier.
    const fn excludes(self, other: Self) -> bool {
        match (self, other) {
            (Self::Lane(ours), Self::Lane(theirs)) => ours & theirs == 0,
            (Self::Guard(ours), Self::Guard(theirs)) => ours.excludes(theirs),
            _ => false,
        }
    }
}

/// More frames than a [`CanIds`] holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanIdsFull;

impl fmt::Display for CanIdsFull {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a wiring holds 8 received, 8 sent and 2 listened-to patterns")
    }
}

impl core::error::Error for CanIdsFull {}

/// Why two motors cannot share a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clash {
    /// Both devices send frames with this identifier, and nothing tells them apart.
    RxFrames(Id),
    /// Both are commanded by the same bytes of the frame with this identifier.
    TxFrames(Id),
    /// A frame with this identifier, meant for or sent by one, is taken for a command by the other.
    Confuses(Id),
}

impl fmt::Display for Clash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::RxFrames(id) | Self::TxFrames(id) | Self::Confuses(id)) = *self;
        let id = IdPattern::exact(id);
        match self {
            Self::RxFrames(_) => write!(f, "both send feedback with identifier {id}"),
            Self::TxFrames(_) => write!(f, "both are commanded by the same bytes of {id}"),
            Self::Confuses(_) => write!(f, "one takes the other's frame {id} for a command"),
        }
    }
}

impl CanIds {
    /// A motor that occupies nothing yet.
    #[must_use]
    pub const fn new(model: &'static str, id: u16) -> Self {
        Self {
            name: MotorName { model, id },
            receive: Vec::new(),
            transmit: Vec::new(),
            listens: Vec::new(),
        }
    }

    /// Adds frames the device sends.
    ///
    /// # Errors
    /// [`CanIdsFull`] beyond eight.
    pub fn receives(mut self, receive: RxFrames) -> Result<Self, CanIdsFull> {
        self.receive.push(receive).map_err(|_| CanIdsFull)?;
        Ok(self)
    }

    /// Adds frames sent to the device.
    ///
    /// # Errors
    /// [`CanIdsFull`] beyond eight.
    pub fn transmits(mut self, transmit: TxFrames) -> Result<Self, CanIdsFull> {
        self.transmit.push(transmit).map_err(|_| CanIdsFull)?;
        Ok(self)
    }

    /// Adds identifiers the device obeys although we never use them: no other device's frames may
    /// match. (A Damiao reacts to the low byte of every standard identifier.)
    ///
    /// # Errors
    /// [`CanIdsFull`] beyond two.
    pub fn listens_to(mut self, pattern: IdPattern) -> Result<Self, CanIdsFull> {
        self.listens.push(pattern).map_err(|_| CanIdsFull)?;
        Ok(self)
    }

    /// What the motor is called.
    #[must_use]
    pub const fn name(&self) -> MotorName {
        self.name
    }

    /// What the device sends.
    #[must_use]
    pub fn received(&self) -> &[RxFrames] {
        &self.receive
    }

    /// What is sent to the device.
    #[must_use]
    pub fn transmitted(&self) -> &[TxFrames] {
        &self.transmit
    }

    /// What the device obeys although it is never sent.
    #[must_use]
    pub fn listened_to(&self) -> &[IdPattern] {
        &self.listens
    }

    /// After so long without a frame the motor is lost: three periods of its most frequent
    /// feedback, but at least 10 ms.
    #[must_use]
    pub fn link_timeout(&self) -> Micros {
        let rates = self.receive.iter().map(|receive| receive.rate.per_second());
        let fastest = rates.max().unwrap_or(0).max(1);
        Micros::new(u64::from(3_000_000_u32.div_ceil(fastest)).max(10_000))
    }

    /// Why this motor and another cannot share a bus, if so.
    #[must_use]
    pub fn clash(&self, other: &Self) -> Option<Clash> {
        for ours in &self.receive {
            for theirs in &other.receive {
                let told_apart = match (ours.guard, theirs.guard) {
                    (Some(ours), Some(theirs)) => ours.excludes(theirs),
                    _ => false,
                };
                if let (Some(id), false) = (ours.pattern.overlap(&theirs.pattern), told_apart) {
                    return Some(Clash::RxFrames(id));
                }
            }
        }
        for ours in &self.transmit {
            for theirs in &other.transmit {
                let apart = ours.share.excludes(theirs.share)
                    && (ours.len == theirs.len || matches!(ours.share, Ownership::Guard(_)));
                if let (Some(id), false) = (ours.pattern.overlap(&theirs.pattern), apart) {
                    return Some(Clash::TxFrames(id));
                }
            }
        }
        self.confused_by(other).or_else(|| other.confused_by(self)).map(Clash::Confuses)
    }

    /// A frame sent by or to `other` that this device takes for a command.
    fn confused_by(&self, other: &Self) -> Option<Id> {
        let sent = other.receive.iter().map(|receive| receive.pattern);
        let commands = other.transmit.iter().map(|transmit| transmit.pattern);
        let obeyed = self.transmit.iter().map(|transmit| transmit.pattern);
        // Commands of both were compared before: they may share a frame.
        let by_feedback =
            sent.clone().find_map(|frame| obeyed.clone().find_map(|c| c.overlap(&frame)));
        by_feedback.or_else(|| {
            sent.chain(commands).find_map(|f| self.listens.iter().find_map(|l| l.overlap(&f)))
        })
    }

    /// Bit times a second that this motor's feedback takes.
    pub(crate) fn receive_bits(&self) -> impl Iterator<Item = (LengthBounds, u32)> + '_ {
        self.receive.iter().map(|receive| {
            let bounds = LengthBounds::of(usize::from(receive.len), is_extended(&receive.pattern));
            (bounds, receive.rate.per_second())
        })
    }
}

pub(crate) const fn is_extended(pattern: &IdPattern) -> bool {
    matches!(pattern.id(), Id::Extended(_))
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::StandardId;

    fn exact(raw: u16) -> IdPattern {
        IdPattern::exact(StandardId::new(raw).unwrap())
    }

    fn feedback(raw: u16, guard: Option<Guard>) -> RxFrames {
        RxFrames { pattern: exact(raw), len: 8, rate: Rate::EveryTick, guard }
    }

    fn command(raw: u16, share: Ownership) -> TxFrames {
        TxFrames { pattern: exact(raw), len: 8, rate: Rate::EveryTick, share }
    }

    /// As protocols of later motors need it: two Damiao motors on one master identifier.
    #[test]
    fn a_shared_feedback_id_needs_guards_that_exclude_each_other() {
        let nibble = |value| Some(Guard { byte: 0, mask: 0x0F, value });
        let damiao = |id: u16, guard| {
            CanIds::new("J4310", id)
                .receives(feedback(0x000, guard))
                .and_then(|wiring| wiring.transmits(command(id, Ownership::Whole)))
                .unwrap()
        };
        assert_eq!(damiao(0x11, nibble(1)).clash(&damiao(0x12, nibble(2))), None);
        let clash = damiao(0x11, nibble(1)).clash(&damiao(0x21, nibble(1)));
        assert_eq!(clash, Some(Clash::RxFrames(StandardId::ZERO.into())));
        assert!(damiao(0x11, nibble(1)).clash(&damiao(0x12, None)).is_some());
    }

    #[test]
    fn lanes_share_a_frame_unless_their_bytes_overlap() {
        let wired = |share| CanIds::new("x", 1).transmits(command(0x200, share)).unwrap();
        let lane = |bytes| wired(Ownership::Lane(bytes));
        assert_eq!(lane(0b0011).clash(&lane(0b1100)), None);
        let id = StandardId::new(0x200).unwrap().into();
        assert_eq!(lane(0b0011).clash(&lane(0b0110)), Some(Clash::TxFrames(id)));
        assert_eq!(wired(Ownership::Whole).clash(&lane(1)), Some(Clash::TxFrames(id)));
    }

    /// Damiao's registers: all motors of a bus are asked with one identifier, by payload.
    #[test]
    fn devices_that_are_commanded_by_payload_share_an_identifier() {
        let asked = |value| {
            let guard = Guard { byte: 0, mask: 0xFF, value };
            let register =
                TxFrames { len: 4 + value % 2, ..command(0x7FF, Ownership::Guard(guard)) };
            CanIds::new("x", 1).transmits(register).unwrap()
        };
        assert_eq!(asked(0x11).clash(&asked(0x12)), None);
        let id = StandardId::new(0x7FF).unwrap().into();
        assert_eq!(asked(0x11).clash(&asked(0x11)), Some(Clash::TxFrames(id)));
        let lane = CanIds::new("x", 1).transmits(command(0x7FF, Ownership::Lane(1))).unwrap();
        assert_eq!(asked(0x11).clash(&lane), Some(Clash::TxFrames(id)));
    }

    #[test]
    fn a_device_that_obeys_a_low_byte_clashes_with_feedback_that_ends_in_it() {
        let low_byte = IdPattern::masked(StandardId::new(0x001).unwrap(), 0xFF);
        let damiao = CanIds::new("J4310", 1).listens_to(low_byte).unwrap();
        let dji = CanIds::new("M3508", 1).receives(feedback(0x201, None)).unwrap();
        let id = StandardId::new(0x201).unwrap().into();
        assert_eq!(damiao.clash(&dji), Some(Clash::Confuses(id)));
        assert_eq!(dji.clash(&damiao), Some(Clash::Confuses(id)));
    }

    #[test]
    fn the_link_timeout_is_three_periods_or_ten_milliseconds() {
        let at = |rate| {
            let receive = RxFrames { rate, ..feedback(0x201, None) };
            CanIds::new("x", 1).receives(receive).unwrap().link_timeout().get()
        };
        assert_eq!(at(Rate::EveryTick), 10_000);
        assert_eq!(at(Rate::Hz(125)), 24_000);
        assert_eq!(at(Rate::Hz(50)), 60_000);
    }
}
