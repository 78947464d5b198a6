/// The low byte of the sum of some bytes: the checksum of many a small device.
#[inline]
pub(crate) fn sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

/// CRC-16/MCRF4XX, of DJI's serial frames: polynomial 1021, reflected, from FFFF.
///
/// Without a table: the taps of x¹⁶ + x¹² + x⁵ + 1 move a byte to three places.
pub(crate) fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |crc: u16, byte| {
        let mixed = (crc ^ u16::from(*byte)) & 0xFF;
        let fed = (mixed ^ mixed << 4) & 0xFF;
        crc >> 8 ^ fed << 8 ^ fed << 3 ^ fed >> 4
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn only_the_low_byte_counts() {
        assert_eq!(super::sum(&[]), 0);
        assert_eq!(super::sum(&[0xFF, 0x02, 0x10]), 0x11);
    }

    #[test]
    fn the_crc_is_that_of_the_catalogue() {
        assert_eq!(super::crc(b"123456789"), 0x6F91);
    }
}
