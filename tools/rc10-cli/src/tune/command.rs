//! `rc10 tune`: what a motor moves, by a record of it, and gains for that.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{Read, Seek, Write};
use std::path::PathBuf;
use std::sync::atomic::Ordering;

use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::Args;
use rc10_link::Action;
use rc10_motor::rc10_app::{Cascade, Gravity};
use rc10_motor::{DriveMode, TargetKind};
use rc10_time::Micros;

use super::estimate::{Estimate, Figure, Sample, Told};
use super::gains::{LEAST_PHASE, MOST_SENSITIVE, Margins, Plant, margins, tuned};
use crate::args::seconds;
use crate::files::open;
use crate::live::client::Answer;
use crate::live::plan::{FIRST, plan, watch};
use crate::live::session::{Session, stop};
use crate::live::source::SourceArgs;
use crate::live::table::{expression, float};
use crate::record::fields::Named as _;
use crate::record::file::{Item, walk};
use crate::record::replay::numbers;
use crate::record::topic;
use crate::recording::look::MotorLook;
use crate::recording::margin::LEAST;
use crate::recording::sample::is_angle;
use crate::terminal::tell;
use crate::world::robot::Robot;

/// Arguments of `rc10 tune`.
#[derive(Args, Debug)]
#[command(allow_negative_numbers = true)]
pub struct TuneArgs {
    /// The motor, such as wheel-front-left
    #[arg(value_name = "MOTOR")]
    pub motor: String,
    /// Reads a record instead, with a sample every millisecond or two: of rc10 run --record, or rc10 record --period 2
    #[arg(long, value_name = "FILE.mcap", conflicts_with_all = ["travel", "sim", "emu", "port"])]
    pub from: Option<PathBuf>,
    /// Degrees that it may turn either way from where it is
    #[arg(long, value_name = "DEG", required_unless_present = "from", value_parser = degrees)]
    pub travel: Option<f64>,
    /// The fastest that it turns, rpm [default: what the table allows]
    #[arg(long, value_name = "RPM", value_parser = rpm)]
    pub speed: Option<f64>,
    /// Seconds that it turns
    #[arg(long, value_name = "S", default_value = "30", value_parser = seconds)]
    pub seconds: Micros,
    /// Bandwidth of the speed loop, Hz [default: the fastest that keeps the margins]
    #[arg(long, value_name = "HZ", value_parser = hertz)]
    pub bandwidth: Option<f64>,
    #[command(flatten)]
    pub(crate) at: SourceArgs,
}

fn within(text: &str, [least, most]: [f64; 2], unit: &str) -> Result<f64> {
    let number = text.parse().ok().filter(|it| (least..=most).contains(it));
    number.with_context(|| format!("it is to be {least} to {most} {unit}"))
}

fn degrees(text: &str) -> Result<f64> {
    within(text, [5.0, 100_000.0], "degrees")
}

fn rpm(text: &str) -> Result<f64> {
    within(text, [0.5, 3000.0], "rpm")
}

fn hertz(text: &str) -> Result<f64> {
    within(text, [0.1, 100.0], "Hz")
}

/// Samples of a motor, from looks at it.
#[derive(Default)]
struct Gathered {
    samples: Vec<Sample>,
    asked: f64,
    /// The newest speed, rpm.
    speed: f64,
    last: Option<(f64, TargetKind)>,
}

impl Gathered {
    /// Takes the numbers of a look, by their names; what is told again or of another start is no sample.
    fn take<'n>(&mut self, at: f64, numbers: impl Iterator<Item = (&'n str, f64)>) {
        let mut look = MotorLook::NEW;
        numbers.for_each(|(name, number)| look.put_named(name, number));
        if self.last.is_some_and(|it| it.0 >= at) {
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
        self.speed = look.status.feedback.speed.get().into();
        let effort = look.effort.filter(|_| is_driven).unwrap_or(f64::NAN);
        let angle = look.status.feedback.total_angle.microdegrees() as f64 * 1e-6;
        self.samples.push(Sample { at, effort, angle, reference: self.asked });
    }
}

/// The samples of a motor in a record; and why the file ends early, if so. Fails if it is no record, or without this motor.
fn recorded(file: &mut (impl Read + Seek), label: &str) -> Result<(Vec<Sample>, Option<String>)> {
    let (name, mut columns, mut gathered) = (topic("motors", label), None, Gathered::default());
    let cut = walk(file, |item| {
        match item {
            Item::Channel(id, channel) if channel.topic == name => {
                columns = channel.columns.map(|names| (id, names));
            }
            Item::Message(id, time, bytes) => {
                if let Some((_, names)) = columns.as_ref().filter(|(own, _)| *own == id) {
                    let names = names.iter().map(String::as_str);
                    gathered.take(time as f64 * 1e-9, names.zip(numbers(bytes)?));
                }
            }
            _ => {}
        }
        Ok(())
    })?;
    ensure!(columns.is_some(), "it has no motor `{label}`");
    Ok((gathered.samples, cut))
}

/// Speeds that tell much: to and fro within a travel, and jumping all the time.
#[derive(Default)]
struct Excitation {
    travel: f64,
    fastest: f64,
    random: u64,
    direction: f64,
    level: f64,
    /// Until when it stays at this speed, and at this level, s.
    until: [f64; 2],
    speed: f64,
}

/// Way that a motor goes on until it hears that it should turn round, in seconds of its speed.
const REACTS: f64 = 0.3;

impl Excitation {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        // Knuth's generator: the same in each experiment.
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        low + (high - low) * (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The speed to ask for at a time, so many degrees from the start, rpm.
    fn next(&mut self, at: f64, gone: f64) -> f64 {
        if gone * self.direction + 6.0 * self.speed.abs() * REACTS > self.travel {
            self.direction = -self.direction;
            self.until[0] = at;
        }
        if at >= self.until[1] {
            self.level = self.between(0.45, 0.85);
            self.until[1] = at + self.between(0.3, 0.8);
        }
        if at >= self.until[0] {
            let more = if self.between(0.0, 1.0) < 0.5 { -0.15 } else { 0.15 };
            self.speed = self.direction * self.fastest * (self.level + more);
            self.until[0] = at + self.between(0.03, 0.1);
        }
        self.speed
    }
}

/// Turns a motor by jogs, which the robot allows and limits, and gathers what it tells. Fails if the robot refuses, or the
/// motor leaves its travel.
fn turned(session: &mut Session<'_>, label: &str, wish: [f64; 3]) -> Result<Vec<Sample>> {
    let [travel, fastest, seconds] = wish;
    // Where there is little room, it turns so slowly that it can turn round in time.
    let fastest = fastest.min(travel / (8.0 * REACTS));
    let ended = stop()?;
    let motor = session.client.motor(label).context("the robot has no such motor")?;
    let (topics, _) = plan(&session.client);
    let mut own: Vec<_> =
        topics.into_iter().filter(|it| it.name == topic("motors", label)).collect();
    own.iter_mut().for_each(|it| it.group = FIRST);
    watch(&mut session.client, &own, 1);
    let mut excitation =
        Excitation { travel, fastest, random: 1, direction: 1.0, ..Excitation::default() };
    let (mut gathered, mut sent, mut asked, mut start) =
        (Gathered::default(), Micros::ZERO, None, None);
    let begun = session.now();
    let outcome = loop {
        session.step()?;
        let own = own.first().map_or(&[][..], |it| &it.signals);
        for sample in session.client.take_samples() {
            let values: BTreeMap<u16, f32> = sample.values.iter().copied().collect();
            let named = own.iter().filter_map(|(index, signal)| {
                Some((signal.name.as_str(), f64::from(*values.get(index)?)))
            });
            if sample.group == FIRST {
                gathered.take(sample.at.get() as f64 * 1e-6, named);
            }
        }
        let Some(now) = gathered.samples.last() else {
            if session.now().since(begun) > SILENT {
                bail!(
                    "{}",
                    session.trouble().unwrap_or_else(|| "it tells nothing of its motor".into())
                );
            }
            continue;
        };
        let (first, from) = *start.get_or_insert((now.at, now.angle));
        if let Some(Answer::Refused(why)) = asked.and_then(|id| session.client.answer(id)) {
            break Err(anyhow!("refused: {why}"));
        }
        let gone = now.angle - from;
        if gone.abs() > travel {
            break Err(anyhow!("stopped: it was {gone:.0} degrees from where it began"));
        }
        if ended.load(Ordering::Relaxed) {
            break Err(anyhow!("stopped"));
        }
        if now.at - first > seconds {
            break Ok(());
        }
        let speed = excitation.next(now.at, gone);
        if session.now().since(sent) >= CADENCE {
            sent = session.now();
            // One that turns twice as fast as is asked for counts as one that runs away.
            let size = speed.abs().max(CALM * gathered.speed.abs()).min(fastest);
            let jog = Action::Jog(motor, (10.0 * size.copysign(speed)) as i16);
            asked = Some(session.client.act(jog));
        }
    };
    let rest = session.carry_out(Action::Jog(motor, 0));
    outcome?;
    rest?;
    Ok(gathered.samples)
}

/// From one jog to the next: it ends 80 ms after the last.
const CADENCE: Micros = Micros::from_millis(20);
/// Share of its speed that a motor is asked for at least.
const CALM: f64 = 0.65;
/// Time without a word of the motor after which there is no experiment.
const SILENT: Micros = Micros::from_millis(2000);

/// A figure with its interval, in words.
fn figure(it: Figure, unit: &str) -> String {
    let Figure { value, half } = it;
    let places = (1.0 - half.abs().max(1e-12).log10().floor()).clamp(0.0, 9.0) as usize;
    let percent = 100.0 * half / value.abs();
    let percent = if percent < 100.0 { format!("  ({percent:.1} %)") } else { String::new() };
    format!("{value:.places$} ± {half:.places$} {unit}{percent}")
}

fn told(it: Told, unit: &str) -> String {
    it.map_or_else(|why| why.to_string(), |it| figure(it, unit))
}

/// Margins of a loop in a line of a table.
fn line(name: &str, it: &Margins) -> String {
    let Margins { gain, phase, sensitivity, bandwidth } = it;
    let decibel = 20.0 * gain.log10();
    format!("  {name:<22}{decibel:>8.1} dB{phase:>8.0} deg{sensitivity:>8.2}{bandwidth:>10.1} Hz\n")
}

/// The lines of the motor's `Cascade { .. }`.
fn lines(cascade: &Cascade) -> String {
    let ff = cascade.feed_forward;
    let gravity = match ff.gravity {
        Gravity::None => "Gravity::None".into(),
        Gravity::Lift(effort) => format!("Gravity::Lift({})", float(effort)),
        Gravity::Arm { effort, level } => {
            let level = float(level.get());
            format!("Gravity::Arm {{ effort: {}, level: Degrees::new({level}) }}", float(effort))
        }
    };
    let [friction, per_rpm, per_rpm_s] = [ff.friction, ff.per_rpm, ff.per_rpm_s].map(float);
    format!(
        "speed: {},\nangle: {},\nfeed_forward: FeedForward {{ friction: {friction}, per_rpm: {per_rpm}, \
         per_rpm_s: {per_rpm_s}, gravity: {gravity} }},\n",
        expression(&cascade.speed),
        expression(&cascade.angle)
    )
}

/// Three digits: the intervals tell no more.
fn rounded(value: f32) -> f32 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Turns a motor, or reads a record of it; estimates what it moves, and prints gains for that. Fails without such a motor or
/// record, or if nothing can be told.
pub fn tune(args: &TuneArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let motors = robot.description().motors.clone();
    let at = robot.description().motor_called(&args.motor)?;
    let (label, jog) = (motors[at].label, motors[at].jog);
    let Some(loops) = robot.loops().get(at).copied().flatten() else {
        bail!("{label}: its loops run in the device, with gains of its own");
    };
    let (samples, named) = if let Some(file) = &args.from {
        let named = file.display().to_string();
        let (samples, cut) = recorded(&mut open(file)?, label).with_context(|| named.clone())?;
        if let Some(why) = cut {
            tell(format_args!("{named}: cut off: {why}"));
        }
        (samples, named)
    } else {
        let most = jog.with_context(|| {
            format!(
                "{label}: the robot's table does not allow to turn it; with_jog does, in its entry"
            )
        })?;
        let fastest = args.speed.unwrap_or(most);
        ensure!(fastest <= most, "{label}: its with_jog allows {most} rpm");
        let connection = args.at.open_disarmed(robot)?;
        let mut session = Session::meet(connection)?;
        let travel = args.travel.context("--travel is missing")?;
        let wish = [travel, fastest, args.seconds.get() as f64 * 1e-6];
        let samples = turned(&mut session, label, wish).with_context(|| label.to_owned())?;
        (samples, session.name().to_owned())
    };
    let estimate = Estimate::of(&samples).map_err(|why| anyhow!("{label}: {why}"))?;
    let unit = match loops.effort {
        TargetKind::Current => "A",
        TargetKind::Torque => "N m",
        _ => "share",
    };
    let Estimate { seconds, speeds: [slowest, fastest], left, .. } = estimate;
    let mut text = format!(
        "{label}, from {named}: {seconds:.1} s of use, at {slowest:.0} to {fastest:.0} rpm; 95 % intervals\n"
    );
    let mut row = |name: &str, value: &str| writeln!(text, "  {name:<16}{value}");
    row("inertia", &told(estimate.inertia, &format!("{unit}/(rpm/s)")))?;
    row("dry friction", &told(estimate.friction, unit))?;
    row("viscous", &told(estimate.viscous, &format!("{unit}/rpm")))?;
    match estimate.arm {
        Some([effort, level]) => {
            let text = format!("{}, level at {}", figure(effort, unit), figure(level, "deg"));
            row("weight of an arm", &text)?;
        }
        None => row("weight", &told(estimate.weight, unit))?,
    }
    let millis = |it: Figure| Figure { value: 1e3 * it.value, half: 1e3 * it.half };
    row("delay", &told(estimate.delay.map(millis), "ms"))?;
    match estimate.play {
        Some(play) => row("play", &format!("at least {}", figure(play, "deg")))?,
        None => row("play", "cannot be told from this: no sign of it")?,
    }
    row("left over", &format!("{left:.2e} {unit}, root mean square"))?;
    write!(out, "{text}")?;
    let mut new = match tuned(&loops.cascade, &estimate, args.bandwidth) {
        Ok(new) => new,
        Err(why) => {
            writeln!(out, "\nNo gains: they need inertia and delay. {why}")?;
            return Ok(());
        }
    };
    let ff = &mut new.feed_forward;
    for it in [
        &mut new.speed.kp,
        &mut new.speed.ki,
        &mut new.angle.kp,
        &mut ff.friction,
        &mut ff.per_rpm,
        &mut ff.per_rpm_s,
    ] {
        *it = rounded(*it);
    }
    match &mut ff.gravity {
        Gravity::Lift(effort) | Gravity::Arm { effort, .. } => *effort = rounded(*effort),
        Gravity::None => {}
    }
    let plants = Plant::all(&estimate).unwrap_or_default();
    writeln!(
        out,
        "\nThe worst margins within these intervals; kept are {:.0} dB, {LEAST_PHASE} deg, a sensitivity below {MOST_SENSITIVE}",
        20.0 * LEAST.log10()
    )?;
    writeln!(out, "  {:<22}{:>11}{:>12}{:>8}{:>13}", "loop", "gain", "phase", "Ms", "bandwidth")?;
    for (name, cascade) in [("now", &loops.cascade), ("tuned", &new)] {
        let [speed, angle] = margins(&plants, cascade);
        write!(out, "{}", line(&format!("speed, {name}"), &speed))?;
        write!(out, "{}", line(&format!("angle, {name}"), &angle))?;
    }
    writeln!(out, "\nFor the table, in the motor's Cascade {{ .. }}:\n{}", lines(&new))?;
    Ok(())
}
