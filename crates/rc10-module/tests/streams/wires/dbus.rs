use rc10_module::remote::{self, DbusFrame, Switch};

use super::super::wire::{Guard, Place, Segment, Source, Wire, bits, numbers, set_bits, word};

/// DJI DR16: 100 kbaud 8E1, 18 bytes, no header, no checksum.
#[derive(Clone, Copy, Debug)]
pub struct Dbus;

const LENGTH: usize = 18;
/// Where the four channels and the wheel lie, and how wide they are.
const CHANNELS: [(usize, usize); 5] = [(0, 11), (11, 11), (22, 11), (33, 11), (128, 16)];

impl Wire for Dbus {
    type Protocol = remote::Dbus;

    const BYTE_NS: u64 = 110_000;
    const HEADER: &'static [u8] = &[0x00, 0x04, 0x20];
    const GUARD: Guard = Guard::Shape;
    // A frame of 2 ms every 14 ms, of some every 7.
    const GAP: (u64, u64) = (5_000, 13_000);

    fn protocol(self) -> remote::Dbus {
        remote::Dbus
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let mut frame = vec![0; LENGTH];
        for (at, width) in CHANNELS {
            set_bits(&mut frame, at, width, source.between(364, 1684));
        }
        set_bits(&mut frame, 44, 2, source.between(1, 3));
        set_bits(&mut frame, 46, 2, source.between(1, 3));
        frame[6..12].copy_from_slice(&source.bytes::<6>());
        frame[12] = source.byte() & 1;
        frame[13] = source.byte() & 1;
        frame[14..16].copy_from_slice(&source.bytes::<2>());
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let frame = bytes.get(..LENGTH)?;
        // The vendor's rule, 700 off the middle; a wheel may be missing.
        let near = |(at, width): (usize, usize)| {
            let value = bits(frame, at, width);
            (324..=1724).contains(&value) || at == 128 && value == 0
        };
        let good = CHANNELS.into_iter().all(near)
            && bits(frame, 44, 2) != 0
            && bits(frame, 46, 2) != 0
            && frame[12] <= 1
            && frame[13] <= 1;
        good.then_some(LENGTH)
    }

    /// Silence delimits them.
    fn found(self, heard: &Segment) -> Vec<Place> {
        if heard.after_fault { vec![] } else { heard.whole.clone() }
    }

    /// Each is looked at twice: is everything between two pauses good, and then what it says.
    fn in_frames(self, _: u32, frames: u32) -> u32 {
        frames * LENGTH as u32
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let channels = CHANNELS.map(|(at, width)| bits(frame, at, width));
        let buttons = [frame[12], frame[13]].map(u16::from);
        // 1 up, 2 down, 3 in the middle.
        let switches = [44, 46].map(|at| [0, 1, 3, 2][usize::from(bits(frame, at, 2))]);
        let motion = [6, 8, 10].map(|at| word(frame, at));
        Some(numbers(&[&channels, &buttons, &switches, &motion, &[word(frame, 14)]]))
    }

    fn told(self, message: &DbusFrame) -> Vec<f64> {
        let buttons = [message.mouse.left, message.mouse.right].map(u16::from);
        let switches = [message.right_switch, message.left_switch].map(|position| match position {
            Switch::Up => 1,
            Switch::Middle => 2,
            Switch::Down => 3,
        });
        let motion = message.mouse.motion.map(i16::cast_unsigned);
        let (wheel, keys) = ([message.wheel], [message.keys]);
        numbers(&[&message.channels, &wheel, &buttons, &switches, &motion, &keys])
    }
}
