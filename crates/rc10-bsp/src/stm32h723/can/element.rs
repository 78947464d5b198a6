//! Frames as they lie in the message RAM. Knows no register, so that it can be tested on a PC.

use embedded_can::{ExtendedId, Id, StandardId};
use rc10_can::{CanFrame, embedded_can};

/// Words of an element with eight data bytes: two of header, two of data.
pub const ELEMENT: usize = 4;

// Header bits that receive and transmit elements have in common (RM0468, FDCAN chapter, "Rx FIFO
// element" and "Tx buffer element").
const EXTENDED: u32 = 1 << 30;
const REMOTE: u32 = 1 << 29;
const STANDARD_ID_SHIFT: u32 = 18;
const LENGTH_SHIFT: u32 = 16;

/// A frame as a transmit buffer holds it.
pub fn encode(frame: &CanFrame) -> [u32; ELEMENT] {
    let id = match frame.id() {
        Id::Standard(id) => u32::from(id.as_raw()) << STANDARD_ID_SHIFT,
        Id::Extended(id) => id.as_raw() | EXTENDED,
    };
    let length = u32::try_from(frame.len()).unwrap_or(8);
    let remote = if frame.is_remote() { REMOTE } else { 0 };
    let mut data = [0; 8];
    data[..frame.bytes().len()].copy_from_slice(frame.bytes());
    let [a, b, c, d, e, f, g, h] = data;
    [
        id | remote,
        length << LENGTH_SHIFT,
        u32::from_le_bytes([a, b, c, d]),
        u32::from_le_bytes([e, f, g, h]),
    ]
}

/// The frame of an element of a receive FIFO.
pub fn decode([header, length, low, high]: [u32; ELEMENT]) -> CanFrame {
    let id = if header & EXTENDED == 0 {
        let raw = (header >> STANDARD_ID_SHIFT) & 0x7FF;
        Id::Standard(StandardId::new(raw as u16).unwrap_or(StandardId::ZERO))
    } else {
        let raw = header & 0x1FFF_FFFF;
        Id::Extended(ExtendedId::new(raw).unwrap_or(ExtendedId::ZERO))
    };
    // Lengths 9 ..= 15 are legal on a classic wire and mean 8.
    let len = ((length >> LENGTH_SHIFT) as usize & 0xF).min(8);
    let [a, b, c, d] = low.to_le_bytes();
    let [e, f, g, h] = high.to_le_bytes();
    let data = [a, b, c, d, e, f, g, h];
    let frame = if header & REMOTE != 0 {
        CanFrame::remote_frame(id, len)
    } else {
        CanFrame::data_frame(id, &data[..len])
    };
    // At most eight bytes: there is no error to hide.
    frame.unwrap_or_else(|_| CanFrame::eight_bytes(id, data))
}
