use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_motor::{CanIds, Frames, Ownership, SafeState};

use crate::case::Case;
use crate::harness::Sent;
use crate::outcome::{Findings, Outcome, must};
use crate::recorder::name_and_ids;
use crate::rig::Rig;

pub(super) fn ids_are_valid(case: &Case<'_>, found: &mut Findings) {
    let Some(motor) = case.can_motor() else { return };
    let ids = motor.can_ids();
    if motor.name().model.is_empty() {
        found.add(None, "its model has no name".to_owned());
    }
    if !ids.received().iter().any(|receive| receive.rate.per_second() > 0) {
        found.add(None, "no feedback comes regularly: it would always be lost".to_owned());
    }
    if ids.transmitted().is_empty() {
        found.add(None, "nothing is sent to it".to_owned());
    }
    for &Frames { pattern, len, ownership, .. } in ids.received().iter().chain(ids.transmitted()) {
        if len > 8 {
            found.add(None, format!("{pattern} has {len} bytes; a frame has 8 at most"));
        }
        let is_outside = match ownership {
            Ownership::Guard(guard) => guard.byte >= len,
            Ownership::Bytes(lane) => u32::from(len) < 8 - lane.leading_zeros(),
            Ownership::Whole => false,
        };
        if is_outside {
            found.add(None, format!("guard or lane of {pattern} lies outside of its {len} bytes"));
        }
    }
}

pub(super) fn ids_are_constant(case: &Case<'_>, found: &mut Findings) {
    let Some(fresh) = case.can_motor().map(|motor| name_and_ids(&*motor)) else { return };
    for moment in &case.life().log.moments {
        if moment.ids.as_ref().is_some_and(|now| *now != fresh) {
            let what = format!("in {:?} they differ from those of a fresh motor", moment.drive);
            return found.add(Some(moment.at), what);
        }
    }
}

/// Whether such a frame is declared.
fn declares(transmit: &Frames, frame: &CanFrame) -> bool {
    let is_own = match transmit.ownership {
        Ownership::Whole | Ownership::Guard(_) => true,
        Ownership::Bytes(bytes) => {
            let mut rest = frame.bytes().iter().enumerate().filter(|(n, _)| bytes >> n & 1 == 0);
            rest.all(|(_, byte)| *byte == 0)
        }
    };
    is_own && transmit.contains(frame) && frame.len() == usize::from(transmit.len)
}

pub(super) fn frames_are_declared(case: &Case<'_>, found: &mut Findings) {
    let Some(ids) = case.can_ids() else { return };
    let is_declared = |frame: &CanFrame| ids.transmitted().iter().any(|t| declares(t, frame));
    for moment in &case.life().log.moments {
        if let Some((frame, _)) = moment.frames.iter().find(|(frame, _)| !is_declared(frame)) {
            found.add(Some(moment.at), format!("{frame}, sent in {:?}", moment.drive));
        }
    }
    let coast = case.life().log.moments.first().map_or(&[][..], |moment| &moment.coast);
    if let Some(frame) = coast.iter().find(|frame| !is_declared(frame)) {
        found.add(None, format!("{frame}, for a panic handler"));
    }
}

/// Whether a key is that of an identifier which the motor occupies.
fn occupies(ids: &CanIds, key: u32) -> bool {
    let standard = u16::try_from(key).ok().and_then(StandardId::new).map(Id::from);
    let extended = ExtendedId::new(key & 0x3FFF_FFFF).map(Id::from);
    let has_key = |id: &Id| CanFrame::key_of(*id) == key;
    let Some(id) = standard.into_iter().chain(extended).find(has_key) else { return false };
    let mut all = ids.transmitted().iter().chain(ids.received()).chain(ids.listened_to());
    all.any(|frames| frames.pattern.contains(id))
}

pub(super) fn streams_are_own(case: &Case<'_>, found: &mut Findings) {
    let Some(ids) = case.can_ids() else { return };
    for moment in &case.life().log.moments {
        // A frame without a stream of its own is declared, or another rule says so.
        let foreign =
            |(frame, stream): &&(CanFrame, u32)| *stream != frame.key() && !occupies(&ids, *stream);
        if let Some((frame, stream)) = moment.frames.iter().find(foreign) {
            found.add(Some(moment.at), format!("{frame} is of stream {stream:#X}"));
        }
    }
}

pub(super) fn few_frames_a_tick(case: &Case<'_>, found: &mut Findings) {
    for moment in &case.life().log.moments {
        let (sent, coast) = (moment.frames.len(), moment.coast.len());
        if sent > 2 || coast > 2 {
            let what = format!("{sent} frames in a tick, {coast} for a panic handler");
            found.add(Some(moment.at), what);
        }
    }
}

pub(super) fn load_is_as_declared(case: &Case<'_>, found: &mut Findings) {
    let Some(ids) = case.can_ids() else { return };
    found.note(case.going(SafeState::Coast, |rig| {
        let _ = rig.bench.take_traffic();
        count(rig, &ids)
    }));
}

/// Counts frames for a second.
fn count(rig: &mut Rig<'_>, ids: &CanIds) -> Outcome {
    rig.wait(Some(rig.cruise()), 1000);
    let at = rig.now();
    let (mut sent, mut received) = (0_u32, 0_u32);
    for traffic in rig.bench.take_traffic() {
        let Sent::Frame(frame) = &traffic.what else {
            continue;
        };
        if traffic.is_ours {
            sent += 1;
            continue;
        }
        received += 1;
        let is_declared = ids
            .received()
            .iter()
            .any(|receive| receive.contains(frame) && frame.len() == usize::from(receive.len));
        must(traffic.at, is_declared, || format!("{frame} comes from the device"))?;
    }
    let rates = || ids.received().iter().map(|receive| receive.rate.per_second());
    let most: u32 = rates().sum();
    let fastest = rates().max().unwrap_or(0);
    let commands: u32 = ids.transmitted().iter().map(|t| t.rate.per_second()).sum();
    // A tenth for what is rare.
    must(at, received <= most + most / 10 && received >= fastest - fastest / 5, || {
        format!("{received} frames came in a second, {most} are declared")
    })?;
    must(at, sent <= commands + commands / 10, || {
        format!("{sent} frames were sent in a second, {commands} are declared")
    })?;
    Ok(())
}
