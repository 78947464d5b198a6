//! Vectors of protocol `damiao`, through the codec.

use rc10_can::CanFrame;
use rc10_motor::damiao::registers::{Access, Register, Reply, Value as Held};
use rc10_motor::damiao::{
    DeviceId, Feedback, Limits, Mode, Model, Operation, Setpoint, models, wire,
};
use serde_json::{Map, Value, json};

use crate::fields::{Check, Fields, Tolerance, float, frame, integer, narrow, same, text, unknown};

/// One vector of protocol `damiao`.
pub fn run(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    match kind {
        "encode" => encode(vector, tolerance),
        "decode" => decode(vector, tolerance),
        "reject" => reject(vector),
        "rule" => rule(vector),
        other => Err(format!("this runner does not know the kind `{other}`")),
    }
}

/// A number as the codec takes it.
pub fn real(value: &Value) -> Check<f32> {
    #[expect(clippy::cast_possible_truncation, reason = "f32 is what setpoints are made of")]
    float(value).map(|number| number as f32)
}

fn limits(inputs: &mut Fields) -> Check<Option<Limits>> {
    if let Some(name) = inputs.optional("model") {
        return model(&text(&name)?).map(|model| Some(model.limits));
    }
    let mut of = match inputs.optional("limits") {
        Some(limits) => Fields::of("limits", limits)?,
        None => {
            let found: Map<_, _> = ["P", "V", "T"]
                .iter()
                .filter_map(|&f| Some((f.into(), inputs.optional(f)?)))
                .collect();
            if found.is_empty() {
                return Ok(None);
            }
            Fields::of("inputs", found.into())?
        }
    };
    let [p, v, t] = [real(&of.take("P")?)?, real(&of.take("V")?)?, real(&of.take("T")?)?];
    of.finish()?;
    let limits = Limits::new(p, v, t);
    limits.validate().map(|()| Some(limits)).map_err(|error| error.to_string())
}

fn model(name: &str) -> Check<&'static Model> {
    let known = models::ALL.iter().find(|model| {
        let short = model.name.trim_start_matches("DM-");
        [model.name, short].iter().any(|known| known.eq_ignore_ascii_case(name))
    });
    known.ok_or_else(|| format!("this runner does not know the model `{name}`"))
}

fn device(value: &Value) -> Check<DeviceId> {
    DeviceId::new(narrow(value)?).ok_or_else(|| format!("no `CAN_ID`: {value}"))
}

fn mode(name: &str) -> Check<Mode> {
    match name {
        "mit" => Ok(Mode::Mit),
        "pos_vel" => Ok(Mode::PositionVelocity),
        "vel" => Ok(Mode::Velocity),
        "force_pos" => Ok(Mode::ForcePosition),
        other => Err(format!("this runner does not know the mode `{other}`")),
    }
}

fn encode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let expected = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    if let Some(access) = inputs.optional("register_op") {
        inputs.finish()?;
        return same_access(&expected, &access_frame(&text(&access)?)?);
    }
    let id = device(&inputs.take("id")?)?;
    let actual = if let Some(operation) = inputs.optional("op") {
        operation_frame(id, &text(&operation)?, &mut inputs)?
    } else {
        let mode = mode(&inputs.text("mode")?)?;
        let mut number = |field| real(&inputs.take(field)?);
        match mode {
            Mode::PositionVelocity => wire::position_velocity(id, number("p")?, number("v")?),
            Mode::Velocity => wire::velocity(id, number("v")?),
            Mode::ForcePosition => {
                let [p, v, i] = [number("p")?, number("v")?, number("i_pu")?];
                let actual = wire::force_position(id, p, v, i);
                inputs.finish()?;
                return same_force_position(&expected, &actual, vector, tolerance);
            }
            Mode::Mit => {
                let setpoint = setpoint(&mut inputs)?;
                let limits = limits(&mut inputs)?.ok_or("MIT mode needs limits")?;
                inputs.finish()?;
                return same_mit(&expected, &wire::mit(id, &setpoint, &limits), vector, tolerance);
            }
        }
    };
    inputs.finish()?;
    same("frame", expected == actual, &expected, &actual)
}

/// The five numbers of a setpoint.
pub fn setpoint(inputs: &mut Fields) -> Check<Setpoint> {
    let mut number = |field| real(&inputs.take(field)?);
    Ok(Setpoint {
        position: number("p")?,
        velocity: number("v")?,
        kp: number("kp")?,
        kd: number("kd")?,
        torque: number("t")?,
    })
}

fn operation_frame(id: DeviceId, name: &str, inputs: &mut Fields) -> Check<CanFrame> {
    let operation = match name {
        "enable" => Operation::Enable,
        "disable" => Operation::Disable,
        "save_zero" => Operation::StoreZero,
        "clear_error" => Operation::ClearError,
        other => return Err(format!("this runner does not know the operation `{other}`")),
    };
    let offset: u16 = narrow(&inputs.take("mode_offset")?)?;
    let mode = Mode::ALL.into_iter().find(|mode| mode.offset() == offset);
    Ok(wire::operate(id, mode.ok_or_else(|| format!("no mode has offset {offset}"))?, operation))
}

/// Raw fields, by name.
pub type Raw = [(&'static str, u32)];

/// Compares frames by their raw fields, within the tolerance, and both with the vector's own list
/// of them, if it has one; what is no field must be equal.
pub fn same_fields(
    expected: (&CanFrame, &Raw),
    actual: (&CanFrame, &Raw),
    vector: &mut Fields,
    tolerance: &mut Tolerance,
) -> Check {
    for (&(field, wanted), &(_, found)) in expected.1.iter().zip(actual.1) {
        tolerance.raw(field, &json!(wanted), found.into())?;
    }
    if let Some(listed) = vector.optional("fields_raw") {
        for (field, value) in Fields::of("fields_raw", listed)?.into_expectations()? {
            let of = |raw: &Raw| raw.iter().find(|(name, _)| *name == field).map(|&(_, raw)| raw);
            let (Some(wanted), Some(found)) = (of(expected.1), of(actual.1)) else {
                return Err(unknown(&field));
            };
            same(&field, integer(&value)? == i64::from(wanted), &value, &wanted)?;
            tolerance.raw(&field, &value, found.into())?;
        }
    }
    // Without any tolerance, every bit counts.
    let steps: u32 = expected.1.iter().map(|(field, _)| tolerance.steps(field)).sum();
    same("frame", steps > 0 || expected.0 == actual.0, expected.0, actual.0)
}

fn same_mit(
    expected: &CanFrame,
    actual: &CanFrame,
    vector: &mut Fields,
    tolerance: &mut Tolerance,
) -> Check {
    same("identifier", expected.key() == actual.key(), expected, actual)?;
    let raw = |frame: &CanFrame| {
        let bytes = *frame.all_eight().ok_or("a setpoint has eight bytes")?;
        let bits = u64::from_be_bytes(bytes);
        #[expect(clippy::cast_possible_truncation, reason = "masked")]
        let field = |shift: u32, mask: u64| (bits >> shift & mask) as u32;
        Check::Ok([
            ("p16", field(48, 0xFFFF)),
            ("v12", field(36, 0xFFF)),
            ("kp12", field(24, 0xFFF)),
            ("kd12", field(12, 0xFFF)),
            ("t12", field(0, 0xFFF)),
        ])
    };
    let (wanted, found) = (raw(expected)?, raw(actual)?);
    same_fields((expected, &wanted), (actual, &found), vector, tolerance)
}

fn same_force_position(
    expected: &CanFrame,
    actual: &CanFrame,
    vector: &mut Fields,
    tolerance: &mut Tolerance,
) -> Check {
    same("identifier", expected.key() == actual.key(), expected, actual)?;
    let raw = |frame: &CanFrame| {
        let [a, b, c, d, e, f, g, h] = *frame.all_eight().ok_or("a setpoint has eight bytes")?;
        let position = u32::from_le_bytes([a, b, c, d]);
        let [v, i] = [[e, f], [g, h]].map(|pair| u32::from(u16::from_le_bytes(pair)));
        Check::Ok((position, [("v16", v), ("i16", i)]))
    };
    let ((a, wanted), (b, found)) = (raw(expected)?, raw(actual)?);
    same("position", a == b, expected, actual)?;
    same_fields((expected, &wanted), (actual, &found), vector, tolerance)
}

/// The drive takes register frames of four bytes or, padded with zeros, eight.
fn same_access(expected: &CanFrame, actual: &CanFrame) -> Check {
    let (short, long) =
        if expected.len() <= actual.len() { (expected, actual) } else { (actual, expected) };
    let (head, padding) = long.bytes().split_at(short.len());
    let equal = expected.key() == actual.key()
        && !expected.is_remote()
        && (short.len() == long.len() || (short.len(), long.len()) == (4, 8))
        && head == short.bytes()
        && padding.iter().all(|&byte| byte == 0);
    same("frame", equal, expected, actual)
}

/// `read id=0x12 rid=10` and the like: an access to a register.
fn access_frame(text: &str) -> Check<CanFrame> {
    let mut words = text.split_whitespace();
    let verb = words.next().unwrap_or_default();
    let mut arguments = Map::new();
    for word in words {
        let (name, value) =
            word.split_once('=').ok_or_else(|| format!("no `name=value`: {word}"))?;
        let plain = serde_json::from_str(value).ok().filter(Value::is_number);
        arguments.insert(name.into(), plain.unwrap_or_else(|| value.into()));
    }
    let mut arguments = Fields::of("register_op", arguments.into())?;
    let id = device(&arguments.take("id")?)?;
    let mut register = || Check::Ok(Register(narrow(&arguments.take("rid")?)?));
    let access = match verb {
        "rd" | "read" => Access::Read(register()?),
        "wr" | "write" => Access::Write(register()?, value(&mut arguments)?),
        "save" => Access::Save,
        "refresh" => Access::Refresh,
        other => return Err(format!("this runner does not know the access `{other}`")),
    };
    arguments.finish()?;
    access.pack(id).map_err(|error| error.to_string())
}

fn value(fields: &mut Fields) -> Check<Held> {
    match fields.optional("u32") {
        Some(whole) => Ok(Held::Whole(narrow(&whole)?)),
        None => Ok(Held::Real(real(&fields.take("f32")?)?)),
    }
}

/// A reply, with the identifier it came with; `MST_ID` stands for any.
fn replies(vector: &mut Fields) -> Check<Vec<CanFrame>> {
    let fields = vector.take("frame")?;
    let any = fields["id"] == "MST_ID";
    let ids =
        if any { vec![json!(0), json!(0x11), json!(0x7FE)] } else { vec![fields["id"].clone()] };
    let mut frames = Vec::new();
    for id in ids {
        let mut fields = fields.clone();
        if let Some(map) = fields.as_object_mut() {
            map.insert("id".into(), id);
        }
        // One that no bus can carry cannot even arrive.
        frames.extend(frame(Fields::of("frame", fields)?)?);
    }
    Ok(frames)
}

fn decode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = match vector.optional("inputs") {
        Some(inputs) => Fields::of("inputs", inputs)?,
        None => Fields::of("inputs", json!({}))?,
    };
    let limits = limits(&mut inputs)?;
    inputs.finish()?;
    let expected = vector.object("expect")?.into_expectations()?;
    let frames = replies(vector)?;
    same("frames", !frames.is_empty(), &"a classic CAN frame", &"none")?;
    for frame in &frames {
        for (field, expected) in &expected {
            if field == "register_reply" {
                register_reply(frame, expected, tolerance)?;
            } else {
                let limits = limits.ok_or("feedback needs limits")?;
                let heard = Feedback::unpack(frame, &limits).map_err(|error| error.to_string())?;
                feedback(&heard, &limits, field, expected, tolerance)?;
            }
        }
    }
    Ok(())
}

fn feedback(
    heard: &Feedback,
    limits: &Limits,
    field: &str,
    expected: &Value,
    tolerance: &mut Tolerance,
) -> Check {
    let step = |limit: f32, full: f64| 2.0 * f64::from(limit) / full;
    let mut near = |lsb, actual| tolerance.float(field, lsb, expected, actual);
    match field {
        "p" => near(step(limits.position, 65535.0), heard.position),
        "v" => near(step(limits.velocity, 4095.0), heard.velocity),
        "t" => near(step(limits.torque, 4095.0), heard.torque),
        "t_mos_C" => near(1.0, heard.driver_temperature.get()),
        "t_rotor_C" => near(1.0, heard.motor_temperature.get()),
        "id" => tolerance.raw(field, expected, heard.id.into()),
        "err" => tolerance.raw(field, expected, heard.state.code().into()),
        other => Err(unknown(other)),
    }
}

fn register_reply(frame: &CanFrame, expected: &Value, tolerance: &mut Tolerance) -> Check {
    let reply = Reply::unpack(frame).map_err(|error| error.to_string())?;
    for (field, expected) in Fields::of("register_reply", expected.clone())?.into_expectations()? {
        let (register, value) = reply.held.unzip();
        let flag = |actual: bool| same(&field, expected == actual, &expected, &actual);
        match (field.as_str(), register, value) {
            ("id", ..) => tolerance.raw(&field, &expected, reply.id.into())?,
            ("rid", Some(register), _) => tolerance.raw(&field, &expected, register.0.into())?,
            ("u32", _, Some(Held::Whole(whole))) => {
                tolerance.raw(&field, &expected, whole.into())?;
            }
            ("f32", _, Some(Held::Real(real))) => tolerance.float(&field, 0.0, &expected, real)?,
            ("write_ack", ..) => flag(reply.is_written)?,
            ("save_ack", ..) => flag(reply.held.is_none())?,
            (other, ..) => return Err(format!("{other}: not in {reply:?}")),
        }
    }
    Ok(())
}

/// No feedback and no register reply; where the vector names the motor that is listening, one of
/// another motor counts as rejected.
fn reject(vector: &mut Fields) -> Check {
    let mut inputs = match vector.optional("inputs") {
        Some(inputs) => Fields::of("inputs", inputs)?,
        None => Fields::of("inputs", json!({}))?,
    };
    let id = inputs.optional("id").map(|id| device(&id)).transpose()?;
    let master = inputs.optional("mst_id").map(|id| integer(&id)).transpose()?;
    let limits = limits(&mut inputs)?.unwrap_or(models::J4310.limits);
    inputs.finish()?;
    for frame in replies(vector)? {
        if master.is_some_and(|master| master != i64::from(frame.raw_id())) {
            continue;
        }
        let feedback = Feedback::unpack(&frame, &limits).ok();
        let feedback = feedback.filter(|heard| id.is_none_or(|id| id.answers_as(heard.id)));
        same("rejected", feedback.is_none(), &"an error", &format!("{feedback:?}"))?;
        let reply = Reply::unpack(&frame).ok();
        let reply = reply.filter(|heard| id.is_none_or(|id| id.raw() == heard.id));
        same("rejected", reply.is_none(), &"an error", &format!("{reply:?}"))?;
    }
    Ok(())
}

/// A setpoint whose fields are all at their ends, but for the torque, must not be sent as the
/// operation it would spell.
fn rule(vector: &mut Fields) -> Check {
    let mut inputs = vector.object("inputs")?;
    mode(&inputs.text("mode")?)
        .and_then(|mode| same("mode", mode == Mode::Mit, &"mit", &"another"))?;
    let spelt = inputs.text("all_fields_at_max_but_last_byte")?;
    inputs.finish()?;
    let mut expect = vector.object("expect")?;
    let never = expect.text("encoder_never_emits_as_mit")?;
    expect.finish()?;
    same("the forbidden frame", never == spelt, &spelt, &never)?;
    let last =
        never.strip_prefix("ffffffffffffff").and_then(|last| u8::from_str_radix(last, 16).ok());
    let last = last.filter(|last| (0xFB..=0xFE).contains(last));
    let last = last.ok_or_else(|| format!("{never} is no operation"))?;
    let id = DeviceId::new(1).ok_or("no identifier")?;
    let limits = Limits::new(1.0, 1.0, 1.0);
    for part in 0..100_u8 {
        let raw = 3840.0 + f32::from(last) + f32::from(part) / 100.0;
        let torque = raw / 4095.0 * 2.0 - 1.0;
        let frame = wire::mit(
            id,
            &Setpoint { position: 9.0, velocity: 9.0, kp: 1e9, kd: 1e9, torque },
            &limits,
        );
        let text = frame.to_string().to_lowercase();
        same("setpoint", !text.ends_with(&never), &"another frame", &frame)?;
        // It is this torque, give or take a step at the edges, and not another frame altogether.
        let bytes = frame.all_eight().ok_or("a setpoint has eight bytes")?;
        same("setpoint", bytes[7].abs_diff(last) <= 1 && bytes[..6] == [0xFF; 6], &never, &frame)?;
    }
    Ok(())
}
