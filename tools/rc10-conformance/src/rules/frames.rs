use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_can::{CanFrame, IdPattern};
use rc10_motor::{CanIds, DriveMode, FrameError, Frames, Link, Request, Tick, TxBatch};
use rc10_sim::Random;
use rc10_time::Micros;

use crate::case::Case;
use crate::outcome::{Findings, Outcome, broken, must};
use crate::recorder::{Call, Told, not_finite, replay};

/// Eight bytes; in every fourth case such as make infinities and NaN of any float.
const fn bytes(random: &mut Random) -> [u8; 8] {
    match random.bits() % 8 {
        0 => [0xFF; 8],
        1 => [0x7F, 0x80, 0x00, 0x00, 0x80, 0x7F, 0x80, 0x7F],
        _ => random.bits().to_le_bytes(),
    }
}

/// An identifier of a pattern.
fn id_of(pattern: &IdPattern, random: &mut Random) -> Id {
    let free = random.bits() & !u64::from(pattern.mask());
    id(pattern.is_extended(), u64::from(pattern.raw() & pattern.mask()) | free)
}

#[expect(clippy::cast_possible_truncation, reason = "the low bits are what is wanted")]
fn id(is_extended: bool, bits: u64) -> Id {
    if is_extended {
        ExtendedId::new(bits as u32 & 0x1FFF_FFFF).unwrap_or(ExtendedId::ZERO).into()
    } else {
        StandardId::new(bits as u16 & 0x7FF).unwrap_or(StandardId::ZERO).into()
    }
}

fn frame(id: Id, bytes: &[u8]) -> CanFrame {
    CanFrame::data_frame(id, bytes).unwrap_or_else(|_| CanFrame::eight_bytes(id, [0; 8]))
}

/// The drives of a motor that hears nonsense: mostly it runs.
const DRIVES: [DriveMode; 8] = [
    DriveMode::Off,
    DriveMode::Coast,
    DriveMode::Brake,
    DriveMode::Hold,
    DriveMode::Run,
    DriveMode::Run,
    DriveMode::Run,
    DriveMode::Run,
];

/// Whether the motor is expected to look at such an identifier at all.
fn is_own(ids: &CanIds, id: Id) -> bool {
    ids.received().iter().any(|receive| receive.pattern.contains(id))
}

/// Gives frames that are refused to a motor that runs; then it must go on as its twin does that
/// never got them.
fn change_nothing(
    case: &Case<'_>,
    frames: impl Iterator<Item = CanFrame>,
    is_right: impl Fn(&CanFrame, FrameError) -> bool,
) -> Outcome {
    let (before, after) = case.life().calls();
    let (Some(mut motor), Some(mut twin)) = (case.can_motor(), case.can_motor()) else {
        return Ok(());
    };
    replay(&mut *motor, before);
    replay(&mut *twin, before);
    let told = Told::of(&*motor);
    let at = told.feedback.at + Micros::from_millis(1);
    for frame in frames {
        match motor.unpack_feedback(&frame, at, Link::Online) {
            Err(error) if is_right(&frame, error) => (),
            answer => return broken(at, format!("{frame} ({} bytes): {answer:?}", frame.len())),
        }
        must(at, Told::of(&*motor) == told, || {
            format!("{frame} changed what the motor says of itself")
        })?;
    }
    let few = &after[..after.len().min(100)];
    must(at, replay(&mut *motor, few) == replay(&mut *twin, few), || {
        "after them it sends other frames than without".to_owned()
    })
}

pub(super) fn foreign_frames(case: &Case<'_>, found: &mut Findings) {
    let Some(ids) = case.can_ids() else { return };
    let mut random = Random::new(1);
    // Neighbours first: the identifiers that differ from its own by a bit.
    let near = ids.received().iter().flat_map(|Frames { pattern, .. }| {
        let (is_extended, raw) = (pattern.is_extended(), u64::from(pattern.raw()));
        let neighbours =
            (0..if is_extended { 29 } else { 11 }).map(move |bit| id(is_extended, raw ^ 1 << bit));
        neighbours.chain([id(!is_extended, raw)])
    });
    let commands = ids.transmitted().iter().map(|transmit| transmit.pattern.id());
    let any = (0..5000).map(|_| {
        let bits = random.bits();
        id(bits & 1 == 1, bits >> 1)
    });
    let is_foreign = |id: &Id| !is_own(&ids, *id);
    let others: Vec<Id> = near.chain(commands).chain(any).filter(is_foreign).collect();
    let foreign = others.into_iter().map(|id| {
        let len = random.bits() % 9;
        let bytes = bytes(&mut random);
        frame(id, bytes.get(..usize::try_from(len).unwrap_or(8)).unwrap_or(&bytes))
    });
    let remote = ids.received().iter().filter_map(|receive| {
        CanFrame::remote_frame(receive.pattern.id(), receive.len.into()).ok()
    });
    let is_right = |_: &CanFrame, error| error == FrameError::NotMine;
    found.note(change_nothing(case, foreign.chain(remote), is_right));
    // Where devices share an identifier, a byte says whose a frame is.
    let mut random = Random::new(4);
    let guarded = ids.received().iter().filter(|receive| receive.guard().is_some());
    let others = guarded.flat_map(|receive| {
        let made = (0..500).map(|_| {
            let id = id_of(&receive.pattern, &mut random);
            frame(id, &bytes(&mut random)[..receive.len.min(8).into()])
        });
        let is_other = |frame: &CanFrame| !ids.received().iter().any(|own| own.contains(frame));
        made.filter(is_other).collect::<Vec<_>>()
    });
    let others: Vec<CanFrame> = others.collect();
    found.note(change_nothing(case, others.into_iter(), |_, _| true));
}

pub(super) fn wrong_lengths(case: &Case<'_>, found: &mut Findings) {
    let Some(ids) = case.can_ids() else { return };
    let mut random = Random::new(2);
    let mut wrong = Vec::new();
    for receive in ids.received() {
        for len in 0..=8_u8 {
            for _ in 0..50 {
                let id = id_of(&receive.pattern, &mut random);
                let mut others = ids.received().iter();
                if others.any(|other| other.len == len && other.pattern.contains(id)) {
                    continue;
                }
                wrong.push(frame(id, &bytes(&mut random)[..usize::from(len)]));
            }
        }
    }
    let is_right = |_: &CanFrame, error| matches!(error, FrameError::Length | FrameError::NotMine);
    found.note(change_nothing(case, wrong.into_iter(), is_right));
}

pub(super) fn any_content(case: &Case<'_>, found: &mut Findings) {
    let Some(ids) = case.can_ids() else { return };
    for receive in ids.received() {
        found.note(content(case, receive));
    }
    for moment in &case.life().log.moments {
        if let Some(name) = not_finite(&moment.feedback) {
            found.add(Some(moment.at), format!("the {name} in the feedback is not finite"));
        }
    }
}

fn content(case: &Case<'_>, receive: &Frames) -> Outcome {
    let mut random = Random::new(3);
    let (before, after) = case.life().calls();
    let Some(mut motor) = case.can_motor() else { return Ok(()) };
    replay(&mut *motor, before);
    let mut at = motor.feedback().at;
    let own = |call: &Call| match call {
        Call::Frame(frame, ..) if receive.pattern.matches(frame) => Some(*frame),
        _ => None,
    };
    let real: Vec<CanFrame> = before.iter().filter_map(own).collect();
    for turn in 0..4000_usize {
        at += Micros::new(random.bits() % 3000);
        let mut bytes = bytes(&mut random);
        let mut id = id_of(&receive.pattern, &mut random);
        // Every other one is a real one in which a byte or two are wrong: it comes further.
        if let (true, Some(real)) = (turn % 2 == 0, real.get(turn / 2 % real.len().max(1))) {
            id = real.id();
            let wrong = random.bits().to_le_bytes();
            let (first, second) = (usize::from(wrong[0] % 8), usize::from(wrong[1] % 8));
            bytes[..real.len()].copy_from_slice(real.bytes());
            (bytes[first], bytes[second]) = (wrong[2], wrong[3]);
        }
        let frame = frame(id, &bytes[..receive.len.min(8).into()]);
        let told = Told::of(&*motor);
        let heard = motor.unpack_feedback(&frame, at, Link::Online);
        let now = Told::of(&*motor);
        must(at, heard.is_ok() || now == told, || {
            format!("{frame} was refused and changed something")
        })?;
        if let Some(name) = not_finite(&now.feedback) {
            return broken(at, format!("{frame} makes the {name} infinite or NaN"));
        }
        // That it lies within a turn is another rule.
        let (angle, total) = (now.feedback.angle.get(), now.feedback.total_angle);
        let apart = (total.within_turn().get() - angle).rem_euclid(360.0);
        must(at, apart.min(360.0 - apart) <= 1e-3, || {
            format!("{frame} makes its angle {angle}, and {total:?} in all")
        })?;
        let drive = DRIVES[usize::from(random.bits().to_le_bytes()[0]) % DRIVES.len()];
        let trials = &case.declared.trials;
        if !trials.is_empty() {
            let _ = motor.set_target(trials[turn % trials.len()].target);
        }
        let _ = motor.request(Request::ClearFault);
        let _ = motor.response();
        motor.update(&Tick::new(drive));
        let _ = motor.pack_command(&mut TxBatch::new());
    }
    // And it takes real ones still.
    replay(&mut *motor, &after[..after.len().min(100)]);
    Ok(())
}

pub(super) fn feedback_at(case: &Case<'_>, found: &mut Findings) {
    for (arrived, told) in &case.life().log.arrivals {
        if arrived != told {
            found.add(Some(*arrived), format!("it says that it arrived at {told}"));
        }
    }
}
