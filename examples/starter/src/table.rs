//! The motor table: bus, identifier, gains and safe state of each motor; and the robot's measures.

use rc10::prelude::*;

rc10::robot! {
    motors {
        WheelFrontLeft: Dji = wheel(Config::new(&M3508, 1)),
        WheelFrontRight: Dji = wheel(mirrored(2)),
        WheelRearLeft: Dji = wheel(Config::new(&M3508, 3)),
        WheelRearRight: Dji = wheel(mirrored(4)),
        Feeder: Dji = Entry::new(Bus(2), Config::new(&M2006, 1)),
    }
}

/// On blocks, `rc10 live` may turn it: to see which one it is, and which way it turns.
const fn wheel(config: Config) -> Entry<Config> {
    Entry::new(Bus(1), config).with_jog(Rpm::new(20.0))
}

/// Mounted the other way round.
const fn mirrored(id: u8) -> Config {
    Config::new(&M3508, id).with_direction(Direction::Reversed)
}

/// The base: wheels of 76 mm radius, 400 mm by 440 mm apart, in the order of [`Base::mecanum`]. They stay
/// below the 480 rpm that an M3508 reaches unloaded.
pub const BASE: DrivenBase<Name, 4> = DrivenBase {
    wheels: [
        Name::WheelFrontLeft,
        Name::WheelFrontRight,
        Name::WheelRearLeft,
        Name::WheelRearRight,
    ],
    geometry: Base::mecanum(0.076, 0.20, 0.22, Rpm::new(400.0)),
    // With everything on it: an estimate, in kg and kg m².
    body: Body { mass_kg: 20.0, yaw_inertia_kg_m2: 1.2 },
    torque_constant: mirrored(1).torque_constant(),
    // At which its wheels do not slip: m/s² and rad/s².
    limits: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
    // m/s and rad/s.
    full_stick: Twist::new(1.5, 1.5, 4.0),
};

/// Speed of the feeder while it is switched on.
pub const FEEDING: Rpm = Rpm::new(200.0);
