//! A parser that is watched while it works.

use std::cell::Cell;

use rc10_module::{Buffer, Counters, Found, Pause, Protocol, Stream};
use rc10_time::Micros;

use super::wire::Wire;

/// The work that a parser did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    pub examined: u32,
    /// Bytes in good frames.
    pub in_frames: u32,
}

/// A protocol that counts what it is asked, and checks its answers.
pub struct Watched<'w, P> {
    pub protocol: P,
    pub work: &'w Cell<Work>,
}

impl<P: Protocol> Protocol for Watched<'_, P> {
    type Message = P::Message;
    type Buffer = P::Buffer;

    const PAUSE: Option<Pause> = P::PAUSE;

    fn examine(&self, bytes: &[u8]) -> Found<P::Message> {
        assert!(!bytes.is_empty());
        let found = self.protocol.examine(bytes);
        let mut work = self.work.get();
        work.examined += 1;
        match &found {
            Found::More(needed) => {
                let room = P::Buffer::CAPACITY;
                assert!(*needed > bytes.len() && *needed <= room, "{needed} bytes are needed");
            }
            Found::Frame(length, _) | Found::Other(length) => {
                assert!((1..=bytes.len()).contains(length), "a frame of {length} bytes");
                work.in_frames += *length as u32;
            }
            Found::Nothing | Found::Damaged => {}
        }
        self.work.set(work);
        found
    }
}

/// A message that was heard.
#[derive(Clone, Debug, PartialEq)]
pub struct Heard {
    /// The text of the message.
    pub numbers: Vec<f64>,
    /// After how many bytes of the stream.
    pub after: usize,
}

/// The outcome of a stream.
#[derive(Debug)]
pub struct Outcome {
    pub heard: Vec<Heard>,
    pub counters: Counters,
}

impl Outcome {
    pub fn numbers(&self) -> Vec<Vec<f64>> {
        self.heard.iter().map(|heard| heard.numbers.clone()).collect()
    }
}

/// Something that comes from a port.
#[derive(Clone, Debug)]
pub enum Piece {
    Bytes(Vec<u8>, Micros),
    Fault,
}

/// Hears these pieces, and checks whatever must hold for each.
///
/// Work is bounded: at each byte a parser is asked once whether it is enough, and once more for
/// each byte at which no frame begins after all. A byte costs at most one question for each that
/// waits in the buffer; all of them together two each.
pub fn hear<W: Wire>(wire: W, pieces: &[Piece]) -> Outcome {
    let work = Cell::new(Work::default());
    let mut stream = Stream::new(Watched { protocol: wire.protocol(), work: &work });
    let room = <W::Protocol as Protocol>::Buffer::CAPACITY as u32;
    let mut heard = Vec::new();
    let (mut count, mut faults) = (0, 0);
    for piece in pieces {
        let before = work.get();
        let Piece::Bytes(bytes, at) = piece else {
            stream.interrupt();
            faults += 1;
            continue;
        };
        let mut told = Vec::new();
        stream.receive(bytes, *at, |message| {
            let text = format!("{message:?}");
            let numbers = wire.told(&message);
            let finite = numbers.iter().all(|number| number.is_finite());
            assert!(finite && !text.contains("NaN") && !text.contains("inf"), "{text}");
            told.push(numbers);
        });
        count += bytes.len();
        heard.extend(told.into_iter().map(|numbers| Heard { numbers, after: count }));
        let examined = work.get().examined - before.examined;
        assert!(examined <= room + 2 * bytes.len() as u32, "{examined} questions at once");
    }
    // What still waits is given up, and counted.
    stream.interrupt();
    let (counters, Work { examined, in_frames }) = (stream.counters(), work.get());
    let in_frames = wire.in_frames(in_frames, counters.frames);
    assert_eq!(counters.port_errors, faults + 1);
    assert_eq!(in_frames + counters.skipped, count as u32, "a byte is lost uncounted");
    assert!(heard.len() as u32 <= counters.frames);
    assert!(examined <= 2 * count as u32, "{examined} questions for {count} bytes");
    Outcome { heard, counters }
}
