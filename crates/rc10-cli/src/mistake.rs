//! Mistakes in building a robot, as a user writes them: `direction:feeder`, `radius:x2`. The world
//! then differs from the robot's table by that, and a run shows how it looks.

use std::fmt;
use std::str::FromStr;

use anyhow::{Context, Result, bail, ensure};
use rc10_motor::rc10_app::Direction;
use rc10_sim::Chassis;
use rc10_sim::lk::Drive;
use rc10_sim::odrive::Axis;
use rc10_sim::vesc::Vesc;

use crate::robot::{Description, Device, Motor, Twin};

/// What a command line says of its argument.
pub const HELP: &str = "\
The world differs from the robot's table: direction:NAME gear:NAME=19.2 pole-pairs:NAME=14 \
swap:NAME,NAME id:NAME=3 radius:x2 track:x1.1 wheelbase:x0.9; a name is a motor's label or its \
beginning, with - for spaces; repeat for more";

/// One thing that is not as the robot's table says.
#[derive(Clone, Debug, PartialEq)]
pub enum Mistake {
    /// `direction:NAME`: the motor looks the other way.
    Direction(String),
    /// `gear:NAME=n`: `n` turns of the rotor per turn of the output shaft.
    Gear(String, f64),
    /// `pole-pairs:NAME=n`: the motor at an ESC that counts electrical turns has `n` pole pairs.
    PolePairs(String, u8),
    /// `swap:NAME,NAME`: each of two motors of one model is where the table says that the other is,
    /// bus and identifier.
    Swap(String, String),
    /// `id:NAME=n`: the device is set to another identifier.
    Id(String, u8),
    /// `radius:xF`: the wheels' radius is `F` times that of the table.
    Radius(f64),
    /// `track:xF`: the wheels are `F` times as far apart sideways.
    Track(f64),
    /// `wheelbase:xF`: the axles are `F` times as far apart.
    Wheelbase(f64),
}

impl fmt::Display for Mistake {
    /// As a user writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Direction(name) => write!(f, "direction:{name}"),
            Self::Gear(name, ratio) => write!(f, "gear:{name}={ratio}"),
            Self::PolePairs(name, pairs) => write!(f, "pole-pairs:{name}={pairs}"),
            Self::Swap(first, second) => write!(f, "swap:{first},{second}"),
            Self::Id(name, id) => write!(f, "id:{name}={id}"),
            Self::Radius(factor) => write!(f, "radius:x{factor}"),
            Self::Track(factor) => write!(f, "track:x{factor}"),
            Self::Wheelbase(factor) => write!(f, "wheelbase:x{factor}"),
        }
    }
}

/// Why a text is no mistake.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoMistake(String);

impl fmt::Display for NoMistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for NoMistake {}

const KINDS: &str = "direction:NAME gear:NAME=n pole-pairs:NAME=n swap:NAME,NAME id:NAME=n \
                     radius:xF track:xF wheelbase:xF";

impl FromStr for Mistake {
    type Err = NoMistake;

    fn from_str(text: &str) -> Result<Self, NoMistake> {
        mistake_of(text).map_err(|why| NoMistake(format!("`{text}`: {why}")))
    }
}

fn mistake_of(text: &str) -> Result<Mistake, String> {
    let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
    let name = |name: &str| match name.trim() {
        "" => Err(format!("{kind} needs the label of a motor: {kind}:feeder")),
        name => Ok(name.to_owned()),
    };
    let pair = |sign: char, example: &str| {
        let (first, second) =
            rest.split_once(sign).ok_or_else(|| format!("write {kind}:{example}"))?;
        Ok::<_, String>((name(first)?, second.trim()))
    };
    let positive = |number: &str, example: &str| match number.parse::<f64>() {
        Ok(value) if (1e-3..=1e3).contains(&value) => Ok(value),
        _ => Err(format!("`{number}` is no number from 0.001 to 1000: {kind}:{example}")),
    };
    let factor = || match rest.strip_prefix('x') {
        Some(number) => positive(number, "x2"),
        None => Err(format!("write how many times as large: {kind}:x2")),
    };
    let whole = |number: &str, example: &str| {
        let wrong = || format!("`{number}` is no whole number from 1 to 254: {kind}:{example}");
        number.parse().ok().filter(|number| (1..=254).contains(number)).ok_or_else(wrong)
    };
    match kind {
        "direction" => name(rest).map(Mistake::Direction),
        "gear" => {
            let (name, ratio) = pair('=', "feeder=36")?;
            Ok(Mistake::Gear(name, positive(ratio, "feeder=36")?))
        }
        "pole-pairs" => {
            let (name, pairs) = pair('=', "wheel=14")?;
            Ok(Mistake::PolePairs(name, whole(pairs, "wheel=14")?))
        }
        "swap" => {
            let (first, second) = pair(',', "lift-front-left,lift-rear-left")?;
            Ok(Mistake::Swap(first, name(second)?))
        }
        "id" => {
            let (name, id) = pair('=', "feeder=3")?;
            Ok(Mistake::Id(name, whole(id, "feeder=3")?))
        }
        "radius" => factor().map(Mistake::Radius),
        "track" => factor().map(Mistake::Track),
        "wheelbase" => factor().map(Mistake::Wheelbase),
        _ => Err(format!("there is no such mistake; there are: {KINDS}")),
    }
}

/// The robot as it is really built: the description's motors and base, but for the mistakes.
pub struct Built {
    /// The motors, in the order of the description: each with what its place has.
    pub motors: Vec<Motor>,
    /// The base.
    pub chassis: Option<Chassis>,
    /// Changes to motors, by their places in `motors`, made when they are plugged in.
    changes: Vec<(usize, Change)>,
}

/// A change to a simulated motor.
enum Change {
    Gear(f64),
    PolePairs(u8),
    Id(u8),
}

impl Built {
    /// What a description says, but for its mistakes.
    ///
    /// # Errors
    /// If a mistake names no motor of it, or more than one; or a base that it does not have; or the
    /// motors to swap are not of one model.
    pub fn new(description: &Description) -> Result<Self> {
        let mut built = Self {
            motors: description.motors.clone(),
            chassis: description.base.map(|base| base.chassis),
            changes: Vec::new(),
        };
        for mistake in &description.mistakes {
            built.apply(mistake, description).with_context(|| format!("--mistake {mistake}"))?;
        }
        Ok(built)
    }

    fn apply(&mut self, mistake: &Mistake, description: &Description) -> Result<()> {
        let find = |name: &str| motor_named(description, name);
        let mut change = |name: &str, change: Change| -> Result<()> {
            self.changes.push((find(name)?, change));
            Ok(())
        };
        match mistake {
            Mistake::Direction(name) => {
                let direction = &mut self.motors[find(name)?].direction;
                *direction = match direction {
                    Direction::Forward => Direction::Reversed,
                    Direction::Reversed => Direction::Forward,
                };
            }
            Mistake::Gear(name, ratio) => change(name, Change::Gear(*ratio))?,
            Mistake::PolePairs(name, pairs) => change(name, Change::PolePairs(*pairs))?,
            Mistake::Id(name, id) => change(name, Change::Id(*id))?,
            Mistake::Swap(first, second) => {
                let [first, second] = [find(first)?, find(second)?];
                ensure!(first != second, "that is one motor");
                let [one, other] = [self.motors[first], self.motors[second]];
                let [model, its] = [one.name().model, other.name().model];
                ensure!(
                    model == its,
                    "{} is a {model}, {} a {its}: they cannot stand for one another",
                    one.label,
                    other.label
                );
                (self.motors[first].on, self.motors[first].device) = (other.on, other.device);
                (self.motors[second].on, self.motors[second].device) = (one.on, one.device);
            }
            Mistake::Radius(factor) | Mistake::Track(factor) | Mistake::Wheelbase(factor) => {
                let chassis =
                    self.chassis.as_mut().context("this robot has no base that is simulated")?;
                *match mistake {
                    Mistake::Radius(_) => &mut chassis.wheel_radius,
                    Mistake::Track(_) => &mut chassis.half_width,
                    _ => &mut chassis.half_length,
                } *= factor;
            }
        }
        Ok(())
    }

    /// Makes the changes to a motor that has just been plugged in.
    ///
    /// # Errors
    /// If its device has no such number.
    pub fn finish(&self, index: usize, twin: &Twin) -> Result<()> {
        let motor = &self.motors[index];
        let model = motor.name().model;
        for (_, change) in self.changes.iter().filter(|(at, _)| *at == index) {
            match (change, twin) {
                (Change::Gear(ratio), Twin::Esc(esc)) => {
                    // The others count at their output shaft, by a gear of their own.
                    let counts_rotor = matches!(motor.device, Device::Dji { .. })
                        || esc.with(|_: &mut Vesc| ()).is_some()
                        || esc.with(|_: &mut Axis| ()).is_some()
                        || esc.with(|_: &mut Drive| ()).is_some();
                    ensure!(counts_rotor, "no gear of a {model} stands in a robot's table");
                    esc.set_gear(*ratio);
                }
                (Change::Gear(_), Twin::Line(_)) => {
                    bail!("no gear of a {model} stands in a robot's table")
                }
                (Change::PolePairs(pairs), Twin::Esc(esc)) => esc
                    .with(|vesc: &mut Vesc| vesc.set_pole_pairs(*pairs))
                    .with_context(|| format!("no pole pairs of a {model} stand in the table"))?,
                (Change::PolePairs(_), Twin::Line(_)) => {
                    bail!("no pole pairs of a {model} stand in a robot's table")
                }
                (Change::Id(id), twin) => {
                    let can_be = match twin {
                        Twin::Esc(esc) => esc.set_id(*id),
                        Twin::Line(motor) => motor.set_id(*id),
                    };
                    ensure!(can_be, "a simulated {model} cannot be set to the identifier {id}");
                }
            }
        }
        Ok(())
    }
}

/// The motor with this label, or the only one whose label begins so; `-` stands for a space.
fn motor_named(description: &Description, name: &str) -> Result<usize> {
    let plain = |text: &str| text.to_lowercase().replace('-', " ");
    let wanted = plain(name);
    let labels = || description.motors.iter().map(|motor| motor.label);
    if let Some(exact) = labels().position(|label| plain(label) == wanted) {
        return Ok(exact);
    }
    let begins: Vec<usize> = (0..)
        .zip(labels())
        .filter(|(_, label)| plain(label).starts_with(&wanted))
        .map(|it| it.0)
        .collect();
    let list = |indices: &[usize]| {
        let labels = indices.iter().map(|index| description.motors[*index].label);
        labels.collect::<Vec<_>>().join(", ")
    };
    match begins.as_slice() {
        [one] => Ok(*one),
        [] => {
            let all: Vec<usize> = (0..description.motors.len()).collect();
            bail!("there is no motor `{name}`; there are: {}", list(&all))
        }
        more => bail!("`{name}` may be {}", list(more)),
    }
}

#[cfg(test)]
mod tests {
    use rc10_motor::dji;

    use super::*;
    use crate::robot::Base;

    #[test]
    fn mistakes_are_shown_as_they_are_written() {
        for text in [
            "direction:wheel-front-left",
            "gear:feeder=19.2",
            "pole-pairs:wheel=14",
            "swap:left,right",
            "id:feeder=3",
            "radius:x2",
            "track:x1.1",
            "wheelbase:x0.5",
        ] {
            assert_eq!(text.parse::<Mistake>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn what_is_no_mistake_is_told_why() {
        for (text, why) in [
            ("direction", "needs the label of a motor"),
            ("direction:", "needs the label of a motor"),
            ("gear:feeder", "write gear:feeder=36"),
            ("gear:feeder=0", "no number from 0.001 to 1000"),
            ("gear:feeder=NaN", "no number"),
            ("gear:=3", "needs the label"),
            ("pole-pairs:wheel=1.5", "no whole number"),
            ("id:feeder=0", "no whole number from 1 to 254"),
            ("id:feeder=300", "no whole number"),
            ("swap:left", "write swap:"),
            ("swap:left,", "needs the label"),
            ("radius:2", "radius:x2"),
            ("radius:x-2", "no number"),
            ("radius:xinf", "no number"),
            ("weight:x2", "there are: direction:NAME"),
        ] {
            let error = text.parse::<Mistake>().unwrap_err().to_string();
            assert!(error.contains(why) && error.contains(text), "{error}");
        }
    }

    fn description(mistake: &str) -> Description {
        let wheel = |label, id| Motor::new(label, 1, &dji::M3508, id);
        Description {
            motors: vec![
                wheel("wheel left", 1),
                Motor { direction: Direction::Reversed, ..wheel("wheel right", 2) },
                Motor::new("arm", 2, &dji::M2006, 1),
            ],
            buses: 2,
            base: Some(Base { wheels: [0; 4], chassis: Chassis::default() }),
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
            ("radius:x2", Chassis { wheel_radius: 2.0 * chassis.wheel_radius, ..chassis }),
            ("track:x0.5", Chassis { half_width: 0.5 * chassis.half_width, ..chassis }),
            ("wheelbase:x3", Chassis { half_length: 3.0 * chassis.half_length, ..chassis }),
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
