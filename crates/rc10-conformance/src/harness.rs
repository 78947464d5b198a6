//! What the rules need of a bench, whatever the motors on it are connected by.

use std::ops::{Deref, DerefMut};

use rc10_app::Seconds;
use rc10_can::{CanFrame, Micros};
use rc10_motor::unitree::{GoM8010, Rs485Bus};
use rc10_motor::{
    ArmSwitch, CanMotor, CommandError, DriveMode, Motor, MotorId, MotorName, MotorStatus, Request,
    RequestError, Response, Safety, Target, TargetSet, TxBatch,
};
use rc10_sim::{Esc, EscFault, EscState, LineMotor};

use crate::mirror::Mirror;

/// A motor to be tried.
pub(crate) enum Subject {
    OnBus(Box<dyn CanMotor>),
    OnLine(Box<GoM8010>),
}

impl Subject {
    pub(crate) fn name(&self) -> MotorName {
        Motor::name(&**self)
    }

    /// Silent for longer it is lost.
    pub(crate) fn link_timeout(&self) -> Micros {
        match self {
            Self::OnBus(motor) => motor.can_ids().link_timeout(),
            Self::OnLine(_) => Rs485Bus::LINK_TIMEOUT,
        }
    }

    /// Between two reports of its device.
    pub(crate) fn report_period(&self) -> Micros {
        let Self::OnBus(motor) = self else {
            return Micros::from_millis(1);
        };
        let ids = motor.can_ids();
        let rates = ids.received().iter().map(|receive| receive.rate.per_second());
        let slowest = rates.filter(|rate| *rate > 0).min().unwrap_or(1000);
        Micros::new(1_000_000 / u64::from(slowest))
    }

    /// Its frames of one tick, which are not sent.
    pub(crate) fn pack(&mut self) {
        match self {
            // What does not fit is a matter of other rules.
            Self::OnBus(motor) => drop(motor.pack_command(&mut TxBatch::new())),
            Self::OnLine(motor) => drop(motor.pack_command()),
        }
    }
}

impl Deref for Subject {
    type Target = dyn Motor;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::OnBus(motor) => &**motor,
            Self::OnLine(motor) => &**motor,
        }
    }
}

impl DerefMut for Subject {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            Self::OnBus(motor) => &mut **motor,
            Self::OnLine(motor) => &mut **motor,
        }
    }
}

/// A simulated device with its motor, wherever it is plugged in.
pub(crate) trait Device {
    fn state(&self) -> EscState;
    fn set_power(&self, powered: bool);
    fn set_feedback(&self, enabled: bool);
    fn set_load(&self, torque: f64);
    fn inject(&self, fault: EscFault) -> bool;
}

macro_rules! is_device {
    ($handle:ty) => {
        impl Device for $handle {
            fn state(&self) -> EscState {
                self.state()
            }

            fn set_power(&self, powered: bool) {
                self.set_power(powered);
            }

            fn set_feedback(&self, enabled: bool) {
                self.set_feedback(enabled);
            }

            fn set_load(&self, torque: f64) {
                self.set_load(torque);
            }

            fn inject(&self, fault: EscFault) -> bool {
                self.inject(fault)
            }
        }
    };
}

is_device!(Esc);
is_device!(LineMotor);

/// What went over a wire, and when it was over.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Traffic {
    pub(crate) at: Micros,
    pub(crate) is_ours: bool,
    pub(crate) what: Sent,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Sent {
    Frame(CanFrame),
    Bytes(Vec<u8>),
}

/// Motors of ours and what watches over them, on a wire with their devices.
pub(crate) trait Harness<'m> {
    /// Puts a motor of ours on the wire; the text says why it does not go.
    fn attach(&mut self, motor: &'m mut Subject, safety: Safety) -> Result<MotorId, String>;
    /// Puts a device with this identifier on the wire.
    fn device(&self, id: u8) -> Box<dyn Device>;
    fn now(&self) -> Micros;
    fn command(&mut self, motor: MotorId, target: Target) -> Result<(), CommandError>;
    fn request(&mut self, motor: MotorId, request: Request) -> Result<Response, RequestError>;
    fn response(&mut self, motor: MotorId) -> Option<Result<Response, RequestError>>;
    fn supports(&self, motor: MotorId) -> TargetSet;
    fn status(&self, motor: MotorId) -> MotorStatus;
    /// A millisecond, with a tick at its end; the motors are told that `dt` has passed.
    fn tick(&mut self, dt: Seconds);
    /// A tick of a motor that is not attached, so that no bus supervises it, and a millisecond.
    fn tick_unwatched(&mut self, motor: &mut Subject, dt: Seconds, drive: DriveMode);
    /// The program panics: what is for a panic handler is sent, and what waited is not. No tick may
    /// follow.
    fn panic(&mut self);
    /// A millisecond without a tick.
    fn pass(&mut self);
    /// Cuts our side off the wire, or connects it again.
    fn set_cut(&mut self, cut: bool);
    /// What went over the wire since the last time.
    fn take_traffic(&mut self) -> Vec<Traffic>;
}

/// Makes motors, and benches for them.
pub(crate) trait Connection {
    fn motor(&self, id: u8) -> Subject;
    /// An empty wire; `mirror` is that of the motors on it.
    fn bench<'m>(
        &'m self,
        seed: u64,
        mirror: Mirror,
        switch: &'m ArmSwitch,
    ) -> Box<dyn Harness<'m> + 'm>;
}
