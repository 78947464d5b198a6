//! Rules that hold for every protocol, tried with thousands of streams: the same ones in each run.

use std::cell::Cell;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};
use rc10_module::{Buffer, Protocol};
use rc10_time::Micros;

use super::observed::{Piece, hear};
use super::port::{Line, Listened, listened, readings};
use super::wire::{Guard, Place, Source, Wire, said, same, searched};

/// Runs a check with `count` inputs, from the same seed in every run.
pub fn cases<S: Strategy>(cases: u32, inputs: S, check: impl Fn(S::Value)) {
    let rng_seed = RngSeed::Fixed(10);
    let config =
        ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() };
    let checked = TestRunner::new(config).run(&inputs, |input| {
        check(input);
        Ok(())
    });
    checked.unwrap_or_else(|error| panic!("{error}"));
}

/// The most bytes that can wait for more.
pub fn room<W: Wire>() -> usize {
    <W::Protocol as Protocol>::Buffer::CAPACITY
}

/// A good frame.
pub fn frame<W: Wire>(wire: W) -> impl Strategy<Value = Vec<u8>> {
    vec(any::<u8>(), 0..220).prop_map(move |bytes| wire.frame(&mut Source(&bytes)))
}

/// Bytes that are no good frame: any at all, those of headers, frames cut short, frames damaged.
pub fn garbage<W: Wire>(wire: W) -> impl Strategy<Value = Vec<u8>> {
    let header = prop::sample::select(W::HEADER);
    prop_oneof![
        vec(any::<u8>(), 0..40),
        vec(prop_oneof![3 => header, 1 => any::<u8>()], 0..40),
        (frame(wire), any::<prop::sample::Index>()).prop_map(|(mut frame, at)| {
            frame.truncate(at.index(frame.len()));
            frame
        }),
        (frame(wire), any::<prop::sample::Index>(), 0..8_u8).prop_map(|(mut frame, at, bit)| {
            let at = at.index(frame.len());
            frame[at] ^= 1_u8 << bit;
            frame
        }),
    ]
}

/// The same bytes in pieces of these lengths, again and again.
fn split(stream: &[u8], lengths: &[usize]) -> Vec<Piece> {
    let (mut pieces, mut left) = (Vec::new(), stream);
    for &length in lengths.iter().cycle() {
        if left.is_empty() {
            break;
        }
        let (piece, rest) = left.split_at(length.min(left.len()));
        pieces.push(Piece::Bytes(piece.to_vec(), Micros::ZERO));
        left = rest;
    }
    pieces
}

/// All bytes at once, and behind them enough others that nothing waits any more.
fn all_of(mut stream: Vec<u8>, room: usize) -> (Vec<u8>, Vec<Piece>) {
    stream.extend(std::iter::repeat_n(FILLER, room));
    let piece = Piece::Bytes(stream.clone(), Micros::from_millis(1000));
    (stream, vec![piece])
}

/// Begins no frame of any protocol.
const FILLER: u8 = 0x33;

/// A good stream, whenever its bytes come and however late and in what pieces a task reads them,
/// says what its frames say.
pub fn splits<W: Wire>(wire: W) {
    let frames = vec((frame(wire), W::GAP.0..=W::GAP.1), 1..20);
    cases(512, (frames, readings()), |(frames, readings)| {
        let mut line = Line::default();
        for (frame, gap) in &frames {
            line.send(*gap, frame, W::BYTE_NS);
        }
        let expected: Vec<_> = frames.iter().filter_map(|(frame, _)| wire.says(frame)).collect();
        let Listened { heard, counters, .. } = listened(wire, &line, &readings);
        assert_same(&heard, &expected);
        let counted = (counters.frames, counters.damaged, counters.skipped, counters.port_errors);
        assert_eq!(counted, (frames.len() as u32, 0, 0, 0));
    });
}

pub fn assert_same(heard: &[Vec<f64>], expected: &[Vec<f64>]) {
    let all = heard.len() == expected.len();
    let right = all && heard.iter().zip(expected).all(|(one, other)| same(one, other));
    assert!(right, "heard {heard:?}\nnot {expected:?}");
}

/// Garbage before, between and after frames, glued to them: what is heard is what a search with all
/// the time in the world finds, at the latest when the buffer would be full. So no good frame is
/// lost but where garbage and frame together make a valid one.
pub fn garbage_between<W: Wire>(wire: W) {
    let piece = prop_oneof![
        frame(wire).prop_map(|frame| (frame, true)),
        garbage(wire).prop_map(|garbage| (garbage, false)),
    ];
    let [planted, hidden] = [const { Cell::new(0_u32) }; 2];
    cases(2048, (vec(piece, 1..16), vec(1..=64_usize, 1..8)), |(parts, lengths)| {
        let mut stream = Vec::new();
        let mut places = Vec::new();
        for (bytes, is_good) in parts {
            let start = stream.len();
            stream.extend(bytes);
            if is_good {
                places.push(Place { start, end: stream.len() });
            }
        }
        stream.extend(std::iter::repeat_n(FILLER, room::<W>()));
        let found = searched(wire, &stream);
        let outcome = hear(wire, &split(&stream, &lengths));
        assert_same(&outcome.numbers(), &said(wire, &stream, &found));
        assert_eq!(outcome.counters.frames, found.len() as u32);

        // Byte by byte: with its last one, if nothing that looks like a longer frame is before it.
        let late = hear(wire, &split(&stream, &[1]));
        let told: Vec<_> = found
            .iter()
            .filter(|place| wire.says(&stream[place.start..place.end]).is_some())
            .collect();
        for (heard, place) in late.heard.iter().zip(told) {
            assert!((place.end..place.end + room::<W>()).contains(&heard.after));
        }
        for place in places {
            planted.set(planted.get() + 1);
            if !found.contains(&place) {
                let other = found.iter().any(|f| f.start < place.end && place.start < f.end);
                assert!(other, "a good frame is not found, and nothing is in its way");
                hidden.set(hidden.get() + 1);
            }
        }
    });
    let [planted, hidden] = [planted, hidden].map(|counter| counter.get());
    println!("{hidden} of {planted} frames lost to garbage that made a valid one of them");
    // A checksum of eight bits lets one of 256 pass, and most garbage does not even look like one.
    let most = if W::GUARD == Guard::Shape { planted / 10 } else { planted / 256 };
    assert!(planted > 5000 && hidden <= most, "{hidden} of {planted}");
}

/// Every byte changed to every other value, one bit of it changed among them. Where there is a
/// checksum the frame is refused; the frames before and after it are heard.
pub fn damage<W: Wire>(wire: W) {
    let [tried, taken, hidden] = [const { Cell::new(0_u32) }; 3];
    let add = |counter: &Cell<u32>| counter.set(counter.get() + 1);
    cases(4, [frame(wire), frame(wire), frame(wire)], |[before, good, after]| {
        let start = before.len();
        let next = Place { start: start + good.len(), end: start + good.len() + after.len() };
        for (at, change) in (0..good.len()).flat_map(|at| (1..=0xFF_u8).map(move |c| (at, c))) {
            let mut damaged = good.clone();
            damaged[at] ^= change;
            let stream = [&before[..], &damaged, &after].concat();
            let (stream, pieces) = all_of(stream, room::<W>());
            let found = searched(wire, &stream);
            let outcome = hear(wire, &pieces);
            assert_same(&outcome.numbers(), &said(wire, &stream, &found));
            add(&tried);
            if found.iter().any(|place| place.start == start) {
                add(&taken);
                let unchecked = match W::GUARD {
                    Guard::Checksum { not_over } => not_over.contains(&at),
                    Guard::Shape => true,
                };
                assert!(unchecked, "byte {at} of {good:02X?} changed by {change:02X} was taken");
            }
            assert_eq!(found[0], Place { start: 0, end: start });
            if !found.contains(&next) {
                add(&hidden);
            }
        }
    });
    let [tried, taken, hidden] = [tried, taken, hidden].map(|counter| counter.get());
    println!("of {tried} damaged frames {taken} were taken, {hidden} hid the frame behind them");
    assert!(hidden <= tried / 500);
}

/// Any bytes at any time, and faults: see `hear` for what holds. Both ends of a stream that never
/// comes to an end.
pub fn anything<W: Wire>(wire: W) {
    let bytes = prop_oneof![4 => garbage(wire), 2 => frame(wire), 1 => vec(any::<u8>(), 0..300)];
    let piece = prop_oneof![
        9 => (bytes, any::<u64>()).prop_map(|(bytes, at)| Piece::Bytes(bytes, Micros::new(at))),
        1 => Just(Piece::Fault),
    ];
    cases(2048, vec(piece, 0..16), |pieces| drop(hear(wire, &pieces)));
}
