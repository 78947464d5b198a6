//! The walks through all of rc10-app that a PC and the chip must agree on, on this PC: they see numbers,
//! and are the same twice. `cargo xtask count` compares them with the chip's.

use crate::walk;

#[test]
fn a_walk_sees_numbers_and_is_the_same_twice() {
    for &(name, walk) in walk::WALKS {
        let (mut seen, mut nothing) = (0, 0);
        walk(&mut |value| {
            seen += 1;
            nothing += u32::from(!value.is_finite());
        });
        assert!(seen > 1000, "{name} sees {seen} numbers");
        assert!(nothing * 10 < seen, "{name}: {nothing} of {seen} are no finite numbers");
        assert_eq!(walk::hash(walk), walk::hash(walk), "{name}");
    }
}

/// One bit of one number is another hash.
#[test]
fn a_hash_sees_every_bit() {
    fn three(put: &mut dyn FnMut(f32)) {
        [1.0, 2.0, 3.0].into_iter().for_each(put);
    }
    fn nearly(put: &mut dyn FnMut(f32)) {
        [1.0, f32::from_bits(2.0_f32.to_bits() + 1), 3.0].into_iter().for_each(put);
    }
    assert_ne!(walk::hash(three), walk::hash(nearly));
}

/// Paths that cannot be driven; bases that wait, arrive, and give up.
#[test]
fn the_walk_along_paths_goes_everywhere() {
    let mut codes = [0_u32; 6];
    walk::paths::walk(&mut |number| {
        for (code, count) in [-1.0_f32, -2.0, -3.0, 1.0, 2.0, 3.0].into_iter().zip(&mut codes) {
            *count += u32::from(number.to_bits() == code.to_bits());
        }
    });
    assert!(codes.iter().all(|&code| code > 0), "{codes:?}");
}
