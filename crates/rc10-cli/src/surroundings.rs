//! The world around a robot, without the robot: wires, ESCs with their motors and loads, a base.

use anyhow::{Context, Result};
use rc10_motor::dji::Direction;
use rc10_sim::{Base, BusConfig, LineConfig, Mounting, Wheels, World};

use crate::robot::{Description, Twin};

/// The world around a robot.
pub struct Surroundings {
    /// Time, and everything in it.
    pub world: World,
    /// The wires; bus 1 is the first.
    pub wires: Vec<rc10_sim::Bus>,
    /// The RS-485 lines; line 1 is the first.
    pub lines: Vec<rc10_sim::Line>,
    /// The motors' twins, in the order of [`Description::motors`].
    pub motors: Vec<Twin>,
    /// The base on its wheels, if the robot has one.
    pub base: Option<Base>,
}

impl Surroundings {
    /// What the description says, with all chance from `seed`.
    ///
    /// # Errors
    /// If it has a motor that no simulated ESC can be, or one on a bus that it does not have; or
    /// if four wheels of the base are not four motors.
    pub fn new(description: &Description, seed: u64) -> Result<Self> {
        let mut world = World::new(seed);
        let wires: Vec<_> =
            (0..description.buses).map(|_| world.add_bus(BusConfig::default())).collect();
        let lines: Vec<_> =
            (0..description.lines).map(|_| world.add_line(LineConfig::default())).collect();
        let mut motors = Vec::new();
        for motor in &description.motors {
            let twin = motor.plug_in(&wires, &lines);
            motors.push(twin.with_context(|| format!("motor table, {}", motor.label))?);
        }
        let mut base = None;
        if let Some(under) = &description.base {
            let wheel = |line: usize| {
                let motor = description.motors.get(line).zip(motors.get(line));
                let (motor, esc) =
                    motor.with_context(|| format!("base: there is no motor in line {line}"))?;
                let mounting = match motor.direction {
                    Direction::Forward => Mounting::Normal,
                    Direction::Reversed => Mounting::Mirrored,
                };
                let esc = esc.esc().context("base: a wheel's motor must be on a bus")?;
                anyhow::Ok((esc, mounting))
            };
            let [front_left, front_right, rear_left, rear_right] = under.wheels;
            let wheels = Wheels {
                front_left: wheel(front_left)?,
                front_right: wheel(front_right)?,
                rear_left: wheel(rear_left)?,
                rear_right: wheel(rear_right)?,
            };
            base = Some(world.add_base(under.chassis, wheels).context("base")?);
        }
        Ok(Self { world, wires, lines, motors, base })
    }
}

#[cfg(test)]
mod tests {
    use rc10_motor::dji;

    use super::*;
    use crate::robot::{self, Motor, Place};

    #[test]
    fn what_cannot_be_built_is_named() {
        const OTHER: dji::Model = dji::Model { name: "M3508 without gearbox", ..dji::M3508 };
        let complaint = |motor: Motor, wheels: Option<[usize; 4]>| {
            let base = wheels.map(|wheels| robot::Base { wheels, chassis: <_>::default() });
            let description =
                Description { motors: vec![motor; 4], buses: 2, base, ..<_>::default() };
            Surroundings::new(&description, 1).err().map(|error| format!("{error:#}"))
        };
        let arm = Motor::new("arm", 2, &dji::M2006, 1);
        assert_eq!(complaint(arm, None), None);
        for (motor, wheels, words) in [
            (Motor { on: Place::Bus(0), ..arm }, None, "motor table, arm: there is no bus 0"),
            (Motor { on: Place::Bus(3), ..arm }, None, "motor table, arm: there is no bus 3"),
            (
                Motor::new("arm", 2, &OTHER, 1),
                None,
                "motor table, arm: no simulated ESC for a M3508 without gearbox",
            ),
            (arm, Some([0, 1, 2, 4]), "base: there is no motor in line 4"),
        ] {
            assert_eq!(complaint(motor, wheels).as_deref(), Some(words));
        }
        assert!(complaint(Motor::new("arm", 2, &dji::M2006, 9), None).is_some());
        assert!(complaint(arm, Some([0, 1, 2, 2])).is_some());
    }
}
