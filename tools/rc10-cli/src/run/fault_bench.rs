//! A motor of ours with its simulated device, on buses that tick as a robot's do, and all that can go
//! wrong around it.

use std::cell::{Cell, RefCell};
use std::num::NonZeroU8;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

use anyhow::{Result, bail};
use rc10_app::{
    Amps, Cascade, Degrees, FeedForward, Gear, PidConfig, Rpm, RpmPerSecond, Seconds, TotalAngle,
};
use rc10_can::embedded_can::Id;
use rc10_can::{CanFrame, CanPort, ErrorState, Health, IdPattern, Submitted};
use rc10_module::remote::{Remote, Switch};
use rc10_motor::embassy::{BusPort, Runner};
use rc10_motor::unitree::{GoM8010, GoModule, LineConfig, ModuleConfig, Rs485Bus, Step};
use rc10_motor::{
    ArmState, ArmSwitch, CanMotor, Device, DriveMode, MotorBus, MotorId, MotorStatus, Request,
    Safety, Target, Wiring, cybergear, damiao, dji, lk, odrive, vesc,
};
use rc10_sim::{
    Bus, BusConfig, Esc, EscFault, Fault, Faults, Line, LineConfig as Settings, Nanos, Parts,
    Random, SimPort, World,
};
use rc10_tasks::rc10_message::Stamped;
use rc10_tasks::{Arming, ArmingConfig};
use rc10_time::Micros;

use crate::robot::motor::{Motor, Place, Plant};

/// A motor model as it is tried: how it is set up, what drives it, and what is on its shaft.
#[derive(Clone, Copy)]
pub struct Model {
    /// The name in tables.
    pub name: &'static str,
    /// The device.
    pub device: Device,
    /// The target that makes it turn.
    pub target: Target,
    /// The speed at which it then turns, rpm.
    pub cruise: f64,
    inertia: f64,
}

const fn cascade(most: f32, kp: f32, ki: f32, angle_kp: f32) -> Cascade {
    Cascade {
        speed: PidConfig::within(most).kp(kp).ki(ki),
        angle: PidConfig::within(200.0).kp(angle_kp),
        outer_divider: 5,
        acceleration: RpmPerSecond::new(1500.0),
        feed_forward: FeedForward::NONE,
    }
}

/// Every motor model that has a simulated device, in each way to drive it.
#[rustfmt::skip]
pub fn models() -> Vec<Model> {
    let poles = NonZeroU8::new(7).unwrap_or(NonZeroU8::MIN);
    let gear = |teeth| Gear::new(teeth, 1).unwrap_or(Gear::DIRECT);
    let dji = |model| dji::Config::new(model, 1).device();
    let damiao = |model, control| damiao::Config::new(model, 0x11, 0x31, control).device();
    let (j4310, speed) = (damiao::models::J4310, Rpm::new(30.0));
    let vesc = |gear| vesc::Config::new(1, vesc::ElectricalScale::new(poles, gear), vesc::Currents {
        limit: Amps::new(40.0), brake: Amps::new(15.0), handbrake: Amps::new(20.0),
    });
    let lk = |model, most, kp, ki, angle_kp| lk::Config::new(model, 1, cascade(most, kp, ki, angle_kp));
    let mf = lk(lk::models::MF9025, 12.0, 0.1, 0.5, 2.0);
    let odrive = |control| odrive::Config::new(3, odrive::Firmware::V0_6, control, odrive::Rates::new(1000, 100))
        .with_gear(gear(8)).with_limits(odrive::Limits { speed: Rpm::new(300.0), current: Amps::new(18.0) }).device();
    use odrive::{Control, InputMode};
    let mut all = vec![
        ("M3508", dji(&dji::M3508), 100.0, 0.029),
        ("M2006", dji(&dji::M2006), 100.0, 0.002),
        ("GM6020, current", dji(&dji::GM6020_CURRENT), 60.0, 0.01),
        ("GM6020, voltage", dji(&dji::GM6020_VOLTAGE), 60.0, 0.01),
        ("Damiao J4310, MIT", damiao(j4310, damiao::Control::Mit(cascade(7.0, 0.063, 0.5, 1.3))), 60.0, 0.02),
        ("Damiao J4310, velocity", damiao(j4310, damiao::Control::Velocity), 60.0, 0.02),
        ("Damiao J4310, position", damiao(j4310, damiao::Control::PositionVelocity { speed }), 30.0, 0.02),
        ("Damiao J4310, force", damiao(j4310, damiao::Control::ForcePosition { speed, torque_share: 0.5 }), 30.0, 0.02),
        ("Damiao J8009", damiao(damiao::models::J8009, damiao::Control::Velocity), 60.0, 0.1),
        ("VESC", vesc(Gear::DIRECT).device(), 1000.0, 6e-4),
        ("VESC, geared", vesc(gear(19)).with_angle_loops(cascade(40.0, 0.9, 5.0, 2.0)).device(), 60.0, 0.05),
        ("MG4010E-i10", lk(lk::models::MG4010E_I10, 5.0, 0.2, 2.0, 3.0).device(), 60.0, 0.02),
        ("MF9025", mf.device(), 100.0, 0.005),
        ("MF9025, multi-motor", mf.with_commands(lk::Commands::MultiMotor).device(), 100.0, 0.005),
        ("ODrive, torque", odrive(Control::Torque(cascade(8.0, 0.1, 1.0, 3.0))), 80.0, 0.03),
        ("ODrive, velocity", odrive(Control::Velocity(InputMode::VelocityRamp)), 80.0, 0.03),
        ("ODrive, position", odrive(Control::Position(InputMode::Trapezoid)), 80.0, 0.03),
        ("GO-M8010-6, module", ModuleConfig::new(3, 1).device(), 100.0, 0.01),
        ("GO-M8010-6, RS-485", LineConfig::new(1).device(), 100.0, 0.01),
    ];
    all.extend(cybergear::models::ALL.into_iter().map(|known| {
        let inertia = if known.limits.torque > 30.0 { 0.1 } else { 0.01 };
        let config = cybergear::Config::new(known, cybergear::Address { motor: 1, host: 0xFD });
        (known.name, config.device(), 60.0, inertia)
    }));
    all.into_iter().map(|(name, device, cruise, inertia)| {
        // Those that take angles alone: farther than they come.
        let target = match name {
            "Damiao J4310, position" | "Damiao J4310, force" => Target::TotalAngle(TotalAngle::from_degrees(700)),
            "ODrive, position" => Target::TotalAngle(TotalAngle::from_degrees(36_000)),
            _ => Target::Speed(Rpm::new(cruise)),
        };
        Model { name, device, target, cruise: cruise.into(), inertia }
    }).collect()
}

/// A motor of ours.
enum Made {
    Can(Box<dyn CanMotor>),
    Line(Box<GoM8010>),
}

fn made(device: &Device) -> Result<Made> {
    Ok(Made::Can(match *device {
        Device::Dji(config) => Box::new(dji::Dji::new(config)?),
        Device::Vesc(config) => Box::new(vesc::Vesc::new(config)?),
        Device::Damiao(config) => Box::new(damiao::Damiao::new(config)?),
        Device::CyberGear(config) => Box::new(cybergear::CyberGear::new(config)?),
        Device::Lk(config) => Box::new(lk::Lk::new(config)?),
        Device::ODrive(config) => Box::new(odrive::ODrive::new(config)?),
        Device::GoModule(config) => Box::new(GoModule::new(config)?),
        Device::GoM8010(config) => return Ok(Made::Line(Box::new(GoM8010::new(config)?))),
        _ => bail!("there is no motor of ours for a {}", device.name().model),
    }))
}

/// What goes wrong between a robot and its motors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// A fault of wires and devices, as `--fault` writes it: `*` is the bus or line, `motor` the motor.
    Fault(&'static str),
    /// One frame in three is lost, either way.
    Lost,
    /// The motor's frames come a byte too short.
    Short,
    /// Another node sends anything with the motor's identifier, every millisecond.
    Foreign,
    /// A second device with the same identifier.
    Double,
    /// The device reports that it is too hot; without power it forgets that.
    Reported,
    /// An emergency stop.
    Stop,
    /// The switch that disarms.
    Disarm,
    /// All tasks hang: nothing commands, nothing looks after the remote.
    Hung,
    /// The targets are no numbers.
    NotANumber,
    /// The buses' executor does not run.
    Blocked,
    /// The clock jumps ahead by a second.
    Jump,
    /// The remote is not heard.
    RemoteLost,
}

/// What the troubles of the host do to its port.
#[derive(Default)]
struct Tap {
    going: RefCell<Vec<Trouble>>,
    offset: Cell<u64>,
    count: Cell<u32>,
    /// When the controller was first seen off the bus, and when it was first sent back.
    off_at: Cell<Option<Micros>>,
    back_at: Cell<Option<Micros>>,
}

impl Tap {
    fn is(&self, trouble: Trouble) -> bool {
        self.going.borrow().contains(&trouble)
    }

    fn loses_one(&self) -> bool {
        self.count.set(self.count.get().wrapping_add(1));
        self.is(Trouble::Lost) && self.count.get().is_multiple_of(3)
    }
}

/// The port of a bus, with what troubles its host.
struct Tapped {
    port: SimPort,
    tap: Rc<Tap>,
    /// Whether the motor is on this bus: only the clock is the same for all.
    is_here: bool,
}

impl CanPort for Tapped {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        let (mut frame, mut at) = self.port.receive()?;
        while self.is_here && self.tap.loses_one() {
            (frame, at) = self.port.receive()?;
        }
        if self.is_here
            && self.tap.is(Trouble::Short)
            && let [bytes @ .., _] = frame.bytes()
        {
            frame = CanFrame::data_frame(frame.id(), bytes).unwrap_or(frame);
        }
        Some((frame, at + Micros::new(self.tap.offset.get())))
    }

    fn submit_as(&mut self, frame: &CanFrame, stream: u32) -> Submitted {
        if self.is_here && self.tap.loses_one() {
            return Submitted::Queued;
        }
        self.port.submit_as(frame, stream)
    }

    fn cancel_pending(&mut self) -> u8 {
        self.port.cancel_pending()
    }

    fn health(&self) -> Health {
        self.port.health()
    }

    fn recover(&mut self) {
        if self.is_here && self.tap.back_at.get().is_none() {
            self.tap.back_at.set(Some(rc10_sim::now()));
        }
        self.port.recover();
    }
}

/// What was seen since a moment.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// The moment.
    pub since: Nanos,
    /// The last time at which the winding drove the shaft.
    pub drove: Nanos,
    /// The last time at which the bus followed the target.
    pub ran: Nanos,
    /// The greatest current, A, and speed, rpm, either way.
    pub peak: [f64; 2],
    /// The longest time between two commands to others on this bus and on another one, us.
    pub gaps: [u64; 2],
    last: [Micros; 2],
    /// Frames to DJI motors with a torque that left more than a tick after a stop.
    pub pushed: u32,
}

/// The bench.
pub struct Bench<'r> {
    /// The simulated world.
    pub world: World,
    /// The device.
    pub twin: Esc,
    /// Arms and stops all.
    pub switch: &'r ArmSwitch,
    /// What was seen since [`watch`](Self::watch).
    pub seen: Seen,
    model: &'r Model,
    double: Esc,
    wires: [Bus; 2],
    line: Line,
    faults: Faults,
    ports: &'r [BusPort; 2],
    runners: [Runner<'r, 'r, Tapped>; 2],
    rs485: Rs485Bus<'r>,
    /// The motor, and the others on this bus and on another one.
    ids: [MotorId; 3],
    tap: Rc<Tap>,
    arming: Arming,
    remote: Option<Stamped<Remote>>,
    clearing: Option<Pin<Box<dyn Future<Output = ()> + 'r>>>,
    /// When the switch of the remote was brought to where it disarms, to arm.
    gesture: Micros,
    /// When the motor was last given a target that is a number.
    pub commanded_at: Micros,
    /// Since when the robot is stopped or disarmed, with buses that run.
    pub stopped_at: Option<Micros>,
    /// When each that comes again and again is due.
    due: [Micros; 5],
    random: Random,
}

/// A sample of the true state.
const SAMPLE: u64 = 100_000;
/// What comes again and again, and how often: a DR16's frames, the task that arms, those that command, the RS-485
/// line's ticks, and what goes on going wrong.
const REMOTE: (usize, Micros) = (0, Micros::from_millis(14));
const ARMING: (usize, Micros) = (1, Micros::from_millis(10));
const COMMANDS: (usize, Micros) = (2, Micros::from_millis(5));
const LINE: (usize, Micros) = (3, Micros::from_millis(1));
const WRONG: (usize, Micros) = (4, Micros::from_millis(1));
/// What was handed over before a stop has left: a tick, and the way on the wire.
const LEFT: Micros = Micros::new(1_500);
/// How long the switch stays where it disarms.
const GESTURE: Micros = Micros::from_millis(80);
const OTHER: dji::Config = dji::Config::new(&dji::M3508, 4);

/// Does something with a bench for a model; all chance is from the seed. Fails if the motor or its
/// device cannot be made, or what is done fails.
pub fn on_bench<T>(
    model: &Model,
    seed: u64,
    work: impl FnOnce(&mut Bench<'_>) -> Result<T>,
) -> Result<T> {
    let (switch, ports) = (ArmSwitch::new(), [BusPort::new(), BusPort::new()]);
    let mut ours = made(&model.device)?;
    let mut others = [dji::Dji::new(OTHER)?, dji::Dji::new(OTHER)?];
    let mut world = World::new(seed);
    let mut random = Random::new(seed ^ 0x0F0F);
    let wires = [world.add_bus(BusConfig::default()), world.add_bus(BusConfig::default())];
    let line = world.add_line(Settings::default());
    let is_on_line = matches!(model.device.wiring(), Wiring::Line(_));
    let place = if is_on_line { Place::Line(1) } else { Place::Bus(1) };
    let plug = |device: Device, on, inertia| {
        let plant = Plant::inertia(inertia);
        Motor { plant, ..Motor::new("motor", on, device) }
            .plug_in(&wires, std::slice::from_ref(&line))
    };
    let (twin, double) =
        (plug(model.device, place, model.inertia)?, plug(model.device, place, model.inertia)?);
    double.set_cut(true);
    // So that what stops has something to stop.
    let plant = twin.plant();
    twin.set_load(-0.05 * plant.current_limit * plant.torque_constant);
    for bus in [1, 2] {
        plug(OTHER.device(), Place::Bus(bus), 0.02)?;
    }
    let mut rs485 = Rs485Bus::new(&switch).with_reply_timeout(Micros::new(200))?;
    let mut buses = [MotorBus::new(&switch), MotorBus::new(&switch)];
    let [first, second] = &mut buses;
    let motor = match &mut ours {
        Made::Can(motor) => first.attach(motor.as_mut(), Safety::COAST)?,
        Made::Line(motor) => rs485.attach(motor, Safety::COAST)?,
    };
    let [here, there] = &mut others;
    let ids = [motor, first.attach(here, Safety::COAST)?, second.attach(there, Safety::COAST)?];
    let tap = Rc::new(Tap::default());
    let [one, two] = buses;
    let tapped = |at: usize| Tapped {
        port: wires[at].port(),
        tap: Rc::clone(&tap),
        is_here: at == 0 && !is_on_line,
    };
    let runners = [
        Runner::new(tapped(0), one, &ports[0], Micros::ZERO),
        Runner::new(tapped(1), two, &ports[1], Micros::new(60)),
    ];
    let mut faults = Faults::new(&wires, std::slice::from_ref(&line), &[])?;
    faults.set_parts(Parts { motors: vec![("motor".into(), twin.clone())], ..Parts::default() });
    let due = [REMOTE, ARMING, COMMANDS, LINE, WRONG];
    let due = due.map(|(_, period)| Micros::new(random.below(period.get())));
    let mut bench = Bench {
        world,
        twin,
        switch: &switch,
        seen: Seen::default(),
        model,
        double,
        wires,
        line,
        faults,
        ports: &ports,
        runners,
        rs485,
        ids,
        tap,
        due,
        random,
        arming: Arming::new(ArmingConfig::DEFAULT),
        remote: None,
        clearing: None,
        gesture: Micros::ZERO,
        commanded_at: Micros::ZERO,
        stopped_at: None,
    };
    work(&mut bench)
}

impl Bench<'_> {
    /// Whether something is due; then it is again, a period later.
    fn is_due(&mut self, (at, period): (usize, Micros)) -> bool {
        let (now, due) = (self.world.now(), &mut self.due[at]);
        let is_due = now >= *due;
        if is_due {
            *due = now + period;
        }
        is_due
    }

    fn is(&self, trouble: Trouble) -> bool {
        self.tap.is(trouble)
    }

    fn is_on_line(&self) -> bool {
        matches!(self.model.device.wiring(), Wiring::Line(_))
    }

    /// The time as the robot reads it.
    fn own(&self) -> Micros {
        self.world.now() + Micros::new(self.tap.offset.get())
    }

    /// Lets time pass.
    pub fn pass(&mut self, until: Nanos) {
        while self.world.now_ns() < until {
            let sample = Nanos::new((self.world.now_ns().get() / SAMPLE + 1) * SAMPLE);
            let mut next = sample.min(until);
            if !self.is(Trouble::Blocked) {
                let offset = self.tap.offset.get();
                for runner in &self.runners {
                    let due =
                        runner.next().get().saturating_sub(offset).max(self.world.now().get());
                    next = next.min(Micros::new(due).into());
                }
                if self.is_on_line() {
                    next = next.min(self.world.next_event()).min(self.due[LINE.0].into());
                }
            }
            self.world.advance_to(next.max(self.world.now_ns() + Nanos::new(1)));
            if !self.is(Trouble::Blocked) {
                self.serve();
            }
            if self.world.now_ns() >= sample {
                self.work();
                self.look();
            }
        }
    }

    /// Lets so many milliseconds pass.
    pub fn wait(&mut self, millis: u64) {
        self.pass(self.world.now_ns() + Nanos::new(millis * 1_000_000));
    }

    /// The buses, as their executor runs them.
    fn serve(&mut self) {
        let own = self.own();
        for runner in &mut self.runners {
            while runner.next() <= own {
                runner.tick(|| own);
            }
        }
        if !self.is_on_line() {
            return;
        }
        let mut io = self.line.port();
        let received = io.take_received();
        self.rs485.on_bytes(&received, own);
        if self.is_due(LINE) {
            self.rs485.tick(own, Seconds::new(0.001));
        }
        while let Step::Send(bytes) = self.rs485.poll(own) {
            io.send(&bytes);
        }
    }

    /// The robot's tasks and its operator; and what goes on going wrong.
    fn work(&mut self) {
        let (now, own) = (self.world.now(), self.own());
        if self.is_due(REMOTE) {
            let disarms = self.is(Trouble::Disarm) || now.since(self.gesture) < GESTURE;
            let right_switch = if disarms { Switch::Down } else { Switch::Up };
            let value = Remote { right_switch, ..Remote::default() };
            if !self.is(Trouble::RemoteLost) {
                self.remote = Some(Stamped { value, at: own });
            }
        }
        if self.is_due(ARMING) && !self.is(Trouble::Hung) {
            let _ = self.arming.step(self.remote, self.switch, own);
        }
        if self.is_due(COMMANDS) && !self.is(Trouble::Hung) {
            if !self.is(Trouble::NotANumber) {
                self.commanded_at = now;
            }
            self.command();
        }
        if let Some(asked) = &mut self.clearing
            && asked.as_mut().poll(&mut Context::from_waker(Waker::noop())) != Poll::Pending
        {
            self.clearing = None;
        }
        if self.is_on_line() {
            // One that waits for its answer to be taken takes no other request.
            let _ = self.rs485.response(self.ids[0]);
        }
        if self.is_due(WRONG) {
            self.go_wrong();
        }
    }

    fn command(&mut self) {
        let own = self.own();
        let target = if self.is(Trouble::NotANumber) {
            match self.model.target {
                Target::TotalAngle(_) => Target::Angle(Degrees::new(f32::NAN)),
                _ => Target::Speed(Rpm::new(f32::NAN)),
            }
        } else {
            self.model.target
        };
        let [motor, here, there] = self.ids;
        // A refusal is what some troubles are about.
        if self.is_on_line() {
            let _ = self.rs485.command(motor, target, own);
        } else {
            let _ = self.ports[0].motor(motor).command(target);
        }
        let speed = Target::Speed(Rpm::new(100.0));
        let _ = self.ports[0].motor(here).command(speed);
        let _ = self.ports[1].motor(there).command(speed);
    }

    /// What is done again every millisecond while it lasts.
    fn go_wrong(&mut self) {
        if self.is(Trouble::Lost) && self.is_on_line() {
            let [ask, answer] = [0, 1].map(|_| u32::from(self.random.below(3) == 0));
            self.line.damage_commands(ask);
            self.line.damage_answers(answer);
        }
        if self.is(Trouble::Foreign) {
            let data = self.random.bits().to_le_bytes();
            match self.model.device.wiring() {
                Wiring::Line(_) => self.line.inject(&data),
                Wiring::Can(ids) => {
                    if let Some(frames) = ids.received().first() {
                        let id: Id = frames.pattern.id();
                        let bytes = data.get(..frames.len.into()).unwrap_or(&data);
                        let _ = CanFrame::data_frame(id, bytes).map(|it| self.wires[0].inject(&it));
                    }
                }
            }
        }
        let now = self.world.now();
        for (at, wire) in self.wires.iter().enumerate() {
            let trace = wire.take_trace();
            let others = |frame: &CanFrame| IdPattern::standard(0x200).matches(frame);
            for entry in trace.iter().filter(|it| it.from_controller && others(&it.frame)) {
                let gap = entry.at.since(self.seen.last[at]).get();
                self.seen.gaps[at] = self.seen.gaps[at].max(gap);
                self.seen.last[at] = entry.at;
                let is_late =
                    self.stopped_at.is_some_and(|stop| entry.start > (stop + LEFT).into());
                self.seen.pushed += u32::from(is_late && entry.frame.bytes() != [0; 8]);
            }
            self.seen.gaps[at] = self.seen.gaps[at].max(now.since(self.seen.last[at]).get());
            self.faults.heard(at, &trace);
        }
        let _ = self.faults.act(Nanos::new(now.get() / 1000 * 1_000_000));
    }

    fn look(&mut self) {
        let (now, state) = (self.world.now_ns(), self.twin.state());
        let is_stopped = matches!(self.switch.state(), ArmState::Disarmed | ArmState::EStopped);
        self.stopped_at = (is_stopped && !self.is(Trouble::Blocked))
            .then(|| self.stopped_at.unwrap_or(self.world.now()));
        if !(state.idle || state.open || state.shorted) {
            self.seen.drove = now;
        }
        if self.status().drive == DriveMode::Run {
            self.seen.ran = now;
        }
        for (peak, value) in self.seen.peak.iter_mut().zip([state.current, state.output_rpm]) {
            *peak = peak.max(value.abs());
        }
        if self.tap.off_at.get().is_none()
            && self.wires[0].port().health().state == ErrorState::BusOff
        {
            self.tap.off_at.set(Some(self.world.now()));
        }
    }

    /// Forgets what was seen before.
    pub fn watch(&mut self) {
        let (now, last) = (self.world.now_ns(), self.seen.last);
        self.seen = Seen { since: now, drove: now, ran: now, last, ..Seen::default() };
        self.tap.off_at.set(None);
        self.tap.back_at.set(None);
    }

    /// How long after the controller was off its bus it was sent back, us; infinite if it was not, NaN if it was not off.
    pub fn off_for(&self) -> f64 {
        match (self.tap.off_at.get(), self.tap.back_at.get()) {
            (None, _) => f64::NAN,
            (_, None) => f64::INFINITY,
            (Some(off), Some(back)) => back.since(off).get() as f64,
        }
    }

    /// The state of the motor as tasks see it.
    pub fn status(&self) -> MotorStatus {
        if self.is_on_line() {
            return self.rs485.status(self.ids[0], self.own()).unwrap_or(MotorStatus::NEW);
        }
        self.ports[0].motor(self.ids[0]).status()
    }

    /// Whether it is driven and turns at half its speed at least.
    fn turns(&self) -> bool {
        let rpm = self.twin.state().output_rpm;
        self.status().drive == DriveMode::Run && rpm > 0.5 * self.model.cruise
    }

    /// Waits until it turns, at most so long, and does by hand what has to be. The time that took, ms, `None` if it did
    /// not; whether it had to be armed, and its fault to be cleared.
    pub fn bring_back(&mut self, millis: u64) -> (Option<u64>, [bool; 2]) {
        let (mut arms, mut clears, began) = (false, false, self.world.now());
        for millisecond in 0..millis {
            if self.turns() {
                let took = self.world.now().since(began).get().div_ceil(1000);
                return (Some(took), [arms, clears]);
            }
            let is_stopped = matches!(self.switch.state(), ArmState::Disarmed | ArmState::EStopped);
            if is_stopped && self.world.now().since(self.gesture) > Micros::from_millis(300) {
                (self.gesture, arms) = (self.world.now(), true);
            }
            if millisecond % 100 == 50 && self.status().fault.is_some() {
                clears = true;
                self.clear_fault();
            }
            self.wait(1);
        }
        (None, [arms, clears])
    }

    fn clear_fault(&mut self) {
        if self.is_on_line() {
            let _ = self.rs485.request(self.ids[0], Request::ClearFault);
            return;
        }
        let (ports, motor) = (self.ports, self.ids[0]);
        self.clearing = Some(Box::pin(async move {
            let _ = ports[0].motor(motor).request(Request::ClearFault).await;
        }));
    }

    /// Begins a trouble, or ends it. Whether there is such a one for this motor.
    pub fn set(&mut self, trouble: Trouble, begins: bool) -> bool {
        self.tap.going.borrow_mut().retain(|it| *it != trouble);
        if begins {
            self.tap.going.borrow_mut().push(trouble);
        }
        match trouble {
            Trouble::Fault(text) => {
                let wire = if self.is_on_line() { "L1" } else { "1" };
                let Ok(fault) = format!("{}@1s", text.replace('*', wire)).parse::<Fault>() else {
                    return false;
                };
                let now = self.world.now_ns();
                self.faults.plan(now, begins, fault.kind);
                let _ = self.faults.act(now);
            }
            Trouble::Lost => {
                self.line.damage_commands(0);
                self.line.damage_answers(0);
            }
            Trouble::Short => return !self.is_on_line(),
            Trouble::Double => self.double.set_cut(!begins),
            Trouble::Reported if begins => return self.twin.inject(EscFault::OverTemperature),
            Trouble::Reported => {
                self.twin.set_power(false);
                self.wait(20);
                self.twin.set_power(true);
            }
            Trouble::Stop if begins => self.switch.emergency_stop(),
            Trouble::Jump if begins => self.tap.offset.set(self.tap.offset.get() + 1_000_000),
            _ => {}
        }
        true
    }

    /// Ends all.
    pub fn heal(&mut self) {
        while let Some(trouble) = { self.tap.going.borrow().last().copied() } {
            self.set(trouble, false);
        }
    }
}
