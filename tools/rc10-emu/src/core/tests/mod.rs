//! The core, instruction by instruction: compared with another one (`rsemu`), and with the manual.

mod doubles;
mod exceptions;
mod instructions;
mod program;
mod random;
pub(super) mod witness;

use super::{Core, Step, T};
use crate::memory::{FLASH, Memory};

/// Where the code of a test is, its data, and its stack.
const CODE: u32 = 0x2001_0000;
const DATA: u32 = 0x2000_4000;
const STACK: u32 = 0x2000_8000;
/// Handlers: of exception n at 16 n.
const HANDLERS: u32 = 0x2001_4000;

/// Memories with a vector table whose handlers are `BX LR`.
fn memory() -> Memory {
    let memory = Memory::new(7);
    for exception in 0..256_u32 {
        let handler = HANDLERS + 16 * exception;
        let vector = if exception == 0 { STACK } else { handler | 1 };
        memory.write(FLASH + 4 * exception, &vector.to_le_bytes()).unwrap();
        memory.write(handler, &0x4770_u16.to_le_bytes()).unwrap();
    }
    memory
}

/// Puts instructions of 16 bits to an address.
fn put(memory: &Memory, address: u32, code: &[u16]) {
    let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
    memory.write(address, &bytes).unwrap();
}

/// The halves of an instruction of 32 bits, in the order of their addresses.
const fn wide(bits: u32) -> [u16; 2] {
    [(bits >> 16) as u16, bits as u16]
}

/// A core that is about to execute this code, with its memory.
fn with_code(code: &[u16]) -> (Core, Memory) {
    let memory = memory();
    put(&memory, CODE, code);
    let mut core = super::bare(&memory);
    (core.r[15], core.psr) = (CODE, T);
    (core, memory)
}

fn steps(core: &mut Core, count: usize) -> Vec<(Step, u64)> {
    (0..count).map(|_| core.step()).collect()
}
