//! Vectors of protocols `cybergear` and `robstride`, through the codec they share.

use rc10_can::CanFrame;
use rc10_motor::cybergear::models::{ALL, CYBERGEAR};
use rc10_motor::cybergear::wire::{self, Parameter};
use rc10_motor::cybergear::{Address, Limits, Reply};
use serde_json::{Value, json};

use crate::damiao::{real, same_fields, setpoint};
use crate::fields::{Check, Fields, Tolerance, frame, narrow, same, text, unknown};

/// One vector of protocol `cybergear`.
pub fn cybergear(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    run(kind, vector, tolerance, |inputs| {
        let limits = CYBERGEAR.limits;
        match inputs.optional("P") {
            None => Ok(limits),
            Some(Value::String(text)) if text == "4pi" => {
                position(limits, 4.0 * std::f32::consts::PI)
            }
            Some(number) => position(limits, real(&number)?),
        }
    })
}

/// One vector of protocol `robstride`.
pub fn robstride(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    run(kind, vector, tolerance, |inputs| {
        let name = inputs.text("model")?;
        let model = ALL[1..].iter().find(|model| model.name.eq_ignore_ascii_case(&name));
        let model = model.ok_or_else(|| format!("this runner does not know the model `{name}`"))?;
        match inputs.optional("P") {
            None => Ok(model.limits),
            Some(number) => position(model.limits, real(&number)?),
        }
    })
}

fn position(limits: Limits, position: f32) -> Check<Limits> {
    let limits = Limits { position, ..limits };
    limits.validate().map(|()| limits).map_err(|error| error.to_string())
}

/// The motor as the vector describes it.
type LimitsOf = fn(&mut Fields) -> Check<Limits>;

fn run(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance, limits: LimitsOf) -> Check {
    match kind {
        "encode" => encode(vector, tolerance, limits),
        "decode" => decode(vector, tolerance, limits),
        "reject" => reject(vector, limits),
        other => Err(format!("this runner does not know the kind `{other}`")),
    }
}

fn encode(vector: &mut Fields, tolerance: &mut Tolerance, limits: LimitsOf) -> Check {
    let mut inputs = vector.object("inputs")?;
    let expected = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    let motor = narrow(&inputs.take("motor_id")?)?;
    if let Some(kind) = inputs.optional("type") {
        same("type", kind == 1, &"1, all others have an `op`", &kind)?;
        let setpoint = setpoint(&mut inputs)?;
        let limits = limits(&mut inputs)?;
        inputs.finish()?;
        let actual = wire::motion(motor, &setpoint, &limits);
        let fixed = |frame: &CanFrame| frame.key() & !0x00FF_FF00;
        same("identifier", fixed(&expected) == fixed(&actual), &expected, &actual)?;
        let (wanted, found) = (raw(&expected)?, raw(&actual)?);
        return same_fields((&expected, &wanted), (&actual, &found), vector, tolerance);
    }
    let operation = inputs.text("op")?;
    // It says nothing in these frames, but must be one that exists.
    inputs
        .optional("model")
        .map(|model| limits(&mut Fields::of("model", json!({"model": model}))?))
        .transpose()?;
    let mut host = inputs.optional("host").map(|host| narrow(&host)).transpose()?;
    inputs.finish()?;
    let mut words = Vec::new();
    for word in operation.split_whitespace() {
        match word.strip_prefix("host=") {
            Some(number) => host = Some(narrow(&plain(number))?),
            None => words.push(word),
        }
    }
    // The package these vectors are from leaves it at zero where nothing is said.
    let actual = operate(Address { motor, host: host.unwrap_or(0) }, &words)?;
    same("frame", expected == actual, &expected, &actual)
}

/// A number as it stands in a text.
fn plain(number: &str) -> Value {
    serde_json::from_str(number).ok().filter(Value::is_number).unwrap_or_else(|| number.into())
}

fn operate(to: Address, words: &[&str]) -> Check<CanFrame> {
    Ok(match *words {
        ["get", "id"] | ["get", "device", "id"] => wire::identify(to),
        ["enable"] => wire::enable(to),
        ["stop"] => wire::stop(to),
        ["clear", "fault" | "faults"] | ["stop", "clear", "fault" | "faults"] => {
            wire::clear_faults(to)
        }
        ["set", "zero"] | ["set", "zero", "position"] => wire::set_zero(to),
        ["change" | "set", "id", "to", new] => wire::set_id(to, narrow(&plain(new))?),
        ["read", name] => wire::read(to, parameter(name)?),
        ["write", name, value] if !name.contains('=') => {
            wire::write_real(to, parameter(name)?, real(&plain(value))?)
        }
        ["write", setting, "(u8)"] => {
            let (name, value) = setting.split_once('=').ok_or("no `name=value`")?;
            wire::write_byte(to, parameter(name)?, narrow(&plain(value))?)
        }
        ["write", setting] | ["write", setting, "(f32)"] if setting.contains('=') => {
            let (name, value) = setting.split_once('=').ok_or("no `name=value`")?;
            wire::write_real(to, parameter(name)?, real(&plain(value))?)
        }
        _ => return Err(format!("this runner does not know the operation {words:?}")),
    })
}

fn parameter(name: &str) -> Check<Parameter> {
    Ok(match name {
        "run_mode" => Parameter::RUN_MODE,
        "iq_ref" => Parameter::CURRENT,
        "spd_ref" => Parameter::VELOCITY,
        "limit_torque" => Parameter::TORQUE_LIMIT,
        "loc_ref" => Parameter::POSITION,
        "limit_spd" => Parameter::VELOCITY_LIMIT,
        "limit_cur" => Parameter::CURRENT_LIMIT,
        "mechPos" => Parameter::MEASURED_POSITION,
        "mechVel" => Parameter::MEASURED_VELOCITY,
        "VBUS" | "vbus" => Parameter::SUPPLY,
        number if number.starts_with("0x") => Parameter(narrow(&number.into())?),
        other => return Err(format!("this runner does not know the parameter `{other}`")),
    })
}

/// The fields of a setpoint; the torque stands in the identifier.
fn raw(frame: &CanFrame) -> Check<[(&'static str, u32); 5]> {
    let bytes = frame.all_eight().ok_or("a setpoint has eight bytes")?;
    let field = |at| u32::from(u16::from_be_bytes([bytes[at], bytes[at + 1]]));
    let torque = frame.raw_id() >> 8 & 0xFFFF;
    Ok([
        ("t16", torque),
        ("p16", field(0)),
        ("v16", field(2)),
        ("kp16", field(4)),
        ("kd16", field(6)),
    ])
}

fn decode(vector: &mut Fields, tolerance: &mut Tolerance, limits: LimitsOf) -> Check {
    let mut inputs = match vector.optional("inputs") {
        Some(inputs) => Fields::of("inputs", inputs)?,
        None => Fields::of("inputs", json!({}))?,
    };
    let limits = limits(&mut inputs)?;
    inputs.finish()?;
    let frame = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    let reply = Reply::unpack(&frame, &limits).map_err(|error| error.to_string())?;
    for (field, expected) in vector.object("expect")?.into_expectations()? {
        compare(&reply, &limits, &field, &expected, tolerance)?;
    }
    Ok(())
}

fn compare(
    reply: &Reply,
    limits: &Limits,
    field: &str,
    expected: &Value,
    tolerance: &mut Tolerance,
) -> Check {
    let step = |limit: f32| 2.0 * f64::from(limit) / 65535.0;
    let (lsb, actual) = match (reply, field) {
        (Reply::Feedback(heard), "position") => (step(limits.position), heard.position),
        (Reply::Feedback(heard), "velocity") => (step(limits.velocity), heard.velocity),
        (Reply::Feedback(heard), "torque") => (step(limits.torque), heard.torque),
        (Reply::Feedback(heard), "temperature") => (0.1, heard.temperature.get()),
        (Reply::Parameter(heard), "f32") => (0.0, heard.real().ok_or("infinite or NaN")?),
        _ => return tolerance.raw(field, expected, whole(reply, field)?),
    };
    tolerance.float(field, lsb, expected, actual)
}

fn whole(reply: &Reply, field: &str) -> Check<i64> {
    let address = match reply {
        Reply::Feedback(heard) => Some(heard.address),
        Reply::Parameter(heard) => Some(heard.address),
        Reply::Faults(heard) => Some(heard.address),
        _ => None,
    };
    match (field, reply, address) {
        ("motor_id", _, Some(address)) => Ok(address.motor.into()),
        ("motor_id", Reply::Identity { motor, .. }, _) => Ok((*motor).into()),
        ("host", _, Some(address)) => Ok(address.host.into()),
        ("mode", Reply::Feedback(heard), _) => Ok(heard.mode as i64),
        ("fault_bits", Reply::Feedback(heard), _) => Ok(heard.faults.into()),
        ("fault_bits", Reply::Faults(heard), _) => Ok(heard.faults.into()),
        ("warning_bits", Reply::Faults(heard), _) => Ok(heard.warnings.into()),
        ("index", Reply::Parameter(heard), _) => Ok(heard.parameter.0.into()),
        ("u8", Reply::Parameter(heard), _) => Ok(heard.byte().into()),
        ("u32", Reply::Parameter(heard), _) => Ok(u32::from_le_bytes(heard.bytes).into()),
        (other, ..) => Err(unknown(other)),
    }
}

/// No reply; where the vector names a listener, a reply of another motor counts as rejected.
fn reject(vector: &mut Fields, limits: LimitsOf) -> Check {
    let mut inputs = match vector.optional("inputs") {
        Some(inputs) => Fields::of("inputs", inputs)?,
        None => Fields::of("inputs", json!({}))?,
    };
    let motor: Option<i64> = inputs.optional("motor_id").map(|id| narrow(&id)).transpose()?;
    let host: Option<i64> = inputs.optional("host").map(|id| narrow(&id)).transpose()?;
    // The test whether a frame is a reply is the same for all models.
    let limits = limits(&mut inputs).unwrap_or(CYBERGEAR.limits);
    inputs.finish()?;
    let Some(frame) = frame(vector.object("frame")?)? else {
        return Ok(()); // It cannot even arrive.
    };
    let Ok(reply) = Reply::unpack(&frame, &limits) else { return Ok(()) };
    let differs = |field, own: Option<i64>| own.is_some_and(|own| whole(&reply, field) != Ok(own));
    let foreign = differs("motor_id", motor) || differs("host", host);
    same("rejected", foreign, &"an error", &text(&format!("{reply:?}").into())?)
}
