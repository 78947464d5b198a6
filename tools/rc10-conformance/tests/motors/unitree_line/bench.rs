use std::ops::{Deref, DerefMut};

use rc10_can::Micros;
use rc10_conformance::LineBench;
use rc10_motor::unitree::{GoM8010, LineConfig};
use rc10_motor::{ArmSwitch, MotorId, Target};
use rc10_sim::unitree_line::{self, GoM8010 as Device, plant};
use rc10_sim::{Esc, Plant};

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

impl<'m> Bench<'m> {
    pub fn new(seed: u64, switch: &'m ArmSwitch) -> Self {
        let bench = LineBench::new(seed, switch);
        Self { bench, asked: Default::default(), sent: [[0; 17]; 15] }
    }

    /// A simulated motor of this id.
    pub fn device(&self, id: u8) -> Esc {
        self.device_with(id, plant())
    }

    pub fn device_with(&self, id: u8, plant: Plant) -> Esc {
        self.wire.add(Device::new(id), plant)
    }

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
