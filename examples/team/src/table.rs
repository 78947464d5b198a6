//! The motor table: bus, id, gains and safe state of each motor; and the robot's measures.

use rc10::app::{AngleLimits, Gravity, RpmPerSecondSquared};
use rc10::prelude::*;

rc10::robot! {
    own crate::Own;
    imu wit;
    strip LEDS, brightness LED_BRIGHTNESS;
    motors {
        WheelFrontLeft: Dji = wheel(Config::new(&M3508, 1)),
        WheelFrontRight: Dji = wheel(mirrored(2)),
        WheelRearLeft: Dji = wheel(Config::new(&M3508, 3)),
        WheelRearRight: Dji = wheel(mirrored(4)),
        GimbalYaw: Dji = Entry::new(Bus(2), YAW),
        GimbalPitch: Dji = Entry::new(Bus(2), PITCH),
        Feeder: Dji = Entry::new(Bus(2), Config::new(&M2006, 3)),
        LiftFrontLeft: Dji = lift(Config::new(&M3508, 1)),
        LiftFrontRight: Dji = lift(mirrored(2)),
        LiftRearLeft: Dji = lift(Config::new(&M3508, 3)),
        LiftRearRight: Dji = lift(mirrored(4)),
    }
}

/// On blocks, a PC may turn it: to see which one it is, and which way it turns.
const fn wheel(config: Config) -> Entry<Config> {
    let cascade = Cascade { feed_forward: ROLLING, ..LOADED };
    Entry::new(Bus(1), config.with_cascade(cascade)).with_jog(Rpm::new(20.0))
}

/// An M3508's loops with an integral that is firmer than a bare motor's: it also learns the load.
const LOADED: Cascade = Cascade { speed: PidConfig::within(20.0).kp(0.4).ki(4.0), ..M3508.cascade };

/// The current that a wheel itself takes, in A: friction in its gearbox and on the floor; wheel and
/// rotor are 0.0052 kg m², and an M3508 makes 0.3 N m/A. What the robot on it takes is in [`BASE`].
const ROLLING: FeedForward =
    FeedForward { friction: 0.5, per_rpm: 0.001, per_rpm_s: 0.0018, gravity: Gravity::None };

/// Mounted the other way round.
const fn mirrored(id: u8) -> Config {
    Config::new(&M3508, id).with_direction(Direction::Reversed)
}

/// A lift that coasts falls.
const fn lift(config: Config) -> Entry<Config> {
    let cascade = Cascade { feed_forward: LIFTING, ..LOADED };
    Entry::new(Bus(3), config.with_cascade(cascade)).with_safety(Safety::HOLD)
}

/// The current that a shaft of the lift takes, in A: 1 N m of weight and 0.0137 kg m², by an
/// M3508's 0.3 N m/A.
const LIFTING: FeedForward = FeedForward {
    friction: 0.33,
    per_rpm: 0.0009,
    per_rpm_s: 0.0048,
    gravity: Gravity::Lift(3.33),
};

/// 0.0204 kg m² on 0.741 N m/A: loaded, the loops can be firmer than those of a bare motor.
const YAW: Config = Config::new(&GM6020_CURRENT, 1).with_cascade(Cascade {
    speed: PidConfig::within(3.0).kp(0.12).ki(0.6),
    angle: PidConfig::within(250.0).kp(1.5),
    feed_forward: FeedForward {
        friction: 0.054,
        per_rpm: 0.000_14,
        per_rpm_s: 0.0029,
        gravity: Gravity::None,
    },
    ..GM6020_CURRENT.cascade
});

/// The same as shares of 24 V: back-EMF of 0.741 V s/rad, and 1.8 ohms for the current.
const PITCH: Config = Config::new(&GM6020_VOLTAGE, 2).with_cascade(Cascade {
    speed: PidConfig::within(1.0).kp(0.006).ki(0.06),
    angle: PidConfig::within(250.0).kp(1.2),
    feed_forward: FeedForward {
        friction: 0.004,
        per_rpm: 0.003_24,
        per_rpm_s: 0.000_11,
        gravity: Gravity::None,
    },
    ..GM6020_VOLTAGE.cascade
});

/// The lift's motors.
pub const LIFT: [Name; 4] =
    [Name::LiftFrontLeft, Name::LiftFrontRight, Name::LiftRearLeft, Name::LiftRearRight];

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
    // With everything on it.
    body: Body { mass_kg: 20.0, yaw_inertia_kg_m2: 1.2 },
    torque_constant: Config::new(&M3508, 1).torque_constant(),
    // At which its wheels do not slip: m/s² and rad/s².
    limits: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
    // m/s and rad/s.
    full_stick: Twist::new(2.0, 2.0, 6.0),
};

/// LEDs of the strip that shows how the robot is.
pub const LEDS: usize = 8;

/// Brightness, of 255. An LED takes up to 60 mA at full white: the 5 V of a board are soon
/// too weak for that.
pub const LED_BRIGHTNESS: u8 = 60;

/// Speed of the gimbal with the sticks at their ends, degrees per second: yaw and pitch.
pub const GIMBAL_RATES: [f32; 2] = [240.0, 120.0];

/// Limits of the gimbal's motion.
pub const GIMBAL_LIMITS: AngleLimits = AngleLimits {
    velocity: Rpm::new(60.0),
    acceleration: RpmPerSecond::new(400.0),
    jerk: RpmPerSecondSquared::new(10_000.0),
};

/// Limits of the motion of the lift's shafts.
pub const LIFT_LIMITS: AngleLimits = AngleLimits {
    velocity: Rpm::new(160.0),
    acceleration: RpmPerSecond::new(600.0),
    jerk: RpmPerSecondSquared::new(10_000.0),
};

/// Angles of the gimbal when the robot is armed.
pub const GIMBAL_AHEAD: Degrees = Degrees::new(180.0);

/// Speed of the feeder with the stick at its end.
pub const FEEDER: Rpm = Rpm::new(300.0);

/// Speed of the lift's shafts with the stick at its end, degrees per second.
pub const LIFT_RATE: f32 = 800.0;

/// The lift's shafts turn so far from the bottom to the top, degrees.
pub const LIFT_TOP: i32 = 1080;
