//! What the rules need of a bench, whatever the motors on it are connected by.

use std::ops::{Deref, DerefMut};

use rc10_app::Seconds;
use rc10_can::{CanFrame, CanPort};
use rc10_motor::pending::Outcome;
use rc10_motor::unitree::{GoM8010, Rs485Bus};
use rc10_motor::{
    ArmSwitch, CanMotor, CommandError, DriveMode, Motor, MotorId, MotorStatus, Request, Safety,
    Target, TargetSet, Tick, TxBatch,
};
use rc10_sim::{Bus, Esc, Line};
use rc10_time::Micros;

use crate::mirror::Mirror;
use crate::{Bench, LineBench};

/// A motor to be tried.
pub(crate) enum Subject {
    OnBus(Box<dyn CanMotor>),
    OnLine(Box<GoM8010>),
}

impl Subject {
    /// Silent for longer it is lost, ms.
    pub(crate) fn link_timeout(&self) -> u32 {
        let timeout = match self {
            Self::OnBus(motor) => motor.can_ids().link_timeout(),
            Self::OnLine(_) => Rs485Bus::LINK_TIMEOUT,
        };
        u32::try_from(timeout.get() / 1000).unwrap_or(u32::MAX)
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

    /// Packs the frames of one tick, which are not sent.
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

/// A frame or bytes on a wire, and when they were over.
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

/// Makes motors, and benches for them.
#[derive(Clone, Copy)]
pub(crate) enum Connection<'a> {
    ByBus { motor: &'a dyn Fn(u8) -> Box<dyn CanMotor>, device: &'a dyn Fn(&Bus, u8) -> Esc },
    ByLine { motor: &'a dyn Fn(u8) -> GoM8010, device: &'a dyn Fn(&Line, u8) -> Esc },
}

impl<'a> Connection<'a> {
    pub(crate) fn motor(self, id: u8) -> Subject {
        match self {
            Self::ByBus { motor, .. } => Subject::OnBus(motor(id)),
            Self::ByLine { motor, .. } => Subject::OnLine(Box::new(motor(id))),
        }
    }

    /// An empty wire; `mirror` is that of the motors on it.
    pub(crate) fn bench(self, seed: u64, mirror: Mirror, switch: &'a ArmSwitch) -> Harness<'a> {
        let wired = match self {
            Self::ByBus { device, .. } => Wired::Bus(Bench::new(seed, switch), device),
            Self::ByLine { device, .. } => Wired::Line(LineBench::new(seed, switch), device),
        };
        Harness { wired, mirror }
    }
}

/// Motors of ours and what watches over them, on a wire with their devices.
pub(crate) struct Harness<'m> {
    wired: Wired<'m>,
    mirror: Mirror,
}

/// A bench, and what puts a device with an identifier on its wire.
enum Wired<'m> {
    Bus(Bench<'m>, &'m dyn Fn(&Bus, u8) -> Esc),
    Line(LineBench<'m>, &'m dyn Fn(&Line, u8) -> Esc),
}

/// The same of both benches.
macro_rules! on_either {
    ($wired:expr, $bench:ident => $result:expr) => {
        match $wired {
            Wired::Bus($bench, _) => $result,
            Wired::Line($bench, _) => $result,
        }
    };
}

impl<'m> Harness<'m> {
    /// Puts a motor of ours on the wire; the text says why it does not go.
    pub(crate) fn attach(
        &mut self,
        motor: &'m mut Subject,
        safety: Safety,
    ) -> Result<MotorId, String> {
        let attached = match (&mut self.wired, motor) {
            (Wired::Bus(bench, _), Subject::OnBus(motor)) => bench.attach(&mut **motor, safety),
            (Wired::Line(bench, _), Subject::OnLine(motor)) => bench.bus.attach(motor, safety),
            _ => return Err("it belongs on another wire".to_owned()),
        };
        attached.map_err(|error| error.to_string())
    }

    /// Puts a device with this identifier on the wire.
    pub(crate) fn device(&self, id: u8) -> Esc {
        match &self.wired {
            Wired::Bus(bench, device) => device(&bench.wire, id),
            Wired::Line(bench, device) => device(&bench.wire, id),
        }
    }

    pub(crate) fn now(&self) -> Micros {
        on_either!(&self.wired, bench => bench.world.now())
    }

    pub(crate) fn command(&mut self, motor: MotorId, target: Target) -> Result<(), CommandError> {
        let (target, now) = (self.mirror.target(target), self.now());
        on_either!(&mut self.wired, bench => bench.bus.command(motor, target, now))
    }

    pub(crate) fn request(&mut self, motor: MotorId, request: Request) -> Outcome {
        on_either!(&mut self.wired, bench => bench.bus.request(motor, request))
    }

    pub(crate) fn response(&mut self, motor: MotorId) -> Option<Outcome> {
        on_either!(&mut self.wired, bench => bench.bus.response(motor))
    }

    pub(crate) fn supports(&self, motor: MotorId) -> TargetSet {
        on_either!(&self.wired, bench => bench.bus.supports(motor))
    }

    pub(crate) fn status(&self, motor: MotorId) -> MotorStatus {
        self.mirror.status(on_either!(&self.wired, bench => bench.status(motor)))
    }

    /// A millisecond, with a tick at its end; the motors are told that `dt` has passed.
    pub(crate) fn tick(&mut self, dt: Seconds) {
        on_either!(&mut self.wired, bench => bench.tick_with(dt));
    }

    /// A tick of a motor that is not attached, so that no bus supervises it, and a millisecond.
    pub(crate) fn tick_unwatched(&mut self, motor: &mut Subject, dt: Seconds, drive: DriveMode) {
        motor.update(&Tick { dt, ..Tick::new(drive) });
        match (&self.wired, motor) {
            (Wired::Bus(bench, _), Subject::OnBus(motor)) => {
                let mut batch = TxBatch::new();
                let _ = motor.pack_command(&mut batch);
                submit(&bench.wire, &batch);
            }
            (Wired::Line(bench, _), Subject::OnLine(motor)) => {
                bench.wire.port().send(&motor.pack_command());
            }
            _ => (),
        }
        self.pass();
    }

    /// The program panics: what is for a panic handler is sent, and what waited is not. No tick may
    /// follow.
    pub(crate) fn panic(&mut self) {
        match &self.wired {
            Wired::Bus(bench, _) => {
                let mut image = TxBatch::new();
                let _ = bench.bus.coast_image(&mut image);
                bench.wire.port().cancel_pending();
                submit(&bench.wire, &image);
            }
            Wired::Line(bench, _) => {
                let image = Rs485Bus::coast_image();
                // The first may meet an answer.
                (0..2).for_each(|_| bench.wire.port().send(&image));
            }
        }
    }

    /// A millisecond without a tick.
    pub(crate) fn pass(&mut self) {
        let next = self.now() + Micros::from_millis(1);
        on_either!(&mut self.wired, bench => bench.world.advance(next));
    }

    /// Cuts our side off the wire, or connects it again.
    pub(crate) fn set_cut(&mut self, cut: bool) {
        on_either!(&self.wired, bench => bench.wire.set_cut(cut));
    }

    /// Takes the traffic since the last time.
    pub(crate) fn take_traffic(&mut self) -> Vec<Traffic> {
        match &mut self.wired {
            Wired::Bus(bench, _) => {
                let entries = bench.wire.take_trace().into_iter();
                let traffic = entries.map(|entry| Traffic {
                    at: entry.at,
                    is_ours: entry.from_controller,
                    what: Sent::Frame(entry.frame),
                });
                traffic.collect()
            }
            Wired::Line(bench, _) => {
                let heard = std::mem::take(&mut bench.traffic).into_iter();
                let traffic = heard.map(|(at, is_ours, bytes)| {
                    let what = Sent::Bytes(bytes);
                    Traffic { at, is_ours, what }
                });
                traffic.collect()
            }
        }
    }
}

fn submit(wire: &Bus, batch: &TxBatch) {
    let mut port = wire.port();
    for (frame, stream) in batch.entries() {
        // A full controller is a slow wire, not a fault of the motor.
        let _ = port.submit_as(frame, stream);
    }
}
