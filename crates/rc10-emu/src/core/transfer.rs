//! Loads and stores (A6.7, A7.7).

use super::arithmetic::{rd, rm, rn, rt};
use super::exceptions::Fault;
use super::system::CCR;
use super::{Core, Done};

/// Where the second part of an address comes from: distance from the program counter, ..
pub(super) const LITERAL: u32 = 0;
/// .. twelve bits, a shifted register, ..
pub(super) const TWELVE: u32 = 1;
pub(super) const REGISTER: u32 = 2;
/// .. eight bits with a sign, and the base may be changed.
pub(super) const EIGHT: u32 = 3;

/// `CCR.UNALIGN_TRP`.
const TRAPS_UNALIGNED: u32 = 1 << 3;

/// Bits of most loads and stores: offset before the access, up, base changes.
const UP: u32 = 1 << 23;
const BEFORE: u32 = 1 << 24;
const BACK: u32 = 1 << 21;

/// An address: of the access, and what becomes of the base.
struct Address {
    at: u32,
    base: Option<u32>,
    privileged: bool,
}

const fn offset(base: u32, distance: u32, up: bool) -> u32 {
    if up { base.wrapping_add(distance) } else { base.wrapping_sub(distance) }
}

#[inline]
fn address<const FORM: u32>(core: &Core, i: u32) -> Result<Address, Fault> {
    let base = core.get(rn(i));
    let plain = |at| Ok(Address { at, base: None, privileged: true });
    match FORM {
        LITERAL => plain(offset(core.r[15] & !3, i & 0xFFF, i & UP != 0)),
        TWELVE => plain(base.wrapping_add(i & 0xFFF)),
        REGISTER => plain(base.wrapping_add(core.get(rm(i)) << (i >> 4 & 3))),
        _ => {
            let moved = offset(base, i & 0xFF, i & 1 << 9 != 0);
            let (before, back) = (i & 1 << 10 != 0, i & 1 << 8 != 0);
            if !before && !back {
                return Err(Fault::Undefined);
            }
            Ok(Address {
                at: if before { moved } else { base },
                base: back.then_some(moved),
                // LDRT, STRT.
                privileged: i & 7 << 8 != 6 << 8,
            })
        }
    }
}

/// `always`: this kind of access must be aligned.
#[inline]
pub(super) fn align(core: &Core, address: u32, bytes: u32, always: bool) -> Done {
    if address & (bytes - 1) == 0 || !always && core.system.word(CCR) & TRAPS_UNALIGNED == 0 {
        return Ok(());
    }
    Err(Fault::Unaligned)
}

pub(super) fn load<const BYTES: u32, const SIGNED: bool, const FORM: u32>(
    core: &mut Core,
    i: u32,
) -> Done {
    let to = rt(i);
    let Address { at, base, privileged } = address::<FORM>(core, i)?;
    if BYTES < 4 && to == 15 {
        // PLD, PLI.
        return Ok(());
    }
    align(core, at, BYTES, false)?;
    let value = if privileged {
        core.load(at, BYTES)?
    } else {
        core.clocks += 1;
        core.load_anywhere(at, BYTES, false)?
    };
    if let Some(base) = base {
        core.set(rn(i), base);
    }
    let value = match (BYTES, SIGNED) {
        (1, true) => value as i8 as u32,
        (2, true) => value as i16 as u32,
        _ => value,
    };
    if to == 15 {
        return core.branch_exchange(value);
    }
    core.set(to, value);
    Ok(())
}

pub(super) fn store<const BYTES: u32, const FORM: u32>(core: &mut Core, i: u32) -> Done {
    let Address { at, base, privileged } = address::<FORM>(core, i)?;
    align(core, at, BYTES, false)?;
    let value = core.get(rt(i));
    if privileged {
        core.store(at, BYTES, value)?;
    } else {
        core.clocks += 1;
        core.store_anywhere(at, BYTES, value, false)?;
    }
    if let Some(base) = base {
        core.set(rn(i), base);
    }
    Ok(())
}

/// Address of two words, and what becomes of the base.
fn address_of_two(core: &Core, i: u32) -> Result<(u32, Option<u32>), Fault> {
    let base = if rn(i) == 15 { core.r[15] & !3 } else { core.get(rn(i)) };
    let moved = offset(base, (i & 0xFF) << 2, i & UP != 0);
    let at = if i & BEFORE == 0 { base } else { moved };
    align(core, at, 4, true)?;
    Ok((at, (i & BACK != 0).then_some(moved)))
}

pub(super) fn load_dual(core: &mut Core, i: u32) -> Done {
    let (at, base) = address_of_two(core, i)?;
    let first = core.load(at, 4)?;
    let second = core.load(at.wrapping_add(4), 4)?;
    core.set(rt(i), first);
    core.set(rd(i), second);
    if let Some(base) = base {
        core.set(rn(i), base);
    }
    Ok(())
}

pub(super) fn store_dual(core: &mut Core, i: u32) -> Done {
    let (at, base) = address_of_two(core, i)?;
    core.store(at, 4, core.get(rt(i)))?;
    core.store(at.wrapping_add(4), 4, core.get(rd(i)))?;
    if let Some(base) = base {
        core.set(rn(i), base);
    }
    Ok(())
}

/// Of several words: the first address, and what becomes of the base.
fn range<const DOWN: bool>(core: &Core, i: u32) -> Result<(u32, u32), Fault> {
    let (base, length) = (core.get(rn(i)), 4 * (i & 0xFFFF).count_ones());
    let end = offset(base, length, !DOWN);
    let start = if DOWN { end } else { base };
    align(core, start, 4, true)?;
    if length == 0 { Err(Fault::Undefined) } else { Ok((start, end)) }
}

/// LDM, LDMDB, POP. After a fault it can be executed again: no register has changed.
pub(super) fn load_multiple<const DOWN: bool>(core: &mut Core, i: u32) -> Done {
    let (mut at, end) = range::<DOWN>(core, i)?;
    let mut loaded = [0; 16];
    let mut list = i & 0xFFFF;
    while list != 0 {
        loaded[list.trailing_zeros() as usize] = core.load(at, 4)?;
        (at, list) = (at.wrapping_add(4), list & (list - 1));
    }
    if i & BACK != 0 {
        core.set(rn(i), end);
    }
    for (register, value) in (0..15).zip(loaded) {
        if i >> register & 1 != 0 {
            core.set(register, value);
        }
    }
    if i >> 15 & 1 != 0 { core.branch_exchange(loaded[15]) } else { Ok(()) }
}

/// STM, STMDB, PUSH.
pub(super) fn store_multiple<const DOWN: bool>(core: &mut Core, i: u32) -> Done {
    let (mut at, end) = range::<DOWN>(core, i)?;
    let mut list = i & 0xFFFF;
    while list != 0 {
        core.store(at, 4, core.get(list.trailing_zeros()))?;
        (at, list) = (at.wrapping_add(4), list & (list - 1));
    }
    if i & BACK != 0 {
        core.set(rn(i), end);
    }
    Ok(())
}

/// Of words there is an offset, too.
const fn exclusive_address<const BYTES: u32>(core: &Core, i: u32) -> u32 {
    core.get(rn(i)).wrapping_add(if BYTES == 4 { (i & 0xFF) << 2 } else { 0 })
}

pub(super) fn load_exclusive<const BYTES: u32>(core: &mut Core, i: u32) -> Done {
    let at = exclusive_address::<BYTES>(core, i);
    align(core, at, BYTES, true)?;
    let value = core.load(at, BYTES)?;
    core.exclusive = Some(at);
    core.set(rt(i), value);
    Ok(())
}

pub(super) fn store_exclusive<const BYTES: u32>(core: &mut Core, i: u32) -> Done {
    let at = exclusive_address::<BYTES>(core, i);
    align(core, at, BYTES, true)?;
    let is_own = core.exclusive == Some(at);
    if is_own {
        core.store(at, BYTES, core.get(rt(i)))?;
    }
    core.exclusive = None;
    core.set(if BYTES == 4 { rd(i) } else { rm(i) }, u32::from(!is_own));
    Ok(())
}

pub(super) fn clear_exclusive(core: &mut Core, _: u32) -> Done {
    core.exclusive = None;
    Ok(())
}

/// TBB, TBH.
pub(super) fn branch_table<const BYTES: u32>(core: &mut Core, i: u32) -> Done {
    let at = core.get(rn(i)).wrapping_add(core.get(rm(i)).wrapping_mul(BYTES));
    align(core, at, BYTES, true)?;
    let halves = core.load(at, BYTES)?;
    core.branch(core.r[15].wrapping_add(2 * halves));
    Ok(())
}
