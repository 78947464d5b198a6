//! Models of DJI motors, the settings of their controllers, and a motor as it is set up.

use embedded_can::StandardId;
use rc10_app::{Cascade, ConfigError, Direction, FeedForward, Gear, PidConfig, RpmPerSecond, ok};
use rc10_can::IdPattern;

use crate::can_ids::{CanIds, Frames, Ownership, Rate};
use crate::shaft::gear;

/// Properties of a DJI model. Controllers of the same protocol are one more constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// The name, as the vendor writes it.
    pub name: &'static str,
    /// Identifiers go from 1 to this.
    pub last_id: u8,
    /// Feedback comes with this plus the identifier set on the device.
    pub feedback_base: u16,
    /// Command frame of identifiers 1 ..= 4, and of 5 ..= 8.
    pub command_ids: [u16; 2],
    /// The quantity that a command sets: a current or a voltage.
    pub effort: Effort,
    /// Raw command at full scale.
    pub full_scale: i16,
    /// Amperes per raw unit of the current in the feedback.
    pub amps_per_count: f32,
    /// Whether byte 6 of the feedback is a temperature.
    pub has_temperature: bool,
    /// The gearbox it is sold with.
    pub gear: Gear,
    /// Torque per ampere at the rotor, N m / A.
    pub rotor_torque_constant: f32,
    /// Gains that work from a bare shaft to a usual load (wheel of a 20 kg robot: 0.029 kg m²,
    /// M2006 0.002, gimbal 0.01), give or take 30 %.
    pub cascade: Cascade,
}

/// The quantity that a raw command stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effort {
    /// A torque-producing current; the number is full scale in amperes.
    Current(f32),
    /// A voltage, as a share of full scale: the vendor documents no volts per count.
    Voltage,
}

impl Effort {
    /// Full scale, in the unit the cascade works in.
    pub(super) const fn full(self) -> f32 {
        match self {
            Self::Current(amps) => amps,
            Self::Voltage => 1.0,
        }
    }
}

/// `speed` is kp, ki, largest effort; `angle` is kp, largest speed in rpm; `acceleration` rpm/s.
const fn cascade(speed: [f32; 3], angle: [f32; 2], acceleration: f32) -> Cascade {
    let ([kp, ki, effort], [angle_kp, rpm]) = (speed, angle);
    Cascade {
        speed: PidConfig::within(effort).kp(kp).ki(ki),
        angle: PidConfig::within(rpm).kp(angle_kp),
        outer_divider: 10,
        acceleration: RpmPerSecond::new(acceleration),
        feed_forward: FeedForward::NONE,
    }
}

/// M3508 with its C620: ±20 A, gear 3591 : 187.
pub const M3508: Model = Model {
    name: "M3508",
    last_id: 8,
    feedback_base: 0x200,
    command_ids: [0x200, 0x1FF],
    effort: Effort::Current(20.0),
    full_scale: 16384,
    amps_per_count: 20.0 / 16384.0,
    has_temperature: true,
    gear: gear(3591, 187),
    rotor_torque_constant: 0.015_622,
    cascade: cascade([0.40, 2.0, 20.0], [1.3, 400.0], 1000.0),
};

/// M2006 with its C610: ±10 A, gear 36 : 1. It has no temperature sensor.
pub const M2006: Model = Model {
    name: "M2006",
    effort: Effort::Current(10.0),
    full_scale: 10000,
    amps_per_count: 10.0 / 10000.0,
    has_temperature: false,
    gear: gear(36, 1),
    rotor_torque_constant: 0.005,
    cascade: cascade([0.10, 0.75, 10.0], [1.3, 400.0], 2000.0),
    ..M3508
};

/// GM6020 in current mode: ±3 A. Set in RoboMaster Assistant (1.0.11.2 on); it obeys no other mode.
pub const GM6020_CURRENT: Model = Model {
    name: "GM6020 (current mode)",
    last_id: 7,
    feedback_base: 0x204,
    command_ids: [0x1FE, 0x2FE],
    effort: Effort::Current(3.0),
    full_scale: 16384,
    amps_per_count: 3.0 / 16384.0,
    has_temperature: true,
    gear: Gear::DIRECT,
    rotor_torque_constant: 0.741,
    cascade: cascade([0.04, 0.1, 3.0], [0.8, 250.0], 500.0),
};

/// GM6020 set to voltage mode, as sold. ±25000: every firmware (the first manual says 30000).
pub const GM6020_VOLTAGE: Model = Model {
    name: "GM6020 (voltage mode)",
    command_ids: [0x1FF, 0x2FF],
    effort: Effort::Voltage,
    full_scale: 25000,
    cascade: Cascade {
        // 320 rpm at full voltage without load; less, so that a weak motor is not overdriven.
        feed_forward: FeedForward::of_speed(0.7 / 320.0),
        ..cascade([0.003, 0.06, 1.0], [0.8, 250.0], 500.0)
    },
    ..GM6020_CURRENT
};

impl Model {
    /// The identifier of the feedback of device `id`.
    ///
    /// # Errors
    /// [`ConfigError`] for an `id` that no device of the model can be set to.
    pub const fn feedback_id(&self, id: u8) -> Result<StandardId, ConfigError> {
        Ok(ok!(self.ids(id)).0)
    }

    /// The identifier of the frame that commands device `id`, and the first of its two bytes in it.
    ///
    /// # Errors
    /// [`ConfigError`] for an `id` that no device of the model can be set to.
    pub const fn command_lane(&self, id: u8) -> Result<(StandardId, usize), ConfigError> {
        let (_, command, lane) = ok!(self.ids(id));
        Ok((command, lane))
    }

    /// Identifiers of feedback and command, and the place in the command.
    pub(super) const fn ids(&self, id: u8) -> Result<(StandardId, StandardId, usize), ConfigError> {
        let must_be = match self.last_id {
            4 => "1 to 4",
            7 => "1 to 7",
            8 => "1 to 8",
            _ => "1 to the `last_id` of its model",
        };
        let error = ConfigError::new("id", id as f32, must_be).of_device(self.name, id as u16);
        if id == 0 || id > self.last_id || id > 8 {
            return Err(error);
        }
        let (group, lane) = ((id as usize - 1) / 4, (id as usize - 1) % 4 * 2);
        let feedback = StandardId::new(self.feedback_base + id as u16);
        match (feedback, StandardId::new(self.command_ids[group])) {
            (Some(feedback), Some(command)) => Ok((feedback, command, lane)),
            _ => Err(error),
        }
    }
}

/// A DJI motor as it is set up.
///
/// ```
/// use rc10_motor::dji::{Config, M3508};
/// use rc10_motor::rc10_app::Direction;
/// const WHEEL: Config = Config::new(&M3508, 1).with_direction(Direction::Reversed);
/// const _: () = assert!(WHEEL.validate().is_ok());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Config {
    /// The model.
    pub model: &'static Model,
    /// The identifier set on it: 1 to the model's `last_id`.
    pub id: u8,
    /// The gearbox.
    pub gear: Gear,
    /// Which way its output shaft counts.
    pub direction: Direction,
    /// The feedback rate set in its controller.
    pub rate: FeedbackRate,
    /// The control loops. The speed loop's output limit is at most what the model can: 20 A, 10 A or 3 A, or 1 for the
    /// whole voltage.
    pub cascade: Cascade,
}

impl Config {
    /// The device set to `id`, stock gearbox, forward, 1 kHz, with the model's gains.
    pub const fn new(model: &'static Model, id: u8) -> Self {
        let (gear, cascade) = (model.gear, model.cascade);
        let (direction, rate) = (Direction::Forward, FeedbackRate::Hz1000);
        Self { model, id, gear, direction, rate, cascade }
    }

    /// With another gearbox ([`Gear::DIRECT`] for none). The gains are scaled so that the rotor is
    /// driven as before; an explicit [`with_cascade`](Self::with_cascade) comes after this.
    pub const fn with_gear(mut self, gear: Gear) -> Self {
        let factor = gear.ratio() / self.gear.ratio();
        self.cascade.speed.kp *= factor;
        self.cascade.speed.ki *= factor;
        self.cascade.speed.kd *= factor;
        self.cascade.feed_forward = self.cascade.feed_forward.geared(factor);
        self.cascade.angle.output_limit /= factor;
        self.cascade.acceleration = RpmPerSecond::new(self.cascade.acceleration.get() / factor);
        self.gear = gear;
        self
    }

    /// With the feedback rate that is set in the controller.
    pub const fn with_feedback_rate(self, rate: FeedbackRate) -> Self {
        Self { rate, ..self }
    }

    /// With what is on its shaft: the effort that moving it takes. After [`with_gear`](Self::with_gear).
    pub const fn with_feed_forward(mut self, feed_forward: FeedForward) -> Self {
        self.cascade.feed_forward = feed_forward;
        self
    }

    /// Torque at the output shaft per ampere, N m/A.
    #[must_use]
    pub const fn torque_constant(&self) -> f32 {
        self.model.rotor_torque_constant * self.gear.ratio()
    }

    pub(crate) const fn check(&self) -> Result<(), ConfigError> {
        ok!(self.model.ids(self.id));
        ok!(self.cascade.validate());
        let (limit, full) = (self.cascade.speed.output_limit, self.model.effort.full());
        let must_be = match self.model.effort {
            Effort::Current(_) => "at most the model's largest current, in A",
            Effort::Voltage => "at most 1, the whole voltage",
        };
        let error = ConfigError::check(limit <= full, "output_limit", limit, must_be);
        ok!(error, in "speed");
        Ok(())
    }

    /// The identifiers on its bus, of a [valid](Self::validate) configuration; else no identifier.
    pub const fn can_ids(&self) -> CanIds {
        let Ok((_, _, lane)) = self.model.ids(self.id) else { return CanIds::new() };
        let Model { feedback_base, command_ids, .. } = self.model;
        let feedback = IdPattern::standard(*feedback_base + self.id as u16);
        let command = IdPattern::standard(command_ids[(self.id as usize - 1) / 4]);
        let feedback = Frames::new(feedback, 8, Rate::Hz(self.rate.hz()));
        let command = Frames::new(command, 8, Rate::EveryTick);
        CanIds::new().receives(feedback).transmits(command.owned(Ownership::Bytes(0b11 << lane)))
    }
}

/// The feedback rate, set in RoboMaster Assistant (GM6020: 1 kHz only).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeedbackRate {
    /// 1000 Hz, the factory setting.
    #[default]
    Hz1000 = 1000,
    /// 500 Hz: needed from six motors a bus on.
    Hz500 = 500,
    /// 250 Hz; above 6750 rpm the rotor's turns are estimated, see
    /// [`Feedback::turn_gaps`](crate::Feedback::turn_gaps).
    Hz250 = 250,
    /// 125 Hz; above 3375 rpm the rotor's turns are estimated.
    Hz125 = 125,
}

impl FeedbackRate {
    /// In frames a second.
    #[must_use]
    pub const fn hz(self) -> u16 {
        self as u16
    }
}
