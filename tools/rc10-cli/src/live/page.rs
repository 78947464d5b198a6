//! `rc10 live`: a page in the browser that shows a robot while it runs.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::hash::{BuildHasher as _, RandomState};
use std::io::{self, Write};
use std::net::{IpAddr, UdpSocket};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;
use rc10_emu::LogLine;
use rc10_link::{Action, Urgent};
use rc10_time::Micros;
use serde_json::{Value, json};

use super::broken::Broken;
use super::client::{Answer, Client, KeptValue, Losses, Urgency};
use super::connection::look;
use super::field::Field;
use super::judge::Judge;
use super::line::RobotConnection;
use super::plan::{Line, SLOW, Topic, plan, watch_at};
use super::record::{LiveRecord, RESTART, named, room, tell_leftovers};
use super::server::{PageRequest, Pages, PendingRequest};
use super::session::{Session, full_name};
use super::source::PlaceArgs;
use super::table::table_lines;
use super::viewers::{ViewerArgs, Viewers};
use crate::args::{pace, seconds};
use crate::live::session::stop;
use crate::record::replay::Kit;
use crate::recording::problem::Problem;
use crate::run::running::Running;
use crate::world::robot::Robot;

/// Arguments of `rc10 live`.
#[derive(Args, Debug)]
pub struct LiveArgs {
    #[command(flatten)]
    pub(crate) at: PlaceArgs,
    /// The page's port on this PC; 0 is any that is free
    #[arg(long, value_name = "N", default_value_t = 8010)]
    pub page: u16,
    /// Lets a phone in the same network watch and stop, by a QR code; at this address of this PC
    /// [default: the one of its network]
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = "0.0.0.0")]
    pub lan: Option<IpAddr>,
    /// Open the page in the browser
    #[arg(long)]
    pub open: bool,
    /// The script drives the robot of --sim or --emu from its begin, until a page takes its remote
    #[arg(long)]
    pub script: bool,
    /// How fast the time of --sim or --emu passes: 1 is as the clock, 0.2 a fifth of it
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = pace)]
    pub pace: f64,
    /// Folder for records
    #[arg(long, value_name = "DIR", default_value = "target/rc10-live")]
    pub out: PathBuf,
    #[command(flatten)]
    pub(crate) viewers: ViewerArgs,
    /// File in which the simulated robot keeps its saved parameters; without it they are kept for this run
    #[arg(long, value_name = "FILE", requires = "sim")]
    pub kept: Option<PathBuf>,
    /// Ends after this many seconds of the robot's time [default: runs until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<Micros>,
}

/// Period of samples of the motors, ms, unless a page asks for a shorter one.
const OFTEN: u16 = 10;
/// Shorter periods that a page offers, ms.
const FAST: [u16; 3] = [1, 2, 5];
/// Period of the state for the pages.
const TELL: Micros = Micros::from_millis(50);
/// Silence after which a page has gone: a browser lets a hidden one speak once a minute.
const GONE: Micros = Micros::from_millis(150_000);
/// Limit of marks.
const MARKS: usize = 1000;
/// Limit of lines of the chip's log.
const LINES: usize = 40;
/// Limit of pages.
const PAGES: usize = 32;
/// The signals that a page shows, their period, and when it said so last.
struct Choice {
    period: u16,
    signals: Vec<u16>,
    seen: Micros,
}
/// Time for which an event is shown.
const LATELY: Micros = Micros::from_millis(60_000);
/// Period of what moves.
const MOVING: Micros = Micros::from_millis(20);
/// A request that waits for the robot's answer: its number, its time, and the way back.
type Waiting = (u16, Micros, Sender<Result<Value, String>>);
/// The way to the report of a record: it may come later.
type Reporter<'r> = Box<dyn Fn(PathBuf) -> Receiver<Result<Vec<u8>>> + 'r>;
/// Time in which the answer to a page has left before the robot begins anew.
const ANSWERED: Micros = Micros::from_millis(400);
/// Limit of waiting requests, of all pages together: a browser has six connections, and STOP needs one.
const MOST_WAITING: usize = 3;
const PATIENCE: Micros = Micros::from_millis(5000);

/// Serves the page until Ctrl-C; fails without a line to the robot, or if the port is taken.
pub fn live(args: &LiveArgs, mut robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    if let Some(file) = &args.kept {
        robot.keep_in(file)?;
    }
    let kit = Kit::of(&robot);
    let stop = stop()?;
    let pages = Pages::serve(args.page)?;
    let connection = args.at.source().open_for_shells(robot, pages.port, args.pace)?;
    let mut live = LivePage::new(args, connection, &kit, pages, Box::new(report_by_program))?;
    if let Some(address) = live.viewers.address() {
        writeln!(out, "foxglove  {address}")?;
    }
    writeln!(out, "live  {}\n{}; Ctrl-C ends it", live.pages.address, live.session.name())?;
    if let Some(address) = args.lan {
        tell_guests(&live.pages, address, out)?;
    }
    out.flush()?;
    if args.open {
        open_browser(&live.pages.address);
    }
    tell_leftovers(&args.out);
    let mut outcome = Ok(());
    let is_over = |live: &LivePage<'_, '_>| {
        live.is_anew() || args.seconds.is_some_and(|end| live.now() >= end)
    };
    while outcome.is_ok() && !stop.load(Ordering::Relaxed) && !is_over(&live) {
        outcome = live.step();
    }
    match live.record.take() {
        Some((record, path)) => {
            record.finish(outcome)?;
            writeln!(out, "record  {}", path.display())?;
        }
        None => outcome?,
    }
    let (anew, port) = (live.anew.take(), live.pages.port);
    drop(live);
    match anew {
        Some((_, mistakes)) => begin_anew(port, &mistakes, out),
        None => Ok(()),
    }
}

/// Becomes this command anew, with other mistakes, at the same port.
#[cfg(unix)]
fn begin_anew(port: u16, mistakes: &[String], out: &mut dyn Write) -> Result<()> {
    use std::os::unix::process::CommandExt as _;

    let with = if mistakes.is_empty() { "no mistake" } else { &mistakes.join(" ") };
    writeln!(out, "the robot begins anew, with {with}")?;
    out.flush()?;
    let mut command = Command::new(std::env::current_exe()?);
    let mut all = std::env::args_os().skip(1);
    while let Some(argument) = all.next() {
        let text = argument.to_string_lossy();
        match text.split_once('=').map_or(&*text, |it| it.0) {
            "--open" => {}
            "--page" | "--mistake" if text.contains('=') => {}
            "--page" | "--mistake" => drop(all.next()),
            _ => drop(command.arg(argument)),
        }
    }
    command.arg(format!("--page={port}"));
    command.args(mistakes.iter().map(|it| format!("--mistake={it}")));
    Err::<(), _>(command.exec()).context("the robot does not begin anew")
}

/// A program cannot become another here.
#[cfg(not(unix))]
fn begin_anew(_: u16, _: &[String], _: &mut dyn Write) -> Result<()> {
    Ok(())
}

/// Opens the page for other devices, and prints its address, also as a QR code.
fn tell_guests(pages: &Pages, address: IpAddr, out: &mut dyn Write) -> Result<()> {
    let address = if address.is_unspecified() {
        // Nothing is sent: it only finds the way out of this PC.
        let way = UdpSocket::bind((address, 0)).and_then(|it| {
            it.connect("192.0.2.1:9")?;
            it.local_addr()
        });
        way.context("this PC is in no network; or name its address: --lan=ADDRESS")?.ip()
    } else {
        address
    };
    let url = pages.serve_guests(address)?;
    let code = QrCode::new(&url)?.render::<Dense1x2>().build();
    writeln!(
        out,
        "phone  {url}\nwatches, and STOP; for who has this address, in this network\n{code}"
    )?;
    Ok(())
}

/// Makes the report of a record, by a program of its own: the robot is not held up.
fn report_by_program(path: PathBuf) -> Receiver<Result<Vec<u8>>> {
    let (made, making) = channel();
    let make = move || {
        let out = path.with_extension("report");
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["report", "--out"]).arg(&out).arg("--").arg(&path).stdin(Stdio::null());
        let output = command.output()?;
        ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr).trim());
        Ok(std::fs::read(out.join("report.html"))?)
    };
    std::thread::spawn(move || made.send(make()));
    making
}

/// Opens an address in the browser. One that does not open is no error: the address is said.
fn open_browser(address: &str) {
    let mut command = Command::new(match () {
        () if cfg!(windows) => "explorer",
        () if cfg!(target_os = "macos") => "open",
        () => "xdg-open",
    });
    let quiet = command.arg(address).stdin(Stdio::null()).stdout(Stdio::null());
    let _ = quiet.stderr(Stdio::null()).spawn();
}

fn is_there(error: &anyhow::Error) -> bool {
    let error = error.downcast_ref::<io::Error>();
    error.is_some_and(|error| error.kind() == io::ErrorKind::AlreadyExists)
}

/// The world of a robot that is simulated here with its motors.
fn simulated<'a>(session: &'a mut Session<'_>) -> Option<&'a mut dyn Running> {
    session.world().filter(|world| !world.is_real())
}

/// Time by which a robot's clock may differ from that on the line: samples come late.
const LATE: Micros = Micros::from_millis(2000);

/// Whether the robot was restarted, or is another one: its clock has not gone on with that on the line.
fn is_another(before: (Micros, Micros), now: (Micros, Micros)) -> bool {
    let (robot, line) = (now.0.since(before.0), now.1.since(before.1));
    now.0 + RESTART < before.0 || robot > line + LATE || line > robot + LATE
}

/// The session with the robot, and the pages that show it.
pub(super) struct LivePage<'r, 'k> {
    session: Session<'r>,
    pub(super) pages: Pages,
    report_of: Reporter<'r>,
    folder: PathBuf,
    judge: Judge<'k>,
    /// Why the robot is not judged.
    stranger: Option<String>,
    topics: Vec<Topic>,
    /// Number of signals without room.
    left: usize,
    record: Option<(LiveRecord, PathBuf)>,
    records: u32,
    /// A message that the page shows, and whether it stays.
    note: Option<(String, bool)>,
    /// Moments that were marked.
    marks: Vec<(Micros, String)>,
    /// The report of the last record, while it is made.
    making: Option<Receiver<Result<Vec<u8>>>>,
    waiting: Vec<Waiting>,
    line: Line,
    /// The choice of each page, by its number.
    chosen: BTreeMap<u32, Choice>,
    /// What is watched for all pages: the shortest period, and the signals.
    watched: (u16, BTreeSet<u16>),
    /// Periods of the topics, ms: of the frequent ones, and of the others.
    paces: [u16; 2],
    /// Losses before that.
    before: Losses,
    /// Whether the robot has described itself and is watched.
    met: bool,
    viewers: Viewers,
    state_at: Option<Micros>,
    /// By chance, and another number after each restart of the robot, or with another robot: so that a page does not
    /// undo what it did to one before.
    boot: u32,
    /// The robot's time, and that on the line, of the newest sample.
    clocks: Option<(Micros, Micros)>,
    moving_at: Option<Micros>,
    field: Option<Field<'k>>,
    is_simulated: bool,
    broken: Broken,
    /// When the robot is to begin anew, and with what mistakes.
    pub(super) anew: Option<(Micros, Vec<String>)>,
    /// What was let go wrong and taken back, as events.
    told: Vec<(Micros, String)>,
    /// The newest lines of the chip's log.
    log: VecDeque<String>,
    /// The begin of a second by this PC's clock, the robot's time at it, and how far that came in the second before.
    pace: (Instant, Micros, Option<f64>),
}

impl<'r, 'k> LivePage<'r, 'k> {
    /// The pages of a robot before its first step. Fails if a viewer cannot be fed, or for a script without a remote.
    pub(super) fn new(
        args: &LiveArgs,
        connection: RobotConnection<'r>,
        kit: &'k Kit<'k>,
        pages: Pages,
        report_of: Reporter<'r>,
    ) -> Result<Self> {
        let mut session = Session::new(connection);
        let is_simulated = simulated(&mut session).is_some();
        let mut broken = Broken::default();
        match session.world() {
            Some(world) => {
                look(&pages.hands).begin(world, args.script);
                broken = Broken::of(world.description());
            }
            None => ensure!(!args.script, "--script is for --sim and --emu that are begun here"),
        }
        Ok(Self {
            session,
            pages,
            report_of,
            folder: args.out.clone(),
            judge: Judge::new(kit),
            stranger: None,
            topics: Vec::new(),
            left: 0,
            record: None,
            records: 0,
            note: None,
            marks: Vec::new(),
            making: None,
            waiting: Vec::new(),
            line: Line::new(0, &[]),
            chosen: BTreeMap::new(),
            watched: (OFTEN, BTreeSet::new()),
            paces: [OFTEN, SLOW],
            before: Losses::default(),
            met: false,
            viewers: Viewers::new(&args.viewers)?,
            state_at: None,
            boot: RandomState::new().hash_one(0) as u32,
            clocks: None,
            moving_at: None,
            field: None,
            is_simulated,
            broken,
            anew: None,
            told: Vec::new(),
            log: VecDeque::new(),
            pace: (Instant::now(), Micros::ZERO, None),
        })
    }

    /// Time on the line.
    pub(super) fn now(&self) -> Micros {
        self.session.now()
    }

    /// Whether the robot is to begin anew now, with the mistakes of `anew`.
    pub(super) fn is_anew(&self) -> bool {
        self.anew.as_ref().is_some_and(|(due, _)| self.now() >= *due)
    }

    /// Answers the pages, and lets the robot go on for some milliseconds; fails if the line has ended.
    pub(super) fn step(&mut self) -> Result<()> {
        // First, so that a stop goes out with these bytes.
        while let Ok(request) = self.pages.requests.try_recv() {
            self.handle(request);
        }
        let now = self.session.now();
        if let Some(operator) = self.session.world().and_then(Running::operator) {
            look(&self.pages.hands).act(operator, now);
        }
        self.session.step()?;
        let lines = self.session.world().map(Running::log).unwrap_or_default();
        for LogLine { at, text } in lines {
            // Ten a second: the newest is enough.
            let is_status = |it: &String| it.contains(" motors online");
            if is_status(&text) && self.log.back().is_some_and(is_status) {
                self.log.pop_back();
            }
            self.log.push_back(format!("{:.3} {text}", at.get() as f64 * 1e-9));
        }
        self.log.drain(..self.log.len().saturating_sub(LINES));
        self.answer();
        let is_described = self.session.client.is_described();
        if is_described && !self.met {
            let (topics, left) = plan(&self.session.client);
            if topics != self.topics {
                (self.topics, self.left) = (topics, left.len());
                self.judge = Judge::new(self.judge.kit);
                self.stranger = self.judge.stranger(&self.topics);
                self.chosen.clear();
            }
            self.viewers.meet(&self.session.client, &self.topics)?;
            let mut field = Field::new(self.judge.kit.description(), &self.session.client);
            simulated(&mut self.session).into_iter().for_each(|world| field.build(world));
            self.field = Some(field).filter(|_| self.stranger.is_none());
            self.line = Line::new(self.session.baud(), &self.topics);
            self.session.client.set_line(self.line.bytes);
            self.watch();
        }
        let now = self.session.now();
        let pages = self.chosen.len();
        self.chosen.retain(|_, it| now.since(it.seen) < GONE);
        if self.chosen.len() < pages {
            self.watch();
        }
        self.met = is_described;
        if let Some(made) = self.making.as_ref().and_then(|it| it.try_recv().ok()) {
            self.making = None;
            match made {
                Ok(report) => look(&self.pages.shown).report = Some(report),
                Err(why) => self.note = Some((format!("no report: {why:#}"), true)),
            }
        }
        let samples = self.session.client.take_samples();
        samples.iter().for_each(|sample| self.viewers.take(sample, &self.session.client));
        if let Some((record, _)) = &mut self.record
            && let error @ Err(_) = samples.iter().try_for_each(|sample| record.take(sample))
            && let Some((record, _)) = self.record.take()
            && let Err(error) = record.finish(error)
        {
            self.note = Some((format!("the record has ended: {error:#}"), true));
        }
        if self.stranger.is_none() {
            samples.iter().try_for_each(|sample| self.judge.take(&self.topics, sample))?;
        }
        if let Some(sample) = samples.last() {
            let now = (sample.at, self.session.now());
            let before = self.clocks.replace(now);
            self.boot = self.boot.wrapping_add(before.is_some_and(|it| is_another(it, now)).into());
        }
        // Pages ask five times a second: every step would be too often.
        let is_due = self.state_at.is_none_or(|at| now.since(at) >= TELL);
        let state = is_due.then(|| self.state().to_string().into());
        let is_due = self.moving_at.is_none_or(|at| now.since(at) >= MOVING);
        let moving = is_due.then(|| self.moving().to_string().into());
        let mut shown = look(&self.pages.shown);
        if let Some(moving) = moving {
            (shown.moving, self.moving_at) = (moving, Some(now));
        }
        for sample in &samples {
            if sample.at + RESTART < shown.now {
                shown.history.clear();
                self.marks.clear();
                shown.now = Micros::ZERO;
            }
            shown.now = shown.now.max(sample.at);
            for (signal, value) in &sample.values {
                shown.history.push(*signal, sample.at, *value);
            }
        }
        if let Some(state) = state {
            (shown.state, self.state_at) = (state, Some(now));
        }
        Ok(())
    }

    /// What moves: the remote, and how fast time runs.
    fn moving(&mut self) -> Value {
        let now = self.session.now();
        let wall = self.pace.0.elapsed().as_secs_f64();
        if wall >= 1.0 {
            let passed = now.since(self.pace.1).get() as f64 * 1e-6;
            self.pace = (Instant::now(), now, Some(passed / wall));
        }
        let pace = self.pace.2;
        let mut world = self.session.world();
        let hands = look(&self.pages.hands);
        let remote = world.as_mut().and_then(|it| Some(hands.state(it.operator()?)));
        let shown = look(&self.pages.shown);
        let world = world.filter(|world| !world.is_real());
        let field = self.field.as_mut().map(|it| it.look(&shown.history, world.as_deref()));
        let pace = pace.filter(|_| world.is_some());
        json!({ "now": now.get() as f64 * 1e-6, "remote": remote, "pace": pace, "field": field })
    }

    /// Passes the robot's answers on to the pages.
    fn answer(&mut self) {
        let now = self.session.now();
        let client = &mut self.session.client;
        self.waiting.retain(|(id, since, tell)| match client.answer(*id) {
            None => now.since(*since) < PATIENCE,
            Some(answer) => {
                // The page may have gone.
                let _ = tell.send(match answer {
                    Answer::Done => Ok(Value::Null),
                    Answer::Register(value) => Ok(value.into()),
                    Answer::Refused(why) => Err(why),
                });
                false
            }
        });
    }

    fn handle(&mut self, (request, tell): PendingRequest) {
        let now = self.session.now();
        // The number of the robot's answer, or one at once.
        let outcome = match request {
            PageRequest::Watch(page, period, signals) => {
                self.choose(page, Choice { period, signals, seen: now }).map(Err)
            }
            PageRequest::Record(on, words) => self.switch_record(on, words).map(Err),
            PageRequest::Mark(words) => self.mark(words).map(Err),
            PageRequest::Break(words, begins) => self.let_break(&words, begins).map(Err),
            PageRequest::Advise(name, value) => self.advise(&name, value).map(Err),
            PageRequest::Table => {
                let lines = table_lines(self.session.client.parameters(), self.judge.kit);
                Ok(Err(lines.into()))
            }
            PageRequest::Urge(what) => Ok(Ok(self.session.client.urge(what, now))),
            PageRequest::Set(wanted) => {
                self.may_ask().and_then(|()| self.session.ask(&wanted)).map(Ok)
            }
            PageRequest::Do(action, label, speed) => {
                self.may_ask().and_then(|()| self.act(&action, &label, speed)).map(Ok)
            }
        };
        // The page may have gone.
        let _ = match outcome {
            Ok(Ok(id)) => return self.waiting.push((id, now, tell)),
            Ok(Err(value)) => tell.send(Ok(value)),
            Err(why) => tell.send(Err(format!("{why:#}"))),
        };
    }

    /// Lets something go wrong with a simulated robot, or takes it back.
    fn let_break(&mut self, words: &str, begins: bool) -> Result<Value> {
        let now = self.session.now();
        let world = simulated(&mut self.session)
            .context("a real robot is broken by hand, not from here")?;
        ensure!(self.anew.is_none(), "the robot is just beginning anew");
        if let Some(mistakes) = self.broken.change(world, words, begins)? {
            ensure!(
                cfg!(any(unix, target_os = "wasi")),
                "not while it runs: begin the robot with it, rc10 live --sim --mistake"
            );
            self.anew = Some((now + ANSWERED, mistakes));
            return Ok(Value::Null);
        }
        let what = if begins { "let go wrong" } else { "taken back" };
        self.told.push((now, format!("{what}: {words}")));
        Ok(Value::Null)
    }

    /// The effect of a gain before it is sent; null if nothing is known of it.
    fn advise(&self, name: &str, value: f32) -> Result<Value> {
        if self.stranger.is_some() {
            return Ok(Value::Null);
        }
        let wanted = self.session.parameter(name)?;
        let [least, most] = wanted.range;
        if !(least..=most).contains(&value) {
            // The robot gives the reason for its refusal.
            return Ok(Value::Null);
        }
        let known = self.session.client.parameters().filter(|it| it.label == wanted.label);
        let now: Vec<_> = known.map(|it| (it.name.as_str(), it.value)).collect();
        let advice = self.judge.advise(&wanted.label, (&wanted.name, value), now);
        Ok(advice.map_or(Value::Null, |it| {
            json!({
                "loop": it.name, "margin": it.margin, "phase": it.phase, "now": it.before, "least": it.least,
                "ask": it.ask, "text": it.text,
            })
        }))
    }

    /// Whether the robot may get a request that is not urgent.
    fn may_ask(&self) -> Result<()> {
        if let Some(stranger) = &self.stranger {
            bail!("{stranger}: only stopped, disarmed and watched");
        }
        if !self.session.client.is_up(self.session.now()) {
            bail!("not sent: {}", self.session.trouble().unwrap_or_default());
        }
        ensure!(
            self.waiting.len() < MOST_WAITING,
            "the robot has not answered what was asked before"
        );
        Ok(())
    }

    fn act(&mut self, action: &str, label: &str, speed: f32) -> Result<u16> {
        if action == "save" {
            return Ok(self.session.client.act(Action::Save));
        }
        let client = &mut self.session.client;
        let motor = client.motor(label);
        let motor = motor.with_context(|| format!("the robot has no motor `{label}`"))?;
        Ok(client.act(match action {
            // The robot refuses a speed that is too high.
            "jog" => Action::Jog(motor, (speed * 10.0).round() as i16),
            "zero" => Action::Zero(motor),
            "clear" => Action::ClearFault(motor),
            _ => bail!("there is no `{action}`"),
        }))
    }

    /// Takes a page's choice, unless the line does not carry it beside those of other pages.
    fn choose(&mut self, page: u32, choice: Choice) -> Result<Value> {
        ensure!(
            self.chosen.len() < PAGES || self.chosen.contains_key(&page),
            "too many pages watch this robot"
        );
        let before = self.chosen.insert(page, choice);
        let (period, signals) = self.wanted();
        let (count, most) = (signals.len(), self.line.most(period));
        if count > most && self.met {
            match before {
                Some(before) => self.chosen.insert(page, before),
                None => self.chosen.remove(&page),
            };
            bail!(
                "the line carries {most} signals every {period} ms, and {count} are chosen on all pages"
            );
        }
        self.watch();
        Ok(json!({ "period": period, "signals": count }))
    }

    /// What all pages that want more than is sent anyway want together.
    fn wanted(&self) -> (u16, BTreeSet<u16>) {
        let fast = || self.chosen.values().filter(|it| it.period < OFTEN && !it.signals.is_empty());
        let period = fast().map(|it| it.period.max(1)).min().unwrap_or(OFTEN);
        (period, fast().flat_map(|it| it.signals.iter().copied()).collect())
    }

    /// Has the robot send that, and all else as often as the line allows beside it.
    fn watch(&mut self) {
        let wanted = self.wanted();
        let beside =
            if wanted.1.is_empty() { None } else { self.line.beside(wanted.1.len(), wanted.0) };
        self.paces = beside.unwrap_or([OFTEN, SLOW]);
        let chosen = self.chosen.values().flat_map(|it| it.signals.iter().copied());
        look(&self.pages.shown).history.choose(chosen.collect());
        let client = &mut self.session.client;
        client.watch(0, wanted.0, wanted.1.iter().copied());
        watch_at(client, &self.topics, self.paces);
        if wanted != self.watched {
            // What was lost of another choice says nothing about this one.
            (self.watched, self.before) = (wanted, client.losses());
        }
    }

    /// Marks the moment.
    fn mark(&mut self, words: String) -> Result<Value> {
        ensure!(self.marks.len() < MARKS, "too many marks");
        let words = if words.is_empty() { format!("mark {}", self.marks.len() + 1) } else { words };
        if let Some((record, _)) = &mut self.record {
            record.mark(&words)?;
        }
        let now = look(&self.pages.shown).now;
        self.marks.push((now, words));
        Ok(Value::Null)
    }

    fn switch_record(&mut self, on: bool, words: [String; 2]) -> Result<Value> {
        if let Some((mut record, path)) = self.record.take() {
            if !on {
                record.name(words.clone());
            }
            let name = record.words()[0].clone();
            record.finish(Ok(()))?;
            let path = named(path, &name);
            self.note = Some((format!("record: {}", path.display()), false));
            look(&self.pages.shown).report = None;
            self.making = Some((self.report_of)(path));
        }
        if on {
            std::fs::create_dir_all(&self.folder)
                .with_context(|| format!("cannot make {}", self.folder.display()))?;
            self.record = loop {
                self.records += 1;
                let path = self.folder.join(format!("{:03}.mcap", self.records));
                match LiveRecord::new(
                    &path,
                    false,
                    &self.topics,
                    self.judge.kit.description(),
                    words.clone(),
                ) {
                    // The file of another time, or of another program that shows a robot.
                    Err(error) if is_there(&error) => {}
                    record => break Some((record?, path)),
                }
            };
            self.note = room(&self.folder, OFTEN).map(|it| {
                let stays = it.starts_with("WARNING");
                (it, stays)
            });
        }
        Ok(Value::Null)
    }

    /// All that pages show but the plots.
    fn state(&self) -> Value {
        let Self { session, topics, .. } = self;
        let client: &Client = &session.client;
        let (losses, before) = (client.losses(), self.before);
        let shown = look(&self.pages.shown);
        let signal = |(index, it): (u16, &crate::live::client::Signal)| {
            let value = shown.history.newest(index).map(|(_, value)| value);
            json!({
                "index": index, "folder": it.folder, "label": it.label, "name": it.name,
                "unit": it.unit, "states": it.states, "value": value.filter(|it| it.is_finite()),
                "begin": shown.history.begin(Some(index)).map(Micros::get),
            })
        };
        let kept: Option<Vec<_>> = client.kept().map(Iterator::collect);
        let kept_of = |index| {
            let is_it = |it: &&&KeptValue| it.is_used && it.parameter == Some(index);
            kept.iter().flatten().find(is_it).map(|it| it.value)
        };
        let parameter = |it: &crate::live::client::Parameter| {
            json!({
                "kept": kept_of(it.index),
                "index": it.index, "full": full_name(it), "label": it.label, "name": it.name,
                "unit": it.unit, "range": it.range, "value": it.value, "initial": it.initial,
            })
        };
        let record = self.record.as_ref().map(|(record, path)| {
            json!({ "path": path.display().to_string(), "seconds": record.length().get() as f64 * 1e-6 })
        });
        let is_whole = client.is_described();
        let urgency = |what| {
            let urgency = client.urgency(what, session.now());
            urgency.map(|it| if it == Urgency::Sent { "sent" } else { "not heard" })
        };
        let lately = self.told.iter().filter(|(at, _)| session.now().since(*at) < LATELY);
        let mut happened: Vec<_> =
            self.judge.happened.iter().chain(&self.marks).chain(lately).collect();
        happened.sort_by_key(|(at, _)| *at);
        json!({
            "is_simulated": self.is_simulated,
            "broken": self.broken.words().collect::<Vec<_>>(),
            "problems": self.judge.found.iter().map(Problem::to_json).collect::<Vec<_>>(),
            "judged": self.judge.judged.map(Micros::get),
            "happened": happened.iter()
                .map(|(at, what)| json!([at.get() as f64 * 1e-6, what])).collect::<Vec<_>>(),
            "stranger": self.stranger,
            "log": self.log,
            "stop": urgency(Urgent::Stop),
            "disarm": urgency(Urgent::Disarm),
            "declaration": client.declaration().0,
            "boot": self.boot,
            "drawn": self.judge.kit.description().drawn(),
            "name": session.name(),
            "trouble": session.trouble(),
            "note": self.note.as_ref().map(|it| &it.0),
            "stays": self.note.as_ref().is_some_and(|it| it.1),
            "report": match &self.making {
                Some(_) => Some("making"),
                None => shown.report.as_ref().map(|_| "ready"),
            },
            "now": shown.now.get(),
            "begin": shown.history.begin(None).map(Micros::get),
            "whole": is_whole,
            "losses": {
                "samples": losses.samples - before.samples, "skipped": losses.skipped - before.skipped,
                "damaged": losses.damaged - before.damaged, "unknown": losses.unknown - before.unknown,
                "left": self.left,
            },
            "record": record,
            "often": OFTEN,
            "paces": self.paces,
            "fast": (!self.watched.1.is_empty()).then_some(self.watched.0),
            "fits": FAST.map(|period| json!([period, self.line.most(period)])),
            "topics": topics.len(),
            "signals": client.signals().map(signal).collect::<Vec<_>>(),
            "kept": kept.as_ref().map(|kept| kept.iter().map(|it| json!({
                "name": session.name_of(it), "value": it.value, "used": it.is_used,
                "known": it.parameter.is_some(),
            })).collect::<Vec<_>>()),
            "parameters": client.parameters().map(parameter).collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_robot_is_told_by_its_clock() {
        let at = |robot, line| (Micros::from_millis(robot), Micros::from_millis(line));
        let before = at(60_000, 5000);
        for (robot, line) in [(60_050, 5050), (60_010, 6900), (61_500, 5010), (60_000, 5000)] {
            assert!(!is_another(before, at(robot, line)), "{robot} {line}");
        }
        // Restarted; one that was switched on earlier; one that was later, behind a cable that was out for a while.
        for (robot, line) in [(300, 5400), (90_000, 5050), (61_000, 65_000)] {
            assert!(is_another(before, at(robot, line)), "{robot} {line}");
        }
    }
}
