//! A GO-M8010-6 behind Unitree's CAN-to-485 module, as a motor on a CAN bus.
//!
//! What each target does, and when a motor is enabled anew: `docs/motors/unitree-module.md`. Armed,
//! the gains are written to the module and read back, then the motor is put into field-oriented
//! control, then driven: from the fourth tick on at best.
//!
//! **One frame a tick**, by identifiers' order, and one stream: the newest frame replaces others.
//!
//! ```
//! use rc10_motor::unitree::{GoModule, ModuleConfig};
//! use rc10_motor::{ArmSwitch, Impedance, MotorBus, Safety, Target};
//! use rc10_motor::rc10_app::Degrees;
//! use rc10_motor::rc10_time::Micros;
//!
//! let switch = ArmSwitch::new();
//! // Both behind the module with switches 1 and 2 on, as it is sold.
//! let mut hip = GoModule::new(ModuleConfig::new(3, 0))?;
//! let mut knee = GoModule::new(ModuleConfig::new(3, 1))?;
//! let mut bus = MotorBus::new(&switch);
//! let hip = bus.attach(&mut hip, Safety::HOLD)?;
//! let knee = bus.attach(&mut knee, Safety::HOLD)?;
//! let spring = Impedance { angle: Degrees::new(30.0), kp: 20.0, kd: 0.5, ..Impedance::default() };
//! bus.command(hip, Target::Impedance(spring), Micros::ZERO)?;
//! bus.command(knee, Target::Angle(Degrees::new(45.0)), Micros::ZERO)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod sequence;

use rc10_app::{ConfigError, Degrees, Rpm};
use rc10_can::{CanFrame, IdPattern};
use rc10_time::Micros;

use self::sequence::Sequence;
use super::config::{ModuleConfig, OWNER};
use super::motor::Actuator;
use super::wire::module::{Content, FROM_MODULE, Module, Reply, Request as Question};
use super::wire::{self, Address, RawImpedance, RawMotion, RotorScale};
use crate::batch::{TxBatch, TxFull};
use crate::can_ids::{CanIds, MotorName};
use crate::feedback::{Condition, Feedback};
use crate::motor::{CanMotor, DriveMode, FrameError, FrameKind, Heard, Link, Motor, Tick};
use crate::request::{Request, RequestError, Response};
use crate::servo::Spring;
use crate::target::{Impedance, Target};

/// A GO-M8010-6 behind a CAN-to-485 module.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct GoModule {
    module: Module,
    address: Address,
    /// Module, direction and motor of its replies, in place.
    owner: u32,
    actuator: Actuator,
    mode: DriveMode,
    sequence: Sequence,
    /// The motion of the next command that carries one.
    command: RawMotion,
}

impl GoModule {
    /// The motor that is set up like this; [`ConfigError`] names a field that cannot be used.
    pub fn new(config: ModuleConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        let (module, address) = config.devices()?;
        let owner = u32::from(module.get()) << 27 | FROM_MODULE | u32::from(address.get()) << 8;
        Ok(Self {
            module,
            address,
            owner,
            actuator: Actuator::new(config.direction, config.cascade),
            mode: DriveMode::Off,
            sequence: Sequence::new(),
            command: RawMotion::default(),
        })
    }

    /// The impedance that the motor shall make itself.
    fn impedance(&self) -> Option<Impedance> {
        match self.actuator.servo.target() {
            Target::Impedance(impedance) if self.mode == DriveMode::Run => Some(impedance),
            _ => None,
        }
    }

    /// The motion for a spring while the module has the gains of `target`: the share of them that
    /// the servo allows is a share of the way and of the damper's speed.
    fn pull(&self, spring: &Spring, target: &Impedance) -> RawMotion {
        let share = match target {
            Impedance { kp, .. } if *kp > 0.0 => spring.kp / kp,
            Impedance { kd, .. } if *kd > 0.0 => spring.kd / kd,
            _ => 1.0,
        };
        let measured = self.actuator.shaft.speed().get();
        let speed = measured + (spring.speed.get() - measured) * share;
        let way = Degrees::new(spring.way.get() * share);
        self.actuator.pull(&Spring { way, speed: Rpm::new(speed), ..*spring })
    }

    /// Sends in the one stream of all frames to the motor: what their identifiers have in common.
    fn send(&self, question: &Question, tx: &mut TxBatch) -> Result<(), TxFull> {
        let stream = IdPattern::extended(self.owner ^ FROM_MODULE).id();
        tx.push_as(question.pack(self.module, self.address), CanFrame::key_of(stream))
    }
}

impl Motor for GoModule {
    handed_on!(supports, set_target, target, loops of [actuator.servo]);
    handed_on!(fault of [actuator.fault]);
    handed_on!(state but []);

    fn name(&self) -> MotorName {
        ModuleConfig::new(self.module.get(), self.address.get()).name()
    }

    fn feedback(&self) -> Feedback {
        self.actuator.feedback()
    }

    fn update(&mut self, tick: &Tick) {
        self.mode = tick.mode;
        let is_stopped = tick.mode == DriveMode::Off || tick.link != Link::Online;
        if is_stopped || self.actuator.fault.is_some() {
            self.sequence.stop();
            self.actuator.servo.rest();
            return;
        }
        let impedance = self.impedance();
        let gains = impedance.map_or(RawImpedance::NONE, |Impedance { kp, kd, .. }| {
            RotorScale::OUTPUT.raw_impedance(&wire::Impedance { stiffness: kp, damping: kd })
        });
        self.sequence.advance(gains);
        if self.sequence.is_following() {
            self.actuator.servo.update(tick, &self.actuator.shaft);
        } else {
            self.actuator.servo.rest();
        }
        let servo = &self.actuator.servo;
        self.command = match (servo.spring(), &impedance) {
            (Some(spring), Some(target)) => self.pull(spring, target),
            _ => self.actuator.push(servo.effort()),
        };
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        if request == Request::ClearFault {
            self.actuator.fault = None;
            return Ok(Response::Done);
        }
        self.actuator.servo.request(request, &mut self.actuator.shaft)
    }

    fn condition(&self) -> Condition {
        if self.mode == DriveMode::Off || self.sequence.is_following() {
            Condition::Ready
        } else {
            Condition::Starting
        }
    }
}

impl CanMotor for GoModule {
    fn can_ids(&self) -> CanIds {
        ModuleConfig::new(self.module.get(), self.address.get()).can_ids()
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros, link: Link) -> Heard {
        if frame.raw_id() & OWNER != self.owner {
            return Err(FrameError::NotMine);
        }
        let reply = Reply::unpack(frame)?;
        match reply.content {
            Content::State { status, motion, temperature, .. } => {
                if link != Link::Online {
                    self.sequence.stop();
                }
                self.actuator.report(motion, temperature, at, link);
                self.sequence.on_state(status);
                Ok(FrameKind::Feedback)
            }
            Content::Fault { .. } => {
                self.actuator.fault = reply.fault();
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
    use crate::unitree::wire::Status;
    use embedded_can::ExtendedId;

    /// The identifier that a tick sends.
    fn tick(motor: &mut GoModule, drive: DriveMode) -> u32 {
        motor.update(&Tick::new(drive));
        let mut tx = TxBatch::new();
        motor.pack_command(&mut tx).unwrap();
        assert_eq!(tx.entries().next().map(|(_, stream)| stream), Some(tx_stream(motor)));
        tx.frames()[0].raw_id()
    }

    fn tx_stream(motor: &GoModule) -> u32 {
        CanFrame::key_of(motor.can_ids().transmitted()[0].pattern.id())
    }

    fn reply(motor: &mut GoModule, id: u32, link: Link) -> Heard {
        let frame = CanFrame::eight_bytes(ExtendedId::new(id).unwrap(), [0; 8]);
        motor.unpack_feedback(&frame, Micros::from_millis(1), link)
    }

    #[test]
    fn a_motor_heard_again_after_a_gap_is_a_new_one_even_if_no_tick_counted_it() {
        let mut motor = GoModule::new(ModuleConfig::new(3, 0)).unwrap();
        assert_eq!(reply(&mut motor, 0x1D00_0023, Link::NeverSeen), Ok(FrameKind::Feedback));
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180B_0000);
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180C_0000);
        assert_eq!(reply(&mut motor, 0x1E02_0000, Link::Online), Ok(FrameKind::Other));
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180A_1000);
        assert_eq!(reply(&mut motor, 0x1D00_1023, Link::Online), Ok(FrameKind::Feedback));
        assert_eq!(motor.condition(), Condition::Ready);
        assert_eq!(reply(&mut motor, 0x1D00_1023, Link::Online), Ok(FrameKind::Feedback));
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180A_1000);
        assert_eq!(reply(&mut motor, 0x1D00_1023, Link::Lost), Ok(FrameKind::Feedback));
        assert_eq!(motor.condition(), Condition::Starting);
        assert_eq!(tick(&mut motor, DriveMode::Coast), 0x180B_0000);
    }

    /// The torque that the motor makes by its own law of stiffness, damping and a motion.
    fn law(motor: &GoModule, gains: &Impedance, command: RawMotion) -> f32 {
        let shaft = &motor.actuator.shaft;
        let command = RotorScale::OUTPUT.motion(command);
        let way = command.angle.minus(shaft.angle()).degrees().get().to_radians();
        let slip = (command.speed.get() - shaft.speed().get()) * core::f32::consts::TAU / 60.0;
        gains.kp * way + gains.kd * slip + command.torque.get()
    }

    #[test]
    fn what_the_servo_takes_back_of_a_spring_the_module_takes_back_too() {
        let mut motor = GoModule::new(ModuleConfig::new(3, 0)).unwrap();
        let frame = Question::Control(Status::FOC, RawMotion { torque: 0, speed: 500, angle: 700 });
        let data = *frame.pack(motor.module, motor.address).all_eight().unwrap();
        let frame = CanFrame::eight_bytes(ExtendedId::new(0x1D00_1023).unwrap(), data);
        motor.unpack_feedback(&frame, Micros::ZERO, Link::NeverSeen).unwrap();
        for (kp, kd) in [(40.0, 0.0), (0.0, 2.0), (40.0, 2.0), (0.0, 0.0)] {
            let target = Impedance { kp, kd, ..Impedance::default() };
            for share in [0.0, 0.3, 1.0] {
                let (way, speed) = (Degrees::new(20.0), Rpm::new(90.0));
                let torque = 3.0 * share;
                let spring = Spring { way, speed, torque, kp: kp * share, kd: kd * share };
                let slip = (90.0 - motor.feedback().speed.get()) * core::f32::consts::TAU / 60.0;
                let asked = share * (kp * 20_f32.to_radians() + kd * slip + 3.0);
                let made = law(&motor, &target, motor.pull(&spring, &target));
                assert!((made - asked).abs() < 0.03, "{kp} {kd} {share}: {made} {asked}");
            }
        }
    }

    #[test]
    fn it_is_small() {
        let size = size_of::<GoModule>();
        assert!(size <= 464, "{size}");
    }
}
