//! Where a story plays: a motor of ours, its device, and what lies between them.

use rc10_can::{CanFrame, CanPort, ErrorState, IdPattern};
use rc10_conformance::{Bench, Claim, Declaration};
use rc10_motor::{
    ArmSwitch, CanIds, CanMotor, CommandError, MotorId, MotorStatus, Request, RequestError,
    Response, Safety, Target, TargetSet,
};
use rc10_sim::{Bus, Esc, SimPort};
use rc10_time::Micros;

use crate::chaos::random::Random;
use crate::chaos::story;

pub trait Scene {
    fn now(&self) -> Micros;
    fn switch(&self) -> &ArmSwitch;
    /// One millisecond.
    fn tick(&mut self);
    fn supports(&self) -> TargetSet;
    fn command(&mut self, target: Target) -> Result<(), CommandError>;
    fn request(&mut self, request: Request) -> Result<Response, RequestError>;
    fn response(&mut self) -> Option<Result<Response, RequestError>>;
    fn status(&self) -> MotorStatus;
    fn link_timeout(&self) -> Micros;
    /// Milliseconds from the end of a cut to its next command.
    fn heals_within(&self) -> u32;
    /// Whether its device is enabled step by step, so that one restarted in a blink is found out.
    fn tells_restarts(&self) -> bool;
    /// The device.
    fn esc(&self) -> &Esc;
    fn set_cut(&self, cut: bool);
    /// Shorts the wires: nothing can be sent, and a controller leaves its bus.
    fn set_shorted(&self, shorted: bool);
    /// Noise on the next frames.
    fn damage(&self, frames: u32);
    /// Another node sends what only the device should.
    fn impersonate(&self, random: &mut Random);
    /// The error in what was sent in the last tick.
    fn wrong_frames(&self) -> Option<String>;
}

pub struct CanScene<'m> {
    bench: Bench<'m>,
    switch: &'m ArmSwitch,
    port: SimPort,
    esc: Esc,
    motor: MotorId,
    ids: CanIds,
    off_since: Option<Micros>,
    tells_restarts: bool,
}

/// A motor sends no more than this in a tick.
const MOST_FRAMES: usize = 2;

impl CanScene<'_> {
    pub fn play(
        declared: &Declaration,
        motor: &mut dyn CanMotor,
        device: impl Fn(&Bus, u8) -> Esc,
        seed: u64,
    ) -> Result<(), String> {
        let switch = ArmSwitch::new();
        let mut random = Random::new(seed);
        let safety = random.pick(&[Safety::COAST, Safety::BRAKE, Safety::HOLD]);
        let mut bench = Bench::new(seed, &switch);
        let esc = device(&bench.wire, declared.ids[0]);
        let (ids, model) = (motor.can_ids(), motor.name().model);
        let motor = bench.attach(motor, safety).unwrap();
        let port = bench.wire.port();
        // A VESC, and a GO-M8010-6, obey whatever the next command says.
        let obeys_anyone = model == "VESC" || model.starts_with("GO-M8010");
        let tells_restarts = declared.disables == Claim::Does && !obeys_anyone;
        let mut scene = CanScene {
            bench,
            switch: &switch,
            port,
            esc,
            motor,
            ids,
            off_since: None,
            tells_restarts,
        };
        story::tell(&mut scene, declared, safety.state, &mut random)
    }
}

impl Scene for CanScene<'_> {
    fn now(&self) -> Micros {
        self.bench.world.now()
    }

    fn switch(&self) -> &ArmSwitch {
        self.switch
    }

    fn tick(&mut self) {
        self.bench.tick();
        if self.port.health().state < ErrorState::BusOff {
            self.off_since = None;
            return;
        }
        let now = self.now();
        let since = *self.off_since.get_or_insert(now);
        if now.since(since) >= Micros::from_millis(5) {
            self.off_since = None;
            self.port.cancel_pending();
            self.port.recover();
        }
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
        self.ids.link_timeout()
    }

    fn heals_within(&self) -> u32 {
        5
    }

    fn tells_restarts(&self) -> bool {
        self.tells_restarts
    }

    fn esc(&self) -> &Esc {
        &self.esc
    }

    fn set_cut(&self, cut: bool) {
        self.bench.wire.set_cut(cut);
    }

    fn set_shorted(&self, shorted: bool) {
        self.bench.wire.set_shorted(shorted);
    }

    fn damage(&self, frames: u32) {
        self.bench.wire.damage(frames);
    }

    fn impersonate(&self, random: &mut Random) {
        let received = self.ids.received();
        let any = random.pick(received);
        let receive = random.pick(&[received[0], any]);
        let id = any_of(&receive.pattern, random);
        let mut data = random.bits().to_le_bytes();
        if let Some(guard) = receive.guard() {
            let byte = &mut data[usize::from(guard.byte)];
            *byte = *byte & !guard.mask | guard.value & guard.mask;
        }
        let len = if random.one_in(4) { random.below(9) as usize } else { receive.len.into() };
        self.bench.wire.inject(&CanFrame::data_frame(id, &data[..len]).unwrap());
    }

    fn wrong_frames(&self) -> Option<String> {
        let frames = self.bench.sent.frames();
        if frames.len() > MOST_FRAMES {
            return Some(format!("{} frames in a tick", frames.len()));
        }
        let declared = |frame: &CanFrame| {
            let mut transmits = self.ids.transmitted().iter();
            transmits.any(|own| own.pattern.matches(frame))
        };
        let stray = frames.iter().find(|frame| !declared(frame))?;
        Some(format!("it sent {stray:?}, which it does not declare"))
    }
}

/// Any identifier that a pattern has.
fn any_of(pattern: &IdPattern, random: &mut Random) -> rc10_can::embedded_can::Id {
    use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
    #[expect(clippy::cast_possible_truncation, reason = "low bits are meant")]
    let any = random.bits() as u32;
    match pattern.id() {
        Id::Standard(id) => {
            let mask = pattern.mask() & 0x7FF;
            let raw = u32::from(id.as_raw()) & mask | any & !mask & 0x7FF;
            StandardId::new(u16::try_from(raw).unwrap()).unwrap().into()
        }
        Id::Extended(id) => {
            let mask = pattern.mask() & 0x1FFF_FFFF;
            ExtendedId::new(id.as_raw() & mask | any & !mask & 0x1FFF_FFFF).unwrap().into()
        }
    }
}
