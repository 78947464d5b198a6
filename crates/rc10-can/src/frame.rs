use core::fmt;

use embedded_can::{ExtendedId, Frame, Id, StandardId};

/// A classic CAN 2.0 frame: 11 or 29 bit identifier, 0 ..= 8 data bytes, or a remote request.
///
/// 16 bytes, `Copy`. Bytes past the length are always zero.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CanFrame {
    /// Identifier, with [`EXTENDED`] and [`REMOTE`] on top: one word to compare and to hash.
    key: u32,
    /// Data length code, with [`NO_DATA`] on top of a remote request's: one comparison for eight.
    len: u8,
    data: [u8; 8],
}

const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const NO_DATA: u8 = 1 << 7;

/// More than eight data bytes were asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a classic CAN frame carries at most 8 data bytes, not {len}")]
pub struct FrameTooLong {
    /// The number of bytes asked for.
    pub len: usize,
}

impl CanFrame {
    /// A data frame.
    ///
    /// # Errors
    /// [`FrameTooLong`] if `data` has more than 8 bytes.
    ///
    /// ```
    /// use rc10_can::{CanFrame, embedded_can::StandardId};
    /// let id = StandardId::new(0x200).unwrap();
    /// let frame = CanFrame::data_frame(id, &[0x12, 0x34])?;
    /// assert_eq!(frame.to_string(), "200#1234");
    /// # Ok::<(), rc10_can::FrameTooLong>(())
    /// ```
    pub fn data_frame(id: impl Into<Id>, data: &[u8]) -> Result<Self, FrameTooLong> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len()).ok_or(FrameTooLong { len: data.len() })?.copy_from_slice(data);
        #[expect(clippy::cast_possible_truncation, reason = "at most 8, checked above")]
        Ok(Self { key: Self::key_of(id), len: data.len() as u8, data: bytes })
    }

    /// A data frame of exactly eight bytes: cannot fail.
    #[inline]
    #[must_use]
    pub fn eight_bytes(id: impl Into<Id>, data: [u8; 8]) -> Self {
        Self { key: Self::key_of(id), len: 8, data }
    }

    /// A data frame whose length is known: more than eight bytes do not compile.
    ///
    /// ```
    /// use rc10_can::{CanFrame, embedded_can::StandardId};
    /// let frame = CanFrame::exact(StandardId::new(0x211).unwrap(), [0x0A, 0xD7, 0x23, 0x3C]);
    /// assert_eq!(frame.to_string(), "211#0AD7233C");
    /// ```
    #[inline]
    #[must_use]
    pub fn exact<const LEN: usize>(id: impl Into<Id>, data: [u8; LEN]) -> Self {
        const { assert!(LEN <= 8, "a classic CAN frame carries at most 8 data bytes") };
        let mut bytes = [0; 8];
        bytes[..LEN].copy_from_slice(&data);
        #[expect(clippy::cast_possible_truncation, reason = "at most 8, checked above")]
        Self { key: Self::key_of(id), len: LEN as u8, data: bytes }
    }

    /// A remote request for `len` bytes.
    ///
    /// # Errors
    /// [`FrameTooLong`] if `len` is more than 8.
    pub fn remote_frame(id: impl Into<Id>, len: usize) -> Result<Self, FrameTooLong> {
        match u8::try_from(len) {
            Ok(short) if short <= 8 => {
                let len = short | NO_DATA;
                Ok(Self { key: Self::key_of(id) | REMOTE, len, data: [0; 8] })
            }
            _ => Err(FrameTooLong { len }),
        }
    }

    /// The identifier.
    #[inline]
    #[must_use]
    pub fn id(&self) -> Id {
        let raw = self.raw_id();
        if self.key & EXTENDED == 0 {
            #[expect(clippy::cast_possible_truncation, reason = "a standard id has 11 bits")]
            Id::Standard(StandardId::new(raw as u16).unwrap_or(StandardId::ZERO))
        } else {
            Id::Extended(ExtendedId::new(raw).unwrap_or(ExtendedId::ZERO))
        }
    }

    /// The identifier as a number, without telling standard from extended.
    #[inline]
    #[must_use]
    pub const fn raw_id(&self) -> u32 {
        self.key & !(EXTENDED | REMOTE)
    }

    /// Whether the identifier is an extended one (29 bit).
    #[inline]
    #[must_use]
    pub const fn is_extended_id(&self) -> bool {
        self.key & EXTENDED != 0
    }

    /// Whether this is a remote request: such a frame has a length, but no data.
    #[inline]
    #[must_use]
    pub const fn is_remote(&self) -> bool {
        self.key & REMOTE != 0
    }

    /// One word of identifier, size and remote flag, for tables; not in arbitration order.
    #[inline]
    #[must_use]
    pub const fn key(&self) -> u32 {
        self.key
    }

    /// The [`key`](Self::key) of data frames that carry `id`.
    #[inline]
    #[must_use]
    pub fn key_of(id: impl Into<Id>) -> u32 {
        match id.into() {
            Id::Standard(id) => u32::from(id.as_raw()),
            Id::Extended(id) => id.as_raw() | EXTENDED,
        }
    }

    /// Number of data bytes (of bytes asked for, if this is a remote request), 0 ..= 8.
    #[expect(clippy::len_without_is_empty, reason = "a frame without data is still a frame")]
    #[inline]
    #[must_use]
    pub const fn len(&self) -> usize {
        (self.len & !NO_DATA) as usize
    }

    /// The data bytes, byte 0 first; empty for a remote request.
    #[inline]
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        let len = if self.is_remote() { 0 } else { self.len() };
        // `min` lets the compiler drop the bounds check.
        &self.data[..len.min(8)]
    }

    /// All eight bytes if this is a data frame of length eight, else `None`.
    #[inline]
    #[must_use]
    pub const fn all_eight(&self) -> Option<&[u8; 8]> {
        if self.len == 8 { Some(&self.data) } else { None }
    }

    /// All eight bytes, to be changed, if this is a data frame of length eight, else `None`.
    #[inline]
    pub const fn all_eight_mut(&mut self) -> Option<&mut [u8; 8]> {
        if self.len == 8 { Some(&mut self.data) } else { None }
    }
}

impl Frame for CanFrame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        Self::data_frame(id, data).ok()
    }
    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        Self::remote_frame(id, dlc).ok()
    }
    fn is_extended(&self) -> bool {
        self.is_extended_id()
    }
    fn is_remote_frame(&self) -> bool {
        self.is_remote()
    }
    fn id(&self) -> Id {
        Self::id(self)
    }
    fn dlc(&self) -> usize {
        self.len()
    }
    fn data(&self) -> &[u8] {
        self.bytes()
    }
}

/// The notation of candump: `201#0001F4`, `00000301#52`, `201#R8`.
impl fmt::Display for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_extended_id() {
            write!(f, "{:08X}#", self.raw_id())?;
        } else {
            write!(f, "{:03X}#", self.raw_id())?;
        }
        if self.is_remote() {
            return write!(f, "R{}", self.len());
        }
        self.bytes().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CanFrame({self})")
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for CanFrame {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{:X}#{=[u8]:02X}", self.raw_id(), self.bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::string::ToString;

    fn standard(raw: u16) -> StandardId {
        StandardId::new(raw).unwrap()
    }

    #[test]
    fn nine_bytes_are_an_error_and_eight_are_not() {
        let id = standard(1);
        assert_eq!(CanFrame::data_frame(id, &[0; 9]), Err(FrameTooLong { len: 9 }));
        assert_eq!(CanFrame::data_frame(id, &[1; 8]).unwrap().bytes(), [1; 8]);
        assert_eq!(CanFrame::remote_frame(id, 256), Err(FrameTooLong { len: 256 }));
    }

    #[test]
    fn standard_and_extended_of_one_number_differ() {
        let short = CanFrame::data_frame(standard(0x201), &[]).unwrap();
        let long = CanFrame::data_frame(ExtendedId::new(0x201).unwrap(), &[]).unwrap();
        assert_ne!(short, long);
        assert_ne!(short.key(), long.key());
        assert_eq!(short.raw_id(), long.raw_id());
        assert_eq!(long.id(), Id::Extended(ExtendedId::new(0x201).unwrap()));
    }

    #[test]
    fn a_remote_request_has_a_length_but_no_data() {
        let frame = CanFrame::remote_frame(standard(0x7FF), 8).unwrap();
        assert_eq!((frame.len(), frame.bytes()), (8, &[][..]));
        assert_eq!(frame.all_eight(), None);
        assert_eq!(frame.to_string(), "7FF#R8");
    }

    #[test]
    fn only_a_data_frame_of_eight_bytes_has_all_eight() {
        let mut short = CanFrame::data_frame(standard(1), &[1, 2, 3, 4]).unwrap();
        assert_eq!(short.all_eight_mut(), None);
        let mut whole = CanFrame::eight_bytes(standard(1), [0; 8]);
        whole.all_eight_mut().unwrap()[7] = 9;
        assert_eq!(whole.all_eight(), Some(&[0, 0, 0, 0, 0, 0, 0, 9]));
    }

    #[test]
    fn writes_itself_like_candump() {
        let id = ExtendedId::new(0x301).unwrap();
        let frame = CanFrame::data_frame(id, &[0, 0, 0x52, 8]).unwrap();
        assert_eq!(frame.to_string(), "00000301#00005208");
    }
}
