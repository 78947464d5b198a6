use rc10_emu::fdcan::Node;
use rc10_sim::{Controller, Nanos};
use std::sync::Arc;

use crate::chip::{AHB4ENR, APB1HENR, Chip};

const GPIO: u32 = 0x5802_0000;

impl Chip {
    /// Gives a pin an alternate function. Port A is 0.
    pub fn alternate(&mut self, port: u32, pin: u32, function: u32) {
        let base = GPIO + 0x400 * port;
        self.set(AHB4ENR, 1 << port, 1 << port);
        self.set(base, 3 << (2 * pin), 2 << (2 * pin));
        let shift = 4 * (pin % 8);
        self.set(base + 0x20 + 4 * (pin / 8), 0xF << shift, function << shift);
    }

    fn is_connected(&self, index: usize) -> bool {
        Node::new(Arc::clone(&self.soc.fdcan), index).is_connected()
    }
}

#[test]
fn only_the_right_alternate_function_connects_a_can() {
    // Our board: PD0, PD1; PB12, PB13; PF6, PF7.
    for (index, port, receive, transmit, function) in
        [(0, 3, 0, 1, 9), (1, 1, 12, 13, 9), (2, 5, 6, 7, 2)]
    {
        let mut chip = Chip::running();
        chip.write(APB1HENR, 1 << 8);
        chip.alternate(port, receive, function);
        assert!(!chip.is_connected(index), "no transmit pin");
        chip.alternate(port, transmit, function + 1);
        assert!(!chip.is_connected(index), "wrong function");
        chip.alternate(port, transmit, function);
        assert!(chip.is_connected(index));
        assert_eq!((0..3).filter(|&index| chip.is_connected(index)).count(), 1);
        // An output is no CAN.
        chip.set(GPIO + 0x400 * port, 3 << (2 * receive), 1 << (2 * receive));
        assert!(!chip.is_connected(index));
    }
}

#[test]
fn a_chips_reset_disconnects_its_pins() {
    let mut chip = Chip::running();
    chip.alternate(3, 0, 9);
    chip.alternate(3, 1, 9);
    assert!(chip.is_connected(0));
    chip.soc.reset(rc10_emu::peripherals::ResetCause::Software, Nanos::new(chip.now));
    assert!(!chip.is_connected(0));
}

#[test]
fn outputs_show_outside_and_inputs_inside() {
    let mut chip = Chip::running();
    chip.write(AHB4ENR, 1 << 4);
    let port = GPIO + 4 * 0x400;
    assert_eq!(chip.soc.pin_output('E', 5), None);
    chip.set(port, 3 << 10, 1 << 10);
    chip.write(port + 0x18, 1 << 5);
    assert_eq!(chip.soc.pin_output('E', 5), Some(true));
    assert_eq!(chip.read(port + 0x10), 1 << 5);

    chip.set(port, 3 << 12, 0);
    assert!(chip.soc.drive_pin('E', 6, Some(true), Nanos::new(chip.now)));
    assert_eq!(chip.read(port + 0x10), 3 << 5);
    assert!(!chip.soc.drive_pin('L', 0, None, Nanos::new(chip.now)));
    assert!(!chip.soc.drive_pin('E', 16, None, Nanos::new(chip.now)));
    assert_eq!(chip.soc.pin_output('E', 16), None);
}
