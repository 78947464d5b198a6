//! Properties of the motor, its stock gains, and how it is set up.

use rc10_app::{
    Cascade, ConfigError, Direction, FeedForward, NewtonMetres, PidConfig, Rpm, RpmPerSecond, ok,
};
use rc10_can::IdPattern;

use crate::can_ids::{CanIds, Frames, Rate};
use crate::servo::{Servo, SpringRange};
use crate::target::TargetKind;

use super::wire::module::{FROM_MODULE, Module};
use super::wire::{Address, GAIN_LIMIT, GEAR, SPEED_LIMIT};

/// Largest torque at the output shaft (data manual).
pub const LARGEST_TORQUE: NewtonMetres = NewtonMetres::new(23.7);

/// Gains in N m at the output, to a load of 0.02 kg m², give or take 30 %; from simulation only.
pub const CASCADE: Cascade = Cascade {
    speed: PidConfig::within(LARGEST_TORQUE.get()).kp(0.12).ki(0.8),
    angle: PidConfig::within(200.0).kp(1.1),
    outer_divider: 1,
    acceleration: RpmPerSecond::new(800.0),
    feed_forward: FeedForward::NONE,
};

#[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
const SPRINGS: SpringRange = {
    let ratio = GEAR.rotor_turns() as f64 / GEAR.output_turns() as f64;
    let gain = (GAIN_LIMIT * ratio * ratio) as f32;
    let rpm = SPEED_LIMIT * 60.0 / (core::f64::consts::TAU * ratio);
    SpringRange { kp: gain, kd: gain, speed: Rpm::new(rpm as f32) }
};

/// Loops of ours, and the controller's springs.
pub(super) const fn servo(cascade: Cascade) -> Servo {
    Servo::of(TargetKind::Torque, cascade).with_springs(SPRINGS)
}

const fn check_cascade(cascade: &Cascade) -> Result<(), ConfigError> {
    let limit = cascade.speed.output_limit;
    let is_good = limit <= LARGEST_TORQUE.get();
    let checked = ConfigError::check(is_good, "output_limit", limit, "at most 23.7 N m");
    ok!(checked, in "speed");
    cascade.validate()
}

/// A GO-M8010-6 on RS-485 as it is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct LineConfig {
    /// The number on the line, 0 to 14.
    pub id: u8,
    /// Which way its output shaft counts.
    pub direction: Direction,
    /// Loops of ours; the speed loop's output limit is the largest torque, N m.
    pub cascade: Cascade,
}

impl LineConfig {
    /// The motor set to `id`, turning forward, with [`CASCADE`].
    pub const fn new(id: u8) -> Self {
        Self { id, direction: Direction::Forward, cascade: CASCADE }
    }

    pub(crate) const fn check(&self) -> Result<(), ConfigError> {
        ok!(self.address());
        check_cascade(&self.cascade)
    }

    /// The address on the line.
    ///
    /// # Errors
    /// [`ConfigError`] for an `id` that no motor has.
    pub const fn address(&self) -> Result<Address, ConfigError> {
        match Address::new(self.id) {
            Some(address) => Ok(address),
            None => {
                let must_be = "0 to 14 (15 is every motor)";
                Err(self.name().blame(ConfigError::new("id", self.id as f32, must_be)))
            }
        }
    }
}

/// A GO-M8010-6 behind a CAN-to-485 module as it is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct ModuleConfig {
    /// The module, 0 to 3, by switches 1 and 2; 3 as sold. Never 0 beside a VESC: same frames.
    pub module: u8,
    /// The number on the module's line, 0 to 14.
    pub motor: u8,
    /// Which way its output shaft counts.
    pub direction: Direction,
    /// Loops of ours; the speed loop's output limit is the largest torque, N m.
    pub cascade: Cascade,
}

/// By the module's number.
const NAMES: [&str; 4] = [
    "GO-M8010-6 behind module 0,",
    "GO-M8010-6 behind module 1,",
    "GO-M8010-6 behind module 2,",
    "GO-M8010-6 behind module 3,",
];

/// Bits of an identifier with module, direction and motor.
pub(super) const OWNER: u32 = 0x1C00_0F00;
/// The same, bits 25 and 24 and the lowest byte: zero in what is sent to a motor.
const TO_MOTOR: u32 = 0x1F00_0FFF;

impl ModuleConfig {
    /// The motor with a number behind a module, turning forward, with [`CASCADE`].
    pub const fn new(module: u8, motor: u8) -> Self {
        Self { module, motor, direction: Direction::Forward, cascade: CASCADE }
    }

    /// The model, and the module that it is behind.
    pub(crate) const fn model(&self) -> &'static str {
        let known = (self.module as usize) < NAMES.len();
        if known { NAMES[self.module as usize] } else { "GO-M8010-6" }
    }

    pub(crate) const fn check(&self) -> Result<(), ConfigError> {
        ok!(self.devices());
        check_cascade(&self.cascade)
    }

    pub(super) const fn devices(&self) -> Result<(Module, Address), ConfigError> {
        const ALL: &str = "0 to 14 (15 is every motor)";
        match (Module::new(self.module), Address::new(self.motor)) {
            (Some(module), Some(address)) => Ok((module, address)),
            (None, _) => Err(ConfigError::new("module", self.module as f32, "0 to 3")),
            (_, None) => Err(ConfigError::new("motor", self.motor as f32, ALL)),
        }
    }

    /// The identifiers it occupies on its bus. Of a configuration that is [valid](Self::validate).
    pub const fn can_ids(&self) -> CanIds {
        let module = (self.module as u32) << 27;
        let commands = IdPattern::extended(module | (self.motor as u32) << 8);
        let replies = IdPattern::extended(commands.raw() | FROM_MODULE);
        let to_all = IdPattern::extended(module | (Address::BROADCAST.get() as u32) << 8);
        // One pattern for state, fault and gains: a bus has room for eight that are masked.
        CanIds::new()
            .receives(Frames::new(replies.under(OWNER), 8, Rate::EveryTick))
            .transmits(Frames::new(commands.under(TO_MOTOR), 8, Rate::EveryTick))
            .listens_to(commands.under(OWNER))
            .listens_to(to_all.under(OWNER))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;
    use crate::motor::{CanMotor, Motor};
    use crate::unitree::{GoM8010, GoModule};

    #[test]
    fn the_stock_gains_are_good_and_more_torque_than_the_motor_has_is_refused() {
        assert!(LineConfig::new(14).validate().is_ok());
        let mut cascade = CASCADE;
        for (limit, text) in [(24.0, "24"), (f32::NAN, "NaN")] {
            cascade.speed.output_limit = limit;
            let error = GoM8010::new(LineConfig::new(3).with_cascade(cascade)).unwrap_err();
            let sentence =
                "GO-M8010-6 id 3: `speed.output_limit` is # but must be at most 23.7 N m";
            assert_eq!(error.to_string(), sentence.replace('#', &std::format!("{text},")));
        }
    }

    #[test]
    fn configurations_are_checked_in_constants_and_their_motors_occupy_what_they_say() {
        const HIP: ModuleConfig = ModuleConfig::new(3, 14);
        const _: () = assert!(HIP.validate().is_ok() && LineConfig::new(14).validate().is_ok());
        const IDS: CanIds = HIP.can_ids();
        let motor = GoModule::new(HIP).unwrap();
        assert_eq!(motor.name(), HIP.name());
        assert_eq!(motor.can_ids().received(), IDS.received());
        assert_eq!(motor.can_ids().transmitted(), IDS.transmitted());
        assert_eq!(motor.can_ids().listened_to(), IDS.listened_to());
        let refused = |config: ModuleConfig| GoModule::new(config).unwrap_err().to_string();
        assert_eq!(
            refused(ModuleConfig::new(4, 0)),
            "GO-M8010-6 id 0: `module` is 4, but must be 0 to 3"
        );
        assert_eq!(
            refused(ModuleConfig::new(1, 15)),
            "GO-M8010-6 behind module 1, id 15: `motor` is 15, but must be 0 to 14 (15 is every motor)"
        );
        assert_eq!(
            GoM8010::new(LineConfig::new(15)).unwrap_err().to_string(),
            "GO-M8010-6 id 15: `id` is 15, but must be 0 to 14 (15 is every motor)"
        );
    }
}
