//! Damiao motors (DM-J, -H, -G, -S) from the device's side: registers, modes, enabling, errors,
//! time-out, and what they answer.
//!
//! * It obeys and answers every standard frame whose low byte is that of its `CAN_ID`; it speaks
//!   only then, on its `MST_ID`. A frame with another mode's offset is answered and not obeyed
//!   (damiao-motor's documentation); one with a foreign high part is obeyed, the worst that our
//!   sources allow.
//! * Enabling starts without a setpoint: no torque until a command comes.
//! * An error stops it until it is cleared, and comes back while its cause lasts.
//! * `TIMEOUT` (50 µs each, 0 for never) without a frame while enabled is an error.
//! * At power-on the output encoder tells the angle within the turn: turns are forgotten. That is
//!   our reading of "dual encoder".
//! * Saving takes 20 ms, in which it is deaf (the manual says up to 30 ms); only while disabled.
//! * Identifiers that are written count at once.
//!
//! Sources: manuals of J4310, J10010L and S3519; the vendor's code; damiao-motor 1.0.6.
//!
//! ```
//! use rc10_can::{CanFrame, CanPort, embedded_can::StandardId};
//! use rc10_time::Micros;
//! use rc10_sim::damiao::{Damiao, DamiaoConfig};
//! use rc10_sim::{BusConfig, World};
//!
//! let mut world = World::new(1);
//! let bus = world.add_bus(BusConfig::default());
//! let config = DamiaoConfig::j4310(0x01, 0x11);
//! let motor = bus.add(Damiao::new(&config), config.plant);
//! let mut port = bus.port();
//! let enable = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
//! let _ = port.submit(&CanFrame::eight_bytes(StandardId::new(0x01).unwrap(), enable));
//! world.advance(Micros::from_millis(1));
//! let (answer, _) = port.receive().unwrap();
//! assert_eq!((answer.raw_id(), answer.bytes()[0]), (0x11, 0x11)); // enabled, motor 1
//! assert_eq!(motor.with(|damiao: &mut Damiao| damiao.is_enabled()), Some(true));
//! ```

mod codec;
mod config;
mod loops;
mod registers;

use std::f64::consts::TAU;

use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;
use rc10_time::Micros;

use crate::device::{Device, EscFault, Outbox, Taken, Winding};
use crate::motor::Shaft;

pub use codec::{Access, Limits, Mode, Operation, Report, Setpoint};
pub use config::DamiaoConfig;
use loops::Loops;
use registers::{Registers, number};

/// Identifier of register frames.
const REGISTERS: u32 = 0x7FF;
/// The time that saving takes.
const SAVING: Micros = Micros::from_millis(20);
/// Unit of `TIMEOUT`, µs.
const TIMEOUT_STEP: u64 = 50;

/// Error codes: manuals of J4310 and S3519.
mod error {
    pub const ENCODER: u8 = 0x5;
    pub const OVER_VOLTAGE: u8 = 0x8;
    pub const UNDER_VOLTAGE: u8 = 0x9;
    pub const OVER_CURRENT: u8 = 0xA;
    pub const BRIDGE_HOT: u8 = 0xB;
    pub const WINDING_HOT: u8 = 0xC;
    pub const COMMUNICATION: u8 = 0xD;
}

/// The state of the device.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Disabled,
    /// With the last setpoint, if one came.
    Enabled(Option<Setpoint>),
    Error(u8),
}

/// A simulated Damiao motor.
#[derive(Clone, Debug)]
pub struct Damiao {
    config: DamiaoConfig,
    /// The registers that it keeps without power.
    flash: Registers,
    registers: Registers,
    state: State,
    loops: Loops,
    /// The error that stays, if it has one.
    broken: Option<u8>,
    /// The shaft's zero in the world, rad; kept without power.
    zero: f64,
    /// Whole turns forgotten at power-on, rad; `None` until it has looked.
    forgotten: Option<f64>,
    heard_at: Micros,
    saved_at: Option<Micros>,
    /// The number of times that it has saved its registers.
    pub saves: u32,
}

impl Damiao {
    /// A motor as configured, without power yet.
    pub fn new(config: &DamiaoConfig) -> Self {
        let registers = Registers::of(config);
        Self {
            config: *config,
            flash: registers,
            registers,
            state: State::Disabled,
            loops: Loops::default(),
            broken: None,
            zero: 0.0,
            forgotten: None,
            heard_at: Micros::ZERO,
            saved_at: None,
            saves: 0,
        }
    }

    /// Whether it is enabled.
    pub const fn is_enabled(&self) -> bool {
        matches!(self.state, State::Enabled(_))
    }

    /// Status code in its reports: 0 disabled, 1 enabled, else an error.
    pub const fn code(&self) -> u8 {
        match self.state {
            State::Disabled => 0,
            State::Enabled(_) => 1,
            State::Error(code) => code,
        }
    }

    /// The setpoint it follows.
    pub const fn setpoint(&self) -> Option<Setpoint> {
        match self.state {
            State::Enabled(setpoint) => setpoint,
            _ => None,
        }
    }

    /// The control mode.
    pub fn mode(&self) -> Mode {
        let mode = self.registers.whole(number::MODE);
        Mode::ALL.into_iter().find(|it| *it as u32 == mode).unwrap_or(Mode::Mit)
    }

    /// Bits of a register; `None` if it does not exist.
    pub fn register(&self, register: u8) -> Option<u32> {
        self.registers.read(register).map(u32::from_le_bytes)
    }

    fn can_id(&self) -> u16 {
        (self.registers.whole(number::DEVICE_ID) & 0x7FF) as u16
    }

    fn position(&mut self, shaft: &Shaft) -> f64 {
        let angle = shaft.radians() - self.zero;
        angle - *self.forgotten.get_or_insert((angle / TAU).round() * TAU)
    }

    fn fail(&mut self, code: u8) {
        self.state = State::Error(code);
    }

    fn operate(&mut self, operation: Operation, shaft: &Shaft) {
        match (operation, self.state) {
            (Operation::Enable, State::Disabled) => {
                self.loops = Loops::default();
                self.state = State::Enabled(None);
            }
            (Operation::Disable, State::Enabled(_)) | (Operation::ClearError, State::Error(_)) => {
                self.state = State::Disabled;
            }
            (Operation::StoreZero, _) => {
                self.zero = shaft.radians();
                self.forgotten = Some(0.0);
            }
            _ => (),
        }
        if let Some(code) = self.broken {
            self.fail(code);
        }
    }

    fn take_command(&mut self, offset: u32, payload: &[u8], shaft: &Shaft) -> Taken {
        let mode = self.mode();
        let of_a_mode = Mode::ALL.into_iter().any(|mode| mode.offset() == offset);
        if self.config.old_firmware && offset != mode.offset() {
            return Taken::NotMine;
        }
        if let Some(operation) = Operation::decode(payload) {
            self.operate(operation, shaft);
            return Taken::Yes;
        }
        if of_a_mode && offset != mode.offset() {
            return Taken::Yes;
        }
        let Some(setpoint) = Setpoint::decode(mode, payload, &self.registers.limits()) else {
            return Taken::Malformed;
        };
        if let State::Enabled(followed) = &mut self.state {
            *followed = Some(setpoint);
        }
        Taken::Yes
    }

    fn report(&mut self, shaft: &Shaft) -> CanFrame {
        let limits = self.registers.limits();
        let position = self.config.beyond.of(self.position(shaft), limits.position);
        let report = Report {
            id: self.can_id(),
            code: self.code(),
            position,
            velocity: shaft.speed,
            torque: shaft.torque(),
            bridge_temperature: shaft.temperature,
            winding_temperature: shaft.temperature,
        };
        self.answer(report.encode(&limits))
    }

    fn answer(&self, payload: [u8; 8]) -> CanFrame {
        let id = (self.registers.whole(number::MASTER_ID) & 0x7FF) as u16;
        CanFrame::eight_bytes(StandardId::new(id).unwrap_or(StandardId::ZERO), payload)
    }

    fn about_register(&self, operation: u8, register: u8, value: [u8; 4]) -> CanFrame {
        let [low, high] = self.can_id().to_le_bytes();
        let [a, b, c, d] = value;
        self.answer([low, high, operation, register, a, b, c, d])
    }

    fn take_access(
        &mut self,
        access: Access,
        shaft: &Shaft,
        now: Micros,
        out: &mut Outbox,
    ) -> Taken {
        match access {
            Access::Report => out.push(self.report(shaft)),
            Access::Read(register) => {
                self.measure(shaft);
                let Some(value) = self.registers.read(register) else { return Taken::Malformed };
                out.push(self.about_register(0x33, register, value));
            }
            Access::Write(register, value) => {
                let before = self.mode();
                let Some(held) = self.registers.write(register, value) else {
                    return Taken::Malformed;
                };
                if self.mode() != before {
                    self.loops = Loops::default();
                    if let State::Enabled(setpoint) = &mut self.state {
                        *setpoint = None;
                    }
                }
                out.push(self.about_register(self.config.acknowledges_with, register, held));
            }
            Access::Save if self.state == State::Disabled => self.saved_at = Some(now + SAVING),
            // Not while it moves, says the manual, and not what it answers.
            Access::Save => return Taken::Malformed,
        }
        Taken::Yes
    }

    /// Registers that hold what is measured.
    fn measure(&mut self, shaft: &Shaft) {
        let position = self.position(shaft);
        #[expect(clippy::cast_possible_truncation, reason = "registers are single precision")]
        for (register, value) in [
            (number::SUPPLY, shaft.plant.supply),
            (number::BRIDGE_TEMPERATURE, shaft.temperature),
            (number::WINDING_TEMPERATURE, shaft.temperature),
            (number::MOTOR_POSITION, position),
            (number::OUTPUT_POSITION, position),
        ] {
            self.registers.set_real(register, value as f32);
        }
    }

    /// Looks after itself; what it finds wrong stops it.
    fn protect(&mut self, shaft: &Shaft, now: Micros) {
        let supply = shaft.plant.supply;
        let silence = now.since(self.heard_at).get();
        let timeout = u64::from(self.registers.whole(number::TIMEOUT)) * TIMEOUT_STEP;
        let wrong = if let Some(code) = self.broken {
            Some(code)
        } else if shaft.temperature > self.registers.real(number::OVER_TEMPERATURE) {
            Some(error::WINDING_HOT)
        } else if supply < self.registers.real(number::UNDER_VOLTAGE) {
            Some(error::UNDER_VOLTAGE)
        } else if self.is_enabled() && timeout > 0 && silence > timeout {
            Some(error::COMMUNICATION)
        } else {
            None
        };
        if let Some(code) = wrong
            && !matches!(self.state, State::Error(_))
        {
            self.fail(code);
        }
    }
}

impl Device for Damiao {
    fn power_on(&mut self, _shaft: &Shaft, now: Micros, _phase: Micros) {
        self.registers = self.flash;
        self.state = State::Disabled;
        self.loops = Loops::default();
        self.broken = None;
        self.forgotten = None;
        self.heard_at = now;
        self.saved_at = None;
        // The only time it looks at that.
        if self.config.plant.supply > self.registers.real(number::OVER_VOLTAGE) {
            self.fail(error::OVER_VOLTAGE);
        }
    }

    fn receive(&mut self, frame: &CanFrame, shaft: &Shaft, now: Micros, out: &mut Outbox) -> Taken {
        let is_deaf = self.saved_at.is_some();
        if frame.is_extended_id() || frame.is_remote() || is_deaf {
            return Taken::NotMine;
        }
        let can_id = self.can_id();
        if frame.raw_id() == REGISTERS {
            return match Access::decode(frame.bytes()) {
                Some((id, access)) if id == can_id => {
                    self.heard_at = now;
                    self.take_access(access, shaft, now, out)
                }
                _ => Taken::NotMine,
            };
        }
        if (frame.raw_id() ^ u32::from(can_id)) & 0xFF != 0 {
            return Taken::NotMine;
        }
        let offset = frame.raw_id().wrapping_sub(can_id.into());
        let taken = self.take_command(offset, frame.bytes(), shaft);
        if taken == Taken::Yes {
            self.heard_at = now;
            out.push(self.report(shaft));
        }
        taken
    }

    fn next_event(&self) -> Option<Micros> {
        self.saved_at
    }

    fn advance(&mut self, _shaft: &Shaft, now: Micros, out: &mut Outbox) {
        if self.saved_at.is_some_and(|done| now >= done) {
            self.saved_at = None;
            self.flash = self.registers;
            self.saves += 1;
            out.push(self.about_register(0xAA, 0x01, [0; 4]));
        }
    }

    fn drive(&mut self, shaft: &Shaft, now: Micros) -> Winding {
        self.protect(shaft, now);
        match self.state {
            State::Enabled(Some(setpoint)) => {
                let here = self.position(shaft);
                let torque = self.loops.torque(setpoint, here, shaft, &self.registers);
                Winding::Current(torque / shaft.plant.torque_constant)
            }
            _ => Winding::Open,
        }
    }

    fn inject(&mut self, fault: EscFault) -> bool {
        let code = match fault {
            // Over with the next command.
            EscFault::CommunicationLost => {
                self.fail(error::COMMUNICATION);
                return true;
            }
            EscFault::OverTemperature => error::BRIDGE_HOT,
            EscFault::OverCurrent => error::OVER_CURRENT,
            EscFault::OverVoltage => error::OVER_VOLTAGE,
            EscFault::UnderVoltage => error::UNDER_VOLTAGE,
            EscFault::Encoder => error::ENCODER,
        };
        self.broken = Some(code);
        self.fail(code);
        true
    }
}
