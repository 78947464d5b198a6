//! Events, and how a story ends.

use std::collections::VecDeque;

use rc10_app::{Amps, Degrees, NewtonMetres, Rpm, RpmPerSecond, TotalAngle};
use rc10_conformance::{Declaration, Trial};
use rc10_motor::{Condition, Gains, Impedance, Link, Motion, Request, Response, SafeState, Target};
use rc10_sim::EscFault;

use crate::chaos::random::Random;
use crate::chaos::scene::Scene;
use crate::chaos::watch::{Arm, Watch, World};

/// How long a story is, ms.
const LENGTH: u32 = 2500;
/// Mean time between two events, ms.
const SELDOM: u32 = 40;
/// A device answers within, ms.
const LONGEST_ANSWER: u32 = 1000;
/// Number of the last events that a report has.
const REMEMBERED: usize = 14;

struct Player<'a, S> {
    scene: &'a mut S,
    declared: &'a Declaration,
    watch: Watch<'a>,
    world: World,
    /// Repeated in every millisecond.
    target: Option<Target>,
    /// When what was done is undone, by what it was.
    ends: [u32; 5],
    /// For how long an answer has been waited for.
    waited: Option<u32>,
    happened: VecDeque<String>,
}

/// Troubles that last for a while.
#[derive(Clone, Copy, Debug)]
enum Trouble {
    Cut,
    Shorted,
    Unpowered,
    Muted,
    Load,
}

const TROUBLES: [Trouble; 5] =
    [Trouble::Cut, Trouble::Shorted, Trouble::Unpowered, Trouble::Muted, Trouble::Load];

/// Plays a story to its end.
pub fn tell(
    scene: &mut impl Scene,
    declared: &Declaration,
    safe: SafeState,
    random: &mut Random,
) -> Result<(), String> {
    let timeout = u32::try_from(scene.link_timeout().get().div_ceil(1000)).unwrap();
    let mut player = Player {
        scene,
        declared,
        watch: Watch::new(declared, safe, timeout),
        world: World { command_age: 1000, powered_for: 1000, ..World::default() },
        target: None,
        ends: [0; 5],
        waited: None,
        happened: VecDeque::new(),
    };
    let outcome = player.live(random).and_then(|()| player.end_well(random));
    outcome.map_err(|what| {
        let happened: Vec<_> = player.happened.into();
        format!("{safe:?}: {what} (at {})\n  {}", player.scene.now(), happened.join("\n  "))
    })
}

impl<S: Scene> Player<'_, S> {
    fn note(&mut self, what: String) {
        if self.happened.len() == REMEMBERED {
            self.happened.pop_front();
        }
        self.happened.push_back(format!("{}: {what}", self.scene.now()));
    }

    fn live(&mut self, random: &mut Random) -> Result<(), String> {
        let hostile = random.one_in(3);
        for _ in 0..LENGTH {
            if random.one_in(SELDOM) {
                self.event(random, hostile);
            }
            for trouble in TROUBLES {
                let left = &mut self.ends[trouble as usize];
                *left = left.saturating_sub(1);
                if *left == 0 {
                    self.set(trouble, false, 0.0);
                }
            }
            self.tick()?;
        }
        Ok(())
    }

    fn tick(&mut self) -> Result<(), String> {
        self.world.command_age += 1;
        if let Some(target) = self.target {
            match self.scene.command(target) {
                Ok(()) if !target.is_finite() => return Err(format!("it took {target:?}")),
                Ok(()) => self.world.command_age = 0,
                Err(_) => (),
            }
        }
        self.scene.tick();
        // Without a motor driving against it, a load would turn it faster than it can turn itself.
        if self.scene.esc().state().output_rpm.abs() > 2.0 * f64::from(self.declared.cruise.get()) {
            self.set(Trouble::Load, false, 0.0);
        }
        if self.world.noisy == 1 {
            // Frames that were to be damaged and never came.
            self.scene.damage(0);
        }
        self.world.noisy = self.world.noisy.saturating_sub(1);
        self.world.powered_for += 1;
        if let Some(waited) = &mut self.waited {
            *waited += 1;
            let waited = *waited;
            if let Some(answer) = self.scene.response() {
                self.waited = None;
                self.watch.zeroed = true;
                self.note(format!("it answers {answer:?}"));
            } else if waited > LONGEST_ANSWER {
                return Err(format!("no answer for {waited} ms"));
            }
        }
        self.watch.look(self.scene, &self.world)
    }

    fn set(&mut self, trouble: Trouble, begins: bool, share: f64) {
        let World { cut, shorted, unpowered, muted, .. } = &mut self.world;
        let (is, scene) = match trouble {
            Trouble::Cut => (cut, &*self.scene),
            Trouble::Shorted => (shorted, &*self.scene),
            Trouble::Unpowered => (unpowered, &*self.scene),
            Trouble::Muted => (muted, &*self.scene),
            Trouble::Load => {
                self.scene.esc().set_load(share * f64::from(self.declared.load.get()));
                return;
            }
        };
        if std::mem::replace(is, begins) == begins {
            return;
        }
        match trouble {
            Trouble::Cut => scene.set_cut(begins),
            Trouble::Shorted => scene.set_shorted(begins),
            Trouble::Unpowered => scene.esc().set_power(!begins),
            Trouble::Muted => scene.esc().set_feedback(!begins),
            Trouble::Load => (),
        }
        if !begins {
            match trouble {
                Trouble::Unpowered => {
                    (self.world.powered_for, self.world.faulty) = (0, false);
                    self.world.deaf = false;
                }
                // What waited is sent first, and a controller comes back to its bus.
                Trouble::Cut => {
                    self.world.noisy = self.world.noisy.max(self.scene.heals_within());
                }
                Trouble::Shorted => self.world.noisy = self.world.noisy.max(30),
                Trouble::Muted | Trouble::Load => (),
            }
        }
        self.note(format!("{trouble:?} {}", if begins { "begins" } else { "ends" }));
    }

    fn event(&mut self, random: &mut Random, hostile: bool) {
        match random.below(20) {
            0..=3 => {
                let trouble = random.pick(&TROUBLES);
                let longest = random.pick(&[5, 9, 30, 150, 400]);
                self.ends[trouble as usize] = 1 + random.below(longest);
                self.set(trouble, true, random.signed().into());
            }
            4..=8 => {
                self.target = self.any_target(random);
                self.note(format!("commanded {:?}", self.target));
            }
            9..=12 => self.arm(random),
            13 => {
                let faults = [
                    EscFault::OverTemperature,
                    EscFault::CommunicationLost,
                    EscFault::OverCurrent,
                    EscFault::OverVoltage,
                    EscFault::UnderVoltage,
                    EscFault::Encoder,
                ];
                let fault = random.pick(&faults);
                if random.one_in(2) && self.scene.esc().inject(fault) {
                    self.world.faulty = true;
                    self.world.deaf |= fault == EscFault::CommunicationLost;
                    self.note(format!("{fault:?}"));
                }
            }
            14 | 15 => self.ask(Request::ClearFault),
            16 | 17 => {
                let request = any_request(random);
                self.ask(request);
            }
            18 => {
                let frames = random.below(20);
                self.world.noisy = self.world.noisy.max(10 + frames);
                self.scene.damage(frames);
                self.note(format!("noise on {frames} frames"));
            }
            _ if hostile => {
                self.world.impersonated = true;
                for _ in 0..=random.below(4) {
                    self.scene.impersonate(random);
                }
                self.note("an impostor".to_owned());
            }
            _ => (),
        }
    }

    fn arm(&mut self, random: &mut Random) {
        let switch = self.scene.switch();
        let what = match random.below(8) {
            0..=4 => {
                if switch.arm().is_ok() {
                    self.world.arm = Arm::On;
                }
                "arm"
            }
            5 => {
                switch.disarm();
                self.world.arm = Arm::Off;
                "disarm"
            }
            6 => {
                switch.emergency_stop();
                if self.world.arm == Arm::On {
                    self.world.arm = Arm::Stopped;
                }
                "emergency stop"
            }
            _ => {
                switch.reset();
                if self.world.arm == Arm::Stopped {
                    self.world.arm = Arm::Off;
                }
                "reset"
            }
        };
        self.note(what.to_owned());
    }

    fn ask(&mut self, request: Request) {
        let busy = self.waited.is_some();
        let answer = self.scene.request(request);
        self.watch.zeroed = true;
        if request == Request::SaveRegisters && answer == Ok(Response::Pending) {
            // It may be deaf meanwhile, and a little longer.
            self.world.noisy = self.world.noisy.max(200);
        }
        match (request, answer) {
            (_, Ok(Response::Pending)) if !busy => self.waited = Some(0),
            (Request::SpeedGains(_) | Request::AngleGains(_), Ok(_)) => self.world.spoiled = true,
            _ => (),
        }
        self.note(format!("asked {request:?}: {answer:?}"));
    }

    fn any_target(&self, random: &mut Random) -> Option<Target> {
        if random.one_in(6) {
            return None;
        }
        if random.one_in(2) {
            return Some(random.pick(&self.declared.trials).target);
        }
        let supports = self.scene.supports();
        loop {
            let target = any_target(random, self.declared);
            if supports.contains(target.kind()) {
                return Some(target);
            }
        }
    }

    /// Everything is made well again, and the motor has to follow.
    fn end_well(&mut self, random: &mut Random) -> Result<(), String> {
        self.target = None;
        for trouble in TROUBLES {
            self.set(trouble, false, 0.0);
        }
        self.scene.damage(0);
        self.note("all is made well".to_owned());
        // Faults of a device end with its power.
        self.scene.switch().disarm();
        self.scene.switch().reset();
        self.world.arm = Arm::Off;
        self.set(Trouble::Unpowered, true, 0.0);
        self.wait(200)?;
        self.set(Trouble::Unpowered, false, 0.0);
        self.wait(500)?;
        for attempt in 0.. {
            self.wait_for_answer()?;
            self.ask(Request::ClearFault);
            self.wait_for_answer()?;
            self.wait(100)?;
            let fault = self.scene.status().fault;
            if fault.is_none() {
                break;
            } else if attempt == 3 {
                return Err(format!("{fault:?} cannot be cleared"));
            }
        }
        if random.one_in(2) {
            self.ask(Request::SetZeroOfDriven);
        }
        self.ask(Request::CurrentLimit(Amps::new(1e6)));
        self.ask(Request::TorqueLimit(NewtonMetres::new(1e6)));
        self.scene.switch().arm().map_err(|_| "it cannot be armed".to_owned())?;
        self.world.arm = Arm::On;
        self.follow(random)
    }

    fn wait(&mut self, millis: u32) -> Result<(), String> {
        (0..millis).try_for_each(|_| self.tick())
    }

    fn wait_for_answer(&mut self) -> Result<(), String> {
        while self.waited.is_some() {
            self.tick()?;
        }
        Ok(())
    }

    fn follow(&mut self, random: &mut Random) -> Result<(), String> {
        let from = self.scene.status().feedback.total_angle;
        let turns = f64::from(from.degrees().get()).abs() / 360.0;
        let trials: Vec<Trial> = self
            .declared
            .trials
            .iter()
            .copied()
            .filter(|trial| {
                match trial.target {
                    Target::Speed(_) | Target::Angle(_) => true,
                    // With an impostor it may count from anywhere.
                    Target::TotalAngle(_) => !self.world.impersonated && turns < 20.0,
                    _ => false,
                }
            })
            .collect();
        let trial = random.pick(&trials);
        self.target = Some(trial.target);
        self.note(format!("armed, and commanded {:?}", trial.target));
        if self.scene.command(trial.target).is_err() {
            return Ok(());
        }
        let (mut kept, mut off) = (0, f64::INFINITY);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let patience = 2 * trial.within + (turns.min(20.0) * 3000.0) as u32 + 500;
        for _ in 0..patience {
            self.tick()?;
            off = self.off(&trial);
            kept = if off <= trial.tolerance { kept + 1 } else { 0 };
            if kept >= 50 && (off.is_finite()) {
                return self.is_well();
            }
        }
        self.is_well()?;
        if self.world.spoiled {
            return Ok(());
        }
        Err(format!("{:?} is missed by {off:.2} after {patience} ms", trial.target))
    }

    fn is_well(&self) -> Result<(), String> {
        let status = self.scene.status();
        if status.link == Link::Online && status.condition == Condition::Ready {
            return Ok(());
        }
        Err(format!("in the end it is {:?} and {:?}", status.link, status.condition))
    }

    /// How far it is from what is asked for.
    fn off(&self, trial: &Trial) -> f64 {
        let (status, state) = (self.scene.status(), self.scene.esc().state());
        match trial.target {
            Target::Speed(rpm) => (state.output_rpm - f64::from(rpm.get())).abs(),
            Target::Angle(degrees) => {
                let off = f64::from(status.feedback.angle.get() - degrees.get());
                ((off + 540.0).rem_euclid(360.0) - 180.0).abs()
            }
            Target::TotalAngle(angle) => {
                let told = status.feedback.total_angle.microdegrees();
                (told - angle.microdegrees()).abs() as f64 * 1e-6
            }
            _ => f64::INFINITY,
        }
    }
}

fn any_number(random: &mut Random, usual: f32) -> f32 {
    match random.below(8) {
        0 => f32::NAN,
        1 => random.pick(&[f32::INFINITY, f32::NEG_INFINITY]),
        2 => random.pick(&[f32::MAX, f32::MIN, f32::MIN_POSITIVE, -0.0, 1e10]),
        _ => random.signed() * usual,
    }
}

fn any_target(random: &mut Random, declared: &Declaration) -> Target {
    let full = declared.full_torque.get();
    match random.below(12) {
        0 => Target::Coast,
        1 => Target::Current(Amps::new(any_number(random, 10.0))),
        2 => Target::Duty(any_number(random, 1.0)),
        3 => Target::Speed(Rpm::new(any_number(random, 2.0 * declared.cruise.get()))),
        4 => Target::Angle(Degrees::new(any_number(random, 720.0))),
        5 => {
            let far = random.pick(&[i64::MAX, i64::MIN, 0, 1_000_000, -500_000_000]);
            Target::TotalAngle(TotalAngle::from_microdegrees(far))
        }
        6 => Target::Torque(NewtonMetres::new(any_number(random, full))),
        7 => Target::Impedance(Impedance {
            angle: Degrees::new(any_number(random, 400.0)),
            speed: Rpm::new(any_number(random, 50.0)),
            torque: NewtonMetres::new(any_number(random, full)),
            kp: any_number(random, 30.0).abs(),
            kd: any_number(random, 2.0).abs(),
        }),
        8 => Target::Brake(Amps::new(any_number(random, 20.0))),
        9 | 10 => {
            let far = random.pick(&[i64::MAX, i64::MIN, 0, 1_000_000, -500_000_000]);
            let acceleration = RpmPerSecond::new(any_number(random, 1000.0));
            Target::Motion(Motion {
                angle: random.one_in(2).then(|| TotalAngle::from_microdegrees(far)),
                speed: Rpm::new(any_number(random, 2.0 * declared.cruise.get())),
                acceleration,
                inertia: any_number(random, full),
                effort: if random.one_in(2) { 0.0 } else { any_number(random, full) },
            })
        }
        _ => Target::Handbrake(Amps::new(any_number(random, 20.0))),
    }
}

fn any_request(random: &mut Random) -> Request {
    let gains = |random: &mut Random| Gains {
        kp: any_number(random, 1.0),
        ki: any_number(random, 1.0),
        kd: any_number(random, 0.01),
    };
    match random.below(10) {
        0..=3 => Request::SetZeroOfDriven,
        4 => Request::StoreZero,
        5 => Request::ReadRegister(random.pick(&[0, 10, 21, 81, 0x7005, 0x7019, u16::MAX])),
        6 => Request::SaveRegisters,
        7 => Request::CurrentLimit(Amps::new(any_number(random, 10.0))),
        8 => Request::TorqueLimit(NewtonMetres::new(any_number(random, 5.0))),
        _ if random.one_in(2) => Request::SpeedGains(gains(random)),
        _ => Request::AngleGains(gains(random)),
    }
}
