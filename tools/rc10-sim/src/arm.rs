//! An arm: links that hang on each other, each on a motor.

use crate::base::{GRAVITY, Mounting};
use crate::device::Unit;

/// A link of an arm in an upright plane, with its mass at one point.
///
/// Its inertia is that of its motor's load: the motions of the links do not move each other, their weights do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmLink {
    /// Mass, kg.
    pub mass: f64,
    /// From its joint to its centre of mass, m.
    pub centre: f64,
    /// From its joint to that of the next link, m; of the last of no use.
    pub length: f64,
    /// Angle at power-on, degrees upwards: of the first link from the horizontal, of others from the link
    /// before, where 0 is stretched.
    pub start: f64,
}

/// A link on its motor, and where its joint and its centre of mass are in front of the first joint, m.
struct Joint {
    unit: usize,
    sign: f64,
    link: ArmLink,
    at: f64,
    centre: f64,
}

pub(crate) struct Arm(Vec<Joint>);

impl Arm {
    pub(crate) fn new(links: impl Iterator<Item = (usize, Mounting, ArmLink)>) -> Self {
        Self(
            links
                .map(|(unit, mounting, link)| Joint {
                    unit,
                    sign: mounting.sign(),
                    link,
                    at: 0.0,
                    centre: 0.0,
                })
                .collect(),
        )
    }

    /// Sets what the weights do to the shafts: the balance of moments about each joint, of all that hangs on it.
    pub(crate) fn step(&mut self, units: &mut [Unit]) {
        let (mut direction, mut at) = (0.0, 0.0);
        for joint in &mut self.0 {
            direction += joint.link.start + joint.sign * units[joint.unit].motor.load_degrees();
            let forward = f64::to_radians(direction).cos();
            (joint.at, joint.centre) = (at, at + joint.link.centre * forward);
            at += joint.link.length * forward;
        }
        let (mut weight, mut moment) = (0.0, 0.0);
        for joint in self.0.iter().rev() {
            weight += joint.link.mass * GRAVITY;
            moment += joint.link.mass * GRAVITY * joint.centre;
            units[joint.unit].motor.reaction = -joint.sign * (moment - weight * joint.at);
        }
    }
}
