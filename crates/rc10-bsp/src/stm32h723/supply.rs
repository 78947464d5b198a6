//! The core's supply, which has to be chosen before memory is written.
//!
//! RM0468, PWR: after power-on the chip waits in "Run*" for the program to say which regulator feeds the
//! core (CR3, once per power-on); until CSR1.ACTVOSRDY says that the voltage is there, memories must not
//! be written. cortex-m-rt clears statics and uses the stack long before a program's first line; but it
//! calls `__pre_init` before that, as ST's start-up code calls its `ExitRun0Mode`.

/// PWR (`stm32h723xx.h`).
const PWR: u32 = 0x5802_4800;

/// The LDO, the only regulator: LDOEN without SCUEN and BYPASS (`PWR_LDO_SUPPLY`), as embassy-stm32
/// writes again. It waits: without a supply there is nothing else to do.
// SAFETY: cortex-m-rt calls it from `Reset`; two registers, neither stack nor statics.
#[unsafe(export_name = "__pre_init")]
#[unsafe(naked)]
unsafe extern "C" fn choose_supply() {
    core::arch::naked_asm!(
        "ldr r0, ={PWR}",
        // CR3
        "ldr r1, [r0, #0x0C]",
        "bic r1, r1, #0b101",
        "orr r1, r1, #0b010",
        "str r1, [r0, #0x0C]",
        // CSR1, ACTVOSRDY
        "2: ldr r1, [r0, #0x04]",
        "tst r1, #(1 << 13)",
        "beq 2b",
        "bx lr",
        PWR = const PWR,
    )
}
