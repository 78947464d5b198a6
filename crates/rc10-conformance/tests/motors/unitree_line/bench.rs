use rc10_app::Seconds;
use rc10_can::Micros;
use rc10_motor::unitree::{GoM8010, Step, UnitreeLine};
use rc10_motor::{ArmSwitch, MotorId, MotorStatus, Target};
use rc10_sim::unitree_line::{self, GoM8010 as Device, plant};
use rc10_sim::{Line, LineConfig, LineMotor, Plant, SerialPort, World};

/// A line of our motors on a simulated one, ticked every millisecond and polled in between by a
/// plain loop.
pub struct Bench<'m> {
    pub world: World,
    pub wire: Line,
    pub line: UnitreeLine<'m>,
    port: SerialPort,
    /// When each motor of ours was asked, by its id.
    pub asked: [Vec<Micros>; 15],
    /// The newest command of each.
    pub sent: [[u8; 17]; 15],
}

/// Our motors of ids 0 .. `count`.
pub fn motors(count: u8) -> Vec<GoM8010> {
    (0..count).map(|id| GoM8010::new(id).unwrap()).collect()
}

impl<'m> Bench<'m> {
    pub fn new(seed: u64, switch: &'m ArmSwitch) -> Self {
        let mut world = World::new(seed);
        let wire = world.add_line(LineConfig::default());
        let (line, port) = (UnitreeLine::new(switch), wire.port());
        Self { world, wire, line, port, asked: Default::default(), sent: [[0; 17]; 15] }
    }

    /// A simulated motor of this id.
    pub fn device(&self, id: u8) -> LineMotor {
        self.wire.add(Device::new(id), plant())
    }

    pub fn device_with(&self, id: u8, plant: Plant) -> LineMotor {
        self.wire.add(Device::new(id), plant)
    }

    /// One tick, one millisecond later, and all that is to be done on the line up to then.
    pub fn tick(&mut self) {
        let tick = self.world.now() + Micros::from_millis(1);
        loop {
            let now = self.world.now();
            let received = self.port.take_received();
            self.line.on_bytes(&received, now);
            if now >= tick {
                break;
            }
            match self.line.poll(now) {
                Step::Send(bytes) => {
                    let id = usize::from(bytes[2] & 0xF);
                    self.asked[id].push(now);
                    self.sent[id] = bytes;
                    self.port.send(&bytes);
                }
                Step::Wait(until) => {
                    let next = self.world.next_event().min(until.into()).min(tick.into());
                    self.world.advance_to(next);
                }
            }
        }
        self.line.tick(tick, Seconds::new(0.001));
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
                self.line.command(motor, target, now).unwrap();
            }
            self.tick();
        }
    }

    pub fn status(&self, motor: MotorId) -> MotorStatus {
        self.line.status(motor, self.world.now()).unwrap()
    }

    /// What a motor is told now.
    pub fn told(&self, id: u8) -> unitree_line::Command {
        unitree_line::Command::read(&self.sent[usize::from(id)]).unwrap()
    }
}

/// What the device obeys.
pub fn obeys(device: &LineMotor) -> unitree_line::Command {
    device.with(|device: &mut Device| device.command()).unwrap()
}
