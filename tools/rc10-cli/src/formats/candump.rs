//! candump logs: what can-utils and python-can write, line by line.
//!
//! | form | a line of it |
//! |---|---|
//! | file (`candump -l`, python-can) | `(1732150000.000150) can0 201#000100080BB81E00`, perhaps with ` R` or ` T` |
//! | console (`candump`) | `  can0  201   [8]  00 01 00 08 0B B8 1E 00`, perhaps with a time before and ASCII behind |
//!
//! Standard identifiers have three hex digits, extended ones eight. A remote request is `201#R8`
//! or `[8]  remote request`. Empty lines, and lines that start with `#`, say nothing.
//!
//! Source: can-utils, `lib.h` (log format) and `candump.c` (console format); python-can,
//! `CanutilsLogWriter` (direction).

use std::fmt;
use std::io::{self, BufRead, Read};

use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_time::Micros;

/// Longest line in bytes; the rest of a longer one is not kept.
const LONGEST_LINE: usize = 1000;

/// Set in the identifier of an error frame (linux/can.h, `CAN_ERR_FLAG`).
const ERROR_FLAG: u32 = 0x2000_0000;

/// One frame of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CandumpLine<'t> {
    /// Time of the frame, if the line has one; with `candump -td` the time since the line before.
    pub at: Option<Micros>,
    /// Interface of the frame, such as `can0`.
    pub channel: &'t str,
    /// The frame that was on the wire.
    pub frame: CanFrame,
    /// Direction of the frame, as seen by the machine that wrote the log, if the line has one.
    pub direction: Option<Direction>,
}

/// Direction of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Into the machine that wrote the log.
    Received,
    /// Out of it.
    Sent,
}

// Why a line cannot be read.
const NOT_A_FRAME: &str = "not a frame: neither \"(1.000150) can0 201#00\" nor \"can0 201 [1] 00\"";
const TIME: &str = "the time is not in seconds, as candump -l, -ta and -tz write it";
const ID_DIGITS: &str = "an identifier has 3 hex digits, or 8 if it is an extended one";
const REMOTE_LENGTH: &str = "the length of a remote request is one digit, 0 to 8";
const TRAILING: &str = "something that does not belong there follows the frame";
const FLEXIBLE_DATA_RATE: &str = "CAN FD and CAN XL frames cannot be read";
const ERROR_FRAME: &str = "an error frame: the controller reports a bus error";

/// Reads one line, without or with its end; `None` if it says nothing: empty, or a comment. Fails
/// if the line is in neither form, or has an invalid part: with the reason, in words.
///
/// ```
/// use rc10_cli::formats::candump::parse;
/// let line = parse("(1732150000.000150) can0 201#000100080BB81E00 R")?.unwrap();
/// assert_eq!(line.at.unwrap().get(), 1_732_150_000_000_150);
/// assert_eq!((line.channel, line.frame.raw_id()), ("can0", 0x201));
/// assert_eq!(parse("  can0  201   [2]  00 01")?.unwrap().frame.bytes(), [0, 1]);
/// # Ok::<(), String>(())
/// ```
pub fn parse(text: &str) -> Result<Option<CandumpLine<'_>>, String> {
    let mut rest = text.trim();
    if rest.is_empty() || rest.starts_with('#') {
        return Ok(None);
    }
    let mut at = None;
    if let Some(time) = rest.strip_prefix('(') {
        let (time, behind) = time.split_once(')').ok_or(TIME)?;
        (at, rest) = (Some(micros(time).ok_or(TIME)?), behind);
    }
    let channel = word(&mut rest).ok_or(NOT_A_FRAME)?;
    if channel.contains('#') {
        return Err("no interface, such as can0, stands before the frame".into());
    }
    let mut identifier = word(&mut rest).ok_or(NOT_A_FRAME)?;
    let mut direction = None;
    // `candump -x` writes "RX - -" or "TX - -" here: the two flags are those of CAN FD.
    if let "RX" | "TX" = identifier {
        direction = direction_of(&identifier[..1]);
        let _flags = (word(&mut rest), word(&mut rest));
        identifier = word(&mut rest).ok_or(NOT_A_FRAME)?;
    }
    let frame = match identifier.split_once('#') {
        None => console_frame(identifier, rest)?,
        Some((identifier, data)) => {
            let frame = file_frame(identifier, data)?;
            if let Some(letter) = word(&mut rest) {
                direction = Some(direction_of(letter).ok_or(TRAILING)?);
            }
            if !rest.trim().is_empty() {
                return Err(TRAILING.into());
            }
            frame
        }
    };
    Ok(Some(CandumpLine { at, channel, frame, direction }))
}

fn word<'t>(rest: &mut &'t str) -> Option<&'t str> {
    let text = rest.trim_start();
    let end = text.find(char::is_whitespace).unwrap_or(text.len());
    let (word, behind) = text.split_at(end);
    *rest = behind;
    (!word.is_empty()).then_some(word)
}

fn direction_of(letter: &str) -> Option<Direction> {
    match letter {
        "R" => Some(Direction::Received),
        "T" => Some(Direction::Sent),
        _ => None,
    }
}

/// Reads decimal seconds exactly; digits after the sixth are cut off.
fn micros(text: &str) -> Option<Micros> {
    let (seconds, fraction) = text.split_once('.').unwrap_or((text, "0"));
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(seconds) || !digits(fraction) {
        return None;
    }
    format!("{seconds}{fraction:0<6.6}").parse().ok().map(Micros::new)
}

/// Reads `201` `000100080BB81E00`, or `201` `R8`.
fn file_frame(identifier: &str, data: &str) -> Result<CanFrame, String> {
    if data.starts_with('#') {
        return Err(FLEXIBLE_DATA_RATE.into());
    }
    let id = id(identifier)?;
    if let Some(len) = data.strip_prefix('R') {
        return remote(id, if len.is_empty() { "0" } else { len });
    }
    let mut bytes = Vec::new();
    add(&mut bytes, data)?;
    data_frame(id, &bytes)
}

/// Reads `201` `[8]  00 01 00 08 0B B8 1E 00`, or `201` `[8]  remote request`.
fn console_frame(identifier: &str, mut rest: &str) -> Result<CanFrame, String> {
    let announced = word(&mut rest)
        .and_then(|len| len.strip_prefix('[')?.strip_suffix(']'))
        .filter(|len| !len.is_empty() && len.bytes().all(|byte| byte.is_ascii_digit()))
        .ok_or(NOT_A_FRAME)?;
    // Classic frames are written with one digit, CAN FD with two, CAN XL with four.
    if announced.len() > 1 {
        return Err(FLEXIBLE_DATA_RATE.into());
    }
    let id = id(identifier)?;
    let mut rest = rest.trim();
    if rest.ends_with("ERRORFRAME") {
        return Err(ERROR_FRAME.into());
    }
    if rest == "remote request" {
        return remote(id, announced);
    }
    let announced = usize::from(announced.as_bytes()[0] - b'0');
    let mut bytes = Vec::new();
    while !rest.is_empty() && !rest.starts_with('\'') {
        let Some(byte) = word(&mut rest) else { break };
        add(&mut bytes, byte)?;
        rest = rest.trim_start();
    }
    // Behind the bytes, `candump -a` writes them once more as characters, in quotes.
    if !rest.is_empty() && (rest.len() < 2 || !rest.ends_with('\'')) {
        return Err(TRAILING.into());
    }
    let found = bytes.len();
    if found != announced {
        return Err(format!("{announced} data bytes announced, but {found} found"));
    }
    data_frame(id, &bytes)
}

fn id(text: &str) -> Result<Id, String> {
    // `from_str_radix` alone would take a sign.
    if !text.bytes().all(|byte| byte.is_ascii_hexdigit()) || !matches!(text.len(), 3 | 8) {
        return Err(ID_DIGITS.into());
    }
    let raw = u32::from_str_radix(text, 16).map_err(|_| ID_DIGITS)?;
    let id = if text.len() == 3 {
        u16::try_from(raw).ok().and_then(StandardId::new).map(Id::Standard)
    } else if raw & !(ERROR_FLAG - 1) == ERROR_FLAG {
        return Err(ERROR_FRAME.into());
    } else {
        ExtendedId::new(raw).map(Id::Extended)
    };
    id.ok_or_else(|| {
        format!("identifier {raw:X} is out of range: standard ends at 7FF, extended at 1FFFFFFF")
    })
}

fn remote(id: Id, len: &str) -> Result<CanFrame, String> {
    let frame = match len.as_bytes() {
        [digit @ b'0'..=b'8'] => CanFrame::remote_frame(id, usize::from(digit - b'0')).ok(),
        _ => None,
    };
    frame.ok_or_else(|| REMOTE_LENGTH.into())
}

fn data_frame(id: Id, bytes: &[u8]) -> Result<CanFrame, String> {
    CanFrame::data_frame(id, bytes).map_err(|error| error.to_string())
}

/// Reads data bytes.
fn add(bytes: &mut Vec<u8>, text: &str) -> Result<(), String> {
    if let Some(character) = text.chars().find(|character| !character.is_ascii_hexdigit()) {
        return Err(format!("{character:?} is no hex digit"));
    }
    if !text.len().is_multiple_of(2) {
        return Err(format!("odd number of hex digits in the data: {}", text.len()));
    }
    let pairs = (0..text.len()).step_by(2).map(|start| &text[start..start + 2]);
    bytes.extend(pairs.filter_map(|pair| u8::from_str_radix(pair, 16).ok()));
    Ok(())
}

/// Reads a log line by line, keeping one line at a time.
pub struct Reader<R> {
    source: R,
    bytes: Vec<u8>,
    text: String,
    number: u64,
}

/// A line of a log, read or not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Numbered<'t> {
    /// The number of the line, counted from 1.
    pub number: u64,
    /// The text of the line, or its beginning if it is too long, with bad bytes replaced.
    pub text: &'t str,
    /// The frame of the line, or the error in it; `None` for a line without a frame.
    pub line: Result<Option<CandumpLine<'t>>, String>,
}

impl<R: BufRead> Reader<R> {
    /// Creates a reader from the start of `source`.
    pub const fn new(source: R) -> Self {
        Self { source, bytes: Vec::new(), text: String::new(), number: 0 }
    }

    /// Reads the next line; `None` at the end. Fails if the source does, not for a broken line.
    pub fn next_line(&mut self) -> io::Result<Option<Numbered<'_>>> {
        self.bytes.clear();
        let limit = LONGEST_LINE as u64 + 1;
        if (&mut self.source).take(limit).read_until(b'\n', &mut self.bytes)? == 0 {
            return Ok(None);
        }
        self.number += 1;
        let too_long = self.bytes.len() > LONGEST_LINE && !self.bytes.ends_with(b"\n");
        if too_long {
            self.source.skip_until(b'\n')?;
        }
        let lossy = String::from_utf8_lossy(&self.bytes);
        // Some editors put a byte order mark before the first line.
        let is_first = self.number == 1;
        let text = lossy.trim_start_matches(|letter| is_first && letter == '\u{FEFF}');
        text.clone_into(&mut self.text);
        let line = if too_long {
            Err(format!("it is longer than {LONGEST_LINE} bytes"))
        } else if std::str::from_utf8(&self.bytes).is_err() {
            Err("it is not UTF-8 text".into())
        } else {
            parse(&self.text)
        };
        Ok(Some(Numbered { number: self.number, text: self.text.trim_end(), line }))
    }
}

/// Writes a frame as a line in the file form; fails only if `out` does, so never for a `String`.
pub fn write_line(
    out: &mut impl fmt::Write,
    at: Micros,
    channel: &str,
    frame: &CanFrame,
) -> fmt::Result {
    write!(out, "({}) {channel} ", SecondsOf(at))?;
    let Some(&bytes) = frame.all_eight() else { return writeln!(out, "{frame}") };
    // One number is written faster than eight.
    let (digits, bytes) = (if frame.is_extended_id() { 8 } else { 3 }, u64::from_be_bytes(bytes));
    writeln!(out, "{:0digits$X}#{bytes:016X}", frame.raw_id())
}

/// A time as in a log, `1732150000.000150`, with every digit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SecondsOf(pub Micros);

impl fmt::Display for SecondsOf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:010}.{:06}", self.0.get() / 1_000_000, self.0.get() % 1_000_000)
    }
}

#[cfg(test)]
mod tests {
    use rc10_can::FrameTooLong;

    use super::*;

    fn frame(text: &str) -> String {
        parse(text).unwrap().unwrap().frame.to_string()
    }

    fn error(text: &str) -> String {
        parse(text).unwrap_err()
    }

    #[test]
    fn reads_the_file_form_with_and_without_a_direction() {
        let line = parse("(1732150000.000150) can0 201#000100080BB81E00").unwrap().unwrap();
        assert_eq!(line.at, Some(Micros::new(1_732_150_000_000_150)));
        assert_eq!((line.channel, line.direction), ("can0", None));
        assert_eq!(line.frame.to_string(), "201#000100080BB81E00");
        let way = |text| parse(text).unwrap().unwrap().direction;
        assert_eq!(way("(1.5) can0 201#00 R"), Some(Direction::Received));
        assert_eq!(way("(1.5) can0 201#00 T\r\n"), Some(Direction::Sent));
        assert_eq!(frame("(1.5) vcan12 00000301#5208"), "00000301#5208");
        assert_eq!(frame("(1.5) can0 1fffffff#ab"), "1FFFFFFF#AB");
        assert_eq!(frame("(1.5) can0 7FF#"), "7FF#");
        assert_eq!(frame("(1.5) can0 201#R"), "201#R0");
        assert_eq!(frame("(1.5) can0 00000201#R8"), "00000201#R8");
    }

    #[test]
    fn reads_the_console_form_with_all_it_can_have() {
        assert_eq!(frame("  can0  201   [8]  00 01 00 08 0B B8 1E 00\r\n"), "201#000100080BB81E00");
        assert_eq!(frame("  can0  00000301   [2]  52 08"), "00000301#5208");
        assert_eq!(frame("  can0  201   [0]"), "201#");
        assert_eq!(frame("  can0  201   [8]  remote request"), "201#R8");
        assert_eq!(frame("  can0  201   [3]  41 20 27                   'A ''"), "201#412027");
        let line = parse(" (000.000150)  can1  TX - -  200   [1]  7F").unwrap().unwrap();
        assert_eq!((line.at, line.channel), (Some(Micros::new(150)), "can1"));
        assert_eq!((line.direction, line.frame.raw_id()), (Some(Direction::Sent), 0x200));
    }

    #[test]
    fn times_are_exact_to_the_microsecond() {
        let at = |text: &str| micros(text).map(Micros::get);
        assert_eq!(at("1732150000.999999"), Some(1_732_150_000_999_999));
        // A double has no room for these digits.
        assert_eq!(at("9007199254740.993001"), Some(9_007_199_254_740_993_001));
        assert_eq!(at("0.5"), Some(500_000));
        assert_eq!(at("1.000001999"), Some(1_000_001));
        assert_eq!(at("7"), Some(7_000_000));
        for wrong in ["", ".", "1.", ".1", "-1.0", "+1.0", "1e3", "nan", "1.-5", "18446744073710.0"]
        {
            assert_eq!(at(wrong), None, "{wrong}");
        }
        assert_eq!(error("(2024-11-21 00:46:40.000150) can0 201#00"), TIME);
        assert_eq!(error("(1.0 can0 201#00"), TIME);
    }

    #[test]
    fn says_what_is_wrong_with_a_line() {
        assert_eq!(error("hello"), NOT_A_FRAME);
        assert_eq!(error("hello there, motor"), NOT_A_FRAME);
        assert_eq!(error("(1.0)"), NOT_A_FRAME);
        assert_eq!(error("(1.0) can0"), NOT_A_FRAME);
        assert!(error("(1.0) 201#00").starts_with("no interface, such as can0,"));
        assert_eq!(error("(1.0) can0 2001#00"), ID_DIGITS);
        assert_eq!(error("(1.0) can0 #00"), ID_DIGITS);
        assert_eq!(error("(1.0) can0 +12#00"), ID_DIGITS);
        assert_eq!(
            error("(1.0) can0 800#00"),
            "identifier 800 is out of range: standard ends at 7FF, extended at 1FFFFFFF"
        );
        assert_eq!(
            error("(1.0) can0 80000000#00"),
            "identifier 80000000 is out of range: standard ends at 7FF, extended at 1FFFFFFF"
        );
        assert_eq!(error("(1.0) can0 20000004#0000000000000000"), ERROR_FRAME);
        assert_eq!(error("(1.0) can0 201#0"), "odd number of hex digits in the data: 1");
        assert_eq!(error("(1.0) can0 201#0G"), "'G' is no hex digit");
        assert_eq!(error("(1.0) can0 201#é0"), "'é' is no hex digit");
        assert_eq!(error("(1.0) can0 201#001122334455667788"), FrameTooLong { len: 9 }.to_string());
        assert_eq!(error("(1.0) can0 201##10011"), FLEXIBLE_DATA_RATE);
        assert_eq!(error("(1.0) can0 201#R9"), REMOTE_LENGTH);
        assert_eq!(error("(1.0) can0 201#00 X"), TRAILING);
        assert_eq!(error("(1.0) can0 201#00 R R"), TRAILING);
        assert_eq!(error("can0 201 [12] 00"), FLEXIBLE_DATA_RATE);
        assert_eq!(error("can0 201 [08] 00"), FLEXIBLE_DATA_RATE);
        assert_eq!(
            error("can0 201 [9] 00 00 00 00 00 00 00 00 00"),
            FrameTooLong { len: 9 }.to_string()
        );
        let short = "8 data bytes announced, but 2 found";
        assert_eq!(error("can0 201 [8] 00 01"), short);
        assert_eq!(error("can0 201 [1] 0"), "odd number of hex digits in the data: 1");
        assert_eq!(error("can0 201 [1] 00 'x"), TRAILING);
        assert_eq!(error("can0 201 [9] remote request"), REMOTE_LENGTH);
        assert_eq!(error("can0 201 [] 00"), NOT_A_FRAME);
        let report = "can0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME";
        assert_eq!(error(report), ERROR_FRAME);
    }

    #[test]
    fn empty_lines_and_comments_say_nothing() {
        for text in ["", " \r\n", "# can0 201#00", "\t#"] {
            assert_eq!(parse(text), Ok(None));
        }
    }

    #[test]
    fn the_reader_goes_on_behind_lines_it_cannot_read() {
        let mut log = b"\xEF\xBB\xBF(1.0) can0 201#01\r\n\xFF\xFE\n".to_vec();
        log.extend(std::iter::repeat_n(b'0', 100_000));
        log.extend(b"\n\n# end\n(2.0) can0 202#02");
        let mut reader = Reader::new(io::Cursor::new(log));
        let mut seen = Vec::new();
        while let Some(Numbered { number, text, line }) = reader.next_line().unwrap() {
            assert!(text.len() <= LONGEST_LINE + 1);
            seen.push((number, line.map(|line| line.map(|line| line.frame.raw_id()))));
        }
        let expected = [
            (1, Ok(Some(0x201))),
            (2, Err("it is not UTF-8 text".into())),
            (3, Err("it is longer than 1000 bytes".into())),
            (4, Ok(None)),
            (5, Ok(None)),
            (6, Ok(Some(0x202))),
        ];
        assert_eq!(seen, expected);
    }

    /// Knuth's MMIX generator: the tests need variety, not quality.
    struct Numbers(u64);

    impl Numbers {
        fn below(&mut self, end: u64) -> u64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (self.0 >> 16) % end
        }

        fn byte(&mut self) -> u8 {
            u8::try_from(self.below(256)).unwrap()
        }

        fn frame(&mut self) -> CanFrame {
            let id = if self.below(2) == 0 {
                Id::Standard(StandardId::new(u16::try_from(self.below(0x800)).unwrap()).unwrap())
            } else {
                let raw = u32::try_from(self.below(0x2000_0000)).unwrap();
                Id::Extended(ExtendedId::new(raw).unwrap())
            };
            let len = usize::try_from(self.below(9)).unwrap();
            if self.below(4) == 0 {
                return CanFrame::remote_frame(id, len).unwrap();
            }
            let data: Vec<u8> = (0..len).map(|_| self.byte()).collect();
            CanFrame::data_frame(id, &data).unwrap()
        }
    }

    /// Writes a frame as candump prints it on a console.
    fn console(at: Micros, channel: &str, frame: &CanFrame) -> String {
        let text = frame.to_string();
        let id = text.split('#').next().unwrap();
        let data: String = frame.bytes().iter().map(|byte| format!(" {byte:02X}")).collect();
        let data = if frame.is_remote() { " remote request" } else { &data };
        format!(" ({})  {channel}  {id}   [{}] {data}", SecondsOf(at), frame.len())
    }

    #[test]
    fn what_is_written_is_read_back() {
        let mut numbers = Numbers(1);
        for _ in 0..5000 {
            let (at, frame) = (Micros::new(numbers.below(1 << 48)), numbers.frame());
            let expected = CandumpLine { at: Some(at), channel: "can2", frame, direction: None };
            let mut file = String::new();
            write_line(&mut file, at, "can2", &frame).unwrap();
            assert_eq!(parse(&file), Ok(Some(expected)), "{file}");
            let console = console(at, "can2", &frame);
            assert_eq!(parse(&console), Ok(Some(expected)), "{console}");
        }
    }

    #[test]
    fn lines_with_damage_are_read_or_refused_but_never_panic() {
        let mut numbers = Numbers(2);
        for _ in 0..20_000 {
            let frame = numbers.frame();
            let mut line = console(Micros::new(150), "can0", &frame);
            if numbers.below(2) == 0 {
                line.clear();
                write_line(&mut line, Micros::new(150), "can0", &frame).unwrap();
            }
            let mut line = line.into_bytes();
            for _ in 0..=numbers.below(3) {
                let place = usize::try_from(numbers.below(line.len() as u64)).unwrap();
                match numbers.below(3) {
                    0 => line[place] = numbers.byte(),
                    1 => line.truncate(place + 1),
                    _ => line.insert(place, b" #[]()'RT0"[usize::from(numbers.byte() % 10)]),
                }
            }
            let mut reader = Reader::new(line.as_slice());
            while let Some(numbered) = reader.next_line().unwrap() {
                if let Ok(Some(line)) = numbered.line {
                    assert!(line.frame.len() <= 8);
                }
            }
        }
    }

    #[test]
    fn a_small_time_is_written_with_ten_digits_like_candump() {
        let mut line = String::new();
        let frame = CanFrame::data_frame(StandardId::ZERO, &[1]).unwrap();
        write_line(&mut line, Micros::new(1_000_150), "can0", &frame).unwrap();
        assert_eq!(line, "(0000000001.000150) can0 000#01\n");
    }
}
