//! `ODrive` axes from the device's side, after firmware 0.5.6 (`can_simple.cpp`, `axis.cpp`,
//! `controller.cpp`) and the DBC of 0.6.
//!
//! The firmware's behaviour: every frame feeds the watchdog, which counts in every state; closed-loop
//! control begins with the position input where the shaft is and the integral at zero, but leaves
//! velocity and torque inputs as they were. Not simulated: calibration (an axis is ready, and other
//! states than idle and closed loop are refused), anticogging, end stops. The gains fit the motor.

mod codec;
mod controller;

use rc10_can::CanFrame;
use rc10_time::Micros;

use crate::device::{Device, EscFault, Outbox, Taken, Winding, set_if};
use crate::motor::Shaft;
use crate::plant::Plant;

pub use codec::{
    Order, decode, encode_currents, encode_estimates, encode_heartbeat, encode_supply,
    encode_temperatures,
};
pub use controller::Controller;

/// Family of firmware: error bits and messages differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// `ODrive` v3.
    V0_5,
    /// `ODrive` Pro, S1, Micro.
    V0_6,
}

/// States of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// No torque.
    Idle = 1,
    /// Follows inputs.
    ClosedLoop = 8,
}

/// Settings of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// `can.node_id`, 0 ..= 63.
    pub node: u8,
    /// The firmware.
    pub version: Version,
    /// `encoder_msg_rate_ms`.
    pub estimates_every: Micros,
    /// `heartbeat_msg_rate_ms`.
    pub heartbeat_every: Micros,
    /// `iq_msg_rate_ms`, `temperature_msg_rate_ms` and `bus_voltage_msg_rate_ms` alike; `None`:
    /// not sent.
    pub others_every: Option<Micros>,
    /// Expires without frames; `None`: off.
    pub watchdog: Option<Micros>,
    /// The time for which it starts before it can be switched on (firmware 0.6 says so in its
    /// errors).
    pub starts_for: Micros,
}

impl Settings {
    /// 1 kHz estimates, 50 Hz heartbeats, nothing else; firmware 0.6.
    pub const fn new(node: u8) -> Self {
        Self {
            node,
            version: Version::V0_6,
            estimates_every: Micros::from_millis(1),
            heartbeat_every: Micros::from_millis(20),
            others_every: None,
            watchdog: None,
            starts_for: Micros::ZERO,
        }
    }
}

/// Causes of errors of an axis, and their bits: `ODrive.Axis.Error` in firmware 0.5, `ODrive.Error` in
/// 0.6; 0 where there is no such bit.
mod cause {
    pub const STARTING: (u32, u32) = (0, 0x1);
    /// Firmware 0.6 refuses without an error.
    pub const STATE_NOT_POSSIBLE: (u32, u32) = (0x1, 0);
    pub const UNDER_VOLTAGE: (u32, u32) = (0x2, 0x200);
    pub const OVER_VOLTAGE: (u32, u32) = (0x4, 0x100);
    /// 0.5 tells in another message what is wrong with the motor.
    pub const OVER_CURRENT: (u32, u32) = (0x40, 0x1000);
    pub const OVER_TEMPERATURE: (u32, u32) = (0x4_0000, 0x2000);
    pub const ENCODER: (u32, u32) = (0x100, 0x8);
    pub const WATCHDOG: (u32, u32) = (0x800, 0x100_0000);
    pub const E_STOP: (u32, u32) = (0x4000, 0x200_0000);
}

impl Version {
    /// The bit of a [`cause`].
    const fn bit(self, (v0_5, v0_6): (u32, u32)) -> u32 {
        match self {
            Self::V0_5 => v0_5,
            Self::V0_6 => v0_6,
        }
    }
}

/// Above this an axis switches itself off, °C; our estimate.
const TOO_HOT: f64 = 120.0;

/// One axis.
#[derive(Debug)]
pub struct Axis {
    settings: Settings,
    /// The state.
    pub state: State,
    /// The controller: modes, inputs, limits.
    pub controller: Controller,
    /// The error word.
    pub errors: u32,
    causes: u32,
    /// Turns of the shaft when the encoder began to count.
    origin: Option<f64>,
    started_at: Micros,
    fed_at: Micros,
    /// The times at which the next are due: heartbeat, estimates, others.
    due: [Micros; 3],
}

impl Axis {
    /// With these settings; `None` if there is no such node or something is sent at no interval.
    pub fn new(settings: Settings) -> Option<Self> {
        let Settings { estimates_every, heartbeat_every, others_every, .. } = settings;
        let others = others_every.unwrap_or(heartbeat_every);
        let good = [estimates_every, heartbeat_every, others].iter().all(|it| *it > Micros::ZERO);
        (settings.node <= 63 && good).then(|| Self::started(settings, Micros::ZERO))
    }

    fn started(settings: Settings, now: Micros) -> Self {
        Self {
            settings,
            state: State::Idle,
            controller: Controller::new(),
            errors: 0,
            causes: 0,
            origin: None,
            started_at: now,
            fed_at: now,
            due: [now; 3],
        }
    }

    /// Turns as the encoder counts them: from zero at power-on.
    fn position(&mut self, shaft: &Shaft) -> f64 {
        let turns = shaft.rotor_turns();
        turns - *self.origin.get_or_insert(turns)
    }

    fn is_starting(&self, now: Micros) -> bool {
        now.since(self.started_at) < self.settings.starts_for
    }

    fn find(&mut self, cause: (u32, u32)) {
        self.errors |= self.settings.version.bit(cause);
    }

    fn protect(&mut self, shaft: &Shaft, now: Micros) {
        self.errors |= self.causes;
        let starting = self.settings.version.bit(cause::STARTING);
        self.errors &= !starting;
        if self.is_starting(now) {
            self.errors |= starting;
        }
        if shaft.temperature > TOO_HOT {
            self.find(cause::OVER_TEMPERATURE);
        }
        if self.settings.watchdog.is_some_and(|most| now.since(self.fed_at) > most) {
            self.find(cause::WATCHDOG);
        }
        if self.errors != 0 {
            self.state = State::Idle;
        }
    }

    fn enter(&mut self, state: u32, position: f64, now: Micros) {
        match state {
            1 => self.state = State::Idle,
            8 if self.errors == 0 && !self.is_starting(now) => {
                if self.state != State::ClosedLoop {
                    self.controller.enter(position);
                }
                self.state = State::ClosedLoop;
            }
            _ => self.find(cause::STATE_NOT_POSSIBLE),
        }
    }

    fn obey(&mut self, order: Order, position: f64, now: Micros) {
        match order {
            Order::State(state) => self.enter(state, position, now),
            Order::ClearErrors => self.errors &= self.causes,
            Order::EStop => {
                self.find(cause::E_STOP);
                self.state = State::Idle;
            }
            other => self.controller.take(other),
        }
    }

    fn heartbeat(&self) -> CanFrame {
        let details = match self.settings.version {
            // The motor's, the encoder's and the controller's own errors, and a finished move.
            Version::V0_5 => {
                let bit = |mask: u32| u8::from(self.errors & mask != 0);
                [bit(0x40), bit(0x100), bit(0x200)]
            }
            Version::V0_6 => [0; 3],
        };
        encode_heartbeat(self.settings.node, self.errors, self.state as u8, details)
    }

    fn estimates(&mut self, shaft: &Shaft) -> CanFrame {
        encode_estimates(self.settings.node, self.position(shaft), shaft.rotor_rpm() / 60.0)
    }

    fn currents(&self, shaft: &Shaft) -> CanFrame {
        encode_currents(self.settings.node, self.controller.amps, shaft.current)
    }

    fn supply(&self, shaft: &Shaft) -> CanFrame {
        let volts = shaft.plant.supply;
        let watts =
            shaft.plant.resistance * shaft.current * shaft.current + shaft.torque() * shaft.speed;
        encode_supply(self.settings.node, volts, watts / volts)
    }

    /// Answers a remote frame, as firmware 0.5 does for what it does not send by itself.
    fn answer(&mut self, message: u8, shaft: &Shaft, out: &mut Outbox) -> Taken {
        out.push(match message {
            0x01 => self.heartbeat(),
            0x09 => self.estimates(shaft),
            0x14 => self.currents(shaft),
            0x17 => self.supply(shaft),
            _ => return Taken::Malformed,
        });
        Taken::Yes
    }
}

impl Device for Axis {
    fn set_id(&mut self, id: u8) -> bool {
        set_if(id <= 63, &mut self.settings.node, id)
    }

    fn power_on(&mut self, _shaft: &Shaft, now: Micros, phase: Micros) {
        *self = Self { due: [now + phase; 3], ..Self::started(self.settings, now) };
    }

    fn period(&self) -> Micros {
        self.settings.estimates_every
    }

    fn receive(&mut self, frame: &CanFrame, shaft: &Shaft, now: Micros, out: &mut Outbox) -> Taken {
        if frame.is_extended_id() || frame.raw_id() >> 5 != u32::from(self.settings.node) {
            return Taken::NotMine;
        }
        self.fed_at = now;
        let message = (frame.raw_id() & 0x1F) as u8;
        if frame.is_remote() {
            return self.answer(message, shaft, out);
        }
        let Some(order) = decode(message, frame.bytes()) else { return Taken::Malformed };
        let position = self.position(shaft);
        self.obey(order, position, now);
        Taken::Yes
    }

    fn next_event(&self) -> Option<Micros> {
        let [heartbeat, estimates, others] = self.due;
        let soonest = heartbeat.min(estimates);
        Some(if self.settings.others_every.is_some() { soonest.min(others) } else { soonest })
    }

    fn advance(&mut self, shaft: &Shaft, now: Micros, out: &mut Outbox) {
        let Settings { node, version, estimates_every, heartbeat_every, others_every, .. } =
            self.settings;
        if now >= self.due[0] {
            self.due[0] += heartbeat_every;
            out.push(self.heartbeat());
        }
        if now >= self.due[1] {
            self.due[1] += estimates_every;
            out.push(self.estimates(shaft));
        }
        if let Some(every) = others_every
            && now >= self.due[2]
        {
            self.due[2] += every;
            // Firmware 0.5 sends nothing else by itself.
            if version == Version::V0_6 {
                out.push(self.currents(shaft));
                // No thermistor on the power stage of this one.
                out.push(encode_temperatures(node, f64::NAN, shaft.temperature));
                out.push(self.supply(shaft));
            }
        }
    }

    fn drive(&mut self, shaft: &Shaft, now: Micros) -> Winding {
        self.protect(shaft, now);
        let position = self.position(shaft);
        if self.state == State::Idle {
            return Winding::Open;
        }
        Winding::Current(self.controller.step(position, shaft.rotor_rpm() / 60.0, &shaft.plant))
    }

    fn inject(&mut self, fault: EscFault) -> bool {
        let cause = match fault {
            EscFault::OverTemperature => cause::OVER_TEMPERATURE,
            EscFault::CommunicationLost => cause::WATCHDOG,
            EscFault::OverCurrent => cause::OVER_CURRENT,
            EscFault::OverVoltage => cause::OVER_VOLTAGE,
            EscFault::UnderVoltage => cause::UNDER_VOLTAGE,
            EscFault::Encoder => cause::ENCODER,
        };
        self.causes |= self.settings.version.bit(cause);
        true
    }
}

/// D6374, 150 rpm/V, behind an 8 : 1 belt, 24 V, no load on the shaft.
pub const fn d6374_8to1() -> Plant {
    // Vendor's motor guide: 150 rpm/V, so 8.27/150 N·m/A; 39 mΩ between phases. Inertia,
    // friction and heating are our estimates.
    Plant::motor(8.0, 8.0 * 8.27 / 150.0, 0.039, 40.0, 1.3e-4)
        .with_friction(5e-3, 0.15, 0.2)
        .with_heating(1.5, 500.0)
        .with_no_load_speed(3500.0)
}
