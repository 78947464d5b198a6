//! Profile of a run: instructions per function and exception.

use std::collections::BTreeMap;

use crate::image::Image;
use crate::memory::FLASH;

/// Halfwords of flash that are counted one by one.
const PLACES: usize = (1 << 20) / 2;
/// Exceptions of an Armv7-M core: its number of the present one has nine bits.
const EXCEPTIONS: usize = 512;

/// Executed instructions since the start, or since [`restart`](Self::restart).
#[derive(Clone)]
pub struct Profile {
    places: Vec<u64>,
    /// Instructions in code that is not in flash.
    elsewhere: u64,
    exceptions: [ExceptionCost; EXCEPTIONS],
    total: u64,
    lowest_stack: u32,
}

/// Cost of one exception's handler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExceptionCost {
    /// Its number; 0 is thread mode, external interrupts start at 16.
    pub exception: u16,
    /// Number of entries.
    pub entries: u64,
    /// Instructions in its handler, those of handlers that interrupted it not included.
    pub instructions: u64,
    /// Clocks that they took, with those in which the core waited for a bus.
    pub clocks: u64,
}

impl Profile {
    pub(crate) fn new() -> Self {
        Self {
            places: vec![0; PLACES],
            elsewhere: 0,
            exceptions: [ExceptionCost::default(); EXCEPTIONS],
            total: 0,
            lowest_stack: u32::MAX,
        }
    }

    /// Counts from zero again; the stack's lowest point stays.
    pub fn restart(&mut self) {
        *self = Self { lowest_stack: self.lowest_stack, ..Self::new() };
    }

    #[inline]
    const fn cost(&mut self, exception: u16) -> &mut ExceptionCost {
        &mut self.exceptions[exception as usize % EXCEPTIONS]
    }

    #[inline]
    pub(crate) fn instruction(&mut self, address: u32, stack: u32) {
        let place = (address.wrapping_sub(FLASH) / 2) as usize;
        match self.places.get_mut(place) {
            Some(count) => *count += 1,
            None => self.elsewhere += 1,
        }
        self.lowest_stack = self.lowest_stack.min(stack);
    }

    pub(crate) fn entry(&mut self, exception: u16, stack: u32) {
        self.cost(exception).entries += 1;
        self.lowest_stack = self.lowest_stack.min(stack);
    }

    /// What instructions that were counted cost, and what they were part of.
    #[inline]
    pub(crate) const fn spend(&mut self, exception: u16, instructions: u64, clocks: u64) {
        let cost = self.cost(exception);
        cost.instructions += instructions;
        cost.clocks += clocks;
        self.total += instructions;
    }

    /// All instructions.
    pub const fn total(&self) -> u64 {
        self.total
    }

    /// The lowest stack pointer ever seen; `None` before the first instruction.
    pub(crate) fn lowest_stack(&self) -> Option<u32> {
        (self.lowest_stack != u32::MAX).then_some(self.lowest_stack)
    }

    /// Instructions in each exception that occurred, and in thread mode.
    pub fn by_exception(&self) -> Vec<ExceptionCost> {
        let costs = (0..).zip(&self.exceptions);
        let costs = costs.map(|(exception, cost)| ExceptionCost { exception, ..*cost });
        costs.filter(|cost| cost.entries + cost.instructions > 0).collect()
    }

    /// Instructions of each function, most first; inlined functions belong to their callers.
    pub fn by_function<'i>(&self, image: &'i Image) -> Vec<(&'i str, u64)> {
        let mut functions: BTreeMap<u32, (&str, u64)> = BTreeMap::new();
        let places = (FLASH..).step_by(2).zip(self.places.iter().copied());
        for (address, count) in places.filter(|&(_, count)| count > 0) {
            let (start, name) = image.function_at(address).unwrap_or((0, "(no symbol)"));
            functions.entry(start).or_insert((name, 0)).1 += count;
        }
        if self.elsewhere > 0 {
            functions.insert(u32::MAX, ("(outside flash)", self.elsewhere));
        }
        let mut functions: Vec<_> = functions.into_values().collect();
        // Stable: functions of equal cost stay in the order of their addresses.
        functions.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
        functions
    }
}
