//! The flash: programming, erasing, codes, and cuts of power. Source of what is expected: RM0468 and `facts` of others
//! who met it (Zephyr 33140, 34374, 60449, 103501; embassy 4777; `ArduPilot` 30013).

use super::*;

const INTERFACE: u32 = 0x5200_2000;
const KEYR: u32 = INTERFACE + 0x04;
const CR: u32 = INTERFACE + 0x0C;
const SR: u32 = INTERFACE + 0x10;
const CCR: u32 = INTERFACE + 0x14;
/// The last sector.
const KEPT: u32 = FLASH + 7 * 0x2_0000;

const LOCK: u32 = 1;
const PG: u32 = 1 << 1;
const SER: u32 = 1 << 2;
const FW: u32 = 1 << 6;
const START_ERASE: u32 = 1 << 7;
const SECTOR_7: u32 = 7 << 8;
/// 64 bits at once.
const X64: u32 = 3 << 4;

const BUSY: u32 = 0b101;
const WBNE: u32 = 0b10;
const EOP: u32 = 1 << 16;
const PGSERR: u32 = 1 << 18;
const STRBERR: u32 = 1 << 19;
const INCERR: u32 = 1 << 21;
const READ_ERRORS: u32 = 3 << 23;
const SNECCERR: u32 = 1 << 25;
const DBECCERR: u32 = 1 << 26;

/// `WFI`, and a branch back to it.
const SLEEPS: [u8; 4] = [0x30, 0xBF, 0xFD, 0xE7];

/// A chip whose program sleeps in ITCM, so that it goes on while the flash is busy.
fn bench(seed: u64) -> Bench {
    let options = Options { seed, ..Options::default() };
    let machine = Machine::with(&program(BRANCH, 1, HANDLER), options).unwrap();
    machine.memory.write(0, &SLEEPS).unwrap();
    let mut bench = Bench { machine, world: World::new(1) };
    bench.run_to(1_000);
    bench
}

impl Bench {
    fn unlock(&self) {
        self.write(KEYR, 0x4567_0123);
        self.write(KEYR, 0xCDEF_89AB);
        assert_eq!(self.read(CR) & LOCK, 0);
    }

    /// Writes eight words to the flash, which programs them.
    fn program_words(&self, address: u32, words: [u32; 8]) {
        self.write(CR, PG | X64);
        for (at, word) in (address..).step_by(4).zip(words) {
            self.write(at, word);
        }
    }

    /// Lets what runs end, and clears all flags.
    fn finish(&mut self) -> u32 {
        self.until_ready();
        let flags = self.read(SR);
        self.write(CCR, u32::MAX);
        flags & !READ_ERRORS
    }

    fn erase(&mut self) -> u64 {
        self.write(CR, SER | SECTOR_7 | X64);
        self.write(CR, SER | SECTOR_7 | X64 | START_ERASE);
        self.until_ready()
    }

    /// Time until the flash is no longer busy.
    fn until_ready(&mut self) -> u64 {
        let begin = self.machine.now().get();
        while self.read(SR) & BUSY != 0 {
            self.wait(5_000);
        }
        self.machine.now().get() - begin
    }

    fn cut(&mut self) {
        self.machine.inject(&ChipFault::CutPower, true).unwrap();
        self.wait(1_000_000);
        self.machine.inject(&ChipFault::CutPower, false).unwrap();
        self.machine.memory.write(0, &SLEEPS).unwrap();
        self.wait(1_000);
    }

    /// What the core would read; `None`: a fault of the bus.
    fn load(&self, address: u32) -> Option<u32> {
        self.machine.soc().read(address, Width::Word, self.machine.now()).ok()
    }
}

const WORDS: [u32; 8] = [0x0123_4567, 0x89AB_CDEF, 0, 1, 2, 3, 4, 5];

#[test]
fn two_keys_in_order_unlock_and_others_shut_until_the_next_reset() {
    let mut bench = bench(1);
    assert_eq!(bench.read(CR), 0x31, "locked, 64 bits at once");
    bench.write(CR, PG);
    assert_eq!(bench.machine.soc().count(AccessKind::Protected), 1);
    bench.unlock();
    bench.write(CR, LOCK);
    assert_eq!(bench.read(CR) & LOCK, LOCK);
    let wrong = |bench: &Bench| {
        bench.machine.soc().write(KEYR, Width::Word, 0x4567_0123, bench.machine.now()).unwrap();
        bench.machine.soc().write(KEYR, Width::Word, 0x1234_5678, bench.machine.now())
    };
    assert!(wrong(&bench).is_err(), "a fault of the bus");
    let now = bench.machine.now();
    assert!(bench.machine.soc().write(KEYR, Width::Word, 0x4567_0123, now).is_err());
    bench.machine.restart(ResetCause::Software);
    bench.wait(1_000);
    bench.unlock();
}

#[test]
fn a_word_is_programmed_when_it_is_whole_and_takes_its_time() {
    let mut bench = bench(1);
    bench.unlock();
    bench.write(CR, PG | X64);
    bench.write(KEPT, WORDS[0]);
    assert_eq!(bench.read(SR) & (BUSY | WBNE), WBNE);
    for (at, word) in (KEPT..).step_by(4).zip(WORDS).skip(1) {
        bench.write(at, word);
    }
    assert_eq!(bench.read(SR) & (BUSY | WBNE | EOP), BUSY);
    assert_eq!(bench.machine.memory.word(KEPT).unwrap(), u32::MAX, "not yet");
    let time = bench.until_ready();
    assert!((100_000..=210_000).contains(&time), "{time} ns");
    assert_eq!(bench.read(SR) & !READ_ERRORS, EOP);
    assert_eq!(bench.machine.memory.word(KEPT).unwrap(), WORDS[0]);
    // The status is cleared by the clear register alone.
    bench.write(SR, 0);
    assert_eq!(bench.read(SR) & EOP, EOP);
    bench.write(CCR, EOP);
    assert_eq!(bench.read(SR) & EOP, 0);
    // What is missing is written as ones, if that is forced.
    bench.write(KEPT + 32, 7);
    bench.write(CR, PG | X64 | FW);
    bench.finish();
    assert_eq!(bench.machine.memory.word(KEPT + 32).unwrap(), 7);
    assert_eq!(bench.machine.memory.word(KEPT + 36).unwrap(), u32::MAX);
}

#[test]
fn an_erased_sector_takes_one_to_four_seconds_by_the_width() {
    for (psize, typical) in [(0, 2000), (1, 1800), (2, 1100), (3, 1000)] {
        let mut bench = bench(psize);
        bench.unlock();
        bench.program_words(KEPT, WORDS);
        bench.finish();
        let control = SER | SECTOR_7 | u32::try_from(psize).unwrap() << 4;
        bench.write(CR, control);
        bench.write(CR, control | START_ERASE);
        let time = bench.until_ready() / 1_000_000;
        assert!((typical..=2 * typical).contains(&time), "PSIZE {psize}: {time} ms");
        assert_eq!(bench.machine.memory.word(KEPT).unwrap(), u32::MAX);
    }
}

#[test]
fn a_word_is_programmed_once_for_each_erase() {
    let mut bench = bench(1);
    bench.unlock();
    bench.program_words(KEPT, WORDS);
    bench.finish();
    // The same bits once more do no harm, others do, also if they only clear some.
    bench.program_words(KEPT, WORDS);
    bench.finish();
    assert_eq!(bench.load(KEPT), Some(WORDS[0]));
    bench.program_words(KEPT, [0; 8]);
    bench.finish();
    assert_eq!(bench.load(KEPT), None);
    assert_eq!(bench.read(SR) & DBECCERR, DBECCERR);
    assert_eq!(bench.load(KEPT + 32), Some(u32::MAX), "its neighbour");
    bench.erase();
    assert_eq!(bench.load(KEPT), Some(u32::MAX));
}

#[test]
fn wrong_sequences_are_flagged() {
    let mut bench = bench(1);
    let store = |bench: &Bench, address, width| {
        bench.machine.soc().write(address, width, 0, bench.machine.now())
    };
    assert!(store(&bench, KEPT, Width::Word).is_err(), "locked");
    bench.unlock();
    assert!(store(&bench, KEPT, Width::Word).is_err(), "PG is not set");
    assert_eq!(bench.finish(), PGSERR);
    bench.write(CR, X64 | START_ERASE);
    assert_eq!(bench.finish(), PGSERR, "nothing to start");
    bench.write(CR, PG | X64);
    store(&bench, KEPT, Width::Byte).unwrap();
    store(&bench, KEPT, Width::Byte).unwrap();
    assert_eq!(bench.finish(), STRBERR, "a byte twice");
    store(&bench, KEPT, Width::Word).unwrap();
    store(&bench, KEPT + 32, Width::Word).unwrap();
    assert_eq!(bench.finish(), INCERR, "another word");
    store(&bench, KEPT, Width::Word).unwrap();
    bench.write(CR, X64);
    assert_eq!(bench.read(SR) & WBNE, 0, "the buffer is lost without PG");
    assert_eq!(bench.load(KEPT), Some(u32::MAX));
}

#[test]
fn errors_and_ends_interrupt_if_they_are_enabled() {
    let mut bench = bench(1);
    let is_high = |bench: &Bench| bench.machine.soc().interrupt_levels()[0] >> 4 & 1 != 0;
    bench.unlock();
    bench.program_words(KEPT, WORDS);
    bench.wait(1_000_000);
    assert!(!is_high(&bench));
    bench.write(CR, EOP);
    assert!(is_high(&bench));
    bench.write(CCR, EOP);
    assert!(!is_high(&bench));
}

/// From ITCM the core goes on; from the flash it stands, as long as the flash is busy.
#[test]
fn the_core_waits_for_a_busy_flash() {
    for (instruction, address, stands) in [(BRANCH, 1, false), (LOAD, FLASH, true)] {
        let machine = Machine::new(&program(instruction, address, HANDLER)).unwrap();
        machine.memory.write(0, &0xE7FE_E7FE_u32.to_le_bytes()).unwrap();
        let mut bench = Bench { machine, world: World::new(1) };
        bench.run_to(1_000);
        bench.unlock();
        bench.write(CR, SER | SECTOR_7 | X64 | START_ERASE);
        bench.wait(1_000);
        bench.machine.profile.restart();
        bench.wait(50_000_000);
        let done = bench.machine.profile.total();
        assert!(if stands { done <= 1 } else { done > 1_000_000 }, "{address:#x}: {done}");
        bench.until_ready();
        bench.wait(50_000_000);
        assert!(bench.machine.profile.total() > 1_000_000, "it goes on");
    }
    // Meanwhile the watchdog runs on: 512 ms.
    let mut bench = Bench::new(LOAD, Options::default());
    bench.run_to(1_000);
    bench.write(0x5800_4800, 0xCCCC);
    bench.unlock();
    bench.write(CR, SER | SECTOR_7 | X64 | START_ERASE);
    bench.wait(600_000_000);
    let [restart] = bench.machine.restarts[..] else { panic!("{:?}", bench.machine.restarts) };
    assert_eq!(restart.cause, ResetCause::Watchdog);
    assert!((510..=515).contains(&(restart.at.get() / 1_000_000)), "{restart:?}");
}

/// What a cut leaves of a word, and of a sector.
#[test]
fn a_cut_tears_what_runs() {
    let (mut seen, mut weak) = ([0; 4], 0);
    for seed in 0..400 {
        let mut bench = bench(seed);
        bench.unlock();
        bench.program_words(KEPT, WORDS);
        bench.wait(seed * 500);
        bench.cut();
        let word = bench.load(KEPT);
        let flags = bench.read(SR) & (SNECCERR | DBECCERR);
        let whole: Vec<_> = (KEPT..KEPT + 32).step_by(4).map(|at| bench.load(at)).collect();
        let is_erased = whole.iter().all(|word| *word == Some(u32::MAX));
        seen[match (word, flags) {
            (None, DBECCERR) => 0,
            (Some(_), SNECCERR) => 1,
            (Some(_), 0) if is_erased => 2,
            (Some(_), 0) => 3,
            other => panic!("{other:?}"),
        }] += 1;
        if flags == SNECCERR || flags == 0 && !is_erased {
            assert_eq!(whole, WORDS.map(Some), "seed {seed}");
        }
        if is_erased {
            // It looks as if it could be programmed.
            bench.unlock();
            bench.program_words(KEPT, WORDS);
            bench.finish();
            weak += usize::from(bench.load(KEPT).is_none());
        }
    }
    println!("[double, single, erased, whole] {seen:?}, {weak} erased ones that take no word");
    assert!(seen.iter().all(|count| *count > 2) && weak > 2, "{seen:?} {weak}");
    // A sector in the middle of being erased has some of everything.
    let mut bench = bench(1);
    bench.unlock();
    for at in 0..64 {
        bench.program_words(KEPT + 32 * at, WORDS);
        bench.wait(300_000);
    }
    bench.write(CR, SER | SECTOR_7 | X64 | START_ERASE);
    bench.wait(700_000_000);
    bench.cut();
    let torn = (0..64).filter(|at| bench.load(KEPT + 32 * at).is_none()).count();
    assert!(torn > 20, "{torn} of 64");
}

/// A torn word is a fault at each read of the core: a program that reads it at its start never gets further.
#[test]
fn an_unguarded_read_of_a_torn_word_faults_at_every_boot() {
    let file = program(LOAD, KEPT, HANDLER);
    let mut bench = Bench { machine: Machine::new(&file).unwrap(), world: World::new(1) };
    bench.run_to(1_000);
    bench.unlock();
    bench.program_words(KEPT, WORDS);
    bench.wait(1_000_000);
    bench.program_words(KEPT, [0; 8]);
    bench.wait(1_000_000);
    for _ in 0..3 {
        bench.cut();
        bench.machine.profile.restart();
        bench.machine.restart(ResetCause::Pin);
        bench.wait(10_000);
        let faults = bench.machine.profile.by_exception();
        assert!(faults.iter().any(|cost| cost.exception == 3), "{faults:?}");
        assert_eq!(bench.read(SR) & DBECCERR, DBECCERR, "also with its interrupt off");
    }
}

/// With FAULTMASK and `BFHFNMIGN` the core goes on, and the flag tells.
#[test]
fn a_guarded_read_of_a_torn_word_goes_on() {
    // CPSID f; LDR R0, =CCR; LDR R1, =BFHFNMIGN; STR R1, [R0]; LDR R0, =KEPT; LDR R1, [R0]; then
    // LDR R2, =COUNT; MOVS R3, #7; STR R3, [R2]; B to itself.
    let code = [0xB671, 0x4804, 0x4904, 0x6001, 0x4804, 0x6801, 0x4A04, 0x2307, 0x6013, 0xE7FE];
    let literals = [0xE000_ED14, 1 << 8 | 1 << 9, KEPT, COUNT];
    let file = assemble(&[STACK, START | 1], START, &code, &literals);
    let mut bench = Bench { machine: Machine::new(&file).unwrap(), world: World::new(1) };
    bench.run_to(10_000);
    assert_eq!(bench.machine.memory.word(COUNT).unwrap(), 7);
    bench.unlock();
    bench.program_words(KEPT, WORDS);
    bench.wait(1_000_000);
    bench.program_words(KEPT, [0; 8]);
    bench.wait(1_000_000);
    bench.write(CCR, u32::MAX);
    bench.machine.memory.write(COUNT, &[0; 4]).unwrap();
    bench.machine.restart(ResetCause::Software);
    bench.wait(10_000);
    assert_eq!(bench.machine.memory.word(COUNT).unwrap(), 7, "it went on");
    assert_eq!(bench.read(SR) & DBECCERR, DBECCERR);
}

/// A DMA takes the bytes as they are, and the flag tells.
#[test]
fn a_dma_reads_a_torn_word_without_a_fault() {
    const DMA1: u32 = 0x4002_0000;
    let mut bench = bench(1);
    bench.unlock();
    bench.program_words(KEPT, WORDS);
    bench.finish();
    bench.program_words(KEPT, [0; 8]);
    bench.finish();
    bench.write(RCC + 0xD8, 1);
    for (offset, value) in [(0x14, 8), (0x18, KEPT), (0x1C, 0x2400_0000)] {
        bench.write(DMA1 + offset, value);
    }
    // Memory to memory, both count on, words.
    bench.write(DMA1 + 0x10, 2 << 13 | 2 << 11 | 1 << 10 | 1 << 9 | 2 << 6 | 1);
    bench.wait(10_000);
    assert_eq!(bench.read(DMA1) & 0x3D, 0x20 | 0x10, "complete, no error");
    assert_eq!(bench.machine.memory.word(0x2400_0000).unwrap(), 0);
    assert_eq!(bench.read(SR) & DBECCERR, DBECCERR);
}

/// Without an MPU the core looks ahead into protected memory now and then.
#[test]
fn looking_ahead_sets_read_errors() {
    let mut bench = bench(1);
    bench.wait(5_000_000);
    assert_eq!(bench.read(SR), READ_ERRORS);
    bench.write(CCR, READ_ERRORS);
    bench.wait(5_000_000);
    assert_eq!(bench.read(SR), READ_ERRORS, "again and again");
}

#[test]
fn a_worn_sector_fails_to_erase() {
    let mut bench = bench(1);
    bench.unlock();
    bench.program_words(KEPT, WORDS);
    bench.finish();
    bench.machine.soc().wear_flash(7);
    bench.erase();
    assert_eq!(bench.load(KEPT), Some(WORDS[0]));
    assert_eq!(bench.read(SR) & (1 << 22), 1 << 22, "OPERR");
}

/// AXI SRAM has a code for 64 bits, the others for 32: a reset discards what is less.
#[test]
fn a_reset_discards_the_last_word_of_ram_that_is_not_whole() {
    for (address, bytes, stays) in [
        (0x2000_0000, 4, true),
        (0x2000_0000, 2, false),
        (0x2400_0000, 4, false),
        (0x2400_0000, 8, true),
        (0x3800_0000, 4, true),
    ] {
        let mut bench = bench(1);
        let before = bench.machine.memory.word(address).unwrap();
        bench.machine.memory.write(address, &[0x5A; 8][..bytes]).unwrap();
        bench.machine.restart(ResetCause::Watchdog);
        let after = bench.machine.memory.word(address).unwrap();
        assert_eq!(after != before, stays, "{address:#x}, {bytes} bytes");
        // Another one written behind it takes it in.
        bench.machine.memory.write(address, &[0x5A; 8][..bytes]).unwrap();
        bench.machine.memory.write(address + 16, &[0x5A; 8]).unwrap();
        bench.machine.restart(ResetCause::Watchdog);
        assert_ne!(bench.machine.memory.word(address).unwrap(), before, "{address:#x}");
    }
}

#[test]
fn without_power_ram_is_lost_and_the_flash_is_kept() {
    let mut bench = bench(1);
    bench.unlock();
    bench.program_words(KEPT, WORDS);
    bench.finish();
    bench.machine.memory.write(COUNT, &[0x77; 4]).unwrap();
    bench.machine.profile.restart();
    bench.machine.inject(&ChipFault::CutPower, true).unwrap();
    bench.wait(1_000_000);
    assert_eq!(bench.machine.profile.total(), 0, "nothing is executed");
    bench.machine.inject(&ChipFault::CutPower, false).unwrap();
    bench.wait(1_000);
    assert!(bench.machine.profile.total() > 0);
    assert_ne!(bench.machine.memory.word(COUNT).unwrap(), 0x7777_7777);
    assert_eq!(bench.load(KEPT), Some(WORDS[0]));
    assert_eq!(bench.machine.restarts.last().unwrap().cause, ResetCause::PowerOn);
}
