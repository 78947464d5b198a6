//! Mistakes in building a robot, as users write them: `direction:feeder`, `radius:x2`. The world
//! then differs from the robot's table, and a run shows the effects.

use std::fmt;
use std::str::FromStr;

use anyhow::{Result, anyhow};

/// Help text of the command line's argument.
pub const HELP: &str = "\
The world differs from the robot's table: direction:NAME gear:NAME=19.2 pole-pairs:NAME=14 \
swap:NAME,NAME id:NAME=3 radius:x2 track:x1.1 wheelbase:x0.9 imu:over mass:x1.3, and of all motors whose \
labels begin so inertia:NAME=x1.3 friction:NAME=x0.7 torque:NAME=x0.7 load:NAME=x2; a name is a motor's label or its \
beginning, with - for spaces; repeat for more";

/// A difference between the world and the robot's table.
#[derive(Clone, Debug, PartialEq)]
pub enum Mistake {
    /// `direction:NAME`: the motor turns the other way.
    Direction(String),
    /// `gear:NAME=n`: `n` turns of the rotor per turn of the output shaft.
    Gear(String, f64),
    /// `pole-pairs:NAME=n`: the motor at an ESC that counts electrical turns has `n` pole pairs.
    PolePairs(String, u8),
    /// `swap:NAME,NAME`: two motors of one model have exchanged their buses and identifiers.
    Swap(String, String),
    /// `id:NAME=n`: the device is set to another identifier.
    Id(String, u8),
    /// `radius:xF`: the wheels' radius is `F` times that of the table.
    Radius(f64),
    /// `track:xF`: the wheels are `F` times as far apart sideways.
    Track(f64),
    /// `wheelbase:xF`: the axles are `F` times as far apart.
    Wheelbase(f64),
    /// `imu:over`: the IMU is mounted upside down.
    ImuOver,
    /// `mass:xF`: the robot is `F` times as heavy.
    Mass(f64),
    /// `inertia:NAME=xF` and so on: a quantity of all motors whose labels begin so.
    Shaft(Quantity, String, f64),
}

/// A quantity of a motor and its load that a mistake can multiply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// `inertia`: of rotor and load.
    Inertia,
    /// `friction`: viscous, dry and at rest.
    Friction,
    /// `torque`: per ampere, and the back-EMF with it.
    Torque,
    /// `load`: the torque from outside, such as a weight.
    Load,
}

impl Quantity {
    const ALL: [(&str, Self); 4] = [
        ("inertia", Self::Inertia),
        ("friction", Self::Friction),
        ("torque", Self::Torque),
        ("load", Self::Load),
    ];

    fn word(self) -> &'static str {
        Self::ALL.into_iter().find(|(_, it)| *it == self).map_or("", |(word, _)| word)
    }
}

impl fmt::Display for Mistake {
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
            Self::ImuOver => write!(f, "imu:over"),
            Self::Mass(factor) => write!(f, "mass:x{factor}"),
            Self::Shaft(quantity, name, factor) => {
                write!(f, "{}:{name}=x{factor}", quantity.word())
            }
        }
    }
}

const KINDS: &str = "direction:NAME gear:NAME=n pole-pairs:NAME=n swap:NAME,NAME id:NAME=n \
                     radius:xF track:xF wheelbase:xF imu:over mass:xF inertia:NAME=xF friction:NAME=xF \
                     torque:NAME=xF load:NAME=xF";

impl FromStr for Mistake {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        mistake_of(text).map_err(|why| anyhow!("`{text}`: {why}"))
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
        "imu" if rest == "over" => Ok(Mistake::ImuOver),
        "imu" => Err("write imu:over".into()),
        "mass" => factor().map(Mistake::Mass),
        _ => {
            let known = Quantity::ALL.into_iter().find(|(word, _)| *word == kind);
            let unknown = || format!("there is no such mistake; there are: {KINDS}");
            let (_, quantity) = known.ok_or_else(unknown)?;
            let (name, factor) = pair('=', "lift=x1.3")?;
            let number = factor.strip_prefix('x').unwrap_or_default();
            Ok(Mistake::Shaft(quantity, name, positive(number, "lift=x1.3")?))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            "imu:over",
            "mass:x1.5",
            "inertia:lift=x1.3",
            "friction:wheel=x0.7",
            "torque:gimbal yaw=x0.7",
            "load:lift=x2",
        ] {
            assert_eq!(text.parse::<Mistake>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn invalid_mistakes_are_refused_with_a_reason() {
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
            ("imu:under", "write imu:over"),
            ("radius:2", "radius:x2"),
            ("radius:x-2", "no number"),
            ("radius:xinf", "no number"),
            ("weight:x2", "there are: direction:NAME"),
            ("inertia:lift", "write inertia:lift=x1.3"),
            ("inertia:lift=1.3", "no number"),
            ("mass:1.3", "mass:x2"),
        ] {
            let error = text.parse::<Mistake>().unwrap_err().to_string();
            assert!(error.contains(why) && error.contains(text), "{error}");
        }
    }
}
