use rc10_app::ConfigError;
use rc10_time::Micros;

use super::config::LineConfig;
use super::motor::Actuator;
use super::wire::line::{COMMAND_LEN, Command, Reply};
use super::wire::{Address, Impedance, RawImpedance, RawMotion, RotorScale, Status};
use crate::can_ids::MotorName;
use crate::feedback::{Condition, Feedback};
use crate::motor::{DriveMode, FrameError, FrameKind, Heard, Link, Motor, Tick};
use crate::pending::{Pending, Retry};
use crate::request::{Request, RequestError, Response};

/// A GO-M8010-6 on RS-485. It belongs to a [`Rs485Bus`](super::Rs485Bus), which polls it.
///
/// What each target does, and each fault: `docs/motors/unitree.md`. It starts softly after a loss;
/// its turns are estimated then ([`Feedback::turn_gaps`]).
#[derive(Clone, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct GoM8010 {
    address: Address,
    actuator: Actuator,
    mode: DriveMode,
    /// The last status that the motor reported.
    status: Status,
    command: Command,
    /// A fault that is to be cleared: the next reply tells.
    pending: Pending<()>,
}

/// The time that a motor has to reply after [`Request::ClearFault`], s.
const CLEARING: Retry = Retry::new(0.25, 1);

impl GoM8010 {
    /// The motor that is set up like this; [`ConfigError`] names a field that cannot be used.
    pub fn new(config: LineConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        let address = config.address()?;
        Ok(Self {
            address,
            actuator: Actuator::new(config.direction, config.cascade),
            mode: DriveMode::Off,
            status: Status::LOCK,
            command: idle(address, Status::LOCK),
            pending: Pending::new(),
        })
    }

    /// The address of its commands.
    pub const fn address(&self) -> Address {
        self.address
    }

    /// The command to send now.
    pub fn pack_command(&self) -> [u8; COMMAND_LEN] {
        self.command.pack()
    }

    /// Takes its reply, which ended at `at`. `link` is what the bus knew of the motor until then.
    ///
    /// # Errors
    /// [`FrameError::NotMine`] if another motor replied; nothing changed.
    pub fn unpack_reply(&mut self, reply: &Reply, at: Micros, link: Link) -> Heard {
        if reply.address != self.address {
            return Err(FrameError::NotMine);
        }
        self.actuator.report(reply.motion, reply.temperature, at, link);
        self.status = reply.status;
        let fault = reply.fault();
        if self.pending.question().is_some() {
            self.actuator.fault = None;
            let refused = fault.map(|fault| RequestError::Refused(fault.code));
            self.pending.end(refused.map_or(Ok(Response::Done), Err));
        }
        if fault.is_none() {
            return Ok(FrameKind::Feedback);
        }
        self.actuator.fault = fault;
        Ok(FrameKind::Fault)
    }
}

/// All five numbers zero.
pub(super) const fn idle(address: Address, status: Status) -> Command {
    let motion = RawMotion { torque: 0, speed: 0, angle: 0 };
    Command { address, status, motion, impedance: RawImpedance::NONE }
}

impl Motor for GoM8010 {
    handed_on!(supports, set_target, target, loops of [actuator.servo]);
    handed_on!(fault of [actuator.fault]);
    handed_on!(response of [pending]);
    handed_on!(state but []);

    fn name(&self) -> MotorName {
        MotorName { model: "GO-M8010-6", id: self.address.get().into() }
    }

    fn feedback(&self) -> Feedback {
        self.actuator.feedback()
    }

    fn update(&mut self, tick: &Tick) {
        self.mode = tick.mode;
        self.pending.update(tick);
        let Self { actuator, address, .. } = self;
        self.command = if tick.mode == DriveMode::Off || actuator.fault.is_some() {
            actuator.servo.rest();
            idle(*address, Status::LOCK)
        } else {
            actuator.servo.update(tick, &actuator.shaft);
            let command = idle(*address, Status::FOC);
            match actuator.servo.spring() {
                None => Command { motion: actuator.push(actuator.servo.effort()), ..command },
                Some(spring) => {
                    let gains = Impedance { stiffness: spring.kp, damping: spring.kd };
                    let impedance = RotorScale::OUTPUT.raw_impedance(&gains);
                    Command { motion: actuator.pull(spring), impedance, ..command }
                }
            }
        };
    }

    /// Takes zero, gains, [`TorqueLimit`](Request::TorqueLimit), and
    /// [`ClearFault`](Request::ClearFault), which the next reply decides: one that is still there
    /// refuses with its code. Over-temperature ends only with the supply.
    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        match request {
            Request::ClearFault => self.pending.ask((), CLEARING),
            _ if self.pending.is_busy() => Err(RequestError::Busy),
            _ => self.actuator.servo.request(request, &mut self.actuator.shaft),
        }
    }

    fn condition(&self) -> Condition {
        let follows = self.mode != DriveMode::Run || self.status == Status::FOC;
        if follows || !self.actuator.shaft.is_known() {
            Condition::Ready
        } else {
            Condition::Starting
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::Target;
    use rc10_app::{Celsius, Degrees, Rpm};

    #[test]
    fn ids_are_those_of_one_motor() {
        for id in 0..=14 {
            assert_eq!(GoM8010::new(LineConfig::new(id)).unwrap().address().get(), id);
        }
        for id in [15, 16, 255] {
            assert_eq!(GoM8010::new(LineConfig::new(id)).unwrap_err().field, "id");
        }
    }

    fn reply(angle: i32, speed: i16) -> Reply {
        Reply {
            address: Address::new(0).unwrap(),
            status: Status::FOC,
            motion: RawMotion { torque: 0, speed, angle },
            temperature: Celsius::new(30.0),
            error: 0,
            foot_force: 0,
        }
    }

    #[test]
    fn heard_again_after_a_silence_it_starts_softly() {
        let angle = Degrees::new(90.0);
        let pull = crate::Impedance { angle, kp: 20.0, ..Default::default() };
        for target in [Target::Speed(Rpm::new(200.0)), Target::Impedance(pull)] {
            let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
            motor.set_target(target).unwrap();
            let mut force = |from: u64, ticks: u64, mut link| {
                for at in from..from + ticks {
                    motor.unpack_reply(&reply(0, 0), Micros::from_millis(at), link).unwrap();
                    link = Link::Online;
                    motor.update(&Tick::new(DriveMode::Run));
                }
                let Command { motion, impedance, .. } = motor.command;
                i32::from(motion.torque) + i32::from(impedance.stiffness)
            };
            let full = force(0, 100, Link::NeverSeen);
            assert!(full > 300, "{target:?} {full}");
            assert!(force(100, 1, Link::Online) >= full);
            // No tick saw the silence, and no new command came.
            let soft = force(130, 1, Link::Lost);
            assert!(soft < full / 5, "{target:?} {soft} of {full}");
        }
    }
}
