//! `listen` on a port that fails: what comes whole behind a fault is heard, and what is lost is
//! counted.

use std::cell::Cell;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;
use rc10_module::Protocol;

use super::checks::{cases, frame, room};
use super::port::{Event, LATE, Line, listened, readings};
use super::wire::{Place, Segment, Wire, same};

/// A fault: before which byte, how many are lost there, and whether the port calls it an error.
type Fault = (Index, usize, bool);

/// Something that the port tells: when, ns; which byte of the good stream it is, if one.
type Told = (u64, Event, Option<usize>);

/// How long silence is that is heard however early a task is, and such as is heard however late,
/// ns: if the protocol listens for it.
fn silences<W: Wire>() -> Option<(u64, u64)> {
    let pause = W::Protocol::PAUSE?.length().get() * 1000;
    Some((pause, pause + LATE * 1000 + 2 * W::BYTE_NS))
}

/// `listen` reads on so much later after each error, ns.
const ERROR_PAUSE: u64 = 4_000_000;

/// Puts faults into a stream. Silence is lengthened where it would depend on the task whether it is
/// heard, or begins while the task pauses after errors.
fn with_faults<W: Wire>(good: &Line, faults: &[Fault]) -> Vec<Told> {
    let count = good.events.len();
    let mut faults: Vec<_> =
        faults.iter().map(|(at, lost, is_error)| (at.index(count), *lost, *is_error)).collect();
    faults.sort_unstable();
    let mut faults = faults.into_iter().peekable();
    let mut told: Vec<Told> = Vec::new();
    let (mut lost_until, mut longer, mut paused_until) = (0, 0, 0_u64);
    for (index, &(time, byte)) in good.events.iter().enumerate() {
        let mut events = Vec::new();
        while let Some((_, lost, is_error)) = faults.next_if(|(at, ..)| *at == index) {
            events.push((if is_error { Event::Error } else { Event::Nothing }, None));
            lost_until = lost_until.max(index + lost);
        }
        if index >= lost_until {
            events.push((byte, Some(index)));
        }
        for (event, index) in events {
            let before = told.last().map_or(0, |(before, ..)| *before);
            let silence = time + longer - before;
            if let Some((early, late)) = silences::<W>()
                && silence >= early
            {
                let heard = late + paused_until.saturating_sub(before);
                longer += heard.saturating_sub(silence);
            }
            if !matches!(event, Event::Byte(_)) {
                paused_until = paused_until.max(time + longer) + ERROR_PAUSE;
            }
            told.push((time + longer, event, index));
        }
    }
    told
}

/// The bytes between two faults or silences, of a stream with frames at these places.
fn segments<W: Wire>(told: &[Told], places: &[Place]) -> Vec<Segment> {
    let is_silence =
        |from: &Told, to: &Told| silences::<W>().is_some_and(|(early, _)| to.0 - from.0 >= early);
    let is_fault = |told: &Told| told.2.is_none();
    let apart = |a: &Told, b: &Told| !is_silence(a, b) && !is_fault(a) && !is_fault(b);
    let mut before: Option<&Told> = None;
    let mut segments = Vec::new();
    for run in told.chunk_by(apart) {
        let [first, ..] = run else { continue };
        let last_before = before.replace(&run[run.len() - 1]);
        if is_fault(first) {
            let segment: Option<&mut Segment> = segments.last_mut();
            if let Some(segment) = segment.filter(|_| !is_silence(last_before.unwrap(), first)) {
                segment.before_fault = true;
            }
            continue;
        }
        let after_fault =
            last_before.is_some_and(|last| is_fault(last) && !is_silence(last, first));
        let (mut indices, mut bytes) = (Vec::new(), Vec::new());
        for (_, event, index) in run {
            if let (Event::Byte(byte), Some(index)) = (event, index) {
                indices.push(*index);
                bytes.push(*byte);
            }
        }
        let whole = places.iter().filter_map(|place| {
            let start = indices.binary_search(&place.start).ok()?;
            let end = start + place.end - place.start;
            // They grow: so all of them are there.
            (indices.get(end - 1) == Some(&(place.end - 1))).then_some(Place { start, end })
        });
        let whole = whole.collect();
        segments.push(Segment { bytes, whole, after_fault, before_fault: false });
    }
    segments
}

/// Faults at random: lost bytes, errors without a loss, reads of nothing, anywhere in a stream of
/// good frames. Every frame that comes whole behind one is heard, but where what a fault left and a
/// frame together make another valid one. And of frames without a header: one that comes right
/// behind a fault, with no silence in between.
///
/// A frame that comes right before another fault is lost if it still waits for bytes or silence:
/// because what the fault before left looks like the beginning of a longer one, or because silence
/// would have been its end.
pub fn faults<W: Wire>(wire: W) {
    let frames = vec((frame(wire), W::GAP.0..=W::GAP.1), 1..20);
    let faults = vec((any::<Index>(), 0..12_usize, any::<bool>()), 0..5);
    let [all, unheard, hidden] = [const { Cell::new(0_u32) }; 3];
    let add = |counter: &Cell<u32>| counter.set(counter.get() + 1);
    cases(1024, (frames, faults, readings()), |(frames, faults, readings)| {
        let mut good = Line::default();
        let mut places = Vec::new();
        for (frame, gap) in &frames {
            let start = good.events.len();
            good.send(*gap, frame, W::BYTE_NS);
            places.push(Place { start, end: good.events.len() });
        }
        let told = with_faults::<W>(&good, &faults);
        let segments = segments::<W>(&told, &places);
        let mut line = Line::default();
        line.events.extend(told.iter().map(|(time, event, _)| (*time, *event)));
        // A fault behind everything, so that nothing waits any more.
        line.events.push((told.last().unwrap().0 + 1_000_000_000, Event::Error));

        let listened = listened(wire, &line, &readings);
        assert_eq!(listened.counters.port_errors as usize, faults.len() + 1);
        let delivered: usize = segments.iter().map(|segment| segment.bytes.len()).sum();
        let accounted = listened.in_frames + listened.counters.skipped;
        assert_eq!(accounted as usize, delivered, "a byte is lost uncounted");
        let mut heard = listened.heard.iter().peekable();
        for segment in &segments {
            let found = wire.found(segment);
            for place in &segment.whole {
                add(&all);
                if !found.contains(place) {
                    let other = found.iter().any(|f| f.start < place.end && place.start < f.end);
                    assert!(other || segment.after_fault, "a good frame is lost");
                    add(&hidden);
                }
            }
            for place in found {
                let Some(says) = wire.says(&segment.bytes[place.start..place.end]) else {
                    continue;
                };
                if heard.next_if(|numbers| same(numbers, &says)).is_none() {
                    let waited = place.start + room::<W>() > segment.bytes.len();
                    assert!(segment.before_fault && waited, "{place:?} of {segment:02X?}");
                    add(&unheard);
                }
            }
        }
        assert!(heard.next().is_none(), "heard what was not sent");
    });
    let [all, unheard, hidden] = [all, unheard, hidden].map(|counter| counter.get());
    println!("of {all} frames that no fault hit, {hidden} hidden, {unheard} waited until the next");
    assert!(all > 5000 && hidden + unheard < all / 50);
}
