use std::ops::{Deref, DerefMut};

use rc10_conformance::LineBench;
use rc10_motor::unitree::{GoM8010, LineConfig};
use rc10_motor::{ArmSwitch, MotorId, Safety, Target};
use rc10_sim::unitree_line::{self, GoM8010 as Device, plant};
use rc10_sim::{Esc, Plant};
use rc10_time::Micros;

use crate::motors::leak;

/// The kit's bench, and what our motors were told on it.
pub struct Bench<'m> {
    bench: LineBench<'m>,
    /// When each motor of ours was asked, by its id.
    pub asked: [Vec<Micros>; 15],
    /// The newest command of each.
    pub sent: [[u8; 17]; 15],
}

impl<'m> Deref for Bench<'m> {
    type Target = LineBench<'m>;

    fn deref(&self) -> &LineBench<'m> {
        &self.bench
    }
}

impl DerefMut for Bench<'_> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.bench
    }
}

/// Our motors of ids 0 .. `count`.
pub fn motors(count: u8) -> Vec<GoM8010> {
    (0..count).map(|id| GoM8010::new(LineConfig::new(id)).unwrap()).collect()
}

impl Bench<'static> {
    fn new() -> Self {
        let bench = LineBench::new(10, leak(ArmSwitch::new()));
        Self { bench, asked: Default::default(), sent: [[0; 17]; 15] }
    }

    /// One motor and its device, heard and armed.
    pub fn armed(config: LineConfig, plant: Plant, safety: Safety) -> (Self, MotorId, Esc) {
        let mut bench = Self::new();
        let device = bench.wire.add(Device::new(config.id), plant);
        let motor = leak(GoM8010::new(config).unwrap());
        let id = bench.bus.attach(motor, safety).unwrap();
        bench.wait(5);
        bench.bus.switch().arm().unwrap();
        (bench, id, device)
    }

    /// Motors of ids 0 .. `count` and their devices, not armed.
    pub fn of(count: u8, safety: Safety) -> (Self, Vec<MotorId>, Vec<Esc>) {
        let mut bench = Self::new();
        let devices = (0..count).map(|id| bench.wire.add(Device::new(id), plant())).collect();
        let ours = leak(motors(count)).iter_mut();
        let ids = ours.map(|motor| bench.bus.attach(motor, safety).unwrap()).collect();
        (bench, ids, devices)
    }
}

impl Bench<'_> {
    pub fn tick(&mut self) {
        self.bench.tick();
        for (at, is_ours, bytes) in self.bench.traffic.drain(..) {
            if is_ours {
                let id = usize::from(bytes[2] & 0xF);
                self.asked[id].push(at);
                self.sent[id] = bytes.try_into().unwrap();
            }
        }
    }

    pub fn wait(&mut self, millis: u32) {
        (0..millis).for_each(|_| self.tick());
    }

    /// `millis` ticks, with the target repeated before each.
    pub fn hold(&mut self, motor: MotorId, target: Target, millis: u32) {
        self.hold_all(&[motor], target, millis);
    }

    pub fn hold_all(&mut self, motors: &[MotorId], target: Target, millis: u32) {
        for _ in 0..millis {
            let now = self.world.now();
            for &motor in motors {
                self.bus.command(motor, target, now).unwrap();
            }
            self.tick();
        }
    }

    /// The newest command to a motor.
    pub fn told(&self, id: u8) -> unitree_line::Command {
        unitree_line::Command::read(&self.sent[usize::from(id)]).unwrap()
    }
}

/// The command that the device obeys.
pub fn obeys(device: &Esc) -> unitree_line::Command {
    device.with(|device: &mut Device| device.command).unwrap()
}

/// The number of a motor on its line, as `attach` counts.
pub fn nth(index: usize) -> rc10_motor::MotorId {
    rc10_motor::numbers([rc10_motor::Place::Line(1); 16]).nth(index).unwrap()
}
