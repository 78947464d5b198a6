//! Where the core's accesses go: memories, peripherals, its own registers.

use std::sync::{Arc, Mutex};

use rc10_sim::Nanos;

use super::exceptions::Fault;
use super::system::CCR;
use super::{Core, Done, system};
use crate::memory::{Bank, FLASH, Memory};
use crate::peripherals::{FlashState, SECTOR, Soc, Width, lock};
use crate::time::Lapse;

/// `CCR.BFHFNMIGN`.
const IGNORES_BUS_FAULTS: u32 = 1 << 8;
/// Memories that AHB2ENR gives a clock, by their addresses.
const GATED: [u32; 2] = [0x3000_0000, 0x3000_4000];
/// Ranges of addresses by their upper bits: two memories in the same one are neighbours, or slow.
const RANGES: usize = 64;
const RANGE_BITS: u32 = 26;
const NOWHERE: [(u32, u32); 3] = [(u32::MAX, 0); 3];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Access {
    Read,
    Write,
    Fetch,
}

/// Addresses of a memory that the core may access as it is now.
#[derive(Clone, Copy, Default)]
struct Window {
    base: u32,
    length: u32,
    /// Place of `base` in the memories.
    start: u32,
}

/// Memories and peripherals on the core's side.
pub(crate) struct Bus {
    pub(super) memory: Memory,
    soc: Option<Arc<Mutex<Soc>>>,
    /// The time of the access.
    pub(crate) time: Lapse,
    /// Set by an access to a peripheral that may have changed an interrupt, or what comes next.
    pub(crate) touched: bool,
    /// Clocks that the core has waited for peripherals since this was last taken.
    pub(crate) waited: u64,
    /// Which of the gated memories have a clock.
    running: [bool; 2],
    /// RAM must not be written yet.
    guarded: bool,
    flash: FlashState,
    readable: [Window; RANGES],
    writable: [Window; RANGES],
    executable: Window,
    /// Range of addresses in which the MPU permitted the last read, write and fetch.
    permitted: [(u32, u32); 3],
}

impl Bus {
    pub(super) fn new(memory: &Memory, soc: Option<Arc<Mutex<Soc>>>) -> Self {
        Self {
            memory: memory.clone(),
            time: Lapse::new(1),
            touched: false,
            waited: 0,
            running: [soc.is_none(); 2],
            guarded: soc.as_ref().is_some_and(|soc| lock(soc).guards_ram()),
            flash: soc.as_ref().map_or_else(FlashState::default, |soc| lock(soc).flash_state()),
            soc,
            readable: [Window::default(); RANGES],
            writable: [Window::default(); RANGES],
            executable: Window::default(),
            permitted: NOWHERE,
        }
    }

    /// Sets which of SRAM1 and SRAM2 have a clock now, whether RAM must still not be written, and how the flash is:
    /// the peripherals take such accesses, and tell.
    pub(crate) fn set_memories(&mut self, running: [bool; 2], guarded: bool, flash: FlashState) {
        let guarded = guarded && self.guarded;
        if (running, guarded, flash) != (self.running, self.guarded, self.flash) {
            (self.running, self.guarded, self.flash) = (running, guarded, flash);
            self.forget();
        }
    }

    pub(super) fn forget(&mut self) {
        self.readable = [Window::default(); RANGES];
        self.writable = [Window::default(); RANGES];
        self.executable = Window::default();
        self.permitted = NOWHERE;
    }

    /// Whether an instruction of four bytes may be executed here, as far as known.
    #[inline]
    pub(super) fn executes(&self, address: u32) -> bool {
        // The last bytes are for instructions of two.
        address.wrapping_sub(self.executable.base) < self.executable.length.saturating_sub(2)
    }

    fn bank(&self, address: u32, access: Access) -> Option<&'static Bank> {
        Memory::bank(address).filter(|bank| {
            let gate = GATED.iter().position(|&gated| gated == bank.base);
            let is_locked = match access {
                Access::Write => bank.base == FLASH || self.guarded,
                Access::Read | Access::Fetch if bank.base == FLASH => {
                    self.flash.is_busy || self.flash.sick >> ((address - FLASH) / SECTOR) & 1 != 0
                }
                Access::Read | Access::Fetch => false,
            };
            gate.is_none_or(|gate| self.running[gate]) && !is_locked
        })
    }

    /// A word of memory that the core reads by itself, or looks at.
    pub(super) fn word(&self, address: u32) -> Option<u32> {
        let bank = self.bank(address, Access::Read).filter(|_| address & 3 == 0)?;
        Some(self.memory.get(bank.start + (address - bank.base), 4))
    }

    fn read(&mut self, address: u32, bytes: u32) -> Option<u32> {
        if let Some(bank) = self.bank(address, Access::Read) {
            return Some(self.memory.get(bank.start + (address - bank.base), bytes));
        }
        let mut soc = lock(self.soc.as_ref()?);
        self.waited += soc.access_clocks(address);
        let read = soc.read(address, Width::of(bytes), Nanos::new(self.time.now())).ok();
        self.touched |= soc.take_changed();
        read
    }

    fn write(&mut self, address: u32, bytes: u32, value: u32) -> Option<()> {
        if let Some(bank) = self.bank(address, Access::Write) {
            self.memory.put(bank.start + (address - bank.base), bytes, value);
            return Some(());
        }
        let mut soc = lock(self.soc.as_ref()?);
        if soc.write_early(address, &value.to_le_bytes()[..bytes as usize]) {
            self.touched = true;
            return Some(());
        }
        self.waited += soc.access_clocks(address);
        let written = soc.write(address, Width::of(bytes), value, Nanos::new(self.time.now())).ok();
        self.touched |= soc.take_changed();
        written
    }

    /// A halfword of code. Instructions do not come from peripherals, at any address.
    fn fetch(&mut self, address: u32) -> Option<u32> {
        if let Some(bank) = self.bank(address, Access::Fetch) {
            let place = bank.start + (address - bank.base);
            self.memory.mark_code(place);
            return Some(self.memory.get(place, 2));
        }
        self.touched = true;
        let mut soc = lock(self.soc.as_ref()?);
        if Memory::bank(address).is_some_and(|bank| bank.base == FLASH) {
            return soc.read_flash(address, Width::Half).ok();
        }
        soc.refuse(address, false);
        None
    }

    /// Lets the next accesses to that part of a memory for which the MPU says the same go unasked.
    fn open(&mut self, address: u32, access: Access) {
        let Some(bank) = self.bank(address, access) else { return };
        let (first, last) = self.permitted[access as usize];
        let base = first.max(bank.base);
        let mut end = last.min(bank.base + (bank.length - 1));
        if bank.base == FLASH && self.flash.sick != 0 {
            // Up to the first sector that must be asked for: what lies behind goes the long way.
            let healthy = FLASH + SECTOR * self.flash.sick.trailing_zeros();
            if address >= healthy {
                return;
            }
            end = end.min(healthy - 1);
        }
        let start = bank.start + (base - bank.base);
        let window = Window { base, length: end - base + 1, start };
        let range = (address >> RANGE_BITS) as usize;
        match access {
            Access::Read => self.readable[range] = window,
            Access::Write => self.writable[range] = window,
            Access::Fetch => self.executable = window,
        }
    }
}

impl Core {
    #[inline]
    pub(super) fn load(&mut self, address: u32, bytes: u32) -> Result<u32, Fault> {
        self.load_as(address, bytes, true)
    }

    #[inline]
    pub(super) fn store(&mut self, address: u32, bytes: u32, value: u32) -> Done {
        self.store_as(address, bytes, value, true)
    }

    /// Loads with the privileges that there are, or without.
    #[inline]
    pub(super) fn load_as(&mut self, address: u32, bytes: u32, own: bool) -> Result<u32, Fault> {
        self.clocks += 1;
        let window = &self.bus.readable[(address >> RANGE_BITS) as usize];
        let offset = address.wrapping_sub(window.base);
        if own && offset < window.length && address & (bytes - 1) == 0 {
            let value = self.bus.memory.get(window.start + offset, bytes);
            #[cfg(test)]
            self.watch.note(address, bytes, value, false);
            return Ok(value);
        }
        self.load_anywhere(address, bytes, own && self.is_privileged())
    }

    /// Stores with the privileges that there are, or without.
    #[inline]
    pub(super) fn store_as(&mut self, address: u32, bytes: u32, value: u32, own: bool) -> Done {
        self.clocks += 1;
        let window = &self.bus.writable[(address >> RANGE_BITS) as usize];
        let offset = address.wrapping_sub(window.base);
        if own && offset < window.length && address & (bytes - 1) == 0 {
            self.bus.memory.put(window.start + offset, bytes, value);
            #[cfg(test)]
            self.watch.note(address, bytes, value, true);
            return Ok(());
        }
        self.store_anywhere(address, bytes, value, own && self.is_privileged())
    }

    #[cold]
    fn load_anywhere(&mut self, address: u32, bytes: u32, privileged: bool) -> Result<u32, Fault> {
        if system::is_own(address) {
            let word = self.read_system(address & !3, true);
            return Ok(word >> (8 * (address & 3)) & (u32::MAX >> (32 - 8 * bytes)));
        }
        self.permit(address, bytes, Access::Read, privileged)?;
        let read = if address.is_multiple_of(bytes) {
            self.bus.read(address, bytes)
        } else {
            let byte = |at: u32| Some(self.bus.read(address.wrapping_add(at), 1)? << (8 * at));
            (0..bytes).map(byte).sum()
        };
        #[cfg(test)]
        read.inspect(|&value| self.watch.note(address, bytes, value, false));
        // In a handler of the most urgent faults a program may look at what does not answer (B1.5.8).
        let is_ignored = || {
            let ignores = self.system.word(CCR) & IGNORES_BUS_FAULTS != 0;
            ignores && self.system.is_negative(self.faultmask)
        };
        read.or_else(|| is_ignored().then_some(0))
            .ok_or_else(|| self.fault_at(address, Fault::DataBus))
    }

    #[cold]
    fn store_anywhere(&mut self, address: u32, bytes: u32, value: u32, privileged: bool) -> Done {
        if system::is_own(address) {
            let (shift, mask) = (8 * (address & 3), u32::MAX >> (32 - 8 * bytes));
            // Of a register that is written in part the rest is written as it reads.
            let rest = if bytes == 4 { 0 } else { self.read_system(address & !3, false) };
            self.write_system(address & !3, rest & !(mask << shift) | (value & mask) << shift);
            return Ok(());
        }
        self.permit(address, bytes, Access::Write, privileged)?;
        let written = if address.is_multiple_of(bytes) {
            self.bus.write(address, bytes, value)
        } else {
            let byte = |at| self.bus.write(address.wrapping_add(at), 1, value >> (8 * at) & 0xFF);
            (0..bytes).try_for_each(byte)
        };
        #[cfg(test)]
        written.inspect(|()| self.watch.note(address, bytes, value, true));
        written.ok_or_else(|| self.fault_at(address, Fault::DataBus))
    }

    pub(super) fn fetch(&mut self, address: u32) -> Result<u32, Fault> {
        self.permit(address, 2, Access::Fetch, self.is_privileged())?;
        self.bus.fetch(address).ok_or(Fault::FetchBus)
    }

    /// Whether the MPU lets the core look ahead at an address: fetch what it may not need.
    pub(crate) fn looks_ahead(&self, address: u32) -> bool {
        self.system.mpu.verdict(address, Access::Fetch, true, false).0
    }

    /// Asks the MPU about an access; both its ends, for it may not be aligned.
    fn permit(&mut self, address: u32, bytes: u32, access: Access, privileged: bool) -> Done {
        let last = address.wrapping_add(bytes - 1);
        let is_own = privileged == self.is_privileged();
        let (from, to) = self.bus.permitted[access as usize];
        if !is_own || address < from || last > to || last < address {
            let negative = self.system.is_negative(self.faultmask);
            let verdict = |at| self.system.mpu.verdict(at, access, privileged, negative);
            let (permitted, range) = verdict(address);
            if !permitted || !verdict(last).0 {
                let fault = if access == Access::Fetch { Fault::FetchMpu } else { Fault::DataMpu };
                return Err(self.fault_at(address, fault));
            }
            if is_own {
                self.bus.permitted[access as usize] = range;
            }
        }
        if is_own {
            self.bus.open(address, access);
        }
        Ok(())
    }

    pub(super) const fn fault_at(&mut self, address: u32, fault: Fault) -> Fault {
        self.fault_address = address;
        fault
    }
}
