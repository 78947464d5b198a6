//! DBUS, whose frames have neither header nor checksum: silence delimits them, and ranges of values
//! are all that stands against garbage.
//!
//! What holds: between two silences there are whole frames and nothing else, or nothing of it is
//! believed. So garbage that is glued to a frame costs that one, and the next one is heard.

use std::cell::Cell;

use proptest::collection::vec;
use proptest::prelude::*;
use rc10_module::{Found, Protocol};
use rc10_time::Micros;

use super::checks::{assert_same, cases, frame, garbage, room};
use super::observed::{Piece, hear};
use super::port::{Line, listened, readings};
use super::wire::Wire;
use super::wires::Dbus;

/// The content of bytes between two silences.
fn said(burst: &[u8]) -> Vec<Vec<f64>> {
    let frames =
        burst.chunks(18).map(|frame| Dbus.frame_at(frame).map(|_| Dbus.says(frame).unwrap()));
    if burst.len() > room::<Dbus>() {
        vec![]
    } else {
        frames.collect::<Option<_>>().unwrap_or_default()
    }
}

#[test]
fn garbage_costs_the_frame_that_it_is_glued_to() {
    let glued = (garbage(Dbus), frame(Dbus), garbage(Dbus));
    let burst = prop_oneof![
        4 => frame(Dbus),
        1 => garbage(Dbus),
        2 => glued.prop_map(|(before, frame, after)| [before, frame, after].concat()),
        1 => (frame(Dbus), frame(Dbus)).prop_map(|(one, other)| [one, other].concat()),
    ];
    let [frames, refused] = [const { Cell::new(0) }; 2];
    cases(1024, (vec((burst, 5_500..13_000_u64), 1..20), readings()), |(bursts, readings)| {
        let mut line = Line::default();
        // So that an empty one is no longer silence than any other.
        line.send(0, &[0], Dbus::BYTE_NS);
        for (burst, gap) in &bursts {
            line.send(*gap, burst, Dbus::BYTE_NS);
        }
        let expected: Vec<_> = bursts.iter().flat_map(|(burst, _)| said(burst)).collect();
        let listened = listened(Dbus, &line, &readings);
        assert_same(&listened.heard, &expected);
        let accounted = listened.in_frames + listened.counters.skipped;
        assert_eq!(accounted as usize, line.events.len());
        frames.set(frames.get() + listened.counters.frames);
        refused.set(refused.get() + listened.counters.damaged);
    });
    println!("{} frames heard, {} bursts refused", frames.get(), refused.get());
    assert!(frames.get() > 5000 && refused.get() > 2000);
}

/// Each byte of a frame changed to every other value. No checksum: most of it is believed, and it
/// is the UART's parity that sees a single bit.
#[test]
fn damage_costs_one_frame() {
    let [tried, taken] = [const { Cell::new(0) }; 2];
    cases(8, [frame(Dbus), frame(Dbus)], |[good, after]| {
        for (at, change) in (0..good.len()).flat_map(|at| (1..=0xFF_u8).map(move |c| (at, c))) {
            let mut damaged = good.clone();
            damaged[at] ^= change;
            let pause = |ms| Piece::Bytes(vec![], Micros::from_millis(ms));
            let bytes = |bytes: &[u8], ms| Piece::Bytes(bytes.to_vec(), Micros::from_millis(ms));
            let pieces = [bytes(&damaged, 2), pause(9), bytes(&after, 16), pause(23)];
            let expected = [said(&damaged), said(&after)].concat();
            assert_same(&hear(Dbus, &pieces).numbers(), &expected);
            tried.set(tried.get() + 1);
            taken.set(taken.get() + expected.len() - 1);
        }
    });
    println!("of {} damaged frames {} were taken", tried.get(), taken.get());
}

/// How much of noise, as long as a frame and between two silences, is taken for one: by the rule
/// (1401 / 2048)⁴ (channels) · (3 / 4)² (switches) · 1403 / 65536 (wheel) of that whose two bytes
/// of buttons are right, and (2 / 256)² of that in all: one of 6.2 million.
#[test]
fn noise_is_hardly_ever_a_frame() {
    const TRIES: u32 = 1 << 22;
    let is_taken = |burst: &[u8; 24]| {
        u32::from(matches!(Dbus.protocol().examine(&burst[..18]), Found::Frame(..)))
    };
    let mut state = 10_u64;
    let mut noise = || {
        // SplitMix64.
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        (mixed ^ mixed >> 31).to_le_bytes()
    };
    let [mut taken, mut taken_with_buttons] = [0_u32; 2];
    for _ in 0..TRIES {
        let mut burst = [0; 24];
        burst.as_chunks_mut().0.iter_mut().for_each(|chunk| *chunk = noise());
        taken += is_taken(&burst);
        (burst[12], burst[13]) = (burst[12] & 1, burst[13] & 1);
        taken_with_buttons += is_taken(&burst);
    }
    let share = (1401.0_f64 / 2048.0).powi(4) * 0.75_f64.powi(2) * 1403.0 / 65536.0;
    let expected = share * f64::from(TRIES);
    println!("{taken} of {TRIES}; {taken_with_buttons} with buttons, {expected:.0} expected");
    assert!((f64::from(taken_with_buttons) / expected - 1.0).abs() < 0.05);
    assert!(taken <= 5);
}
