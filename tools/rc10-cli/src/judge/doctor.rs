//! The causes of what was found in a run, the likeliest first, with what tells them apart and what to do.
//!
//! A cause is a finding that no other explains, or one that several share: a bus whose motors are all lost together is one
//! cause, and not one for each motor. Injected faults are not looked at: a doctor does not know of them.

use rc10_can::Health;
use rc10_motor::{ArmState, Link};
use rc10_time::Micros;
use serde_json::Value;

use crate::judge::problems;
use crate::recording::problem::{About, Problem, Severity};
use crate::recording::sample::{SAMPLE_PERIOD, seconds, time_of};
use crate::recording::{MotorTrack, Recording};
use crate::robot::motor::Place;

/// A cause, and what follows of it.
pub struct Cause {
    /// The finding itself.
    pub problem: Problem,
    /// Other findings that it explains.
    pub so_also: Vec<Problem>,
}

impl Cause {
    /// The cause as JSON.
    pub fn to_json(&self) -> Value {
        let mut json = self.problem.to_json();
        let so_also = self.so_also.iter().map(Problem::to_json).collect::<Vec<_>>();
        json["so_also"] = so_also.into();
        json
    }
}

/// Kinds that follow of a motor that is not heard.
const LOSS: &str = "never-heard lost was-lost not-back expired saturation runaway never-commanded base gave-up \
     never-began device-fault condition bus-off overwritten frame-refused timeout oscillation feed-forward refused \
     replaced";
/// Kinds that follow of a wheel, or a loop, that is not as the table has it.
const BUILD: &str = "saturation runaway oscillation gain-margin feed-forward base gave-up refused";
/// What follows of what: kinds of causes, the kinds that follow of them, and what these are about: `*` anything, `?`
/// anything if the cause's motors are unknown, the `robot` or a part, a `motor` of the cause or what is `shared` with it,
/// or one that the cause has `named`.
const FOLLOWS: [(&str, &str, &str); 9] = [
    ("restart task-ended", "*", "robot"),
    // Where a supply falls far, ESCs begin anew.
    ("restart task-ended sags", LOSS, "*"),
    (
        "answers-twice other-identifier never-heard lost was-lost timeout not-back",
        LOSS,
        "motor robot named",
    ),
    ("power-gone bus-shorted bus-alone bus-silent bus-loose", LOSS, "motor shared robot"),
    ("heats", "device-fault", "motor"),
    ("does-not-fit overrun replaced", "overwritten replaced rx-lost expired", "motor shared"),
    ("base", BUILD, "motor robot ?"),
    (
        "device-fault condition runaway oscillation gain-margin feed-forward saturation",
        BUILD,
        "motor robot",
    ),
    ("never-armed", "never-commanded never-began", "*"),
];

/// Transmit errors of a controller that takes itself for the culprit, ISO 11898-1.
const PASSIVE: u8 = 128;
/// Degrees at which the first of the motors, Unitree's, switch off; and those from which on it is looked how they rise.
const HOT: f64 = 90.0;
const WARM: f64 = 50.0;
/// Seconds that are looked ahead, and that a rise is looked at.
const AHEAD: f64 = 120.0;
const LEAST: f64 = 5.0;
/// Share of its highest voltage below which a supply sags.
const SAGS: f32 = 0.8;
/// Losses that begin so near to one another are one.
const TOGETHER: Micros = Micros::from_millis(60);

/// The times at which a motor that had been heard was lost.
fn losses(track: &MotorTrack) -> Vec<Micros> {
    let pairs = (1..).zip(track.samples.windows(2));
    let lost = pairs.filter(|(_, two)| two[0].link == Link::Online && two[1].link == Link::Lost);
    lost.map(|(at, _)| time_of(at)).collect()
}

/// The times at which all of these motors were lost together.
fn common_losses(tracks: &[&MotorTrack]) -> Vec<Micros> {
    let Some((first, others)) = tracks.split_first() else { return Vec::new() };
    let near = |at: &Micros, track: &&MotorTrack| {
        losses(track).iter().any(|it| it.since(*at).max(at.since(*it)) <= TOGETHER)
    };
    losses(first).into_iter().filter(|at| others.iter().all(|track| near(at, track))).collect()
}

/// What several motors share: their supply, or their bus.
fn shared(recording: &Recording) -> Vec<Problem> {
    let all: Vec<&MotorTrack> = recording.motors.iter().collect();
    let mut places: Vec<Place> = Vec::new();
    for track in &all {
        if !places.contains(&track.motor.on) {
            places.push(track.motor.on);
        }
    }
    let is_silent = |tracks: &[&MotorTrack]| {
        tracks.len() > 1 && tracks.iter().all(|track| track.last.link == Link::NeverSeen)
    };
    let told = |times: &[Micros]| {
        let shown = times.iter().take(5).map(|at| format!("{:.2}", seconds(*at)));
        let shown = shown.collect::<Vec<_>>().join(", ");
        let more = times.len().saturating_sub(5);
        if more == 0 { format!("{shown} s") } else { format!("{shown} s and {more} times more") }
    };
    let problem = |about, kind, text, times: &[Micros]| {
        let (problem, first) = (Problem::new(about, kind, text), times.first());
        let span = first.map(|first| (*first, *first + TOGETHER));
        Problem { span, ..problem }
    };
    let (count, together) = (all.len(), common_losses(&all));
    if places.len() > 1 && (is_silent(&all) || !together.is_empty()) {
        let text = match together.as_slice() {
            [] => format!("not one of its {count} motors was ever heard, on any bus"),
            some => {
                format!("all {count} motors were lost together, on every bus, at {}", told(some))
            }
        };
        return vec![problem(About::Robot, "power-gone", text, &together)];
    }
    let mut found = Vec::new();
    for on in places {
        let tracks: Vec<_> = all.iter().copied().filter(|it| it.motor.on == on).collect();
        let (about, health) = match on {
            Place::Bus(number) => {
                let bus = recording.buses.iter().find(|bus| bus.number == number);
                (About::Bus(number), bus.map(|bus| bus.last.health).unwrap_or_default())
            }
            Place::Line(number) => (About::Line(number), Health::default()),
        };
        let labels: Vec<_> = tracks.iter().map(|track| track.motor.label).collect();
        let (labels, together) = (labels.join(", "), common_losses(&tracks));
        let kind = match (is_silent(&tracks), health.bus_offs) {
            (false, _) if together.is_empty() => continue,
            (_, 1..) => "bus-shorted",
            // Frames that nothing acknowledges take it that far, and no further.
            _ if health.transmit_errors >= PASSIVE => "bus-alone",
            (true, _) => "bus-silent",
            // One motor that is alone on its bus is lost like its bus.
            _ if tracks.len() < 2 => continue,
            _ => "bus-loose",
        };
        let mut text = match together.as_slice() {
            [] => format!("never heard: {labels}"),
            some => format!("{labels} lost together at {}", told(some)),
        };
        let (errors, offs) = (health.transmit_errors, health.bus_offs);
        if errors > 0 || offs > 0 {
            text += &format!("; transmit error counter {errors}, {offs} times bus-off");
        }
        found.push(problem(about, kind, text, &together));
    }
    found
}

/// A motor that is too hot, or will soon be.
fn heat(track: &MotorTrack) -> Option<Problem> {
    let told = (0..).zip(&track.samples).filter(|(_, it)| it.temperature.is_finite());
    let told: Vec<(f64, f64)> =
        told.map(|(at, it)| (seconds(time_of(at)), f64::from(it.temperature))).collect();
    let (now, last) = *told.last()?;
    // Of the last half minute: a line by least squares, as they tell whole degrees.
    let some: Vec<_> = told.into_iter().filter(|(at, _)| *at > now - 30.0).collect();
    let count = some.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| some.iter().map(of).sum::<f64>() / count;
    let (at, degrees) = (mean(|it| it.0), mean(|it| it.1));
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| some.iter().map(of).sum::<f64>();
    let rise = sum(&|it| (it.0 - at) * (it.1 - degrees)) / sum(&|it| (it.0 - at).powi(2));
    let left = (HOT - last) / rise;
    let text = if last >= HOT {
        format!("is at {last:.0} °C")
    } else if last >= WARM && some[0].0 < now - LEAST && rise > 0.0 && left < AHEAD {
        format!(
            "is at {last:.0} °C, {rise:.2} °C a second warmer: at this load {HOT:.0} °C in {left:.0} s"
        )
    } else {
        return None;
    };
    Some(Problem::new(About::Motor(track.motor.label), "heats", text))
}

/// The supply that falls most under load.
fn sag(recording: &Recording) -> Option<Problem> {
    let of = |track: &MotorTrack| {
        let told = (0..).zip(&track.samples).filter(|(_, it)| it.supply > 1.0);
        let told: Vec<(usize, f32)> = told.map(|(at, it)| (at, it.supply)).collect();
        let highest = told.iter().map(|it| it.1).fold(0.0, f32::max);
        let (at, lowest) = told.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some((lowest / highest, track.motor.label, [highest, lowest], time_of(at)))
    };
    let all = recording.motors.iter().filter_map(of);
    let (share, label, [highest, lowest], at) = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let text = format!("falls from {highest:.1} to {lowest:.1} V at {:.2} s", seconds(at));
    let problem = Problem::new(About::Motor(label), "sags", text).in_time(at, SAMPLE_PERIOD);
    (share < SAGS).then_some(problem)
}

/// A remote that was not heard while the robot drove.
fn remote_lost(recording: &Recording) -> Option<Problem> {
    let is_off = |arm: &ArmState| *arm == ArmState::Suspended;
    let pairs = (1..).zip(recording.arm.windows(2));
    let begin = pairs.filter(|(_, two)| two[0] == ArmState::Armed && is_off(&two[1]));
    let begins: Vec<_> = begin.map(|(at, _)| time_of(at)).collect();
    let first = *begins.first()?;
    let count = recording.arm.iter().filter(|arm| is_off(arm)).count() as u64;
    let length = Micros::new(count * SAMPLE_PERIOD.get());
    let text = format!(
        "not heard {} times, {:.1} s in all: the motors coast",
        begins.len(),
        seconds(length)
    );
    Some(Problem::new(About::Remote, "remote-lost", text).in_time(first, length))
}

/// Labels of the motors that a finding is of.
fn motors_of(recording: &Recording, problem: &Problem) -> Vec<&'static str> {
    let on = |place: Place| {
        let of = recording.motors.iter().filter(move |track| track.motor.on == place);
        of.map(|track| track.motor.label).collect()
    };
    match problem.about {
        About::Motor(label) => vec![label],
        _ if !problem.culprits.is_empty() => problem.culprits.clone(),
        About::Bus(number) => on(Place::Bus(number)),
        About::Line(number) => on(Place::Line(number)),
        About::Robot if problem.kind == "power-gone" => {
            recording.motors.iter().map(|track| track.motor.label).collect()
        }
        _ => Vec::new(),
    }
}

/// Whether a finding follows of another.
fn explains(recording: &Recording, cause: &Problem, other: &Problem) -> bool {
    let begins = |problem: &Problem| problem.span.map(|(begin, _)| begin);
    if let (Some(cause), Some(other)) = (begins(cause), begins(other))
        && cause > other + TOGETHER
    {
        return false;
    }
    let (own, others) = (motors_of(recording, cause), motors_of(recording, other));
    let is_one = own.iter().any(|label| others.contains(label));
    let is_shared = matches!(other.about, About::Bus(_) | About::Line(_));
    let is_named = || others.iter().any(|it| cause.text.contains(it));
    let about = [
        ("*", true),
        ("?", own.is_empty()),
        ("robot", matches!(other.about, About::Robot | About::Part(_))),
        ("motor", is_one && !is_shared),
        ("shared", is_one && is_shared),
        ("named", other.kind == "never-heard" && is_named()),
    ];
    let has = |words: &str, word| words.split(' ').any(|it| it == word || it == "*");
    FOLLOWS.iter().any(|(causes, kinds, of)| {
        has(causes, cause.kind)
            && has(kinds, other.kind)
            && about.iter().any(|(word, is_it)| *is_it && has(of, word))
    })
}

/// The causes of what was found in a run, the likeliest first.
pub fn causes(recording: &Recording) -> Vec<Cause> {
    let blind = Recording { faults: Vec::new(), ..recording.clone() };
    let mut all = shared(&blind);
    all.extend(remote_lost(&blind));
    all.extend(blind.motors.iter().filter_map(heat));
    all.extend(sag(&blind));
    all.extend(problems(&blind).into_iter().filter(|it| it.severity == Severity::Problem));
    // Of two alike the earlier one is first.
    all.sort_by_key(|it| (it.remedy().0, it.span.map_or(Micros::ZERO, |(begin, _)| begin)));
    let mut causes: Vec<Cause> = Vec::new();
    for problem in all {
        if let Some(cause) = causes.iter_mut().find(|it| explains(&blind, &it.problem, &problem)) {
            cause.so_also.push(problem);
            continue;
        }
        causes.push(Cause { problem, so_also: Vec::new() });
    }
    causes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::look::MotorLook;
    use crate::recording::sample::MotorSample;
    use crate::robot::motor::Motor;

    /// A motor that is heard, of these samples of 10 ms.
    fn recorded(count: u64, seen: impl Fn(f64, &mut MotorSample)) -> Recording {
        let sample = |at| {
            let mut sample = MotorSample { link: Link::Online, ..MotorLook::NEW.seen() };
            seen(0.01 * at as f64, &mut sample);
            sample
        };
        let mut last = rc10_motor::MotorStatus::NEW;
        last.link = Link::Online;
        let track = MotorTrack {
            motor: Motor::dji_on("wheel", 1, &rc10_motor::dji::M3508, 1),
            samples: (0..count).map(sample).collect(),
            last,
            overwritten: 0,
            tracking: Vec::new(),
            peak_current: 0.0,
            effort: None,
        };
        Recording { length: time_of(count as usize), motors: vec![track], ..Recording::default() }
    }

    fn found(recording: &Recording) -> Vec<(&'static str, String)> {
        causes(recording).into_iter().map(|it| (it.problem.kind, it.problem.text)).collect()
    }

    #[test]
    fn each_word_of_what_follows_is_a_kind() {
        for words in FOLLOWS.iter().flat_map(|(causes, kinds, _)| [causes, kinds]) {
            for kind in words.split(' ').filter(|kind| *kind != "*") {
                assert!(Problem::new(About::Robot, kind, String::new()).cause != kind, "{kind}");
            }
        }
    }

    #[test]
    fn heat_is_told_ahead_and_only_if_it_comes_soon() {
        let rises = |begin: f64, rise: f64| {
            move |at: f64, it: &mut MotorSample| it.temperature = (begin + rise * at).floor() as f32
        };
        let told = found(&recorded(2000, rises(50.0, 0.8)));
        assert_eq!(told.len(), 1, "{told:?}");
        assert_eq!(
            told[0],
            (
                "heats",
                "is at 65 °C, 0.80 °C a second warmer: at this load 90 °C in 31 s".to_owned()
            )
        );
        assert_eq!(found(&recorded(600, rises(91.0, 0.0)))[0].1, "is at 91 °C");
        for (begin, rise) in [(30.0, 0.8), (60.0, 0.1), (80.0, 0.0), (88.0, -1.0)] {
            assert!(found(&recorded(2000, rises(begin, rise))).is_empty(), "{begin} {rise}");
        }
        // A short look tells no rise.
        assert!(found(&recorded(300, rises(60.0, 3.0))).is_empty());
    }

    #[test]
    fn a_supply_that_sags_is_told_and_explains_what_is_lost_behind_it() {
        let sags = |lowest: f32| {
            recorded(500, move |at, it| {
                it.supply = if (2.0..2.2).contains(&at) { lowest } else { 24.0 };
                if (2.05..2.3).contains(&at) {
                    (it.link, it.supply) = (Link::Lost, 0.0);
                }
                it.counters.lost = u32::from(at >= 2.05);
            })
        };
        let mut recording = sags(17.0);
        recording.motors[0].last.counters.lost = 1;
        let told = causes(&recording);
        assert_eq!(told[0].problem.text, "falls from 24.0 to 17.0 V at 2.01 s");
        assert_eq!((told.len(), told[0].so_also[0].kind), (1, "was-lost"));
        assert!(found(&sags(20.0)).iter().all(|it| it.0 != "sags"));
    }
}
