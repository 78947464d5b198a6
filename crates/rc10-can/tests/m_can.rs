//! The layout of frames in the message RAM, word by word (RM0468, FDCAN chapter, "Rx FIFO element"
//! and "Tx buffer element").
#![cfg(test)]

use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, StandardId};
use rc10_can::m_can::{decode, encode, time_stamp};

fn standard(raw: u16) -> StandardId {
    StandardId::new(raw).unwrap()
}

#[test]
fn a_standard_identifier_lies_in_the_upper_bits_and_data_little_endian() {
    let frame = CanFrame::data_frame(standard(0x201), &[1, 2, 3, 4, 5]).unwrap();
    let words = [0x201 << 18, 5 << 16, 0x0403_0201, 0x0000_0005];
    assert_eq!(encode(&frame), words);
    assert_eq!(decode(words), frame);
}

#[test]
fn an_extended_identifier_is_marked_by_bit_30() {
    let id = ExtendedId::new(0x1ABC_DEF0).unwrap();
    let frame = CanFrame::eight_bytes(id, [0xFF; 8]);
    let words = [0x5ABC_DEF0, 8 << 16, u32::MAX, u32::MAX];
    assert_eq!(encode(&frame), words);
    assert_eq!(decode(words), frame);
}

#[test]
fn a_remote_request_is_marked_by_bit_29_and_keeps_its_length() {
    let frame = CanFrame::remote_frame(standard(0x7FF), 3).unwrap();
    let words = [0x3FFC_0000, 3 << 16, 0, 0];
    assert_eq!(encode(&frame), words);
    assert_eq!(decode(words), frame);
    assert_eq!(decode([0x3FFC_0000, 3 << 16, 7, 7]), frame);
}

#[test]
fn what_the_receiver_adds_does_not_end_up_in_the_frame() {
    // Error state indicator; accepted by no filter, filter 127, time stamp; bytes past the length.
    let words = [1 << 31 | 0x201 << 18 | 0x2_AAAA, 0xFF02_FFFF, 0xDDCC_BBAA, 0x9988_7766];
    let frame = CanFrame::data_frame(standard(0x201), &[0xAA, 0xBB]).unwrap();
    // Bits 21 and 20 (FD format, bit rate switch) are zero on a classic bus.
    assert_eq!(decode([words[0], words[1] & !(3 << 20), words[2], words[3]]), frame);
}

#[test]
fn lengths_beyond_eight_mean_eight() {
    for length in 9..16 {
        let frame = decode([0, length << 16, 0x0403_0201, 0x0807_0605]);
        assert_eq!(frame.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }
}

#[test]
fn the_time_stamp_is_the_lower_half_of_the_second_word() {
    assert_eq!(time_stamp([u32::MAX, 0x0008_1234, u32::MAX, u32::MAX]), 0x1234);
}
