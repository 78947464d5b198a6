//! Another core, that does what ours does: rsemu 0.0.7.
//!
//! Where it differs from the manual (ARM DDI 0403E), ours does what the manual says, and the tests
//! leave it out or say so:
//!
//! * xPSR is stacked without the state of an IT block, and that state goes on by one after a fault
//!   and after a return (B1.5.6).
//! * The base of an LDM has changed when one of its loads faults.
//! * BASEPRI keeps bits of priorities that do not exist (B1.4.3), and of two pending exceptions of
//!   one group the subpriority does not count (B1.5.4).
//! * BKPT and SVC inside `HardFault` enter it again: the core locks up (B1.5.15).
//! * A stack that takes no frame sets flags, and is no exception of its own (B1.5.14); an MPU's fault
//!   there counts as a bus fault.
//! * `ICSR` does not say which exception is active (B3.2.4); 8 regions in place of the chip's 16.
//! * VSUB changes the sign of a NaN that is subtracted; a result flushed to zero is inexact, too;
//!   VFMA tells of no flushed operand beside a NaN; singles are not flushed on their way to half
//!   precision; fixed point is scaled step by step, with the flags of each, and 16 bits of it are
//!   left without their sign (A2.5). There is no double precision.
//!
//! As in rsemu, and not as in the manual: exceptions leave no event for WFE, unaligned accesses to
//! peripherals go by bytes.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use rsemu::core::error::BusError;
use rsemu::core::space::{AddressSpace, MemAttrs, MemOps, MemResult, Region};
use rsemu::cpu::arm::v7m::{ArmV7m, Config, Regs};

use super::super::{Core, EXCEPTION, IT, Step};
use crate::memory::{FLASH, Memory};

/// A load or a store of our core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Traced {
    pub(crate) address: u32,
    pub(crate) bytes: u32,
    pub(crate) value: u32,
    pub(crate) stores: bool,
}

/// What the other core sees for memory: what ours saw, in the same order.
struct Replay {
    memory: Memory,
    trace: Mutex<VecDeque<Traced>>,
    complaint: Mutex<Option<String>>,
}

impl std::fmt::Debug for Replay {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("replay")
    }
}

impl Replay {
    fn complain(&self, text: String) {
        self.complaint.lock().unwrap().get_or_insert(text);
    }

    /// The byte that our core loaded, or stored; an access that is not aligned comes in bytes.
    fn next(&self, address: u32, bytes: u32, stores: bool) -> Option<u32> {
        let mut trace = self.trace.lock().unwrap();
        let first = *trace.front()?;
        let offset = address.wrapping_sub(first.address);
        if first.stores != stores || offset >= first.bytes || bytes > first.bytes {
            return None;
        }
        if offset + bytes == first.bytes {
            trace.pop_front();
        }
        Some((u64::from(first.value) >> (8 * offset)) as u32)
    }
}

impl MemOps for Replay {
    fn read(&self, offset: u64, to: &mut [u8], attributes: MemAttrs) -> MemResult {
        let address = offset as u32;
        let is_fetch = attributes.purpose == rsemu::core::space::AccessPurpose::FETCH;
        if !is_fetch && let Some(value) = self.next(address, to.len() as u32, false) {
            to.copy_from_slice(&value.to_le_bytes()[..to.len()]);
            return Ok(());
        }
        // Code, and vectors; a load that is not in the trace failed for ours, too.
        self.memory.read(address, to).map_err(|_| BusError::Unassigned)
    }

    fn write(&self, offset: u64, from: &[u8], _: MemAttrs) -> MemResult {
        let address = offset as u32;
        let mut bytes = [0; 4];
        bytes[..from.len()].copy_from_slice(from);
        let value = u32::from_le_bytes(bytes);
        match self.next(address, from.len() as u32, true) {
            Some(own) => {
                let mask = u32::MAX >> (32 - 8 * from.len());
                if own & mask != value {
                    self.complain(format!("stores {value:#x} at {address:#x}, ours {own:#x}"));
                }
                Ok(())
            }
            None => Err(BusError::Unassigned),
        }
    }
}

/// The other core.
pub(crate) struct Witness {
    pub(super) core: ArmV7m,
    replay: Arc<Replay>,
    levels: [u32; super::super::INTERRUPT_WORDS],
    pub(super) steps: u64,
}

impl Witness {
    pub(crate) fn new(memory: &Memory) -> Self {
        let replay = Arc::new(Replay {
            memory: memory.clone(),
            trace: Mutex::default(),
            complaint: Mutex::default(),
        });
        let space = AddressSpace::new("cpu", 32);
        let region = Region::io("replay", 1 << 32, replay.clone());
        space.topology().map_with_priority(region, 0, -1).unwrap();
        let config = Config::CORTEX_M7F.with_priority_bits(4).with_reset_vtor(FLASH);
        let core = ArmV7m::new(config);
        core.attach_space(Arc::new(space));
        core.step();
        Self { core, replay, levels: [0; super::super::INTERRUPT_WORDS], steps: 0 }
    }

    /// The other core gets the registers of ours.
    pub(crate) fn copy(&mut self, own: &Core) {
        self.core.set_regs(registers(own));
        (0..32).for_each(|index| self.core.set_s(index, own.s[usize::from(index)]));
        self.core.set_fpscr(own.fpscr);
        for (word, (&new, old)) in own.system.levels.iter().zip(&mut self.levels).enumerate() {
            for bit in 0..32 {
                if (new ^ *old) >> bit & 1 != 0 {
                    self.core.set_irq((32 * word + bit) as u16, new >> bit & 1 != 0);
                }
            }
            *old = new;
        }
        self.core.set_nmi(own.system.nmi);
        self.core.with_sys(|system| {
            system.dwt_cyccnt = own.system.cycles;
            system.syst_cvr = own.system.word(0x18 / 4);
        });
    }

    /// Does the step that our core did, and compares.
    pub(crate) fn follow(
        &mut self,
        own: &Core,
        before: &Regs,
        step: Step,
        clocks: u64,
    ) -> Result<(), String> {
        *self.replay.trace.lock().unwrap() = own.watch.trace.iter().copied().collect();
        let taken = self.core.step();
        self.steps += 1;
        if let Some(complaint) = self.replay.complaint.lock().unwrap().take() {
            // It stacks xPSR without the state of an IT block.
            if before.xpsr & IT == 0 || own.psr & EXCEPTION == before.xpsr & EXCEPTION {
                return Err(complaint);
            }
        }
        let left = self.replay.trace.lock().unwrap().len();
        if left > 0 {
            return Err(format!("{left} of {:x?} are missing", own.watch.trace));
        }
        let (other, own_now) = (self.core.regs(), registers(own));
        if other != own_now {
            return Err(format!("registers\n{other}, ours\n{own_now}"));
        }
        let other: Vec<u32> = (0..32).map(|index| self.core.s(index)).collect();
        if other != own.s {
            return Err(format!("{other:x?}, ours {:x?}", own.s));
        }
        // A result that is flushed to zero underflows; rsemu calls it inexact, too (A2.5.5: it is not).
        let inexact = if own.fpscr & 1 << 24 != 0 && own.fpscr & 1 << 3 != 0 { 1 << 4 } else { 0 };
        if (self.core.fpscr() ^ own.fpscr) & !inexact != 0 {
            return Err(format!("FPSCR {:x}, ours {:x}", self.core.fpscr(), own.fpscr));
        }
        if taken != clocks || self.core.is_locked_up() != (step == Step::LockedUp) {
            return Err(format!("{taken} clocks, ours {clocks} for {step:?}"));
        }
        self.core.with_sys(|system| {
            let own = &own.system;
            // Until the next step the levels are not latched.
            let other =
                (system.active, system.cfsr, system.hfsr, system.bfar, system.mmfar, system.fpccr);
            let own = (
                own.active,
                own.word(0xD28 / 4),
                own.word(0xD2C / 4),
                own.word(0xD38 / 4),
                own.word(0xD34 / 4),
                own.word(0xF34 / 4),
            );
            if other == own { Ok(()) } else { Err(format!("{other:x?}, ours {own:x?}")) }
        })
    }
}

thread_local! {
    /// Whether cores that are made get a witness.
    pub(super) static WATCHES: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// State that a core keeps for its witness.
#[derive(Default)]
pub(crate) struct Watch {
    pub(super) trace: Vec<Traced>,
    pub(super) witness: Option<Box<Witness>>,
    before: Option<Regs>,
}

impl Watch {
    pub(crate) fn new(memory: &Memory) -> Self {
        let witness = WATCHES.get().then(|| Box::new(Witness::new(memory)));
        Self { witness, ..Self::default() }
    }

    pub(crate) fn reset(&mut self, memory: &Memory) {
        if let Some(witness) = &mut self.witness {
            let steps = witness.steps;
            **witness = Witness { steps, ..Witness::new(memory) };
        }
    }

    pub(crate) fn note(&mut self, address: u32, bytes: u32, value: u32, stores: bool) {
        self.trace.push(Traced { address, bytes, value, stores });
    }
}

impl Core {
    pub(in super::super) fn begin_watch(&mut self) {
        self.watch.trace.clear();
        if let Some(mut witness) = self.watch.witness.take() {
            witness.copy(self);
            self.watch.before = Some(registers(self));
            self.watch.witness = Some(witness);
        }
    }

    pub(in super::super) fn end_watch(&mut self, step: Step) {
        if let (Some(mut witness), Some(before)) = (self.watch.witness.take(), self.watch.before) {
            if let Err(difference) = witness.follow(self, &before, step, self.clocks) {
                panic!("after {} steps\n{before}:\n{difference}", witness.steps);
            }
            self.watch.witness = Some(witness);
        }
    }
}

/// The registers of our core, as the other one has them.
pub(crate) fn registers(core: &Core) -> Regs {
    let mut registers = Regs::new();
    registers.r = core.r;
    let is_process = core.psr & EXCEPTION == 0 && core.control & super::super::PROCESS_STACK != 0;
    (registers.msp, registers.psp) =
        if is_process { (core.other_stack, core.r[13]) } else { (core.r[13], core.other_stack) };
    (registers.xpsr, registers.control) = (core.psr, core.control);
    (registers.primask, registers.faultmask) = (core.primask, core.faultmask);
    registers.basepri = core.basepri;
    registers
}
