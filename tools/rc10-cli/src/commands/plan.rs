//! `rc10 plan`: each frame of a robot's buses, how late it can be, and what else fits.

use std::io::Write;
use std::str::FromStr;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use clap::Args;
use rc10_motor::dji::{self, FeedbackRate};
use rc10_motor::plan::{Extra, Plan, Sort};
use rc10_motor::{
    AttachError, BusLoad, Device, Entry, MOST_BUSES, Place, Rate, SetupError, Unsound, Wiring,
    declaration,
};
use rc10_sim::fault::is_called;
use rc10_tasks::boards::Boards;
use rc10_time::Micros;
use serde_json::{Value, json};

use crate::robot::description::Description;
use crate::robot::motor::Motor;
use crate::show::figures::{Entry as Cell, Table, words};

/// Arguments of `rc10 plan`.
#[derive(Args, Debug)]
pub struct PlanArgs {
    /// What if there were more motors: on this bus, M3508, M2006 or GM6020 with its feedback rate, or another one like
    /// the motor of a label; each gets a free identifier. Repeatable
    #[arg(long, value_name = "BUS:MOTOR[@HZ][*N]")]
    pub add: Vec<More>,
    /// Error frames a second, evenly spread, each with the frame that it destroys
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub errors: u32,
    /// With the frames by which motors are set up, and their replies: of each motor one at a time
    #[arg(long)]
    pub set_up: bool,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
}

/// Motors that are thought of: `1:M3508@500*2`.
#[derive(Clone, Debug)]
pub struct More {
    bus: u8,
    motor: String,
    rate: Option<u16>,
    count: u8,
}

impl FromStr for More {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let form = "BUS:MOTOR[@HZ][*N], as in 1:M3508@500*2";
        let (bus, rest) = text.split_once(':').context(form)?;
        let (rest, count) = rest.split_once('*').unwrap_or((rest, "1"));
        let (motor, rate) = match rest.split_once('@') {
            Some((motor, rate)) => (motor, Some(rate.parse().context(form)?)),
            None => (rest, None),
        };
        let [bus, count] = [bus, count].map(|it| it.parse().context(form));
        ensure!(count.as_ref().is_ok_and(|count| *count > 0), "N is 1 to 255: {form}");
        Ok(Self { bus: bus?, motor: motor.to_owned(), rate, count: count? })
    }
}

/// The line of the declaration that a motor is.
fn entry(motor: &Motor) -> Entry<Device> {
    let entry = Entry::new(motor.on, motor.device).with_label(motor.label);
    Entry { most_age: motor.most_age, ..entry }
}

/// A device like this one with another identifier, if there is such a one.
fn renumbered(device: Device, id: u8) -> Option<Device> {
    let mut device = device;
    match &mut device {
        Device::Dji(config) => config.id = id,
        Device::Vesc(config) => config.id = id,
        Device::Damiao(config) => {
            (config.can_id, config.master_id) = (id.into(), 0x20 + u16::from(id));
        }
        Device::CyberGear(config) => config.address.motor = id,
        Device::Lk(config) => config.id = id,
        Device::ODrive(config) => config.node = id,
        Device::GoModule(config) => config.motor = id,
        _ => return None,
    }
    Some(device)
}

/// The motors with one more like this on a bus, by the first identifier that is free.
fn with_one_more(entries: &[Entry<Device>], bus: u8, device: Device) -> Result<Vec<Entry<Device>>> {
    let label = NEW.iter().find(|label| entries.iter().all(|entry| entry.label != **label));
    let label = label.context("so many more are not thought of")?;
    let mut found = None;
    for id in 1..=32 {
        let device = renumbered(device, id).context("there is no other one like it")?;
        let mut more = entries.to_vec();
        more.push(Entry::new(Place::Bus(bus), device).with_label(label));
        let Err(error) = check(&more) else { return Ok(more) };
        let is_taken = matches!(error.why, Unsound::Config(_))
            || matches!(error.why, Unsound::Attach { error: AttachError::Clash { .. }, .. });
        if !is_taken {
            bail!("{error}");
        }
        found = Some(error);
    }
    Err(found.map_or_else(|| anyhow!("no identifier is free"), Into::into))
}

/// Labels of motors that are thought of: as many as three buses hold.
const NEW: [&str; 24] = [
    "new 1", "new 2", "new 3", "new 4", "new 5", "new 6", "new 7", "new 8", "new 9", "new 10",
    "new 11", "new 12", "new 13", "new 14", "new 15", "new 16", "new 17", "new 18", "new 19",
    "new 20", "new 21", "new 22", "new 23", "new 24",
];

fn check(entries: &[Entry<Device>]) -> std::result::Result<(), SetupError> {
    declaration::check(entries, &[100.0; MOST_BUSES], u8::MAX)
}

/// A motor of DJI, by its model, or one like another motor of the robot.
fn thought_of(more: &More, entries: &[Entry<Device>]) -> Result<Device> {
    let models = [&dji::M3508, &dji::M2006, &dji::GM6020_CURRENT];
    let model = models.iter().find(|model| model.name.split(' ').next() == Some(&*more.motor));
    let like = entries.iter().find(|entry| is_called(entry.label, &more.motor));
    let mut device = match (model, like) {
        (Some(model), _) => dji::Config::new(model, 1).device(),
        (None, Some(like)) => like.config,
        (None, None) => bail!(
            "there is no motor `{}`: it is M3508, M2006, GM6020, or the label of one of the robot's motors",
            more.motor
        ),
    };
    match (&mut device, more.rate) {
        (_, None) => {}
        (Device::Dji(config), Some(rate)) => config.rate = rate_of(rate)?,
        (device, Some(_)) => {
            bail!("a {} has its feedback rate in its own configuration", device.name().model)
        }
    }
    Ok(device)
}

/// What a motor of DJI may be set to.
const RATES: [FeedbackRate; 4] =
    [FeedbackRate::Hz1000, FeedbackRate::Hz500, FeedbackRate::Hz250, FeedbackRate::Hz125];

fn rate_of(hz: u16) -> Result<FeedbackRate> {
    let rate = RATES.into_iter().find(|rate| rate.hz() == hz);
    rate.with_context(|| {
        let rates = RATES.map(|rate| rate.hz().to_string()).join(", ");
        format!("a motor of DJI has no feedback rate of {hz} Hz: it is one of {rates}")
    })
}

/// Prints each frame of each bus and its times; fails if a motor that is thought of has no place.
pub fn plan(args: &PlanArgs, description: &Description, out: &mut dyn Write) -> Result<()> {
    let mut entries: Vec<_> = description.motors.iter().map(entry).collect();
    for more in &args.add {
        let device = thought_of(more, &entries)?;
        ensure!((1..=description.buses).contains(&more.bus), "the robot has no bus {}", more.bus);
        for number in 1..=more.count {
            entries = with_one_more(&entries, more.bus, device).with_context(|| {
                format!("{} more like {} on bus {}", number, more.motor, more.bus)
            })?;
        }
    }
    let extra = Extra { errors: args.errors, set_up: args.set_up };
    // The bus of two boards has the motors of both.
    let shared = description.partner;
    let shared = shared.and_then(|other| Some((other, other.boards.buses(other.role)?)));
    if let Some((other, [here, there])) = shared {
        let theirs =
            (other.description)().motors.into_iter().filter(|it| it.on == Place::Bus(there));
        entries.extend(theirs.map(|motor| entry(&Motor { on: Place::Bus(here), ..motor })));
    }
    let plan = |bus| {
        let boards = shared.filter(|(_, [here, _])| *here == bus).map(|(other, _)| other.boards);
        BusPlan::of(bus, &entries, extra, boards)
    };
    let buses: Vec<_> = (1..=description.buses).map(plan).collect();
    if args.json {
        let buses: Vec<_> = buses.iter().map(BusPlan::to_json).collect();
        writeln!(out, "{}", json!({ "errors_per_second": args.errors, "buses": buses }))?;
        return Ok(());
    }
    for bus in &buses {
        bus.print(out)?;
    }
    writeln!(
        out,
        "Worst cases: all stuff bits, all phases, {} error frames a second. Within: from when a frame should be ready to its\n\
         end on the wire. Age: of feedback, when a command that it decided has arrived. An ESC's own clock is taken to be off by\n\
         50 us, and a reply to come within 250 us: no maker tells it.",
        args.errors
    )?;
    Ok(())
}

/// A bus with its frames.
struct BusPlan<'e> {
    number: u8,
    entries: &'e [Entry<Device>],
    plan: Plan,
    load: BusLoad,
    /// More motors that fit: a name, and how many.
    fits: Vec<(String, usize)>,
}

impl<'e> BusPlan<'e> {
    fn of(number: u8, entries: &'e [Entry<Device>], extra: Extra, boards: Option<Boards>) -> Self {
        let on = Place::Bus(number);
        let plan = Plan::of(entries, on, extra);
        let mut kinds = vec![
            ("M3508 at 1 kHz".to_owned(), dji::Config::new(&dji::M3508, 1).device()),
            (
                "M3508 at 500 Hz".to_owned(),
                dji::Config::new(&dji::M3508, 1).with_feedback_rate(FeedbackRate::Hz500).device(),
            ),
        ];
        for entry in entries.iter().filter(|entry| matches!(entry.on, Place::Bus(_))) {
            let name = entry.config.name().model.trim_end_matches(',').to_owned();
            if !matches!(entry.config, Device::Dji(_))
                && kinds.iter().all(|(known, _)| *known != name)
            {
                kinds.push((name, entry.config));
            }
        }
        let fits = |(name, device): (String, Device)| {
            let mut more = entries.to_vec();
            while let Ok(next) = with_one_more(&more, number, device) {
                more = next;
            }
            (name, more.len() - entries.len())
        };
        Self {
            number,
            entries,
            plan: boards.map_or(plan, |boards| boards.in_plan(plan)),
            load: declaration::load(entries, on),
            fits: kinds.into_iter().map(fits).collect(),
        }
    }

    fn label(&self, motor: usize) -> &'static str {
        self.entries.get(motor).map_or("a board", |entry| entry.label)
    }

    /// The motors that a command is for, or the one whose feedback it is.
    fn motors(&self, at: usize) -> Vec<&'static str> {
        let Some(sort) = self.plan.sorts().get(at) else { return Vec::new() };
        let is_for = |entry: &&Entry<Device>| match entry.config.wiring() {
            Wiring::Can(ids) => {
                ids.transmitted().iter().any(|sent| sent.pattern == sort.frames.pattern)
            }
            Wiring::Line(_) => false,
        };
        if sort.is_command {
            let on_bus = self.entries.iter().filter(|entry| entry.on == Place::Bus(self.number));
            on_bus.filter(is_for).map(|entry| entry.label).collect()
        } else {
            vec![self.label(sort.motor)]
        }
    }

    fn is_between_boards(&self, sort: &Sort) -> bool {
        sort.motor >= self.entries.len()
    }

    /// Of a frame that is sent all the time.
    fn period(&self, at: usize, sort: &Sort) -> Option<u32> {
        match sort.frames.rate.per_second() {
            0 if self.is_between_boards(sort) => Some(self.plan.period(at)),
            rate => 1_000_000_u32.checked_div(rate),
        }
    }

    fn frames(&self) -> Table {
        let row = |(at, sort): (usize, &Sort)| {
            let (period, is_between_boards) = (self.period(at, sort), self.is_between_boards(sort));
            let within = self.plan.response(at);
            // A reply has no time of its own: it follows its command.
            let is_reply = !sort.is_command && matches!(sort.frames.rate, Rate::EveryTick);
            let due = period.filter(|_| !is_reply).zip(within);
            let slack = due.map(|(due, within)| i64::from(due) - i64::from(within));
            vec![
                words(sort.frames.pattern),
                words(if sort.is_command { "robot" } else { self.label(sort.motor) }),
                words(match (sort.is_command, is_between_boards) {
                    (true, _) => self.motors(at).join(", "),
                    (false, true) => "the other".to_owned(),
                    (false, false) => "robot".to_owned(),
                }),
                words(period.map_or("set-up".to_owned(), |period| period.to_string())),
                words(self.plan.bits(at)),
                Cell {
                    bad: within.is_none(),
                    ..words(within.map_or("no bound".to_owned(), |it| it.to_string()))
                },
                Cell {
                    bad: slack.is_some_and(|slack| slack < 0),
                    ..words(slack.map_or("–".to_owned(), |it| it.to_string()))
                },
            ]
        };
        let head = vec!["frame", "from", "to", "every us", "bits", "within us", "slack us"];
        Table { head, words: 3, rows: self.plan.sorts().iter().enumerate().map(row).collect() }
    }

    /// Of each motor the sort of its feedback and its age, with the age that is allowed.
    fn ages(
        &self,
    ) -> impl Iterator<Item = (&'static str, Option<u32>, Option<u32>, Option<Micros>)> {
        let of_motors = self
            .plan
            .sorts()
            .iter()
            .enumerate()
            .take_while(|(_, sort)| sort.motor < self.entries.len());
        of_motors.filter(|(at, _)| self.plan.is_feedback(*at)).map(|(at, sort)| {
            let allowed = self.entries.get(sort.motor).and_then(|entry| entry.most_age);
            (
                self.label(sort.motor),
                sort.command.and_then(|at| self.plan.response(at)),
                self.plan.age(at),
                allowed,
            )
        })
    }

    fn print(&self, out: &mut dyn Write) -> Result<()> {
        let count = self.entries.iter().filter(|entry| entry.on == Place::Bus(self.number)).count();
        writeln!(out, "bus {}: {count} motors, {}", self.number, self.load)?;
        if !self.plan.sorts().is_empty() {
            writeln!(out, "{}", self.frames().text())?;
        }
        if count > 0 {
            let us = |time: Option<u32>| time.map_or("no bound".to_owned(), |it| it.to_string());
            let row = |(label, command, age, allowed): (
                &str,
                Option<u32>,
                Option<u32>,
                Option<Micros>,
            )| {
                let most = allowed.map_or("–".to_owned(), |most| most.get().to_string());
                vec![words(label), words(us(command)), words(us(age)), words(most)]
            };
            let head = vec!["motor", "command within us", "age us", "allowed us"];
            writeln!(
                out,
                "{}",
                Table { head, words: 1, rows: self.ages().map(row).collect() }.text()
            )?;
        }
        let fits = self.fits.iter().filter(|(_, count)| *count > 0);
        let fits: Vec<_> = fits.map(|(name, count)| format!("{count} {name}")).collect();
        match &*fits.join(", or ") {
            "" => writeln!(
                out,
                "There is no room for an M3508 or another motor of the robot's kinds.\n"
            )?,
            fits => writeln!(out, "There is room for {fits} more.\n")?,
        }
        Ok(())
    }

    fn to_json(&self) -> Value {
        let frames = self.plan.sorts().iter().enumerate().map(|(at, sort)| {
            json!({
                "frame": sort.frames.pattern.to_string(),
                "is_command": sort.is_command,
                "motors": self.motors(at),
                "period_us": self.period(at, sort),
                "bits": self.plan.bits(at),
                "response_us": self.plan.response(at),
            })
        });
        let motors = self.ages().map(|(label, command, age, allowed)| {
            json!({ "label": label, "command_us": command, "age_us": age, "allowed_us": allowed.map(Micros::get) })
        });
        let fits = self.fits.iter().map(|(name, count)| json!({ "motor": name, "more": count }));
        json!({
            "bus": self.number,
            "load_percent": { "least": self.load.least, "typical": self.load.typical, "worst": self.load.worst },
            "frames": frames.collect::<Vec<_>>(),
            "motors": motors.collect::<Vec<_>>(),
            "fits": fits.collect::<Vec<_>>(),
        })
    }
}
