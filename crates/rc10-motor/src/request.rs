pub use rc10_app::Gains;
use rc10_app::{Amps, ConfigError, NewtonMetres, Rpm};

/// A request to a motor beside its targets.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Request {
    /// Zero is here from now on. Only while not driven: commands of old numbers would move it.
    SetZero,
    /// The same of a driven motor, as in homing: what is sought stays, under another number.
    SetZeroOfDriven,
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
    /// The shaft's angle now is zero, also after power-off. Only while the robot is disarmed.
    StoreZero,
    /// Reads a register of the device: four bytes, little endian ([`Response::Register`]).
    ReadRegister(u16),
    /// Writes four bytes, little endian, into a register until power-off. Only while disarmed.
    WriteRegister(u16, u32),
    /// Turns slowly while the robot is disarmed, and only this motor: for 80 ms at this speed, or not at
    /// all any more at zero; repeat it. Loops that run here use a fifth of their limit. A target from a
    /// task ends it, as does arming, a stop, a fault, a lost link, or twice its speed: then the next
    /// one is refused, too ([`RequestError::TooFast`]), until zero is asked for, or nothing for 0.2 s.
    /// Refused while a task commands the motor ([`RequestError::Busy`]).
    Jog(Rpm),
    /// The device keeps its registers after power-off. Only while disarmed: it wears and stops.
    SaveRegisters,
}

/// The outcome of a request that was not refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Response {
    /// The request is done.
    Done,
    /// The device was asked; [`Motor::response`](crate::Motor::response) tells. Not at a port.
    Pending,
    /// Raw value of the register.
    Register(u32),
}

/// Why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum RequestError {
    /// This motor cannot do that.
    #[error("this motor cannot do that")]
    Unsupported,
    /// A number in it cannot be used.
    #[error(transparent)]
    #[cfg_attr(feature = "record", serde(skip))]
    Config(#[from] ConfigError),
    /// The request needs feedback, and none came yet.
    #[error("the motor has not been heard of yet")]
    NoFeedback,
    /// The one before has not been carried out yet.
    #[error("the request before has not been carried out yet")]
    Busy,
    /// The bus has no such motor.
    #[error("the bus has no such motor")]
    NoSuchMotor,
    /// Only while the robot is disarmed.
    #[error("only while the robot is disarmed")]
    NotWhileArmed,
    /// Only while the motor is not driven.
    #[error("only while the motor is not driven")]
    WhileDriven,
    /// The motor turned twice as fast as a jog asked for.
    #[error("it turned twice as fast as asked for")]
    TooFast,
    /// The device did not answer in time: whether it did what was asked is not known.
    #[error("the device did not answer in time")]
    Timeout,
    /// The device refused, with this code of its own.
    #[error("the device refused, code {0}")]
    Refused(u32),
}
