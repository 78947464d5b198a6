/// A CRC of 16 bits with the polynomial 0x1021, the lowest bit first.
pub(crate) fn crc16(start: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(start, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte), |crc, _| {
            (crc >> 1) ^ if crc & 1 == 0 { 0 } else { 0x8408 }
        })
    })
}

/// A CRC of 8 bits with the polynomial 0x31, the lowest bit first.
pub(crate) fn crc8(start: u8, bytes: &[u8]) -> u8 {
    bytes.iter().fold(start, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| (crc >> 1) ^ if crc & 1 == 0 { 0 } else { 0x8C })
    })
}
