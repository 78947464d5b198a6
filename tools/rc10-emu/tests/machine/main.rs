//! The whole chip with programs of a few instructions: what it refuses, and what becomes of it.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod bit_rates;
mod flash;
mod links;
mod memory;
mod parts;

use rc10_emu::fault::ChipFault;
use rc10_emu::peripherals::{AccessKind, ResetCause, Width};
use rc10_emu::{Machine, Options};
use rc10_sim::{Nanos, World};

const FLASH: u32 = 0x0800_0000;
const STACK: u32 = 0x2002_0000;
/// The first instruction, behind the vectors of the core's own exceptions.
const START: u32 = FLASH + 0x40;
/// `B` to itself, at [`START`] + 6: what handles faults.
const HANDLER: u32 = START + 6;

/// `LDR R1, [R0]`.
const LOAD: u16 = 0x6801;
/// `STR R1, [R0]`.
const STORE: u16 = 0x6001;
/// `BX R0`.
const BRANCH: u16 = 0x4700;
/// `CPSID i`.
const MASK: u16 = 0xB672;

/// An ELF file whose flash holds the bytes, at an address.
fn elf(address: u32, flash: &[u8]) -> Vec<u8> {
    let mut file = b"\x7fELF\x01\x01\x01".to_vec();
    file.resize(16, 0);
    let half = |file: &mut Vec<u8>, value: u16| file.extend(value.to_le_bytes());
    let word = |file: &mut Vec<u8>, value: u32| file.extend(value.to_le_bytes());
    // An executable for Arm.
    half(&mut file, 2);
    half(&mut file, 40);
    // Version, entry, program headers behind this header, no sections, flags.
    [1, address, 52, 0, 0].into_iter().for_each(|value| word(&mut file, value));
    // Sizes of this header and of a program header, one of these; no sections.
    [52, 32, 1, 40, 0, 0].into_iter().for_each(|value| half(&mut file, value));
    // To be loaded: from where in the file, where to, how much, read and execute, alignment.
    let length = u32::try_from(flash.len()).unwrap();
    let segment = [1, 84, address, address, length, length, 5, 4];
    segment.into_iter().for_each(|value| word(&mut file, value));
    file.extend(flash);
    file
}

/// A file with these vectors, all others at `other`, then instructions from [`START`] on, then words.
fn assemble(vectors: &[u32], other: u32, code: &[u16], literals: &[u32]) -> Vec<u8> {
    let mut words = vectors.to_vec();
    words.resize(16, other | 1);
    let mut flash: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    flash.extend(code.iter().flat_map(|half| half.to_le_bytes()));
    flash.extend(literals.iter().flat_map(|word| word.to_le_bytes()));
    elf(FLASH, &flash)
}

/// Loads an address into R0, executes an instruction, then loops; faults end in a loop, too.
fn program(instruction: u16, address: u32, fault_handler: u32) -> Vec<u8> {
    let vectors = [STACK, START | 1, HANDLER | 1, fault_handler | 1];
    // LDR R0, [PC, #4]
    assemble(&vectors, HANDLER, &[0x4801, instruction, 0xE7FE, 0xE7FE], &[address])
}

const fn micros(micros: u64) -> Nanos {
    Nanos::new(micros * 1000)
}

/// A chip in its world; the program only loops, and registers are written from outside.
struct Bench {
    machine: Machine,
    world: World,
}

impl Bench {
    fn new(instruction: u16, options: Options) -> Self {
        let machine = Machine::with(&program(instruction, START, HANDLER), options).unwrap();
        Self { machine, world: World::new(1) }
    }

    fn write(&self, address: u32, value: u32) {
        self.machine.soc().write(address, Width::Word, value, self.machine.now()).unwrap();
    }

    fn read(&self, address: u32) -> u32 {
        self.machine.soc().read(address, Width::Word, self.machine.now()).unwrap()
    }

    fn set(&self, address: u32, mask: u32, value: u32) {
        self.write(address, self.read(address) & !mask | value);
    }

    fn alternate(&self, port: u32, pin: u32, function: u32) {
        let base = 0x5802_0000 + 0x400 * port;
        self.set(base, 3 << (2 * pin), 2 << (2 * pin));
        let shift = 4 * (pin % 8);
        self.set(base + 0x20 + 4 * (pin / 8), 0xF << shift, function << shift);
    }

    fn run_to(&mut self, nanos: u64) {
        self.machine.run(&mut self.world, Nanos::new(nanos)).unwrap();
    }

    fn wait(&mut self, nanos: u64) {
        self.run_to(self.machine.now().get() + nanos);
    }
}

fn run(program: &[u8]) -> Machine {
    let mut machine = Machine::new(program).unwrap();
    machine.run(&mut World::new(1), micros(10)).unwrap();
    machine
}

fn reports(machine: &Machine) -> Vec<&str> {
    machine.reports.iter().map(|report| report.text.as_str()).collect()
}

/// The function that most instructions were in.
fn busiest(machine: &Machine) -> &str {
    machine.profile.by_function(&machine.image)[0].0
}

#[test]
fn what_has_no_owner_is_counted_wherever_it_is() {
    // Behind the flash, the bootloader's memory, behind DTCM, behind the peripherals.
    for address in [0x0810_0000, 0x1FF1_E800, STACK, 0x6000_0000, 0x9000_0000, 0xFFFF_FFF0] {
        for instruction in [LOAD, STORE, BRANCH] {
            // Thumb.
            let address = if instruction == BRANCH { address | 1 } else { address };
            let machine = run(&program(instruction, address, HANDLER));
            let reports = reports(&machine);
            assert_eq!(
                machine.soc().count(AccessKind::Unowned),
                1,
                "{address:#x} {instruction:#x} {reports:?}"
            );
            assert!(reports[0].contains(&format!("{:#010x}", address & !1)), "{reports:?}");
            assert!(machine.profile.by_exception().iter().any(|cost| cost.exception == 3));
        }
    }
    let machine = run(&program(LOAD, FLASH, HANDLER));
    assert_eq!((machine.soc().count(AccessKind::Unowned), &machine.reports[..]), (0, &[][..]));
}

#[test]
fn flash_is_not_written_and_peripherals_are_not_executed() {
    let stores = program(STORE, START + 4, HANDLER);
    let machine = run(&stores);
    assert_eq!(machine.soc().count(AccessKind::Protected), 1);
    assert_eq!(machine.memory.word(START + 4).unwrap(), 0xE7FE_E7FE);
    // RCC.
    let machine = run(&program(BRANCH, 0x5802_4401, HANDLER));
    assert_eq!(machine.soc().count(AccessKind::Unowned), 1, "{:?}", reports(&machine));
}

#[test]
fn a_core_that_locks_up_says_so_and_waits() {
    // The fault handler is nowhere.
    let machine = run(&program(LOAD, 0x9000_0000, 0xA000_0000));
    let reports = reports(&machine);
    assert!(reports.iter().any(|text| text.contains("locked up")), "{reports:?}");
    assert!(machine.now() >= micros(10) && machine.profile.total() < 10);
}

#[test]
fn what_is_no_program_for_this_chip_is_refused() {
    let program = program(LOAD, FLASH, HANDLER);
    // Another chip's flash is where this one has ITCM.
    for other in [elf(0, &program[84..]), elf(FLASH, &[0; 64]), elf(FLASH, &[0xFF; 64])] {
        let error = Machine::new(&other).err().unwrap().to_string();
        assert!(error.contains("vector table"), "{error}");
    }
    for text in [&b""[..], b"\x89PNG\r\n", &program[..80]] {
        assert!(Machine::new(text).is_err());
    }
}

/// At 64 MHz after the reset: two clocks or so for each turn of the loop.
#[test]
fn time_is_what_the_instructions_take() {
    let program = program(LOAD, FLASH, HANDLER);
    let mut machine = Machine::new(&program).unwrap();
    // At 480 MHz: so 64 million here.
    machine.set_speed(480_000_000);
    machine.run(&mut World::new(1), micros(1000)).unwrap();
    assert!(machine.profile.total().abs_diff(64_000) <= 1, "{}", machine.profile.total());
}

/// Reads a word at an address, then the cycle counter, and stores that in [`COUNT`], for ever.
fn counts_cycles(address: u32) -> Vec<u8> {
    // LDR R0, =DEMCR; LDR R1, =TRCENA; STR R1, [R0]; LDR R0, =DWT_CTRL; MOVS R1, #1; STR R1, [R0];
    // LDR R2, =COUNT; LDR R3, =address; then LDR R1, [R3]; LDR R1, [R0, #4]; STR R1, [R2]; B
    let code = [0x4805, 0x4906, 0x6001, 0x4806, 0x2101, 0x6001, 0x4A05, 0x4B06];
    let code = [&code[..], &[0x6819, 0x6841, 0x6011, 0xE7FB]].concat();
    let literals = [0xE000_EDFC, 1 << 24, 0xE000_1000, COUNT, address];
    assemble(&[STACK, START | 1], START, &code, &literals)
}

/// In DTCM.
const COUNT: u32 = 0x2000_0000;

/// Cycles are time times clock, independent of the program: 64 MHz after a reset.
#[test]
fn the_cycle_counter_counts_the_clocks_that_go_by() {
    // Flash; RCC_CR, which is behind two buses.
    for address in [FLASH, 0x5802_4400] {
        for speed in [None, Some(480_000_000), Some(111_000_000)] {
            let mut world = World::new(1);
            let mut machine = Machine::new(&counts_cycles(address)).unwrap();
            if let Some(speed) = speed {
                machine.set_speed(speed);
            }
            let mut count = |until| {
                machine.run(&mut world, micros(until)).unwrap();
                (machine.memory.word(COUNT).unwrap(), machine.profile.total())
            };
            let (before, after) = (count(100), count(10_100));
            let cycles = after.0.wrapping_sub(before.0);
            println!("{cycles} cycles, {} instructions", after.1 - before.1);
            // A turn of the loop more or less.
            assert!(cycles.abs_diff(640_000) < 100, "{address:#x} {speed:?}: {cycles}");
        }
    }
}

/// Faults at one moment happen one after the other.
#[test]
fn no_fault_is_forgotten() {
    let program = program(LOAD, FLASH, HANDLER);
    let mut machine = Machine::new(&program).unwrap();
    machine.inject(&ChipFault::HardFault, true).unwrap();
    machine.inject(&ChipFault::HardFault, true).unwrap();
    machine.run(&mut World::new(1), micros(10)).unwrap();
    // The second one in the first one's handler.
    assert!(reports(&machine)[0].contains("locked up"), "{:?}", reports(&machine));
}

/// A program that masks interrupts itself is not unmasked by a fault's end.
#[test]
fn a_mask_ends_as_it_began() {
    let mut world = World::new(1);
    let loops = program(LOAD, FLASH, HANDLER);
    let mut machine = Machine::new(&loops).unwrap();
    machine.run(&mut world, micros(1)).unwrap();
    machine.inject(&ChipFault::Mask, true).unwrap();
    machine.profile.restart();
    machine.run(&mut world, micros(2)).unwrap();
    assert_eq!(busiest(&machine), "(outside flash)");
    machine.inject(&ChipFault::Mask, false).unwrap();
    machine.profile.restart();
    machine.run(&mut world, micros(3)).unwrap();
    assert_eq!(busiest(&machine), "(no symbol)");

    let mut world = World::new(1);
    let mut machine = Machine::new(&program(MASK, 0, HANDLER)).unwrap();
    machine.run(&mut world, micros(1)).unwrap();
    machine.inject(&ChipFault::Mask, true).unwrap();
    machine.profile.restart();
    machine.run(&mut world, micros(2)).unwrap();
    assert_eq!(busiest(&machine), "(no symbol)", "the program's own mask never ends");
}

/// SRAM1 has a clock only if the program gives it one: for the core as for a DMA.
#[test]
fn a_memory_without_clock_is_told() {
    const SRAM1: u32 = 0x3000_0000;
    const AHB2ENR: u32 = 0x5802_44DC;
    let load = program(LOAD, SRAM1, HANDLER);
    let machine = run(&load);
    assert_eq!(machine.soc().count(AccessKind::Gated), 1);
    let report = reports(&machine)[0].to_owned();
    assert!(report.contains("SRAM1") && report.contains("without clock"), "{report}");

    // The first instructions are still the program's own: it has its clock before they get there.
    let mut machine = Machine::new(&load).unwrap();
    machine.soc().write(AHB2ENR, Width::Word, 1 << 29, Nanos::ZERO).unwrap();
    machine.memory.write(SRAM1, &[1, 2, 3, 4]).unwrap();
    machine.run(&mut World::new(1), Nanos::new(1)).unwrap();
    machine.run(&mut World::new(1), micros(10)).unwrap();
    assert_eq!((machine.soc().count(AccessKind::Gated), reports(&machine).len()), (0, 0));
    // A reset takes it away again, and the memory keeps its contents.
    machine.soc().reset(ResetCause::Software, micros(10));
    assert_eq!(machine.soc().memories_run(), [false; 2]);
    assert_eq!(machine.memory.word(SRAM1).unwrap(), 0x0403_0201);
}

const RCC: u32 = 0x5802_4400;

/// Switches HSE on and makes it the system clock: what a program does at first.
fn use_crystal(machine: &mut Machine, world: &mut World) {
    let write = |machine: &Machine, offset, value| {
        let now = machine.now();
        machine.soc().write(RCC + offset, Width::Word, value, now).unwrap();
    };
    write(machine, 0, 1 << 16 | 1);
    write(machine, 0x10, 2);
    machine.run(world, micros(3000)).unwrap();
    assert_eq!(machine.soc().clocks().core, rc10_emu::Board::H723ZG.crystal_hz);
}

/// The core takes the NMI at once, and does so again and again until the flag is cleared.
#[test]
fn clock_security_interrupts_the_core() {
    let mut world = World::new(1);
    let mut machine = Machine::new(&program(MASK, 0, HANDLER)).unwrap();
    use_crystal(&mut machine, &mut world);
    let now = machine.now();
    // CSSHSEON.
    machine.soc().write(RCC, Width::Word, 1 << 19 | 1 << 16 | 1, now).unwrap();
    machine.set_crystal(false);
    machine.profile.restart();
    machine.run(&mut world, micros(3010)).unwrap();
    // Interrupts are masked, and it is no interrupt that can be.
    let costs = machine.profile.by_exception();
    let nmi = costs.iter().find(|cost| cost.exception == 2).unwrap();
    assert!(nmi.entries == 1 && nmi.instructions > 10, "{costs:?}");
    assert_eq!(machine.soc().clocks().core, 64_000_000);
}

/// Nothing is executed, and only what LSI drives is left: the watchdog.
#[test]
fn without_clock_security_the_core_stands_and_the_watchdog_resets() {
    const IWDG: u32 = 0x5800_4800;
    let mut world = World::new(1);
    let mut machine = Machine::new(&program(LOAD, FLASH, HANDLER)).unwrap();
    // Started, its settings as after a reset: 4096 periods of 4 / 32 kHz, 512 ms.
    machine.soc().write(IWDG, Width::Word, 0xCCCC, Nanos::ZERO).unwrap();
    use_crystal(&mut machine, &mut world);
    machine.set_crystal(false);
    machine.profile.restart();
    machine.run(&mut world, micros(511_999)).unwrap();
    assert_eq!((machine.profile.total(), machine.restarts.len()), (0, 0));
    machine.run(&mut world, micros(512_100)).unwrap();
    let causes: Vec<_> = machine.restarts.iter().map(|restart| restart.cause).collect();
    assert_eq!(causes, [ResetCause::Watchdog]);
    assert!(machine.profile.total() > 0, "it runs on HSI again");
}

/// An address in DTCM, where a program's statics are.
const STATIC: u32 = 0x2000_1000;

/// A program that keeps a count in RAM and takes for granted that it starts at zero, as `.bss` does
/// and `.uninit` does not: counts it up, and executes an undefined instruction if it is beyond 100.
/// `clears`: it writes a zero first.
fn counter(clears: bool) -> Vec<u8> {
    const LOOP: u32 = START + 18;
    let code = [
        0x4804,                               // LDR R0, [PC, #16]: the address
        if clears { 0x2100 } else { 0xE000 }, // MOVS R1, #0; or on behind the next
        0x6001,                               // STR R1, [R0]
        0x6801,                               // LDR R1, [R0]
        0x3101,                               // ADDS R1, #1
        0x2964,                               // CMP R1, #100
        0xD900,                               // BLS, over the next
        0xDE00,                               // UDF #0
        0x6001,                               // STR R1, [R0]
        0xE7FE,                               // B to itself: faults end here, too
    ];
    assemble(&[STACK, START | 1], LOOP, &code, &[STATIC])
}

#[test]
fn ram_that_was_never_written_is_noise() {
    for seed in 0..20 {
        let run = |program: &[u8]| {
            let options = Options { seed, ..Options::default() };
            let mut machine = Machine::with(program, options).unwrap();
            machine.run(&mut World::new(1), micros(10)).unwrap();
            let faults = machine.profile.by_exception();
            (faults.iter().any(|cost| cost.exception == 3), machine.memory.word(STATIC).unwrap())
        };
        assert_eq!(run(&counter(true)), (false, 1));
        let (fails, first) = run(&counter(false));
        assert!(fails, "{seed}: it began with {first}");
        // The same seed, the same noise.
        assert_eq!(run(&counter(false)), (fails, first));
    }
}

/// Every RAM has its own noise, and a reset keeps its contents.
#[test]
fn power_comes_with_noise_in_every_ram() {
    let machine = run(&program(LOAD, FLASH, HANDLER));
    let mut seen = std::collections::BTreeSet::new();
    for bank in machine.memory.banks().iter().filter(|bank| bank.base != FLASH) {
        let words = (0..64).map(|word| machine.memory.word(bank.base + 256 + 4 * word).unwrap());
        assert!(words.into_iter().all(|word| seen.insert(word)), "{}", bank.name);
    }
    let before = machine.memory.word(STATIC).unwrap();
    machine.soc().reset(ResetCause::Watchdog, micros(10));
    assert_eq!(machine.memory.word(STATIC).unwrap(), before);
}

/// Instructions are what they were; time is not.
#[test]
fn an_access_takes_what_the_buses_take() {
    let instructions = |address| {
        let mut machine = Machine::new(&program(LOAD, address, HANDLER)).unwrap();
        // At 480 MHz: 64 million here, one a clock.
        machine.set_speed(480_000_000);
        machine.run(&mut World::new(1), micros(1000)).unwrap();
        machine.profile.total()
    };
    let alone = instructions(FLASH);
    // All buses at the core's 64 MHz. RCC, on AHB4; IWDG1, on APB4; DMA1 without its clock, on AHB1.
    for (address, clocks) in [(0x5802_4400, 12), (0x5800_4800, 16), (0x4002_0000, 12)] {
        assert_eq!(alone - instructions(address), clocks, "{address:#x}");
    }
}

/// RM0468, power control: no write to a RAM before ACTVOSRDY. The write is done all the same.
#[test]
fn ram_written_before_the_supply_is_configured_is_told_if_asked_for() {
    const CR3: u32 = 0x5802_480C;
    let stores = counter(true);
    assert_eq!(run(&stores).reports, [], "as every start-up code does");
    let options = Options { reports_early_ram: true, ..Options::default() };
    let mut machine = Machine::with(&stores, options).unwrap();
    machine.run(&mut World::new(1), micros(10)).unwrap();
    let reports = reports(&machine);
    // Once, although it stores twice.
    assert!(reports.len() == 1 && reports[0].contains("before the supply"), "{reports:?}");
    assert!(reports[0].contains("0x20001000"), "{reports:?}");
    assert_eq!(machine.memory.word(STATIC).unwrap(), 1);

    // LDOEN is written before its first instruction.
    let mut machine = Machine::with(&stores, options).unwrap();
    machine.soc().write(CR3, Width::Word, 0b010, Nanos::ZERO).unwrap();
    machine.run(&mut World::new(1), Nanos::new(1)).unwrap();
    machine.run(&mut World::new(1), micros(10)).unwrap();
    assert_eq!(machine.reports, []);
    assert_eq!(machine.memory.word(STATIC).unwrap(), 1);
}

/// A program that measures with `SysTick` what a load takes, and says it at [`STATIC`].
fn stopwatch(address: u32) -> Vec<u8> {
    let code: [u16; 12] = [
        0x4805, // LDR R0, =SYST_CSR
        0x21FF, // MOVS R1, #255
        0x6041, // STR R1, [R0, #4]: SYST_RVR
        0x2105, // MOVS R1, #5
        0x6001, // STR R1, [R0]: enabled, the core's clock
        0x4A04, // LDR R2, =address
        0x6813, // LDR R3, [R2]
        0x6884, // LDR R4, [R0, #8]: SYST_CVR
        0x4D03, // LDR R5, =STATIC
        0x602C, // STR R4, [R5]
        0xE7FE, // B to itself
        0xBF00, // NOP
    ];
    let literals = [0xE000_E010, address, STATIC];
    assemble(&[STACK, START | 1], START + 0x14, &code, &literals)
}

/// A program's own clock sees what its accesses take.
#[test]
fn systick_goes_on_while_the_core_waits_for_a_bus() {
    let left = |address| run(&stopwatch(address)).memory.word(STATIC).unwrap();
    assert_eq!(left(FLASH) - left(0x5802_4400), 12);
}

/// A program whose `SysTick` interrupts it everywhere, also in a block of IT whose rest must not be
/// executed: how often it was interrupted stands behind [`STATIC`], and there whether the rest was.
fn conditional() -> Vec<u8> {
    let mut vectors = [(START + 0x22) | 1; 15];
    (vectors[0], vectors[1]) = (STACK, START | 1);
    let code: [u16; 22] = [
        0x480A, // LDR R0, =SYST_CSR
        0x4D0B, // LDR R5, =STATIC
        0x2400, // MOVS R4, #0
        0x602C, // STR R4, [R5]
        0x606C, // STR R4, [R5, #4]
        0x2125, // MOVS R1, #37
        0x6041, // STR R1, [R0, #4]: SYST_RVR
        0x2107, // MOVS R1, #7
        0x6001, // STR R1, [R0]: enabled, with its interrupt, the core's clock
        0x2201, // loop: MOVS R2, #1
        0xBF12, // ITEE NE
        0x2301, // MOVNE R3, #1
        0x2200, // MOVEQ R2, #0
        0x2200, // MOVEQ R2, #0
        0x2A01, // CMP R2, #1
        0xD0F8, // BEQ loop
        0x6028, // STR R0, [R5]
        0xE7FE, // B to itself: faults end here, too
        0x6869, // SysTick: LDR R1, [R5, #4]
        0x3101, // ADDS R1, #1
        0x6069, // STR R1, [R5, #4]
        0x4770, // BX LR
    ];
    assemble(&vectors, START + 0x24, &code, &[0xE000_E010, STATIC])
}

/// Armv7-M ARM B1.5.6: an exception stacks the whole of xPSR, and its return goes on in the block.
#[test]
fn an_interrupt_in_a_block_of_it_does_not_end_it() {
    let mut machine = Machine::new(&conditional()).unwrap();
    machine.run(&mut World::new(1), micros(1000)).unwrap();
    let word = |offset| machine.memory.word(STATIC + offset).unwrap();
    assert!(word(4) > 500, "{} interrupts", word(4));
    assert_eq!(word(0), 0, "the rest of the block was executed");
}
