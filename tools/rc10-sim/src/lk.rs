//! LK-TECH drives (MF, MG) from the drive's side, after LK CAN manual V2.3.
//!
//! Not in the manual, so assumed: whether a drive is on after power-on (a setting here), that a drive
//! that is off answers all commands and carries out `88` alone, that the answers to the multi-motor
//! frame look like those to `A1`, the drive's own gains.

mod codec;

use std::ops::RangeInclusive;

use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;
use rc10_time::Micros;

use crate::device::{Device, EscFault, Outbox, Taken, Winding, set_if};
use crate::motor::Shaft;
use crate::plant::Plant;

pub use codec::{Order, State, decode, encode_echo, encode_health, encode_state};

/// Everything above is for this many steps of torque current, ±.
const MOST_STEPS: i16 = 2048;
/// Above this the drive switches itself off, °C; our estimate.
const TOO_HOT: f64 = 100.0;
/// Below this too, V; our estimate.
const TOO_LOW: f64 = 7.0;
/// Steps of the encoder's value in answers: of 16 bits (there are drives with 14 and 15, too).
const ENCODER_STEPS: f64 = 65_536.0;
/// The identifier by which four drives are commanded at once.
const SHARED: u16 = 0x280;

/// Error bits of the answer to `9A` (manual V2.3: bits 0 and 3; newer firmware: all).
mod error {
    pub const UNDER_VOLTAGE: u8 = 1;
    pub const OVER_VOLTAGE: u8 = 1 << 1;
    pub const OVER_TEMPERATURE: u8 = 1 << 3;
    pub const OVER_CURRENT: u8 = 1 << 4;
    pub const COMMANDS_STOPPED: u8 = 1 << 7;
}

/// Settings of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Settings {
    /// 1 ..= 32.
    pub id: u8,
    /// Amperes at 2048 steps: 33 (MG), 16.5 (MF).
    pub full_scale: f64,
    /// Obeys the multi-motor frame, and no other.
    pub multi_motor: bool,
    /// Does what a frame says when the next one comes.
    pub is_late: bool,
    /// Is on after power-on.
    pub starts_on: bool,
    /// Longest time without a command; then it switches itself off.
    pub command_timeout: Option<Micros>,
}

impl Settings {
    /// An MG, as it is sold; off after power-on.
    pub const fn mg(id: u8) -> Self {
        Self {
            id,
            full_scale: 33.0,
            multi_motor: false,
            is_late: false,
            starts_on: false,
            command_timeout: None,
        }
    }

    const fn ids(&self) -> RangeInclusive<u8> {
        1..=if self.multi_motor { 4 } else { 32 }
    }

    /// An MF, else the same.
    pub const fn mf(id: u8) -> Self {
        Self { full_scale: 16.5, ..Self::mg(id) }
    }
}

/// Setpoint of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// No torque.
    Nothing,
    /// Torque current, steps.
    Current(i16),
    /// Rotor speed, degrees/s.
    Speed(f64),
    /// Rotor angle over many turns, degrees, and the largest speed, degrees/s.
    Angle(f64, f64),
}

/// One drive's electronics.
#[derive(Debug)]
pub struct Drive {
    settings: Settings,
    /// Whether it carries commands out.
    pub is_on: bool,
    /// The setpoint.
    pub goal: Goal,
    late: Option<Order>,
    /// The error bits.
    pub errors: u8,
    causes: u8,
    last_command: Micros,
    /// Integral of the speed loop, A.
    integral: f64,
}

impl Drive {
    /// With these settings; `None` if the identifier cannot be.
    pub fn new(settings: Settings) -> Option<Self> {
        settings.ids().contains(&settings.id).then(|| Self::started(settings, Micros::ZERO))
    }

    const fn started(settings: Settings, now: Micros) -> Self {
        Self {
            settings,
            is_on: settings.starts_on || settings.multi_motor,
            goal: Goal::Nothing,
            late: None,
            errors: 0,
            causes: 0,
            last_command: now,
            integral: 0.0,
        }
    }

    fn own_id(&self) -> u16 {
        0x140 + u16::from(self.settings.id)
    }

    const fn amps_per_step(&self) -> f64 {
        self.settings.full_scale / MOST_STEPS as f64
    }

    #[expect(clippy::cast_possible_truncation, reason = "saturates, as the drive's own numbers do")]
    fn state(&self, shaft: &Shaft) -> State {
        State {
            temperature: shaft.temperature.round() as i8,
            current: (shaft.current / self.amps_per_step()).round() as i16,
            speed: (shaft.rotor_rpm() * 6.0).round() as i16,
            encoder: (shaft.rotor_angle() * ENCODER_STEPS) as u16,
        }
    }

    fn answer(&self, byte: u8, order: Order, shaft: &Shaft) -> [u8; 8] {
        let state = self.state(shaft);
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        match order {
            Order::Off | Order::Stop | Order::Run => encode_echo(byte),
            Order::ReadHealth | Order::ClearErrors => {
                encode_health(byte, state.temperature, shaft.plant.supply, self.errors)
            }
            Order::ReadPhases => {
                // A standing vector: all of it in phase A.
                let amps = (shaft.current * 64.0).round() as i16;
                codec::encode_phases(state.temperature, [amps, -amps / 2, -amps / 2])
            }
            Order::ReadManyTurns => {
                codec::encode_many_turns((shaft.rotor_turns() * 36_000.0).round() as i64)
            }
            Order::ReadOneTurn => codec::encode_one_turn((shaft.rotor_angle() * 36_000.0) as u16),
            _ => encode_state(byte, state),
        }
    }

    fn obey(&mut self, order: Order, shaft: &Shaft) {
        let degrees = |centidegrees: i32| f64::from(centidegrees) / 100.0;
        let limit = |limit: Option<u16>| limit.map_or(f64::INFINITY, f64::from);
        let here = shaft.rotor_turns() * 360.0;
        match order {
            Order::Off => (self.is_on, self.goal) = (false, Goal::Nothing),
            Order::Run => self.is_on = self.errors == 0,
            Order::ClearErrors => self.errors &= self.causes,
            Order::Stop => self.goal = Goal::Nothing,
            _ if !self.is_on => (),
            Order::Current(steps) => self.steer(Goal::Current(steps)),
            Order::Speed(speed) => self.steer(Goal::Speed(degrees(speed))),
            Order::TurnTo(angle, most) => self.steer(Goal::Angle(degrees(angle), limit(most))),
            Order::TurnBy(angle, most) => {
                self.steer(Goal::Angle(here + degrees(angle), limit(most)));
            }
            Order::TurnWithin(angle, is_backwards, most) => {
                let way = (f64::from(angle) / 100.0 - here).rem_euclid(360.0);
                let way = if is_backwards { way - 360.0 } else { way };
                self.steer(Goal::Angle(here + way, limit(most)));
            }
            // What only reads; and an open loop, for drives without a current loop.
            _ => (),
        }
    }

    fn steer(&mut self, goal: Goal) {
        if std::mem::discriminant(&goal) != std::mem::discriminant(&self.goal) {
            self.integral = 0.0;
        }
        self.goal = goal;
    }

    /// Does what it is told, now or a frame later.
    fn take(&mut self, order: Order, shaft: &Shaft, now: Micros) {
        self.last_command = now;
        let order = if self.settings.is_late { self.late.replace(order) } else { Some(order) };
        if let Some(order) = order {
            self.obey(order, shaft);
        }
    }

    fn protect(&mut self, shaft: &Shaft, now: Micros) {
        let mut found = self.causes;
        if shaft.temperature > TOO_HOT {
            found |= error::OVER_TEMPERATURE;
        }
        if shaft.plant.supply < TOO_LOW {
            found |= error::UNDER_VOLTAGE;
        }
        let silence = now.since(self.last_command);
        if self.settings.command_timeout.is_some_and(|most| silence > most) {
            found |= error::COMMANDS_STOPPED;
        }
        self.errors |= found;
        if self.errors != 0 {
            (self.is_on, self.goal) = (false, Goal::Nothing);
        }
    }

    /// A speed loop with gains that fit its own motor: amperes for degrees/s of the rotor.
    fn seek_speed(&mut self, wanted: f64, shaft: &Shaft) -> f64 {
        let plant = &shaft.plant;
        // In 10 ms, at the rotor.
        let per_degree = plant.inertia() / plant.gear_ratio / plant.torque_constant;
        let gain = per_degree.to_radians() / 0.01;
        let error = wanted - shaft.rotor_rpm() * 6.0;
        let most = self.settings.full_scale;
        self.integral = (self.integral + error * gain * 1e-4 / 0.1).clamp(-most, most);
        error * gain + self.integral
    }
}

impl Device for Drive {
    fn set_id(&mut self, id: u8) -> bool {
        set_if(self.settings.ids().contains(&id), &mut self.settings.id, id)
    }

    fn power_on(&mut self, _shaft: &Shaft, now: Micros, _phase: Micros) {
        *self = Self::started(self.settings, now);
    }

    fn receive(&mut self, frame: &CanFrame, shaft: &Shaft, now: Micros, out: &mut Outbox) -> Taken {
        let id = u32::from(if self.settings.multi_motor { SHARED } else { self.own_id() });
        if frame.is_remote() || frame.is_extended_id() || frame.raw_id() != id {
            return Taken::NotMine;
        }
        let Some(bytes) = frame.all_eight() else { return Taken::Malformed };
        let (byte, order) = if self.settings.multi_motor {
            let lane = 2 * usize::from(self.settings.id - 1);
            (0xA1, Order::Current(i16::from_le_bytes([bytes[lane], bytes[lane + 1]])))
        } else {
            let Some(order) = decode(bytes) else { return Taken::Malformed };
            (bytes[0], order)
        };
        self.take(order, shaft, now);
        if let Some(id) = StandardId::new(self.own_id()) {
            out.push(CanFrame::eight_bytes(id, self.answer(byte, order, shaft)));
        }
        Taken::Yes
    }

    fn drive(&mut self, shaft: &Shaft, now: Micros) -> Winding {
        self.protect(shaft, now);
        if !self.is_on {
            return Winding::Open;
        }
        let most = self.settings.full_scale;
        let amps = match self.goal {
            Goal::Nothing => return Winding::Open,
            Goal::Current(steps) => {
                f64::from(steps.clamp(-MOST_STEPS, MOST_STEPS)) * self.amps_per_step()
            }
            Goal::Speed(speed) => self.seek_speed(speed, shaft),
            Goal::Angle(angle, fastest) => {
                let way = angle - shaft.rotor_turns() * 360.0;
                self.seek_speed((way * 10.0).clamp(-fastest, fastest), shaft)
            }
        };
        Winding::Current(amps.clamp(-most, most))
    }

    fn command(&self) -> i16 {
        match self.goal {
            Goal::Current(steps) => steps,
            _ => 0,
        }
    }

    fn inject(&mut self, fault: EscFault) -> bool {
        self.causes |= match fault {
            EscFault::OverTemperature => error::OVER_TEMPERATURE,
            EscFault::CommunicationLost => error::COMMANDS_STOPPED,
            EscFault::OverCurrent => error::OVER_CURRENT,
            EscFault::OverVoltage => error::OVER_VOLTAGE,
            EscFault::UnderVoltage => error::UNDER_VOLTAGE,
            // No error bit says so.
            EscFault::Encoder => return false,
        };
        true
    }
}

/// MG4010E-i10 on its drive, 24 V, no load on the shaft.
pub const fn mg4010e_i10() -> Plant {
    // Data sheet: 10 : 1, 0.07 N·m/A at the rotor, 320 rpm without load, 0.6 Ω, 202 g·cm²,
    // 7 A at stall. Friction and heating are our estimates.
    Plant::motor(10.0, 0.7, 0.6, 7.0, 2.02e-5)
        .with_friction(3e-3, 0.08, 0.1)
        .with_heating(4.0, 250.0)
        .with_no_load_speed(3200.0)
}

/// MF9025 V2 on its drive, 24 V, no load on the shaft.
pub const fn mf9025() -> Plant {
    // Data sheet: no gearbox, 0.32 N·m/A, 0.05 V/rpm, 0.5 Ω. Inertia, friction and heating are
    // our estimates.
    Plant {
        back_emf: 0.477,
        ..Plant::motor(1.0, 0.32, 0.5, 13.0, 2.6e-4)
            .with_friction(5e-4, 0.03, 0.04)
            .with_heating(2.0, 400.0)
    }
}
