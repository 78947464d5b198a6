//! Exceptions: order, nesting, frames, faults.

use super::super::{Core, IT, Step, T};
use super::{CODE, DATA, HANDLERS, STACK, put, steps, wide, with_code};
use crate::memory::FLASH;

const NOP: u16 = 0xBF00;
const SVC: u16 = 0xDF00;
const UDF: u16 = 0xDE00;
const LOAD: u16 = 0x6808;

const CFSR: usize = 0xD28 / 4;
const HFSR: usize = 0xD2C / 4;
const MMFAR: usize = 0xD34 / 4;
const BFAR: usize = 0xD38 / 4;

/// Allows external interrupts at these priorities.
fn enable(core: &mut Core, interrupts: &[(u32, u32)]) {
    for &(interrupt, priority) in interrupts {
        core.write_system(0xE000_E100 + interrupt / 32 * 4, 1 << (interrupt % 32));
        core.store(0xE000_E400 + interrupt, 1, priority << 4).unwrap();
    }
}

fn raise(core: &mut Core, interrupts: &[u32]) {
    let mut levels = [0; 6];
    interrupts
        .iter()
        .for_each(|&interrupt| levels[interrupt as usize / 32] |= 1 << (interrupt % 32));
    core.set_interrupts(levels);
}

/// MSR, from R12.
fn set_special(core: &mut Core, number: u32, value: u32) {
    core.r[12] = value;
    core.write_special(number, 0, 12).unwrap();
}

fn entered(core: &mut Core) -> Option<u16> {
    match core.step().0 {
        Step::Entry(exception) => Some(exception),
        _ => None,
    }
}

#[test]
fn the_more_urgent_interrupts_and_the_other_waits() {
    let (mut core, _) = with_code(&[NOP; 8]);
    enable(&mut core, &[(5, 8), (40, 4), (160, 8)]);
    raise(&mut core, &[5, 160]);
    // Of equal ones the first; then the more urgent one, over it.
    assert_eq!(core.step(), (Step::Entry(21), 20));
    assert_eq!((core.r[14], core.r[13]), (0xFFFF_FFF9, STACK - 32));
    raise(&mut core, &[5, 40, 160]);
    assert_eq!(entered(&mut core), Some(56));
    assert_eq!(core.r[14], 0xFFFF_FFF1);
    raise(&mut core, &[160]);
    // Back, and from there without a return to the one that waits, and to the thread.
    assert_eq!(core.step(), (Step::Entry(21), 19));
    assert_eq!(core.step(), (Step::Entry(176), 7));
    raise(&mut core, &[]);
    assert_eq!(core.step(), (Step::Instruction, 19));
    assert_eq!((core.exception(), core.r[13], core.r[15]), (0, STACK, CODE));
}

#[test]
fn a_level_that_stays_comes_again_and_one_that_ended_does_not() {
    let (mut core, _) = with_code(&[NOP; 4]);
    enable(&mut core, &[(3, 0)]);
    raise(&mut core, &[3]);
    assert_eq!(entered(&mut core), Some(19));
    core.step();
    assert_eq!(core.exception(), 19);
    raise(&mut core, &[]);
    core.step();
    assert_eq!(core.exception(), 0);
    assert_eq!(steps(&mut core, 2), [(Step::Instruction, 1); 2]);
}

#[test]
fn masks_keep_interrupts_away() {
    // CPSID i, CPSIE i.
    let (mut core, _) = with_code(&[0xB672, NOP, 0xB662, NOP]);
    enable(&mut core, &[(3, 5)]);
    core.step();
    raise(&mut core, &[3]);
    assert_eq!(core.step().0, Step::Instruction);
    assert_eq!(core.step().0, Step::Instruction);
    assert_eq!(entered(&mut core), Some(19));
    // BASEPRI: 5 is not urgent enough beside 5, and is beside 6.
    let (mut core, _) = with_code(&[NOP; 4]);
    enable(&mut core, &[(3, 5)]);
    set_special(&mut core, 17, 5 << 4);
    raise(&mut core, &[3]);
    assert_eq!(core.step().0, Step::Instruction);
    set_special(&mut core, 17, 6 << 4);
    assert_eq!(entered(&mut core), Some(19));
}

#[test]
fn groups_decide_who_interrupts_and_the_rest_who_is_first() {
    let (mut core, _) = with_code(&[NOP; 4]);
    // Two bits for groups, two for the order in them.
    core.write_system(0xE000_ED0C, 0x05FA_0000 | 5 << 8);
    enable(&mut core, &[(1, 6), (2, 5), (3, 3)]);
    raise(&mut core, &[1, 2]);
    assert_eq!(entered(&mut core), Some(18));
    raise(&mut core, &[1]);
    assert_eq!(core.step().0, Step::Entry(17));
    raise(&mut core, &[1, 3]);
    assert_eq!(entered(&mut core), Some(19));
}

#[test]
fn a_block_goes_on_after_an_interrupt() {
    // ITTE EQ; ADDEQ, ADDEQ, ADDNE R0, #1.
    let (mut core, memory) = with_code(&[0xBF06, 0x3001, 0x3001, 0x3001, NOP]);
    core.psr |= 1 << 30;
    core.r[0] = 0;
    enable(&mut core, &[(3, 0)]);
    steps(&mut core, 2);
    let state = core.psr & IT;
    raise(&mut core, &[3]);
    assert_eq!(entered(&mut core), Some(19));
    assert_eq!(core.psr & IT, 0);
    assert_eq!(memory.word(core.r[13] + 28).unwrap() & IT, state);
    raise(&mut core, &[]);
    core.step();
    assert_eq!((core.psr & IT, core.exception()), (state, 0));
    steps(&mut core, 2);
    assert_eq!((core.r[0], core.r[15], core.psr & IT), (2, CODE + 8, 0));
}

#[test]
fn a_fault_in_a_block_keeps_its_place_and_a_call_is_past_it() {
    for (instruction, past) in [(UDF, false), (SVC, true)] {
        // ITT EQ.
        let (mut core, memory) = with_code(&[0xBF04, instruction, NOP]);
        core.psr |= 1 << 30;
        core.step();
        let state = core.psr & IT;
        assert!(matches!(core.step().0, Step::Entry(3 | 11)));
        let stacked = memory.word(core.r[13] + 28).unwrap() & IT;
        assert_eq!(stacked == state, !past, "{stacked:x} {state:x}");
        assert_ne!(stacked, 0);
        assert_eq!(memory.word(core.r[13] + 24).unwrap(), CODE + if past { 4 } else { 2 });
    }
}

#[test]
fn frames_are_aligned_and_say_so() {
    let (mut core, memory) = with_code(&[SVC, NOP]);
    core.r[13] = STACK - 4;
    assert_eq!(entered(&mut core), Some(11));
    assert_eq!(core.r[13], STACK - 40);
    assert_ne!(memory.word(core.r[13] + 28).unwrap() & 1 << 9, 0);
    core.step();
    assert_eq!((core.r[13], core.psr), (STACK - 4, T));
}

#[test]
fn processes_have_their_own_stack() {
    let (mut core, _) = with_code(&[SVC, NOP]);
    set_special(&mut core, 9, DATA);
    set_special(&mut core, 20, 2);
    assert_eq!((core.r[13], core.other_stack), (DATA, STACK));
    assert_eq!(entered(&mut core), Some(11));
    assert_eq!((core.r[13], core.other_stack, core.r[14]), (STACK, DATA - 32, 0xFFFF_FFFD));
    core.step();
    assert_eq!((core.r[13], core.other_stack), (DATA, STACK));
}

#[test]
fn faults_have_handlers_or_are_hard_ones() {
    let (mut core, _) = with_code(&[UDF]);
    assert_eq!(entered(&mut core), Some(3));
    assert_eq!((core.system.word(CFSR), core.system.word(HFSR)), (1 << 16, 1 << 30));
    let (mut core, _) = with_code(&[UDF]);
    core.write_system(0xE000_ED24, 7 << 16);
    assert_eq!(entered(&mut core), Some(6));
    assert_eq!((core.system.word(CFSR), core.system.word(HFSR)), (1 << 16, 0));
    // LDR R0, [R1] from nowhere.
    let (mut core, _) = with_code(&[LOAD]);
    core.write_system(0xE000_ED24, 7 << 16);
    core.r[1] = 0x7000_0000;
    assert_eq!(entered(&mut core), Some(5));
    assert_eq!((core.system.word(CFSR), core.system.word(BFAR)), (0x8200, 0x7000_0000));
    // Code that is not Thumb.
    let (mut core, _) = with_code(&[0x4708]);
    core.r[1] = CODE;
    assert_eq!(entered(&mut core), Some(3));
    assert_eq!(core.system.word(CFSR), 1 << 17);
}

#[test]
fn a_fault_in_the_fault_handler_ends_everything() {
    let (mut core, memory) = with_code(&[UDF]);
    put(&memory, HANDLERS + 48, &[UDF]);
    assert_eq!(entered(&mut core), Some(3));
    assert_eq!(core.step().0, Step::LockedUp);
    assert_eq!((core.r[15], core.step()), (0xFFFF_FFFE, (Step::LockedUp, 1)));
    core.reset();
    assert_eq!((core.r[15], core.exception()), (HANDLERS + 16, 0));
}

#[test]
fn division_and_alignment_fault_if_they_are_to() {
    // UDIV R0, R0, R1.
    let divide = wide(0xFBB0_F0F1);
    let (mut core, _) = with_code(&divide);
    core.r[1] = 0;
    assert_eq!((core.step(), core.r[0]), ((Step::Instruction, 3), 0));
    for (code, bit) in [(divide.to_vec(), 25), (vec![LOAD], 24)] {
        let (mut core, _) = with_code(&code);
        core.write_system(0xE000_ED14, 1 << 4 | 1 << 3);
        core.r[1] = if bit == 25 { 0 } else { DATA + 1 };
        assert_eq!(entered(&mut core), Some(3));
        assert_eq!(core.system.word(CFSR), 1 << bit);
    }
}

/// Region 0: `attributes`, of 4 KiB at `DATA`.
fn protect(core: &mut Core, attributes: u32) {
    core.write_system(0xE000_ED9C, DATA | 1 << 4);
    core.write_system(0xE000_EDA0, attributes | 11 << 1 | 1);
    // On, with the background.
    core.write_system(0xE000_ED94, 5);
    core.write_system(0xE000_ED24, 7 << 16);
}

#[test]
fn the_mpu_forbids() {
    let load = |attributes, at| {
        let (mut core, _) = with_code(&[LOAD]);
        protect(&mut core, attributes);
        core.r[1] = at;
        let entered = entered(&mut core);
        (entered, core.system.word(CFSR), core.system.word(MMFAR))
    };
    assert_eq!(load(0, DATA + 0xFFC), (Some(4), 0x82, DATA + 0xFFC));
    // Next to it; half of an access in it; a part of it that is switched off.
    assert_eq!(load(0, DATA + 0x1000).0, None);
    assert_eq!(load(0, DATA - 2), (Some(4), 0x82, DATA - 2));
    assert_eq!(load(1 << 15, DATA + 0xFFC).0, None);
    assert_eq!(load(1 << 15, DATA + 0xDFC).0, Some(4));
    // Read only, also for the privileged.
    assert_eq!(load(6 << 24, DATA).0, None);
    let (mut core, _) = with_code(&[0x6008]);
    protect(&mut core, 6 << 24);
    core.r[1] = DATA;
    assert_eq!(entered(&mut core), Some(4));
    // Never to be executed, or only without privileges not to be read.
    for (attributes, control, entry) in
        [(3 << 24 | 1 << 28, 0, Some(4)), (1 << 24, 1, Some(4)), (3 << 24, 0, None)]
    {
        let (mut core, memory) = with_code(&[0x4708]);
        put(&memory, DATA, &[NOP]);
        protect(&mut core, attributes);
        core.r[1] = DATA | 1;
        core.step();
        set_special(&mut core, 20, control);
        assert_eq!(entered(&mut core), entry);
        // Without privileges there is no stack, either.
        let stack = u32::from(control == 1) << 4;
        assert_eq!(core.system.word(CFSR), u32::from(entry.is_some()) | stack);
    }
}

#[test]
fn the_mpu_is_off_in_hard_faults_unless_it_is_to_be_on() {
    for (control, step) in [(5, Step::Instruction), (7, Step::LockedUp)] {
        let (mut core, memory) = with_code(&[LOAD, UDF]);
        put(&memory, HANDLERS + 48, &[LOAD]);
        core.r[1] = DATA;
        // What was permitted before is not any more.
        core.step();
        protect(&mut core, 0);
        core.write_system(0xE000_ED24, 0);
        core.write_system(0xE000_ED94, control);
        assert_eq!(entered(&mut core), Some(3));
        assert_eq!(core.step().0, step);
    }
}

#[test]
fn a_stack_without_memory_is_a_fault_of_its_own() {
    let (mut core, _) = with_code(&[NOP, NOP]);
    core.write_system(0xE000_ED24, 7 << 16);
    enable(&mut core, &[(3, 9)]);
    core.r[13] = 0x2000_0008;
    raise(&mut core, &[3]);
    // It is more urgent than the interrupt, which comes next.
    assert_eq!(entered(&mut core), Some(5));
    assert_eq!(core.system.word(CFSR), 1 << 12);
    assert_ne!(core.system.pending[0] & 1 << 19, 0);
}

#[test]
fn registers_of_the_fpu_are_kept_when_they_are_used() {
    // VADD.F32 S0, S0, S0, also in the handler.
    let add = wide(0xEE30_0A00);
    for uses in [false, true] {
        let (mut core, memory) = with_code(&[&add[..], &[SVC, NOP]].concat());
        *core.system.word_mut(0xD88 / 4) = 0xF << 20;
        put(&memory, HANDLERS + 16 * 11, &[if uses { add[0] } else { NOP }, add[1], 0x4770]);
        if !uses {
            put(&memory, HANDLERS + 16 * 11, &[NOP, 0x4770]);
        }
        core.s[0] = 1.5_f32.to_bits();
        core.step();
        assert_eq!(core.control & 4, 4);
        // A comparison's conditions, and another way to round.
        core.fpscr = 0xA040_0000;
        assert_eq!(core.step(), (Step::Entry(11), 21));
        assert_eq!((core.r[13], core.r[14]), (STACK - 104, 0xFFFF_FFE9));
        assert_eq!(core.system.word(0xF34 / 4) & 1, 1);
        let (step, clocks) = core.step();
        assert_eq!((step, clocks), (Step::Instruction, if uses { 18 } else { 1 }));
        // What it begins with is FPDSCR's, when it begins.
        assert_eq!(core.fpscr >> 22 & 3, if uses { 0 } else { 1 });
        let (_, clocks) = core.step();
        assert_eq!(clocks, if uses { 36 } else { 19 });
        assert_eq!((core.s[0], core.control & 4), (3.0_f32.to_bits(), 4));
        // The branch that comes next goes where it was to go.
        assert_eq!(core.fpscr, 0xA040_0000);
        assert_eq!((core.r[13], core.system.word(0xF34 / 4) & 1), (STACK, 0));
    }
}

#[test]
fn the_fpu_is_off_until_it_is_on() {
    let (mut core, _) = with_code(&wide(0xEE30_0A00));
    assert_eq!(entered(&mut core), Some(3));
    assert_eq!(core.system.word(CFSR), 1 << 19);
}

#[test]
fn code_that_is_written_is_executed() {
    let (mut core, memory) = with_code(&[0x2001, 0xE7FD]);
    steps(&mut core, 2);
    // From outside, as a DMA does; then by the core.
    put(&memory, CODE, &[0x2002]);
    steps(&mut core, 2);
    assert_eq!(core.r[0], 2);
    core.store(CODE, 2, 0x2003).unwrap();
    steps(&mut core, 1);
    assert_eq!(core.r[0], 3);
}

#[test]
fn it_sleeps_until_something_comes() {
    // WFI, WFE, SEV, WFE.
    let (mut core, _) = with_code(&[0xBF30, 0xBF20, 0xBF40, 0xBF20, NOP]);
    enable(&mut core, &[(3, 0)]);
    core.primask = true;
    assert_eq!(core.step(), (Step::Instruction, 1));
    assert_eq!(steps(&mut core, 2), [(Step::Asleep, 1); 2]);
    raise(&mut core, &[3]);
    // It wakes, and does not handle it: that is masked.
    assert_eq!(core.step().0, Step::Instruction);
    assert_eq!(core.r[15], CODE + 4);
    raise(&mut core, &[]);
    core.write_system(0xE000_E280, 1 << 3);
    assert_eq!(core.step().0, Step::Asleep);
    core.primask = false;
    raise(&mut core, &[3]);
    assert_eq!(entered(&mut core), Some(19));
    raise(&mut core, &[]);
    // Back; an event is left, and taken: it does not sleep.
    assert_eq!(
        steps(&mut core, 3),
        [(Step::Instruction, 19), (Step::Instruction, 1), (Step::Instruction, 1)]
    );
    assert_eq!(core.step().0, Step::Instruction);
}

#[test]
fn its_own_timer_counts_and_interrupts() {
    let (mut core, _) = with_code(&[NOP; 16]);
    core.write_system(0xE000_E014, 4);
    core.write_system(0xE000_E010, 3);
    // One clock to reload, four down to zero.
    assert_eq!(core.clocks_until_timer(), Some(5));
    assert!(steps(&mut core, 5).iter().all(|step| *step == (Step::Instruction, 1)));
    assert_eq!(entered(&mut core), Some(15));
    assert_ne!(core.read_system(0xE000_E010, true) & 1 << 16, 0);
    assert_eq!(core.read_system(0xE000_E010, true) & 1 << 16, 0);
}

#[test]
fn a_reset_is_asked_for_with_its_key() {
    let (mut core, _) = with_code(&[NOP]);
    core.write_system(0xE000_ED0C, 4);
    assert!(!core.take_reset_request());
    core.write_system(0xE000_ED0C, 0x05FA_0004);
    assert!(core.take_reset_request() && !core.take_reset_request());
}

#[test]
fn registers_say_what_there_is() {
    let (mut core, _) = with_code(&[NOP; 3]);
    for (address, value) in [
        (0xE000_ED00, 0x411F_C271),
        (0xE000_ED08, FLASH),
        (0xE000_ED14, 0x200),
        (0xE000_EF40, 0x1011_0221),
        (0xE000_1000, 0x0D00_0000),
        (0xE000_ED90, 16 << 8),
    ] {
        assert_eq!(core.load(address, 4).unwrap(), value, "{address:x}");
    }
    // The cycle counter stands until traces are on.
    core.store(0xE000_1000, 4, 1).unwrap();
    core.step();
    assert_eq!(core.load(0xE000_1004, 4).unwrap(), 0);
    core.store(0xE000_EDFC, 4, 1 << 24).unwrap();
    core.store(0xE000_1000, 4, 1).unwrap();
    core.step();
    assert_eq!(core.load(0xE000_1004, 4).unwrap(), 1);
}

#[test]
fn nothing_that_is_executed_ends_the_emulator() {
    let mut random = super::random::Random::new(10);
    let (mut core, _) = with_code(&[NOP]);
    for round in 0..4000 {
        core.reset();
        for register in 0..15 {
            core.r[register] = if random.below(3) == 0 { DATA } else { random.number() };
        }
        // Also with the FPU, the MPU, without privileges, and with a stack at the end of all memory.
        *core.system.word_mut(0xD88 / 4) = 0xF << 20;
        if round % 4 == 1 {
            protect(&mut core, random.word() & 0x1700_FF00);
        }
        core.control = random.below(8);
        core.r[13] = random.one_of(&[STACK, 4, 0, 0xFFFF_FFFC, 0x2000_0010]);
        core.fpscr = random.word() & 0xF3C0_009F;
        core.r[15] = 0x2000_0000 + (random.below(0x1_0000) & !1);
        core.write_system(0xE000_ED24, random.below(8) << 16);
        raise(&mut core, &[random.below(160)]);
        core.write_system(0xE000_E100, random.word());
        steps(&mut core, 500);
    }
}
