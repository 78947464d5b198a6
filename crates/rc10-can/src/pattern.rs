use core::fmt;

use embedded_can::{ExtendedId, Id, StandardId};

use crate::CanFrame;

/// Data frames whose identifier bits under `mask` are the pattern's; of one size only.
///
/// ```
/// use rc10_can::IdPattern;
/// // In a constant, too: every identifier of a VESC with number 5.
/// const VESC: IdPattern = IdPattern::extended(0x005).under(0x0FF);
/// assert_eq!(VESC.to_string(), "0x00000005/0xFF");
/// ```
#[derive(Clone, Copy, PartialEq, Eq)]
#[must_use]
pub struct IdPattern {
    // Not an `Id`: a constant cannot look into one.
    raw: u32,
    is_extended: bool,
    mask: u32,
}

/// Standard filters of a controller as `rc10-bsp` sets it up: one for each pattern.
pub const STANDARD_FILTERS: usize = 32;
/// The same for extended identifiers.
pub const EXTENDED_FILTERS: usize = 16;

/// All bits count: an extended identifier has 29.
const EXACT: u32 = 0x1FFF_FFFF;
/// The bits of a standard identifier.
const STANDARD: u32 = 0x7FF;

impl IdPattern {
    /// Just this standard identifier, as a constant; cut off above 11 bits.
    pub const fn standard(raw: u16) -> Self {
        Self { raw: raw as u32 & STANDARD, is_extended: false, mask: EXACT }
    }

    /// Just this extended identifier, as a constant; cut off above 29 bits.
    pub const fn extended(raw: u32) -> Self {
        Self { raw: raw & EXACT, is_extended: true, mask: EXACT }
    }

    /// Just this identifier.
    pub fn exact(id: impl Into<Id>) -> Self {
        match id.into() {
            Id::Standard(id) => Self::standard(id.as_raw()),
            Id::Extended(id) => Self::extended(id.as_raw()),
        }
    }

    /// With only the bits of the identifier that are ones in `mask` counting.
    pub const fn under(mut self, mask: u32) -> Self {
        self.mask = mask & EXACT;
        self
    }

    /// Every standard identifier.
    pub const fn any_standard() -> Self {
        Self::standard(0).under(0)
    }

    /// Every extended identifier.
    pub const fn any_extended() -> Self {
        Self::extended(0).under(0)
    }

    /// The identifier the pattern was made with.
    #[must_use]
    pub const fn id(&self) -> Id {
        #[expect(clippy::cast_possible_truncation, reason = "11 bits")]
        match (self.is_extended, StandardId::new(self.raw as u16), ExtendedId::new(self.raw)) {
            (false, Some(id), _) => Id::Standard(id),
            (true, _, Some(id)) => Id::Extended(id),
            // They have as many bits as they may.
            _ => Id::Standard(StandardId::ZERO),
        }
    }

    /// The number of that identifier.
    #[must_use]
    pub const fn raw(&self) -> u32 {
        self.raw
    }

    /// Whether it is of extended identifiers, with 29 bits.
    #[must_use]
    pub const fn is_extended(&self) -> bool {
        self.is_extended
    }

    /// The bits of the identifier that count.
    #[must_use]
    pub const fn mask(&self) -> u32 {
        self.mask
    }

    /// Bits that exist in an identifier of this size.
    const fn width(&self) -> u32 {
        if self.is_extended { EXACT } else { STANDARD }
    }

    /// Whether the pattern names one identifier only.
    #[must_use]
    pub const fn is_exact(&self) -> bool {
        self.mask & self.width() == self.width()
    }

    /// Whether the identifier belongs to the pattern.
    #[must_use]
    pub fn contains(&self, id: Id) -> bool {
        self.overlap(&Self::exact(id)).is_some()
    }

    /// An identifier that belongs to both patterns, if there is one.
    #[must_use]
    pub const fn overlap(&self, other: &Self) -> Option<Self> {
        let common = self.mask & other.mask & self.width();
        if self.is_extended != other.is_extended || (self.raw ^ other.raw) & common != 0 {
            return None;
        }
        let raw = (self.raw & self.mask) | (other.raw & other.mask & !self.mask);
        Some(Self { raw, is_extended: self.is_extended, mask: EXACT })
    }

    /// Whether a frame belongs to the pattern. A remote request never does.
    #[must_use]
    pub fn matches(&self, frame: &CanFrame) -> bool {
        !frame.is_remote() && self.contains(frame.id())
    }
}

impl fmt::Display for IdPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = if self.is_extended { 8 } else { 3 };
        write!(f, "0x{:0digits$X}", self.raw)?;
        if self.is_exact() { Ok(()) } else { write!(f, "/0x{:X}", self.mask & self.width()) }
    }
}

impl<I: Into<Id>> From<I> for IdPattern {
    fn from(id: I) -> Self {
        Self::exact(id)
    }
}

impl fmt::Debug for IdPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "IdPattern({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standard(raw: u16) -> StandardId {
        StandardId::new(raw).unwrap()
    }

    #[test]
    fn standard_and_extended_never_overlap() {
        let short = IdPattern::any_standard();
        assert_eq!(short.overlap(&IdPattern::any_extended()), None);
        assert!(!short.contains(Id::Extended(ExtendedId::ZERO)));
    }

    #[test]
    fn an_overlap_belongs_to_both() {
        let group = IdPattern::exact(standard(0x200)).under(0x7F0);
        let one = IdPattern::exact(standard(0x205));
        let shared = group.overlap(&one).unwrap();
        assert!(group.contains(shared.id()) && one.contains(shared.id()));
        assert_eq!(group.overlap(&IdPattern::exact(standard(0x210))), None);
    }

    #[test]
    fn a_remote_request_never_matches() {
        let frame = CanFrame::remote_frame(standard(0x205), 8).unwrap();
        assert!(!IdPattern::exact(standard(0x205)).matches(&frame));
    }
}
