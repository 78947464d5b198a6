//! `rc10 tune`: what a motor moves, by a record of it, and gains for that.

use std::fmt::Write as _;
use std::io::{Read, Seek, Write};
use std::path::PathBuf;

use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::Args;
use rc10_link::Action;
use rc10_motor::TargetKind;
use rc10_motor::rc10_app::{Cascade, Gravity};
use rc10_time::Micros;

use super::estimate::{Estimate, Figure, Sample, Told, Unknown};
use super::experiment::{Gathered, Jumps, Turned, Waves};
use super::gains::{LEAST_PHASE, MOST_SENSITIVE, Margins, Plant, margins, tuned};
use super::page::{Tuning, page_of};
use super::response::{Point, margins_measured, response};
use crate::args::seconds;
use crate::files::{PAGES, make_folder, open, page_name, write_file};
use crate::lang::Language;
use crate::live::session::Session;
use crate::live::source::SourceArgs;
use crate::live::table::{expression, float};
use crate::record::file::{Item, walk};
use crate::record::replay::numbers;
use crate::record::topic;
use crate::recording::margin::LEAST;
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
    /// Sets the new gains, measures with them, and puts the old ones back if they do not keep their margins
    #[arg(long, conflicts_with = "from")]
    pub apply: bool,
    /// The same, and keeps them over a power-off
    #[arg(long, conflicts_with = "from")]
    pub keep: bool,
    /// Folder for the page with Bode plot and steps
    #[arg(long, value_name = "DIR", default_value = PAGES)]
    pub out: PathBuf,
    #[command(flatten)]
    pub(crate) at: SourceArgs,
}

impl TuneArgs {
    const fn wants_to_apply(&self) -> bool {
        self.apply || self.keep
    }
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

/// Margins of both loops in lines of a table.
fn table(name: &str, loops: &[Margins; 2]) -> String {
    let line = |which: &str, it: &Margins| {
        let Margins { gain, phase, sensitivity, bandwidth } = it;
        let told = |is: bool, text: String| if is { text } else { "-".into() };
        let gain = told(gain.is_finite(), format!("{:.1} dB", 20.0 * gain.log10()));
        let phase = told(*bandwidth > 0.0, format!("{phase:.0} deg"));
        let bandwidth = told(*bandwidth > 0.0, format!("{bandwidth:.1} Hz"));
        let name = format!("{which}, {name}");
        format!("  {name:<22}{gain:>11}{phase:>12}{sensitivity:>8.2}{bandwidth:>13}\n")
    };
    line("speed", &loops[0]) + &line("angle", &loops[1])
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

/// The estimate in a table.
fn estimates(estimate: &Estimate, unit: &str) -> Result<String> {
    let mut text = String::new();
    let mut row = |name: &str, value: &str| writeln!(text, "  {name:<18}{value}");
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
    row("left over", &format!("{:.2e} {unit}, root mean square", estimate.left))?;
    Ok(text)
}

/// Gains for an estimate, to three digits.
fn gains(loops: &Cascade, estimate: &Estimate, bandwidth: Option<f64>) -> Result<Cascade, Unknown> {
    let mut new = tuned(loops, estimate, bandwidth)?;
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
    Ok(new)
}

/// The gains of a motor's loops, under the full names of its parameters.
fn parameters<'c>(label: &str, it: &'c mut Cascade) -> [(String, &'c mut f32); 6] {
    let gains = [
        ("speed_kp", &mut it.speed.kp),
        ("speed_ki", &mut it.speed.ki),
        ("speed_kd", &mut it.speed.kd),
        ("angle_kp", &mut it.angle.kp),
        ("angle_ki", &mut it.angle.ki),
        ("angle_kd", &mut it.angle.kd),
    ];
    gains.map(|(name, gain)| (format!("{}.{name}", label.replace(' ', "_")), gain))
}

/// Sets a motor's gains in the robot.
fn set(session: &mut Session<'_>, label: &str, mut to: Cascade) -> Result<()> {
    session.set(&parameters(label, &mut to).map(|(name, gain)| (name, *gain)))
}

/// The cascade with the gains that the robot has now.
fn present(session: &Session<'_>, label: &str, mut table: Cascade) -> Result<Cascade> {
    for (name, gain) in parameters(label, &mut table) {
        *gain = session.parameter(&name)?.value;
    }
    Ok(table)
}

/// How often a robot that is busy is asked.
const TRIES: usize = 5;

/// Whether a sweep tells of the gains that it was made with that they are as good as promised, but for what a measurement is
/// wrong by.
fn is_good(points: &[Point], cascade: &Cascade) -> Result<()> {
    let whole = margins_measured(points, cascade);
    // Where a loop oscillates, no sine of that frequency is seen.
    let has_gap = points.windows(2).any(|pair| pair[1].hz > 2.0 * pair[0].hz);
    let reaches = |it: &Margins| {
        it.bandwidth > 0.0 && points.last().is_some_and(|last| last.hz > 1.5 * it.bandwidth)
    };
    let Some([speed, angle]) = whole.filter(|it| reaches(&it[0]) && !has_gap) else {
        bail!("the sweep tells too little: allow more travel");
    };
    for it in [speed, angle] {
        let is_kept = it.gain > 0.8 * LEAST && it.phase > LEAST_PHASE - 5.0;
        ensure!(
            is_kept && it.sensitivity < 1.1 * MOST_SENSITIVE,
            "a sweep measures too little margin:\n{}",
            table("tuned", &[speed, angle])
        );
    }
    Ok(())
}

/// Turns a motor with its new gains: a swept sine, and steps. Puts the old ones back if that fails, or the margins that it
/// measures are below what is promised.
fn tried(
    turned: &mut Turned<'_, '_>,
    label: &str,
    [now, new]: [&Cascade; 2],
) -> Result<[Vec<Sample>; 2]> {
    let whole = turned.whole();
    let outcome = (|| {
        set(turned.session, label, *new)?;
        let steps = turned.turn(&mut Waves::steps(whole))?;
        let sweep = turned.turn(&mut Waves::sweep(whole))?;
        is_good(&response(&sweep), new)?;
        Ok([steps, sweep])
    })();
    outcome.or_else(|why: anyhow::Error| {
        let mut tries = (0..TRIES).map(|_| set(turned.session, label, *now));
        ensure!(tries.any(|it| it.is_ok()), "THE NEW GAINS ARE STILL SET: {why:#}");
        Err(why.context("the gains before are set again"))
    })
}

/// Keeps what is set, as soon as the motor rests.
fn kept(session: &mut Session<'_>) -> Result<()> {
    let begun = session.now();
    loop {
        match session.carry_out(Action::Save) {
            Err(_) if session.now().since(begun) < COASTS => {
                for _ in 0..TRIES {
                    session.step()?;
                }
            }
            outcome => return outcome.map(drop).context("the new gains are set, but not kept"),
        }
    }
}

/// How long a motor may coast before it rests.
const COASTS: Micros = Micros::from_millis(5000);

/// Turns a motor, or reads a record of it; estimates what it moves, and prints gains for that. Fails without such a motor or
/// record, or if nothing can be told.
pub fn tune(args: &TuneArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let motors = robot.description().motors.clone();
    let at = robot.description().motor_called(&args.motor)?;
    let (label, jog) = (motors[at].label, motors[at].jog);
    let Some(loops) = robot.loops().get(at).copied().flatten() else {
        bail!("{label}: its loops run in the device, with gains of its own");
    };
    let unit = match loops.effort {
        TargetKind::Current => "A",
        TargetKind::Torque => "N m",
        _ => "share",
    };
    let mut session = None;
    if args.from.is_none() {
        let most = jog.with_context(|| {
            format!(
                "{label}: the robot's table does not allow to turn it; with_jog does, in its entry"
            )
        })?;
        let fastest = args.speed.unwrap_or(most);
        ensure!(fastest <= most, "{label}: its with_jog allows {most} rpm");
        let travel = args.travel.context("--travel is missing")?;
        session = Some((Session::meet(args.at.open_disarmed(robot)?)?, [travel, fastest]));
    }
    let turned = session.as_mut().map(|(session, wish)| Turned::new(session, label, *wish));
    let mut turned = turned.transpose()?;
    let mut found = Tuning {
        text: String::new(),
        code: String::new(),
        now: loops.cascade,
        new: None,
        plant: None,
        points: Vec::new(),
        steps: Default::default(),
    };
    let (samples, named) = match (&mut turned, &args.from) {
        (Some(turned), _) => {
            let named = || label.to_owned();
            found.now = present(turned.session, label, loops.cascade)?;
            let whole = turned.whole();
            found.steps[0] = turned.turn(&mut Waves::steps(whole)).with_context(named)?;
            let seconds = args.seconds.get() as f64 * 1e-6;
            let samples = turned.turn(&mut Jumps::new(seconds)).with_context(named)?;
            (samples, turned.session.name().to_owned())
        }
        (None, file) => {
            let file = file.as_ref().context("--from is missing")?;
            let named = file.display().to_string();
            let (samples, cut) =
                recorded(&mut open(file)?, label).with_context(|| named.clone())?;
            if let Some(why) = cut {
                tell(format_args!("{named}: cut off: {why}"));
            }
            (samples, named)
        }
    };
    let estimate = Estimate::of(&samples)
        .map_err(|why| anyhow!("{label}: {}", Language::spoken().say(&why.to_string())))?;
    let Estimate { seconds, speeds: [slowest, fastest], .. } = estimate;
    let heading = format!(
        "{label}, from {named}: {seconds:.1} s of use, at {slowest:.0} to {fastest:.0} rpm; 95 % intervals\n"
    );
    found.text = heading + &estimates(&estimate, unit)?;
    found.plant = Plant::of(&estimate).ok();
    let now = found.now;
    match gains(&now, &estimate, args.bandwidth) {
        Err(why) => {
            if args.wants_to_apply() {
                let text = format!("{}\nNo gains are set. {why}", found.text);
                bail!("{}", Language::spoken().say(&text));
            }
            write!(found.text, "\nNo gains: they need inertia and delay. {why}\n")?;
        }
        Ok(new) => {
            found.new = Some(new);
            let plants = Plant::all(&estimate).unwrap_or_default();
            write!(
                found.text,
                "\nThe worst margins within these intervals; kept are {:.0} dB, {LEAST_PHASE} deg, a sensitivity below {MOST_SENSITIVE}\n",
                20.0 * LEAST.log10()
            )?;
            found.text += &format!(
                "  {:<22}{:>11}{:>12}{:>8}{:>13}\n",
                "loop", "gain", "phase", "Ms", "bandwidth"
            );
            found.text +=
                &(table("now", &margins(&plants, &now)) + &table("tuned", &margins(&plants, &new)));
        }
    }
    // A record has a sweep, too, if one was made while it was written.
    let sweep = match (&mut turned, found.new.filter(|_| args.wants_to_apply())) {
        (Some(turned), Some(new)) => tried(turned, label, [&now, &new]).map(|[steps, sweep]| {
            found.steps[1] = steps;
            sweep
        }),
        (Some(turned), None) => {
            let whole = turned.whole();
            turned.turn(&mut Waves::sweep(whole))
        }
        (None, _) => Ok(samples),
    };
    // What was found is told all the same.
    let mut failed = None;
    let sweep = sweep.unwrap_or_else(|why| {
        failed = Some(why.context(label.to_owned()));
        Vec::new()
    });
    found.points = response(&sweep);
    if let (Some(it), [first, .., last]) =
        (margins_measured(&found.points, &now), found.points.as_slice())
    {
        write!(found.text, "\nMeasured at {:.1} to {:.0} Hz; - lies beyond\n", first.hz, last.hz)?;
        found.text += &table("now", &it);
        if let Some(it) = found.new.and_then(|new| margins_measured(&found.points, &new)) {
            found.text += &table("tuned", &it);
        }
    }
    if let Some(turned) = turned.filter(|_| args.wants_to_apply() && failed.is_none()) {
        failed = if args.keep { kept(turned.session).err() } else { None };
        found.text += match args.keep && failed.is_none() {
            true => "\nThe new gains are set, kept over a power-off.\n",
            false => "\nThe new gains are set, until power-off; rc10 save keeps them.\n",
        };
    }
    if let Some(new) = &found.new {
        found.text += "\nFor the table, in the motor's cascade:\n";
        found.code = lines(new);
    }
    let say = |text: &str| Language::spoken().say(text);
    writeln!(out, "{}{}", say(&found.text), found.code)?;
    let page = page_name(label);
    make_folder(&args.out)?;
    // The page has a table of languages, too.
    write_file(&args.out, &page, page_of(label, &found).as_bytes())?;
    let place = args.out.join(page);
    writeln!(out, "{}", say(&format!("Bode plot and steps: {}", place.display())))?;
    failed.map_or(Ok(()), Err)
}
