use heapless::Vec;
use rc10_time::Micros;

use super::channels::eleven_bits;
use super::{Keys, Mouse, Remote, Stick, Switch, Travel};
use crate::{Found, Pause, Protocol};

/// The protocol of a DJI DR16: 18 bytes about every 14 ms, 100 kbaud 8E1, inverted.
///
/// No header, no checksum, only pauses. A frame has four channels within 700 of 1024, switches and
/// mouse buttons in positions that exist, the wheel 0 (older remotes) or within 700 of 1024; and
/// only whole frames may come between two pauses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dbus;

/// One frame of a DR16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DbusFrame {
    /// Right x, y, left x, y: 364 ..= 1684, middle 1024; without calibration 324 ..= 1724.
    pub channels: [u16; 4],
    /// The switch on the right.
    pub right_switch: Switch,
    /// The switch on the left.
    pub left_switch: Switch,
    /// The mouse of the computer that the remote is plugged into.
    pub mouse: Mouse,
    /// The computer's keys, in the order of [`Keys`].
    pub keys: u16,
    /// The wheel, like a channel; 0 without a wheel.
    pub wheel: u16,
}

/// Bytes of a frame (DR16 manual).
const LENGTH: usize = 18;
/// Frames that a late reader may find at once.
const BURST: usize = 4;
/// Longer than a frame (2 ms, every 14 or 7), for drivers that hand bytes over when idle.
const PAUSE: Micros = Micros::from_millis(3);
/// Largest distance from the middle (DJI's C-board examples, `RC_CHANNAL_ERROR_VALUE`).
const FURTHEST: u16 = 700;
const MIDDLE: u16 = 1024;
/// The sticks' ends (DR16 manual).
pub(super) const TRAVEL: Travel = Travel { low: 364, middle: MIDDLE, high: 1684 };

impl Protocol for Dbus {
    type Message = DbusFrame;
    type Buffer = Vec<u8, { LENGTH * BURST }>;

    const PAUSE: Option<Pause> = Some(Pause::Delimits(PAUSE));

    fn examine(&self, bytes: &[u8]) -> Found<DbusFrame> {
        match bytes.first_chunk() {
            None => Found::More(LENGTH),
            Some(frame) => {
                DbusFrame::unpack(frame).map_or(Found::Damaged, |frame| Found::Frame(LENGTH, frame))
            }
        }
    }
}

impl DbusFrame {
    fn unpack(frame: &[u8; LENGTH]) -> Option<Self> {
        let [sticks @ .., x0, x1, y0, y1, z0, z1, left, right, k0, k1, w0, w1] = *frame;
        let [.., switches] = sticks;
        let channels = eleven_bits(&sticks);
        let wheel = u16::from_le_bytes([w0, w1]);
        let is_sound = |value: u16| value.abs_diff(MIDDLE) <= FURTHEST;
        if !channels.into_iter().all(is_sound) || !(wheel == 0 || is_sound(wheel)) {
            return None;
        }
        Some(Self {
            channels,
            right_switch: switch(switches >> 4 & 3)?,
            left_switch: switch(switches >> 6)?,
            mouse: Mouse {
                motion: [[x0, x1], [y0, y1], [z0, z1]].map(i16::from_le_bytes),
                left: flag(left)?,
                right: flag(right)?,
                middle: false,
            },
            keys: u16::from_le_bytes([k0, k1]),
            wheel,
        })
    }

    /// The state of the remote.
    pub fn remote(&self) -> Remote {
        let [right_x, right_y, left_x, left_y] = self.channels.map(|raw| TRAVEL.share(raw));
        Remote {
            left: Stick { x: left_x, y: left_y },
            right: Stick { x: right_x, y: right_y },
            left_switch: self.left_switch,
            right_switch: self.right_switch,
            dial: if self.wheel == 0 { 0.0 } else { TRAVEL.share(self.wheel) },
            mouse: self.mouse,
            keys: Keys(self.keys.into()),
            ..Remote::default()
        }
    }
}

/// DR16 manual, table of switches; 0 does not exist.
const fn switch(raw: u8) -> Option<Switch> {
    match raw {
        1 => Some(Switch::Up),
        2 => Some(Switch::Down),
        3 => Some(Switch::Middle),
        _ => None,
    }
}

const fn flag(raw: u8) -> Option<bool> {
    match raw {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stream;

    /// Sticks in the middle, both switches in the middle, a wheel in the middle.
    const CENTRED: [u8; LENGTH] =
        [0x00, 0x04, 0x20, 0x00, 0x01, 0xF8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x00, 0x04];

    fn found(bytes: &[u8]) -> Option<DbusFrame> {
        match Dbus.examine(bytes) {
            Found::Frame(LENGTH, frame) => Some(frame),
            _ => None,
        }
    }

    #[test]
    fn every_field_lies_where_the_manual_says() {
        let frame = found(&CENTRED).unwrap();
        assert_eq!(frame.channels, [MIDDLE; 4]);
        assert_eq!(frame.remote(), Remote::default());
        // 364 + 1684 << 11 + 1024 << 22 + 724 << 33, right down, left up.
        let sticks: u64 = 364 | 1684 << 11 | 1024 << 22 | 724 << 33 | 2 << 44 | 1 << 46;
        let mut bytes = CENTRED;
        bytes[..6].copy_from_slice(&sticks.to_le_bytes()[..6]);
        bytes[6..].copy_from_slice(&[1, 0, 0xFE, 0xFF, 0, 0x80, 1, 0, 0x05, 0x80, 0x94, 0x06]);
        let frame = found(&bytes).unwrap();
        assert_eq!(frame.channels, [364, 1684, 1024, 724]);
        assert_eq!(frame.mouse.motion, [1, -2, i16::MIN]);
        let remote = frame.remote();
        assert_eq!((remote.right.x, remote.right.y, remote.left.x), (-1.0, 1.0, 0.0));
        assert!(remote.left.y < -0.4 && remote.left.y > -0.5, "{}", remote.left.y);
        assert_eq!((remote.right_switch, remote.left_switch), (Switch::Down, Switch::Up));
        assert_eq!((remote.keys, remote.dial, remote.failsafe), (Keys(0x8005), 1.0, false));
        assert!(remote.mouse.left && !remote.mouse.right && !remote.mouse.middle);
    }

    #[test]
    fn what_no_remote_sends_is_refused() {
        let spoilt = |index: usize, value: u8| {
            let mut bytes = CENTRED;
            bytes[index] = value;
            found(&bytes)
        };
        assert_eq!(spoilt(0, 0xFF).map(|frame| frame.channels[0]), Some(1279));
        // Channel 0 at 2047, no right switch, no left switch, two on a button, a wheel at 300.
        let mut bytes = CENTRED;
        [bytes[0], bytes[1]] = [0xFF, 0x07];
        assert_eq!(found(&bytes), None);
        for (index, value) in [(5, 0xC8), (5, 0x38), (12, 2), (13, 0xFF), (17, 0x01), (17, 0x07)] {
            assert_eq!(spoilt(index, value), None, "byte {index}: {value}");
        }
        // The last that is taken, and the first that is not.
        for (raw, is_taken) in [(324_u16, true), (323, false), (1724, true), (1725, false)] {
            let mut bytes = CENTRED;
            [bytes[16], bytes[17]] = raw.to_le_bytes();
            assert_eq!(found(&bytes).is_some(), is_taken, "{raw}");
        }
        let no_wheel = spoilt(17, 0).unwrap();
        assert_eq!((no_wheel.wheel, no_wheel.remote().dial), (0, 0.0));
        assert_eq!(Dbus.examine(&CENTRED[..17]), Found::More(LENGTH));
    }

    /// A line with a reader that looks when it likes.
    struct Line {
        stream: Stream<Dbus>,
        at: u64,
        heard: usize,
    }

    impl Line {
        fn new() -> Self {
            Self { stream: Stream::new(Dbus), at: 0, heard: 0 }
        }

        fn read(&mut self, bytes: &[u8]) -> &mut Self {
            self.stream.receive(bytes, Micros::new(self.at), |_| self.heard += 1);
            self
        }

        /// A pause of this length, which the reader sees.
        fn pause(&mut self, micros: u64) -> &mut Self {
            self.at += micros;
            self.read(&[])
        }

        fn heard(&mut self) -> usize {
            core::mem::take(&mut self.heard)
        }
    }

    #[test]
    fn a_frame_is_believed_when_the_line_has_been_silent() {
        let mut line = Line::new();
        for byte in CENTRED {
            line.read(&[byte]).at += 110;
        }
        line.at -= 110;
        assert_eq!(line.pause(2999).heard(), 0);
        assert_eq!(line.pause(1).heard(), 1);
        assert_eq!(line.pause(9000).heard(), 0);
        let counters = line.stream.counters();
        assert_eq!((counters.frames, counters.damaged, counters.skipped), (1, 0, 0));
    }

    #[test]
    fn a_late_reader_gets_all_frames_and_no_false_one() {
        let mut line = Line::new();
        // Two in one read; then one in pieces, with nothing seen of the pause between them.
        line.read(&[CENTRED, CENTRED].concat()).at += 20_000;
        line.read(&CENTRED[..10]).at += 20_000;
        line.read(&CENTRED[10..]);
        assert_eq!(line.pause(3000).heard(), 3);
        // More than it can keep: all of it is lost, and what follows is good again.
        line.read(&CENTRED.repeat(5));
        assert_eq!(line.pause(3000).heard(), 0);
        assert_eq!(line.stream.counters().skipped, 90);
        // Also what came behind it, before the line was silent: where it begins is not known.
        line.read(&CENTRED.repeat(4)).read(&CENTRED[..1]).read(&CENTRED);
        assert_eq!(line.pause(3000).heard(), 0);
        assert_eq!(line.read(&CENTRED).pause(3000).heard(), 1);
    }

    #[test]
    fn nothing_is_believed_that_something_else_is_glued_to() {
        for (before, after) in [(1, 0), (0, 1), (17, 0), (0, 17), (9, 8)] {
            let mut line = Line::new();
            let burst = [&[0x0F; 17][..before], &CENTRED, &[0; 17][..after]].concat();
            assert_eq!(line.read(&burst).pause(3000).heard(), 0, "{before} {after}");
            assert_eq!(line.stream.counters().damaged, 1);
            assert_eq!(line.read(&CENTRED).pause(3000).heard(), 1);
        }
        // A whole burst of the right length, of which one frame is wrong.
        let mut line = Line::new();
        let burst = [CENTRED, [0; LENGTH], CENTRED].concat();
        assert_eq!(line.read(&burst).pause(3000).heard(), 0);
    }

    #[test]
    fn what_lost_a_byte_ends_with_the_next_pause() {
        let mut line = Line::new();
        line.read(&CENTRED[..7]).stream.interrupt();
        // The rest and the next frame make 18 + 10 bytes; then 8 more: whole frames, by their number.
        line.read(&CENTRED[8..]).read(&CENTRED[..8]).read(&CENTRED);
        assert_eq!(line.pause(2999).heard(), 0);
        assert_eq!(line.pause(1).heard(), 0);
        assert_eq!(line.read(&CENTRED).pause(3000).heard(), 1);
        let counters = line.stream.counters();
        assert_eq!((counters.port_errors, counters.frames), (1, 1));
        assert_eq!(counters.skipped, 7 + 10 + 8 + 18);
        // An error while a frame waits to be believed: it is dropped.
        line.read(&CENTRED).stream.interrupt();
        assert_eq!(line.pause(3000).heard() + line.pause(3000).heard(), 0);
    }
}
