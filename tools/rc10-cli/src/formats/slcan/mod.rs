//! slcan: CAN frames as lines of ASCII, as serial adapters, python-can, `SavvyCAN` and Linux'
//! `slcand` use them.
//!
//! | line | what it says | answer |
//! |---|---|---|
//! | `O`, `L`, `C` | open the channel, open it to listen only, close it | `\r` |
//! | `S0` .. `S8` | bit rate: 10, 20, 50, 100, 125, 250, 500, 800, 1000 kbit/s | `\r` |
//! | `tiiil..`, `Tiiiiiiiil..` | send a data frame: standard, extended; `l` bytes follow | `\r` |
//! | `riiil`, `Riiiiiiiil` | send a remote request for `l` bytes | `\r` |
//! | `V`, `N` | version, serial number | `Vhhss\r`, `Nxxxx\r` |
//! | `F` | status flags since the last `F`, in hex | `Fxx\r` |
//! | `Z0`, `Z1` | received frames without, with a time: milliseconds modulo 60,000, in hex | `\r` |
//! | | nothing: ends whatever was on the line | `\r` |
//!
//! A line ends with `\r`. Received frames have the same form as sent ones. A line that is invalid
//! or cannot be done is answered with a bell (7) and changes nothing.
//!
//! Source: Lawicel, CANUSB manual 1.0D, and python-can's `slcan` interface. More tolerant than the
//! manual: the channel may be opened or closed twice, time stamps switched while it is open, and
//! without `S` the bit rate is the bus's; bit 31 of an extended identifier is ignored. Missing: `s`
//! (bit timing registers), `M`, `m` (filters), `P`, `A`, `X` (polling).

pub(crate) mod adapter;
pub(crate) mod host;
#[cfg(all(feature = "socketcan", target_os = "linux"))]
pub mod socket;

use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};

pub use crate::formats::slcan::adapter::{Adapter, Channel, Counts, Flow};

/// End of a line; also the answer to a command that was done.
pub const DONE: u8 = b'\r';
/// Answer to a command that is invalid or was refused.
pub const BELL: u8 = 7;

/// Bit that `SavvyCAN` sets in the identifiers of extended frames; it is ignored.
const EXTENDED: u32 = 1 << 31;

/// Longest line: an extended data frame of eight bytes, with its time.
const LONGEST_LINE: usize = 30;

/// A command of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlcanCommand {
    /// An empty line.
    Nothing,
    /// Opens the channel, opens it to listen only, or closes it.
    Switch(Channel),
    /// Sets the bit rate, 0 ..= 8.
    BitRate(u8),
    /// Sends a frame.
    Send(CanFrame),
    /// Asks for hardware and software version.
    Version,
    /// Asks for the serial number.
    SerialNumber,
    /// Asks for the status flags.
    Status,
    /// Switches the times of received frames on or off.
    Times(bool),
}

/// A line that is no command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed;

/// Reads one line, without its end; [`Malformed`] if it differs from the table above in any digit.
///
/// ```
/// use rc10_cli::formats::slcan::{SlcanCommand, Malformed, parse};
/// let Ok(SlcanCommand::Send(frame)) = parse(b"t20121A2b") else { panic!() };
/// assert_eq!(frame.to_string(), "201#1A2B");
/// assert_eq!(parse(b"t20121A2"), Err(Malformed));
/// ```
pub fn parse(line: &[u8]) -> Result<SlcanCommand, Malformed> {
    let command = match line {
        [] => SlcanCommand::Nothing,
        b"O" => SlcanCommand::Switch(Channel::Open),
        b"L" => SlcanCommand::Switch(Channel::Listening),
        b"C" => SlcanCommand::Switch(Channel::Closed),
        b"V" => SlcanCommand::Version,
        b"N" => SlcanCommand::SerialNumber,
        b"F" => SlcanCommand::Status,
        b"Z0" => SlcanCommand::Times(false),
        b"Z1" => SlcanCommand::Times(true),
        [b'S', rate @ b'0'..=b'8'] => SlcanCommand::BitRate(rate - b'0'),
        _ => SlcanCommand::Send(frame(line).ok_or(Malformed)?),
    };
    Ok(command)
}

fn frame(line: &[u8]) -> Option<CanFrame> {
    let (&letter, rest) = line.split_first()?;
    let is_extended = letter.is_ascii_uppercase();
    let (id, rest) = rest.split_at_checked(if is_extended { 8 } else { 3 })?;
    let id: Id = match letter {
        b't' | b'r' => StandardId::new(hex(id)? as u16)?.into(),
        b'T' | b'R' => ExtendedId::new(hex(id)? & !EXTENDED)?.into(),
        _ => return None,
    };
    let (&len @ b'0'..=b'8', digits) = rest.split_first()? else { return None };
    let len = usize::from(len - b'0');
    if matches!(letter, b'r' | b'R') {
        return CanFrame::remote_frame(id, len).ok().filter(|_| digits.is_empty());
    }
    let data: Vec<u8> =
        digits.chunks(2).map(|pair| Some(hex(pair)? as u8)).collect::<Option<_>>()?;
    CanFrame::data_frame(id, &data).ok().filter(|_| digits.len() == 2 * len)
}

fn hex(digits: &[u8]) -> Option<u32> {
    let digit = |byte: u8| char::from(byte).to_digit(16);
    digits.iter().try_fold(0, |value, &byte| Some(value << 4 | digit(byte)?))
}

/// Writes a frame as a line with its end, and with the time `millis` if given.
pub fn write_frame(out: &mut Vec<u8>, frame: &CanFrame, millis: Option<u16>) {
    let letter = match (frame.is_extended_id(), frame.is_remote()) {
        (false, false) => 't',
        (true, false) => 'T',
        (false, true) => 'r',
        (true, true) => 'R',
    };
    let (id, digits) = (frame.raw_id(), if frame.is_extended_id() { 8 } else { 3 });
    let mut line = format!("{letter}{id:0digits$X}{:X}", frame.len());
    for byte in frame.bytes() {
        line += &format!("{byte:02X}");
    }
    if let Some(millis) = millis {
        line += &format!("{millis:04X}");
    }
    out.extend(line.into_bytes());
    out.push(DONE);
}

/// Cuts a stream of bytes into lines.
#[derive(Debug, Default)]
pub struct Lines {
    line: Vec<u8>,
    is_too_long: bool,
}

impl Lines {
    /// The commands of the lines that end within `bytes`. Line feeds, which some terminals send,
    /// are ignored.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<Result<SlcanCommand, Malformed>> {
        let mut commands = Vec::new();
        for &byte in bytes {
            match byte {
                DONE => {
                    let command = if self.is_too_long { Err(Malformed) } else { parse(&self.line) };
                    commands.push(command);
                    self.line.clear();
                    self.is_too_long = false;
                }
                b'\n' => (),
                _ if self.line.len() < LONGEST_LINE => self.line.push(byte),
                _ => self.is_too_long = true,
            }
        }
        commands
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::formats::candump;

    fn frame_of(candump: &str) -> CanFrame {
        candump::parse(&format!("(0.0) can0 {candump}")).unwrap().unwrap().frame
    }

    /// The forms of the manual's own examples, and both ends of every number.
    const FRAMES: [(&str, &str); 9] = [
        ("100#", "t1000\r"),
        ("7FF#1122", "t7FF21122\r"),
        ("201#000100080BB81E00", "t2018000100080BB81E00\r"),
        ("00000000#", "T000000000\r"),
        ("1FFFFFFF#FF", "T1FFFFFFF1FF\r"),
        ("00000201#DEADBEEF", "T000002014DEADBEEF\r"),
        ("7FF#R0", "r7FF0\r"),
        ("123#R8", "r1238\r"),
        ("1234ABCD#R3", "R1234ABCD3\r"),
    ];

    #[test]
    fn frames_have_the_form_of_the_manual_both_ways() {
        for (candump, line) in FRAMES {
            let frame = frame_of(candump);
            let mut out = Vec::new();
            write_frame(&mut out, &frame, None);
            assert_eq!(String::from_utf8_lossy(&out), line);
            assert_eq!(Lines::default().take(&out), [Ok(SlcanCommand::Send(frame))]);
            let lower: Vec<u8> = [&out[..1], &out[1..].to_ascii_lowercase()].concat();
            assert_eq!(Lines::default().take(&lower), [Ok(SlcanCommand::Send(frame))]);
        }
        let savvy = frame_of("12345678#01");
        assert_eq!(parse(b"T92345678101"), Ok(SlcanCommand::Send(savvy)));
        let mut out = Vec::new();
        write_frame(&mut out, &frame_of("201#01"), Some(59_999));
        assert_eq!(out, b"t201101EA5F\r");
    }

    #[test]
    fn a_line_is_understood_to_the_last_digit_or_not_at_all() {
        for line in [
            "t",
            "t2",
            "t201",
            "t2019",
            "t80000",
            "t20121A2",
            "t20121A2B3",
            "t2011G1",
            "t201/",
            "T20121A2B",
            "T2000000000",
            "r20100",
            "r2019",
            "R0000020",
            "S",
            "S9",
            "S88",
            "s031C",
            "Z",
            "Z2",
            "OO",
            "o",
            "c",
            "C ",
            " C",
            "FF",
            "\x07",
            "t+012",
            "t201:",
            "M00000000",
            "é",
        ] {
            assert_eq!(parse(line.as_bytes()), Err(Malformed), "{line:?}");
        }
    }

    #[test]
    fn every_command_is_understood() {
        let text = b"\rC\rS8\rS0\rO\rL\rV\rN\rF\rZ0\rZ1\r\r\n";
        let commands: Vec<_> =
            Lines::default().take(text).into_iter().map(Result::unwrap).collect();
        use SlcanCommand::*;
        let expected = [
            Nothing,
            Switch(Channel::Closed),
            BitRate(8),
            BitRate(0),
            Switch(Channel::Open),
            Switch(Channel::Listening),
            Version,
            SerialNumber,
            Status,
            Times(false),
            Times(true),
            Nothing,
        ];
        assert_eq!(commands, expected);
    }

    #[test]
    fn a_line_of_any_length_is_one_bell_and_takes_no_room() {
        let mut lines = Lines::default();
        assert_eq!(lines.take(&[b'0'; 100_000]), []);
        assert_eq!(lines.take(b"\rO\r"), [Err(Malformed), Ok(SlcanCommand::Switch(Channel::Open))]);
        assert!(lines.line.capacity() < 100);
    }

    fn any_frame() -> impl Strategy<Value = CanFrame> {
        let id = prop_oneof![
            (0..=0x7FF_u16).prop_map(|raw| Id::from(StandardId::new(raw).unwrap())),
            (0..=0x1FFF_FFFF_u32).prop_map(|raw| Id::from(ExtendedId::new(raw).unwrap())),
        ];
        (id, any::<[u8; 8]>(), 0..=8_usize, any::<bool>()).prop_map(|(id, data, len, remote)| {
            if remote {
                CanFrame::remote_frame(id, len).unwrap()
            } else {
                CanFrame::data_frame(id, &data[..len]).unwrap()
            }
        })
    }

    proptest! {
        /// What candump writes of a frame and what slcan writes of it is one frame.
        #[test]
        fn frames_come_back_as_they_were(frame in any_frame(), millis in 0..60_000_u16) {
            let mut line = Vec::new();
            write_frame(&mut line, &frame_of(&frame.to_string()), None);
            prop_assert_eq!(Lines::default().take(&line), [Ok(SlcanCommand::Send(frame))]);
            let mut timed = Vec::new();
            write_frame(&mut timed, &frame, Some(millis));
            prop_assert!(timed.len() <= LONGEST_LINE + 1);
            let (same, time) = timed.split_at(line.len() - 1);
            prop_assert_eq!(same, &line[..line.len() - 1]);
            prop_assert_eq!(String::from_utf8_lossy(time), format!("{millis:04X}\r"));
        }

        /// However the bytes come in pieces, and whatever stands between two frames.
        #[test]
        fn the_next_good_line_is_found(
            frames in vec((any_frame(), vec(any::<u8>(), 0..40)), 0..8),
            pieces in vec(1..60_usize, 1..50),
        ) {
            let mut text = Vec::new();
            for (frame, garbage) in &frames {
                text.extend(garbage);
                text.push(DONE);
                write_frame(&mut text, frame, None);
            }
            let whole = Lines::default().take(&text);
            // Garbage may be a command of its own: behind it stands the frame, whatever it was.
            let good = |commands: &[_]| {
                let frames = frames.iter().map(|(frame, _)| Ok(SlcanCommand::Send(*frame)));
                let mut wanted = frames.peekable();
                for command in commands {
                    wanted.next_if_eq(command);
                }
                wanted.peek().is_none()
            };
            prop_assert!(good(&whole), "{:?}", whole);
            let ends = text.iter().filter(|&&byte| byte == DONE).count();
            prop_assert_eq!(whole.len(), ends);
            let (mut lines, mut rest, mut cut) = (Lines::default(), &text[..], Vec::new());
            for length in pieces.into_iter().cycle() {
                let (piece, behind) = rest.split_at(length.min(rest.len()));
                cut.extend(lines.take(piece));
                rest = behind;
                if rest.is_empty() {
                    break;
                }
            }
            prop_assert_eq!(cut, whole);
        }
    }
}
