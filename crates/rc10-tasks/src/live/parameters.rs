//! The parameters that every robot has: gains and the limit of each motor whose loops run here.

use embassy_futures::join::join4;
use heapless::Vec;
use rc10_app::{Amps, ConfigError, NewtonMetres};
use rc10_link::{Change as One, Tell, Topic};
use rc10_motor::{Request, RequestError, Response, TargetKind, Tuning};

use super::RobotView;
use super::own::{count, nth};
use super::signals::short;

/// Changes that are carried out together.
pub(super) type Change = Vec<One, { rc10_link::CHANGES }>;

/// Why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Refusal {
    pub parameter: Option<u16>,
    pub why: &'static str,
    pub detail: &'static str,
}

impl Refusal {
    pub const ANOTHER: Self = Self::because(
        None,
        "another robot was meant: its motors or values are not those of this one",
    );
    pub const UNKNOWN: Self = Self::because(None, "this robot does not know what is asked");
    pub const BUSY: Self = Self::because(None, "too many requests at once");
    pub const NOWHERE: Self = Self::because(None, "this robot keeps no parameters");
    pub const NO_MOTOR: Self = Self::because(None, "there is no motor with this number");

    pub const fn because(parameter: Option<u16>, why: &'static str) -> Self {
        Self { parameter, why, detail: "" }
    }

    /// Without numbers: formatting them takes 15 KiB of flash.
    pub const fn of(parameter: Option<u16>, error: RequestError) -> Self {
        let (why, detail) = match error {
            RequestError::Unsupported => ("this motor cannot do that", ""),
            RequestError::Config(ConfigError { field, must_be, .. }) => (field, must_be),
            RequestError::NoFeedback => ("the motor has not been heard of yet", ""),
            RequestError::Busy => ("the request before has not been carried out yet", ""),
            RequestError::NoSuchMotor => ("its bus does not run", ""),
            RequestError::NotWhileArmed => ("only while the robot is disarmed", ""),
            RequestError::WhileDriven => ("only while the motor is not driven", ""),
            RequestError::TooFast => ("it turned twice as fast as asked for", ""),
            RequestError::Timeout => ("the device did not answer in time", ""),
            _ => ("the device refused", ""),
        };
        Self { parameter, why, detail }
    }
}

/// A parameter of a motor.
struct Field {
    name: &'static str,
    get: fn(&mut Tuning) -> &mut f32,
    part: Part,
    /// Its units where the effort is a current, a torque, and a share of the voltage.
    units: [&'static str; 3],
}

/// The part of a motor that a request changes.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Speed,
    Angle,
    Limit,
}

const fn speed(
    name: &'static str,
    units: [&'static str; 3],
    get: fn(&mut Tuning) -> &mut f32,
) -> Field {
    Field { name, get, part: Part::Speed, units }
}

const fn angle(name: &'static str, unit: &'static str, get: fn(&mut Tuning) -> &mut f32) -> Field {
    Field { name, get, part: Part::Angle, units: [unit; 3] }
}

const MOTOR: [Field; 7] = [
    speed("speed_kp", ["A/rpm", "N m/rpm", "1/rpm"], |it| &mut it.speed.kp),
    speed("speed_ki", ["A/rpm/s", "N m/rpm/s", "1/rpm/s"], |it| &mut it.speed.ki),
    speed("speed_kd", ["A s/rpm", "N m s/rpm", "s/rpm"], |it| &mut it.speed.kd),
    angle("angle_kp", "rpm/deg", |it| &mut it.angle.kp),
    angle("angle_ki", "rpm/deg/s", |it| &mut it.angle.ki),
    angle("angle_kd", "rpm s/deg", |it| &mut it.angle.kd),
    Field {
        name: "limit",
        get: |it| &mut it.limit,
        part: Part::Limit,
        units: ["A", "N m", "of full voltage"],
    },
];
const EACH: u16 = short(MOTOR.len());

/// What a gain that is not declared is measured by, beside the proportional gain of its loop, if that
/// is not either; and a derivative gain by this share.
const SOME_GAIN: f32 = 0.1;
const DERIVATIVE: f32 = 0.01;

impl Part {
    /// The request that makes this part of a motor's tuning be so.
    const fn request(self, tuning: &Tuning) -> Request {
        match (self, tuning.effort) {
            (Self::Speed, _) => Request::SpeedGains(tuning.speed),
            (Self::Angle, _) => Request::AngleGains(tuning.angle),
            (Self::Limit, TargetKind::Torque) => {
                Request::TorqueLimit(NewtonMetres::new(tuning.limit))
            }
            (Self::Limit, _) => Request::CurrentLimit(Amps::new(tuning.limit)),
        }
    }

    fn is_same(self, a: &Tuning, b: &Tuning) -> bool {
        match self {
            Self::Speed => a.speed == b.speed,
            Self::Angle => a.angle == b.angle,
            Self::Limit => a.limit.to_bits() == b.limit.to_bits(),
        }
    }
}

/// The request that sets a motor's parameter by its name, and puts it into `tuning`; `None` for another name.
pub fn request_to_set(name: &str, value: f32, tuning: &mut Tuning) -> Option<Request> {
    let field = MOTOR.iter().find(|field| field.name == name)?;
    *(field.get)(tuning) = value;
    Some(field.part.request(tuning))
}

/// How many of a motor's parameters differ from the table.
pub(crate) fn changed([mut declared, mut now]: [Tuning; 2]) -> usize {
    let differs = |it: &&Field| (it.get)(&mut declared).to_bits() != (it.get)(&mut now).to_bits();
    MOTOR.iter().filter(differs).count()
}

/// The number of parameters, those included that a motor has not.
pub(super) fn parameters(robot: &RobotView<'_>) -> u16 {
    short(robot.motors.len()) * EACH + count(|see| robot.own.parameters(see))
}

/// The motor's parameter with this number.
fn of_motor(index: u16, robot: &RobotView<'_>) -> Option<(usize, &'static Field)> {
    let motor = usize::from(index / EACH);
    (motor < robot.motors.len()).then_some((motor, MOTOR.get(usize::from(index % EACH))?))
}

/// The gains of a motor, as declared and now.
fn tuning(motor: usize, robot: &RobotView<'_>) -> Option<[Tuning; 2]> {
    robot.motor(motor)?.tuning()
}

const fn unit(field: &Field, effort: TargetKind) -> &'static str {
    let [current, torque, duty] = field.units;
    match effort {
        TargetKind::Torque => torque,
        TargetKind::Duty => duty,
        _ => current,
    }
}

/// Whether the motor can be asked for it: no request limits a share of the voltage.
const fn has(part: Part, effort: TargetKind) -> bool {
    !matches!((part, effort), (Part::Limit, TargetKind::Duty))
}

/// A PC never allows more than the declaration.
fn range(field: &Field, mut declared: Tuning, most_gain: f32) -> [f32; 2] {
    let kp = match field.part {
        Part::Speed => declared.speed.kp,
        Part::Angle => declared.angle.kp,
        Part::Limit => return [0.0, declared.limit],
    };
    let own = *(field.get)(&mut declared);
    let kp = if kp > 0.0 { kp } else { SOME_GAIN };
    let other = if field.name.ends_with("kd") { kp * DERIVATIVE } else { kp };
    [0.0, most_gain * if own > 0.0 { own } else { other }]
}

/// A parameter in words; one without a name if the motor has none with this number, `None` behind the
/// last.
#[inline(never)] // Once in flash.
pub(super) fn parameter<'r>(index: u16, robot: &RobotView<'r>) -> Option<Tell<'r>> {
    let nothing = Topic { folder: "", label: "" };
    let none = Tell::Parameter {
        index,
        topic: nothing,
        name: "",
        unit: "",
        range: [0.0; 2],
        value: 0.0,
        initial: 0.0,
    };
    if let Some((motor, field)) = of_motor(index, robot) {
        let tuning = tuning(motor, robot);
        let Some([mut declared, mut now]) = tuning.filter(|it| has(field.part, it[0].effort))
        else {
            return Some(none);
        };
        return Some(Tell::Parameter {
            index,
            topic: Topic { folder: "motors", label: robot.slots[motor].label },
            name: field.name,
            unit: unit(field, declared.effort),
            range: range(field, declared, robot.slots[motor].most_gain),
            value: *(field.get)(&mut now),
            initial: *(field.get)(&mut declared),
        });
    }
    let first = short(robot.motors.len()) * EACH;
    let own = nth(index.checked_sub(first)?, |see| robot.own.parameters(see))?;
    Some(Tell::Parameter {
        index,
        topic: Topic { folder: "parameters", label: own.label },
        name: "value",
        unit: own.unit,
        range: own.range,
        value: own.peek(),
        initial: own.initial,
    })
}

/// What a motor is asked, to change it and to change it back.
struct Step {
    motor: usize,
    parameter: u16,
    to: Request,
    back: Request,
}

/// Changes parameters: all of them or none. What concerns motors of one bus takes effect in one tick of
/// it.
pub(super) async fn set(change: &Change, robot: &RobotView<'_>) -> Result<(), Refusal> {
    let _turn = robot.changes.turn.lock().await;
    // The whole is checked before anything is done.
    for (at, one) in change.iter().enumerate() {
        check(one, robot)?;
        if change.iter().take(at).any(|other| other.parameter == one.parameter) {
            return Err(Refusal::because(Some(one.parameter), "it is changed twice at once"));
        }
    }
    let mut steps = Vec::<Step, { rc10_link::CHANGES }>::new();
    for One { parameter, .. } in change {
        let Some((motor, field)) = of_motor(*parameter, robot) else { continue };
        let Some([_, now]) = tuning(motor, robot) else { continue };
        let mut to = now;
        for One { parameter, value } in change {
            if let Some((_, field)) =
                of_motor(*parameter, robot).filter(|(other, _)| *other == motor)
            {
                *(field.get)(&mut to) = *value;
            }
        }
        let part = field.part;
        let is_new = |it: &Step| it.motor != motor || it.to != part.request(&to);
        if !part.is_same(&now, &to) && steps.iter().all(is_new) {
            let (to, back) = (part.request(&to), part.request(&now));
            let _ = steps.push(Step { motor, parameter: *parameter, to, back });
        }
    }
    // As many at once as a bus takes.
    for (group, some) in steps.chunks(4).enumerate() {
        let outcomes = ask(some, robot, |step| step.to).await;
        let failed = some.iter().zip(outcomes).find_map(|(step, outcome)| {
            outcome.err().map(|error| Refusal::of(Some(step.parameter), error))
        });
        if let Some(refusal) = failed {
            for some in steps.chunks(4).take(group + 1) {
                // One that did not change is told its own value.
                let _ = ask(some, robot, |step| step.back).await;
            }
            return Err(refusal);
        }
    }
    let first = short(robot.motors.len()) * EACH;
    for One { parameter, value } in change {
        let own = parameter.checked_sub(first);
        let own = own.and_then(|at| nth(at, |see| robot.own.parameters(see)));
        own.into_iter().for_each(|own| own.set(*value));
    }
    robot.changes.add();
    Ok(())
}

/// Asks up to four motors at once.
async fn ask(
    steps: &[Step],
    robot: &RobotView<'_>,
    which: impl Fn(&Step) -> Request,
) -> [Result<Response, RequestError>; 4] {
    let ask = async |at: usize| match steps.get(at) {
        Some(step) => match robot.motor(step.motor) {
            Some(port) => port.request(which(step)).await,
            None => Err(RequestError::NoSuchMotor),
        },
        None => Ok(Response::Done),
    };
    join4(ask(0), ask(1), ask(2), ask(3)).await.into()
}

/// Whether a parameter may have a value.
fn check(one: &One, robot: &RobotView<'_>) -> Result<(), Refusal> {
    let refused = |why| Err(Refusal::because(Some(one.parameter), why));
    match parameter(one.parameter, robot) {
        Some(Tell::Parameter { name, range: [least, most], .. }) if !name.is_empty() => {
            // Not a number is in no range.
            if one.value >= least && one.value <= most {
                Ok(())
            } else {
                refused("the value is out of its range")
            }
        }
        _ => refused("there is no parameter with this number"),
    }
}
