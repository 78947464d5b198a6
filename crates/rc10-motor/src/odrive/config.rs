//! The setup and control of an axis, and the meaning of the bits of its error word.

use rc10_app::{Amps, Cascade, ConfigError, Direction, Gear, Rpm, ok};
use rc10_can::IdPattern;

use super::wire::{
    CLEAR_ERRORS, CURRENTS, ControlMode, ESTIMATES, HEARTBEAT, InputMode, MESSAGE_BITS, Node,
    POSITION, SUPPLY, TEMPERATURES, TORQUE, VELOCITY,
};
use crate::can_ids::{CanIds, Frames, Rate};
use crate::feedback::Fault;

/// The setup of an axis, and how it is controlled.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Config {
    /// The axis's number, 0 to 62: an axis without a number has 63.
    pub node: u8,
    /// The axis's firmware: what its errors mean.
    pub firmware: Firmware,
    /// Turns of the encoder's shaft for turns of the output. Torques on the wire are the encoder's.
    pub gear: Gear,
    /// Which way the output shaft counts.
    pub direction: Direction,
    /// The place where the loops run: here or in the axis.
    pub control: Control,
    /// The rates of the axis's messages.
    pub rates: Rates,
    /// The limits that it gets before it is switched on, if any.
    /// [`Request::CurrentLimit`](crate::Request::CurrentLimit) needs them, and so does an axis that
    /// closes its own loops: by them it starts softly.
    pub limits: Option<Limits>,
    /// N m/A at the encoder's shaft (`motor.config.torque_constant`): for the torque's feedback.
    pub torque_constant: Option<f32>,
}

/// The place where the loops run, and the setpoints that the axis gets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// Here: the axis gets torques at the output, N m, up to the speed loop's output limit.
    Torque(Cascade),
    /// In the axis, which gets speeds: [`InputMode::Passthrough`] or [`InputMode::VelocityRamp`].
    Velocity(InputMode),
    /// In the axis, which gets positions: `Passthrough`, `PositionFilter` or `Trapezoid`.
    Position(InputMode),
}

impl Control {
    pub(super) const fn modes(&self) -> (ControlMode, InputMode) {
        match *self {
            Self::Torque(_) => (ControlMode::Torque, InputMode::Passthrough),
            Self::Velocity(input) => (ControlMode::Velocity, input),
            Self::Position(input) => (ControlMode::Position, input),
        }
    }
}

/// Rates of the messages of an axis, Hz, as set in it; 0 for those it does not send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Rates {
    /// `09`: 1 ..= 1000, at least 200 to control by.
    pub estimates: u16,
    /// `01`: 1 ..= 1000, at most the estimates'; a period passes until a state or error is known.
    pub heartbeat: u16,
    /// `14`; not above the estimates.
    pub currents: u16,
    /// `15`, firmware 0.6; not above the estimates.
    pub temperatures: u16,
    /// `17`; not above the estimates.
    pub supply: u16,
}

impl Rates {
    /// Estimates and heartbeats, and nothing else.
    pub const fn new(estimates: u16, heartbeat: u16) -> Self {
        Self { estimates, heartbeat, currents: 0, temperatures: 0, supply: 0 }
    }

    pub(super) const fn all(&self) -> [(u8, u16); 5] {
        [
            (ESTIMATES, self.estimates),
            (HEARTBEAT, self.heartbeat),
            (CURRENTS, self.currents),
            (TEMPERATURES, self.temperatures),
            (SUPPLY, self.supply),
        ]
    }

    const fn check(&self, firmware: &Firmware) -> Result<(), ConfigError> {
        const FIELDS: [&str; 5] = ["estimates", "heartbeat", "currents", "temperatures", "supply"];
        let (mut at, all) = (0, self.all());
        while at < all.len() {
            let (field, rate) = (FIELDS[at], all[at].1);
            let is_sent = at >= 2 || rate >= 1 && rate <= 1000;
            ok!(ConfigError::check(is_sent, field, rate as f32, "1 to 1000 Hz"));
            // The link time-out follows from the most frequent message.
            let must_be = "not above the rate of the estimates";
            ok!(ConfigError::check(rate <= self.estimates, field, rate as f32, must_be));
            at += 1;
        }
        let tells = firmware.has_temperatures || self.temperatures == 0;
        let must_be = "0: this firmware does not send them";
        ConfigError::check(tells, "temperatures", self.temperatures as f32, must_be)
    }
}

/// The limits of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Limits {
    /// The output shaft's largest speed.
    pub speed: Rpm,
    /// The motor's largest current.
    pub current: Amps,
}

impl Config {
    /// An axis that turns the output shaft directly and forward, and is told no limits.
    pub const fn new(node: u8, firmware: Firmware, control: Control, rates: Rates) -> Self {
        Self {
            node,
            firmware,
            gear: Gear::DIRECT,
            direction: Direction::Forward,
            control,
            rates,
            limits: None,
            torque_constant: None,
        }
    }

    /// Behind a gearbox.
    pub const fn with_gear(self, gear: Gear) -> Self {
        Self { gear, ..self }
    }

    /// Never exceeding these.
    pub const fn with_limits(self, limits: Limits) -> Self {
        Self { limits: Some(limits), ..self }
    }

    pub(crate) const fn check(&self) -> Result<(), ConfigError> {
        ok!(self.checked_node());
        let ratio = self.gear.ratio();
        let must_be = "one turn or more for a turn of the output";
        ok!(ConfigError::check(ratio >= 1.0, "gear", ratio, must_be));
        ok!(self.check_control());
        ok!(self.rates.check(&self.firmware));
        if let Some(Limits { speed, current }) = self.limits {
            ok!(check_usable("speed limit", speed.get()));
            ok!(check_usable("current limit", current.get()));
        }
        let needed = !matches!(self.control, Control::Torque(_)) && self.limits.is_none();
        let must_be = "given to an axis that closes its own loops: by them it starts softly";
        ok!(ConfigError::check(!needed, "limits", f32::NAN, must_be));
        match self.torque_constant {
            Some(constant) => check_usable("torque_constant", constant),
            None => Ok(()),
        }
    }

    const fn check_control(&self) -> Result<(), ConfigError> {
        use InputMode::{Passthrough, PositionFilter, Trapezoid, VelocityRamp};
        let (input, good, must_be) = match &self.control {
            Control::Torque(cascade) => return cascade.validate(),
            Control::Velocity(input) => {
                (*input, matches!(input, Passthrough | VelocityRamp), "passthrough (1) or ramp (2)")
            }
            Control::Position(input) => {
                let good = matches!(input, Passthrough | PositionFilter | Trapezoid);
                (*input, good, "passthrough (1), filter (3) or trapezoid (5)")
            }
        };
        ConfigError::check(good, "input mode", input as u8 as f32, must_be)
    }

    pub(super) const fn checked_node(&self) -> Result<Node, ConfigError> {
        match Node::new(self.node) {
            Some(node) if self.node < 63 => Ok(node),
            _ => {
                let must_be = "0 to 62: an axis without a number has 63";
                Err(ConfigError::new("node", self.node as f32, must_be))
            }
        }
    }

    /// The identifiers it occupies on its bus. Of a configuration that is [valid](Self::validate).
    pub const fn can_ids(&self) -> CanIds {
        can_ids(self.node, self.control.modes().0, &self.rates)
    }
}

const fn check_usable(field: &'static str, value: f32) -> Result<(), ConfigError> {
    let is_good = value.is_finite() && value > 0.0;
    ConfigError::check(is_good, field, value, "finite and above zero")
}

/// The bits of an identifier that tell the node; the other five are the message.
pub(super) const NODE_MASK: u16 = 0x7E0;

pub(super) const fn can_ids(node: u8, mode: ControlMode, rates: &Rates) -> CanIds {
    let input = match mode {
        ControlMode::Velocity => VELOCITY,
        ControlMode::Position => POSITION,
        ControlMode::Torque | ControlMode::Voltage => TORQUE,
    };
    let mut ids = CanIds::new()
        .transmits(Frames::new(message(node, input), 8, Rate::EveryTick))
        .transmits(Frames::new(message(node, 0).under(NODE_MASK as u32), 8, Rate::Rare))
        .transmits(Frames::new(message(node, CLEAR_ERRORS), 0, Rate::Rare));
    let (mut at, all) = (0, rates.all());
    while at < all.len() {
        let (number, rate) = all[at];
        if rate > 0 {
            ids = ids.receives(Frames::new(message(node, number), 8, Rate::Hz(rate)));
        }
        at += 1;
    }
    ids
}

const fn message(node: u8, number: u8) -> IdPattern {
    IdPattern::standard((node as u16) << MESSAGE_BITS | number as u16)
}

/// A family of firmware, by what its error word means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Firmware {
    /// The version, as the vendor counts.
    pub version: &'static str,
    /// Bits of the error word and their texts, the gravest first.
    pub errors: &'static [(u8, &'static str)],
    /// Bits that are set while an axis starts: no fault.
    pub starting: u32,
    /// Whether message `15` is temperatures.
    pub has_temperatures: bool,
}

impl Firmware {
    /// `ODrive` v3 (`odrive-interface.yaml`, `Axis.error`; bits 1 to 5, 10, 15, 16: older).
    pub const V0_5: Self = Self {
        version: "0.5",
        errors: &[
            (14, "emergency stop requested"),
            (6, "motor failed"),
            (8, "encoder failed"),
            (9, "controller failed"),
            (7, "sensorless estimator failed"),
            (18, "too hot"),
            (2, "supply voltage too high"),
            (1, "supply voltage too low"),
            (16, "supply current too high"),
            (15, "too much current fed back"),
            (3, "current measurement timed out"),
            (4, "brake resistor disarmed"),
            (5, "motor disarmed"),
            (11, "watchdog expired"),
            (12, "lower end stop pressed"),
            (13, "upper end stop pressed"),
            (17, "homing without end stop"),
            (19, "position unknown"),
            (10, "position control while sensorless"),
            (0, "state not possible now"),
        ],
        starting: 0,
        has_temperatures: false,
    };

    /// `ODrive` Pro, S1 and Micro (`odrive` 0.6.7, `ODriveError`).
    pub const V0_6: Self = Self {
        version: "0.6",
        errors: &[
            (25, "emergency stop requested"),
            (5, "gate driver failed"),
            (1, "system failed"),
            (2, "timing failed"),
            (12, "current limit violated"),
            (13, "motor too hot"),
            (14, "controller too hot"),
            (8, "supply voltage too high"),
            (9, "supply voltage too low"),
            (10, "supply current too high"),
            (11, "too much current fed back"),
            (15, "velocity limit violated"),
            (16, "position limit violated"),
            (26, "motor does not follow its field"),
            (27, "brake resistor disarmed"),
            (28, "thermistor disconnected"),
            (24, "watchdog expired"),
            (3, "encoder estimate missing"),
            (6, "input missing"),
            (4, "configuration invalid"),
            (30, "calibration failed"),
            (0, "still starting"),
        ],
        starting: 1,
        has_temperatures: true,
    };

    /// The whole error word, with the text of its gravest error; `None` without an error.
    pub fn fault(&self, errors: u32) -> Option<Fault> {
        if errors == 0 {
            return None;
        }
        let gravest = self.errors.iter().find(|(bit, _)| errors >> bit & 1 == 1);
        Some(Fault::new(errors, gravest.map_or("an undocumented error", |(_, text)| text)))
    }
}
