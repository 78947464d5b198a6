//! A GO-M8010-6 behind Unitree's CAN-to-485 module, as a motor on a CAN bus.
//!
//! **Who controls.** The module keeps stiffness and damping ("gains") for each of its motors, and
//! forgets them without power. Speeds, angles and torques are controlled here, by a [`Servo`], with
//! both zero in the module: each frame then says all there is to say. For [`Target::Impedance`] the
//! module gets the target's `kp` and `kd`, and the motor runs the law itself, at its own rate.
//!
//! **Set-up.** Disarmed, the motor is asked how it is with status 0 (lock). Armed, the module is
//! given the gains, then asked for them; once it answers with what it was given, the motor is put
//! into field-oriented control; once it says so, it is driven, softly: from the fourth tick on at
//! best. Until then its condition is [`Condition::Starting`] and it has no torque. The same happens
//! when the gains change, when the motor was silent for 10 ms, when it is found locked, and when
//! the module is found without its gains (asked 20 times a second during an impedance).
//!
//! **One frame a tick.** A module puts gains on its line after the motion of the same tick,
//! because identifiers go out in order. All frames of a motor are one stream: a newer one takes
//! the place of one that still waits.
//!
//! ```
//! use rc10_motor::unitree::GoModule;
//! use rc10_motor::{ArmSwitch, Impedance, MotorBus, Safety, Target};
//! use rc10_motor::rc10_app::Degrees;
//! use rc10_motor::rc10_can::Micros;
//!
//! let switch = ArmSwitch::new();
//! // Both behind the module with switches 1 and 2 on, as it is sold.
//! let mut hip = GoModule::new(3, 0)?;
//! let mut knee = GoModule::new(3, 1)?;
//! let mut bus = MotorBus::new(&switch);
//! let hip = bus.attach(&mut hip, Safety::HOLD)?;
//! let knee = bus.attach(&mut knee, Safety::HOLD)?;
//! let spring = Impedance { angle: Degrees::new(30.0), kp: 20.0, kd: 0.5, ..Impedance::default() };
//! bus.command(hip, Target::Impedance(spring), Micros::ZERO)?;
//! bus.command(knee, Target::Angle(Degrees::new(45.0)), Micros::ZERO)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod impedance;
mod sequence;
mod turns;

use embedded_can::{ExtendedId, Id};
use rc10_app::{
    Celsius, ConfigError, CountsPerTurn, NewtonMetres, PidConfig, Rpm, RpmPerSecond, Seconds,
    TotalAngle,
};
use rc10_can::{CanFrame, IdPattern, Micros};

use self::sequence::{NONE, Sequence};
use self::turns::Turns;
use super::wire::module::{Content, Module, Reply};
use super::wire::{self, Address, Motion, RawMotion, ReplyError, Shaft};
use crate::batch::{TxBatch, TxFull};
use crate::motor::{
    CanMotor, Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Impedance, Loops,
    Motor, Request, RequestError, Response, Target, TargetError, TargetKind, TargetSet,
};
use crate::servo::{Measured, Servo};
use crate::wiring::{CanIds, Ownership, Rate, RxFrames, TxFrames};
use rc10_app::Cascade;
use rc10_app::Direction;

/// Largest torque, N m (data manual: 23.7 at the output shaft).
const LARGEST_TORQUE: f32 = 23.7;
/// Silent for longer, a motor may be another one when it is back: as its
/// [`link_timeout`](CanIds::link_timeout).
const LINK_TIMEOUT: Micros = Micros::from_millis(10);
/// The same in seconds, and half a tick for rounding.
const LINK_TIMEOUT_SECONDS: f32 = 0.010_5;
/// The bits of an identifier that say whose it is, in either direction: module, direction, motor.
const WHOSE: u32 = 0x1C00_0F00;
/// What is sent to a motor also leaves bits 25 and 24 zero, and the lowest byte.
const TO_MOTOR: u32 = 0x1F00_0FFF;
const FROM_MODULE: u32 = 1 << 26;

/// Gains it works well with out of the box, from a bare shaft to a load of 0.02 kg m², give or take
/// 30 %. Found in simulation with estimated inertia and friction; no real motor has been driven.
pub const CASCADE: Cascade = Cascade {
    speed: PidConfig::new(0.12, 0.8, 0.0, LARGEST_TORQUE),
    angle: PidConfig::new(1.0, 0.0, 0.0, 200.0),
    outer_divider: 1,
    acceleration: RpmPerSecond::new(800.0),
    feed_forward: 0.0,
};

/// By the module's number.
const NAMES: [&str; 4] = [
    "GO-M8010-6 behind module 0,",
    "GO-M8010-6 behind module 1,",
    "GO-M8010-6 behind module 2,",
    "GO-M8010-6 behind module 3,",
];

/// A GO-M8010-6 behind a CAN-to-485 module.
#[derive(Clone, Debug)]
pub struct GoModule {
    module: Module,
    address: Address,
    /// Module, direction and motor of its answers, in place.
    whose: u32,
    /// 1 or -1.
    sign: i8,
    heard: bool,
    drive: DriveMode,
    sequence: Sequence,
    servo: Servo,
    /// What was asked for last; [`Servo`] has it too, unless it is an impedance.
    target: Target,
    /// Where the impedance's spring pulls to, microdegrees.
    spring: i64,
    /// How much of the torque limit an impedance may use, 0 ..= 1: it starts softly.
    share: f32,
    /// Seconds without feedback, by the ticks.
    silence: f32,
    /// What is sent when a motion is.
    command: RawMotion,
    fault: Option<Fault>,
    turns: Turns,
    seen: Seen,
}

/// What the newest feedback told.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    at: Micros,
    raw: RawMotion,
    temperature: Celsius,
    /// Of the output, in the motor's own direction: rpm.
    rpm: f32,
}

impl GoModule {
    /// The motor with number `motor` (0 ..= 14) behind module `module` (0 ..= 3, by its switches 1
    /// and 2; 3 as it is sold), turning forward, with [`CASCADE`].
    ///
    /// # Errors
    /// [`ConfigError`], naming the number that no device has.
    pub fn new(module: u8, motor: u8) -> Result<Self, ConfigError> {
        let refuse = |field, value: u8, must_be| ConfigError::new(field, value.into(), must_be);
        let address =
            Address::new(motor).ok_or(refuse("motor", motor, "0 to 14 (15 is every motor)"))?;
        let module = Module::new(module).ok_or(refuse("module", module, "0 to 3"))?;
        let whose = u32::from(module.get()) << 27 | FROM_MODULE | u32::from(address.get()) << 8;
        Ok(Self {
            module,
            address,
            whose,
            sign: 1,
            heard: false,
            drive: DriveMode::Off,
            sequence: Sequence::new(),
            servo: Servo::new(TargetKind::Torque, CASCADE)?,
            target: Target::Coast,
            spring: 0,
            share: 0.0,
            silence: 0.0,
            command: RawMotion::default(),
            fault: None,
            turns: Turns::default(),
            seen: Seen::default(),
        })
    }

    /// Turning the given way.
    #[must_use]
    pub const fn with_direction(mut self, direction: Direction) -> Self {
        self.sign = direction.sign();
        self
    }

    /// With gains of your own; the speed loop's output limit is the largest torque, N m.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used.
    pub fn with_cascade(mut self, cascade: Cascade) -> Result<Self, ConfigError> {
        let (name, id) = (self.name(), self.address.get().into());
        let named = |error: ConfigError| error.of_device(name, id);
        let most = cascade.speed.output_limit;
        if most > LARGEST_TORQUE {
            let must_be = "at most 23.7, which is what the motor can give";
            let error = ConfigError::new("output_limit", most, must_be);
            return Err(named(error.in_part("speed")));
        }
        self.servo = Servo::new(TargetKind::Torque, cascade).map_err(named)?;
        Ok(self)
    }

    fn name(&self) -> &'static str {
        NAMES.get(usize::from(self.module.get())).copied().unwrap_or("GO-M8010-6")
    }

    /// The module it is behind.
    #[must_use]
    pub const fn module(&self) -> Module {
        self.module
    }

    /// Its number on the module's line.
    #[must_use]
    pub const fn address(&self) -> Address {
        self.address
    }

    fn measured(&self) -> Option<Measured> {
        let microdegrees = self.turns.microdegrees();
        self.heard.then_some(Measured { rpm: self.seen.rpm, microdegrees })
    }

    /// The impedance it shall have now, if the module is to make it.
    fn impedance(&self) -> Option<Impedance> {
        match self.target {
            Target::Impedance(impedance) if self.drive == DriveMode::Run => Some(impedance),
            _ => None,
        }
    }

    /// Whatever drives next starts softly.
    fn rest(&mut self) {
        self.servo.rest();
        self.share = 0.0;
    }

    /// The frame for a motion, in the motor's own direction, with the torque in N m. What the
    /// module has for stiffness and damping does nothing at the measured angle and speed.
    fn motion(&self, torque: f32, rpm: f32, angle: i32) -> RawMotion {
        let sign = f32::from(self.sign);
        Shaft::OUTPUT.raw(&Motion {
            torque: NewtonMetres::new(torque * sign),
            speed: Rpm::new(rpm * sign),
            angle: TotalAngle::new(angle.into(), Shaft::OUTPUT.scale()),
        })
    }

    /// How it is now.
    #[inline]
    fn see(&mut self, raw: RawMotion, temperature: Celsius, at: Micros) {
        let Self { seen, turns, sign, .. } = self;
        let silence = at.since(seen.at);
        if core::mem::replace(&mut self.heard, true) {
            if silence > LINK_TIMEOUT {
                self.sequence.stop();
            }
            // 1/256 of a turn a second are 128 steps a second: twice the mean, half as many.
            let speed = (i32::from(seen.raw.speed) + i32::from(raw.speed)) * 64;
            turns.follow(seen.raw.angle, raw.angle, (*sign).into(), speed, silence);
        } else {
            turns.begin(raw.angle, (*sign).into());
        }
        let rpm = Shaft::OUTPUT.motion(raw).speed.get() * f32::from(*sign);
        *seen = Seen { at, raw, temperature, rpm };
        self.silence = 0.0;
    }

    /// The pattern of identifiers that agree with this one where the mask has ones.
    fn pattern(id: u32, mask: u32) -> IdPattern {
        IdPattern::masked(ExtendedId::new(id).unwrap_or(ExtendedId::ZERO), mask)
    }

    /// What all frames to the motor have in common.
    const fn stream(&self) -> u32 {
        self.whose ^ FROM_MODULE
    }

    fn send(&self, request: &wire::module::Request, tx: &mut TxBatch) -> Result<(), TxFull> {
        let stream = ExtendedId::new(self.stream()).unwrap_or(ExtendedId::ZERO);
        let key = CanFrame::key_of(Id::Extended(stream));
        tx.push_as(request.pack(self.module, self.address), key)
    }
}

impl Motor for GoModule {
    fn loops(&self) -> Option<Loops> {
        Some(self.servo.loops())
    }

    fn supports(&self) -> TargetSet {
        use TargetKind::{Angle, Coast, Impedance, Speed, Torque, TotalAngle};
        TargetSet::of(&[Coast, Torque, Speed, Angle, TotalAngle, Impedance])
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        match &target {
            // The usual case is the same target again.
            Target::Impedance(_) if target == self.target => (),
            Target::Impedance(impedance) => {
                self.supports().accepts(&target)?;
                self.spring = Self::check(impedance)?;
            }
            _ => self.servo.set_target(target)?,
        }
        self.target = target;
        Ok(())
    }

    fn target(&self) -> Target {
        self.target
    }

    fn feedback(&self) -> Feedback {
        let Seen { at, raw, temperature, rpm } = self.seen;
        if !self.heard {
            return Feedback::NEW;
        }
        let total = TotalAngle::new(self.turns.microdegrees(), CountsPerTurn::MICRODEGREES);
        let torque = Shaft::OUTPUT.motion(raw).torque.get() * f32::from(self.sign);
        let mut feedback = Feedback::new(at, Rpm::new(rpm), self.turns.within_turn(), total)
            .with_torque(NewtonMetres::new(torque))
            .with_temperature(temperature);
        feedback.turn_gaps = self.turns.gaps();
        feedback
    }

    fn fault(&self) -> Option<Fault> {
        self.fault
    }

    fn update(&mut self, dt: Seconds, drive: DriveMode) {
        self.drive = drive;
        self.silence = (self.silence + dt.get()).min(1.0);
        let lost = self.silence > LINK_TIMEOUT_SECONDS;
        if drive == DriveMode::Off || lost || self.fault.is_some() {
            self.sequence.stop();
            self.rest();
            return;
        }
        let impedance = self.impedance();
        let wanted = impedance.map_or(NONE, |Impedance { kp, kd, .. }| {
            Shaft::OUTPUT.raw_impedance(&wire::Impedance { stiffness: kp, damping: kd })
        });
        self.sequence.advance(wanted);
        self.command = if !self.sequence.is_following() {
            self.rest();
            self.motion(0.0, self.seen.rpm, self.seen.raw.angle)
        } else if let Some(impedance) = impedance {
            self.servo.rest();
            self.pull(&impedance, dt)
        } else {
            self.share = 0.0;
            let torque = self.servo.update(dt, drive, self.measured());
            self.motion(torque, self.seen.rpm, self.seen.raw.angle)
        };
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        match request {
            Request::SetZero if !self.heard => return Err(RequestError::NoFeedback),
            Request::SetZero => {
                let zero = self.turns.set_zero();
                self.servo.set_zero(zero);
                self.spring = self.spring.saturating_sub(zero);
                // What is sought stays where it is; the same number commanded again does not.
                self.target = match self.target {
                    Target::Impedance(impedance) => {
                        let angle = TotalAngle::from_microdegrees(self.spring).degrees();
                        Target::Impedance(Impedance { angle, ..impedance })
                    }
                    _ => self.servo.target(),
                };
            }
            Request::ClearFault => self.fault = None,
            _ => return self.servo.request(request, self.measured()),
        }
        Ok(Response::Done)
    }

    fn condition(&self) -> Condition {
        if self.drive == DriveMode::Off || self.sequence.is_following() {
            Condition::Ready
        } else {
            Condition::Starting
        }
    }
}

impl CanMotor for GoModule {
    fn wiring(&self) -> CanIds {
        let (answers, commands) = (self.whose, self.stream());
        let everybody =
            u32::from(self.module.get()) << 27 | u32::from(Address::BROADCAST.get()) << 8;
        // One pattern for state, fault and gains: a bus has room for eight that are masked.
        let receive = RxFrames {
            pattern: Self::pattern(answers, WHOSE),
            len: 8,
            rate: Rate::EveryTick,
            guard: None,
        };
        let transmit = TxFrames {
            pattern: Self::pattern(commands, TO_MOTOR),
            len: 8,
            rate: Rate::EveryTick,
            share: Ownership::Whole,
        };
        let wiring = CanIds::new(self.name(), self.address.get().into());
        let wired = wiring
            .clone()
            .receives(receive)
            .and_then(|wiring| wiring.transmits(transmit))
            .and_then(|wiring| wiring.listens_to(Self::pattern(commands, WHOSE)))
            .and_then(|wiring| wiring.listens_to(Self::pattern(everybody, WHOSE)));
        wired.unwrap_or(wiring)
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError> {
        if frame.raw_id() & WHOSE != self.whose {
            return Err(FrameError::NotMine);
        }
        let reply = Reply::unpack(frame).map_err(|error| match error {
            ReplyError::Length => FrameError::Length,
            ReplyError::Content(_) => FrameError::Unexpected,
            _ => FrameError::NotMine,
        })?;
        match reply.content {
            Content::State { status, motion, temperature, .. } => {
                self.see(motion, temperature, at);
                self.sequence.on_state(status);
                Ok(FrameKind::Feedback)
            }
            Content::Fault { .. } => {
                self.fault = reply.fault();
                Ok(FrameKind::Fault)
            }
            Content::Impedance(has) if self.sequence.on_impedance(has) => Ok(FrameKind::Other),
            Content::Impedance(_) => Err(FrameError::Unasked),
        }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.send(&self.sequence.request(self.command), tx)
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.send(&Sequence::new().request(RawMotion::default()), tx)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Seconds = Seconds::new(0.001);

    /// What a tick sends.
    fn tick(motor: &mut GoModule, drive: DriveMode) -> u32 {
        motor.update(MS, drive);
        let mut tx = TxBatch::new();
        motor.pack_command(&mut tx).unwrap();
        assert_eq!(tx.entries().next().map(|(_, stream)| stream), Some(tx_stream(motor)));
        tx.frames()[0].raw_id()
    }

    fn tx_stream(motor: &GoModule) -> u32 {
        CanFrame::key_of(motor.wiring().transmitted()[0].pattern.id())
    }

    fn answer(motor: &mut GoModule, id: u32, at: u64) -> Result<FrameKind, FrameError> {
        let frame = CanFrame::eight_bytes(ExtendedId::new(id).unwrap(), [0; 8]);
        motor.unpack_feedback(&frame, Micros::from_millis(at))
    }

    #[test]
    fn a_motor_heard_again_after_a_gap_is_a_new_one_even_if_no_tick_counted_it() {
        let mut motor = GoModule::new(3, 0).unwrap();
        assert_eq!(answer(&mut motor, 0x1D00_0023, 1), Ok(FrameKind::Feedback));
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180B_0000);
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180C_0000);
        assert_eq!(answer(&mut motor, 0x1E02_0000, 2), Ok(FrameKind::Other));
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180A_1000);
        assert_eq!(answer(&mut motor, 0x1D00_1023, 3), Ok(FrameKind::Feedback));
        assert_eq!(motor.condition(), Condition::Ready);
        assert_eq!(answer(&mut motor, 0x1D00_1023, 13), Ok(FrameKind::Feedback));
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180A_1000);
        assert_eq!(answer(&mut motor, 0x1D00_1023, 24), Ok(FrameKind::Feedback));
        assert_eq!(motor.condition(), Condition::Starting);
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180B_0000);
    }

    #[test]
    fn it_is_small() {
        let size = size_of::<GoModule>();
        assert!(size <= 352, "{size}");
    }
}
