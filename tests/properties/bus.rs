//! A bus of motors, under every sequence of events.

use proptest::array::uniform8;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::TestCaseResult;
use rc10_app::{Amps, Rpm, Seconds};
use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id};
use rc10_motor::dji::{Dji, Effort};
use rc10_motor::{
    ArmState, ArmSwitch, CanMotor, Dispatch, DriveMode, Feedback, FrameError, Gains, Link, Motor,
    MotorBus, MotorId, Ownership, Request, SafeState, Safety, Target, TargetError, Tick, TxBatch,
};
use rc10_time::Micros;

use super::any;

#[derive(Clone, Debug)]
enum Event {
    /// A frame with this motor's feedback identifier.
    Feedback(usize, [u8; 8]),
    /// The same, but not what it should be.
    Broken(usize, Breakage, [u8; 8]),
    Frame(CanFrame),
    Command(usize, Target),
    Request(usize, Request),
    Arm,
    Disarm,
    Stop,
    Reset,
    Tick(f32),
    /// Microseconds that pass; below zero, the clock is set back.
    Time(i64),
}

#[derive(Clone, Copy, Debug)]
enum Breakage {
    Short(usize),
    Remote,
    Extended,
    /// An angle of 8192 or more.
    Angle,
}

fn event() -> impl Strategy<Value = Event> {
    let which = || 0..8_usize;
    let bytes = || uniform8(any::<u8>());
    let breakage = prop_oneof![
        (0..8_usize).prop_map(Breakage::Short),
        Just(Breakage::Remote),
        Just(Breakage::Extended),
        Just(Breakage::Angle),
    ];
    let time = prop_oneof![
        20 => 0..2_000_i64,
        2 => 0..200_000_i64,
        1 => -100_000..0_i64,
        1 => -(1 << 33)..(1_i64 << 33),
    ];
    let dt = prop_oneof![4 => Just(0.001), 1 => any::number()];
    const SIMPLE: [Event; 6] =
        [Event::Arm, Event::Arm, Event::Arm, Event::Disarm, Event::Stop, Event::Reset];
    prop_oneof![
        6 => (which(), bytes()).prop_map(|(motor, bytes)| Event::Feedback(motor, bytes)),
        1 => (which(), breakage, bytes()).prop_map(|(motor, how, bytes)| Event::Broken(motor, how, bytes)),
        1 => any::frame().prop_map(Event::Frame),
        4 => (which(), any::target()).prop_map(|(motor, target)| Event::Command(motor, target)),
        1 => (which(), any::request()).prop_map(|(motor, request)| Event::Request(motor, request)),
        2 => select(&SIMPLE[..]),
        6 => dt.prop_map(Event::Tick),
        4 => time.prop_map(Event::Time),
    ]
}

/// The test's model of a motor on the bus.
struct Known {
    id: MotorId,
    feedback_id: Id,
    command: (Id, usize),
    voltage: bool,
    full_scale: i16,
    /// Largest raw command: full scale, or what a request lowered it to.
    most: f32,
    coasts: bool,
    heard: bool,
}

fn known(motor: &Dji, id: MotorId, safety: Safety) -> Known {
    let wiring = motor.can_ids();
    let Ownership::Bytes(lane) = wiring.transmitted()[0].ownership else { panic!("a lane") };
    let lane = lane.trailing_zeros();
    Known {
        id,
        feedback_id: wiring.received()[0].pattern.id(),
        command: (wiring.transmitted()[0].pattern.id(), usize::try_from(lane).unwrap()),
        voltage: motor.model().effort == Effort::Voltage,
        full_scale: motor.model().full_scale,
        most: motor.model().full_scale.into(),
        coasts: safety.state == SafeState::Coast,
        heard: false,
    }
}

/// The bus, with all that is expected of it.
struct Bench<'m> {
    switch: &'m ArmSwitch,
    bus: MotorBus<'m>,
    known: Vec<Known>,
    now: u64,
}

const START: u64 = 1 << 40;

impl<'m> Bench<'m> {
    /// Attaches those that can be; the others must be refused.
    fn new(
        motors: &'m mut [Dji],
        safe: SafeState,
        switch: &'m ArmSwitch,
    ) -> Result<Self, TestCaseError> {
        let mut bench = Self { switch, bus: MotorBus::new(switch), known: Vec::new(), now: START };
        let safety = Safety::new(safe);
        for motor in motors {
            let known = known(
                motor,
                rc10_motor::numbers([rc10_motor::Place::Bus(1); 9]).nth(bench.known.len()).unwrap(),
                safety,
            );
            let free = bench.known.len() < 8
                && bench.known.iter().all(|other| {
                    other.feedback_id != known.feedback_id && other.command != known.command
                });
            let attached = bench.bus.attach(motor, safety);
            prop_assert_eq!(attached.is_ok(), free);
            if let Ok(id) = attached {
                prop_assert_eq!(id, known.id);
                bench.known.push(known);
            }
        }
        Ok(bench)
    }

    fn now(&self) -> Micros {
        Micros::new(self.now)
    }

    fn feedback(&self) -> Vec<Feedback> {
        let status = |known: &Known| self.bus.status(known.id, self.now()).unwrap().feedback;
        self.known.iter().map(status).collect()
    }

    fn happen(&mut self, event: &Event) -> TestCaseResult {
        match *event {
            Event::Feedback(which, mut bytes) => {
                bytes[0] &= 0x1F;
                let id = self.some(which).feedback_id;
                self.receive(&CanFrame::eight_bytes(id, bytes))?;
            }
            Event::Broken(which, how, mut bytes) => {
                let id = self.some(which).feedback_id;
                let frame = match (how, id) {
                    (Breakage::Short(len), _) => CanFrame::data_frame(id, &bytes[..len]).unwrap(),
                    (Breakage::Remote, _) => CanFrame::remote_frame(id, 8).unwrap(),
                    (Breakage::Extended, Id::Standard(id)) => {
                        let id = ExtendedId::new(id.as_raw().into()).unwrap();
                        CanFrame::eight_bytes(id, bytes)
                    }
                    _ => {
                        bytes[0] |= 0x20;
                        CanFrame::eight_bytes(id, bytes)
                    }
                };
                self.receive(&frame)?;
            }
            Event::Frame(frame) => self.receive(&frame)?,
            Event::Command(which, target) => self.command(which, target)?,
            Event::Request(which, request) => self.request(which, request)?,
            Event::Arm => drop(self.switch.arm()),
            Event::Disarm => self.switch.disarm(),
            Event::Stop => self.switch.emergency_stop(),
            Event::Reset => self.switch.reset(),
            Event::Tick(dt) => self.tick(dt).map(drop)?,
            Event::Time(step) => self.now = self.now.saturating_add_signed(step),
        }
        for feedback in self.feedback() {
            check_feedback(&feedback)?;
        }
        Ok(())
    }

    fn some(&self, which: usize) -> &Known {
        &self.known[which % self.known.len()]
    }

    /// A frame reaches the motor whose feedback it is, and no other.
    fn receive(&mut self, frame: &CanFrame) -> TestCaseResult {
        let owner = self
            .known
            .iter()
            .position(|known| known.feedback_id == frame.id() && !frame.is_remote());
        let expected = match owner.map(|index| self.known[index].id) {
            None => Dispatch::Unclaimed,
            Some(id) => match frame.all_eight() {
                None => Dispatch::Malformed(id, FrameError::Length),
                Some(bytes) if bytes[0] > 0x1F => Dispatch::Malformed(id, FrameError::Encoder),
                Some(_) => Dispatch::Motor(id),
            },
        };
        let mut before = self.feedback();
        prop_assert_eq!(self.bus.on_frame(frame, self.now()), expected);
        let after = self.feedback();
        if let (Dispatch::Motor(_), Some(index)) = (expected, owner) {
            self.known[index].heard = true;
            prop_assert_eq!(after[index].at, self.now());
            before[index] = after[index];
        }
        prop_assert_eq!(before, after);
        Ok(())
    }

    /// A target that is not finite, or not for this motor, is refused, and the old one stays.
    fn command(&mut self, which: usize, target: Target) -> TestCaseResult {
        let now = self.now();
        let Known { id, voltage, .. } = *self.some(which);
        let (supported, finite) = match target {
            Target::Coast | Target::TotalAngle(_) => (true, true),
            Target::Current(amps) => (!voltage, amps.get().is_finite()),
            Target::Duty(duty) => (voltage, duty.is_finite()),
            Target::Speed(rpm) => (true, rpm.get().is_finite()),
            Target::Angle(degrees) => (true, degrees.get().is_finite()),
            Target::Motion(motion) => (true, motion.is_finite()),
            _ => (false, false),
        };
        let before = self.bus.status(id, now).unwrap().target;
        let outcome = self.bus.command(id, target, now);
        let after = self.bus.status(id, now).unwrap().target;
        if supported && finite {
            prop_assert_eq!(outcome, Ok(()));
            prop_assert_eq!(after, target);
        } else {
            let error = if supported { TargetError::NotFinite } else { TargetError::Unsupported };
            prop_assert_eq!(outcome, Err(rc10_motor::CommandError::Target(error(target.kind()))));
            prop_assert_eq!(after, before);
        }
        Ok(())
    }

    fn request(&mut self, which: usize, request: Request) -> TestCaseResult {
        let index = which % self.known.len();
        let known = &mut self.known[index];
        let finite = |gains: Gains| {
            [gains.kp, gains.ki, gains.kd].iter().all(|gain| gain.is_finite() && *gain >= 0.0)
        };
        let granted = match request {
            Request::SetZeroOfDriven => known.heard,
            Request::CurrentLimit(amps) => !known.voltage && amps.get() >= 0.0,
            Request::SpeedGains(gains) | Request::AngleGains(gains) => finite(gains),
            _ => false,
        };
        prop_assert_eq!(self.bus.request(known.id, request).is_ok(), granted, "{:?}", request);
        if let (Request::CurrentLimit(amps), true) = (request, granted) {
            let full = f32::from(known.full_scale);
            let full_amps = match known.full_scale {
                10000 => 10.0,
                _ if self.bus.motors().nth(index).unwrap().1.model.starts_with("M3508") => 20.0,
                _ => 3.0,
            };
            known.most = (amps.get() / full_amps * full).min(full);
        }
        Ok(())
    }

    /// The frames of one tick, which are well-formed and never ask for more than they may.
    fn tick(&mut self, dt: f32) -> Result<Vec<CanFrame>, TestCaseError> {
        let mut tx = TxBatch::new();
        prop_assert_eq!(self.bus.tick(self.now(), Seconds::new(dt), &mut tx), Ok(()));
        let mut unclaimed: Vec<(Id, usize)> = Vec::new();
        for (index, frame) in tx.frames().iter().enumerate() {
            prop_assert!(frame.all_eight().is_some() && !frame.is_extended_id(), "{}", frame);
            prop_assert!(tx.frames()[..index].iter().all(|other| other.id() != frame.id()));
            unclaimed.extend([0, 2, 4, 6].map(|lane| (frame.id(), lane)));
        }
        let raw = |(id, lane): (Id, usize)| {
            let frame = tx.frames().iter().find(|frame| frame.id() == id)?;
            Some(i16::from_be_bytes([frame.bytes()[lane], frame.bytes()[lane + 1]]))
        };
        for known in &self.known {
            let Some(raw) = raw(known.command) else {
                return Err(TestCaseError::fail("a motor sends nothing"));
            };
            unclaimed.retain(|lane| *lane != known.command);
            let most = known.most + 0.51;
            prop_assert!(f32::from(raw).abs() <= most, "{} above {}", raw, most);
            let drive = self.bus.status(known.id, self.now()).unwrap().drive;
            let must_rest = match self.switch.state() {
                ArmState::Disarmed => true,
                ArmState::Armed => !known.heard,
                ArmState::Suspended | ArmState::EStopped => !known.heard || known.coasts,
            };
            if must_rest {
                prop_assert_eq!(raw, 0, "{:?}", drive);
                prop_assert!(matches!(drive, DriveMode::Off | DriveMode::Coast));
            }
        }
        // Lanes without a motor are zero.
        prop_assert!(unclaimed.into_iter().all(|lane| raw(lane) == Some(0)));
        Ok(tx.frames().to_vec())
    }
}

fn check_feedback(feedback: &Feedback) -> TestCaseResult {
    let numbers = [
        Some(feedback.speed.get()),
        Some(feedback.total_angle.degrees().get()),
        feedback.current().map(|amps| amps.get()),
        feedback.torque().map(|torque| torque.get()),
        feedback.temperature().map(|celsius| celsius.get()),
    ];
    prop_assert!(numbers.iter().flatten().all(|number| number.is_finite()), "{:?}", feedback);
    prop_assert!((0.0..360.0).contains(&feedback.angle.get()), "{:?}", feedback);
    // Both angles are one, as long as microdegrees can tell.
    let within = feedback.total_angle.within_turn().get();
    let apart = (within - feedback.angle.get()).abs();
    let told = feedback.total_angle.microdegrees().unsigned_abs() < u64::MAX / 2;
    prop_assert!(!told || apart.min(360.0 - apart) < 0.01, "{:?}", feedback);
    Ok(())
}

fn safe_state() -> impl Strategy<Value = SafeState> {
    select(vec![SafeState::Coast, SafeState::Brake, SafeState::Hold])
}

proptest! {
    #![proptest_config(any::cases(2000))]

    #[test]
    fn a_bus_stays_sane_whatever_happens(
        mut motors in vec(any::motor(), 1..10),
        safe in safe_state(),
        events in vec(event(), 1..150),
    ) {
        let switch = ArmSwitch::new();
        let mut bench = Bench::new(&mut motors, safe, &switch)?;
        for event in &events {
            bench.happen(event)?;
        }
        switch.reset();
        switch.disarm();
        for frame in bench.tick(0.001)? {
            prop_assert_eq!(frame.bytes(), [0; 8]);
        }
    }

    /// Nothing a motor went through is remembered as NaN or infinity: with its own gains again it
    /// goes to full scale when it stands although it shall turn.
    #[test]
    fn a_motor_recovers_from_everything(
        motor in any::stock_motor(),
        events in vec(event(), 1..60),
    ) {
        let model = motor.model();
        let mut motors = [motor];
        let switch = ArmSwitch::new();
        let mut bench = Bench::new(&mut motors, SafeState::Brake, &switch)?;
        for event in &events {
            bench.happen(event)?;
        }
        switch.reset();
        prop_assert_eq!(switch.arm(), Ok(()));
        let speed = model.cascade.speed;
        let gains = Gains { kp: speed.kp, ki: speed.ki, kd: speed.kd };
        let no_limit = Request::CurrentLimit(Amps::new(f32::INFINITY));
        if !bench.known[0].voltage {
            bench.request(0, no_limit)?;
        }
        bench.request(0, Request::SpeedGains(gains))?;
        bench.happen(&Event::Time(1000))?;
        let mut raw = 0;
        // Its speed reference may have far to go.
        for _ in 0..200_000 {
            bench.now += 1000;
            let standing = CanFrame::eight_bytes(bench.known[0].feedback_id, [0; 8]);
            bench.bus.on_frame(&standing, bench.now());
            let now = bench.now();
            bench.bus.command(bench.known[0].id, Target::Speed(Rpm::new(1e6)), now).unwrap();
            let mut tx = TxBatch::new();
            bench.bus.tick(now, Seconds::new(0.001), &mut tx).unwrap();
            let lane = bench.known[0].command.1;
            let bytes = tx.frames()[0].bytes();
            raw = i16::from_be_bytes([bytes[lane], bytes[lane + 1]]);
            if raw == model.full_scale {
                break;
            }
        }
        prop_assert_eq!(raw, model.full_scale);
    }

    /// Without a bus around it that sees to its times and its permission to drive.
    #[test]
    fn a_motor_alone_stays_within_its_scale(
        mut motor in any::motor(),
        steps in vec(
            (1e-6..=1.0_f32, any::target(), any::request(), uniform8(any::<u8>()), 0..5_usize),
            1..60,
        ),
        times in vec(0..1_u64 << 62, 60),
    ) {
        let id = motor.can_ids().received()[0].pattern.id();
        let drives = [DriveMode::Run, DriveMode::Hold, DriveMode::Brake, DriveMode::Coast, DriveMode::Off];
        for ((dt, target, request, mut bytes, drive), time) in steps.into_iter().zip(times) {
            bytes[0] &= 0x1F;
            let at = Micros::new(time);
            prop_assert!(motor.unpack_feedback(&CanFrame::eight_bytes(id, bytes), at, Link::Online).is_ok());
            let _ = motor.set_target(target);
            let _ = motor.request(request);
            motor.update(&Tick { dt: Seconds::new(dt), ..Tick::new(drives[drive]) });
            let full = motor.model().full_scale;
            prop_assert!((-full..=full).contains(&motor.raw_command()));
            prop_assert!(drive < 3 || motor.raw_command() == 0);
            check_feedback(&motor.feedback())?;
            let mut tx = TxBatch::new();
            prop_assert_eq!(motor.coast_frames(&mut tx), Ok(()));
            prop_assert_eq!(tx.frames()[0].bytes(), [0; 8]);
        }
    }
}
