//! A robot as it is really built: its description with its [mistakes](crate::robot::mistake).

use anyhow::{Context, Result, bail, ensure};
use rc10_motor::rc10_app::Direction;
use rc10_sim::lk::Drive;
use rc10_sim::odrive::Axis;
use rc10_sim::vesc::Vesc;
use rc10_sim::{Chassis, Esc, Scale};

use crate::robot::description::{ArmPart, Description};
use crate::robot::mistake::{Mistake, Quantity};
use crate::robot::motor::{Device, Motor, Plant};

const NO_BASE: &str = "this robot has no base that is simulated";

/// Motors and base of a description with its mistakes.
pub struct Built {
    /// The motors, in the order of the description, each with the load of its place.
    pub motors: Vec<Motor>,
    /// The base.
    pub chassis: Option<Chassis>,
    /// The arms.
    pub(crate) arms: Vec<ArmPart>,
    /// Changes to motors, by index into `motors`, made when they are plugged in.
    changes: Vec<(usize, Mistake)>,
}

impl Built {
    /// Builds the robot of a description with its mistakes. Fails if a mistake names no or several
    /// motors, a missing base, or motors to swap of different models.
    pub fn new(description: &Description) -> Result<Self> {
        let mut built = Self {
            motors: description.motors.clone(),
            chassis: description.base.as_ref().map(|base| base.chassis.clone()),
            arms: description.arms.clone(),
            changes: Vec::new(),
        };
        for mistake in &description.mistakes {
            built.apply(mistake, description).with_context(|| format!("--mistake {mistake}"))?;
        }
        Ok(built)
    }

    fn apply(&mut self, mistake: &Mistake, description: &Description) -> Result<()> {
        let find = |name: &str| motor_named(description, name);
        match mistake {
            Mistake::Direction(name) => {
                let direction = &mut self.motors[find(name)?].direction;
                *direction = match direction {
                    Direction::Forward => Direction::Reversed,
                    Direction::Reversed => Direction::Forward,
                };
            }
            Mistake::Gear(name, _) | Mistake::PolePairs(name, _) | Mistake::Id(name, _) => {
                self.changes.push((find(name)?, mistake.clone()));
            }
            Mistake::Swap(first, second) => {
                let [first, second] = [find(first)?, find(second)?];
                ensure!(first != second, "that is one motor");
                let [one, other] = [&self.motors[first], &self.motors[second]];
                let [model, its] = [one.name().model, other.name().model];
                let [a, b] = [one.label, other.label];
                ensure!(
                    model == its,
                    "{a} is a {model}, {b} a {its}: they cannot stand for one another"
                );
                let [one, other] = [one, other].map(|motor| (motor.on, motor.device));
                (self.motors[first].on, self.motors[first].device) = other;
                (self.motors[second].on, self.motors[second].device) = one;
            }
            Mistake::ImuOver => {
                ensure!(
                    description.yaw.is_some(),
                    "the robot says no yaw of an IMU (`Description::yaw`)"
                );
            }
            Mistake::Mass(factor) => {
                let chassis = self.chassis.take().context(NO_BASE)?;
                let mass = chassis.mass * factor;
                self.chassis = Some(chassis.with_mass(mass));
            }
            Mistake::Shaft(Quantity::Load, name, factor) => {
                for at in motors_named(description, name)? {
                    let plant = &mut self.motors[at].plant;
                    plant.load *= factor;
                    plant.nonlinear.gravity_torque *= factor;
                    let links = self.arms.iter_mut().flat_map(|arm| &mut arm.links);
                    links
                        .filter(|(motor, _)| *motor == at)
                        .for_each(|(_, link)| link.mass *= factor);
                }
            }
            Mistake::Shaft(_, name, _) => {
                let all = motors_named(description, name)?.into_iter();
                self.changes.extend(all.map(|at| (at, mistake.clone())));
            }
            Mistake::Radius(factor) | Mistake::Track(factor) | Mistake::Wheelbase(factor) => {
                for wheel in &mut self.chassis.as_mut().context(NO_BASE)?.wheels {
                    *match mistake {
                        Mistake::Radius(_) => &mut wheel.radius,
                        Mistake::Track(_) => &mut wheel.y,
                        _ => &mut wheel.x,
                    } *= factor;
                }
            }
        }
        Ok(())
    }

    /// The identifier that a motor's device has.
    pub(crate) fn id(&self, index: usize) -> u16 {
        let changed = self.changes.iter().rev().find_map(|change| match change {
            (at, Mistake::Id(_, id)) if *at == index => Some(u16::from(*id)),
            _ => None,
        });
        changed.unwrap_or(self.motors[index].name().id)
    }

    /// Whether a motor is built in another way there.
    pub(crate) fn differs(&self, other: &Self, index: usize) -> bool {
        let of = |it: &Self| {
            let changes = it.changes.iter().filter(|(at, _)| *at == index).cloned();
            let Plant { load, nonlinear, .. } = it.motors[index].plant;
            (it.id(index), load, nonlinear, changes.collect::<Vec<_>>())
        };
        of(self) != of(other)
    }

    /// Makes the changes to a motor that was just plugged in; fails if its device cannot have one.
    pub fn finish(&self, index: usize, twin: &Esc) -> Result<()> {
        let motor = &self.motors[index];
        let model = motor.name().model;
        for (_, change) in self.changes.iter().filter(|(at, _)| *at == index) {
            match change {
                Mistake::Gear(_, ratio) => {
                    // The others count at their output shaft, by a gear of their own.
                    let counts_rotor = matches!(motor.device, Device::Dji(_))
                        || twin.with(|_: &mut Vesc| ()).is_some()
                        || twin.with(|_: &mut Axis| ()).is_some()
                        || twin.with(|_: &mut Drive| ()).is_some();
                    ensure!(counts_rotor, "no gear of a {model} stands in a robot's table");
                    twin.set_gear(*ratio);
                }
                Mistake::PolePairs(_, pairs) => twin
                    .with(|vesc: &mut Vesc| vesc.set_pole_pairs(*pairs))
                    .with_context(|| format!("no pole pairs of a {model} stand in the table"))?,
                Mistake::Shaft(quantity, _, factor) => {
                    let mut scale = Scale::default();
                    match quantity {
                        Quantity::Inertia => scale.inertia = *factor,
                        Quantity::Friction => scale.friction = *factor,
                        Quantity::Torque => scale.torque_constant = *factor,
                        Quantity::Load => {}
                    }
                    twin.set_plant(twin.plant().scaled(scale));
                }
                Mistake::Id(_, id) => ensure!(
                    twin.set_id(*id),
                    "a simulated {model} cannot be set to the identifier {id}"
                ),
                // Made before.
                _ => {}
            }
        }
        Ok(())
    }
}

/// The motor with this label, or the only one whose label begins so; `-` stands for a space.
fn motor_named(description: &Description, name: &str) -> Result<usize> {
    let found = motors_named(description, name)?;
    match found.as_slice() {
        [one] => Ok(*one),
        more => bail!("`{name}` may be {}", labels(description, more)),
    }
}

/// The motor with this label, or all whose labels begin so.
fn motors_named(description: &Description, name: &str) -> Result<Vec<usize>> {
    let plain = |text: &str| text.to_lowercase().replace('-', " ");
    let wanted = plain(name);
    let all = || (0..).zip(description.motors.iter().map(|motor| plain(motor.label)));
    if let Some((exact, _)) = all().find(|(_, label)| *label == wanted) {
        return Ok(vec![exact]);
    }
    let begins: Vec<usize> =
        all().filter(|(_, label)| label.starts_with(&wanted)).map(|(at, _)| at).collect();
    if begins.is_empty() {
        let all: Vec<usize> = (0..description.motors.len()).collect();
        bail!("there is no motor `{name}`; there are: {}", labels(description, &all))
    }
    Ok(begins)
}

fn labels(description: &Description, motors: &[usize]) -> String {
    let labels = motors.iter().map(|index| description.motors[*index].label);
    labels.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use rc10_motor::dji;

    use super::*;
    use crate::robot::base::Base;

    fn description(mistake: &str) -> Description {
        let wheel = |label, id| Motor::dji_on(label, 1, &dji::M3508, id);
        Description {
            motors: vec![
                wheel("wheel left", 1),
                Motor { direction: Direction::Reversed, ..wheel("wheel right", 2) },
                Motor::dji_on("arm", 2, &dji::M2006, 1),
            ],
            buses: 2,
            base: Some(Base {
                wheels: vec![0; 4],
                steering: Vec::new(),
                chassis: Chassis::mecanum(0.08, 0.2, 0.25),
            }),
            mistakes: vec![mistake.parse().unwrap()],
            ..Description::default()
        }
    }

    #[test]
    fn only_what_is_named_is_changed() {
        let sound = description("gear:arm=1");
        let built = |mistake: &str| Built::new(&description(mistake)).unwrap();
        let names = |built: &Built| -> Vec<_> {
            built
                .motors
                .iter()
                .map(|motor| (motor.label, motor.name().id, motor.direction))
                .collect()
        };
        use Direction::{Forward, Reversed};
        let plain = [("wheel left", 1, Forward), ("wheel right", 2, Reversed), ("arm", 1, Forward)];
        assert_eq!(names(&built("radius:x2")), plain);
        let turned = built("direction:wheel-R");
        assert_eq!(names(&turned), [plain[0], ("wheel right", 2, Forward), plain[2]]);
        // The plugs change places, the mountings stay.
        let swapped = names(&built("swap:wheel left,wheel right"));
        assert_eq!(swapped, [("wheel left", 2, Forward), ("wheel right", 1, Reversed), plain[2]]);
        let chassis = sound.base.unwrap().chassis;
        for (mistake, other) in [
            ("radius:x2", Chassis::mecanum(0.16, 0.2, 0.25)),
            ("track:x0.5", Chassis::mecanum(0.08, 0.2, 0.125)),
            ("wheelbase:x2", Chassis::mecanum(0.08, 0.4, 0.25)),
            ("direction:arm", chassis),
        ] {
            assert_eq!(built(mistake).chassis, Some(other), "{mistake}");
        }
    }

    #[test]
    fn a_name_that_is_none_is_answered_with_those_there_are() {
        for (mistake, why) in [
            ("direction:leg", "there is no motor `leg`; there are: wheel left, wheel right, arm"),
            ("direction:wheel", "`wheel` may be wheel left, wheel right"),
            ("swap:arm,wheel-left", "arm is a M2006, wheel left a M3508"),
            ("swap:arm,ARM", "that is one motor"),
        ] {
            let error = format!("{:#}", Built::new(&description(mistake)).err().unwrap());
            assert!(error.contains(why) && error.contains(mistake), "{error}");
        }
        let without = Description { base: None, ..description("radius:x2") };
        let error = format!("{:#}", Built::new(&without).err().unwrap());
        assert_eq!(error, "--mistake radius:x2: this robot has no base that is simulated");
    }
}
