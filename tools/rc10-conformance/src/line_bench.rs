use rc10_app::Seconds;
use rc10_motor::unitree::{Rs485Bus, Step};
use rc10_motor::{ArmSwitch, CommandError, MotorId, MotorStatus, Target};
use rc10_sim::{Line, LineConfig, UartPort, World};
use rc10_time::Micros;

/// A line of our motors on a simulated one, ticked every millisecond and polled in between by a
/// plain loop: as [`Bench`](crate::Bench), for RS-485.
pub struct LineBench<'m> {
    /// Time, and everything in it.
    pub world: World,
    /// The wire.
    pub wire: Line,
    /// The line.
    pub bus: Rs485Bus<'m>,
    /// What went over the wire: when it was handed over or taken, whether it is ours, the bytes.
    pub traffic: Vec<(Micros, bool, Vec<u8>)>,
    port: UartPort,
}

impl<'m> LineBench<'m> {
    /// An empty line; all chance comes from `seed`.
    pub fn new(seed: u64, switch: &'m ArmSwitch) -> Self {
        let mut world = World::new(seed);
        let wire = world.add_line(LineConfig::default());
        let (bus, port) = (Rs485Bus::new(switch), wire.port());
        Self { world, wire, bus, traffic: Vec::new(), port }
    }

    /// All that is to be done on the line in the next millisecond, and then a tick.
    pub fn tick(&mut self) {
        self.tick_with(Seconds::new(0.001));
    }

    /// The same, with the motors told that another time has passed.
    pub fn tick_with(&mut self, dt: Seconds) {
        let tick = self.world.now() + Micros::from_millis(1);
        loop {
            let now = self.world.now();
            let received = self.port.take_received();
            self.bus.on_bytes(&received, now);
            if !received.is_empty() {
                self.traffic.push((now, false, received));
            }
            if now >= tick {
                break;
            }
            match self.bus.poll(now) {
                Step::Send(bytes) => {
                    self.port.send(&bytes);
                    self.traffic.push((now, true, bytes.to_vec()));
                }
                Step::Wait(until) => {
                    let next = self.world.next_event().min(until.into()).min(tick.into());
                    self.world.advance_to(next);
                }
            }
        }
        self.bus.tick(tick, dt);
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
