use core::fmt;

use embedded_can::{ExtendedId, Id, StandardId};

use crate::CanFrame;

/// The data frames of one identifier, or of a family of them: those whose bits under `mask` equal
/// the pattern's. Standard and extended never match each other.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct IdPattern {
    id: Id,
    mask: u32,
}

/// All bits count: an extended identifier has 29.
const EXACT: u32 = 0x1FFF_FFFF;
/// The bits of a standard identifier.
const STANDARD: u32 = 0x7FF;

impl IdPattern {
    /// Just this identifier.
    #[must_use]
    pub fn exact(id: impl Into<Id>) -> Self {
        Self::of(id.into(), EXACT)
    }

    /// As [`exact`](Self::exact) and [`masked`](Self::masked), for constants.
    #[must_use]
    pub const fn of(id: Id, mask: u32) -> Self {
        Self { id, mask: mask & EXACT }
    }

    /// Every identifier of the same size that equals `id` where `mask` has a one.
    #[must_use]
    pub fn masked(id: impl Into<Id>, mask: u32) -> Self {
        Self::of(id.into(), mask)
    }

    /// Every standard identifier.
    #[must_use]
    pub const fn any_standard() -> Self {
        Self { id: Id::Standard(StandardId::ZERO), mask: 0 }
    }

    /// Every extended identifier.
    #[must_use]
    pub const fn any_extended() -> Self {
        Self { id: Id::Extended(ExtendedId::ZERO), mask: 0 }
    }

    /// The identifier the pattern was made with.
    #[must_use]
    pub const fn id(&self) -> Id {
        self.id
    }

    /// The bits of the identifier that count.
    #[must_use]
    pub const fn mask(&self) -> u32 {
        self.mask
    }

    fn raw(&self) -> u32 {
        raw(self.id)
    }

    /// Bits that exist in an identifier of this size.
    const fn width(&self) -> u32 {
        match self.id {
            Id::Standard(_) => STANDARD,
            Id::Extended(_) => EXACT,
        }
    }

    /// Whether the pattern names one identifier only.
    #[must_use]
    pub const fn is_exact(&self) -> bool {
        self.mask & self.width() == self.width()
    }

    /// Whether the identifier belongs to the pattern.
    #[must_use]
    pub fn contains(&self, id: Id) -> bool {
        matches!(self.id, Id::Standard(_)) == matches!(id, Id::Standard(_))
            && (self.raw() ^ raw(id)) & self.mask & self.width() == 0
    }

    /// Whether a frame belongs to the pattern. A remote request never does.
    #[must_use]
    pub fn matches(&self, frame: &CanFrame) -> bool {
        !frame.is_remote() && self.contains(frame.id())
    }

    /// An identifier that belongs to both patterns, if there is one.
    #[must_use]
    pub fn overlap(&self, other: &Self) -> Option<Id> {
        if matches!(self.id, Id::Standard(_)) != matches!(other.id, Id::Standard(_)) {
            return None;
        }
        let common = self.mask & other.mask & self.width();
        if (self.raw() ^ other.raw()) & common != 0 {
            return None;
        }
        let both = (self.raw() & self.mask) | (other.raw() & other.mask & !self.mask);
        Some(match self.id {
            #[expect(clippy::cast_possible_truncation, reason = "masked to 11 bits")]
            Id::Standard(_) => Id::Standard(StandardId::new((both & self.width()) as u16)?),
            Id::Extended(_) => Id::Extended(ExtendedId::new(both & self.width())?),
        })
    }
}

fn raw(id: Id) -> u32 {
    match id {
        Id::Standard(id) => u32::from(id.as_raw()),
        Id::Extended(id) => id.as_raw(),
    }
}

impl fmt::Display for IdPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.id {
            Id::Standard(id) => write!(f, "0x{:03X}", id.as_raw())?,
            Id::Extended(id) => write!(f, "0x{:08X}", id.as_raw())?,
        }
        if self.is_exact() { Ok(()) } else { write!(f, "/0x{:X}", self.mask & self.width()) }
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
        let group = IdPattern::masked(standard(0x200), 0x7F0);
        let one = IdPattern::exact(standard(0x205));
        let shared = group.overlap(&one).unwrap();
        assert!(group.contains(shared) && one.contains(shared));
        assert_eq!(group.overlap(&IdPattern::exact(standard(0x210))), None);
    }

    #[test]
    fn a_remote_request_never_matches() {
        let frame = CanFrame::remote_frame(standard(0x205), 8).unwrap();
        assert!(!IdPattern::exact(standard(0x205)).matches(&frame));
    }
}
