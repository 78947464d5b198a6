//! Models and addresses: ranges, and what the fault bits mean.

use rc10_app::{Cascade, ConfigError, Direction, FeedForward, PidConfig, RpmPerSecond, ok};
use rc10_can::IdPattern;
use rc10_time::Micros;

use super::wire::Address;
use crate::can_ids::{CanIds, Frames, Rate};
use crate::feedback::Fault;
use crate::mit::Limits;
use crate::pending::is_timeout;

/// A model of motor: its limits, faults and gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// The name, as the vendor writes it.
    pub name: &'static str,
    /// Physical values at the ends of the number fields of a frame.
    pub limits: Limits,
    /// Meanings of bits 16 to 21 of a feedback's identifier, the gravest first.
    pub faults: &'static [(u8, &'static str); 6],
    /// Masks and texts of [`FaultReport`](super::wire::FaultReport) bits, the gravest first.
    pub details: &'static [(u32, &'static str)],
    /// Whether it can keep settings and its zero when the power is cut (type 22).
    pub saves: bool,
    /// Gains that work, in N m: simulated up to 0.02 kg m² on a CyberGear, others in proportion.
    pub cascade: Cascade,
}

/// CyberGear manual, feedback frame.
pub(super) const CYBERGEAR_FAULTS: [(u8, &str); 6] = [
    (1, "over-current"),
    (2, "too hot"),
    (3, "magnetic encoder fault"),
    (4, "Hall encoder fault"),
    (0, "under-voltage"),
    (5, "not calibrated"),
];

/// RobStride manuals, feedback frame: bits 1 and 4 differ.
pub(super) const ROBSTRIDE_FAULTS: [(u8, &str); 6] = [
    (1, "driver fault"),
    (2, "too hot"),
    (3, "magnetic encoder fault"),
    (4, "stall overload"),
    (0, "under-voltage"),
    (5, "not calibrated"),
];

/// CyberGear manual, fault frame.
pub(super) const CYBERGEAR_DETAILS: [(u32, &str); 9] = [
    (1 << 1, "driver chip fault"),
    (1 << 16, "over-current in phase A"),
    (1 << 4, "over-current in phase B"),
    (1 << 5, "over-current in phase C"),
    (1 << 0, "motor too hot (80 °C)"),
    (0xFF << 8, "overload"),
    (1 << 3, "over-voltage"),
    (1 << 2, "under-voltage"),
    (1 << 7, "encoder not calibrated"),
];

/// RobStride manuals RS00, RS04 and RS05, fault frame.
pub(super) const ROBSTRIDE_DETAILS: [(u32, &str); 11] = [
    (1 << 1, "driver chip fault"),
    (1 << 16, "over-current in phase A"),
    (1 << 4, "over-current in phase B"),
    (1 << 5, "over-current in phase C"),
    (1 << 0, "motor too hot"),
    (1 << 14, "stall overload"),
    (1 << 3, "over-voltage"),
    (1 << 2, "under-voltage"),
    (1 << 9, "position not initialised"),
    (1 << 8, "hardware not recognised"),
    (1 << 7, "encoder not calibrated"),
];

/// Gains in proportion to torque, as inertia grows. Two thirds of the speed are for a low supply.
const fn cascade(limits: &Limits) -> Cascade {
    let kp = limits.torque / 200.0;
    Cascade {
        speed: PidConfig::within(limits.torque).kp(kp).ki(10.0 * kp),
        angle: PidConfig::within(limits.rpm() * (2.0 / 3.0)).kp(1.3),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    }
}

const fn robstride(name: &'static str, limits: Limits) -> Model {
    Model {
        name,
        limits,
        faults: &ROBSTRIDE_FAULTS,
        details: &ROBSTRIDE_DETAILS,
        saves: true,
        cascade: cascade(&limits),
    }
}

/// All models of CyberGear and RobStride.
pub mod models {
    use super::{Limits, Model, robstride};

    /// Xiaomi CyberGear: ±12.5 rad, ±30 rad/s, ±12 N m. The manual's table says ±4π rad, its own sample
    /// and every driver 12.5; [`with_position_range`] makes it the other.
    ///
    /// [`with_position_range`]: crate::cybergear::Config::with_position_range
    pub const CYBERGEAR: Model = Model {
        faults: &super::CYBERGEAR_FAULTS,
        details: &super::CYBERGEAR_DETAILS,
        saves: false,
        ..robstride("CyberGear", Limits::new(12.5, 30.0, 12.0))
    };

    // RobStride manuals RS00 to RS06, 260428.

    /// RobStride RS00: ±12.57 rad, ±33 rad/s, ±14 N m. Firmware before 0.0.2.6 has ±12.5 rad:
    /// [`with_position_range`](crate::cybergear::Config::with_position_range).
    pub const RS00: Model = robstride("RS00", Limits::new(12.57, 33.0, 14.0));
    /// RobStride RS01: ±12.57 rad, ±44 rad/s, ±17 N m.
    pub const RS01: Model = robstride("RS01", Limits::new(12.57, 44.0, 17.0));
    /// RobStride RS02: as RS01.
    pub const RS02: Model = robstride("RS02", Limits::new(12.57, 44.0, 17.0));
    /// RobStride RS03: ±12.57 rad, ±20 rad/s, ±60 N m; gains up to 5000 and 100.
    pub const RS03: Model =
        robstride("RS03", Limits::new(12.57, 20.0, 60.0).with_gains(5000.0, 100.0));
    /// RobStride RS04: ±12.57 rad, ±15 rad/s, ±120 N m; gains up to 5000 and 100.
    pub const RS04: Model =
        robstride("RS04", Limits::new(12.57, 15.0, 120.0).with_gains(5000.0, 100.0));
    /// RobStride RS05: ±12.57 rad, ±50 rad/s, ±5.5 N m.
    pub const RS05: Model = robstride("RS05", Limits::new(12.57, 50.0, 5.5));
    /// RobStride RS06: ±12.57 rad, ±50 rad/s, ±36 N m; gains up to 5000 and 100.
    pub const RS06: Model =
        robstride("RS06", Limits::new(12.57, 50.0, 36.0).with_gains(5000.0, 100.0));

    /// All of them.
    pub const ALL: [&Model; 8] = [&CYBERGEAR, &RS00, &RS01, &RS02, &RS03, &RS04, &RS05, &RS06];
}

impl Model {
    /// The fault of a feedback: bits as code, the gravest as text; `None` if nothing is wrong.
    pub fn fault(&self, faults: u8) -> Option<Fault> {
        let &(_, text) = self.faults.iter().find(|(bit, _)| faults >> bit & 1 != 0)?;
        Some(Fault::new(faults.into(), text))
    }

    /// The fault of a fault frame: bits as code, the gravest as text; `None` if no bit is set.
    pub fn detail(&self, faults: u32) -> Option<Fault> {
        if faults == 0 {
            return None;
        }
        let known = self.details.iter().find(|(mask, _)| faults & mask != 0);
        Some(Fault::new(faults, known.map_or("unknown fault", |&(_, text)| text)))
    }
}

/// The identifier that addresses every device on a bus: no host's own.
const EVERY_DEVICE: u8 = 0xFE;
/// The largest range of position that can be set, rad.
const LARGEST_RANGE: f32 = 15.0;

/// A CyberGear or RobStride as it is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Config {
    /// The model, with the range of position that is in the device.
    pub model: Model,
    /// Its identifier, 1 to 127, and the host's: below 0xFE, and no motor's (vendors' tools: 0xFD).
    pub address: Address,
    /// Which way its output shaft counts.
    pub direction: Direction,
    /// Loops of ours, efforts in N m.
    pub cascade: Cascade,
    /// Silence after which a RobStride stops by itself, its `canTimeout`: at most this long. Read before it
    /// is ever enabled, and again when it comes back; without one, as it is sold, a motor whose cable is cut
    /// keeps its last torque. Zero: it is not looked at, as of a CyberGear, which has none.
    pub timeout: Micros,
}

impl Config {
    /// A motor of the model, turning forward, with the gains that come with the model; a RobStride has a
    /// time-out of at most 100 ms.
    pub const fn new(model: &Model, address: Address) -> Self {
        let (direction, cascade) = (Direction::Forward, model.cascade);
        let timeout = Micros::from_millis(if model.saves { 100 } else { 0 });
        Self { model: *model, address, direction, cascade, timeout }
    }

    /// The longest [time-out](Self::timeout) that it may have: 10 ms and more, or zero for any and none.
    pub const fn with_timeout(self, timeout: Micros) -> Self {
        Self { timeout, ..self }
    }

    /// The position range in rad, up to 15: a CyberGear has 12.5 or 4π, RS00 before 0.0.2.6 12.5.
    pub const fn with_position_range(mut self, range: f32) -> Self {
        self.model.limits.position = range;
        self
    }

    pub(crate) const fn check(&self) -> Result<(), ConfigError> {
        let Address { motor, host } = self.address;
        let is_good = motor >= 1 && motor <= 127;
        ok!(ConfigError::check(is_good, "motor", motor as f32, "1 to 127"));
        let is_good = host != motor && host < EVERY_DEVICE;
        let must_be = "below 254, and not the motor's own identifier";
        ok!(ConfigError::check(is_good, "host", host as f32, must_be));
        ok!(is_timeout(self.timeout));
        let is_good = self.model.saves || self.timeout.get() == 0;
        let millis = self.timeout.get() as f32 / 1e3;
        ok!(ConfigError::check(is_good, "timeout", millis, "zero: a CyberGear has none"));
        let limits = &self.model.limits;
        let is_good = limits.position <= LARGEST_RANGE;
        ok!(ConfigError::check(is_good, "position", limits.position, "at most 15 rad"));
        ok!(limits.validate());
        limits.check(&self.cascade)
    }

    /// The identifiers it occupies on its bus.
    pub const fn can_ids(&self) -> CanIds {
        let motor = self.address.motor as u32;
        // Feedback, type 2; all other types alike.
        let replies = 2 << 24 | motor << 8 | self.address.host as u32;
        let replies = Frames::new(IdPattern::extended(replies).under(0xFFFF), 8, Rate::EveryTick);
        let motion = IdPattern::extended(MOTION | motor).under(0x1F00_00FF);
        CanIds::new()
            .receives(replies.with_leading(5))
            .transmits(Frames::new(motion, 8, Rate::EveryTick))
            .transmits(Frames::new(IdPattern::extended(motor).under(0xFF), 8, Rate::Rare))
    }
}

pub(super) const MOTION: u32 = 1 << 24;

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::models::{ALL, CYBERGEAR, RS04};
    use super::*;
    use crate::cybergear::CyberGear;
    use crate::motor::{CanMotor, Motor};

    const ADDRESS: Address = Address { motor: 127, host: 0xFD };

    #[test]
    fn a_configuration_is_checked_in_a_constant_and_its_motor_occupies_what_it_says() {
        const WRIST: Config = Config::new(&CYBERGEAR, ADDRESS).with_position_range(12.57);
        const _: () = assert!(WRIST.validate().is_ok());
        const IDS: CanIds = WRIST.can_ids();
        let motor = CyberGear::new(WRIST).unwrap();
        assert_eq!(motor.name(), WRIST.name());
        assert_eq!(motor.can_ids().received(), IDS.received());
        assert_eq!(motor.can_ids().transmitted(), IDS.transmitted());
        let at = |motor, host| Config { address: Address { motor, host }, ..WRIST };
        for (config, sentence) in [
            (at(128, 0), "CyberGear id 128: `motor` is 128, but must be 1 to 127"),
            (
                at(7, 7),
                "CyberGear id 7: `host` is 7, but must be below 254, and not the motor's own \
                 identifier",
            ),
            (
                WRIST.with_position_range(16.0),
                "CyberGear id 127: `position` is 16, but must be at most 15 rad",
            ),
        ] {
            assert_eq!(config.validate().unwrap_err().to_string(), sentence);
        }
    }

    #[test]
    fn all_limits_can_be_used_and_all_bits_have_a_text() {
        for model in ALL {
            assert_eq!(Config::new(model, ADDRESS).validate(), Ok(()), "{}", model.name);
            for bit in 0..6 {
                assert!(model.fault(1 << bit).is_some(), "{bit}");
            }
        }
        assert_eq!(CYBERGEAR.fault(0xC0), None);
    }

    #[test]
    fn the_gravest_fault_gives_the_text() {
        assert_eq!(CYBERGEAR.fault(0b10_0011), Some(Fault::new(0x23, "over-current")));
        assert_eq!(RS04.fault(0b10_0011), Some(Fault::new(0x23, "driver fault")));
        assert_eq!(CYBERGEAR.detail(0), None);
        assert_eq!(CYBERGEAR.detail(0x4001), Some(Fault::new(0x4001, "motor too hot (80 °C)")));
        assert_eq!(RS04.detail(0x4008), Some(Fault::new(0x4008, "stall overload")));
        assert_eq!(RS04.detail(1 << 31), Some(Fault::new(1 << 31, "unknown fault")));
    }
}
