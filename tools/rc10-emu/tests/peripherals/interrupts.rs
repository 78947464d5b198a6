use rc10_sim::Nanos;

use crate::chip::{AHB4ENR, APB4ENR, Chip};

const EXTI: u32 = 0x5800_0000;
const SYSCFG: u32 = 0x5800_0400;
const PORT_C: u32 = 0x5802_0800;

#[test]
fn an_edge_on_the_selected_port_pends_its_line() {
    let mut chip = Chip::running();
    chip.write(APB4ENR, 1 << 1);
    chip.write(AHB4ENR, 1 << 2);
    chip.set(PORT_C, 3 << 26, 0);
    // Line 13 is port C, rising edges, unmasked.
    chip.write(SYSCFG + 0x14, 2 << 4);
    chip.write(EXTI, 1 << 13);
    chip.write(EXTI + 0x80, 1 << 13);
    let drive = |chip: &mut Chip, port, level| {
        assert!(chip.soc.drive_pin(port, 13, Some(level), Nanos::new(chip.now)));
    };
    drive(&mut chip, 'B', true);
    assert!(!chip.interrupt(40), "another port");
    drive(&mut chip, 'C', true);
    assert!(chip.interrupt(40));
    chip.write(EXTI + 0x88, 1 << 12);
    assert!(chip.interrupt(40), "another line");
    chip.write(EXTI + 0x88, 1 << 13);
    assert!(!chip.interrupt(40));
    drive(&mut chip, 'C', false);
    assert!(!chip.interrupt(40), "a falling edge");
}

#[test]
fn software_triggers_and_the_mask() {
    let mut chip = Chip::running();
    chip.write(EXTI + 0x08, 1 << 7);
    assert_eq!((chip.read(EXTI + 0x88), chip.interrupt(23)), (1 << 7, false));
    chip.set(EXTI + 0x80, 1 << 7, 1 << 7);
    assert!(chip.interrupt(23));
}
