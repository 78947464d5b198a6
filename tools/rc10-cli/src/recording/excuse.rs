//! Whether an injected fault explains an effect: its place and its duration.

use rc10_emu::fault::{ChipFault, Fault, Kind as FaultKind};
use rc10_sim::fault::Wire;
use rc10_time::Micros;

use crate::recording::sample::SAMPLE_PERIOD;
use crate::robot::motor::Place;

/// The time in which a fault may have effects on a bus or line.
pub(crate) fn effects(fault: &Fault, on: Place) -> Option<(Micros, Option<Micros>)> {
    let from = fault.from.micros();
    let until = fault.until.map(|until| until.micros());
    match fault.kind {
        FaultKind::RemoteLost | FaultKind::Part(..) => None,
        // For good: bit rates are what the chip's own oscillator makes of them.
        FaultKind::Other(ChipFault::CrystalDead) => Some((from, None)),
        FaultKind::Other(_) => Some((from, Some(until.unwrap_or(from) + RESTART_WITHIN))),
        FaultKind::Noise(_) if is_on(fault, on) => Some((from, Some(from + BACK_WITHIN))),
        _ if is_on(fault, on) => Some((from, until.map(|until| until + BACK_WITHIN))),
        _ => None,
    }
}

pub(crate) fn is_on(fault: &Fault, on: Place) -> bool {
    let (index, number) = match (fault.kind.wire(), on) {
        (Some(Wire::Bus(index)), Place::Bus(number)) => (index, number),
        (Some(Wire::Line(index)), Place::Line(number)) => (index, number),
        _ => return false,
    };
    index + 1 == usize::from(number)
}

/// Whether an injected fault may have effects on a bus or line at a time.
pub(crate) fn is_excused(faults: &[Fault], on: Place, at: Micros) -> bool {
    let effects = faults.iter().filter_map(|fault| effects(fault, on));
    effects.into_iter().any(|(from, until)| {
        from <= at && until.is_none_or(|until| at.since(SAMPLE_PERIOD) <= until)
    })
}

/// Time within which an inaudible motor is known as lost.
pub const LOST_WITHIN: Micros = Micros::from_millis(50);

/// Time from the end of a fault within which a motor is back.
pub const BACK_WITHIN: Micros = Micros::from_millis(500);

/// Time within which a chip that crashed or hung is back, and armed by hand.
pub const RESTART_WITHIN: Micros = Micros::from_millis(1500);
