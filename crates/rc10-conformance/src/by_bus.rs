//! Motors on a CAN bus, as the rules see them.

use rc10_app::Seconds;
use rc10_can::{CanPort, Micros};
use rc10_motor::{
    ArmSwitch, CanMotor, CommandError, DriveMode, MotorId, MotorStatus, Request, RequestError,
    Response, Safety, Target, TargetSet, Tick, TxBatch,
};
use rc10_sim::{Bus, Esc};

use crate::Bench;
use crate::harness::{Connection, Device, Harness, Sent, Subject, Traffic};
use crate::mirror::Mirror;

/// Motors on a CAN bus.
pub(crate) struct ByBus<'a> {
    pub(crate) motor: &'a dyn Fn(u8) -> Box<dyn CanMotor>,
    pub(crate) device: &'a dyn Fn(&Bus, u8) -> Esc,
}

impl Connection for ByBus<'_> {
    fn motor(&self, id: u8) -> Subject {
        Subject::OnBus((self.motor)(id))
    }

    fn bench<'m>(
        &'m self,
        seed: u64,
        mirror: Mirror,
        switch: &'m ArmSwitch,
    ) -> Box<dyn Harness<'m> + 'm> {
        Box::new(OnBus { bench: Bench::new(seed, switch), mirror, device: self.device })
    }
}

struct OnBus<'m> {
    bench: Bench<'m>,
    mirror: Mirror,
    device: &'m dyn Fn(&Bus, u8) -> Esc,
}

impl OnBus<'_> {
    fn submit(&self, batch: &TxBatch) {
        let mut port = self.bench.wire.port();
        for (frame, stream) in batch.entries() {
            // A full controller is a slow wire, not a fault of the motor.
            let _ = port.submit_as(frame, stream);
        }
    }
}

impl<'m> Harness<'m> for OnBus<'m> {
    fn attach(&mut self, motor: &'m mut Subject, safety: Safety) -> Result<MotorId, String> {
        match motor {
            Subject::OnBus(motor) => {
                self.bench.attach(&mut **motor, safety).map_err(|error| error.to_string())
            }
            Subject::OnLine(_) => Err("it belongs on a line".to_owned()),
        }
    }

    fn device(&self, id: u8) -> Box<dyn Device> {
        Box::new((self.device)(&self.bench.wire, id))
    }

    fn now(&self) -> Micros {
        self.bench.world.now()
    }

    fn command(&mut self, motor: MotorId, target: Target) -> Result<(), CommandError> {
        let now = self.now();
        self.bench.bus.command(motor, self.mirror.target(target), now)
    }

    fn request(&mut self, motor: MotorId, request: Request) -> Result<Response, RequestError> {
        self.bench.bus.request(motor, request)
    }

    fn response(&mut self, motor: MotorId) -> Option<Result<Response, RequestError>> {
        self.bench.bus.response(motor)
    }

    fn supports(&self, motor: MotorId) -> TargetSet {
        self.bench.bus.supports(motor)
    }

    fn status(&self, motor: MotorId) -> MotorStatus {
        self.mirror.status(self.bench.status(motor))
    }

    fn tick(&mut self, dt: Seconds) {
        self.bench.tick_with(dt);
    }

    fn tick_unwatched(&mut self, motor: &mut Subject, dt: Seconds, drive: DriveMode) {
        motor.update(&Tick { dt, ..Tick::new(drive) });
        if let Subject::OnBus(motor) = motor {
            let mut batch = TxBatch::new();
            let _ = motor.pack_command(&mut batch);
            self.submit(&batch);
        }
        self.pass();
    }

    fn panic(&mut self) {
        let mut image = TxBatch::new();
        let _ = self.bench.bus.coast_image(&mut image);
        self.bench.wire.port().cancel_pending();
        self.submit(&image);
    }

    fn pass(&mut self) {
        let next = self.now() + Micros::from_millis(1);
        self.bench.world.advance(next);
    }

    fn set_cut(&mut self, cut: bool) {
        self.bench.wire.set_cut(cut);
    }

    fn take_traffic(&mut self) -> Vec<Traffic> {
        let entries = self.bench.wire.take_trace().into_iter();
        let traffic = entries.map(|entry| Traffic {
            at: entry.at,
            is_ours: entry.from_controller,
            what: Sent::Frame(entry.frame),
        });
        traffic.collect()
    }
}
