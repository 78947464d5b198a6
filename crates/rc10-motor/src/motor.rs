use core::fmt;

use rc10_app::{
    Amps, Celsius, ConfigError, Degrees, NewtonMetres, Rpm, Seconds, TotalAngle, Volts,
};
use rc10_can::{CanFrame, Micros};

use crate::batch::{TxBatch, TxFull};
use crate::wiring::CanIds;
use rc10_app::Cascade;

/// What a motor shall do. All values are at the output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Target {
    /// Turn freely: no torque.
    #[default]
    Coast,
    /// A torque-producing current. More than the motor takes is limited.
    Current(Amps),
    /// A share of the full voltage, -1 ..= 1; more is limited.
    Duty(f32),
    /// A speed.
    Speed(Rpm),
    /// An angle within the turn, reached the shorter way round; any number of degrees, taken
    /// modulo 360.
    Angle(Degrees),
    /// An angle of many turns.
    TotalAngle(TotalAngle),
    /// A torque.
    Torque(NewtonMetres),
    /// A spring and a damper between the shaft and a moving point, and a torque on top ("MIT
    /// mode").
    Impedance(Impedance),
    /// A current that brakes whichever way the shaft turns, 0 or more; none at standstill.
    Brake(Amps),
    /// A current that holds the rotor where it stands, 0 or more: it locks a field, and heats.
    Handbrake(Amps),
    /// As [`Current`](Self::Current), as a share of the limit set in the drive, -1 ..= 1.
    CurrentShare(f32),
    /// As [`Brake`](Self::Brake), as a share of the limit set in the drive, 0 ..= 1.
    BrakeShare(f32),
    /// As [`Handbrake`](Self::Handbrake), as a share of the limit set in the drive, 0 ..= 1.
    HandbrakeShare(f32),
}

/// What [`Target::Impedance`] asks for: torque = `kp` · (`angle` - measured) + `kd` · (`speed` -
/// measured) + `torque`.
///
/// A single step of `angle` is a blow: a spring pulls with all it has. Move it, or keep `kp` low.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Impedance {
    /// Where the spring pulls to, over many turns, counted from the zero as
    /// [`Feedback::total_angle`] is.
    pub angle: Degrees,
    /// The speed at which the damper does nothing.
    pub speed: Rpm,
    /// Torque on top.
    pub torque: NewtonMetres,
    /// Stiffness, N m/rad, 0 or more.
    pub kp: f32,
    /// Damping, N m s/rad, 0 or more.
    pub kd: f32,
}

impl Impedance {
    /// Whether every number in it is finite.
    #[must_use]
    pub const fn is_finite(&self) -> bool {
        let Self { angle, speed, torque, kp, kd } = self;
        angle.is_finite()
            && speed.is_finite()
            && torque.is_finite()
            && kp.is_finite()
            && kd.is_finite()
    }
}

/// The kinds of [`Target`], without their values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[repr(u8)]
pub enum TargetKind {
    /// [`Target::Coast`].
    Coast,
    /// [`Target::Current`].
    Current,
    /// [`Target::Duty`].
    Duty,
    /// [`Target::Speed`].
    Speed,
    /// [`Target::Angle`].
    Angle,
    /// [`Target::TotalAngle`].
    TotalAngle,
    /// [`Target::Torque`].
    Torque,
    /// [`Target::Impedance`].
    Impedance,
    /// [`Target::Brake`].
    Brake,
    /// [`Target::Handbrake`].
    Handbrake,
    /// [`Target::CurrentShare`].
    CurrentShare,
    /// [`Target::BrakeShare`].
    BrakeShare,
    /// [`Target::HandbrakeShare`].
    HandbrakeShare,
}

impl Target {
    /// Its kind.
    #[must_use]
    pub const fn kind(&self) -> TargetKind {
        match self {
            Self::Coast => TargetKind::Coast,
            Self::Current(_) => TargetKind::Current,
            Self::Duty(_) => TargetKind::Duty,
            Self::Speed(_) => TargetKind::Speed,
            Self::Angle(_) => TargetKind::Angle,
            Self::TotalAngle(_) => TargetKind::TotalAngle,
            Self::Torque(_) => TargetKind::Torque,
            Self::Impedance(_) => TargetKind::Impedance,
            Self::Brake(_) => TargetKind::Brake,
            Self::Handbrake(_) => TargetKind::Handbrake,
            Self::CurrentShare(_) => TargetKind::CurrentShare,
            Self::BrakeShare(_) => TargetKind::BrakeShare,
            Self::HandbrakeShare(_) => TargetKind::HandbrakeShare,
        }
    }

    /// Whether every number in it is finite.
    #[must_use]
    pub const fn is_finite(&self) -> bool {
        match self {
            Self::Coast | Self::TotalAngle(_) => true,
            Self::Current(amps) | Self::Brake(amps) | Self::Handbrake(amps) => amps.is_finite(),
            Self::Duty(share)
            | Self::CurrentShare(share)
            | Self::BrakeShare(share)
            | Self::HandbrakeShare(share) => share.is_finite(),
            Self::Torque(torque) => torque.is_finite(),
            Self::Impedance(impedance) => impedance.is_finite(),
            Self::Speed(rpm) => rpm.is_finite(),
            Self::Angle(degrees) => degrees.is_finite(),
        }
    }
}

/// Which kinds of target a motor takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TargetSet(u16);

impl TargetSet {
    /// None: not even coasting. What a port offers before its motor is attached.
    pub const NONE: Self = Self(0);

    /// The kinds listed.
    #[must_use]
    pub const fn of(kinds: &[TargetKind]) -> Self {
        let mut bits = 0;
        let mut index = 0;
        while index < kinds.len() {
            bits |= 1 << kinds[index] as u16;
            index += 1;
        }
        Self(bits)
    }

    /// Whether a kind is among them.
    #[must_use]
    pub const fn contains(self, kind: TargetKind) -> bool {
        self.0 & (1 << kind as u16) != 0
    }

    /// `Ok` if the target's kind is among these and its numbers are finite.
    ///
    /// # Errors
    /// [`TargetError`], saying which of both is wrong.
    pub const fn accepts(self, target: &Target) -> Result<(), TargetError> {
        if !self.contains(target.kind()) {
            Err(TargetError::Unsupported(target.kind()))
        } else if target.is_finite() {
            Ok(())
        } else {
            Err(TargetError::NotFinite(target.kind()))
        }
    }
}

/// Why a target was refused. The motor keeps the one it had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TargetError {
    /// This motor cannot do that.
    Unsupported(TargetKind),
    /// A number in it is infinite or NaN.
    NotFinite(TargetKind),
    /// A number in it lies where the motor cannot go.
    OutOfRange(TargetKind),
}

impl fmt::Display for TargetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsupported(kind) => write!(f, "this motor takes no {kind:?} target"),
            Self::NotFinite(kind) => write!(f, "the {kind:?} target is infinite or NaN"),
            Self::OutOfRange(kind) => {
                write!(f, "the {kind:?} target lies where the motor cannot go")
            }
        }
    }
}

impl core::error::Error for TargetError {}

/// What a motor measured, at the output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Feedback {
    /// When it arrived.
    pub at: Micros,
    /// Speed.
    pub speed: Rpm,
    /// Angle within the turn, 0 ..< 360 degrees. Behind a gearbox it counts from where the motor
    /// was at power-on, or from where it was zeroed.
    pub angle: Degrees,
    /// Angle of many turns, exact.
    pub total_angle: TotalAngle,
    /// How often the number of turns had to be estimated, because feedback was missing at speed or
    /// for more than 100 ms. A motor that has lost count runs on: watch this where it matters.
    pub turn_gaps: u32,
    current: Reading,
    torque: Reading,
    temperature: Reading,
    controller_temperature: Reading,
    supply: Reading,
}

/// What not every device tells: absent as NaN, because an `Option<f32>` takes twice the room, and
/// every task that looks at a motor gets a copy.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Reading(f32);

impl Reading {
    const NONE: Self = Self(f32::NAN);

    #[inline]
    const fn get(self) -> Option<f32> {
        if self.0.is_nan() { None } else { Some(self.0) }
    }
}

impl Default for Reading {
    fn default() -> Self {
        Self::NONE
    }
}

impl PartialEq for Reading {
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

impl fmt::Debug for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.get().fmt(f)
    }
}

impl Feedback {
    /// Nothing measured: everything zero or absent.
    pub const NEW: Self = Self {
        at: Micros::ZERO,
        speed: Rpm::ZERO,
        angle: Degrees::ZERO,
        total_angle: TotalAngle::ZERO,
        turn_gaps: 0,
        current: Reading::NONE,
        torque: Reading::NONE,
        temperature: Reading::NONE,
        controller_temperature: Reading::NONE,
        supply: Reading::NONE,
    };

    /// What every device tells, and nothing else.
    #[inline]
    #[must_use]
    pub const fn new(at: Micros, speed: Rpm, angle: Degrees, total_angle: TotalAngle) -> Self {
        Self { at, speed, angle, total_angle, ..Self::NEW }
    }

    /// Torque-producing current, positive for positive torque.
    #[must_use]
    pub fn current(&self) -> Option<Amps> {
        self.current.get().map(Amps::new)
    }

    /// Torque, where the device tells it or its torque constant is known.
    #[must_use]
    pub fn torque(&self) -> Option<NewtonMetres> {
        self.torque.get().map(NewtonMetres::new)
    }

    /// Temperature of the motor, where the device tells it.
    #[must_use]
    pub fn temperature(&self) -> Option<Celsius> {
        self.temperature.get().map(Celsius::new)
    }

    /// Temperature of what drives the motor, where the device tells it.
    #[must_use]
    pub fn controller_temperature(&self) -> Option<Celsius> {
        self.controller_temperature.get().map(Celsius::new)
    }

    /// Voltage it is supplied with, where the device tells it.
    #[must_use]
    pub fn supply(&self) -> Option<Volts> {
        self.supply.get().map(Volts::new)
    }

    /// The same with a current. What is NaN counts as not told, here and below.
    #[inline]
    #[must_use]
    pub const fn with_current(mut self, current: Amps) -> Self {
        self.current = Reading(current.get());
        self
    }

    /// The same with a torque.
    #[inline]
    #[must_use]
    pub const fn with_torque(mut self, torque: NewtonMetres) -> Self {
        self.torque = Reading(torque.get());
        self
    }

    /// The same with a temperature of the motor.
    #[inline]
    #[must_use]
    pub const fn with_temperature(mut self, temperature: Celsius) -> Self {
        self.temperature = Reading(temperature.get());
        self
    }

    /// The same with a temperature of what drives the motor.
    #[inline]
    #[must_use]
    pub const fn with_controller_temperature(mut self, temperature: Celsius) -> Self {
        self.controller_temperature = Reading(temperature.get());
        self
    }

    /// The same with the voltage it is supplied with.
    #[inline]
    #[must_use]
    pub const fn with_supply(mut self, supply: Volts) -> Self {
        self.supply = Reading(supply.get());
        self
    }
}

/// What is wrong with a motor, by its own account.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Fault {
    /// The code the device sent.
    pub code: u32,
    /// What it means.
    pub text: &'static str,
}

impl Fault {
    /// A fault.
    #[must_use]
    pub const fn new(code: u32, text: &'static str) -> Self {
        Self { code, text }
    }
}

/// What the bus lets a motor do in this tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DriveMode {
    /// The robot is disarmed: no torque; a device that can be disabled is.
    #[default]
    Off,
    /// No torque.
    Coast,
    /// Slow down and stand still.
    Brake,
    /// Slow down and keep the angle at which the shaft comes to a stand.
    Hold,
    /// Follow the target.
    Run,
}

/// What a motor does when it may not follow its target: its command expired, or the emergency
/// stop is latched. (A motor whose feedback is lost always coasts: nothing can be held blindly.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SafeState {
    /// Turn freely. Right for wheels.
    #[default]
    Coast,
    /// Slow down actively and stand still.
    Brake,
    /// Hold the angle. Right for a lift, which would fall.
    Hold,
}

impl SafeState {
    /// The drive that brings it about.
    #[must_use]
    pub const fn drive(self) -> DriveMode {
        match self {
            Self::Coast => DriveMode::Coast,
            Self::Brake => DriveMode::Brake,
            Self::Hold => DriveMode::Hold,
        }
    }
}

/// The gains of one loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Gains {
    /// Proportional.
    pub kp: f32,
    /// Integral, per second.
    pub ki: f32,
    /// Derivative, times seconds.
    pub kd: f32,
}

/// What can be asked of a motor beside targets.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Request {
    /// The shaft's angle now is zero from now on. A total angle that is sought or held stays where
    /// it is; the same number commanded again lies elsewhere.
    SetZero,
    /// Forget a fault and go on.
    ClearFault,
    /// Never command more current than this.
    CurrentLimit(Amps),
    /// New gains for the speed loop.
    SpeedGains(Gains),
    /// New gains for the angle loop.
    AngleGains(Gains),
    /// Never command more torque than this.
    TorqueLimit(NewtonMetres),
    /// The shaft's angle now is zero from now on, also after power-off: the device stores it. Only
    /// while the robot is disarmed.
    StoreZero,
    /// What stands in a register of the device: four bytes, little endian
    /// ([`Response::Register`]).
    ReadRegister(u16),
    /// Writes four bytes, little endian, into a register of the device, until power-off. Only while
    /// the robot is disarmed.
    WriteRegister(u16, u32),
    /// The device keeps its registers also after power-off. Only while the robot is disarmed: its
    /// flash wears, and its loops stop meanwhile.
    SaveRegisters,
}

/// What became of a request that was not refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Response {
    /// It is done.
    Done,
    /// The device was asked; [`Motor::answer`] has what it says. Who waits at a motor's port never
    /// sees this.
    Pending,
    /// What stands in the register.
    Register(u32),
}

/// Why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum RequestError {
    /// This motor cannot do that.
    Unsupported,
    /// A number in it cannot be used.
    Config(ConfigError),
    /// It needs feedback, and none came yet.
    NoFeedback,
    /// The one before has not been carried out yet.
    Busy,
    /// The bus has no such motor.
    NoSuchMotor,
    /// Only while the robot is disarmed.
    NotWhileArmed,
    /// The device did not answer in time: whether it did what was asked is not known.
    NoReply,
    /// The device refused, with this code of its own.
    Refused(u32),
}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsupported => f.write_str("this motor cannot do that"),
            Self::Config(error) => error.fmt(f),
            Self::NoFeedback => f.write_str("the motor has not been heard of yet"),
            Self::Busy => f.write_str("the request before has not been carried out yet"),
            Self::NoSuchMotor => f.write_str("the bus has no such motor"),
            Self::NotWhileArmed => f.write_str("only while the robot is disarmed"),
            Self::NoReply => f.write_str("the device did not answer in time"),
            Self::Refused(code) => write!(f, "the device refused, code {code}"),
        }
    }
}

impl core::error::Error for RequestError {}

impl From<ConfigError> for RequestError {
    fn from(error: ConfigError) -> Self {
        Self::Config(error)
    }
}

/// Whether a motor that may run does what its target says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Condition {
    /// It does.
    #[default]
    Ready,
    /// Not yet: its device is being set up or enabled.
    Starting,
    /// The speed asked for is below what its drive regulates: it turns as the load lets it.
    Unregulated,
    /// Its feedback comes too seldom to control it by.
    SlowFeedback,
    /// Its device answers when asked, but sends no feedback: that has to be switched on there.
    NoReports,
    /// Its device does not do what it is told, and does not say why: it may have a fault.
    NotFollowing,
}

/// What a motor learned from a frame of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameKind {
    /// How it is now: this keeps its link alive.
    Feedback,
    /// How it is now, and that it has a fault: its bus takes it to its safe state until the fault
    /// is cleared ([`Request::ClearFault`]).
    Fault,
    /// Something else, such as the reply to a request: it may still be lost.
    Other,
}

/// Why a frame is no feedback. It changes nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum FrameError {
    /// Another identifier, or a remote request.
    NotMine,
    /// Not the length that this frame always has.
    Length,
    /// An encoder value that the device cannot have.
    Encoder,
    /// Content that the device cannot send.
    Unexpected,
    /// An answer to a request that this motor has not made: another program's, or one that came
    /// late. Not a bad frame, but not feedback either.
    Unasked,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotMine => f.write_str("not a frame of this motor"),
            Self::Length => f.write_str("not the length that this frame always has"),
            Self::Encoder => f.write_str("an encoder value that the device cannot have"),
            Self::Unexpected => f.write_str("content that the device cannot send"),
            Self::Unasked => f.write_str("an answer to a request that was not made here"),
        }
    }
}

impl core::error::Error for FrameError {}

/// The control loops that follow speeds and angles, where they run here and not in the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loops {
    /// What their effort is: [`TargetKind::Current`] in A, [`TargetKind::Torque`] in N m, or
    /// [`TargetKind::Duty`] as a share of the full voltage.
    pub effort: TargetKind,
    /// Their gains and limits. The speed loop's output limit is the largest effort.
    pub cascade: Cascade,
}

/// A motor, whatever it is connected by.
pub trait Motor: Send {
    /// The targets it takes, so that a port can refuse the others where the caller sees it.
    fn supports(&self) -> TargetSet;

    /// Takes a new target; it takes effect in the next [`update`](Self::update).
    ///
    /// # Errors
    /// [`TargetError`]; the old target stays.
    fn set_target(&mut self, target: Target) -> Result<(), TargetError>;

    /// The target it has.
    fn target(&self) -> Target;

    /// What it measured last; all zero before the first feedback.
    fn feedback(&self) -> Feedback;

    /// What is wrong with it, by its own account.
    fn fault(&self) -> Option<Fault>;

    /// One step of its control loops. Only maths: what it decides leaves with the next command.
    fn update(&mut self, dt: Seconds, drive: DriveMode);

    /// Asks for something beside a target. After [`Response::Pending`] all further requests are
    /// [`Busy`](RequestError::Busy), until [`answer`](Self::answer) has told how it went.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed.
    fn request(&mut self, request: Request) -> Result<Response, RequestError>;

    /// How a request went that was [`Pending`](Response::Pending), once that is known; told once.
    /// The motor itself gives up on a device that does not answer.
    fn answer(&mut self) -> Option<Result<Response, RequestError>> {
        None
    }

    /// Whether it does what its target says, given that it may run.
    fn condition(&self) -> Condition {
        Condition::Ready
    }

    /// The loops by which it follows [`Target::Speed`], [`Target::Angle`] and
    /// [`Target::TotalAngle`]; `None` if they run in the device.
    fn loops(&self) -> Option<Loops> {
        None
    }
}

/// A motor on a CAN bus.
pub trait CanMotor: Motor {
    /// Everything it occupies on its bus.
    fn wiring(&self) -> CanIds;

    /// Takes a frame of its own that arrived at `at`, and says what it was.
    ///
    /// # Errors
    /// [`FrameError`]; the frame changed nothing.
    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError>;

    /// Adds what it sends in this tick: called every tick, also when it is disarmed or lost, so
    /// that it can enable, poll, or say "zero". Frames of one tick leave in arbitration order, not
    /// in the order they were added: what must follow another frame waits for the next tick.
    ///
    /// # Errors
    /// [`TxFull`] if the batch has no room.
    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull>;

    /// Adds the frames that leave it without torque, whatever state it is in: what a panic
    /// handler sends.
    ///
    /// # Errors
    /// [`TxFull`] if the batch has no room.
    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull>;
}
