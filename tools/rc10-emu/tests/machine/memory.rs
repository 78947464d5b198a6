//! OCTOSPI1 and the DM-MC02's W25Q64JV, register by register as a program would.

use rc10_emu::Board;

use super::*;

const OCTOSPI: u32 = 0x5200_5000;
const CR: u32 = OCTOSPI;
const SR: u32 = OCTOSPI + 0x20;
const FCR: u32 = OCTOSPI + 0x24;
const DLR: u32 = OCTOSPI + 0x40;
const AR: u32 = OCTOSPI + 0x48;
const DR: u32 = OCTOSPI + 0x50;
const CCR: u32 = OCTOSPI + 0x100;
const TCR: u32 = OCTOSPI + 0x108;
const IR: u32 = OCTOSPI + 0x110;
const READS: u32 = 1 << 28;
const POLLS: u32 = 2 << 28;
const TCF: u32 = 0b10;
const BUSY: u32 = 1 << 5;

/// A command's lines: instruction, address of 24 bits, data.
const fn lines(address: u32, data: u32) -> u32 {
    1 | address << 8 | if address == 0 { 0 } else { 2 << 12 } | data << 24
}
const FOUR: u32 = 3;

fn bench() -> Bench {
    let options = Options { board: Board::DM_MC02, ..Options::default() };
    let mut bench = Bench::new(LOAD, options);
    bench.run_to(1_000);
    // OCTOSPI1 and its I/O manager, and ports A to E.
    bench.set(RCC + 0xD4, 0, 1 << 14 | 1 << 21);
    bench.set(RCC + 0xE0, 0, 0x1F);
    for (port, pin, function) in
        [(4, 11, 11), (1, 2, 9), (3, 11, 9), (1, 0, 4), (0, 3, 6), (0, 1, 9)]
    {
        bench.alternate(port, pin, function);
    }
    // 8 MiB; a quarter of the clock.
    bench.write(OCTOSPI + 0x08, 22 << 16);
    bench.write(OCTOSPI + 0x0C, 3);
    bench.write(CR, 1);
    bench
}

impl Bench {
    fn command(&self, mode: u32, instruction: u32, lines: u32, wait: u32) {
        self.write(FCR, 0x1F);
        self.write(CR, mode | 1);
        self.write(CCR, lines);
        self.write(TCR, wait);
        self.write(IR, instruction);
    }

    fn fetch(
        &mut self,
        instruction: u32,
        address: Option<u32>,
        form: (u32, u32),
        count: u32,
    ) -> Vec<u8> {
        self.write(DLR, count - 1);
        self.command(READS, instruction, form.0, form.1);
        address.into_iter().for_each(|address| self.write(AR, address));
        let byte = |_| {
            let value = self.machine.soc().read(DR, Width::Byte, self.machine.now()).unwrap();
            value.to_le_bytes()[0]
        };
        let bytes = (0..count).map(byte).collect();
        self.wait(20_000);
        assert_eq!(self.read(SR) & (BUSY | TCF), TCF);
        bytes
    }

    fn status(&mut self) -> u8 {
        self.fetch(0x05, None, (lines(0, 1), 0), 1)[0]
    }

    fn order(&mut self, instruction: u32, address: Option<u32>) {
        self.command(0, instruction, lines(u32::from(address.is_some()), 0), 0);
        address.into_iter().for_each(|address| self.write(AR, address));
        self.wait(10_000);
    }

    fn store(&mut self, instruction: u32, address: u32, form: u32, bytes: &[u8]) {
        self.order(0x06, None);
        self.write(DLR, u32::try_from(bytes.len()).unwrap() - 1);
        self.command(0, instruction, form, 0);
        self.write(AR, address);
        for byte in bytes {
            let now = self.machine.now();
            self.machine.soc().write(DR, Width::Byte, u32::from(*byte), now).unwrap();
        }
        self.wait(200_000);
    }

    fn until_ready_memory(&mut self) -> u64 {
        let begin = self.machine.now().get();
        while self.status() & 1 != 0 {}
        self.machine.now().get() - begin
    }

    fn load_memory(&mut self, address: u32, count: u32) -> Vec<u8> {
        self.fetch(0x6B, Some(address), (lines(1, FOUR), 8), count)
    }
}

#[test]
fn it_says_what_it_is() {
    let mut bench = bench();
    assert_eq!(bench.fetch(0x9F, None, (lines(0, 1), 0), 3), [0xEF, 0x40, 0x17]);
    assert_eq!(bench.status(), 0);
    // Of a pin that is not set up, and of a form that it does not have, nothing is heard.
    assert_eq!(bench.fetch(0x9F, None, (lines(0, FOUR), 0), 3), [0xFF; 3]);
    bench.alternate(4, 11, 0);
    assert_eq!(bench.fetch(0x9F, None, (lines(0, 1), 0), 3), [0xFF; 3]);
}

#[test]
fn a_page_is_programmed_and_its_bits_only_fall() {
    let mut bench = bench();
    let bytes: Vec<u8> = (0..=255).collect();
    bench.store(0x32, 0x1_0000, lines(1, FOUR), &bytes);
    assert_eq!(bench.status() & 0b11, 0b11, "busy");
    assert_eq!(bench.load_memory(0x1_0000, 4), [0xFF; 4], "busy, it hears nothing but its status");
    let time = bench.until_ready_memory();
    assert!((300_000..3_100_000).contains(&time), "{time} ns");
    assert_eq!(bench.status(), 0, "writing is enabled for once");
    assert_eq!(bench.load_memory(0x1_0000, 256), bytes);
    for (instruction, form, wait) in
        [(0x03, lines(1, 1), 0), (0x0B, lines(1, 1), 8), (0xEB, lines(FOUR, FOUR), 6)]
    {
        let read = bench.fetch(instruction, Some(0x1_0010), (form, wait), 16);
        assert_eq!(read, bytes[16..32], "{instruction:#x}");
    }
    bench.store(0x02, 0x1_0000, lines(1, 1), &[0xF0; 8]);
    bench.until_ready_memory();
    assert_eq!(bench.load_memory(0x1_0000, 9), [0, 0, 0, 0, 0, 0, 0, 0, 8]);
    // Behind the page's end it goes on at its beginning.
    bench.store(0x02, 0x2_00FE, lines(1, 1), &[1, 2, 3]);
    bench.until_ready_memory();
    assert_eq!(bench.load_memory(0x2_00FE, 2), [1, 2]);
    assert_eq!(bench.load_memory(0x2_0000, 1), [3]);
    // Without having been enabled it writes nothing.
    bench.order(0x04, None);
    bench.order(0x20, Some(0x1_0000));
    assert_eq!((bench.status(), bench.load_memory(0x1_0010, 1)), (0, vec![16]));
}

#[test]
fn sectors_and_blocks_are_erased_in_their_time() {
    for (instruction, size, [least, most]) in
        [(0x20, 4 << 10, [45, 400]), (0x52, 32 << 10, [120, 1600]), (0xD8, 64 << 10, [150, 2000])]
    {
        let mut bench = bench();
        for address in [0x10_0000 - 256, 0x10_0000, 0x10_0000 + size - 256, 0x10_0000 + size] {
            bench.store(0x02, address, lines(1, 1), &[7]);
            bench.until_ready_memory();
        }
        bench.order(0x06, None);
        bench.order(instruction, Some(0x10_0000 + 5));
        let millis = bench.until_ready_memory() / 1_000_000;
        assert!((least - 1..=most).contains(&millis), "{instruction:#x}: {millis} ms");
        let bytes = [0x10_0000 - 256, 0x10_0000, 0x10_0000 + size - 256, 0x10_0000 + size]
            .map(|address| bench.load_memory(address, 1)[0]);
        assert_eq!(bytes, [7, 0xFF, 0xFF, 7]);
    }
}

/// The controller asks for the status again and again until it is what it should be.
#[test]
fn a_status_is_polled() {
    let mut bench = bench();
    bench.store(0x02, 0, lines(1, 1), &[7]);
    bench.write(OCTOSPI + 0x80, 1);
    bench.write(OCTOSPI + 0x88, 0);
    bench.write(OCTOSPI + 0x90, 100);
    bench.write(DLR, 0);
    bench.command(POLLS | 1 << 22, 0x05, lines(0, 1), 0);
    assert_eq!(bench.read(SR) & (1 << 3 | BUSY), BUSY);
    bench.wait(4_000_000);
    assert_eq!(bench.read(SR) & (1 << 3 | BUSY), 1 << 3);
    assert_eq!(bench.load_memory(0, 1), [7]);
}

#[test]
fn a_cut_tears_a_page_and_a_sector() {
    let mut bench = bench();
    bench.store(0x02, 0, lines(1, 1), &[0; 256]);
    bench.cut_power();
    let torn = bench.machine.parts.memory.as_ref().unwrap().bytes(0, 256);
    assert!(
        torn.iter().any(|byte| *byte != 0) && torn.iter().any(|byte| *byte != 0xFF),
        "{torn:?}"
    );
}

impl Bench {
    fn cut_power(&mut self) {
        self.machine.inject(&ChipFault::CutPower, true).unwrap();
        self.wait(1_000_000);
        self.machine.inject(&ChipFault::CutPower, false).unwrap();
        self.wait(1_000);
    }
}

#[test]
fn what_is_not_modelled_and_what_is_wrong_is_told() {
    let bench = bench();
    let count = |bench: &Bench| bench.machine.soc().count(AccessKind::Unmodelled);
    bench.write(DLR, 0);
    bench.command(3 << 28, 0x6B, lines(1, FOUR), 8);
    bench.write(AR, 0);
    assert_eq!(count(&bench), 1, "memory-mapped");
    bench.command(READS, 0x6B, lines(1, 4), 8);
    bench.write(AR, 0);
    assert_eq!(count(&bench), 2, "eight lines");
    bench.command(READS, 0x6B, lines(1, FOUR), 8);
    bench.write(AR, 8 << 20);
    assert_eq!(bench.read(SR) & 1, 1, "behind the memory's end");
}
