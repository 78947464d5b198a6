use core::fmt;

use rc10_app::maths::round_to_i32;
use rc10_app::{
    ConfigError, CountsPerTurn, Degrees, NewtonMetres, PidConfig, Rpm, RpmPerSecond, Seconds,
    TotalAngle,
};
use rc10_can::Micros;

use super::seen::{ROTOR_TURN, Seen};
use super::spring::{Pull, STRONGEST, Spring};
use super::wire::line::{COMMAND_LEN, Command, Reply};
use super::wire::{Address, GEAR, Motion, RawImpedance, RawMotion, Shaft, Status};
use crate::motor::{
    Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Loops, Motor, Request,
    RequestError, Response, Target, TargetError, TargetKind, TargetSet,
};
use crate::servo::{Measured, Servo};
use rc10_app::Cascade;
use rc10_app::Direction;

/// A GO-M8010-6 on RS-485. It belongs to a [`Rs485Bus`](super::Rs485Bus), which asks it.
///
/// * **Speed, angle, torque**: loops of ours ([`Servo`]), and one torque in each command.
/// * **Impedance**: the controller's own law; stiffness and damping travel in each command too. Both
///   are taken back where torque at the measured angle and speed would exceed the limit, and for
///   the first 20 ms.
/// * **No torque** ([`DriveMode::Coast`]): field-oriented control with all five numbers zero. **Off**,
///   and while it has a fault: status 0, the vendor's "lock"; what the shaft feels then is not
///   documented, expect a brake.
///
/// A motor that is heard again after more than [`LINK_TIMEOUT`](Self::LINK_TIMEOUT) starts softly.
/// Where it may have been without power meanwhile, the turns it made are estimated
/// ([`Feedback::turn_gaps`]): after power-on it only knows its rotor's angle.
#[derive(Clone, Debug)]
pub struct GoM8010 {
    address: Address,
    direction: Direction,
    servo: Servo,
    /// The impedance asked for, while that is the target.
    spring: Option<Spring>,
    drive: DriveMode,
    /// What is sent when it is asked next.
    command: Command,
    /// Nothing yet: `None`.
    seen: Option<Seen>,
    turn_gaps: u32,
    fault: Option<Fault>,
    clearing: Clearing,
}

/// Where a [`Request::ClearFault`] is.
#[derive(Clone, Copy, Debug)]
enum Clearing {
    Nothing,
    /// The next answer decides; in so many seconds it is too late.
    Waiting(f32),
    Answered(Result<Response, RequestError>),
}

/// There is no such motor on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct IdOutOfRange {
    /// The id asked for.
    pub id: u8,
}

impl fmt::Display for IdOutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "GO-M8010-6 id {}: its ids are 0 to 14", self.id)
    }
}

impl core::error::Error for IdOutOfRange {}

/// Rotor counts per degree of the output.
#[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
const COUNTS_PER_DEGREE: f32 =
    (ROTOR_TURN as f64 * GEAR.rotor_turns() as f64 / (360.0 * GEAR.output_turns() as f64)) as f32;
/// A motor that has not answered [`Request::ClearFault`] after so long (s) does not.
const ANSWER_LIMIT: f32 = 0.25;

impl GoM8010 {
    /// A line must hear a motor this often: within it, fifteen motors of which fourteen do not
    /// answer have all been asked.
    pub const LINK_TIMEOUT: Micros = Micros::from_millis(20);
    /// Largest torque at the output shaft (data manual: 23.7 N m).
    pub const LARGEST_TORQUE: NewtonMetres = NewtonMetres::new(STRONGEST);

    /// Gains for an unloaded to lightly loaded shaft: our choice, tuned in simulation only. Efforts
    /// in N m at the output shaft.
    pub const CASCADE: Cascade = Cascade {
        speed: PidConfig::new(0.08, 0.8, 0.0, STRONGEST),
        angle: PidConfig::new(2.5, 0.0, 0.0, 200.0),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(2000.0),
        feed_forward: 0.0,
    };

    /// The motor set to `id`, turning forward, with the gains of [`CASCADE`](Self::CASCADE).
    ///
    /// # Errors
    /// [`IdOutOfRange`].
    pub fn new(id: u8) -> Result<Self, IdOutOfRange> {
        let address = Address::new(id).ok_or(IdOutOfRange { id })?;
        // These gains are good: a test has them checked.
        let servo =
            Servo::new(TargetKind::Torque, Self::CASCADE).map_err(|_| IdOutOfRange { id })?;
        Ok(Self {
            address,
            direction: Direction::Forward,
            servo,
            spring: None,
            drive: DriveMode::Off,
            command: quiet(address, Status::LOCK),
            seen: None,
            turn_gaps: 0,
            fault: None,
            clearing: Clearing::Nothing,
        })
    }

    /// Turning the given way.
    #[must_use]
    pub const fn with_direction(mut self, direction: Direction) -> Self {
        self.direction = direction;
        self
    }

    /// With gains of your own. The speed loop's output limit is the largest torque.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used.
    pub fn with_cascade(mut self, cascade: Cascade) -> Result<Self, ConfigError> {
        let named = |error: ConfigError| error.of_device("GO-M8010-6", self.address.get().into());
        let value = cascade.speed.output_limit;
        if value > STRONGEST {
            let error = ConfigError::new("output_limit", value, "at most 23.7 N m");
            return Err(named(error.in_part("speed")));
        }
        self.servo = Servo::new(TargetKind::Torque, cascade).map_err(named)?;
        Ok(self)
    }

    /// Whom its commands are for.
    #[must_use]
    pub const fn address(&self) -> Address {
        self.address
    }

    /// How a [`TotalAngle`] of this motor counts: rotor counts.
    #[must_use]
    pub const fn counts_per_turn(&self) -> CountsPerTurn {
        Shaft::OUTPUT.scale()
    }

    /// What it is to be sent now.
    #[inline]
    #[must_use]
    pub fn pack_command(&self) -> [u8; COMMAND_LEN] {
        self.command.pack()
    }

    /// Takes its answer, which ended at `at`.
    ///
    /// # Errors
    /// [`FrameError::NotMine`] if another motor answered; nothing changed.
    pub fn unpack_reply(&mut self, reply: &Reply, at: Micros) -> Result<FrameKind, FrameError> {
        if reply.address != self.address {
            return Err(FrameError::NotMine);
        }
        let raw = reply.motion;
        let seen = match self.seen {
            // Who has jumped was restarted in a blink.
            Some(last)
                if at.since(last.at) <= Self::LINK_TIMEOUT
                    && raw.angle.abs_diff(last.raw.angle) <= ROTOR_TURN.unsigned_abs() / 2 =>
            {
                last.moved(i64::from(raw.angle) - i64::from(last.raw.angle), self.direction.sign())
            }
            last => self.first_after_silence(last, raw, at),
        };
        let (status, temperature) = (reply.status, reply.temperature);
        self.seen = Some(Seen { at, status, raw, temperature, ..seen });
        let fault = reply.fault();
        if fault.is_some() {
            self.fault = fault;
        }
        if let Clearing::Waiting(_) = self.clearing {
            self.clear(fault);
        }
        Ok(if fault.is_some() { FrameKind::Fault } else { FrameKind::Feedback })
    }

    /// The device says whether its fault is over.
    #[cold]
    fn clear(&mut self, fault: Option<Fault>) {
        self.fault = fault;
        let refused = fault.map(|fault| RequestError::Refused(fault.code));
        self.clearing = Clearing::Answered(refused.map_or(Ok(Response::Done), Err));
    }

    /// The first answer of all, or after the link was lost: perhaps the device has been without
    /// power and counts from its rotor's angle again.
    #[cold]
    fn first_after_silence(&mut self, last: Option<Seen>, raw: RawMotion, at: Micros) -> Seen {
        self.servo.rest();
        if let Some(spring) = &mut self.spring {
            spring.rest();
        }
        let Some(last) = last else {
            return Seen::START.moved(raw.angle.into(), self.direction.sign());
        };
        let (seen, gap) = last.after_silence(raw, at, self.direction.sign());
        self.turn_gaps = self.turn_gaps.saturating_add(gap.into());
        seen
    }

    fn measured(&self) -> Option<Measured> {
        let Seen { raw, microdegrees, .. } = self.seen?;
        let speed = Shaft::OUTPUT.motion(RawMotion { speed: raw.speed, ..RawMotion::default() });
        let rpm = speed.speed.get() * f32::from(self.direction.sign());
        Some(Measured { rpm, microdegrees })
    }

    /// Torque alone.
    fn push(&self, torque: f32) -> Command {
        let motion = Motion {
            torque: NewtonMetres::new(torque * f32::from(self.direction.sign())),
            speed: Rpm::ZERO,
            angle: TotalAngle::new(0, Shaft::OUTPUT.scale()),
        };
        Command { motion: Shaft::OUTPUT.raw(&motion), ..quiet(self.address, Status::FOC) }
    }

    /// All five numbers.
    fn follow(&self, pull: &Pull) -> Command {
        let sign = f32::from(self.direction.sign());
        let here = self.seen.map_or(0, |seen| seen.raw.angle);
        let way = round_to_i32(pull.way * sign * COUNTS_PER_DEGREE);
        let motion = Motion {
            torque: NewtonMetres::new(pull.torque.get() * sign),
            speed: Rpm::new(pull.speed.get() * sign),
            angle: TotalAngle::new(i64::from(here) + i64::from(way), Shaft::OUTPUT.scale()),
        };
        Command {
            address: self.address,
            status: Status::FOC,
            motion: Shaft::OUTPUT.raw(&motion),
            impedance: Shaft::OUTPUT.raw_impedance(&pull.gains),
        }
    }
}

/// All five numbers zero.
pub(super) const fn quiet(address: Address, status: Status) -> Command {
    let motion = RawMotion { torque: 0, speed: 0, angle: 0 };
    let impedance = RawImpedance { stiffness: 0, damping: 0 };
    Command { address, status, motion, impedance }
}

impl Motor for GoM8010 {
    fn loops(&self) -> Option<Loops> {
        Some(self.servo.loops())
    }

    fn supports(&self) -> TargetSet {
        use TargetKind::{Angle, Coast, Impedance, Speed, Torque, TotalAngle};
        TargetSet::of(&[Coast, Torque, Speed, Angle, TotalAngle, Impedance])
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        if let Target::Impedance(asked) = target {
            let newer = Spring::new(asked)?;
            match &mut self.spring {
                Some(spring) => spring.replace(newer),
                none => *none = Some(newer),
            }
        } else {
            self.servo.set_target(target)?;
            self.spring = None;
        }
        Ok(())
    }

    fn target(&self) -> Target {
        match &self.spring {
            Some(spring) => Target::Impedance(spring.asked()),
            None => self.servo.target(),
        }
    }

    fn feedback(&self) -> Feedback {
        let Some(seen) = &self.seen else {
            return Feedback::NEW;
        };
        let motion = Shaft::OUTPUT.motion(seen.raw);
        let sign = f32::from(self.direction.sign());
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
        let angle = seen.within as f32 * 1e-6;
        // The last microdegrees would round up to a full turn.
        let angle = Degrees::new(if angle < 360.0 { angle } else { 0.0 });
        let speed = Rpm::new(motion.speed.get() * sign);
        let total_angle = TotalAngle::new(seen.total, Shaft::OUTPUT.scale());
        let mut feedback = Feedback::new(seen.at, speed, angle, total_angle)
            .with_torque(NewtonMetres::new(motion.torque.get() * sign))
            .with_temperature(seen.temperature);
        feedback.turn_gaps = self.turn_gaps;
        feedback
    }

    fn fault(&self) -> Option<Fault> {
        self.fault
    }

    fn update(&mut self, dt: Seconds, drive: DriveMode) {
        self.drive = drive;
        if let Clearing::Waiting(left) = &mut self.clearing {
            *left -= dt.get();
            if *left <= 0.0 {
                self.clearing = Clearing::Answered(Err(RequestError::NoReply));
            }
        }
        let measured = self.measured();
        let limit = self.servo.cascade().speed.output_limit;
        self.command = match (&mut self.spring, measured) {
            _ if drive == DriveMode::Off || self.fault.is_some() => {
                self.servo.rest();
                self.spring.iter_mut().for_each(Spring::rest);
                quiet(self.address, Status::LOCK)
            }
            (Some(spring), Some(measured)) if drive == DriveMode::Run => {
                self.servo.rest();
                let pull = spring.update(dt, measured, limit);
                self.follow(&pull)
            }
            (spring, measured) => {
                spring.iter_mut().for_each(Spring::rest);
                let torque = self.servo.update(dt, drive, measured);
                self.push(torque)
            }
        };
    }

    /// Its zero, its gains, its [`TorqueLimit`](Request::TorqueLimit), and
    /// [`ClearFault`](Request::ClearFault): the device has no such command, so what its next answer
    /// says decides, and a fault that is still there refuses with its code. Over-temperature ends
    /// only with the supply.
    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        if !matches!(self.clearing, Clearing::Nothing) {
            return Err(RequestError::Busy);
        }
        match request {
            Request::SetZero => {
                let seen = self.seen.as_mut().ok_or(RequestError::NoFeedback)?;
                let zero = core::mem::take(&mut seen.microdegrees);
                (seen.total, seen.within) = (0, 0);
                self.servo.set_zero(zero);
                self.spring.iter_mut().for_each(|spring| spring.set_zero(zero));
                Ok(Response::Done)
            }
            Request::ClearFault => {
                self.clearing = Clearing::Waiting(ANSWER_LIMIT);
                Ok(Response::Pending)
            }
            other => self.servo.request(other, self.measured()),
        }
    }

    fn answer(&mut self) -> Option<Result<Response, RequestError>> {
        let Clearing::Answered(answer) = self.clearing else {
            return None;
        };
        self.clearing = Clearing::Nothing;
        Some(answer)
    }

    fn condition(&self) -> Condition {
        match &self.seen {
            // It has been told to follow, and does not yet.
            Some(seen) if self.drive == DriveMode::Run && seen.status != Status::FOC => {
                Condition::Starting
            }
            _ => Condition::Ready,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rc10_app::Celsius;

    #[test]
    fn ids_are_those_of_one_motor() {
        for id in 0..=14 {
            assert_eq!(GoM8010::new(id).unwrap().address().get(), id);
        }
        for id in [15, 16, 255] {
            assert_eq!(GoM8010::new(id).err(), Some(IdOutOfRange { id }));
        }
    }

    #[test]
    fn more_torque_than_the_motor_has_is_refused() {
        let mut cascade = GoM8010::CASCADE;
        cascade.speed.output_limit = 24.0;
        let error = GoM8010::new(0).unwrap().with_cascade(cascade).unwrap_err();
        assert_eq!((error.field, error.must_be), ("output_limit", "at most 23.7 N m"));
        cascade.speed.output_limit = f32::NAN;
        assert!(GoM8010::new(0).unwrap().with_cascade(cascade).is_err());
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
    fn turns_go_on_after_a_silence() {
        let ms = Micros::from_millis;
        let turns = |motor: &GoM8010| motor.feedback().total_angle.counts();
        let mut motor = GoM8010::new(0).unwrap();
        motor.unpack_reply(&reply(100 * 32_768 + 100, 0), ms(1)).unwrap();
        assert_eq!(turns(&motor), 100 * 32_768 + 100);
        // The cable was out; it has counted on.
        motor.unpack_reply(&reply(150 * 32_768, 0), ms(500)).unwrap();
        assert_eq!((turns(&motor), motor.feedback().turn_gaps), (150 * 32_768, 0));
        // The power was off: it knows where its rotor is, no more.
        motor.unpack_reply(&reply(32_000, 0), ms(900)).unwrap();
        assert_eq!((turns(&motor), motor.feedback().turn_gaps), (150 * 32_768 - 768, 1));
        // It turns at two turns a second throughout.
        motor.unpack_reply(&reply(32_100, 512), ms(901)).unwrap();
        motor.unpack_reply(&reply(31_700, 512), ms(1401)).unwrap();
        assert_eq!(turns(&motor), 151 * 32_768 - 1068);
    }

    #[test]
    fn heard_again_after_a_silence_it_starts_softly() {
        let angle = Degrees::new(90.0);
        let pull = crate::motor::Impedance { angle, kp: 20.0, ..Default::default() };
        for target in [Target::Speed(Rpm::new(200.0)), Target::Impedance(pull)] {
            let mut motor = GoM8010::new(0).unwrap();
            motor.set_target(target).unwrap();
            let mut force = |from: u64, ticks: u64| {
                for at in from..from + ticks {
                    motor.unpack_reply(&reply(0, 0), Micros::from_millis(at)).unwrap();
                    motor.update(Seconds::new(0.001), DriveMode::Run);
                }
                i32::from(motor.command.motion.torque)
                    + i32::from(motor.command.impedance.stiffness)
            };
            let full = force(0, 100);
            assert!(full > 300, "{target:?} {full}");
            assert!(force(100, 1) >= full);
            // Nobody ticked it in between, and nobody commanded it anew.
            let soft = force(130, 1);
            assert!(soft < full / 5, "{target:?} {soft} of {full}");
        }
    }

    #[test]
    fn the_angle_stays_within_its_turn() {
        let mut motor = GoM8010::new(0).unwrap().with_direction(Direction::Reversed);
        for step in 0..500 {
            let at = Micros::from_millis(step);
            motor.unpack_reply(&reply(i32::try_from(step).unwrap() * 30_000, 0), at).unwrap();
            let feedback = motor.feedback();
            let (angle, whole) = (feedback.angle, feedback.total_angle.within_turn());
            assert!((0.0..360.0).contains(&angle.get()));
            assert!((angle.get() - whole.get()).abs() < 1e-3, "{angle:?} {whole:?}");
        }
        assert!(motor.feedback().total_angle.counts() < 0);
    }
}
