//! A base on four mecanum wheels that slides, grips and turns in the plane.

use std::cell::Cell;
use std::fmt;
use std::rc::Rc;

use crate::device::Unit;
use crate::motor::STEP;

/// Standard gravity, m/s².
pub(crate) const GRAVITY: f64 = 9.806_65;

/// The body and its wheels, in SI units. x is forward, y is left, yaw is counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chassis {
    /// kg, all included.
    pub mass: f64,
    /// kg·m² about the vertical axis through the middle.
    pub yaw_inertia: f64,
    /// m.
    pub wheel_radius: f64,
    /// One wheel about its axle, kg·m².
    pub wheel_inertia: f64,
    /// From the middle to an axle, forward, m.
    pub half_length: f64,
    /// From the middle to a wheel, sideways, m.
    pub half_width: f64,
    /// Coefficient of friction between rollers and floor.
    pub grip: f64,
    /// Force per slip speed of a wheel that does not slide, N·s/m. Reduced where the physics step
    /// is too long for it.
    pub stiffness: f64,
    /// Rolling resistance as a fraction of the wheel's load.
    pub rolling_resistance: f64,
}

impl Default for Chassis {
    /// A Robocon base of 20 kg on 152 mm wheels: our estimate.
    fn default() -> Self {
        Self {
            mass: 20.0,
            yaw_inertia: 1.2,
            wheel_radius: 0.076,
            wheel_inertia: 1.5e-3,
            half_length: 0.20,
            half_width: 0.22,
            grip: 0.6,
            stiffness: 1000.0,
            rolling_resistance: 0.015,
        }
    }
}

/// Direction of a wheel when its motor turns in its positive direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mounting {
    /// Positive rolls the base forward.
    #[default]
    Normal,
    /// Positive rolls the base backward: the motor looks the other way.
    Mirrored,
}

impl Mounting {
    const fn sign(self) -> f64 {
        match self {
            Self::Normal => 1.0,
            Self::Mirrored => -1.0,
        }
    }
}

/// One value for each wheel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wheels<T> {
    /// Front left.
    pub front_left: T,
    /// Front right.
    pub front_right: T,
    /// Rear left.
    pub rear_left: T,
    /// Rear right.
    pub rear_right: T,
}

impl<T> Wheels<T> {
    pub(crate) fn into_array(self) -> [T; 4] {
        [self.front_left, self.front_right, self.rear_left, self.rear_right]
    }
}

/// Why a motor cannot carry a wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WheelError {
    /// It is in another world.
    OtherWorld,
    /// It carries a wheel already.
    Taken,
}

impl fmt::Display for WheelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OtherWorld => "a wheel's motor is in another world",
            Self::Taken => "a wheel's motor carries a wheel already",
        })
    }
}

impl std::error::Error for WheelError {}

/// Position and heading of a base, from where it started.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// m, forward at the start.
    pub x: f64,
    /// m, left at the start.
    pub y: f64,
    /// rad, counter-clockwise, over many turns.
    pub yaw: f64,
}

/// Velocity of a base, in its own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// m/s forward.
    pub x: f64,
    /// m/s to the left.
    pub y: f64,
    /// rad/s counter-clockwise.
    pub yaw: f64,
}

/// The pose of a base, and its motion.
#[derive(Clone, Copy, Default)]
pub(crate) struct Motion {
    pub(crate) pose: Pose,
    /// In the world's frame.
    velocity: (f64, f64),
    yaw_rate: f64,
}

impl Motion {
    pub(crate) fn twist(&self) -> Twist {
        let (sin, cos) = self.pose.yaw.sin_cos();
        let (x, y) = self.velocity;
        Twist { x: x * cos + y * sin, y: y * cos - x * sin, yaw: self.yaw_rate }
    }
}

pub(crate) struct Body {
    chassis: Chassis,
    stiffness: f64,
    wheels: [(usize, Mounting); 4],
    pub(crate) motion: Rc<Cell<Motion>>,
}

impl Body {
    pub(crate) fn new(
        chassis: Chassis,
        wheels: [(usize, Mounting); 4],
        units: &mut [Unit],
    ) -> Self {
        let wheel_load = chassis.mass * GRAVITY / 4.0;
        let mut lightest = f64::INFINITY;
        for (index, _) in wheels {
            let unit = &mut units[index];
            unit.is_wheel = true;
            unit.motor.add_load_inertia(chassis.wheel_inertia);
            unit.motor.rolling_friction =
                chassis.rolling_resistance * wheel_load * chassis.wheel_radius;
            lightest = lightest.min(unit.motor.plant().inertia());
        }
        // The stiffest contact that an explicit step follows without swinging: the sum of what a
        // force moves at the wheel and at the body, in its most easily moved direction.
        let lever = chassis.half_length + chassis.half_width;
        let body = (4.0 / chassis.mass).max(4.0 * lever * lever / chassis.yaw_inertia);
        let wheel = chassis.wheel_radius * chassis.wheel_radius / lightest;
        Self {
            chassis,
            stiffness: chassis.stiffness.min(0.5 / (STEP * (wheel + body))),
            wheels,
            motion: Rc::default(),
        }
    }

    /// One step of the body; sets what the floor does to the wheels in theirs.
    pub(crate) fn step(&mut self, units: &mut [Unit]) {
        let chassis = &self.chassis;
        let mut motion = self.motion.get();
        let twist = motion.twist();
        let radius = chassis.wheel_radius;
        let lever = chassis.half_length + chassis.half_width;
        let slides_at = chassis.grip * chassis.mass * GRAVITY / 4.0;
        // Rim speed of a wheel that does not slip = forward + left · y + turn · yaw. What moves the
        // wheel also says which way its force pushes the body (virtual work).
        let left = [-1.0, 1.0, 1.0, -1.0];
        let turn = [-lever, lever, -lever, lever];
        let (mut force_x, mut force_y, mut moment) = (0.0, 0.0, 0.0);
        for (wheel, (index, mounting)) in self.wheels.into_iter().enumerate() {
            let motor = &mut units[index].motor;
            let rim = mounting.sign() * motor.speed * radius;
            let ground = twist.x + left[wheel] * twist.y + turn[wheel] * twist.yaw;
            let force = self.stiffness * (rim - ground);
            let force = force.max(-slides_at).min(slides_at);
            motor.reaction = -mounting.sign() * force * radius;
            force_x += force;
            force_y += left[wheel] * force;
            moment += turn[wheel] * force;
        }
        let (sin, cos) = motion.pose.yaw.sin_cos();
        let per_force = STEP / chassis.mass;
        motion.velocity.0 += per_force * (force_x * cos - force_y * sin);
        motion.velocity.1 += per_force * (force_x * sin + force_y * cos);
        motion.yaw_rate += STEP / chassis.yaw_inertia * moment;
        motion.pose.x += STEP * motion.velocity.0;
        motion.pose.y += STEP * motion.velocity.1;
        motion.pose.yaw += STEP * motion.yaw_rate;
        self.motion.set(motion);
    }
}
