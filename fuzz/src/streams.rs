//! Serial protocols: a line that says anything, in any pieces, with silence and faults between them.

use rc10_module::ranging::Range;
use rc10_module::rc10_app::Seconds;
use rc10_module::referee::{Pose, Said, Tally};
use rc10_module::remote::{ChannelMap, CrsfLink, Ppm, Remote};
use rc10_module::{Buffer, Pause, Protocol, Stream};
use rc10_time::Micros;

use super::observed::{Outcome, Piece, hear};
use super::wire::{Source, Wire, said, same, searched};
use super::wires::{
    Action, Crsf, Dbus, Jrt, Rc9, Referee, RmVision, Sbus, Stp23l, TfMini, Vt03, Wit,
};

/// DJI's receiver.
pub fn dbus(bytes: &[u8]) {
    stream(Dbus, bytes, |frame| sane(&frame.remote()));
}

/// Futaba's, and others'.
pub fn sbus(bytes: &[u8]) {
    stream(Sbus, bytes, |frame| frame.remote(&ChannelMap::AETR).iter().for_each(sane));
}

/// `ExpressLRS` and TBS.
pub fn crsf(bytes: &[u8]) {
    let mut link = CrsfLink::new(ChannelMap::AETR);
    stream(Crsf, bytes, |frame| link.hear(frame).iter().for_each(sane));
}

/// DJI's video link.
pub fn vt03(bytes: &[u8]) {
    stream(Vt03, bytes, |frame| sane(&frame.remote()));
}

/// Benewake's range finder.
pub fn tfmini(bytes: &[u8]) {
    stream(TfMini, bytes, |measurement| within(measurement.range(), 10..=12_000));
}

/// Lasers of the JRT type.
pub fn jrt(bytes: &[u8]) {
    stream(Jrt, bytes, |answer| within(answer.range(), 30..=150_000));
}

/// LDROBOT's range finder.
pub fn stp23l(bytes: &[u8]) {
    stream(Stp23l, bytes, |measurement| within(measurement.range(), 30..=7_500));
}

/// WIT's IMUs.
pub fn wit(bytes: &[u8]) {
    stream(Wit, bytes, |_| {});
}

/// ACTION's positioning.
pub fn action(bytes: &[u8]) {
    stream(Action, bytes, |_| {});
}

/// Auto-aim on a PC.
pub fn rm_vision(bytes: &[u8]) {
    stream(RmVision, bytes, |target| {
        let armours = (0..target.armours).map(|it| target.armour(it, Seconds::new(0.1)));
        assert!(armours.flatten().all(|it| !it.is_nan()), "{target:?}");
    });
}

/// RC9's frames.
pub fn rc9(bytes: &[u8]) {
    stream(Rc9, bytes, |_| {});
}

/// `RoboMaster`'s referee system: what is said is finite.
pub fn referee(bytes: &[u8]) {
    let mut tally = Tally::default();
    stream(Referee, bytes, |packet| {
        let numbers = match tally.hear(packet) {
            Said::Pose(Pose { x, y, angle }) => [x, y, angle],
            Said::Shot(shot) => [shot.speed; 3],
            Said::Robot(robot) => [robot.speed_limit.unwrap_or(0.0); 3],
            _ => [0.0; 3],
        };
        assert!(numbers.iter().all(|it| it.is_finite()), "{numbers:?}");
    });
}

/// A remote of pulses: a word for each time between two edges, µs; from 60,000 on ms.
pub fn ppm(bytes: &[u8]) {
    let interval = |word: &[u8; 2]| match u64::from(u16::from_le_bytes(*word)) {
        long @ 60_000.. => (long - 60_000) * 1000,
        short => short,
    };
    let intervals: Vec<u64> = bytes.as_chunks().0.iter().map(interval).collect();
    let (is_channel, is_end) =
        (|us: &u64| (950..=2050).contains(us), |us| (2100..=100_000).contains(&us));
    let (mut ppm, mut at, mut frames) = (Ppm::default(), Micros::ZERO, 0);
    assert_eq!(ppm.edge(at), None);
    for (count, interval) in intervals.iter().enumerate() {
        at += Micros::new(*interval);
        // An end, eight channels, and this end: nothing else is a frame.
        let expected = intervals[..count].last_chunk::<9>().filter(|[begin, channels @ ..]| {
            is_end(*begin) && channels.iter().all(is_channel) && is_end(*interval)
        });
        let heard = ppm.edge(at);
        assert_eq!(
            heard.map(|channels| channels.map(u64::from).to_vec()),
            expected.map(|all| all[1..].to_vec())
        );
        heard.iter().for_each(|channels| sane(&ChannelMap::AIR_JOY.remote(channels)));
        frames += u32::from(heard.is_some());
    }
    assert_eq!(ppm.counters().frames, frames);
}

/// Silence that is long enough for every protocol, ms.
const SILENCE: u64 = 10;

/// Meaning of a fuzzer's bytes: raw bytes that come at once, silence, a good frame made of the
/// bytes that follow, a fault of the port.
fn pieces<W: Wire>(wire: W, mut bytes: &[u8]) -> (Vec<Piece>, Micros) {
    let (mut pieces, mut ns) = (Vec::new(), 0);
    while let Some((&step, rest)) = bytes.split_first() {
        let came = match step {
            0..0xC0 => {
                let (raw, left) = rest.split_at(rest.len().min(usize::from(step & 0x3F) + 1));
                bytes = left;
                raw.to_vec()
            }
            0xC0..0xE0 => {
                ns += u64::from(step & 0x1F) * 1_000_000;
                bytes = rest;
                vec![]
            }
            0xE0..0xF8 => {
                let mut source = Source(rest);
                let frame = wire.frame(&mut source);
                bytes = source.0;
                frame
            }
            0xF8.. => {
                pieces.push(Piece::Fault);
                bytes = rest;
                continue;
            }
        };
        ns += came.len() as u64 * W::BYTE_NS;
        pieces.push(Piece::Bytes(came, Micros::new(ns / 1000)));
    }
    (pieces, Micros::new(ns / 1000))
}

/// A parser hears a line, and `check` every message.
fn stream<W: Wire>(
    wire: W,
    bytes: &[u8],
    mut check: impl FnMut(&<W::Protocol as Protocol>::Message),
) {
    let (mut pieces, end) = pieces(wire, bytes);
    // No panic, nothing that is not finite, bounded work, every byte counted.
    let outcome = hear(wire, &pieces);
    for other in [byte_by_byte(&pieces), together(&pieces)] {
        let other = hear(wire, &other);
        assert_eq!(other.numbers(), outcome.numbers(), "it matters how a read splits the stream");
        assert_eq!(other.counters, outcome.counters);
    }
    segments::<W>(&pieces).iter().for_each(|segment| segment.check(wire, &outcome));

    let mut messages = Stream::new(wire.protocol());
    for piece in &pieces {
        match piece {
            Piece::Bytes(bytes, at) => messages.receive(bytes, *at, |message| check(&message)),
            Piece::Fault => messages.interrupt(),
        }
    }

    // Whatever came before: after a fault, and silence, the next good frame is heard.
    let good = wire.frame(&mut Source(&[]));
    let silence = |ms| Piece::Bytes(vec![], end + Micros::from_millis(ms));
    pieces.extend([Piece::Fault, silence(0), silence(SILENCE)]);
    let frame = Piece::Bytes(good.clone(), end + Micros::from_millis(2 * SILENCE));
    pieces.extend([frame, silence(3 * SILENCE)]);
    let heard = hear(wire, &pieces).numbers();
    let last = heard.last().expect("a good frame after a fault is lost");
    assert!(same(last, &wire.says(&good).unwrap()), "{last:?} after a fault");
}

/// The same in single bytes.
fn byte_by_byte(pieces: &[Piece]) -> Vec<Piece> {
    let single = |piece: &Piece| match piece {
        Piece::Bytes(bytes, at) if !bytes.is_empty() => {
            bytes.iter().map(|byte| Piece::Bytes(vec![*byte], *at)).collect()
        }
        other => vec![other.clone()],
    };
    pieces.iter().flat_map(single).collect()
}

/// The same in one piece, up to each silence and fault.
fn together(pieces: &[Piece]) -> Vec<Piece> {
    let mut joined: Vec<Piece> = Vec::new();
    for piece in pieces {
        match (joined.last_mut(), piece) {
            (Some(Piece::Bytes(before, last)), Piece::Bytes(bytes, at))
                if !before.is_empty() && !bytes.is_empty() =>
            {
                before.extend(bytes);
                *last = *at;
            }
            _ => joined.push(piece.clone()),
        }
    }
    joined
}

/// Bytes between two faults or silences that end frames.
#[derive(Default)]
struct Segment {
    bytes: Vec<u8>,
    /// Number of bytes before it.
    start: usize,
    /// Whether it begins with a fault, and no silence behind it.
    after_fault: bool,
    /// Whether it ends with silence, so that all of it is judged.
    is_over: bool,
}

fn segments<W: Wire>(pieces: &[Piece]) -> Vec<Segment> {
    let (mut segments, mut now, mut last) = (Vec::new(), Segment::default(), None);
    for piece in pieces {
        let fault = match piece {
            Piece::Bytes(bytes, at) if !bytes.is_empty() => {
                now.bytes.extend(bytes);
                last = Some(*at);
                continue;
            }
            Piece::Bytes(_, at) => {
                let silence = at.since(*last.get_or_insert(*at));
                now.is_over = W::Protocol::PAUSE.is_some_and(|pause| silence >= pause.length());
                if !now.is_over {
                    continue;
                }
                false
            }
            Piece::Fault => {
                last = None;
                true
            }
        };
        let start = now.start + now.bytes.len();
        segments.push(std::mem::take(&mut now));
        (now.start, now.after_fault) = (start, fault);
    }
    segments.push(now);
    segments
}

impl Segment {
    /// Against a search that has all the time and memory in the world: no other frame is heard, and
    /// none is lost whose end is a full buffer away from where the segment was cut off.
    fn check<W: Wire>(&self, wire: W, outcome: &Outcome) {
        let (bytes, end) = (&self.bytes, self.start + self.bytes.len());
        let room = <W::Protocol as Protocol>::Buffer::CAPACITY;
        let mut found = searched(wire, bytes);
        if matches!(W::Protocol::PAUSE, Some(Pause::Delimits(_))) {
            // Whole frames between two silences, or nothing.
            let whole: usize = found.iter().map(|place| place.end - place.start).sum();
            if whole != bytes.len() || whole > room || self.after_fault || !self.is_over {
                found.clear();
            }
        }
        let expected = said(wire, bytes, &found);
        found.retain(|place| self.is_over || place.end + room <= bytes.len());
        let least = said(wire, bytes, &found).len();
        let heard: Vec<_> =
            outcome.heard.iter().filter(|one| one.after > self.start && one.after <= end).collect();
        assert!(
            (least..=expected.len()).contains(&heard.len()),
            "heard {heard:?}\nof {expected:?}"
        );
        for (one, other) in heard.iter().zip(&expected) {
            assert!(same(&one.numbers, other), "heard {one:?}\nnot {other:?}");
        }
    }
}

/// Checks the ranges of a remote.
fn sane(remote: &Remote) {
    let Remote { left, right, dial, .. } = *remote;
    let axes = [left.x, left.y, right.x, right.y, dial];
    assert!(axes.iter().all(|axis| (-1.0..=1.0).contains(axis)), "{remote:?}");
}

/// A distance that the device can measure, mm.
fn within(range: Range, possible: std::ops::RangeInclusive<u32>) {
    assert!(range.millimetres().is_none_or(|distance| possible.contains(&distance)), "{range:?}");
}
