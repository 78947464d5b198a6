use core::fmt;

use embedded_can::StandardId;
use rc10_app::{ConfigError, Text};
use rc10_can::{CanFrame, IdPattern};
use rc10_time::Micros;

/// The identifiers of a motor: clash check, receive table, load and link timeout follow from them.
///
/// A motor that declares too much is refused when attached, or by [`checked`](Self::checked).
///
/// ```
/// use rc10_can::IdPattern;
/// use rc10_motor::{CanIds, Frames, Ownership, Rate};
///
/// const IDS: CanIds = CanIds::new()
///     .receives(Frames::new(IdPattern::standard(0x201), 8, Rate::Hz(1000)))
///     .transmits(Frames::new(IdPattern::standard(0x200), 8, Rate::EveryTick))
///     .checked();
/// assert_eq!(IDS.link_timeout().get(), 10_000);
/// ```
#[derive(Clone, Copy, Debug)]
#[must_use]
pub struct CanIds {
    received: List<8>,
    transmitted: List<8>,
    listens: List<2>,
}

/// Up to `N` sorts of frames, in the order in which they were added.
#[derive(Clone, Copy, Debug)]
struct List<const N: usize> {
    items: [Frames; N],
    /// Number of those that were added, those that found no room included.
    len: usize,
}

impl<const N: usize> List<N> {
    const fn new() -> Self {
        Self { items: [Frames::new(IdPattern::any_standard(), 0, Rate::Rare); N], len: 0 }
    }

    const fn push(&mut self, item: Frames) {
        if self.len < N {
            self.items[self.len] = item;
        }
        self.len += 1;
    }

    const fn is_complete(&self) -> bool {
        self.len <= N
    }

    const fn items(&self) -> &[Frames] {
        self.items.split_at(if self.is_complete() { self.len } else { N }).0
    }
}

/// A standard identifier, cut off above 11 bits; as a constant, too.
pub(crate) const fn standard(raw: u16) -> StandardId {
    match StandardId::new(raw & 0x7FF) {
        Some(id) => id,
        None => StandardId::MAX,
    }
}

/// Name of a motor in errors and tables: its model and the identifier set on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorName {
    /// Model, as the vendor writes it.
    pub model: &'static str,
    /// The identifier set on the device.
    pub id: u16,
}

impl MotorName {
    /// The error, in the configuration of this motor.
    pub const fn blame(self, error: ConfigError) -> ConfigError {
        error.of_device(self.model, self.id)
    }

    /// The same, if there is an error.
    pub const fn blamed(self, checked: Result<(), ConfigError>) -> Result<(), ConfigError> {
        match checked {
            Ok(()) => Ok(()),
            Err(error) => Err(self.blame(error)),
        }
    }

    pub(crate) const fn add_to(self, text: Text) -> Text {
        text.push(self.model).push(" id ").push_number(self.id as u64)
    }
}

impl fmt::Display for MotorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} id {}", self.model, self.id)
    }
}

/// The rate at which a frame is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// This many times a second, by the device's own clock.
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

/// A test on one byte of a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guard {
    /// Index of the byte, 0 ..= 7.
    pub byte: u8,
    /// The bits that count.
    pub mask: u8,
    /// Value of those bits.
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

/// Frames between us and a device, in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    /// Their identifiers.
    pub pattern: IdPattern,
    /// Data bytes.
    pub len: u8,
    /// The rate at which they are sent.
    pub rate: Rate,
    /// Share of them that is the device's.
    pub ownership: Ownership,
    /// So many of the identifier's first bits are the pattern's in those sent all the time, whatever its mask asks for.
    pub leading: u8,
}

impl Frames {
    /// Frames that are one device's as a whole.
    pub const fn new(pattern: IdPattern, len: u8, rate: Rate) -> Self {
        Self { pattern, len, rate, ownership: Ownership::Whole, leading: 0 }
    }

    /// Frames of which those sent all the time have so many first bits of their pattern's identifier: how urgent they are
    /// on the bus follows from that.
    #[must_use]
    pub const fn with_leading(mut self, bits: u8) -> Self {
        self.leading = bits;
        self
    }

    /// The identifiers of those sent all the time.
    pub(crate) const fn usual(&self) -> IdPattern {
        let width = if self.pattern.is_extended() { 29 } else { 11 };
        let others = (1_u32 << (width - self.leading as u32)) - 1;
        let leading = if self.leading == 0 { 0 } else { !others };
        self.pattern.under(self.pattern.mask() | leading)
    }

    /// Whether it is a share of the command frame with this identifier, which is sent once for all whose shares it has.
    pub(crate) const fn is_part_of(&self, sent: &IdPattern) -> bool {
        matches!(self.ownership, Ownership::Bytes(_))
            && self.pattern.raw() == sent.raw()
            && self.pattern.is_extended() == sent.is_extended()
    }

    /// Frames of which the device owns a part.
    #[must_use]
    pub const fn owned(mut self, ownership: Ownership) -> Self {
        self.ownership = ownership;
        self
    }

    /// The test that their payload passes, if the identifier alone does not tell whose they are.
    #[must_use]
    pub const fn guard(&self) -> Option<Guard> {
        match self.ownership {
            Ownership::Guard(guard) => Some(guard),
            Ownership::Whole | Ownership::Bytes(_) => None,
        }
    }

    /// Whether a frame is one of these, by its identifier and guard; its length is not looked at.
    #[must_use]
    pub fn contains(&self, frame: &CanFrame) -> bool {
        self.pattern.matches(frame) && self.guard().is_none_or(|guard| guard.passes(frame))
    }

    /// An identifier that two devices both use, with nothing that tells their frames apart.
    const fn clash(&self, other: &Self, pair: Pair) -> Option<IdPattern> {
        let is_apart = match (pair, self.ownership, other.ownership) {
            (Pair::Crossed, ..) => false,
            (_, Ownership::Guard(ours), Ownership::Guard(theirs)) => ours.excludes(theirs),
            // One frame of ours that carries commands to both.
            (Pair::Commands, Ownership::Bytes(ours), Ownership::Bytes(theirs)) => {
                ours & theirs == 0 && self.len == other.len
            }
            _ => false,
        };
        if is_apart { None } else { self.pattern.overlap(&other.pattern) }
    }
}

/// Frames of two devices that are compared: it says what can tell them apart.
#[derive(Clone, Copy)]
enum Pair {
    /// Both are feedback: guards.
    Feedback,
    /// Both are commands: guards, and lanes of one frame.
    Commands,
    /// Sent by or to one, and taken for a command by the other: nothing.
    Crossed,
}

/// The share of a frame that belongs to one device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ownership {
    /// All of it.
    Whole,
    /// Some of its bytes, bit n for byte n, of a sent frame: several devices are commanded by one.
    Bytes(u8),
    /// All of it, if the payload says so: several devices share one identifier.
    Guard(Guard),
}

/// The reason why two motors cannot share a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clash {
    /// Both devices send frames with this identifier, and nothing tells them apart.
    RxFrames(IdPattern),
    /// Both are commanded by the same bytes of the frame with this identifier.
    TxFrames(IdPattern),
    /// A frame with this identifier, meant for or sent by one, is taken for a command by the other.
    Confuses(IdPattern),
    /// Both have this address on their RS-485 bus.
    Address(u8),
}

impl Clash {
    pub(crate) const fn add_to(self, text: Text) -> Text {
        match self {
            Self::RxFrames(of) => id(text.push("both send feedback with identifier "), of),
            Self::TxFrames(of) => id(text.push("both are commanded by the same bytes of "), of),
            Self::Confuses(of) => {
                id(text.push("one takes the other's frame "), of).push(" for a command")
            }
            Self::Address(address) => text.push("both have address ").push_number(address as u64),
        }
    }
}

/// A text with the one identifier of a pattern at its end.
const fn id(text: Text, of: IdPattern) -> Text {
    text.push_hex(of.raw(), if of.is_extended() { 8 } else { 3 })
}

impl fmt::Display for Clash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.add_to(Text::new()).fmt(f)
    }
}

impl CanIds {
    /// The identifiers of a motor that occupies none yet.
    pub const fn new() -> Self {
        Self { received: List::new(), transmitted: List::new(), listens: List::new() }
    }

    /// Adds frames the device sends; eight at most.
    pub const fn receives(mut self, frames: Frames) -> Self {
        self.received.push(frames);
        self
    }

    /// Adds frames sent to the device; eight at most.
    pub const fn transmits(mut self, frames: Frames) -> Self {
        self.transmitted.push(frames);
        self
    }

    /// Adds identifiers that the device obeys but we never use (a Damiao's low byte). Two at most.
    pub const fn listens_to(mut self, pattern: IdPattern) -> Self {
        self.listens.push(Frames::new(pattern, 0, Rate::Rare));
        self
    }

    /// Whether all that was added found room.
    pub const fn is_complete(&self) -> bool {
        self.received.is_complete() && self.transmitted.is_complete() && self.listens.is_complete()
    }

    /// The same, if all that was added found room; else it panics: to be evaluated in a `const`.
    pub const fn checked(self) -> Self {
        assert!(self.is_complete(), "8 received, 8 transmitted and 2 listened-to patterns at most");
        self
    }

    /// Frames that the device sends.
    pub const fn received(&self) -> &[Frames] {
        self.received.items()
    }

    /// Frames that are sent to the device.
    pub const fn transmitted(&self) -> &[Frames] {
        self.transmitted.items()
    }

    /// Frames that the device obeys although they are never sent: only their pattern counts.
    pub const fn listened_to(&self) -> &[Frames] {
        self.listens.items()
    }

    /// Time without a frame before the motor is lost: three feedback periods, at least 10 ms.
    pub fn link_timeout(&self) -> Micros {
        let rates = self.received().iter().map(|receive| receive.rate.per_second());
        let fastest = rates.max().unwrap_or(0).max(1);
        Micros::new(u64::from(3_000_000_u32.div_ceil(fastest)).max(10_000))
    }

    /// Why this motor and another cannot share a bus, if so.
    pub const fn clash(&self, other: &Self) -> Option<Clash> {
        if let Some(id) = shared(self.received(), other.received(), Pair::Feedback) {
            return Some(Clash::RxFrames(id));
        }
        if let Some(id) = shared(self.transmitted(), other.transmitted(), Pair::Commands) {
            return Some(Clash::TxFrames(id));
        }
        match (self.confused_by(other), other.confused_by(self)) {
            (Some(id), _) | (None, Some(id)) => Some(Clash::Confuses(id)),
            (None, None) => None,
        }
    }

    /// A frame sent by or to `other` that this device takes for a command.
    const fn confused_by(&self, other: &Self) -> Option<IdPattern> {
        // Commands of both were compared before: they may share a frame.
        let pairs = [
            (self.transmitted(), other.received()),
            (self.listened_to(), other.received()),
            (self.listened_to(), other.transmitted()),
        ];
        let mut at = 0;
        while at < pairs.len() {
            if let Some(id) = shared(pairs[at].0, pairs[at].1, Pair::Crossed) {
                return Some(id);
            }
            at += 1;
        }
        None
    }
}

/// An identifier of both that nothing tells apart. Loops in place of iterators: constants ask, too. Asked once at the
/// start, so it stands in the firmware once.
#[inline(never)]
const fn shared(ours: &[Frames], theirs: &[Frames], pair: Pair) -> Option<IdPattern> {
    let mut one = 0;
    while one < ours.len() {
        let mut two = 0;
        while two < theirs.len() {
            if let Some(id) = ours[one].clash(&theirs[two], pair) {
                return Some(id);
            }
            two += 1;
        }
        one += 1;
    }
    None
}

impl Default for CanIds {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::StandardId;

    fn exact(raw: u16) -> IdPattern {
        IdPattern::exact(StandardId::new(raw).unwrap())
    }

    fn feedback(raw: u16, guard: Option<Guard>) -> Frames {
        command(raw, guard.map_or(Ownership::Whole, Ownership::Guard))
    }

    fn command(raw: u16, ownership: Ownership) -> Frames {
        Frames::new(exact(raw), 8, Rate::EveryTick).owned(ownership)
    }

    /// A case of later motors' protocols: two Damiao motors on one master identifier.
    #[test]
    fn a_shared_feedback_id_needs_guards_that_exclude_each_other() {
        let nibble = |value| Some(Guard { byte: 0, mask: 0x0F, value });
        let damiao = |id: u16, guard| {
            CanIds::new().receives(feedback(0x000, guard)).transmits(command(id, Ownership::Whole))
        };
        assert_eq!(damiao(0x11, nibble(1)).clash(&damiao(0x12, nibble(2))), None);
        let clash = damiao(0x11, nibble(1)).clash(&damiao(0x21, nibble(1)));
        assert_eq!(clash, Some(Clash::RxFrames(StandardId::ZERO.into())));
        assert!(damiao(0x11, nibble(1)).clash(&damiao(0x12, None)).is_some());
    }

    #[test]
    fn guards_exclude_each_other_only_by_a_bit_that_counts_for_both() {
        let guard = |byte, mask, value| Guard { byte, mask, value };
        for (ours, theirs, is_excluded) in [
            (guard(0, 0x0F, 1), guard(0, 0x0F, 2), true),
            (guard(0, 0x0F, 1), guard(1, 0x0F, 2), false),
            (guard(0, 0x0F, 0x01), guard(0, 0xF0, 0x10), false),
            (guard(0, 0x0F, 0x01), guard(0, 0x0F, 0x11), false),
        ] {
            assert_eq!(ours.excludes(theirs), is_excluded, "{ours:?} {theirs:?}");
        }
        let frame = CanFrame::data_frame(StandardId::ZERO, &[0x31]).unwrap();
        assert!(guard(0, 0x0F, 0xF1).passes(&frame) && !guard(0, 0x0F, 2).passes(&frame));
        assert!(!guard(1, 0, 0).passes(&frame));
    }

    #[test]
    fn a_command_that_a_device_takes_for_its_own_is_a_clash_both_ways() {
        let obeys = CanIds::new().listens_to(exact(0x300));
        let commanded = CanIds::new().transmits(command(0x300, Ownership::Whole));
        let heard = CanIds::new().receives(feedback(0x300, None));
        let id = StandardId::new(0x300).unwrap().into();
        for (ours, theirs) in [(&obeys, &commanded), (&obeys, &heard), (&commanded, &heard)] {
            assert_eq!(ours.clash(theirs), Some(Clash::Confuses(id)));
            assert_eq!(theirs.clash(ours), Some(Clash::Confuses(id)));
        }
    }

    /// Known when it is compiled.
    #[test]
    fn a_clash_of_constants_is_a_constant() {
        const fn motor(raw: u16) -> CanIds {
            CanIds::new().receives(Frames::new(IdPattern::standard(raw), 8, Rate::Hz(1000)))
        }
        const CLASH: Option<Clash> = motor(0x201).clash(&motor(0x201));
        const _: () = assert!(motor(0x201).clash(&motor(0x202)).is_none());
        assert_eq!(CLASH, Some(Clash::RxFrames(StandardId::new(0x201).unwrap().into())));
    }

    #[test]
    fn lanes_share_a_frame_unless_their_bytes_overlap() {
        let wired = |ownership| CanIds::new().transmits(command(0x200, ownership));
        let lane = |bytes| wired(Ownership::Bytes(bytes));
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
            let register = Frames { len: 4 + value % 2, ..command(0x7FF, Ownership::Guard(guard)) };
            CanIds::new().transmits(register)
        };
        assert_eq!(asked(0x11).clash(&asked(0x12)), None);
        let id = StandardId::new(0x7FF).unwrap().into();
        assert_eq!(asked(0x11).clash(&asked(0x11)), Some(Clash::TxFrames(id)));
        let lane = CanIds::new().transmits(command(0x7FF, Ownership::Bytes(1)));
        assert_eq!(asked(0x11).clash(&lane), Some(Clash::TxFrames(id)));
    }

    #[test]
    fn a_device_that_obeys_a_low_byte_clashes_with_feedback_that_ends_in_it() {
        let low_byte = IdPattern::exact(StandardId::new(0x001).unwrap()).under(0xFF);
        let damiao = CanIds::new().listens_to(low_byte);
        let dji = CanIds::new().receives(feedback(0x201, None));
        let id = StandardId::new(0x201).unwrap().into();
        assert_eq!(damiao.clash(&dji), Some(Clash::Confuses(id)));
        assert_eq!(dji.clash(&damiao), Some(Clash::Confuses(id)));
    }

    #[test]
    fn the_link_timeout_is_three_periods_or_ten_milliseconds() {
        let at = |rate| {
            let receive = Frames { rate, ..feedback(0x201, None) };
            CanIds::new().receives(receive).link_timeout().get()
        };
        assert_eq!(at(Rate::EveryTick), 10_000);
        assert_eq!(at(Rate::Hz(125)), 24_000);
        assert_eq!(at(Rate::Hz(50)), 60_000);
    }

    #[test]
    fn more_than_fits_is_never_an_empty_claim() {
        let mut ids = CanIds::new();
        for raw in 0..8 {
            ids = ids.receives(feedback(raw, None)).transmits(command(raw, Ownership::Whole));
        }
        ids = ids.listens_to(exact(8)).listens_to(exact(9));
        assert!(ids.is_complete());
        assert!(!ids.receives(feedback(8, None)).is_complete());
        assert!(!ids.transmits(command(8, Ownership::Whole)).is_complete());
        assert!(!ids.listens_to(exact(10)).is_complete());
        assert_eq!(ids.receives(feedback(8, None)).received().len(), 8);
    }
}
