use rc10_app::Seconds;
use rc10_can::{CanPort, Submitted};
use rc10_motor::ArmSwitch;
use rc10_motor::{
    AttachError, CanMotor, CommandError, MotorBus, MotorId, MotorStatus, Safety, Target, TxBatch,
};
use rc10_sim::{Bus, BusConfig, SimPort, World};
use rc10_time::Micros;

/// A bus of our motors on a simulated wire, ticked every millisecond by a plain loop. The motors
/// are the caller's, and so are the devices that it puts on the [`wire`](Self::wire).
pub struct Bench<'m> {
    /// Time, and everything in it.
    pub world: World,
    /// The wire.
    pub wire: Bus,
    /// The bus.
    pub bus: MotorBus<'m>,
    port: SimPort,
    /// The frames of the last tick.
    pub sent: TxBatch,
    /// Frames that found no room so far.
    pub refused: u32,
}

impl<'m> Bench<'m> {
    /// An empty bus; all chance comes from `seed`.
    pub fn new(seed: u64, switch: &'m ArmSwitch) -> Self {
        let mut world = World::new(seed);
        let wire = world.add_bus(BusConfig::default());
        let port = wire.port();
        let bus = MotorBus::new(switch);
        Self { world, wire, bus, port, sent: TxBatch::new(), refused: 0 }
    }

    /// Puts a motor of ours on the bus. Fails with [`AttachError`], as the bus says.
    pub fn attach(
        &mut self,
        motor: &'m mut dyn CanMotor,
        safety: Safety,
    ) -> Result<MotorId, AttachError> {
        self.bus.attach(motor, safety)
    }

    /// One tick, one millisecond later: frames in, motors, frames out.
    pub fn tick(&mut self) {
        self.tick_with(Seconds::new(0.001));
    }

    /// The same, with the motors told that another time has passed.
    pub fn tick_with(&mut self, dt: Seconds) {
        let now = self.world.now() + Micros::from_millis(1);
        self.world.advance(now);
        while let Some((frame, at)) = self.port.receive() {
            self.bus.on_frame(&frame, at);
        }
        self.sent.clear();
        let full = self.bus.tick(now, dt, &mut self.sent).is_err();
        self.refused += u32::from(full);
        for (frame, stream) in self.sent.entries() {
            self.refused += u32::from(self.port.submit_as(frame, stream) == Submitted::Refused);
        }
    }

    /// `millis` ticks without a new command.
    pub fn wait(&mut self, millis: u32) {
        (0..millis).for_each(|_| self.tick());
    }

    /// `millis` ticks, with the target repeated before each. Fails if the motor does not take it;
    /// then no time has passed.
    pub fn hold(
        &mut self,
        motor: MotorId,
        target: Target,
        millis: u32,
    ) -> Result<(), CommandError> {
        for _ in 0..millis {
            let now = self.world.now();
            self.bus.command(motor, target, now)?;
            self.tick();
        }
        Ok(())
    }

    /// Status of a motor; that of a motor never heard if there is no such motor.
    pub fn status(&self, motor: MotorId) -> MotorStatus {
        self.bus.status(motor, self.world.now()).unwrap_or(MotorStatus::NEW)
    }
}
