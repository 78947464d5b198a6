//! Turning a motor to learn of it: by jogs, which the robot allows and limits, within a travel.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail};
use rc10_link::{Action, RIDES};
use rc10_motor::{DriveMode, TargetKind};
use rc10_time::Micros;

use super::estimate::Sample;
use super::response::frequencies;
use crate::live::client::Answer;
use crate::live::plan::Line;
use crate::live::session::{Session, stop};
use crate::record::fields::Named as _;
use crate::recording::look::MotorLook;
use crate::recording::sample::is_angle;

/// Samples of a motor, from looks at it.
#[derive(Default)]
pub(super) struct Gathered {
    /// The samples.
    pub samples: Vec<Sample>,
    asked: f64,
    last: Option<(f64, TargetKind)>,
}

impl Gathered {
    /// Takes the numbers of a look, by their names; what is told again or of another start is no sample.
    pub fn take<'n>(&mut self, at: f64, numbers: impl Iterator<Item = (&'n str, f64)>) {
        let (mut look, mut has_angle) = (MotorLook::NEW, false);
        for (name, number) in numbers {
            look.put_named(name, number);
            has_angle |= name == "total_angle" && number.is_finite();
        }
        if !has_angle || self.last.is_some_and(|it| it.0 >= at) {
            return;
        }
        let is_driven = look.status.drive == DriveMode::Run;
        let before = self.last.replace((at, look.kind));
        // Angles and speeds are not on the same scale: where one follows the other, it is not known.
        let before = before.filter(|it| is_driven && is_angle(it.1) == is_angle(look.kind));
        self.asked = match (before, look.kind) {
            (None, _) => f64::NAN,
            (_, kind) if is_angle(kind) => look.target,
            (Some((before, _)), TargetKind::Speed | TargetKind::SpeedMotion) => {
                let from = if self.asked.is_nan() { 0.0 } else { self.asked };
                from + 6.0 * look.target * (at - before)
            }
            _ => f64::NAN,
        };
        let speed = look.status.feedback.speed.get().into();
        let effort = look.effort.filter(|_| is_driven).unwrap_or(f64::NAN);
        let angle = look.status.feedback.total_angle.microdegrees() as f64 * 1e-6;
        self.samples.push(Sample { at, effort, angle, speed, reference: self.asked });
    }
}

/// Way that a motor goes on until it hears that it should turn round, in seconds of its speed.
const REACTS: f64 = 0.3;

/// Speeds to ask for, as shares of the fastest: of a motor that turns this way, to and fro within a travel.
pub(super) trait Speeds {
    /// The share at a time, s, for a motor that has this much room, s at the fastest; `None` at the end.
    fn next(&mut self, at: f64, room: f64) -> Option<f64>;
}

/// Speeds that jump all the time: they tell much.
pub(super) struct Jumps {
    until: f64,
    random: u64,
    level: f64,
    share: f64,
    /// Until when it stays at this level, and at this share of it, s.
    holds: [f64; 2],
}

impl Jumps {
    /// For some seconds.
    pub const fn new(seconds: f64) -> Self {
        Self { until: seconds, random: 1, level: 0.0, share: 0.0, holds: [0.0; 2] }
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        // Knuth's generator: the same in each experiment.
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        low + (high - low) * (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }
}

impl Speeds for Jumps {
    fn next(&mut self, at: f64, _: f64) -> Option<f64> {
        if at >= self.holds[0] {
            self.level = self.between(0.45, 0.85);
            self.holds[0] = at + self.between(0.3, 0.8);
        }
        if at >= self.holds[1] {
            let more = if self.between(0.0, 1.0) < 0.5 { -0.15 } else { 0.15 };
            self.share = self.level + more;
            self.holds[1] = at + self.between(0.03, 0.1);
        }
        (at < self.until).then_some(self.share)
    }
}

/// A wave upon a speed: its frequency, Hz, and how long, s; steps up and down, or a sine.
#[derive(Clone, Copy)]
pub(super) struct Wave {
    hz: f64,
    seconds: f64,
    is_steps: bool,
}

impl Wave {
    /// Its way, in seconds at the fastest.
    fn way(&self) -> f64 {
        WAVE[0] * (SETTLES + self.seconds)
    }
}

/// Waves one after the other, each while there is room for it without turning round.
pub(super) struct Waves {
    all: Vec<Wave>,
    now: usize,
    begun: Option<f64>,
}

/// Mean share of the fastest, and how much a wave is more or less: a motor that turns twice as fast as asked is stopped.
const WAVE: [f64; 2] = [0.7, 0.15];
/// Time until it turns evenly, s; and a wave's periods, and its shortest time, s.
const SETTLES: f64 = 0.4;
const PERIODS: f64 = 6.0;
const SHORTEST: f64 = 0.6;

impl Waves {
    /// Steps up and down, half a second each.
    pub fn steps(whole: f64) -> Self {
        Self::of(whole, [1.0; 5].map(|hz| Wave { hz, seconds: 1.0, is_steps: true }).to_vec())
    }

    /// A sine that is swept over all frequencies.
    pub fn sweep(whole: f64) -> Self {
        let wave = |hz: f64| Wave { hz, seconds: (PERIODS / hz).max(SHORTEST), is_steps: false };
        Self::of(whole, frequencies().map(wave).collect())
    }

    /// Those for which the whole travel, in seconds at the fastest, has room.
    fn of(whole: f64, mut all: Vec<Wave>) -> Self {
        all.retain(|it| it.way() + 2.0 * REACTS < whole);
        Self { all, now: 0, begun: None }
    }
}

impl Speeds for Waves {
    fn next(&mut self, at: f64, room: f64) -> Option<f64> {
        let wave = *self.all.get(self.now)?;
        let [mean, more] = WAVE;
        // Without room it goes on to where it turns round.
        let begin = match self.begun {
            None if room < wave.way() => return Some(mean),
            begun => *self.begun.insert(begun.unwrap_or(at + SETTLES)),
        };
        if at > begin + wave.seconds {
            (self.now, self.begun) = (self.now + 1, None);
        }
        let share = (TAU * wave.hz * (at - begin)).sin();
        let share = if wave.is_steps { share.signum() } else { share };
        Some(mean + if at > begin { more * share } else { 0.0 })
    }
}

/// A motor that is turned.
pub(super) struct Turned<'s, 'r> {
    /// The robot.
    pub session: &'s mut Session<'r>,
    motor: u8,
    /// Its signals that are watched, by their numbers.
    signals: BTreeMap<u16, String>,
    travel: f64,
    fastest: f64,
    direction: f64,
    /// The angle at which it began.
    from: Option<f64>,
    ended: Arc<AtomicBool>,
}

impl<'s, 'r> Turned<'s, 'r> {
    /// A motor that may turn by so many degrees either way, and at a speed in rpm. Fails if the robot has none that is called so.
    pub fn new(
        session: &'s mut Session<'r>,
        label: &str,
        [travel, fastest]: [f64; 2],
    ) -> Result<Self> {
        let ended = stop()?;
        let motor = session.client.motor(label).context("the robot has no such motor")?;
        let own =
            session.client.signals().filter(|(_, it)| it.folder == "motors" && it.label == label);
        let own = own.filter(|(_, it)| SIGNALS.contains(&it.name.as_str()));
        let signals: BTreeMap<u16, String> = own.map(|(at, it)| (at, it.name.clone())).collect();
        // As often as the line carries them, each in the tick in which it is: what is late comes between two ticks.
        let line = Line::new(session.baud(), &[]);
        let period = (1..=RIDES).find(|it| line.beside(signals.len(), *it).is_some());
        session.client.set_line(line.bytes);
        session.client.watch(CHOSEN, period.unwrap_or(RIDES), signals.keys().copied());
        // Where there is little room, it turns so slowly that it can turn round in time.
        let fastest = fastest.min(travel / (8.0 * REACTS));
        Ok(Self { session, motor, signals, travel, fastest, direction: 1.0, from: None, ended })
    }

    /// Its whole travel, in seconds at the fastest.
    pub fn whole(&self) -> f64 {
        2.0 * self.travel / (6.0 * self.fastest)
    }

    /// Turns it at these speeds, and gathers what it tells. Fails if the robot refuses, or the motor leaves its travel.
    pub fn turn(&mut self, speeds: &mut impl Speeds) -> Result<Vec<Sample>> {
        let mut gathered = Gathered::default();
        let outcome = self.run(speeds, &mut gathered);
        let rest = self.session.carry_out(Action::Jog(self.motor, 0));
        outcome?;
        rest?;
        Ok(gathered.samples)
    }

    /// Turns it until the speeds end, and then slows it down.
    fn run(&mut self, speeds: &mut impl Speeds, gathered: &mut Gathered) -> Result<()> {
        let Self { session, motor, signals, travel, fastest, direction, from, ended } = self;
        let (motor, travel, fastest) = (*motor, *travel, *fastest);
        let (mut sent, mut asked, mut start, mut speed) = (Micros::ZERO, Vec::new(), None, 0.0_f64);
        let mut refused = None;
        let (mut lately, mut known, mut heard) = ([0.0; LATELY], 0, session.now());
        // Until when it slows down; and the way that it was asked for in this direction, degrees.
        let (mut rests, mut way) = (None, [0.0, 0.0]);
        loop {
            session.step()?;
            for sample in session.client.take_samples() {
                let named = sample.values.iter().filter_map(|(index, value)| {
                    Some((signals.get(index)?.as_str(), f64::from(*value)))
                });
                if sample.group == CHOSEN {
                    gathered.take(sample.at.get() as f64 * 1e-6, named);
                }
            }
            let count = gathered.samples.len();
            if count > known {
                (known, heard) = (count, session.now());
            }
            // What is not heard of must not turn on: a robot that was restarted, too, whose clock begins anew.
            if session.now().since(heard) > if count == 0 { SILENT } else { STALE } {
                let trouble = session.trouble();
                bail!("{}", trouble.unwrap_or_else(|| "it tells nothing of its motor".into()));
            }
            let Some(now) = gathered.samples.last() else { continue };
            let (first, from) = (*start.get_or_insert(now.at), *from.get_or_insert(now.angle));
            // A jog of a busy PC may come too late; when for a while none is done, the robot refuses for good.
            asked.retain(|id| match session.client.answer(*id) {
                Some(Answer::Refused(why)) => {
                    refused.get_or_insert((session.now(), why));
                    false
                }
                Some(_) => {
                    refused = None;
                    false
                }
                None => true,
            });
            // What was lost on the line is never answered.
            asked.drain(..asked.len().saturating_sub(ANSWERED));
            if let Some((_, why)) =
                refused.as_ref().filter(|it| session.now().since(it.0) > REFUSED)
            {
                bail!("refused: {why}");
            }
            let gone = now.angle - from;
            if gone.abs() > travel {
                bail!("stopped: it was {gone:.0} degrees from where it began");
            }
            if ended.load(Ordering::Relaxed) {
                bail!("stopped");
            }
            let left = |direction: f64| travel - gone * direction - 6.0 * speed.abs() * REACTS;
            if left(*direction) < 0.0 && rests.is_none() {
                *direction = -*direction;
                way[0] = 0.0;
            }
            way = [way[0] + 6.0 * speed.abs() * (now.at - way[1]).clamp(0.0, 0.1), now.at];
            if way[0] > 4.0 * travel + 90.0 {
                bail!(
                    "stopped: it was to turn by {:.0} degrees, and did not get there: is it blocked?",
                    way[0]
                );
            }
            let room = left(*direction) / (6.0 * fastest);
            let share = if rests.is_some() { None } else { speeds.next(now.at - first, room) };
            if share.is_none() {
                let end = *rests.get_or_insert(now.at + RESTS);
                if now.at > end || now.speed.abs() < SLOW * fastest {
                    return Ok(());
                }
            }
            speed = *direction * fastest * share.unwrap_or(0.0);
            if session.now().since(sent) >= CADENCE {
                sent = session.now();
                // One that turns twice as fast as is asked for counts as one that runs away; and it turns as fast as was asked
                // for lately, though that is not told yet.
                let most = lately.iter().copied().fold(now.speed.abs(), f64::max);
                let size = speed.abs().max(CALM * most).min(fastest);
                lately.rotate_right(1);
                lately[0] = size;
                let jog = Action::Jog(motor, (10.0 * size.copysign(speed)) as i16);
                asked.push(session.client.act(jog));
            }
        }
    }
}

/// What is gathered of a motor, and the group of signals that a line carries whole.
const SIGNALS: [&str; 6] = ["drive", "target_kind", "target", "effort", "speed", "total_angle"];
const CHOSEN: usize = 0;
/// From one jog to the next: it ends 80 ms after the last.
const CADENCE: Micros = Micros::from_millis(4);
/// Share of its speed that a motor is asked for at least, and how many of the last jogs count as its speed.
const CALM: f64 = 0.65;
const LATELY: usize = 5;
/// The most jogs that wait for their answers.
const ANSWERED: usize = 50;
/// How long all jogs may be refused.
const REFUSED: Micros = Micros::from_millis(300);
/// Time without a sample after which an experiment does not begin, and after which one that runs ends.
const SILENT: Micros = Micros::from_millis(2000);
const STALE: Micros = Micros::from_millis(250);
/// Time in which it slows down at the end, s, and the share of the fastest at which it is let go.
const RESTS: f64 = 1.0;
const SLOW: f64 = 0.05;
