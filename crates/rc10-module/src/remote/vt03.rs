use heapless::Vec;

use super::channels::eleven_bits;
use super::{Keys, Mouse, Remote, Stick, Switch, dbus};
use crate::sum::crc;
use crate::{Found, Protocol};

/// The remote's protocol of a DJI VT03 or VT13 video link: 21 bytes, 921,600 baud 8N1.
///
/// A frame has A9 53, a mode that exists and its checksum; others (A5, referee) are passed over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Vt03;

/// One frame of a VT03.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Vt03Frame {
    /// 364 ..= 1684, middle 1024: right x, y, and the left two, on whose order sources disagree.
    pub channels: [u16; 4],
    /// The switch in the middle of the remote: cine (C) is down, normal (N) middle, sport (S) up.
    pub mode: Switch,
    /// The pause button is pressed.
    pub pause: bool,
    /// The button on the left that is free for use, fn1.
    pub left_button: bool,
    /// The one on the right, fn2.
    pub right_button: bool,
    /// The wheel, like a channel.
    pub wheel: u16,
    /// The trigger is pulled.
    pub trigger: bool,
    /// The mouse's counts since the frame before: x, y, wheel.
    pub mouse_motion: [i16; 3],
    /// The mouse's buttons, left, right, middle: two bits each, 0 if not pressed.
    pub mouse_buttons: [u8; 3],
    /// Keys, in the order of [`Keys`].
    pub keys: u16,
}

const HEADER: [u8; 2] = [0xA9, 0x53];
const LENGTH: usize = 21;

impl Protocol for Vt03 {
    type Message = Vt03Frame;
    type Buffer = Vec<u8, LENGTH>;

    fn examine(&self, bytes: &[u8]) -> Found<Vt03Frame> {
        if !bytes.iter().zip(HEADER).all(|(&byte, header)| byte == header) {
            return Found::Nothing;
        }
        let Some([checked @ .., low, high]) = bytes.first_chunk::<LENGTH>() else {
            return Found::More(if bytes.len() < HEADER.len() { HEADER.len() } else { LENGTH });
        };
        if crc(checked) != u16::from_le_bytes([*low, *high]) {
            return Found::Damaged;
        }
        Vt03Frame::unpack(checked).map_or(Found::Damaged, |frame| Found::Frame(LENGTH, frame))
    }
}

impl Vt03Frame {
    fn unpack(checked: &[u8; LENGTH - 2]) -> Option<Self> {
        let [_, _, sticks @ .., x0, x1, y0, y1, z0, z1, buttons, k0, k1] = checked;
        let [_, _, _, _, _, b5, b6, b7] = sticks;
        let flag = |byte: &u8, bit: u32| byte >> bit & 1 != 0;
        Some(Self {
            channels: eleven_bits(sticks),
            mode: match b5 >> 4 & 3 {
                0 => Switch::Down,
                1 => Switch::Middle,
                2 => Switch::Up,
                _ => return None,
            },
            pause: flag(b5, 6),
            left_button: flag(b5, 7),
            right_button: flag(b6, 0),
            wheel: u16::from_le_bytes([*b6, *b7]) >> 1 & 0x7FF,
            trigger: flag(b7, 4),
            mouse_motion: [[*x0, *x1], [*y0, *y1], [*z0, *z1]].map(i16::from_le_bytes),
            mouse_buttons: [buttons & 3, buttons >> 2 & 3, buttons >> 4 & 3],
            keys: u16::from_le_bytes([*k0, *k1]),
        })
    }

    /// The state of the remote. It has one switch, so buttons take the other's part:
    ///
    /// | here | is |
    /// |---|---|
    /// | `right_switch` | C down, N in the middle, S up |
    /// | `left_switch` | down while the pause button is pressed, else up while the left button (fn1) is, else in the middle |
    /// | `left` | y from channel 2, x from channel 3 |
    /// | keys 16, 17, 18, 19 | pause, left button, right button, trigger |
    pub fn remote(&self) -> Remote {
        let [right_x, right_y, left_y, left_x] = self.channels.map(|raw| dbus::TRAVEL.share(raw));
        let [left, right, middle] = self.mouse_buttons.map(|pressed| pressed != 0);
        let [pause, left_button, right_button, trigger] =
            [self.pause, self.left_button, self.right_button, self.trigger].map(u32::from);
        let buttons = pause | left_button << 1 | right_button << 2 | trigger << 3;
        Remote {
            left: Stick { x: left_x, y: left_y },
            right: Stick { x: right_x, y: right_y },
            left_switch: match (self.pause, self.left_button) {
                (true, _) => Switch::Down,
                (false, true) => Switch::Up,
                (false, false) => Switch::Middle,
            },
            right_switch: self.mode,
            dial: dbus::TRAVEL.share(self.wheel),
            mouse: Mouse { motion: self.mouse_motion, left, right, middle },
            keys: Keys(u32::from(self.keys) | buttons << 16),
            ..Remote::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(bits: u64, rest: [u8; 9]) -> [u8; LENGTH] {
        let mut frame = [0; LENGTH];
        frame[..2].copy_from_slice(&HEADER);
        frame[2..10].copy_from_slice(&bits.to_le_bytes());
        frame[10..19].copy_from_slice(&rest);
        let crc = crc(&frame[..19]);
        frame[19..].copy_from_slice(&crc.to_le_bytes());
        frame
    }

    fn remote(bits: u64) -> Remote {
        match Vt03.examine(&frame(bits, [0; 9])) {
            Found::Frame(LENGTH, frame) => frame.remote(),
            other => panic!("{other:?}"),
        }
    }

    const CENTRED: u64 = 1024 | 1024 << 11 | 1024 << 22 | 1024 << 33 | 1 << 44 | 1024 << 49;

    #[test]
    fn every_field_lies_where_it_should() {
        let bits = 364 | 1684 << 11 | 700 << 22 | 1300 << 33 | 2 << 44 | 1 << 47 | 1684 << 49;
        let bytes = frame(bits | 1 << 60, [1, 0, 0xFE, 0xFF, 0, 0x80, 0b01_0001, 0x05, 0x80]);
        let Found::Frame(LENGTH, frame) = Vt03.examine(&bytes) else { panic!() };
        assert_eq!(frame.channels, [364, 1684, 700, 1300]);
        assert_eq!((frame.mouse_motion, frame.mouse_buttons), ([1, -2, i16::MIN], [1, 0, 1]));
        let remote = frame.remote();
        assert_eq!((remote.right.x, remote.right.y, remote.dial), (-1.0, 1.0, 1.0));
        assert!(remote.left.y < -0.4 && remote.left.x > 0.4);
        assert_eq!((remote.right_switch, remote.left_switch), (Switch::Up, Switch::Up));
        assert_eq!(remote.keys, Keys(0x8005 | 1 << 17 | 1 << 19));
        assert!(remote.mouse.left && !remote.mouse.right && remote.mouse.middle);
    }

    #[test]
    fn buttons_are_the_second_switch() {
        assert_eq!(remote(CENTRED), Remote::default());
        let switches = |bits| (remote(bits).right_switch, remote(bits).left_switch);
        use Switch::{Down, Middle, Up};
        assert_eq!(switches(CENTRED ^ 1 << 44), (Down, Middle));
        assert_eq!(switches(CENTRED ^ 3 << 44), (Up, Middle));
        assert_eq!(switches(CENTRED | 1 << 46), (Middle, Down));
        assert_eq!(switches(CENTRED | 1 << 47), (Middle, Up));
        assert_eq!(switches(CENTRED | 3 << 46), (Middle, Down));
        let keys = |bits| remote(CENTRED | bits).keys.0 >> 16;
        assert_eq!([46, 47, 48, 60].map(|bit| keys(1 << bit)), [1, 2, 4, 8]);
    }

    #[test]
    fn what_is_not_sound_is_refused() {
        let bytes = frame(CENTRED, [0; 9]);
        for bit in 0..8 * LENGTH {
            let mut bytes = bytes;
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(matches!(Vt03.examine(&bytes), Found::Damaged | Found::Nothing), "bit {bit}");
        }
        assert_eq!(Vt03.examine(&frame(CENTRED | 3 << 44, [0; 9])), Found::Damaged);
        assert_eq!(Vt03.examine(&bytes[..1]), Found::More(2));
        assert_eq!(Vt03.examine(&bytes[..2]), Found::More(LENGTH));
        assert_eq!(Vt03.examine(&[0xA9, 0xA9]), Found::Nothing);
    }
}
