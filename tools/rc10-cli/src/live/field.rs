//! The field from above: where the base is by the simulated world, by its wheels, by its own odometry and by its
//! reference, and what its wheels do; and the angles of the mechanisms that are drawn.

use std::f64::consts::TAU;

use rc10_motor::TargetKind;
use serde_json::{Map, Value, json};

use super::client::Client;
use super::history::History;
use crate::judge::path::laid;
use crate::recording::sample::PathPoint;
use crate::recording::wheels::Wheels;
use crate::robot::description::{Description, PoseSignals};
use crate::run::running::Running;
use crate::world::built::Built;

/// A wheel does not roll further between two looks, m: the robot counts anew.
const ANEW: f64 = 0.5;

/// Signals of a motor: angle, speed, target and its kind.
type MotorSignals = [Option<u16>; 4];

/// The field of a robot that has described itself.
pub struct Field<'k> {
    description: &'k Description,
    /// The robot with its mistakes, if it is simulated.
    built: Option<Built>,
    motors: Vec<MotorSignals>,
    /// Signals of the estimate, of the reference, and of the heading by the IMU.
    poses: [Option<([Option<u16>; 3], bool)>; 2],
    heading: Option<u16>,
    /// Degrees that each wheel's motor, and the one that steers it, had turned at the last look; and at first.
    turned: Vec<[f64; 2]>,
    first: Vec<[f64; 2]>,
    by_wheels: PathPoint,
    /// The robot's own axes: its first estimate, and where it was then.
    axes: Option<[PathPoint; 2]>,
}

impl<'k> Field<'k> {
    /// The field before the first look.
    pub fn new(description: &'k Description, client: &Client) -> Self {
        let find = |folder: &str, label: &str, name: &str| {
            let is_it = |(_, it): &(u16, &super::client::Signal)| {
                it.folder == folder && it.label == label && it.name == name
            };
            client.signals().find(is_it)
        };
        let number = |label: &str, name| find("motors", label, name).map(|(number, _)| number);
        let motor =
            |label| ["total_angle", "speed", "target", "target_kind"].map(|it| number(label, it));
        let pose = |labels: PoseSignals| {
            let own = labels.map(|label| find("signals", label, "value"));
            let in_rad = own[2].is_some_and(|(_, it)| it.unit == "rad");
            (own.map(|it| it.map(|(number, _)| number)), in_rad)
        };
        let Description { estimate, reference, yaw, motors, .. } = description;
        Self {
            description,
            built: None,
            motors: motors.iter().map(|it| motor(it.label)).collect(),
            poses: [estimate, reference].map(|labels| labels.map(pose)),
            heading: yaw.and_then(|label| Some(find("signals", label, "value")?.0)),
            turned: Vec::new(),
            first: Vec::new(),
            by_wheels: PathPoint { x: 0.0, y: 0.0, yaw: 0.0 },
            axes: None,
        }
    }

    /// Knows the robot as it is really built.
    pub fn build(&mut self, world: &dyn Running) {
        self.built = Built::new(world.description()).ok();
    }

    /// Looks at the robot by its newest signals, and at its world.
    pub fn look(&mut self, history: &History, world: Option<&dyn Running>) -> Value {
        let newest = |signal: Option<u16>| {
            let value = history.newest(signal?).map(|(_, value)| f64::from(value));
            value.filter(|value| value.is_finite())
        };
        let mut told = Map::new();
        let pose = world.and_then(|it| it.base()).map(|base| {
            let rc10_sim::Pose { x, y, yaw } = base.pose();
            PathPoint { x, y, yaw }
        });
        let mut tell = |name: &str, pose: Option<PathPoint>| {
            if let Some(PathPoint { x, y, yaw }) =
                pose.filter(|it| (it.x + it.y + it.yaw).is_finite())
            {
                told.insert(name.into(), json!([x, y, yaw]));
            }
        };
        tell("true", pose);
        if let Some(base) = &self.description.base {
            let mut steering = base.steering.iter();
            let mut rims = Vec::new();
            let (mut turned, mut steered) = (Vec::new(), Vec::new());
            let lines = base.wheels.iter().zip(&base.chassis.wheels).map(|(line, wheel)| {
                let gear = wheel.steering.and_then(|it| Some((it.gear, *steering.next()?)));
                (*line, wheel, gear)
            });
            let lines: Vec<_> = lines.collect();
            for (line, _, gear) in &lines {
                let angle = |line: usize| newest(self.motors.get(line).and_then(|it| it[0]));
                turned.extend(
                    angle(*line)
                        .map(|it| [it, gear.and_then(|(_, line)| angle(line)).unwrap_or(0.0)]),
                );
            }
            let is_known = turned.len() == lines.len();
            if is_known && self.turned.len() != turned.len() {
                (self.turned, self.first) = (turned.clone(), turned.clone());
                self.by_wheels = pose.unwrap_or(self.by_wheels);
            }
            if is_known {
                let mut ways = Vec::new();
                for ((now, last), (first, (_, wheel, gear))) in
                    turned.iter().zip(&self.turned).zip(self.first.iter().zip(&lines))
                {
                    ways.push((now[0] - last[0]).to_radians() * wheel.radius);
                    // In the simulator a wheel looks its first way at any angle of the motor.
                    let zero = if pose.is_some() { first[1] } else { 0.0 };
                    steered.push(gear.map_or(0.0, |(gear, _)| (now[1] - zero) / gear));
                }
                if ways.iter().all(|way| way.abs() < ANEW) {
                    let [forward, left, turn] = Wheels::new(&base.chassis, &steered).motion(&ways);
                    let at = &mut self.by_wheels;
                    let (sin, cos) = (at.yaw + turn / 2.0).sin_cos();
                    at.x += forward * cos - left * sin;
                    at.y += forward * sin + left * cos;
                    at.yaw += turn;
                }
                self.turned = turned;
                tell("wheels", Some(self.by_wheels));
            }
            let slips = self.built.as_ref().zip(world).map(|(built, world)| slips(built, world));
            for (at, (line, wheel, _)) in lines.iter().enumerate() {
                let [_, speed, target, kind] = self.motors.get(*line).copied().unwrap_or_default();
                let rim = |rpm: Option<f64>| rpm.map(|rpm| rpm * TAU / 60.0 * wheel.radius);
                let is_speed = newest(kind).is_some_and(|it| {
                    let speeds = [TargetKind::Speed, TargetKind::SpeedMotion];
                    speeds.iter().any(|kind| (it - f64::from(*kind as u8)).abs() < 0.5)
                });
                let slip = slips.as_ref().and_then(|it| it.get(at).copied());
                let angle = steered.get(at).copied().unwrap_or(0.0);
                rims.push(json!([
                    angle,
                    rim(newest(target).filter(|_| is_speed)),
                    rim(newest(speed)),
                    slip
                ]));
            }
            told.insert("rims".into(), rims.into());
        }
        let own = self.poses.map(|signals| {
            let ([x, y, yaw], in_rad) = signals?;
            let yaw = newest(yaw)?;
            Some(PathPoint {
                x: newest(x)?,
                y: newest(y)?,
                yaw: if in_rad { yaw } else { yaw.to_radians() },
            })
        });
        if let (None, Some(first)) = (self.axes, own[0]) {
            self.axes = Some([first, pose.unwrap_or(first)]);
        }
        for (name, pose) in ["odometry", "reference"].into_iter().zip(own) {
            let mut tell =
                |pose: PathPoint| told.insert(name.into(), json!([pose.x, pose.y, pose.yaw]));
            pose.map(|it| tell(self.axes.map_or(it, |[from, to]| laid(&it, &from, &to))));
        }
        let angles = self.description.drawn_motors().filter_map(|line| {
            let (motor, signals) = (self.description.motors.get(line)?, self.motors.get(line)?);
            Some((motor.label.to_owned(), json!(newest(signals[0]))))
        });
        told.insert("angles".into(), angles.collect::<Map<_, _>>().into());
        told.insert("heading".into(), newest(self.heading).map(f64::to_radians).into());
        Value::Object(told)
    }
}

/// How fast each wheel's rim slips over the floor along its way, m/s, as only the simulator knows.
fn slips(built: &Built, world: &dyn Running) -> Vec<f64> {
    let (Some(base), Some(under), Some(chassis)) =
        (world.base(), &world.description().base, &built.chassis)
    else {
        return Vec::new();
    };
    let state =
        |line: usize| Some((built.motors.get(line)?.sign(), world.twins().get(line)?.state()));
    let mut steering = under.steering.iter();
    let steered = chassis.wheels.iter().map(|wheel| {
        let turned = wheel.steering.and_then(|it| Some((it.gear, state(*steering.next()?)?)));
        turned.map_or(0.0, |(gear, (sign, state))| sign * state.load_degrees / gear)
    });
    let wheels = Wheels::new(chassis, &steered.collect::<Vec<_>>());
    let twist = base.twist();
    let rims = under.wheels.iter().zip(&chassis.wheels).enumerate();
    let slip = |(at, (line, wheel)): (usize, (&usize, &rc10_sim::Wheel))| {
        let (sign, state) = state(*line)?;
        let rim = sign * state.load_rpm * TAU / 60.0 * wheel.radius;
        Some(rim - wheels.rim(at, &[twist.x, twist.y, twist.yaw]))
    };
    rims.filter_map(slip).collect()
}
