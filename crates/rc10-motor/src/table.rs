use heapless::Vec;
use rc10_can::CanFrame;

use crate::can_ids::{Frames, Guard};
use crate::motors::MotorId;

/// From a frame to its motor in constant time: a hash table, then a list of patterns.
pub(crate) struct ReceiveTable {
    entries: [Entry; SIZE],
    used: u8,
    masked: Vec<(Frames, MotorId), MASKED>,
}

/// Patterns that are not exact.
const MASKED: usize = 8;

/// The room that received frames need: in a bus's table, and of its controller's filters.
#[derive(Clone, Copy)]
pub(crate) struct Room {
    exact: usize,
    masked: usize,
    /// For standard and for extended identifiers.
    pub(crate) filters: [usize; 2],
}

impl Room {
    pub(crate) const NONE: Self = Self { exact: 0, masked: 0, filters: [0; 2] };

    /// With room for these too.
    pub(crate) const fn with(mut self, receives: &[Frames]) -> Self {
        let mut at = 0;
        while at < receives.len() {
            let pattern = &receives[at].pattern;
            self.exact += pattern.is_exact() as usize;
            self.masked += !pattern.is_exact() as usize;
            self.filters[pattern.is_extended() as usize] += 1;
            at += 1;
        }
        self
    }

    /// Whether a bus's table has it.
    pub(crate) const fn is_enough_in_table(&self) -> bool {
        self.exact <= MOST as usize && self.masked <= MASKED
    }
}

const BITS: u32 = 6;
const SIZE: usize = 1 << BITS;
/// At most three quarters full, so that probing stays short.
const MOST: u8 = 48;
const _: () = assert!(MOST as usize == SIZE / 4 * 3);

#[derive(Clone, Copy)]
struct Entry {
    key: u32,
    slot: MotorId,
    guard: Guard,
}

/// No frame has a key with bit 29 set.
const FREE: u32 = u32::MAX;
/// On top of the key of an entry with a guard, so that it is never taken at first sight.
const GUARDED: u32 = 1 << 29;
const NO_GUARD: Guard = Guard { byte: 0, mask: 0, value: 0 };

impl ReceiveTable {
    pub(crate) const fn new() -> Self {
        Self {
            entries: [Entry { key: FREE, slot: MotorId::new(0), guard: NO_GUARD }; SIZE],
            used: 0,
            masked: Vec::new(),
        }
    }

    pub(crate) fn has_room(&self, receives: &[Frames]) -> bool {
        let used = Room { exact: self.used.into(), masked: self.masked.len(), ..Room::NONE };
        used.with(receives).is_enough_in_table()
    }

    /// Adds a motor's patterns; the caller asked [`has_room`](Self::has_room).
    pub(crate) fn insert(&mut self, receive: &Frames, slot: MotorId) {
        if !receive.pattern.is_exact() {
            let _ = self.masked.push((*receive, slot));
            return;
        }
        let key = CanFrame::key_of(receive.pattern.id());
        let mut index = home(key);
        while self.entries[index].key != FREE {
            index = (index + 1) % SIZE;
        }
        let (key, guard) = receive.guard().map_or((key, NO_GUARD), |guard| (key | GUARDED, guard));
        self.entries[index] = Entry { key, slot, guard };
        self.used += 1;
    }

    /// The motor that a frame belongs to, if that is known at first sight.
    pub(crate) fn find_first(&self, frame: &CanFrame) -> Option<MotorId> {
        let entry = &self.entries[home(frame.key()) % SIZE];
        (entry.key == frame.key()).then_some(entry.slot)
    }

    pub(crate) fn find(&self, frame: &CanFrame) -> Option<MotorId> {
        let key = frame.key();
        let mut index = home(key);
        // Never full, so this ends at a free entry at the latest.
        loop {
            let entry = &self.entries[index % SIZE];
            if entry.key == key || (entry.key == key | GUARDED && entry.guard.passes(frame)) {
                return Some(entry.slot);
            }
            if entry.key == FREE {
                break;
            }
            index += 1;
        }
        self.masked.iter().find(|(frames, _)| frames.contains(frame)).map(|&(_, slot)| slot)
    }
}

/// Fibonacci hashing: spreads identifiers that differ in any bit.
const fn home(key: u32) -> usize {
    (key.wrapping_mul(0x9E37_79B1) >> (32 - BITS)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can_ids::{Ownership, Rate};
    use embedded_can::{ExtendedId, StandardId};
    use rc10_can::IdPattern;

    fn number(motor: MotorId) -> u16 {
        u16::try_from(motor.index()).unwrap()
    }

    fn receive(pattern: IdPattern, guard: Option<Guard>) -> Frames {
        let ownership = guard.map_or(Ownership::Whole, Ownership::Guard);
        Frames::new(pattern, 8, Rate::EveryTick).owned(ownership)
    }

    #[test]
    fn finds_every_id_of_a_full_table_and_no_other() {
        let mut table = ReceiveTable::new();
        let id = |raw: u16| StandardId::new(raw * 41).unwrap();
        for slot in 0..MOST {
            let receive = receive(IdPattern::exact(id(slot.into())), None);
            assert!(table.has_room(&[receive]));
            table.insert(&receive, MotorId::new(slot));
        }
        assert!(!table.has_room(&[receive(IdPattern::exact(id(49)), None)]));
        for raw in 0..=0x7FF {
            let frame = CanFrame::eight_bytes(StandardId::new(raw).unwrap(), [0; 8]);
            let slot = (raw % 41 == 0 && raw / 41 < u16::from(MOST)).then_some(raw / 41);
            assert_eq!(table.find(&frame).map(number), slot, "{raw}");
            let first = table.find_first(&frame).map(number);
            assert!(first.is_none() || first == slot, "{raw}");
        }
    }

    #[test]
    fn guards_and_masks_tell_motors_apart() {
        let mut table = ReceiveTable::new();
        let master = IdPattern::exact(StandardId::ZERO);
        for slot in 0..3 {
            let guard = Guard { byte: 0, mask: 0x0F, value: slot + 1 };
            table.insert(&receive(master, Some(guard)), MotorId::new(slot));
        }
        let module = IdPattern::exact(ExtendedId::new(0x1D00_1000).unwrap()).under(0x1F00_FF00);
        table.insert(&receive(module, None), MotorId::new(7));
        // Eight patterns that are masked, however much room there is for others.
        assert!(table.has_room(&[receive(module, None); 7]));
        assert!(!table.has_room(&[receive(module, None); 8]));
        let frame = |byte| CanFrame::eight_bytes(StandardId::ZERO, [byte, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(table.find(&frame(0x12)), Some(MotorId::new(1)));
        assert_eq!(table.find_first(&frame(0x12)), None);
        assert_eq!(table.find(&frame(0x14)), None);
        let state = CanFrame::eight_bytes(ExtendedId::new(0x1D55_1023).unwrap(), [0; 8]);
        assert_eq!(table.find(&state), Some(MotorId::new(7)));
    }
}
