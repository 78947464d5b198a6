use rc10_module::remote::{self, Switch, Vt03Frame};

use super::super::wire::{Guard, Source, Wire, bits, crc_reflected, numbers, set_bits, word};

/// DJI VT03 and VT13: 921,600 baud 8N1, 21 bytes.
#[derive(Clone, Copy, Debug)]
pub struct Vt03;

const LENGTH: usize = 21;
/// From bit 16 on: four channels, mode, pause, two buttons, wheel, trigger; how wide each is.
const WIDTHS: [usize; 10] = [11, 11, 11, 11, 2, 1, 1, 1, 11, 1];

fn crc(bytes: &[u8]) -> u16 {
    crc_reflected(bytes, 0xFFFF, 0x8408)
}

impl Wire for Vt03 {
    type Protocol = remote::Vt03;

    const BYTE_NS: u64 = 10_851;
    const HEADER: &'static [u8] = &[0xA9, 0x53];
    const GUARD: Guard = Guard::Checksum { not_over: &[] };

    fn protocol(self) -> remote::Vt03 {
        remote::Vt03
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let mut frame = vec![0; LENGTH - 2];
        frame[..2].copy_from_slice(&[0xA9, 0x53]);
        let mut at = 16;
        for width in WIDTHS {
            // There are three modes.
            let most = if width == 2 { 2 } else { (1 << width) - 1 };
            set_bits(&mut frame, at, width, source.between(0, most));
            at += width;
        }
        frame[10..].copy_from_slice(&source.bytes::<9>());
        frame[16] &= 0x3F;
        let crc = crc(&frame);
        frame.extend(crc.to_le_bytes());
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let frame = bytes.get(..LENGTH)?;
        let good = frame.starts_with(&[0xA9, 0x53])
            && crc(&frame[..LENGTH - 2]) == word(frame, LENGTH - 2)
            && bits(frame, 60, 2) < 3;
        good.then_some(LENGTH)
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let mut at = 16;
        let fields = WIDTHS.map(|width| {
            at += width;
            bits(frame, at - width, width)
        });
        let motion = [10, 12, 14].map(|at| word(frame, at));
        let buttons = [128, 130, 132].map(|at| bits(frame, at, 2));
        Some(numbers(&[&fields, &motion, &buttons, &[word(frame, 17)]]))
    }

    fn told(self, message: &Vt03Frame) -> Vec<f64> {
        let mode = match message.mode {
            Switch::Down => 0,
            Switch::Middle => 1,
            Switch::Up => 2,
        };
        let buttons = [message.pause, message.left_button, message.right_button].map(u16::from);
        let trigger = u16::from(message.trigger);
        let motion = message.mouse_motion.map(i16::cast_unsigned);
        let pressed = message.mouse_buttons.map(u16::from);
        numbers(&[
            &message.channels,
            &[mode],
            &buttons,
            &[message.wheel, trigger],
            &motion,
            &pressed,
            &[message.keys],
        ])
    }
}
