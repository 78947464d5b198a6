//! A crystal that is not the one that the program reckons with: the bit rate is told.

use rc10_emu::{Board, Options};
use rc10_sim::{BusConfig, EscConfig, Model};

use super::{Bench, LOAD, reports};

const RCC: u32 = 0x5802_4400;
const GPIOD: u32 = 0x5802_0C00;
const FDCAN1: u32 = 0x4000_A000;
const FDCANRAM: u32 = 0x4000_AC00;

/// A chip whose FDCAN1 is set up for 1 Mbit/s on PD0 and PD1, from a crystal of `reckoned` MHz, and
/// sends a frame. Its board has another, perhaps.
fn started(board: Board, reckoned: u32) -> (rc10_sim::Bus, Bench) {
    let mut bench = Bench::new(LOAD, Options { board, ..Options::default() });
    let bus = bench.world.add_bus(BusConfig::default());
    let esc = bus.add_esc(EscConfig::new(Model::C620, 8)).unwrap();
    esc.set_feedback(false);
    bench.machine.connect(0, &bus);
    // Voltage scale 0.
    bench.write(0x5802_480C, 0b010);
    bench.write(0x5802_4818, 0);
    bench.write(RCC, 1 << 16 | 1);
    bench.run_to(2_500_000);
    // HSE / 5 or 6 x 80: 400 or 320 MHz with the crystal that is reckoned with; Q is 80 MHz of
    // both.
    let (first, times, q) = if reckoned == 25 { (5, 80, 5) } else { (6, 80, 4) };
    bench.write(RCC + 0x28, first << 4 | 2);
    bench.write(RCC + 0x2C, 2 << 2 | 3 << 16);
    bench.write(RCC + 0x30, (times - 1) | 1 << 9 | (q - 1) << 16);
    bench.write(RCC, 1 << 24 | 1 << 16 | 1);
    bench.run_to(2_600_000);
    // FDCAN from PLL1 Q; its gate and port D's; AF9 on PD0 and PD1.
    bench.write(RCC + 0x50, 1 << 28);
    bench.write(RCC + 0xEC, 1 << 8);
    bench.write(RCC + 0xE0, 1 << 3);
    bench.write(GPIOD, 0xFFFF_FFFA);
    bench.write(GPIOD + 0x20, 0x99);
    // INIT, CCE; calibration unit bypassed; 2 x (1 + 29 + 10) periods of 80 MHz a bit.
    bench.write(FDCAN1 + 0x18, 3);
    bench.write(FDCAN1 + 0x804, 1 << 6);
    bench.write(FDCAN1 + 0x1C, 9 << 25 | 1 << 16 | 28 << 8 | 9);
    // One dedicated transmit buffer at word 0: 201#00.
    bench.write(FDCAN1 + 0xC0, 1 << 16);
    bench.write(FDCANRAM, 0x201 << 18);
    bench.write(FDCANRAM + 4, 1 << 16);
    bench.write(FDCAN1 + 0x18, 0);
    // What HSI's buses are too fast for does not matter here.
    bench.machine.soc().take_reports();
    bench.run_to(2_700_000);
    bench.write(FDCAN1 + 0xD0, 1);
    bench.run_to(60_000_000);
    (bus, bench)
}

/// TEC, and whether it is bus-off.
fn errors(bench: &Bench) -> (u32, bool) {
    (bench.read(FDCAN1 + 0x40) & 0xFF, bench.read(FDCAN1 + 0x44) >> 7 & 1 != 0)
}

#[test]
fn with_its_crystal_everything_gets_through() {
    for (board, reckoned) in [(Board::DM_MC02, 24), (Board::H723ZG, 25)] {
        let (bus, bench) = started(board, reckoned);
        assert_eq!(reports(&bench.machine), [""; 0]);
        assert_eq!((bus.counters().frames, bus.counters().destroyed), (1, 0));
        assert_eq!(errors(&bench), (0, false));
    }
}

#[test]
fn with_another_nothing_does_and_the_bit_rates_are_told_once() {
    let cases = [
        (Board { crystal_hz: 25_000_000, ..Board::DM_MC02 }, 24, "1041.7"),
        (Board { crystal_hz: 24_000_000, ..Board::H723ZG }, 25, "960"),
        (Board { crystal_hz: 8_000_000, ..Board::H723ZG }, 25, ""),
    ];
    for (board, reckoned, rate) in cases {
        let (bus, mut bench) = started(board, reckoned);
        if rate.is_empty() {
            // The PLL does not lock: no clock, no bit rate.
            assert_eq!(reports(&bench.machine), [""; 0]);
            continue;
        }
        let told = format!("FDCAN1 runs at {rate} kbit/s, its bus at 1000 kbit/s");
        assert_eq!(reports(&bench.machine), [told.as_str()]);
        // The one frame is repeated until its sender is off the bus: 32 times.
        assert_eq!((bus.counters().frames, bus.counters().destroyed), (0, 32));
        assert!(errors(&bench).1);
        // It comes back, and goes again.
        bench.write(FDCAN1 + 0x18, 0);
        bench.wait(60_000_000);
        assert_eq!((bus.counters().frames, bus.counters().destroyed), (0, 64));
        assert_eq!(reports(&bench.machine).len(), 1);
    }
}
