//! Loads and stores (A5.3.5 to A5.3.10, A7.7).

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

/// Bits of most loads and stores: up, offset before the access, base changes, loads.
pub(super) const UP: u32 = 1 << 23;
const BEFORE: u32 = 1 << 24;
pub(super) const BACK: u32 = 1 << 21;
const LOADS: u32 = 1 << 20;

/// An address: of the access, and what becomes of the base.
struct Address {
    at: u32,
    base: Option<u32>,
    privileged: bool,
}

pub(super) const fn offset(base: u32, distance: u32, up: bool) -> u32 {
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

const fn bytes(i: u32) -> u32 {
    1 << (i >> 21 & 3)
}

pub(super) fn load<const FORM: u32>(core: &mut Core, i: u32) -> Done {
    let (to, bytes, signed) = (rt(i), bytes(i), i & 1 << 24 != 0);
    let Address { at, base, privileged } = address::<FORM>(core, i)?;
    if bytes < 4 && to == 15 {
        // PLD, PLI.
        return Ok(());
    }
    align(core, at, bytes, false)?;
    let value = core.load_as(at, bytes, privileged)?;
    if let Some(base) = base {
        core.set(rn(i), base);
    }
    let value = match bytes {
        1 if signed => value as i8 as u32,
        2 if signed => value as i16 as u32,
        _ => value,
    };
    if to == 15 {
        return core.branch_exchange(value);
    }
    core.set(to, value);
    Ok(())
}

pub(super) fn store<const FORM: u32>(core: &mut Core, i: u32) -> Done {
    let Address { at, base, privileged } = address::<FORM>(core, i)?;
    align(core, at, bytes(i), false)?;
    core.store_as(at, bytes(i), core.get(rt(i)), privileged)?;
    if let Some(base) = base {
        core.set(rn(i), base);
    }
    Ok(())
}

/// LDRD, STRD.
pub(super) fn transfer_two(core: &mut Core, i: u32) -> Done {
    let base = if rn(i) == 15 { core.r[15] & !3 } else { core.get(rn(i)) };
    let moved = offset(base, (i & 0xFF) << 2, i & UP != 0);
    let at = if i & BEFORE == 0 { base } else { moved };
    align(core, at, 4, true)?;
    if i & LOADS == 0 {
        core.store(at, 4, core.get(rt(i)))?;
        core.store(at.wrapping_add(4), 4, core.get(rd(i)))?;
    } else {
        let first = core.load(at, 4)?;
        let second = core.load(at.wrapping_add(4), 4)?;
        core.set(rt(i), first);
        core.set(rd(i), second);
    }
    if i & BACK != 0 {
        core.set(rn(i), moved);
    }
    Ok(())
}

/// LDM, STM, PUSH, POP. After a fault no register has changed: it can be executed again.
pub(super) fn transfer_multiple(core: &mut Core, i: u32) -> Done {
    let (base, mut list) = (core.get(rn(i)), i & 0xFFFF);
    let end = offset(base, 4 * list.count_ones(), i & UP != 0);
    let mut at = if i & UP == 0 { end } else { base };
    align(core, at, 4, true)?;
    let mut registers = core.r;
    if i & BACK != 0 {
        registers[rn(i) as usize & 15] = end;
    }
    while list != 0 {
        let register = list.trailing_zeros();
        if i & LOADS == 0 {
            core.store(at, 4, core.get(register))?;
        } else {
            registers[register as usize & 15] = core.load(at, 4)?;
        }
        (at, list) = (at.wrapping_add(4), list & (list - 1));
    }
    let to = std::mem::replace(&mut registers[15], core.r[15]);
    core.r = registers;
    if i & LOADS != 0 && i >> 15 & 1 != 0 { core.branch_exchange(to) } else { Ok(()) }
}

/// Address and bytes of an access; for words there is an offset, too.
const fn exclusive_address(core: &Core, i: u32) -> (u32, u32) {
    let base = core.get(rn(i));
    if i & UP == 0 { (base.wrapping_add((i & 0xFF) << 2), 4) } else { (base, 1 << (i >> 4 & 1)) }
}

pub(super) fn load_exclusive(core: &mut Core, i: u32) -> Done {
    let (at, bytes) = exclusive_address(core, i);
    align(core, at, bytes, true)?;
    let value = core.load(at, bytes)?;
    core.exclusive = Some(at);
    core.set(rt(i), value);
    Ok(())
}

pub(super) fn store_exclusive(core: &mut Core, i: u32) -> Done {
    let (at, bytes) = exclusive_address(core, i);
    align(core, at, bytes, true)?;
    let is_own = core.exclusive == Some(at);
    if is_own {
        core.store(at, bytes, core.get(rt(i)))?;
    }
    core.exclusive = None;
    core.set(if bytes == 4 { rd(i) } else { rm(i) }, u32::from(!is_own));
    Ok(())
}

/// CLREX.
pub(super) fn clear_exclusive(core: &mut Core, _: u32) -> Done {
    core.exclusive = None;
    Ok(())
}

/// TBB, TBH.
pub(super) fn branch_table(core: &mut Core, i: u32) -> Done {
    let bytes = 1 << (i >> 4 & 1);
    let at = core.get(rn(i)).wrapping_add(core.get(rm(i)).wrapping_mul(bytes));
    align(core, at, bytes, true)?;
    let halves = core.load(at, bytes)?;
    core.branch(core.r[15].wrapping_add(2 * halves));
    Ok(())
}
