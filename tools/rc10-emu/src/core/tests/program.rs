//! Whole programs, beside the other core: every step, and every access.

use rc10_sim::{Nanos, World};

use super::super::Step;
use super::witness::WATCHES;
use crate::{Image, Machine, Memory};

/// The firmware that `RC10_FIRMWARE` names, or a program beside it.
fn file(name: Option<&str>) -> Vec<u8> {
    let firmware = std::env::var_os("RC10_FIRMWARE").expect("RC10_FIRMWARE names the firmware");
    let firmware = std::path::PathBuf::from(firmware);
    std::fs::read(name.map_or(firmware.clone(), |name| firmware.with_file_name(name))).unwrap()
}

/// Half a second of the team's firmware on the whole chip, and of every program beside it.
#[test]
#[ignore = "needs the firmware"]
fn firmware_runs_as_it_does_elsewhere() {
    WATCHES.set(true);
    for name in [None, Some("lift-firmware"), Some("omni-firmware"), Some("selftest")] {
        let mut machine = Machine::new(&file(name)).unwrap();
        machine.run(&mut World::new(1), Nanos::new(500_000_000)).unwrap();
        let steps = machine.core().watch.witness.as_ref().unwrap().steps;
        println!("{}: {steps} steps compared", name.unwrap_or("the firmware"));
        assert!(steps > 100_000);
    }
}

/// firmware/count, which computes and has no peripherals.
#[test]
#[ignore = "needs firmware/count"]
fn what_is_counted_runs_as_it_does_elsewhere() {
    WATCHES.set(true);
    let image = Image::parse(&file(Some("count"))).unwrap();
    let done = image.symbol("count_done").unwrap() & !1;
    let mut core = super::super::bare(&Memory::with(&image, 1).unwrap());
    let mut steps = 0_u64;
    while core.program_counter() != done && steps < 20_000_000 {
        assert_eq!(core.step().0, Step::Instruction);
        steps += 1;
    }
    println!("{steps} steps compared");
}
