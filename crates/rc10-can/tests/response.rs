//! Response times: the paper's example, another implementation of other authors, and a bus with random phases.

use rc10_can::IdPattern;
use rc10_can::response::{Stream, response};
use response_time_analysis::arrival::Sporadic;
use response_time_analysis::demand::RBF;
use response_time_analysis::fixed_priority::fully_nonpreemptive::{
    TaskUnderAnalysis, dedicated_uniproc_rta,
};
use response_time_analysis::time::{Duration, Service};
use response_time_analysis::wcet;

struct Random(u64);

impl Random {
    fn below(&mut self, end: u32) -> u32 {
        // `SplitMix64`.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        u32::try_from((mixed ^ mixed >> 31) % u64::from(end)).unwrap()
    }
}

fn stream(place: u32, bits: u32, period: u32, jitter: u32) -> Stream {
    Stream { urgency: [place; 2], bits, period, jitter, fifo: None }
}

/// A set of a bus's size: frames of 44 to 160 bits, 5 to 125 % of the bus.
fn set(random: &mut Random) -> Vec<Stream> {
    let len = 1 + random.below(12);
    let one = |place| {
        let period = [250, 500, 1000, 1000, 2000, 5000, 10_000][random.below(7) as usize];
        let jitter = if random.below(2) == 0 { 0 } else { random.below(2 * period) };
        stream(place, 44 + random.below(117), period, jitter)
    };
    (0..len).map(one).collect()
}

/// The crate `response-time-analysis`, whose analysis is proved in Coq.
fn witness(streams: &[Stream], of: usize) -> Option<u32> {
    let arrivals: Vec<_> = streams
        .iter()
        .map(|stream| Sporadic {
            min_inter_arrival: Duration::from(u64::from(stream.period)),
            jitter: Duration::from(u64::from(stream.jitter)),
        })
        .collect();
    let cost = |stream: &Stream| wcet::Scalar::new(Service::from(u64::from(stream.bits)));
    let before: Vec<_> = (0..of).map(|at| RBF::new(&arrivals[at], cost(&streams[at]))).collect();
    let blocking = streams[of + 1..].iter().map(|stream| stream.bits).max().unwrap_or(0);
    let under = TaskUnderAnalysis {
        wcet: cost(&streams[of]),
        arrivals: &arrivals[of],
        blocking_bound: Service::from(u64::from(blocking)),
    };
    // Up to 100,000 it also tries all times, one by one.
    let found = dedicated_uniproc_rta(&under, &before, Duration::from(100_001)).ok()?;
    u32::try_from(u64::from(found)).ok()
}

/// Theirs counts from when a frame is ready, ours from when it should be: so none that is asked about is late itself.
#[test]
fn random_sets_have_the_times_of_another_implementation() {
    let mut random = Random(37);
    let (mut bounded, mut unbounded) = (0, 0);
    for number in 0..100_000 {
        let late = set(&mut random);
        for of in 0..late.len() {
            let mut streams = late.clone();
            streams[of].jitter = 0;
            let ours = response(&streams, of, 0);
            let theirs = witness(&streams, of);
            assert_eq!(ours, theirs, "set {number}, {of} of {streams:?}");
            if ours.is_some() { bounded += 1 } else { unbounded += 1 }
        }
    }
    println!("{bounded} times equal, {unbounded} without a bound in both");
    assert!(bounded > 50_000 && unbounded > 2000, "{bounded} {unbounded}");
}

/// Known by hand: a frame of 100 bits that is 30 late may wait for one less urgent, and for more urgent ones.
#[test]
fn what_delays_a_frame() {
    let alone = [stream(5, 100, 1000, 30)];
    assert_eq!(response(&alone, 0, 0), Some(130));
    let three = [stream(1, 80, 1000, 0), stream(5, 100, 1000, 30), stream(9, 135, 1000, 0)];
    assert_eq!(response(&three, 1, 0), Some(30 + 135 + 80 + 100));
    // An error frame each 1000 bits, with the longest frame that goes before.
    assert_eq!(response(&three, 1, 1000), Some(30 + 135 + 80 + 100 + 31 + 100));
    // What is set up now and then goes before once, if it is urgent.
    let rare = Stream { period: Stream::RARE, ..stream(0, 64, 1, 0) };
    let [first, own, last] = three;
    assert_eq!(response(&[rare, first, own, last], 2, 0), Some(30 + 135 + 80 + 64 + 100));
    // A family of identifiers goes before by its most urgent one, and waits by its least urgent.
    let family = Stream { urgency: [0, 7], ..stream(0, 90, 1000, 0) };
    assert_eq!(response(&[family, own], 1, 0), Some(30 + 90 + 100));
    assert_eq!(response(&[family, own], 0, 0), Some(100 + 90));
    // In a queue it waits for the other one, as urgent as that: only 135 is behind both.
    let queued = |stream: Stream| Stream { fifo: Some(0), ..stream };
    let fifo = [
        stream(1, 80, 1000, 0),
        queued(stream(0, 100, 1000, 0)),
        queued(stream(3, 110, 1000, 0)),
        last,
    ];
    assert_eq!(response(&fifo, 1, 0), Some(135 + 110 + 80 + 100));
    assert_eq!(response(&fifo[1..], 0, 0), Some(135 + 110 + 100));
    // However many error frames are asked about: beyond what a bus carries there is no bound, and no overflow.
    assert_eq!(response(&three, 1, u32::MAX), None);
    // Half of a full bus each: the second one has no bound.
    let full = [stream(1, 100, 150, 0), stream(2, 100, 250, 0)];
    assert_eq!((response(&full, 0, 0), response(&full, 1, 0)), (Some(200), None));
}

#[test]
fn urgency_is_the_order_of_arbitration() {
    let of = |pattern| Stream::new(pattern, 8, 1000).urgency;
    let order = [
        IdPattern::extended(0x000_0001),
        IdPattern::standard(0x001),
        IdPattern::extended(0x0004_0000),
        IdPattern::standard(0x200),
        IdPattern::extended(0x200 << 18),
        IdPattern::standard(0x201),
    ];
    assert!(order.windows(2).all(|pair| of(pair[0])[1] < of(pair[1])[0]));
    assert_eq!(of(IdPattern::standard(0x201).under(0x7F0)), [0x200 << 19, 0x20F << 19]);
    assert_eq!(Stream::new(IdPattern::standard(0x201), 8, 1000).bits, 135);
    assert_eq!(Stream::new(IdPattern::extended(0x201), 8, 1000).bits, 160);
}
