//! A base on wheels that slides, grips and turns in the plane.

mod chassis;

use std::cell::Cell;
use std::rc::Rc;

pub use self::chassis::{Chassis, Steering, Tread, Wheel};
use crate::device::Unit;
use crate::handles::Esc;
use crate::motor::STEP;

/// Standard gravity, m/s².
pub(crate) const GRAVITY: f64 = 9.806_65;

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
    pub(crate) const fn sign(self) -> f64 {
        match self {
            Self::Normal => 1.0,
            Self::Mirrored => -1.0,
        }
    }
}

/// The motors of a wheel, and how they are mounted.
#[derive(Clone, Copy)]
pub struct WheelMotors<'e> {
    /// The one that turns it.
    pub drive: (&'e Esc, Mounting),
    /// The one that steers it. [`Mounting::Normal`]: its positive direction is that of
    /// [`Steering::gear`].
    pub steering: Option<(&'e Esc, Mounting)>,
}

impl<'e> From<(&'e Esc, Mounting)> for WheelMotors<'e> {
    /// The motors of a wheel that is not steered.
    fn from(drive: (&'e Esc, Mounting)) -> Self {
        Self { drive, steering: None }
    }
}

/// Why motors cannot carry a base or an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WheelError {
    /// One is in another world.
    #[error("a motor is in another world")]
    OtherWorld,
    /// One turns or steers a wheel, or carries a link, already.
    #[error("a motor carries a wheel or a link already")]
    Taken,
    /// They are not as many as the wheels.
    #[error("there are not as many motors as wheels")]
    Count,
    /// A wheel that is steered has no motor for it, or one that is not steered has.
    #[error("a wheel is steered and has no motor for it, or the other way round")]
    Steering,
}

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
    /// The force at which a wheel slides, N.
    slides_at: f64,
    contacts: Vec<Contact>,
    pub(crate) motion: Rc<Cell<Motion>>,
}

/// A unit, and how its motor is mounted.
pub(crate) type Mounted = (usize, Mounting);

/// A wheel on the floor.
struct Contact {
    wheel: Wheel,
    /// The motor of the wheel, and 1 or -1 by its mounting.
    unit: usize,
    sign: f64,
    /// The motor that steers it, and radians of the wheel per degree of that motor's shaft.
    steering: Option<(usize, f64)>,
    /// At the present steering angle: speed of the rim that goes with each component of the twist
    /// without slip; and of a plain wheel the speed across that goes with it.
    along: [f64; 3],
    across: Option<[f64; 3]>,
}

/// How much of a twist's components the point at a wheel's place moves this way.
fn row(wheel: &Wheel, [x, y]: [f64; 2]) -> [f64; 3] {
    [x, y, wheel.x * y - wheel.y * x]
}

/// Speed by a row and a twist.
fn speed(row: &[f64; 3], twist: &Twist) -> f64 {
    row[0] * twist.x + row[1] * twist.y + row[2] * twist.yaw
}

impl Contact {
    /// Turns it as its motor steers it, by this angle, rad.
    fn steer(&mut self, angle: f64) {
        let wheel = &self.wheel;
        let [ahead, left] = wheel.axes(angle);
        (self.along, self.across) = match wheel.tread {
            Tread::Plain => (row(wheel, ahead), Some(row(wheel, left))),
            // The rollers' axis is `ahead + slant · left`: what the floor does along it turns the wheel
            // by its share along `ahead`, which is one.
            Tread::Rollers { slant } => {
                let axis = [ahead[0] + slant * left[0], ahead[1] + slant * left[1]];
                (row(wheel, axis), None)
            }
        };
    }
}

impl Body {
    /// With each wheel's unit and mounting, and those of its steering.
    pub(crate) fn new(
        chassis: Chassis,
        motors: &[(Mounted, Option<Mounted>)],
        units: &mut [Unit],
    ) -> Self {
        let load = chassis.wheel_load();
        let mut contacts = Vec::new();
        // 1/kg: how easily a force moves the rim of the lightest wheel.
        let mut rim = 0.0_f64;
        for (&wheel, &((index, mounting), steering)) in chassis.wheels.iter().zip(motors) {
            let unit = &mut units[index];
            unit.is_taken = true;
            unit.motor.plant.load_inertia += wheel.inertia;
            unit.motor.rolling_friction = chassis.rolling_resistance * load * wheel.radius;
            rim = rim.max(wheel.radius * wheel.radius / unit.motor.contact_inertia());
            let steering = wheel.steering.zip(steering).map(|(gear, (index, mounting))| {
                let Steering { gear, inertia, patch } = gear;
                let unit = &mut units[index];
                unit.is_taken = true;
                unit.motor.plant.load_inertia += inertia / (gear * gear);
                let scrub = 2.0 / 3.0 * chassis.grip * load * patch;
                unit.motor.rolling_friction = scrub / gear.abs();
                (index, mounting.sign() * 1.0_f64.to_radians() / gear)
            });
            let sign = mounting.sign();
            let (along, across) = ([0.0; 3], None);
            let mut contact = Contact { wheel, unit: index, sign, steering, along, across };
            contact.steer(0.0);
            contacts.push(contact);
        }
        // The stiffest contact that an explicit step follows without swinging: the sum of what a
        // force moves at the wheel and at the body, in its most easily moved direction.
        let stiffest = 0.5 / (STEP * (rim + mobility(&chassis, &contacts)));
        Self {
            stiffness: chassis.stiffness.min(stiffest),
            slides_at: chassis.grip * load,
            chassis,
            contacts,
            motion: Rc::default(),
        }
    }

    /// One step of the body; sets what the floor does to the wheels in theirs.
    pub(crate) fn step(&mut self, units: &mut [Unit]) {
        let mut motion = self.motion.get();
        let twist = motion.twist();
        let slides_at = self.slides_at;
        let (mut force_x, mut force_y, mut moment) = (0.0, 0.0, 0.0);
        for contact in &mut self.contacts {
            if let Some((index, radians)) = contact.steering {
                contact.steer(units[index].motor.load_degrees() * radians);
            }
            let motor = &mut units[contact.unit].motor;
            let (radius, sign) = (contact.wheel.radius, contact.sign);
            let rim = sign * motor.load_speed() * radius;
            let mut force = self.stiffness * (rim - speed(&contact.along, &twist));
            // What moves the wheel also says which way its force pushes the body (virtual work).
            if let Some(row) = &contact.across {
                let mut sideways = -self.stiffness * speed(row, &twist);
                let size = force.hypot(sideways);
                if size > slides_at {
                    force *= slides_at / size;
                    sideways *= slides_at / size;
                }
                force_x += row[0] * sideways;
                force_y += row[1] * sideways;
                moment += row[2] * sideways;
            }
            let force = force.max(-slides_at).min(slides_at);
            motor.reaction = -sign * force * radius;
            force_x += contact.along[0] * force;
            force_y += contact.along[1] * force;
            moment += contact.along[2] * force;
        }
        let (sin, cos) = motion.pose.yaw.sin_cos();
        let per_force = STEP / self.chassis.mass;
        motion.velocity.0 += per_force * (force_x * cos - force_y * sin);
        motion.velocity.1 += per_force * (force_x * sin + force_y * cos);
        motion.yaw_rate += STEP / self.chassis.yaw_inertia * moment;
        motion.pose.x += STEP * motion.velocity.0;
        motion.pose.y += STEP * motion.velocity.1;
        motion.pose.yaw += STEP * motion.yaw_rate;
        self.motion.set(motion);
    }
}

/// The most that the forces of all contacts together move the points where they act, 1/kg, at any
/// steering angle of plain wheels: a bound of the largest eigenvalue of `M^-1/2 · Rᵀ·R · M^-1/2` by its rows'
/// sums (Gershgorin), exact where the rows `R` are at right angles, as of mecanum wheels in a rectangle.
fn mobility(chassis: &Chassis, contacts: &[Contact]) -> f64 {
    let masses = [chassis.mass, chassis.mass, chassis.yaw_inertia];
    let rows = || contacts.iter().flat_map(|contact| [Some(contact.along), contact.across]);
    let product = |i: usize, j: usize| -> f64 { rows().flatten().map(|row| row[i] * row[j]).sum() };
    let sum = |i: usize| -> f64 {
        let share = |j: usize| product(i, j).abs() / (masses[i] * masses[j]).sqrt();
        (0..3).map(share).sum()
    };
    (0..3).map(sum).fold(0.0, f64::max)
}
