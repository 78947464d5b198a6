//! The motor table: the motors of six vendors on two buses and a line.

use core::num::NonZeroU8;
use rc10::prelude::*;

use rc10::motor::cybergear::{self, CyberGear};
use rc10::motor::damiao::{self, Damiao};
use rc10::motor::lk::{self, Lk};
use rc10::motor::odrive::{self, ODrive};
use rc10::motor::unitree::{GoM8010, GoModule, LineConfig, ModuleConfig};
use rc10::motor::vesc::{self, Currents, ElectricalScale, Vesc};

rc10::robot! {
    line rs485 at 4_000_000, replies in REPLY;
    motors {
        Wheel: Vesc = Entry::new(Bus(1), WHEEL)
            .with_safety(Safety::BRAKE)
            .with_jog(Rpm::new(300.0)),
        Arm: Damiao = Entry::new(Bus(1), ARM).with_safety(Safety::HOLD),
        Hip: GoModule = late(Bus(1), ModuleConfig::new(3, 0)).with_safety(Safety::HOLD),
        Wrist: CyberGear = Entry::new(Bus(2), WRIST),
        Turret: Lk = late(Bus(2), TURRET).with_safety(Safety::HOLD),
        Flywheel: ODrive = Entry::new(Bus(2), FLYWHEEL),
        Leg0: GoM8010 = leg(0),
        Leg1: GoM8010 = leg(1),
        Leg2: GoM8010 = leg(2),
        Leg3: GoM8010 = leg(3),
        Leg4: GoM8010 = leg(4),
        Leg5: GoM8010 = leg(5),
        Leg6: GoM8010 = leg(6),
        Leg7: GoM8010 = leg(7),
    }
}

/// The legs.
pub const LEGS: [Name; 8] = [
    Name::Leg0,
    Name::Leg1,
    Name::Leg2,
    Name::Leg3,
    Name::Leg4,
    Name::Leg5,
    Name::Leg6,
    Name::Leg7,
];

/// Motors whose commands may arrive after their tick, at worst: others on the bus are more urgent, and all may come at once.
/// `rc10 plan` has the times.
const fn late<C: Copy>(on: rc10::motor::Place, config: C) -> Entry<C> {
    Entry::new(on, config).with_most_age(Micros::from_millis(10))
}

const fn leg(id: u8) -> Entry<LineConfig> {
    Entry::new(Line(1), LineConfig::new(id)).with_safety(Safety::HOLD)
}

/// Seven pole pairs, no gear, currents below what VESC Tool allows it.
pub const WHEEL: vesc::Config = vesc::Config::new(
    1,
    ElectricalScale::new(NonZeroU8::new(7).unwrap(), Gear::DIRECT),
    Currents { limit: Amps::new(40.0), brake: Amps::new(15.0), handbrake: Amps::new(10.0) },
);

/// In MIT mode; efforts in N m; for a light arm on the shaft. The low byte of its identifier is beyond
/// those of DJI's feedback.
pub const ARM: damiao::Config = damiao::Config::new(
    damiao::models::J4310,
    0x11,
    0x31,
    damiao::Control::Mit(Cascade {
        speed: PidConfig::within(7.0).kp(0.063).ki(0.5),
        angle: PidConfig::within(150.0).kp(1.3),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    }),
);

/// With our own identifier, as vendors' tools have it.
pub const WRIST: cybergear::Config = cybergear::Config::new(
    &cybergear::models::CYBERGEAR,
    cybergear::Address { motor: 0x7F, host: 0xFD },
);

/// Efforts in A, 5 of its 33.
pub const TURRET: lk::Config = lk::Config::new(
    lk::models::MG4010E_I10,
    1,
    Cascade {
        speed: PidConfig::within(5.0).kp(0.2).ki(2.0),
        angle: PidConfig::within(200.0).kp(3.0),
        outer_divider: 5,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    },
);

/// Efforts in N m behind its gearbox, estimates at 1 kHz, heartbeats at 100 Hz.
pub const FLYWHEEL: odrive::Config = odrive::Config::new(
    3,
    odrive::Firmware::V0_6,
    odrive::Control::Torque(Cascade {
        speed: PidConfig::within(8.0).kp(0.1).ki(1.0),
        angle: PidConfig::within(250.0).kp(3.0),
        outer_divider: 5,
        acceleration: RpmPerSecond::new(1500.0),
        feed_forward: FeedForward::NONE,
    }),
    odrive::Rates::new(1000, 100),
)
.with_gear(Gear::new(8, 1).unwrap())
.with_limits(odrive::Limits { speed: Rpm::new(400.0), current: Amps::new(18.0) });

/// The longest time from a command to a leg to the end of its reply: nearly twice what that takes if
/// the leg thinks for 20 µs, so that one that is silent costs the others little.
pub const REPLY: Micros = Micros::new(200);
