//! Mechanisms on simulated axes: with inertia, friction, stops that give way, belts that slip, contacts
//! that bounce, and motors that fail. Every run is made of a seed.

#![allow(
    clippy::cast_possible_truncation,
    reason = "simulated in f64, measured in what the mechanisms take"
)]

#[path = "mechanisms/axis.rs"]
mod axis;
#[path = "mechanisms/feeding.rs"]
mod feeding;
#[path = "mechanisms/homing.rs"]
mod homing;
#[path = "mechanisms/lift.rs"]
mod lift;
#[path = "walk/mechanisms.rs"]
mod walk;

/// The walk that a PC and the chip are compared by goes where something happens.
#[test]
fn the_walk_is_finite_and_repeats() {
    let run = || {
        let (mut hash, mut count) = (0xCBF2_9CE4_8422_2325_u64, 0);
        walk::walk(&mut |value| {
            assert!(value.is_finite());
            hash = (hash ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01B3);
            count += 1;
        });
        (hash, count)
    };
    assert_eq!(run(), run());
    assert!(run().1 > 50_000, "{:?}", run());
}
