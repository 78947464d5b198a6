//! Conditions that hold in every millisecond, whatever happens.

use rc10_conformance::{Claim, Declaration};
use rc10_motor::{Condition, DriveMode, Link, MotorStatus, SafeState, TargetKind};
use rc10_sim::EscState;

use crate::chaos::scene::Scene;

/// Whether motors may move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Arm {
    #[default]
    Off,
    On,
    /// By the emergency stop, after it was armed.
    Stopped,
}

/// What the story has done to the motor, as the motor cannot know it.
#[derive(Clone, Copy, Debug, Default)]
pub struct World {
    pub arm: Arm,
    pub cut: bool,
    pub shorted: bool,
    pub unpowered: bool,
    pub muted: bool,
    /// The device has a fault that only ends with its power.
    pub faulty: bool,
    /// It is unplugged from its gateway, or deaf while it writes its flash.
    pub deaf: bool,
    /// Whether its gains are any: it may go anywhere.
    pub spoiled: bool,
    /// Milliseconds for which noise may still be on the wire.
    pub noisy: u32,
    /// Another node has spoken in the device's name.
    pub impersonated: bool,
    /// Milliseconds since the last command that was taken.
    pub command_age: u32,
    /// Power came back in the last few milliseconds.
    pub powered_for: u32,
}

impl World {
    /// Whether commands reach the device for certain.
    const fn is_quiet(&self) -> bool {
        !self.cut && !self.shorted && !self.deaf && self.noisy == 0
    }
}

pub struct Watch<'d> {
    declared: &'d Declaration,
    safe: SafeState,
    timeout: u32,
    /// Milliseconds for which it may not push, and its wire has been well.
    forbidden: u32,
    /// For which nothing of it can have been heard, and for which all of it should have been.
    silent: u32,
    well: u32,
    /// For which its torque has gone with the movement.
    with_movement: u32,
    /// For which it was not driven.
    rested: u32,
    /// Left of a soft start.
    soft: u32,
    last_torque: f64,
    /// Its angle less the shaft's, degrees, and what it had estimated by then.
    offset: Option<(f64, u32)>,
    pub zeroed: bool,
    /// Speed of late, rpm.
    fastest: f64,
}

/// Length of the soft start, ms.
const SOFT: u32 = 15;
/// Largest error of an angle at rest, degrees.
const ANGLE: f64 = 10.0;
/// Longest time until it is heard again, ms: for some motors tenths of a second.
const HEARD_WITHIN: u32 = 400;

impl<'d> Watch<'d> {
    pub fn new(declared: &'d Declaration, safe: SafeState, timeout: u32) -> Self {
        Self {
            declared,
            safe,
            timeout,
            forbidden: 0,
            silent: 0,
            well: 0,
            with_movement: 0,
            rested: 0,
            soft: 0,
            last_torque: 0.0,
            offset: None,
            zeroed: false,
            fastest: 0.0,
        }
    }

    pub fn look(&mut self, scene: &impl Scene, world: &World) -> Result<(), String> {
        let (status, state) = (scene.status(), scene.esc().state());
        if let Some(wrong) = scene.wrong_frames() {
            return Err(wrong);
        }
        Self::feedback(&status)?;
        self.link(&status, world)?;
        self.count(scene, &status, &state, world)?;
        let goes_with = state.torque * state.output_rpm > 0.0;
        self.with_movement = if goes_with { self.with_movement + 1 } else { 0 };
        let may_push = self.may_push(&status, world);
        self.forbidden = if may_push || !world.is_quiet() { 0 } else { self.forbidden + 1 };
        self.torque(&state)?;
        self.softness(scene, &status, world, goes_with)
    }

    fn feedback(status: &MotorStatus) -> Result<(), String> {
        let told = &status.feedback;
        let numbers = [
            ("speed", Some(told.speed.get())),
            ("angle", Some(told.angle.get())),
            ("current", told.current().map(rc10_app::Amps::get)),
            ("torque", told.torque().map(rc10_app::NewtonMetres::get)),
            ("temperature", told.temperature().map(rc10_app::Celsius::get)),
            ("controller", told.controller_temperature().map(rc10_app::Celsius::get)),
            ("supply", told.supply().map(rc10_app::Volts::get)),
        ];
        for (name, number) in numbers {
            if number.is_some_and(|number| !number.is_finite()) {
                return Err(format!("its {name} is {number:?}"));
            }
        }
        let angle = told.angle.get();
        if !(0.0..360.0).contains(&angle) {
            return Err(format!("its angle is {angle}"));
        }
        let total = told.total_angle.microdegrees().rem_euclid(360_000_000) as f64 * 1e-6;
        let off = (f64::from(angle) - total + 540.0).rem_euclid(360.0) - 180.0;
        if off.abs() > 0.1 {
            return Err(format!(
                "its angle is {angle}, and its total angle {total} over whole turns"
            ));
        }
        Ok(())
    }

    /// Online while it is heard, and only then.
    fn link(&mut self, status: &MotorStatus, world: &World) -> Result<(), String> {
        let deaf = world.cut || world.shorted || world.unpowered || world.muted;
        // What waited while the wires were shorted comes afterwards.
        self.silent = if deaf && world.noisy == 0 { self.silent + 1 } else { 0 };
        let ill = deaf || world.noisy > 0 || world.faulty || world.deaf;
        self.well = if ill { 0 } else { self.well + 1 };
        if self.silent > self.timeout + 3 && status.link == Link::Online && !world.impersonated {
            return Err(format!("online, {} ms after anything can have been heard", self.silent));
        }
        if self.well > HEARD_WITHIN && status.link != Link::Online {
            return Err(format!(
                "{:?}, though all has been well for {} ms",
                status.link, self.well
            ));
        }
        Ok(())
    }

    fn may_push(&self, status: &MotorStatus, world: &World) -> bool {
        let stopped = match world.arm {
            Arm::Off => return false,
            Arm::On => false,
            Arm::Stopped => true,
        };
        let stopped = stopped || world.command_age > 50 || status.fault.is_some();
        status.link == Link::Online && (!stopped || self.safe != SafeState::Coast)
    }

    /// Its turns are counted, or it says that they were estimated.
    fn count(
        &mut self,
        scene: &impl Scene,
        status: &MotorStatus,
        state: &EscState,
        world: &World,
    ) -> Result<(), String> {
        let told = &status.feedback;
        let (gaps, angle) = (told.turn_gaps, told.total_angle.microdegrees() as f64 * 1e-6);
        let offset = angle - state.output_degrees;
        // With a fault some tell no angle.
        let blinked = world.powered_for < HEARD_WITHIN && !scene.tells_restarts();
        let unsure = blinked
            || world.spoiled
            || status.link != Link::Online
            || status.fault.is_some()
            || world.impersonated;
        if std::mem::take(&mut self.zeroed) || unsure {
            self.offset = None;
            return Ok(());
        }
        // What is told may be as old as the link allows.
        self.fastest = state.output_rpm.abs().max(0.99 * self.fastest);
        let tolerance = ANGLE + self.fastest * 6e-3 * f64::from(self.timeout + 5);
        match self.offset {
            Some((before, then)) if then == gaps && (offset - before).abs() > tolerance => {
                let (jump, rpm) = (offset - before, state.output_rpm);
                Err(format!("its angle jumped by {jump:.1} degrees to {angle:.1}, at {rpm:.1} rpm"))
            }
            Some((_, then)) if then == gaps => Ok(()),
            _ => {
                self.offset = (state.output_rpm.abs() < 1.0).then_some((offset, gaps));
                Ok(())
            }
        }
    }

    fn torque(&self, state: &EscState) -> Result<(), String> {
        let free = self.declared.coasts_freely == Claim::Does;
        let pushes = free || self.with_movement > self.declared.stops_within;
        let none = 1.5 * f64::from(self.declared.no_torque.get());
        if self.forbidden > self.declared.stops_within && pushes && state.torque.abs() > none {
            let (torque, millis) = (state.torque, self.forbidden);
            return Err(format!("{torque:.3} N m at the shaft {millis} ms after it had to stop"));
        }
        Ok(())
    }

    fn softness(
        &mut self,
        scene: &impl Scene,
        status: &MotorStatus,
        world: &World,
        goes_with: bool,
    ) -> Result<(), String> {
        let state = scene.esc().state();
        let last = std::mem::replace(&mut self.last_torque, state.torque);
        let full = f64::from(self.declared.full_torque.get());
        let driven = matches!(status.drive, DriveMode::Brake | DriveMode::Hold | DriveMode::Run)
            && status.condition != Condition::Starting;
        let blinks = world.powered_for == 1 && scene.tells_restarts() && !world.impersonated;
        if driven {
            if self.rested >= 3 || blinks {
                self.soft = SOFT;
            }
            self.rested = 0;
        } else {
            self.rested += 1;
        }
        if !world.is_quiet() || world.unpowered {
            // What is lost on the way makes a step of what is soft.
            self.soft = 0;
        }
        if self.soft == 0 {
            return Ok(());
        }
        self.soft -= 1;
        let brakes = status.drive != DriveMode::Run
            || matches!(status.target.kind(), TargetKind::Brake | TargetKind::Handbrake);
        if !goes_with && (brakes || self.declared.coasts_freely != Claim::Does) {
            return Ok(());
        }
        let torque = state.torque;
        let grown = if torque * last > 0.0 { torque.abs() - last.abs() } else { torque.abs() };
        // A frame that comes late, or is left out for a question, makes a larger step.
        let most = self.declared.softness * full * 1.5;
        if grown > most {
            return Err(format!(
                "starting, its torque grew from {last:.3} to {torque:.3} N m in 1 ms, at most \
                 {most:.3} ({:?}, {:?})",
                status.drive, status.target
            ));
        }
        Ok(())
    }
}
