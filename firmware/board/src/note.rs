//! A note of its board in a program's ELF file, section `.rc10.board`, for tools and emulator.

use crate::board::{CHIP, CRYSTAL, NAME};

/// The section's bytes: name and chip as text that ends in zeros, and the crystal in hertz, the low byte first.
#[repr(C)]
struct Note {
    name: [u8; 16],
    chip: [u8; 16],
    crystal: [u8; 4],
}

/// A text and zeros.
const fn padded(text: &str) -> [u8; 16] {
    let (bytes, mut padded, mut at) = (text.as_bytes(), [0; 16], 0);
    while at < bytes.len() {
        padded[at] = bytes[at];
        at += 1;
    }
    padded
}

#[used]
#[unsafe(link_section = ".rc10.board")]
static NOTE: Note =
    Note { name: padded(NAME), chip: padded(CHIP), crystal: CRYSTAL.hz().to_le_bytes() };
