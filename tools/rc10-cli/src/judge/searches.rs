//! The searches for problems of a run, which console, JSON, report and exit code share.
//!
//! An effect that an injected fault must have is no problem; its absence is one. The thresholds,
//! and the shipped robots' distance from them: `docs/verdict.md`.

use rc10_emu::fault::{ChipFault, Fault, Kind as FaultKind};
use rc10_module::Counters;
use rc10_motor::rc10_app::mechanism::Stage;
use rc10_motor::{ArmState, Condition, DriveMode, Link, Verdict};
use rc10_sim::fault::is_called;
use rc10_time::Micros;

use crate::recording::effort::{EffortTrack, IN_A_ROW};
use crate::recording::excuse::{
    BACK_WITHIN, LOST_WITHIN, RESTART_WITHIN, effects, is_excused, is_on,
};
use crate::recording::load::WINDOW;
use crate::recording::problem::{About, Problem, counted};
use crate::recording::remote::{Loss, RemoteTrack};
use crate::recording::sample::{
    BusSample, Cell, MotorSample, SAMPLE_PERIOD, Source, seconds, time_of,
};
use crate::recording::{BusTrack, MotorTrack, PartTrack, Recording, load, margin};
use crate::robot::motor::Place;
use crate::robot::remote::Receiver;

/// One lost frame or command in this many, 0.1 %, is still information only.
pub const RARE: u64 = 1000;
/// Longest time from the last good frame of a lost remote until the robot lets go.
pub const REACTION: Micros = Micros::from_millis(120);
/// Armed time from which on a motor without a target is a problem.
pub const ARMED_FOR: Micros = Micros::from_millis(500);
/// Length of a run from which on a robot that is not armed is a problem.
pub const UNARMED_FOR: Micros = Micros::from_millis(1000);
/// Time in a run within which a part on a UART is heard.
pub const PART_WITHIN: Micros = Micros::from_millis(500);

// ---- injected faults ---------------------------------------------------------------------------

/// The part of a total that was counted while no fault had its effects.
fn unexcused<T>(
    recording: &Recording,
    on: Place,
    total: u64,
    samples: &[T],
    count: impl Fn(&T) -> u64,
) -> u64 {
    if recording.faults.is_empty() {
        return total;
    }
    let (mut before, mut excused) = (0, 0);
    for (index, now) in samples.iter().map(count).enumerate() {
        if is_excused(&recording.faults, on, time_of(index)) {
            excused += now.saturating_sub(before);
        }
        before = now;
    }
    total.saturating_sub(excused)
}

fn sample_at<T>(samples: &[T], at: Micros) -> Option<&T> {
    samples.get(usize::try_from(at.get().div_ceil(SAMPLE_PERIOD.get())).ok()?.checked_sub(1)?)
}

/// Time from the first rise of a count to the last one.
fn rises<T>(samples: &[T], count: impl Fn(&T) -> u64) -> Option<(Micros, Micros)> {
    let rose = (1..).zip(samples.windows(2));
    let mut rose = rose.filter(|(_, pair)| count(&pair[1]) > count(&pair[0])).map(|(at, _)| at);
    let first = rose.next()?;
    Some((time_of(first), time_of(rose.last().unwrap_or(first))))
}

/// Whether a fault must make motors of its bus inaudible, as far as that can be seen.
const fn must_be_lost(recording: &Recording, kind: &FaultKind) -> bool {
    match kind {
        // The chip alone knows what is cut off: on the wire its motors still speak.
        FaultKind::Cut(_) => recording.source.is_told(),
        _ => matches!(kind, FaultKind::Power(_) | FaultKind::Short(_) | FaultKind::Dominant(_)),
    }
}

/// Finds missing effects of faults on a motor; returns whether it was back after each fault.
fn effects_on_motor(recording: &Recording, track: &MotorTrack, found: &mut Vec<Problem>) -> bool {
    let on = track.motor.on;
    let about = About::Motor(track.motor.label);
    let mut is_back = true;
    for fault in recording.faults.iter().filter(|fault| is_on(fault, on)) {
        let (from, until) = (fault.from.micros(), fault.until.map(|until| until.micros()));
        let kind = &fault.kind;
        let during = || {
            let samples = (track.samples.iter().enumerate()).map(|(at, seen)| (time_of(at), seen));
            samples.filter(move |(at, _)| {
                *at >= from + LOST_WITHIN && until.is_none_or(|until| *at <= until)
            })
        };
        if must_be_lost(recording, kind)
            && let Some((at, _)) = during().find(|(_, sample)| sample.link == Link::Online)
        {
            let text = format!("is heard at {:.3} s, in spite of {kind}", seconds(at));
            let problem = Problem::new(about, "fault-without-effect", text);
            found.push(problem.in_time(at, SAMPLE_PERIOD));
        }
        let Some(until) = until else { continue };
        let other = recording.faults.iter().any(|other| {
            other != fault
                && effects(other, on).is_some_and(|(from, end)| {
                    from <= until + BACK_WITHIN && end.is_none_or(|end| end > until)
                })
        });
        let sample = sample_at(&track.samples, until + BACK_WITHIN);
        if !other && sample.is_some_and(|sample| sample.link != Link::Online) {
            let limit = BACK_WITHIN.get() / 1000;
            let text = format!("is not back {limit} ms after the end of {kind}");
            found.push(Problem::new(about, "not-back", text).in_time(until, BACK_WITHIN));
            is_back = false;
        }
    }
    is_back
}

// ---- the searches ------------------------------------------------------------------------------

pub(super) fn robot(recording: &Recording, found: &mut Vec<Problem>) {
    let never_armed = !recording.arm.is_empty() && !recording.arm.contains(&ArmState::Armed);
    let forbids = |kind: &FaultKind| {
        use ChipFault::{CrystalDead, CrystalStops};
        matches!(kind, FaultKind::RemoteLost | FaultKind::Other(CrystalDead | CrystalStops))
    };
    let has_reason = recording.source == Source::Robot
        || recording.faults.iter().any(|fault| forbids(&fault.kind));
    if never_armed && recording.length >= UNARMED_FOR && !has_reason && !recording.motors.is_empty()
    {
        let why = match recording.not_at_rest {
            Some(axis) => format!(
                "{axis} is not at rest; it arms when that is in the middle, or is no part of `at_rest`"
            ),
            None => {
                "no motor was driven: does a task obey the remote, at least every 20 ms?".to_owned()
            }
        };
        let text = format!("was never armed: {why}");
        found.push(Problem::new(About::Robot, "never-armed", text));
    }
    found.extend_from_slice(&recording.found);
}

/// A robot with an IMU that drives without a heading.
pub(super) fn heading(recording: &Recording, found: &mut Vec<Problem>) {
    let armed = recording.headings.iter().zip(&recording.arm);
    let missing = |(has_one, arm): (&bool, &ArmState)| *arm == ArmState::Armed && !has_one;
    let missing: Vec<bool> = armed.map(missing).collect();
    let longest = missing.split(|it| !it).map(<[bool]>::len).max().unwrap_or(0) as u64;
    let longest = Micros::new(longest * SAMPLE_PERIOD.get());
    if longest >= ARMED_FOR && recording.faults.is_empty() {
        let text = format!(
            "was armed for {:.1} s without a heading, though it has an IMU: {}",
            seconds(longest),
            if recording.headings.contains(&true) {
                "it was lost; it comes back when the robot is armed anew"
            } else {
                "it never came: is the IMU plugged in, powered, and at this rate?"
            }
        );
        found.push(Problem::new(About::Robot, "no-heading", text));
    }
}

/// Finds mechanisms that gave up or never began.
pub(super) fn mechanisms(recording: &Recording, found: &mut Vec<Problem>) {
    for track in recording.signals.iter().filter(|track| track.states == Stage::NAMES) {
        let about = About::Part(track.label);
        let stage = |value: f64| Stage::ALL.get(value as usize).copied().unwrap_or_default();
        let highest = |cell: &Option<Cell>| cell.map(|cell| stage(cell.max.into()));
        let stages = (0..).zip(&track.samples).filter_map(|(at, it)| Some((at, highest(it)?)));
        let gave_up = stages.filter(|(_, stage)| stage.gave_up()).map(|(at, it)| (time_of(at), it));
        let faults = || recording.faults.iter().map(|fault| (fault.from.micros(), fault.until));
        let is_excused = |at: Micros| {
            faults().any(|(from, until)| {
                from <= at && until.is_none_or(|until| at <= until.micros() + RESTART_WITHIN)
            })
        };
        let mut told = None;
        for (at, stage) in gave_up.filter(|(at, _)| !is_excused(*at)) {
            if told.replace(stage) != Some(stage) {
                let text = format!("gave up at {:.2} s: {}", seconds(at), why_it_gave_up(stage));
                found.push(Problem::new(about, "gave-up", text).in_time(at, SAMPLE_PERIOD));
            }
        }
        let has_begun = track.range.is_some_and(|[.., highest]| stage(highest) != Stage::NotBegun);
        let armed = armed_for(recording);
        if !has_begun && track.last.is_some() && armed >= ARMED_FOR {
            let text = format!(
                "never began, and the robot was armed for {:.1} s: is it updated, and not a copy of it?",
                seconds(armed)
            );
            found.push(Problem::new(about, "never-began", text));
        }
    }
}

/// The meaning of a stage, and what to check.
fn why_it_gave_up(stage: Stage) -> String {
    let hint = match stage {
        Stage::NotTouched => {
            " on the way to the first touch: is the contact torn or inverted, its direction wrong, the \
             travel or the time too short?"
        }
        Stage::NeverOpened => {
            " while it backed off: is it inverted (`Active` is not as it is wired), torn, or stuck?"
        }
        Stage::NotBackedOff => ": is it blocked, or the time too short?",
        Stage::NotTouchedAgain => " on the way to the second touch: is the contact loose?",
        Stage::TouchesDiffer => ": does the stop give way, or does the motor slip?",
        Stage::Apart | Stage::Lags => ": is one of them blocked, or off its gear?",
        Stage::AngleGap => ": its motor was not heard for so long that it may have turned unseen",
        Stage::OutOfTravel => {
            ": was its motor mounted anew, or has a belt slipped? Read its level again"
        }
        Stage::Jammed => ": no try has cleared it",
        _ => "",
    };
    format!("{}{hint}", stage.name())
}

pub(crate) fn armed_for(recording: &Recording) -> Micros {
    let armed = recording.arm.iter().filter(|arm| **arm == ArmState::Armed).count();
    Micros::new(armed as u64 * SAMPLE_PERIOD.get())
}

pub(super) fn motors(recording: &Recording, found: &mut Vec<Problem>) {
    for track in &recording.motors {
        let last = &track.last;
        let on = track.motor.on;
        let about = About::Motor(track.motor.label);
        let is_back = effects_on_motor(recording, track, found);
        let is_excused_now = is_excused(&recording.faults, on, recording.length);
        match last.link {
            Link::NeverSeen if !is_excused_now => {
                let name = track.motor.name();
                let text = format!("never heard: is it {name} on {on}, and powered?");
                found.push(Problem::new(about, "never-heard", text));
            }
            Link::Lost if is_back && !is_excused_now => {
                let heard = track.samples.iter().rposition(|it| it.link == Link::Online);
                let since = time_of(heard.unwrap_or(0));
                let problem = Problem::new(about, "lost", "lost at the end".into());
                found.push(problem.in_time(since, recording.length.since(since)));
            }
            _ => (),
        }
        if let Some(fault) = last.fault.filter(|_| !is_excused_now) {
            let text = format!("{fault} (code {})", fault.code);
            found.push(Problem::new(about, "device-fault", text));
        }
        let condition = match last.condition {
            Condition::NotFollowing => {
                "does not do what it is told: it has a fault that it does not tell, or no number for that angle"
            }
            Condition::NoReports => "sends no feedback: it has to be switched on in the device",
            Condition::SlowFeedback => "sends feedback too seldom to be controlled by it",
            _ => "",
        };
        if !condition.is_empty() && !is_excused_now {
            found.push(Problem::new(about, "condition", format!("{condition}, at the end")));
        }
        let refused = last.counters.refused;
        let counts = [
            (refused.not_finite, "targets refused: not a number (infinite or NaN)"),
            (
                refused.out_of_range,
                "targets refused: a number in them lies where the motor cannot go",
            ),
            (refused.unsupported, "targets refused: of a kind that it does not take"),
        ];
        let counts = counts.map(|(count, what)| (count.into(), "refused", what));
        let refusals = rises(&track.samples, |it| it.counters.refused.total().into());
        found.extend(counted(about, counts).map(|it| Problem { span: refusals, ..it }));
        let was_driven = track.samples.iter().any(|sample| sample.drive == DriveMode::Run);
        let is_well = last.link == Link::Online && last.fault.is_none() && refused.total() == 0;
        let armed = armed_for(recording);
        if armed >= ARMED_FOR && !was_driven && is_well {
            let armed = seconds(armed);
            let text = format!("never got a target, and the robot was armed for {armed:.1} s");
            found.push(Problem::new(about, "never-commanded", text));
        }
        motor_counts(recording, track, found);
    }
}

fn motor_counts(recording: &Recording, track: &MotorTrack, found: &mut Vec<Problem>) {
    let counters = track.last.counters;
    let (on, about) = (track.motor.on, About::Motor(track.motor.label));
    let count = |total: u64, of: fn(&MotorSample) -> u64| {
        unexcused(recording, on, total, &track.samples, of)
    };
    let lost = count(counters.lost.into(), |sample| sample.counters.lost.into());
    let losses = counted(about, [(lost, "was-lost", "× lost during the run")]);
    let losing = rises(&track.samples, |sample| sample.counters.lost.into());
    found.extend(losses.map(|it| Problem { span: losing, ..it }));
    let received = u64::from(counters.received);
    let malformed = count(counters.malformed.into(), |sample| sample.counters.malformed.into());
    let problem = share(about, "malformed", malformed, received, "malformed frames");
    let span = rises(&track.samples, |sample| sample.counters.malformed.into());
    found.extend(problem.map(|it| Problem { span, ..it }));
    let overwritten = count(track.overwritten, |sample| sample.overwritten);
    // A device that is alone on its bus is not acknowledged before the robot is there.
    let before = track.samples.first().map_or(0, |sample| sample.overwritten);
    let overwritten = overwritten.saturating_sub(before);
    let what = "feedback frames overwritten because the bus was busy";
    let problem = share(about, "overwritten", overwritten, received, what);
    let span = rises(&track.samples, |sample| sample.overwritten);
    found.extend(problem.map(|it| Problem { span, ..it }));
    let expired = count(counters.expired.into(), |sample| sample.counters.expired.into());
    if expired > 0 {
        let text = format!("{expired} × its command expired while the robot was armed");
        let span = rises(&track.samples, |sample| sample.counters.expired.into());
        found.push(Problem { span, ..Problem::information(about, "expired", text) });
    }
}

/// A problem of a count that should be zero; only information for one, or below 0.1 % of `all`.
fn share(about: About, kind: &'static str, count: u64, all: u64, what: &str) -> Option<Problem> {
    if count == 0 {
        return None;
    }
    Some(if count.saturating_mul(RARE) < all || count == 1 {
        let percent = count as f64 * 100.0 / all as f64;
        Problem::information(about, kind, format!("{count} {what} ({percent:.3} %)"))
    } else {
        Problem::new(about, kind, format!("{count} {what}"))
    })
}

pub(super) fn efforts(recording: &Recording, found: &mut Vec<Problem>) {
    for track in &recording.motors {
        let Some(effort) = &track.effort else { continue };
        let EffortTrack { loops, margins, windows, reversals, at_limit, .. } = effort;
        let about = About::Motor(track.motor.label);
        let millis = WINDOW.get() / 1000;
        let windows_in_a_row = Micros::new(WINDOW.get() * u64::from(IN_A_ROW));
        if effort.oscillates() {
            let text = format!(
                "shakes: its effort changes direction {} times in {millis} ms (from {:.2} s on; in \
                 {} of {windows} windows): a gain of its loops is too high for what it moves",
                reversals.count,
                seconds(reversals.at),
                reversals.windows,
            );
            let problem = Problem::new(about, "oscillation", text);
            found.push(problem.in_time(reversals.at, windows_in_a_row));
        }
        let margins = margins.map(|margins| [("speed", margins.speed), ("angle", margins.angle)]);
        let low = |(_, margin): &(&str, f64)| *margin < margin::LEAST;
        for (name, gain_margin) in margins.into_iter().flatten().filter(low) {
            let text = format!(
                "the gain margin of its {name} loop is {gain_margin:.1}, and should be at least {}: \
                 the kp of its {name} loop is too high for what it moves",
                margin::LEAST,
            );
            let cause = if name == "speed" { "speed kp too high" } else { "angle kp too high" };
            found.push(Problem::new(about, "gain-margin", text).because(cause));
        }
        if margins.is_none() {
            let text = "what it moves is not described (inertia 0): its gain margin is not judged";
            found.push(Problem::information(about, "no-inertia", text.to_owned()));
        }
        feed_forward(about, effort, found);
        if effort.saturates() {
            let text = format!(
                "its effort stands at its limit of {} {} for {:.0} % of {} ms (from {:.2} s on; in \
                 {} of {windows} windows): it is blocked, too weak, or turns the wrong way",
                loops.cascade.speed.output_limit,
                effort.unit(),
                f64::from(at_limit.count) / 10.0,
                millis * u64::from(IN_A_ROW),
                seconds(at_limit.at),
                at_limit.windows,
            );
            let problem = Problem::new(about, "saturation", text);
            found.push(problem.in_time(at_limit.at, windows_in_a_row));
        }
    }
}

/// Finds a feed-forward that is not what the motor carries: the integral has to hold the rest.
fn feed_forward(about: About, effort: &EffortTrack, found: &mut Vec<Problem>) {
    let (unit, limit) = (effort.unit(), f64::from(effort.loops.cascade.speed.output_limit));
    let friction = f64::from(effort.loops.cascade.feed_forward.friction);
    let least = load::LEAST * limit;
    let weight = ("its weight takes", "its `gravity`");
    let motion = ("its motion takes", "`speed` and `friction` of its feed-forward");
    for (fit, good, (what, of)) in [
        (effort.load.weight, 1.0 / load::SIZE..=load::SIZE, weight),
        (effort.load.motion, load::AGAINST..=f64::INFINITY, motion),
    ] {
        let [said, took, apart] = fit.means();
        let is_judged = fit.windows >= load::WINDOWS && said >= least && apart >= least + friction;
        let factor = fit.factor();
        if !is_judged || good.contains(&factor) {
            continue;
        }
        let cause = if factor < 0.0 { "the sign is wrong" } else { "the size is wrong" };
        let text = format!(
            "{what} {factor:.1} times what {of} says ({took:.2} {unit} where {said:.2} {unit} are said): \
             {cause}, and the integral holds the rest"
        );
        let short = if factor < 0.0 {
            "feed-forward's sign is wrong"
        } else {
            "feed-forward's size is wrong"
        };
        found.push(Problem::new(about, "feed-forward", text).because(short));
    }
}

pub(super) fn buses(recording: &Recording, found: &mut Vec<Problem>) {
    for track in &recording.buses {
        let (last, about) = (&track.last, About::Bus(track.number));
        let load = last.load.to_string();
        match last.load.verdict() {
            Verdict::Fits => (),
            Verdict::Tight => found.push(Problem::information(about, "tight", load)),
            Verdict::DoesNotFit => found.push(Problem::new(about, "does-not-fit", load)),
        }
        let count = |total: u32, of: fn(&BusSample) -> u32| {
            let BusTrack { number, samples, .. } = track;
            unexcused(recording, Place::Bus(*number), total.into(), samples, |one| of(one).into())
        };
        let replaced = count(last.replaced, |sample| sample.replaced);
        let submitted = last.submitted.into();
        let what = "commands replaced before they left";
        let problem = share(about, "replaced", replaced, submitted, what);
        let span = |of: fn(&BusSample) -> u32| rises(&track.samples, |one| of(one).into());
        let replacing = span(|sample| sample.replaced);
        found.extend(problem.map(|it| Problem { span: replacing, ..it }));
        type Of = fn(&BusSample) -> u32;
        let counts: [(_, Of, _, _); 4] = [
            (last.overruns, |one| one.overruns, "overrun", "ticks overrun"),
            (last.health.receive_lost, |one| one.lost, "rx-lost", "received frames lost"),
            (last.refused, |one| one.refused, "frame-refused", "frames refused"),
            (last.health.bus_offs, |one| one.bus_offs, "bus-off", "× bus-off"),
        ];
        for (total, of, kind, what) in counts {
            let problems = counted(about, [(count(total, of), kind, what)]);
            found.extend(problems.map(|it| Problem { span: span(of), ..it }));
        }
        let unclaimed = last.received.unclaimed;
        if let (1.., Some(key)) = (unclaimed, last.received.last_unclaimed) {
            let text = format!("{unclaimed} frames that no motor claims, the newest of {key:#x}");
            found.push(Problem::information(about, "unclaimed", text));
        }
    }
}

pub(super) fn lines(recording: &Recording, found: &mut Vec<Problem>) {
    for (number, line) in (1..).zip(&recording.lines) {
        let (about, traffic) = (About::Line(number), &line.traffic);
        let all = traffic.exchanges.into();
        // A line's counters are not sampled, so the effects of its faults cannot be told apart.
        let is_faulty = recording.faults.iter().any(|fault| is_on(fault, Place::Line(number)));
        for (count, kind, what) in [
            (traffic.timeouts, "timeout", "commands without an answer"),
            (traffic.crc_errors, "crc", "answers with a wrong CRC"),
            (traffic.unexpected, "unexpected", "answers that were not asked for"),
        ] {
            let count = if is_faulty { 0 } else { count };
            found.extend(share(about, kind, count.into(), all, what));
        }
        let errors = (line.port_errors.into(), "port-error", "port errors");
        let overruns = (line.overruns.into(), "overrun", "ticks overrun");
        found.extend(counted(about, [errors, overruns]));
    }
}

pub(super) fn parts(recording: &Recording, found: &mut Vec<Problem>) {
    for PartTrack { label, uart, heard } in &recording.parts {
        let about = About::Part(label);
        if heard.frames == 0 && recording.length > PART_WITHIN {
            let text = format!("never heard at UART {uart}");
            found.push(Problem::new(about, "never-heard", text));
        }
        let is_faulty = |fault: &Fault| matches!(&fault.kind, FaultKind::Part(_, name) if is_called(label, name));
        if !recording.faults.iter().any(is_faulty) {
            damage(about, heard, 0, found);
        }
    }
}

/// Damaged frames and port errors of a serial device; `excused` of the frames have another cause.
fn damage(about: About, heard: &Counters, excused: u32, found: &mut Vec<Problem>) {
    let (damaged, all) = (heard.damaged.saturating_sub(excused).into(), heard.frames.into());
    found.extend(share(about, "damaged", damaged, all, "damaged frames"));
    found.extend(counted(about, [(heard.port_errors.into(), "port-error", "port errors")]));
}

pub(super) fn remote(recording: &Recording, found: &mut Vec<Problem>) {
    let Some(track) = &recording.remote else { return };
    let RemoteTrack { receiver, sent, heard, losses, .. } = track;
    let about = About::Remote;
    if let Some(heard) = heard {
        if heard.frames == 0 && sent.live > 0 {
            let text = format!("never heard: {} frames of {receiver} were sent", sent.frames);
            found.push(Problem::new(about, "never-heard", text));
        }
        // A train of pulses that a loss has cut off is no problem of its own.
        let cut_off = if *receiver == Receiver::Ppm { losses.len() as u32 } else { 0 };
        damage(about, heard, cut_off, found);
    }
    for loss in losses {
        if let Some(time) = loss.reaction().filter(|time| *time > REACTION) {
            let text = format!("lost: the motors coasted after {:.1} ms only", seconds(time) * 1e3);
            let problem = Problem::new(about, "late-to-coast", text);
            found.push(problem.in_time(loss.lost.from, time));
        } else if is_driven_on(loss, recording.length) {
            let text = format!(
                "lost at {:.3} s: the motors did not coast within {} ms of the last good frame",
                seconds(loss.lost.from),
                REACTION.get() / 1000,
            );
            let problem = Problem::new(about, "not-coasting", text);
            found.push(problem.in_time(loss.lost.from, REACTION));
        }
    }
}

/// Whether motors were still driven after a loss that was long enough.
fn is_driven_on(loss: &Loss, end: Micros) -> bool {
    let due = loss.last_frame.unwrap_or(loss.lost.from).max(loss.lost.from) + REACTION;
    let over = loss.back.or(loss.lost.until).unwrap_or(end).min(end);
    loss.coasting.is_none() && over > due
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::problems;
    use crate::recording::look::MotorLook;
    use crate::robot::motor::Motor;

    /// A motor on bus 1 in 8 s, whose link and losses are by the milliseconds.
    fn recorded(seen: impl Fn(u64) -> (Link, u32)) -> Recording {
        let sample = |index| {
            let (link, lost) = seen(time_of(index).get() / 1000);
            let mut sample = MotorSample { link, ..MotorLook::NEW.seen() };
            sample.counters.lost = lost;
            sample
        };
        let samples: Vec<_> = (0..800).map(sample).collect();
        let mut last = rc10_motor::MotorStatus::NEW;
        (last.link, last.counters) = (samples[799].link, samples[799].counters);
        let track = MotorTrack {
            motor: Motor::dji_on("wheel", 1, &rc10_motor::dji::M3508, 1),
            samples,
            last,
            overwritten: 0,
            tracking: Vec::new(),
            peak_current: 0.0,
            effort: None,
        };
        let length = Micros::from_millis(8000);
        Recording { length, motors: vec![track], ..Recording::default() }
    }

    fn found_in(recording: &Recording) -> Vec<(&'static str, String)> {
        problems(recording).into_iter().map(|problem| (problem.kind, problem.text)).collect()
    }

    /// The problems that are found with these faults.
    fn found(faults: &[&str], seen: impl Fn(u64) -> (Link, u32)) -> Vec<(&'static str, String)> {
        let faults = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        found_in(&Recording { faults, ..recorded(seen) })
    }

    /// What never happened to a motor that is heard and not driven, with the robot for these milliseconds
    /// in each state.
    fn armed(source: Source, arm: &[(ArmState, u64)]) -> Vec<&'static str> {
        let samples = arm.iter().flat_map(|(state, millis)| {
            std::iter::repeat_n(*state, (millis * 1000 / SAMPLE_PERIOD.get()) as usize)
        });
        let recording = recorded(|_| (Link::Online, 0));
        let told = found_in(&Recording { source, arm: samples.collect(), ..recording });
        told.into_iter().map(|(kind, _)| kind).filter(|kind| kind.starts_with("never-")).collect()
    }

    /// In 8 s: armed or not, a heading up to some time.
    #[test]
    fn a_lost_heading_and_a_missing_one_differ_and_count_while_armed() {
        use ArmState::{Armed, Disarmed};
        for (arm, until, cause) in [
            (Armed, 0, Some("it never came")),
            (Armed, 2000, Some("it was lost")),
            (Armed, 7600, None),
            (Disarmed, 0, None),
            (Disarmed, 2000, None),
        ] {
            let headings = (0..800).map(|at| time_of(at) <= Micros::from_millis(until));
            let recording = recorded(|_| (Link::Online, 0));
            let (headings, source) = (headings.collect(), Source::Robot);
            let told = found_in(&Recording { headings, source, arm: vec![arm; 800], ..recording });
            let found = told.into_iter().find(|(kind, _)| *kind == "no-heading");
            assert_eq!(found.is_some(), cause.is_some(), "{arm:?} {until}: {found:?}");
            assert!(found.is_none_or(|(_, text)| cause.is_some_and(|it| text.contains(it))));
        }
    }

    /// A weight may be off by the factor of 1.6, a motion may take anything but the opposite; of five windows.
    #[test]
    fn a_feed_forward_is_judged_by_what_it_is_of() {
        use crate::recording::load::{Fit, LoadTrack};
        let loops = rc10_motor::Loops {
            effort: rc10_motor::TargetKind::Current,
            cascade: rc10_motor::dji::M3508.cascade,
        };
        let judged = |load: LoadTrack| {
            let mut recording = recorded(|_| (Link::Online, 0));
            let mut effort = crate::recording::effort::EffortWatch::new(loops, None).finish();
            effort.load = load;
            recording.motors[0].effort = Some(effort);
            found_in(&recording).into_iter().filter(|(kind, _)| *kind == "feed-forward").count()
        };
        let said = 0.5 * f64::from(loops.cascade.speed.output_limit);
        for (factor, windows, weight, motion) in [
            (1.0, 9, 0, 0),
            (1.5, 9, 0, 0),
            (2.5, 9, 1, 0),
            (0.7, 9, 0, 0),
            (0.3, 9, 1, 0),
            (-0.4, 9, 1, 0),
            (-1.0, 5, 1, 1),
            (-1.0, 4, 0, 0),
        ] {
            let fit = Fit::even(windows, said, factor);
            let of_weight = judged(LoadTrack { weight: fit, ..LoadTrack::default() });
            let of_motion = judged(LoadTrack { motion: fit, ..LoadTrack::default() });
            assert_eq!((of_weight, of_motion), (weight, motion), "{factor}, {windows} windows");
        }
    }

    #[test]
    fn a_robot_that_really_runs_may_rest_and_a_simulated_one_is_to_be_armed() {
        use ArmState::{Armed, Disarmed, EStopped, Suspended};
        for arm in [Disarmed, EStopped, Suspended] {
            assert_eq!(armed(Source::Robot, &[(arm, 8000)]), [""; 0], "{arm:?}");
            assert_eq!(armed(Source::Simulation, &[(arm, 8000)]), ["never-armed"], "{arm:?}");
        }
        assert_eq!(armed(Source::Simulation, &[(Disarmed, 7900), (Armed, 100)]), [""; 0]);
    }

    #[test]
    fn only_the_time_in_which_it_was_armed_asks_for_a_target() {
        use ArmState::{Armed, Disarmed, EStopped, Suspended};
        let none = [""; 0];
        for source in [Source::Robot, Source::Simulation] {
            for other in [Disarmed, Suspended, EStopped] {
                let told = armed(source, &[(other, 4000), (Armed, 490), (other, 3510)]);
                assert_eq!(told, none, "{other:?}");
                // In two parts.
                let parts = [(Armed, 250), (other, 4000), (Armed, 250), (other, 3500)];
                assert_eq!(armed(source, &parts), ["never-commanded"], "{other:?}");
            }
        }
    }

    #[test]
    fn a_fault_excuses_no_loss_before_it() {
        let told = found(&["cut:1@5s..5.1s"], |at| match at {
            ..1000 => (Link::Online, 0),
            5010..5200 => (Link::Lost, 4),
            5200.. => (Link::Online, 4),
            _ => (Link::Online, 3),
        });
        assert_eq!(told[0], ("was-lost", "3 × lost during the run".to_owned()));
    }

    #[test]
    fn a_motor_that_does_not_come_back_is_reported_beside_other_faults() {
        let faults = ["cut:1@1s..1.2s", "cut:1@5s..5.1s"];
        let seen = |at| if at < 1010 { (Link::Online, 0) } else { (Link::Lost, 1) };
        let told = found(&faults, seen);
        assert_eq!(told.iter().filter(|(kind, _)| *kind == "not-back").count(), 2, "{told:?}");
        // The second one begins before it could be back.
        let told = found(&["cut:1@1s..1.2s", "cut:1@1.6s..1.8s"], seen);
        assert_eq!(told.iter().filter(|(kind, _)| *kind == "not-back").count(), 1, "{told:?}");
    }
}
