/// The low byte of the sum of some bytes: the checksum of many a small device.
#[inline]
pub(crate) fn sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

#[cfg(test)]
mod tests {
    #[test]
    fn only_the_low_byte_counts() {
        assert_eq!(super::sum(&[]), 0);
        assert_eq!(super::sum(&[0xFF, 0x02, 0x10]), 0x11);
    }
}
