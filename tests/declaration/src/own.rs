use core::num::NonZeroU8;

use rc10_motor::rc10_app::{Amps, Gear};
use rc10_motor::{
    CanMotor, Fault, Feedback, FrameError, FrameKind, Link, Motor, Request, RequestError,
    Response, Target, TargetError, TargetSet, Tick, TxBatch, TxFull,
};

/// A VESC on seven pole pairs.
pub const fn vesc(id: u8) -> rc10_motor::vesc::Config {
    let amps = Amps::new(10.0);
    let currents = rc10_motor::vesc::Currents { limit: amps, brake: amps, handbrake: amps };
    let pairs = NonZeroU8::new(7).unwrap();
    let scale = rc10_motor::vesc::ElectricalScale::new(pairs, Gear::DIRECT);
    rc10_motor::vesc::Config::new(id, scale, currents)
}

/// A motor of a team's own: it does nothing.
pub struct Own(OtherDevice);

impl Own {
    pub const fn new(device: OtherDevice) -> Result<Self, ConfigError> {
        Ok(Self(device))
    }
}

impl Motor for Own {
    fn name(&self) -> MotorName {
        self.0.name
    }

    fn supports(&self) -> TargetSet {
        TargetSet::NONE
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        Err(TargetError::Unsupported(target.kind()))
    }

    fn target(&self) -> Target {
        Target::Coast
    }

    fn feedback(&self) -> Feedback {
        Feedback::default()
    }

    fn fault(&self) -> Option<Fault> {
        None
    }

    fn update(&mut self, _: &Tick) {}

    fn request(&mut self, _: Request) -> Result<Response, RequestError> {
        Err(RequestError::Unsupported)
    }
}

impl CanMotor for Own {
    fn can_ids(&self) -> CanIds {
        self.0.ids
    }

    fn unpack_feedback(
        &mut self,
        _: &CanFrame,
        _: Micros,
        _: Link,
    ) -> Result<FrameKind, FrameError> {
        Err(FrameError::NotMine)
    }

    fn pack_command(&mut self, _: &mut TxBatch) -> Result<(), TxFull> {
        Ok(())
    }

    fn coast_frames(&self, _: &mut TxBatch) -> Result<(), TxFull> {
        Ok(())
    }
}
