//! What the robot has, a line each; and its measures.

use rc10::app::mechanism::{AbsoluteEncoder, Braking, HomingConfig, Reference, SoftLimits};
use rc10::app::{AngleLimits, RpmPerSecondSquared, TwoJointArm};
use rc10::module::remote::{Channel, ChannelOrder};
use rc10::module::servo::{self, WhenDisarmed};
use rc10::prelude::*;

use crate::wall;

rc10::robot! {
    own Own;
    serial wall: uart_10 at 115_200, wall::listen;
    contact bottom: input_1 opens;
    voltage pressure: voltage_1, divider 2.0;
    servo gripper: servo_1, GRIPPER;
    motors {
        WheelLeft: Dji = wheel(Config::new(&M3508, 1)),
        WheelRight: Dji = wheel(Config::new(&M3508, 2).with_direction(Direction::Reversed)),
        Lift: Dji = Entry::new(Bus(1), Config::new(&M3508, 3)).with_safety(Safety::HOLD),
        Shoulder: Dji = joint(1, 0.08),
        Elbow: Dji = joint(2, 0.02),
    }
}

rc10::live! {
    /// What its tasks share, and a PC sees.
    pub struct Own {
        mechanisms {
            lift: "lift";
            arm: "arm";
        }
        contacts {
            bottom: "lift bottom";
        }
        signals {
            wall: "wall", "m";
            height: "lift height", "deg";
            shoulder: "shoulder angle", "deg";
            elbow: "elbow angle", "deg";
            pressure: "pressure", "V";
            gripper: "gripper", "deg";
        }
        parameters {
            shoulder_level: "shoulder level", "deg", 0.0, [-360.0, 360.0];
            elbow_level: "elbow level", "deg", 200.0, [-360.0, 360.0];
        }
    }
}

const fn wheel(config: Config) -> Entry<Config> {
    Entry::new(Bus(1), config).with_jog(Rpm::new(20.0))
}

/// On the joint's shaft, without a gear; `kp` in A per rpm: the lighter the link, the smaller.
const fn joint(id: u8, kp: f32) -> Entry<Config> {
    let cascade = Cascade {
        speed: PidConfig::within(3.0).kp(kp).ki(5.0 * kp),
        angle: PidConfig::within(120.0).kp(1.5),
        ..GM6020_CURRENT.cascade
    };
    let config = Config::new(&GM6020_CURRENT, id).with_cascade(cascade);
    Entry::new(Bus(2), config).with_safety(Safety::HOLD)
}

/// A transmitter whose throttle, channel 3, stays where it is left: it says how high the lift goes.
pub const CHANNELS: ChannelOrder = ChannelOrder {
    right_switch: Channel::new(7),
    left_switch: Channel::new(5),
    more_switches: [None; 2],
    dial: Some(Channel::new(10).reversed()),
    ..ChannelOrder::AETR
};

/// Every stick that springs back is in the middle when it is armed.
pub const ARMING: ArmingConfig = ArmingConfig {
    at_rest: &[Axis::RightX, Axis::RightY, Axis::LeftX, Axis::Dial],
    ..ArmingConfig::DEFAULT
};

/// The base: wheels of 76 mm radius, 400 mm apart.
pub const BASE: DrivenBase<Name, 2> = DrivenBase {
    wheels: [Name::WheelLeft, Name::WheelRight],
    geometry: Base::differential(0.076, 0.2, Rpm::new(400.0)),
    body: Body { mass_kg: 12.0, yaw_inertia_kg_m2: 0.4 },
    torque_constant: Config::new(&M3508, 1).torque_constant(),
    limits: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 10.0 },
    full_stick: Twist::new(1.5, 0.0, 3.0),
};
/// It brakes when a wall is nearer, m.
pub const NEAREST: f32 = 1.0;

/// The lift finds its bottom by the switch, which is pressed 20 degrees above its stop.
pub const HOMING: HomingConfig = HomingConfig {
    reference: Reference::Contact { debounce: Seconds::new(0.01) },
    direction: Direction::Reversed,
    fast: Rpm::new(40.0),
    slow: Rpm::new(6.0),
    back_off: Degrees::new(30.0),
    tolerance: Degrees::new(5.0),
    touch_at: TotalAngle::ZERO,
    travel: Degrees::new(2200.0),
    braking: BRAKING,
    phase_timeout: Seconds::new(10.0),
    timeout: Seconds::new(15.0),
};
const BRAKING: Braking =
    Braking { acceleration: RpmPerSecond::new(500.0), reaction: Seconds::new(0.03) };
/// The range of the lift's shaft above its switch.
pub const HEIGHTS: SoftLimits = SoftLimits {
    lower: TotalAngle::from_degrees(10),
    upper: TotalAngle::from_degrees(1700),
    braking: BRAKING,
    not_homed: Rpm::ZERO,
};
/// Speed and acceleration of the lift's shaft.
pub const LIFT_LIMITS: AngleLimits = AngleLimits {
    velocity: Rpm::new(150.0),
    acceleration: RpmPerSecond::new(400.0),
    jerk: RpmPerSecondSquared::new(5000.0),
};

/// The joints: how far they go. What their encoders say where they are level, or stretched, is a parameter, which a team
/// sets and saves when it mounts them anew. The shoulder rests on a
/// stop 5 degrees below level, where its encoder says 355.
pub const JOINTS: [AbsoluteEncoder; 2] = [
    AbsoluteEncoder {
        level: TotalAngle::ZERO,
        gear: Gear::DIRECT,
        lower: TotalAngle::from_degrees(-5),
        upper: TotalAngle::from_degrees(120),
        tolerance: Degrees::new(3.0),
    },
    AbsoluteEncoder {
        level: TotalAngle::ZERO,
        gear: Gear::DIRECT,
        lower: TotalAngle::from_degrees(-100),
        upper: TotalAngle::from_degrees(100),
        tolerance: Degrees::new(3.0),
    },
];
/// The joints' motion.
pub const JOINT_LIMITS: AngleLimits = AngleLimits {
    velocity: Rpm::new(15.0),
    acceleration: RpmPerSecond::new(100.0),
    jerk: RpmPerSecondSquared::new(2000.0),
};
/// Its links.
pub const ARM: TwoJointArm = TwoJointArm {
    upper_mass_kg: 0.25,
    upper_centre_m: 0.08,
    upper_length_m: 0.15,
    fore_mass_kg: 0.1,
    fore_centre_m: 0.06,
};
/// Of the joints' motors, N m/A.
pub const JOINT_TORQUE: f32 = Config::new(&GM6020_CURRENT, 1).torque_constant();

/// The sensor's voltage with enough air, V.
pub const AIR: f32 = 3.0;

/// Open at 0 degrees, closed at 90.
const GRIPPER: servo::Config = servo::Config {
    ends: [(Degrees::new(0.0), 1000), (Degrees::new(90.0), 2000)],
    when_disarmed: WhenDisarmed::Hold,
};

const _: () = assert!(
    HOMING.validate().is_ok()
        && HEIGHTS.validate().is_ok()
        && LIFT_LIMITS.validate().is_ok()
        && JOINT_LIMITS.validate().is_ok()
        && JOINTS[0].validate().is_ok()
        && JOINTS[1].validate().is_ok()
        && ARM.validate().is_ok()
);
