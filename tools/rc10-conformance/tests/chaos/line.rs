use rc10_conformance::{Declaration, LineBench};
use rc10_motor::unitree::{GoM8010, Rs485Bus};
use rc10_motor::{
    ArmSwitch, CommandError, MotorId, MotorStatus, Request, RequestError, Response, Safety, Target,
    TargetSet,
};
use rc10_sim::{Esc, Line};
use rc10_time::Micros;

use crate::chaos::random::Random;
use crate::chaos::scene::Scene;
use crate::chaos::story;

pub struct LineScene<'m> {
    bench: LineBench<'m>,
    device: Esc,
    motor: MotorId,
}

impl LineScene<'_> {
    pub fn play(
        declared: &Declaration,
        motor: &mut GoM8010,
        device: impl Fn(&Line, u8) -> Esc,
        seed: u64,
    ) -> Result<(), String> {
        let switch = ArmSwitch::new();
        let mut random = Random::new(seed);
        let safety = random.pick(&[Safety::COAST, Safety::BRAKE, Safety::HOLD]);
        let mut bench = LineBench::new(seed, &switch);
        let device = device(&bench.wire, declared.ids[0]);
        let motor = bench.bus.attach(motor, safety).unwrap();
        let mut scene = LineScene { bench, device, motor };
        story::tell(&mut scene, declared, safety.state, &mut random)
    }
}

impl Scene for LineScene<'_> {
    fn now(&self) -> Micros {
        self.bench.world.now()
    }

    fn switch(&self) -> &ArmSwitch {
        self.bench.bus.switch()
    }

    fn tick(&mut self) {
        self.bench.traffic.clear();
        self.bench.tick();
    }

    fn supports(&self) -> TargetSet {
        self.bench.bus.supports(self.motor)
    }

    fn command(&mut self, target: Target) -> Result<(), CommandError> {
        let now = self.now();
        self.bench.bus.command(self.motor, target, now)
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        self.bench.bus.request(self.motor, request)
    }

    fn response(&mut self) -> Option<Result<Response, RequestError>> {
        self.bench.bus.response(self.motor)
    }

    fn status(&self) -> MotorStatus {
        self.bench.status(self.motor)
    }

    fn link_timeout(&self) -> Micros {
        Rs485Bus::LINK_TIMEOUT
    }

    /// A motor that is lost is asked seldom.
    fn heals_within(&self) -> u32 {
        105
    }

    /// Each command says all there is to say, so one that restarted obeys the next.
    fn tells_restarts(&self) -> bool {
        false
    }

    fn esc(&self) -> &Esc {
        &self.device
    }

    fn set_cut(&self, cut: bool) {
        self.bench.wire.set_cut(cut);
    }

    fn set_shorted(&self, shorted: bool) {
        self.device.set_cut(shorted);
    }

    fn damage(&self, frames: u32) {
        self.bench.wire.damage_commands(frames / 2);
        self.bench.wire.damage_answers(frames / 3);
    }

    fn impersonate(&self, random: &mut Random) {
        self.bench.wire.inject(&random.bits().to_le_bytes());
    }

    fn wrong_frames(&self) -> Option<String> {
        let asked = self.bench.traffic.iter().filter(|(_, ours, _)| *ours).count();
        (asked > MOST_QUESTIONS).then(|| format!("asked {asked} times in a tick"))
    }
}

/// Questions to one motor in a tick: the one that is due, and one more where the first was in vain.
const MOST_QUESTIONS: usize = 2;
