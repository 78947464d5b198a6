//! A bus of our own code on a simulated wire, ticked by a plain loop.

pub mod browser;
pub mod made;
pub mod mixed;
pub mod python;
pub mod scratch;
pub mod served;

use rc10_app::Seconds;
use rc10_can::CanPort;
use rc10_motor::dji::{self, Dji, Model};
use rc10_motor::{ArmSwitch, CanMotor, MotorBus, MotorId, MotorStatus, Safety, Target, TxBatch};
use rc10_sim::{BusConfig, Esc, EscConfig, SimPort, World};
use rc10_time::Micros;

/// The simulated device for a model of ours, with its bare motor.
pub fn twin(model: &Model, id: u8) -> EscConfig {
    let sim = match model.name {
        name if name == dji::M3508.name => rc10_sim::Model::C620,
        name if name == dji::M2006.name => rc10_sim::Model::C610,
        name if name == dji::GM6020_CURRENT.name => rc10_sim::Model::Gm6020Current,
        name if name == dji::GM6020_VOLTAGE.name => rc10_sim::Model::Gm6020Voltage,
        name => panic!("no simulated {name}"),
    };
    EscConfig::new(sim, id)
}

/// Everything but the motors, which the caller owns.
pub struct Bench<'m> {
    pub world: World,
    pub wire: rc10_sim::Bus,
    pub port: SimPort,
    pub bus: MotorBus<'m>,
    pub tx: TxBatch,
    pub refused: u32,
}

impl<'m> Bench<'m> {
    pub fn new(seed: u64, switch: &'m ArmSwitch) -> Self {
        let mut world = World::new(seed);
        let wire = world.add_bus(BusConfig::default());
        let port = wire.port();
        Self { world, wire, port, bus: MotorBus::new(switch), tx: TxBatch::new(), refused: 0 }
    }

    /// Puts a motor of ours on the bus, and its simulated device on the wire.
    pub fn add(
        &mut self,
        motor: &'m mut dyn CanMotor,
        safety: Safety,
        device: EscConfig,
    ) -> (MotorId, Esc) {
        let esc = self.wire.add_esc(device).unwrap();
        (self.bus.attach(motor, safety).unwrap(), esc)
    }

    pub fn now(&self) -> Micros {
        self.world.now()
    }

    /// One tick, one millisecond later.
    pub fn tick(&mut self) {
        let now = self.world.now() + Micros::from_millis(1);
        self.world.advance(now);
        while let Some((frame, at)) = self.port.receive() {
            self.bus.on_frame(&frame, at);
        }
        self.tx.clear();
        self.bus.tick(now, Seconds::new(0.001), &mut self.tx).unwrap();
        for frame in self.tx.frames() {
            if self.port.submit(frame) == rc10_can::Submitted::Refused {
                self.refused += 1;
            }
        }
    }

    /// `millis` ticks, with the target repeated in each.
    pub fn hold(&mut self, motor: MotorId, target: Target, millis: u32) {
        for _ in 0..millis {
            self.command(motor, target);
            self.tick();
        }
    }

    pub fn command(&mut self, motor: MotorId, target: Target) {
        let now = self.world.now();
        self.bus.command(motor, target, now).unwrap();
    }

    pub fn status(&self, motor: MotorId) -> MotorStatus {
        self.bus.status(motor, self.world.now()).unwrap()
    }
}

/// A motor with its stock gearbox and gains.
pub fn motor(model: &'static Model, id: u8) -> Dji {
    Dji::new(dji::Config::new(model, id)).unwrap()
}
