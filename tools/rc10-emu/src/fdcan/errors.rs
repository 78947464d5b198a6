//! Fault confinement: error counters, states, last error code (ISO 11898-1; ECR and PSR).

use rc10_can::BusError;

use super::registers::ir;

/// A failed transmission counts eight, a failed reception one.
const FAILED_TRANSMISSION: u8 = 8;
const ERROR_WARNING: u8 = 96;
const ERROR_PASSIVE: u8 = 128;
/// REC above 127 falls to 119 to 127 with the next good frame; ISO leaves the choice.
const REC_AFTER_PASSIVE: u8 = 127;

/// PSR.LEC: no error.
const NO_ERROR: u32 = 0;
/// PSR.LEC: a dominant bit was read back recessive.
const BIT0_ERROR: u32 = 5;
/// PSR.LEC: nothing has happened since PSR was read.
const NO_CHANGE: u32 = 7;

/// PSR.LEC of an error; `None` if it does not occur on the wire.
const fn code(error: BusError) -> Option<u32> {
    match error {
        BusError::Stuff => Some(1),
        BusError::Form => Some(2),
        BusError::Acknowledge => Some(3),
        BusError::Bit => Some(BIT0_ERROR),
        BusError::Crc => Some(6),
        BusError::Overrun => None,
    }
}

/// All functions return the flags they raise in IR.
pub(super) struct Errors {
    transmit: u8,
    receive: u8,
    pub bus_off: bool,
    /// ECR.CEL.
    logged: u8,
    last: u32,
}

impl Default for Errors {
    fn default() -> Self {
        Self { transmit: 0, receive: 0, bus_off: false, logged: 0, last: NO_CHANGE }
    }
}

impl Errors {
    pub const fn is_passive(&self) -> bool {
        self.bus_off || self.transmit >= ERROR_PASSIVE || self.receive >= ERROR_PASSIVE
    }

    const fn is_warning(&self) -> bool {
        self.is_passive() || self.transmit >= ERROR_WARNING || self.receive >= ERROR_WARNING
    }

    /// A change of the counters, and the flags of the states that it changes.
    fn change(&mut self, change: impl FnOnce(&mut Self)) -> u32 {
        let states = |errors: &Self| [errors.is_warning(), errors.is_passive(), errors.bus_off];
        let before = states(self);
        change(self);
        let changed = before.into_iter().zip(states(self)).map(|(before, after)| before != after);
        changed.zip([ir::EW, ir::EP, ir::BO]).map(|(is, flag)| if is { flag } else { 0 }).sum()
    }

    pub fn sent(&mut self) -> u32 {
        self.last = NO_ERROR;
        self.change(|errors| errors.transmit = errors.transmit.saturating_sub(1))
    }

    /// Another node's frame was good. Frozen (restricted operation mode): nothing counts.
    pub fn received(&mut self, frozen: bool) -> u32 {
        self.last = NO_ERROR;
        self.change(|errors| {
            errors.receive = match errors.receive {
                receive if frozen => receive,
                ERROR_PASSIVE.. => REC_AFTER_PASSIVE,
                receive => receive.saturating_sub(1),
            };
        })
    }

    pub fn transmission_failed(&mut self, error: BusError) -> u32 {
        // An error-passive sender that only misses its acknowledge counts no further, else a
        // node that is alone would go to bus-off.
        let counts = error != BusError::Acknowledge || !self.is_passive();
        self.failed(error, counts, |errors| {
            match errors.transmit.checked_add(FAILED_TRANSMISSION) {
                Some(transmit) => errors.transmit = transmit,
                None => errors.bus_off = true,
            }
        })
    }

    /// Another node's frame was destroyed. Frozen (restricted operation mode): it is only logged.
    pub fn reception_failed(&mut self, error: BusError, frozen: bool) -> u32 {
        self.failed(error, true, |errors| {
            if !frozen {
                errors.receive = (errors.receive + 1).min(ERROR_PASSIVE);
            }
        })
    }

    fn failed(&mut self, error: BusError, counts: bool, count: impl FnOnce(&mut Self)) -> u32 {
        let Some(code) = code(error) else { return 0 };
        self.last = code;
        if !counts {
            return ir::PEA;
        }
        let (logged, is_log_full) = self.logged.overflowing_add(1);
        self.logged = if is_log_full { u8::MAX } else { logged };
        ir::PEA | if is_log_full { ir::ELO } else { 0 } | self.change(count)
    }

    /// The recovery from bus-off begins: REC counts its sequences.
    pub const fn start_recovery(&mut self) {
        self.receive = 0;
    }

    pub fn recovering(&mut self, sequences: u64) {
        self.last = BIT0_ERROR;
        let seen = u64::from(self.receive).saturating_add(sequences).min(127);
        self.receive = u8::try_from(seen).unwrap_or(127);
    }

    pub fn recovered(&mut self) -> u32 {
        self.change(|errors| {
            errors.transmit = 0;
            errors.receive = 0;
            errors.bus_off = false;
        })
    }

    /// ECR; reading it clears CEL.
    pub fn read_ecr(&mut self) -> u32 {
        let logged = std::mem::take(&mut self.logged);
        let passive = !self.bus_off && self.receive >= ERROR_PASSIVE;
        u32::from(self.transmit)
            | u32::from(self.receive.min(127)) << 8
            | u32::from(passive) << 15
            | u32::from(logged) << 16
    }

    /// PSR without ACT; reading it sets LEC to "no change". DLEC belongs to CAN FD's data phase.
    pub fn read_psr(&mut self) -> u32 {
        let last = std::mem::replace(&mut self.last, NO_CHANGE);
        last | u32::from(self.is_passive()) << 5
            | u32::from(self.is_warning()) << 6
            | u32::from(self.bus_off) << 7
            | NO_CHANGE << 8
    }
}
