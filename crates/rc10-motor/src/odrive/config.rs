//! The setup and control of an axis, and the meaning of the bits of its error word.

use rc10_app::{Amps, Cascade, ConfigError, Direction, Gear, Rpm};

use super::wire::{ControlMode, InputMode, Node};
use crate::feedback::Fault;

/// The setup of an axis, and how it is controlled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Its firmware: what its errors mean.
    pub firmware: Firmware,
    /// Turns of the encoder's shaft for turns of the output shaft. Torques on the wire are those of
    /// the encoder's shaft, too.
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
    /// Torque per ampere at the encoder's shaft, N m/A (`motor.config.torque_constant`): for the
    /// torque in the feedback alone.
    pub torque_constant: Option<f32>,
}

/// The place where the loops run, and the setpoints that the axis gets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// Here: the axis gets torques, N m at the output shaft. The largest is the speed loop's
    /// output limit.
    Torque(Cascade),
    /// In the axis, which gets speeds: [`InputMode::Passthrough`] or [`InputMode::VelocityRamp`].
    Velocity(InputMode),
    /// In the axis, which gets positions: [`InputMode::Passthrough`],
    /// [`InputMode::PositionFilter`] or [`InputMode::Trapezoid`].
    Position(InputMode),
}

impl Control {
    /// The modes that the axis is set to.
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
pub struct Rates {
    /// `09`: 1 ..= 1000, at least 200 to control by.
    pub estimates: u16,
    /// `01`: 1 ..= 1000; not above the estimates. Up to one period passes before it is known that
    /// an axis was switched on, or has an error.
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
}

/// The limits of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Of the output shaft.
    pub speed: Rpm,
    /// Of the motor.
    pub current: Amps,
}

impl Config {
    /// An axis that turns the output shaft directly and forward, and is told no limits.
    pub const fn new(firmware: Firmware, control: Control, rates: Rates) -> Self {
        Self {
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
    #[must_use]
    pub const fn with_gear(self, gear: Gear) -> Self {
        Self { gear, ..self }
    }

    /// Counting this way.
    #[must_use]
    pub const fn with_direction(self, direction: Direction) -> Self {
        Self { direction, ..self }
    }

    /// Never exceeding these.
    #[must_use]
    pub const fn with_limits(self, limits: Limits) -> Self {
        Self { limits: Some(limits), ..self }
    }

    /// Whether a node can be like that.
    pub(super) fn checked(&self, node: u8) -> Result<Node, ConfigError> {
        let check = ConfigError::check;
        let reserved =
            ConfigError::new("node", node.into(), "0 to 62: an axis without a number has 63");
        let node = Node::new(node).filter(|node| node.number() < 63).ok_or(reserved)?;
        let ratio = self.gear.ratio();
        check(ratio >= 1.0, "gear", ratio, "one turn or more for a turn of the output")?;
        self.check_control()?;
        let Rates { estimates, heartbeat, currents, temperatures, supply } = self.rates;
        for (field, rate) in [("estimates", estimates), ("heartbeat", heartbeat)] {
            check((1..=1000).contains(&rate), field, rate.into(), "1 to 1000 Hz")?;
        }
        // The link time-out follows from the most frequent message.
        for (field, rate) in [
            ("heartbeat", heartbeat),
            ("currents", currents),
            ("temperatures", temperatures),
            ("supply", supply),
        ] {
            check(rate <= estimates, field, rate.into(), "not above the rate of the estimates")?;
        }
        let tells = self.firmware.has_temperatures || temperatures == 0;
        check(tells, "temperatures", temperatures.into(), "0: this firmware does not send them")?;
        let usable = |value: f32| value.is_finite() && value > 0.0;
        if let Some(Limits { speed, current }) = self.limits {
            check(usable(speed.get()), "speed limit", speed.get(), "finite and above zero")?;
            check(usable(current.get()), "current limit", current.get(), "finite and above zero")?;
        }
        let needed = !matches!(self.control, Control::Torque(_)) && self.limits.is_none();
        let must_be = "given to an axis that closes its own loops: by them it starts softly";
        check(!needed, "limits", f32::NAN, must_be)?;
        let constant = self.torque_constant.unwrap_or(1.0);
        check(usable(constant), "torque_constant", constant, "finite and above zero")?;
        Ok(node)
    }

    fn check_control(&self) -> Result<(), ConfigError> {
        use InputMode::{Passthrough, PositionFilter, Trapezoid, VelocityRamp};
        let (input, good, must_be) = match self.control {
            Control::Torque(cascade) => return cascade.validate(),
            Control::Velocity(input) => {
                (input, matches!(input, Passthrough | VelocityRamp), "passthrough (1) or ramp (2)")
            }
            Control::Position(input) => {
                let good = matches!(input, Passthrough | PositionFilter | Trapezoid);
                (input, good, "passthrough (1), filter (3) or trapezoid (5)")
            }
        };
        ConfigError::check(good, "input mode", f32::from(input as u8), must_be)
    }
}

/// A family of firmware, by what its error word means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Firmware {
    /// As the vendor counts.
    pub version: &'static str,
    /// Bits of the error word and their texts, the gravest first.
    pub errors: &'static [(u8, &'static str)],
    /// Bits that are set while an axis starts: no fault.
    pub starting: u32,
    /// Whether message `15` is temperatures.
    pub has_temperatures: bool,
}

impl Firmware {
    /// `ODrive` v3 (`odrive-interface.yaml`, `ODrive.Axis.error`; bits 1 to 5, 10, 15 and 16 only
    /// in older ones).
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
