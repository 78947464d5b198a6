//! Motors on an RS-485 line, as the rules see them.

use rc10_app::Seconds;
use rc10_can::Micros;
use rc10_motor::unitree::{GoM8010, Rs485Bus};
use rc10_motor::{
    ArmSwitch, CommandError, DriveMode, MotorId, MotorStatus, Request, RequestError, Response,
    Safety, Target, TargetSet, Tick,
};
use rc10_sim::{Line, LineMotor};

use crate::LineBench;
use crate::harness::{Connection, Device, Harness, Sent, Subject, Traffic};
use crate::mirror::Mirror;

/// Motors on an RS-485 line.
pub(crate) struct ByLine<'a> {
    pub(crate) motor: &'a dyn Fn(u8) -> GoM8010,
    pub(crate) device: &'a dyn Fn(&Line, u8) -> LineMotor,
}

impl Connection for ByLine<'_> {
    fn motor(&self, id: u8) -> Subject {
        Subject::OnLine(Box::new((self.motor)(id)))
    }

    fn bench<'m>(
        &'m self,
        seed: u64,
        mirror: Mirror,
        switch: &'m ArmSwitch,
    ) -> Box<dyn Harness<'m> + 'm> {
        Box::new(OnLine { bench: LineBench::new(seed, switch), mirror, device: self.device })
    }
}

struct OnLine<'m> {
    bench: LineBench<'m>,
    mirror: Mirror,
    device: &'m dyn Fn(&Line, u8) -> LineMotor,
}

impl<'m> Harness<'m> for OnLine<'m> {
    fn attach(&mut self, motor: &'m mut Subject, safety: Safety) -> Result<MotorId, String> {
        match motor {
            Subject::OnLine(motor) => {
                self.bench.line.attach(motor, safety).map_err(|error| error.to_string())
            }
            Subject::OnBus(_) => Err("it belongs on a bus".to_owned()),
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
        self.bench.line.command(motor, self.mirror.target(target), now)
    }

    fn request(&mut self, motor: MotorId, request: Request) -> Result<Response, RequestError> {
        self.bench.line.request(motor, request)
    }

    fn response(&mut self, motor: MotorId) -> Option<Result<Response, RequestError>> {
        self.bench.line.response(motor)
    }

    fn supports(&self, motor: MotorId) -> TargetSet {
        self.bench.line.supports(motor)
    }

    fn status(&self, motor: MotorId) -> MotorStatus {
        self.mirror.status(self.bench.status(motor))
    }

    fn tick(&mut self, dt: Seconds) {
        self.bench.tick_with(dt);
    }

    fn tick_unwatched(&mut self, motor: &mut Subject, dt: Seconds, drive: DriveMode) {
        motor.update(&Tick { dt, ..Tick::new(drive) });
        if let Subject::OnLine(motor) = motor {
            self.bench.wire.port().send(&motor.pack_command());
        }
        self.pass();
    }

    fn panic(&mut self) {
        let image = Rs485Bus::coast_image();
        // The first may meet an answer.
        for _ in 0..2 {
            self.bench.wire.port().send(&image);
        }
    }

    fn pass(&mut self) {
        let next = self.now() + Micros::from_millis(1);
        self.bench.world.advance(next);
    }

    fn set_cut(&mut self, cut: bool) {
        self.bench.wire.set_cut(cut);
    }

    fn take_traffic(&mut self) -> Vec<Traffic> {
        let heard = std::mem::take(&mut self.bench.traffic).into_iter();
        let traffic =
            heard.map(|(at, is_ours, bytes)| Traffic { at, is_ours, what: Sent::Bytes(bytes) });
        traffic.collect()
    }
}
