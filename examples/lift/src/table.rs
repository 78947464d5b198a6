//! The motor table: bus, id, gains and safe state of each motor; and the robot's measures.

use rc10::app::mechanism::{
    AxesConfig, AxesHomingConfig, Braking, FeederConfig, HomingConfig, JamConfig, Reference,
    SoftLimits, Stall,
};
use rc10::app::{AngleLimits, CountsPerTurn, Gravity, RpmPerSecondSquared};
use rc10::prelude::*;

rc10::robot! {
    own crate::Own;
    contact index: input_1;
    contact bottom: input_2 opens;
    motors {
        LiftLeft: Dji = lift(Config::new(&M3508, 1)),
        LiftRight: Dji = lift(Config::new(&M3508, 2).with_direction(Direction::Reversed)),
        Feeder: Dji = Entry::new(Bus(2), Config::new(&M2006, 1).with_feed_forward(FEEDING)),
        Hoist: Dji = Entry::new(Bus(2), HOIST).with_safety(Safety::HOLD),
    }
}

/// A lift that coasts falls. Both motors count upwards: the right one looks the other way.
const fn lift(config: Config) -> Entry<Config> {
    Entry::new(Bus(1), config.with_feed_forward(LIFTING)).with_safety(Safety::HOLD)
}

/// The lift's motors.
pub const LIFT: [Name; 2] = [Name::LiftLeft, Name::LiftRight];

/// Weight on each shaft of the lift, N m.
pub const WEIGHT: f32 = 1.0;
/// Inertia of each shaft of the lift, with its rotor, kg m².
pub const INERTIA: f32 = 0.0137;

/// 1 rpm in rad/s.
const RADIANS: f32 = core::f32::consts::TAU / 60.0;
/// Torque constant of a motor of the lift, N m/A.
const TORQUE: f32 = Config::new(&M3508, 1).torque_constant();

/// What a shaft of the lift takes, in A: friction of the gearbox, inertia and weight.
const LIFTING: FeedForward = FeedForward {
    friction: 0.1 / TORQUE,
    per_rpm: 0.0026 * RADIANS / TORQUE,
    per_rpm_s: INERTIA * RADIANS / TORQUE,
    gravity: Gravity::Lift(WEIGHT / TORQUE),
};

/// Feed-forward of the feeder, in A: friction of the gearbox.
const FEEDING: FeedForward = FeedForward { friction: 0.28, ..FeedForward::NONE };

/// The hoist's motor looks down: reversed, it counts upwards.
const HOIST: Config = Config::new(&M2006, 2)
    .with_direction(Direction::Reversed)
    .with_feed_forward(FeedForward { gravity: Gravity::Lift(HOISTED / HOIST_TORQUE), ..FEEDING });
/// Weight on the shaft of the hoist, N m.
pub const HOISTED: f32 = 0.4;
/// Torque constant of its motor, N m/A.
const HOIST_TORQUE: f32 = Config::new(&M2006, 2).torque_constant();

/// The bottom is found by running onto it, with both motors.
pub const HOMING: AxesHomingConfig = AxesHomingConfig {
    homing: HomingConfig {
        reference: Reference::Stop(Stall {
            // A. Lowering takes an upward current; a downward one comes only at the stop.
            effort: 2.0,
            standstill: Rpm::new(2.0),
            time: Seconds::new(0.06),
        }),
        direction: Direction::Reversed,
        fast: Rpm::new(30.0),
        slow: Rpm::new(6.0),
        back_off: Degrees::new(20.0),
        tolerance: Degrees::new(3.0),
        touch_at: TotalAngle::ZERO,
        travel: Degrees::new(1300.0),
        braking: BRAKING,
        phase_timeout: Seconds::new(10.0),
        timeout: Seconds::new(15.0),
    },
    spread: Degrees::new(30.0),
};

/// Half of what the motors can, and within two periods of the task.
const BRAKING: Braking =
    Braking { acceleration: RpmPerSecond::new(500.0), reaction: Seconds::new(0.012) };

/// The range of the shafts above the bottom.
pub const RANGE: SoftLimits = SoftLimits {
    lower: TotalAngle::ZERO,
    upper: TotalAngle::from_degrees(1080),
    braking: BRAKING,
    not_homed: Rpm::ZERO,
};

/// Three heights: above the bottom, in the middle, below the top.
pub const HEIGHTS: [TotalAngle; 3] =
    [TotalAngle::from_degrees(20), TotalAngle::from_degrees(540), TotalAngle::from_degrees(1060)];

/// How the lift moves: 80 rpm, reached in 0.3 s. The motors' loops reach 1000 rpm/s.
pub const LIFT_LIMITS: AngleLimits = AngleLimits {
    velocity: Rpm::new(80.0),
    acceleration: RpmPerSecond::new(400.0),
    jerk: RpmPerSecondSquared::new(5000.0),
};

/// How the two motors are kept together.
pub const TOGETHER: AxesConfig = AxesConfig {
    wait: Degrees::new(5.0),
    stop: Degrees::new(15.0),
    patience: Seconds::new(0.5),
    coupling: 0.5,
    correction: Degrees::new(5.0),
};

/// The index is found backwards, so that no piece is fed on the way; by less than a pocket it goes forward
/// again. A pocket stands where the marker begins.
pub const INDEXING: HomingConfig = HomingConfig {
    reference: Reference::Contact { debounce: Seconds::new(0.01) },
    direction: Direction::Reversed,
    fast: Rpm::new(20.0),
    slow: Rpm::new(6.0),
    back_off: Degrees::new(10.0),
    // How much later it is seen at the fast speed.
    tolerance: Degrees::new(3.0),
    touch_at: TotalAngle::ZERO,
    // A turn, the marker, and the way to a stand.
    travel: Degrees::new(400.0),
    braking: BRAKING,
    phase_timeout: Seconds::new(4.0),
    timeout: Seconds::new(8.0),
};

/// It backs off no further than this, or homing has failed: more than the marker, backing off and coming to a stand
/// take, and with what it then coasts less than a pocket.
pub const INDEXING_FORWARD: TotalAngle = TotalAngle::from_degrees(25);

/// The hoist finds its bottom by a switch, 20 degrees above its stop: enough to brake from the fast speed.
pub const HOIST_HOMING: HomingConfig = HomingConfig {
    reference: Reference::Contact { debounce: Seconds::new(0.01) },
    direction: Direction::Reversed,
    fast: Rpm::new(40.0),
    slow: Rpm::new(6.0),
    back_off: Degrees::new(30.0),
    // How much later it is seen at the fast speed.
    tolerance: Degrees::new(5.0),
    touch_at: TotalAngle::ZERO,
    travel: Degrees::new(2200.0),
    braking: BRAKING,
    phase_timeout: Seconds::new(10.0),
    timeout: Seconds::new(15.0),
};

/// It backs off no higher than this above where it began, or homing has failed: more than the switch's way, backing
/// off and coming to a stand take.
pub const HOIST_RISE: TotalAngle = TotalAngle::from_degrees(80);

/// The range of the hoist's shaft above its switch.
pub const HOIST_RANGE: SoftLimits = SoftLimits {
    lower: TotalAngle::from_degrees(5),
    upper: TotalAngle::from_degrees(1700),
    braking: BRAKING,
    not_homed: Rpm::ZERO,
};

/// Speed of the hoist with the dial at its end.
pub const HOIST_SPEED: Rpm = Rpm::new(100.0);

/// A wheel of eight pockets, four pieces a second.
pub const FEEDER: FeederConfig = FeederConfig {
    pieces: CountsPerTurn::new(8, 1),
    direction: Direction::Forward,
    pieces_per_s: 4.0,
    acceleration: RpmPerSecond::new(500.0),
    tolerance: Degrees::new(4.0),
    jam: JamConfig {
        stall: Stall { effort: 3.0, standstill: Rpm::new(3.0), time: Seconds::new(0.2) },
        following_error: Degrees::new(4.0),
        reverse: Degrees::new(20.0),
        reverse_speed: Rpm::new(30.0),
        reverse_time: Seconds::new(0.5),
        tries: 3,
    },
};

const _: () = assert!(
    HOMING.validate().is_ok()
        && INDEXING.validate().is_ok()
        && HOIST_HOMING.validate().is_ok()
        && HOIST_RANGE.validate().is_ok()
        && RANGE.validate().is_ok()
        && LIFT_LIMITS.validate().is_ok()
        && TOGETHER.validate().is_ok()
);
