//! Interrupts that may interrupt the buses, and no others: embassy-stm32 leaves them at the most
//! urgent priority, and a forgotten one shows when a motor stutters.

use rc10_emu::Machine;
use rc10_emu::memory::FLASH;
use rc10_sim::World;

use super::{firmware, millis};

/// External interrupts of the STM32H723 (RM0468, NVIC chapter).
const INTERRUPTS: u16 = 163;
/// Of UARTs, timers, SPI, I2C, pins, and their DMA. Below the buses, which have 6.
const PERIPHERALS: u8 = 7;
/// The interrupt of time, TIM2.
pub const TIME: (u16, u8) = (28, 0);
/// The supervisor, TIM7; the interrupt that is lent to the buses, UART9.
pub const BUSES: [(u16, u8); 2] = [(55, 3), (155, 6)];
/// Number of the buses' exception: 16 of the core's own come before.
pub const BUSES_EXCEPTION: u16 = 16 + BUSES[1].0;
/// TIM13, if the remote speaks serially: it is never started.
const PULSES: u16 = 44;

/// Every interrupt that has a handler, and its priority now; but the pulses', of a robot whose remote speaks serially.
pub fn of(machine: &Machine) -> Vec<(u16, u8)> {
    let unhandled = machine.image.symbol("DefaultHandler").unwrap();
    // 16 exceptions of the core come before.
    let handler = |interrupt| machine.memory.word(FLASH + 4 * (16 + u32::from(interrupt)));
    (0..INTERRUPTS)
        .filter(|interrupt| *interrupt != PULSES)
        .filter(|&interrupt| ![0, unhandled].contains(&handler(interrupt).unwrap()))
        .map(|interrupt| (interrupt, machine.priority(interrupt)))
        .collect()
}

/// All have the priority of peripherals, but the ones named, which are there.
pub fn judge(found: &[(u16, u8)], others: &[(u16, u8)]) {
    for &(interrupt, priority) in found {
        let other = others.iter().find(|(other, _)| *other == interrupt);
        let wanted = other.map_or(PERIPHERALS, |&(_, priority)| priority);
        assert_eq!(priority, wanted, "interrupt {interrupt}");
    }
    assert!(others.iter().all(|other| found.contains(other)), "{found:?}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn only_time_and_the_supervisor_interrupt_the_buses() {
    let mut machine = Machine::new(firmware()).unwrap();
    machine.run(&mut World::new(1), millis(20)).unwrap();
    let found = of(&machine);
    println!("{} interrupts", found.len());
    assert!(found.len() > 10);
    judge(&found, &[&[TIME], &BUSES[..]].concat());
}
