//! Unitree's CAN-to-485 module with GO-M8010-6 motors behind it, from the devices' side.
//!
//! A [`UnitreeModule`] is what its motors share: a number on the bus, and stiffness and damping for
//! each motor, forgotten when it restarts. Each motor is a [`Device`] of its own, with its own
//! [`Plant`]: `bus.add(module.motor(0)?, plant())`. Power of the [`Esc`](crate::Esc) is the motor's;
//! [`UnitreeModule::set_power`] is the module's.
//!
//! Sources: CAN-to-485 module manual V1.0, GO-M8010-6 user manual v1.2 and data manual. **Assumed**,
//! because none of them says: a module puts stiffness and damping on its line with the next control
//! frame, not before; it is silent about a motor that does not
//! answer, and wholly about one without power; a motor that gets no more
//! commands keeps the last one; a locked motor brakes by its shorted windings; power makes it count
//! from its rotor's first turn again; a module has no stiffness and damping when it starts. The
//! 6000 frames a second that a module can pass on at most are not simulated: the wire fits hardly
//! more.

mod codec;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::rc::Rc;

use rc10_can::CanFrame;
use rc10_time::Micros;

pub use self::codec::{Asked, Command, Gains, Motion, Report, Told};
use crate::device::{Device, EscFault, NoDevice, Outbox, Taken, Winding};
use crate::motor::Shaft;
use crate::plant::Plant;
use crate::unitree_line::{self, GEAR, TOO_HOT, TORQUE_CONSTANT, error_of};

/// 33 bytes at 4 Mbit/s, and an estimate for the turnaround.
const EXCHANGE: Micros = Micros::new(150);
/// The manual: about five seconds.
const CALIBRATION: Micros = Micros::from_millis(5000);
/// Turns the motor during its calibration: an estimate.
const CALIBRATION_VOLTS: f64 = 1.0;

/// Its motor on 24 V without load. Gear, torque constant, 23.7 N·m and 30 rad/s are the data
/// manual's; resistance, inertia, friction and thermal figures are estimates.
pub const fn plant() -> Plant {
    Plant { rotor_inertia: 6e-5, ..unitree_line::plant() }
        .with_friction(0.01, 0.10, 0.13)
        .with_heating(1.5, 300.0)
        .with_no_load_speed(30.0 * GEAR * 60.0 / TAU)
}

/// A module. Clones are the same module.
#[derive(Clone, Debug)]
pub struct UnitreeModule {
    number: u8,
    inner: Rc<RefCell<Inner>>,
}

#[derive(Debug)]
struct Inner {
    powered: bool,
    gains: [Gains; 16],
}

impl UnitreeModule {
    /// A module with this number (switches 1 and 2), 0 ..= 3, powered. Fails with another number.
    pub fn new(number: u8) -> Result<Self, NoDevice> {
        if number > 3 {
            return Err(NoDevice(format!("a module has a number from 0 to 3, not {number}")));
        }
        let inner = Inner { powered: true, gains: [Gains::default(); 16] };
        Ok(Self { number, inner: Rc::new(RefCell::new(inner)) })
    }

    /// A motor on its line, with this number, 0 ..= 14. Fails with another number.
    pub fn motor(&self, number: u8) -> Result<UnitreeMotor, NoDevice> {
        if number > 14 {
            return Err(NoDevice(format!("a motor has a number from 0 to 14, not {number}")));
        }
        Ok(UnitreeMotor::new(self.clone(), number))
    }

    /// Switches the module's power: without it nothing passes, and its motors keep their last
    /// command; with it again, it has no stiffness and damping for any of them.
    pub fn set_power(&self, powered: bool) {
        let mut inner = self.inner.borrow_mut();
        *inner = Inner { powered, gains: [Gains::default(); 16] };
    }

    /// Gains that it has for a motor.
    pub fn gains(&self, motor: u8) -> Gains {
        self.inner.borrow().gains.get(usize::from(motor)).copied().unwrap_or_default()
    }
}

/// Mode of a motor, as it reports it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The mode after power-up: the motor brakes (assumed).
    #[default]
    Locked = 0,
    /// The motor follows commands.
    Following = 1,
    /// The motor turns by itself.
    Calibrating = 2,
}

/// A motor behind a module.
#[derive(Debug)]
pub struct UnitreeMotor {
    module: UnitreeModule,
    number: u8,
    /// The mode.
    pub mode: Mode,
    /// The motion it was commanded last, at the rotor.
    pub command: Motion,
    /// The stiffness and damping it follows with, at the rotor.
    pub gains: Gains,
    error: u8,
    unplugged: bool,
    calibrated_at: Micros,
    /// The number of times that it was told to calibrate itself.
    pub calibrations: u32,
    /// Whole rotor turns that had been made when it got power.
    zero: Option<f64>,
    due: VecDeque<(Micros, Answer)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Answer {
    /// Only if there is a fault.
    Fault,
    /// With the status that its command asked for.
    State(u8),
    Gains(Gains),
}

impl UnitreeMotor {
    fn new(module: UnitreeModule, number: u8) -> Self {
        Self {
            module,
            number,
            mode: Mode::Locked,
            command: Motion::default(),
            gains: Gains::default(),
            error: 0,
            unplugged: false,
            calibrated_at: Micros::ZERO,
            calibrations: 0,
            zero: None,
            due: VecDeque::new(),
        }
    }

    /// Turns of the rotor as it counts them.
    fn turns(&mut self, shaft: &Shaft) -> f64 {
        let turns = shaft.rotor_turns();
        turns - *self.zero.get_or_insert(turns.floor())
    }

    fn motion(&mut self, shaft: &Shaft) -> Motion {
        Motion {
            torque: shaft.current * TORQUE_CONSTANT / GEAR,
            speed: shaft.speed * GEAR,
            angle: self.turns(shaft) * TAU,
        }
    }

    fn control(&mut self, status: u8, motion: Motion, now: Micros) {
        self.gains = self.module.gains(self.number);
        self.command = motion;
        self.mode = match status {
            1 => Mode::Following,
            2 => {
                self.calibrations += 1;
                self.calibrated_at = now;
                Mode::Calibrating
            }
            _ => Mode::Locked,
        };
    }

    fn report(&mut self, answer: Answer, shaft: &Shaft) -> Option<CanFrame> {
        let told = match answer {
            Answer::Gains(gains) => Told::Gains(gains),
            _ if self.unplugged || self.mode == Mode::Calibrating => return None,
            _ if self.error != 0 => Told::Fault { status: self.mode as u8, error: self.error },
            Answer::Fault => return None,
            Answer::State(status) => Told::State {
                status,
                motion: self.motion(shaft),
                temperature: shaft.temperature,
                air_pressure: 0,
            },
        };
        Some(Report { module: self.module.number, motor: self.number, told }.pack())
    }
}

impl Device for UnitreeMotor {
    fn power_on(&mut self, _shaft: &Shaft, _now: Micros, _phase: Micros) {
        let calibrations = self.calibrations;
        *self = Self { calibrations, ..Self::new(self.module.clone(), self.number) };
    }

    fn receive(&mut self, frame: &CanFrame, _: &Shaft, now: Micros, _: &mut Outbox) -> Taken {
        let is_meant = |command: &Command| {
            command.module == self.module.number && [self.number, 15].contains(&command.motor)
        };
        let Some(command) = Command::unpack(frame).filter(is_meant) else { return Taken::NotMine };
        let Some(asked) = command.asked else { return Taken::Malformed };
        if !self.module.inner.borrow().powered {
            return Taken::NotMine;
        }
        let answer = match asked {
            Asked::Control { status, motion, answered } => {
                if !self.unplugged && self.mode != Mode::Calibrating {
                    self.control(status, motion, now);
                }
                Some(if answered { Answer::State(self.mode as u8) } else { Answer::Fault })
            }
            Asked::SetGains(gains) => {
                self.module.inner.borrow_mut().gains[usize::from(self.number)] = gains;
                None
            }
            Asked::ReadGains => Some(Answer::Gains(self.module.gains(self.number))),
        };
        // A command to all motors is not answered.
        if let (Some(answer), true) = (answer, command.motor == self.number) {
            self.due.push_back((now + EXCHANGE, answer));
        }
        Taken::Yes
    }

    fn next_event(&self) -> Option<Micros> {
        self.due.front().map(|(at, _)| *at)
    }

    fn advance(&mut self, shaft: &Shaft, now: Micros, out: &mut Outbox) {
        while self.next_event().is_some_and(|at| at <= now)
            && let Some((_, answer)) = self.due.pop_front()
        {
            let frame = self.report(answer, shaft);
            if self.module.inner.borrow().powered {
                out.extend(frame);
            }
        }
    }

    fn drive(&mut self, shaft: &Shaft, now: Micros) -> Winding {
        let has = self.motion(shaft);
        if shaft.temperature >= TOO_HOT {
            self.error = 1;
        }
        if self.mode == Mode::Calibrating && now.since(self.calibrated_at) >= CALIBRATION {
            self.mode = Mode::Locked;
        }
        match self.mode {
            _ if self.error != 0 => Winding::Open,
            Mode::Locked => Winding::Voltage(0.0),
            Mode::Calibrating => Winding::Voltage(CALIBRATION_VOLTS),
            Mode::Following => {
                let wanted = self.command;
                let torque = wanted.torque
                    + self.gains.stiffness * (wanted.angle - has.angle)
                    + self.gains.damping * (wanted.speed - has.speed);
                Winding::Current(torque * GEAR / TORQUE_CONSTANT)
            }
        }
    }

    fn inject(&mut self, fault: EscFault) -> bool {
        match fault {
            // Its cable to the module.
            EscFault::CommunicationLost => self.unplugged = true,
            _ => self.error = error_of(fault).unwrap_or(self.error),
        }
        fault != EscFault::UnderVoltage
    }
}
