use rc10_motor::{DriveMode, Request, SafeState};
use rc10_sim::EscFault;

use crate::case::Case;
use crate::outcome::{Findings, Outcome, broken};
use crate::rig::Rig;

const FAULTS: [EscFault; 6] = [
    EscFault::OverTemperature,
    EscFault::CommunicationLost,
    EscFault::OverCurrent,
    EscFault::OverVoltage,
    EscFault::UnderVoltage,
    EscFault::Encoder,
];

/// Longest time until a fault is told, ms.
const TOLD_WITHIN: u32 = 500;

/// Those faults that the device knows and its protocol tells.
fn for_each_fault(
    case: &Case<'_>,
    found: &mut Findings,
    scenario: impl Fn(&mut Rig<'_>, EscFault) -> Outcome,
) {
    for fault in FAULTS {
        if case.declared.untold_faults.iter().any(|(untold, _)| *untold == fault) {
            continue;
        }
        found.note(case.going(SafeState::Coast, |rig| {
            if rig.esc.inject(fault) { scenario(rig, fault) } else { Ok(()) }
        }));
    }
}

fn is_told(rig: &mut Rig<'_>, fault: EscFault) -> Outcome {
    let is_told = rig.until(Some(rig.cruise()), TOLD_WITHIN, |rig| rig.status().fault.is_some());
    rig.must(is_told, || format!("{fault:?} is not told in {TOLD_WITHIN} ms"))
}

pub(super) fn fault_is_told(case: &Case<'_>, found: &mut Findings) {
    for_each_fault(case, found, |rig, fault| {
        is_told(rig, fault)?;
        let text = rig.status().fault.map_or("", |fault| fault.text);
        rig.must(!text.trim().is_empty(), || format!("{fault:?} is told without a word"))?;
        rig.tick(Some(rig.cruise()));
        let drive = rig.status().drive;
        rig.must(drive == DriveMode::Coast, || {
            format!("with {fault:?} (\"{text}\") it may {drive:?}")
        })?;
        rig.stops(Some(rig.cruise()), &format!("after {fault:?} was told"))
    });
}

pub(super) fn fault_waits(case: &Case<'_>, found: &mut Findings) {
    for_each_fault(case, found, |rig, fault| {
        let cruise = rig.cruise();
        rig.esc.set_load(0.0);
        // That it is told is another rule.
        let _ = is_told(rig, fault);
        rig.wait(Some(cruise), rig.declared.stops_within);
        rig.rests(Some(cruise), (0, 300), &format!("of commands after {fault:?}"))?;
        rig.is_disabled(&format!("after {fault:?}"))?;
        rig.restart(cruise, 100);
        rig.wait(Some(cruise), 1);
        rig.rests(Some(cruise), (0, 300), &format!("after a restart, with {fault:?} not cleared"))?;
        rig.is_disabled(&format!("after a restart, with {fault:?} not cleared"))?;
        if let Err(error) = rig.ask(Request::ClearFault) {
            return broken(rig.now(), format!("clearing {fault:?}: {error}"));
        }
        rig.wait(Some(cruise), 100);
        if let Some(told) = rig.status().fault {
            return broken(rig.now(), format!("{fault:?} is cleared and still told: {told:?}"));
        }
        rig.goes_again(cruise, &format!("{fault:?} cleared,"))
    });
    // Without a restart the device may insist on its fault; if it does not, it runs.
    for_each_fault(case, found, |rig, fault| {
        let cruise = rig.cruise();
        rig.esc.set_load(0.0);
        is_told(rig, fault).map_err(|_| crate::outcome::Halt::Stuck)?;
        let answer = rig.ask(Request::ClearFault);
        rig.wait(Some(cruise), 100);
        if answer.is_ok() && rig.status().fault.is_none() {
            return rig.goes_again(cruise, &format!("{fault:?} cleared,"));
        }
        rig.rests(Some(cruise), (0, 200), &format!("while {fault:?} is still there"))
    });
}
