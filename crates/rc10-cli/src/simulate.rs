//! The robot in a simulated world: its own tasks, against simulated motors on simulated wires.

use std::fmt::Write as _;
use std::pin::Pin;

use anyhow::{Context, Result};
use rc10_app::angle::shortest_way_degrees;
use rc10_can::Micros;
use rc10_motor::dji::{self, Direction, FeedbackRate};
use rc10_motor::embassy::run_bus;
use rc10_motor::{BusLoad, Drive, Target};
use rc10_robot::driver::{SCRIPT, SCRIPT_LENGTH};
use rc10_robot::table::{BASE, BUSES, Entry, LIFT, MOTORS, Name, WHEELS};
use rc10_robot::{Bus, Io, Robot, chassis, driver, mechanisms, status};
use rc10_sim::{Base, BusConfig, Chassis, Esc, EscConfig, Model, Mounting, Tasks, Wheels, World};

use crate::candump;
use crate::recording::{
    BusTrack, Event, MotorSample, MotorTrack, PathPoint, Recording, SAMPLE_PERIOD,
};

/// The world around the robot: three wires, the motors of the robot's table, and its base.
pub struct Surroundings {
    /// Time, and everything in it.
    pub world: World,
    /// The wires; bus 1 is the first.
    pub wires: [rc10_sim::Bus; BUSES],
    /// The motors, in the order of the table.
    pub motors: Vec<Esc>,
    /// The base on its wheels.
    pub base: Base,
}

impl Surroundings {
    /// What the robot's table says, with all chance from `seed`.
    ///
    /// # Errors
    /// If the table has a motor that no simulated ESC can be.
    pub fn new(seed: u64) -> Result<Self> {
        let mut world = World::new(seed);
        let wires = [(); BUSES].map(|()| world.add_bus(BusConfig::default()));
        let mut motors = Vec::new();
        for entry in &MOTORS {
            let esc = wires[usize::from(entry.bus - 1)]
                .add_esc(esc_config(entry)?)
                .with_context(|| format!("motor table, {}", entry.label))?;
            motors.push(esc);
        }
        for name in LIFT {
            // The weight of the lift, which pulls every shaft down.
            motors[name as usize].set_load(-sign(name.entry()));
        }
        let wheel = |name: Name| {
            let mounting = match name.entry().direction {
                Direction::Forward => Mounting::Normal,
                Direction::Reversed => Mounting::Mirrored,
            };
            (&motors[name as usize], mounting)
        };
        let [front_left, front_right, rear_left, rear_right] = WHEELS.map(wheel);
        let chassis = Chassis {
            wheel_radius: BASE.wheel_radius.into(),
            half_length: BASE.half_wheelbase.into(),
            half_width: BASE.half_track.into(),
            ..Chassis::default()
        };
        let wheels = Wheels { front_left, front_right, rear_left, rear_right };
        let base = world.add_base(chassis, wheels)?;
        Ok(Self { world, wires, motors, base })
    }
}

/// 1 for a motor that counts forward, -1 for a reversed one.
fn sign(entry: &Entry) -> f64 {
    match entry.direction {
        Direction::Forward => 1.0,
        Direction::Reversed => -1.0,
    }
}

/// The simulated twin of a line of the table, with the load on its shaft.
fn esc_config(entry: &Entry) -> Result<EscConfig> {
    let model = match entry.model {
        model if *model == dji::M3508 => Model::C620,
        model if *model == dji::M2006 => Model::C610,
        model if *model == dji::GM6020_CURRENT => Model::Gm6020Current,
        model if *model == dji::GM6020_VOLTAGE => Model::Gm6020Voltage,
        model => anyhow::bail!("{}: no simulated ESC for a {}", entry.label, model.name),
    };
    // kg m² at the output shaft; our estimates. The wheels get theirs from the base.
    let load = match entry.name {
        Name::Yaw => 0.02,
        Name::Pitch => 0.01,
        Name::Feeder => 0.002,
        name if LIFT.contains(&name) => 0.01,
        _ => 0.0,
    };
    let mut config = EscConfig::new(model, entry.id);
    config.plant = config.plant.with_load_inertia(load);
    config.rate = match entry.rate {
        FeedbackRate::Hz1000 => rc10_sim::FeedbackRate::Hz1000,
        FeedbackRate::Hz500 => rc10_sim::FeedbackRate::Hz500,
        FeedbackRate::Hz250 => rc10_sim::FeedbackRate::Hz250,
        FeedbackRate::Hz125 => rc10_sim::FeedbackRate::Hz125,
    };
    Ok(config)
}

/// All tasks of the robot, with its bus runners on simulated wires.
pub fn tasks<'r>(io: &'r Io, buses: [Bus<'r>; BUSES], wires: &[rc10_sim::Bus; BUSES]) -> Tasks<'r> {
    let mut tasks = Tasks::new();
    for ((bus, shared), wire) in buses.into_iter().zip(&io.buses).zip(wires) {
        let port = wire.port();
        tasks.add(run_bus(port, bus, shared));
    }
    tasks.add(async { chassis::run(io).await });
    tasks.add(async { mechanisms::run(io).await });
    tasks.add(async { driver::run(io).await });
    tasks.add(async { status::run(io).await });
    tasks
}

/// What the robot's buses need, before anything runs.
///
/// # Errors
/// If the robot's table is wrong.
pub fn plan() -> Result<[BusLoad; BUSES]> {
    let mut robot = Robot::new()?;
    let (_, buses) = robot.start()?;
    Ok(buses.map(|bus| bus.load(1_000_000)))
}

/// Runs the robot for `length` of virtual time.
///
/// # Errors
/// If the robot's table is wrong.
pub fn simulate(seed: u64, length: Micros) -> Result<Recording> {
    let plan = plan()?;
    let mut robot = Robot::new()?;
    let (io, buses) = robot.start()?;
    let Surroundings { mut world, wires, motors, base } = Surroundings::new(seed)?;
    let mut tasks = tasks(io, buses, &wires);

    let mut samples = vec![Vec::new(); MOTORS.len()];
    let mut logs = [const { String::new() }; BUSES];
    let mut frames = [0; BUSES];
    let mut path = Vec::new();
    while world.now() < length {
        let until = (world.now() + SAMPLE_PERIOD).min(length);
        let _ = world.run(Pin::new(&mut tasks), until);
        for (number, wire) in wires.iter().enumerate() {
            for entry in wire.take_trace() {
                frames[number] += 1;
                candump::write_line(&mut logs[number], entry.at, CHANNELS[number], &entry.frame)?;
            }
        }
        for (samples, (entry, esc)) in samples.iter_mut().zip(MOTORS.iter().zip(&motors)) {
            samples.push(sample(io, entry, esc));
        }
        let pose = base.pose();
        path.push(PathPoint { x: pose.x, y: pose.y, yaw: pose.yaw });
    }

    let motors =
        MOTORS.iter().zip(samples).zip(&motors).map(|((entry, samples), esc)| MotorTrack {
            entry,
            samples,
            last: io.motor(entry.name).status(),
            overwritten: esc.state().feedback_overwritten,
        });
    let buses = wires.iter().zip(logs).enumerate().map(|(index, (wire, log))| BusTrack {
        number: index as u8 + 1,
        plan: plan[index],
        load: wire.load(),
        load_windows: wire.load_windows(),
        last: io.buses[index].status(),
        frames: frames[index],
        log,
    });
    Ok(Recording {
        seed,
        length,
        motors: motors.collect(),
        buses: buses.collect(),
        path,
        events: events(length),
    })
}

/// What the buses are called in logs: as can-utils would.
const CHANNELS: [&str; BUSES] = ["can0", "can1", "can2"];

fn sample(io: &Io, entry: &Entry, esc: &Esc) -> MotorSample {
    let status = io.motor(entry.name).status();
    let feedback = status.feedback;
    let (wanted, measured) = match status.target {
        Target::Angle(wanted) => {
            let measured = feedback.angle.get();
            // Shown next to its target, also across the end of the turn.
            let way = shortest_way_degrees(wanted, feedback.angle).get();
            (
                Some(f64::from(wanted.get())),
                f64::from(if way.is_finite() { wanted.get() + way } else { measured }),
            )
        }
        Target::TotalAngle(wanted) => {
            let degrees = |angle: rc10_app::TotalAngle| angle.microdegrees() as f64 * 1e-6;
            (Some(degrees(wanted)), degrees(feedback.total_angle))
        }
        Target::Speed(wanted) => (Some(wanted.get().into()), feedback.speed.get().into()),
        _ => (None, feedback.speed.get().into()),
    };
    let state = esc.state();
    MotorSample {
        target: wanted.filter(|_| status.drive == Drive::Run),
        measured,
        kind: status.target.kind(),
        current: state.current * sign(entry),
        rpm: state.output_rpm * sign(entry),
        link: status.link,
        drive: status.drive,
    }
}

/// The script's lines with the times at which the driver comes to them.
fn events(length: Micros) -> Vec<Event> {
    let start = driver::EARLIEST_START;
    let rounds = (0..).map(|round| start + round * u64::from(SCRIPT_LENGTH));
    let lines = rounds.flat_map(|start| {
        SCRIPT.iter().map(move |&(at, label, _)| Event {
            at: Micros::from_millis(start + u64::from(at)),
            label,
        })
    });
    lines.take_while(|event| event.at < length).collect()
}

/// The three logs, one after another, as one hash.
#[must_use]
pub fn trace_hash(recording: &Recording) -> String {
    use sha2::{Digest, Sha256};
    let mut hash = Sha256::new();
    for bus in &recording.buses {
        hash.update(&bus.log);
    }
    hash.finalize().iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
