//! Vectors of protocol `dji`: through the codec, and through real motors on a real [`MotorBus`].

use rc10_app::{Amps, CountsPerTurn, Gear, Seconds};
use rc10_can::CanFrame;
use rc10_can::embedded_can::{Id, StandardId};
use rc10_motor::dji::{
    self, Dji, Effort, GM6020_CURRENT, GM6020_VOLTAGE, M2006, M3508, Model, RawFeedback,
};
use rc10_motor::rc10_app::Direction;
use rc10_motor::{
    ArmSwitch, CanMotor, Dispatch, Feedback, Link, Motor, MotorBus, Safety, Target, TxBatch,
};
use rc10_time::Micros;
use serde_json::{Map, Value};

use crate::fields::{Check, Fields, Tolerance, float, frame, integer, narrow, same, text, unknown};
use crate::wire::{compare, totals};

const TURN: u32 = 8192;
/// All identifiers that DJI motors answer with.
const FEEDBACK_IDS: std::ops::RangeInclusive<u32> = 0x201..=0x20B;

/// One vector of protocol `dji`.
pub fn run(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    match kind {
        "encode" => encode(vector, tolerance),
        "decode" => decode(vector, tolerance),
        "convert" => convert(vector, tolerance),
        "sequence" => sequence(vector, tolerance),
        "config" => config(vector),
        "encode_bus" => encode_bus(vector, tolerance),
        "reject" => reject(vector),
        other => Err(format!("this runner does not know the kind `{other}`")),
    }
}

fn model(name: &str) -> Check<&'static Model> {
    match name {
        "c620" | "m3508" => Ok(&M3508),
        "c610" | "m2006" => Ok(&M2006),
        "gm6020_current" => Ok(&GM6020_CURRENT),
        "gm6020_voltage" => Ok(&GM6020_VOLTAGE),
        other => Err(format!("this runner does not know the model `{other}`")),
    }
}

fn encode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let group: u16 = narrow(&inputs.take("group_id")?)?;
    let group = StandardId::new(group).ok_or("`group_id` is no standard identifier")?;
    let slots = inputs.list("slots_raw_i16")?;
    same("slots", slots.len() == 4, &4, &slots.len())?;
    inputs.finish()?;
    let mut batch = TxBatch::new();
    for (slot, raw) in slots.iter().enumerate() {
        let raw: i16 = narrow(raw)?;
        batch.lane(group, slot * 2, raw.to_be_bytes()).map_err(|error| error.to_string())?;
    }
    let expected = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    same_frames(&[expected], batch.frames(), tolerance.steps("slots_raw_i16"))
}

/// Compares frames whose bytes are four numbers each; 0 steps: every bit.
fn same_frames(expected: &[CanFrame], actual: &[CanFrame], steps: u32) -> Check {
    same("frames", expected.len() == actual.len(), &expected.len(), &actual.len())?;
    for (expected, actual) in expected.iter().zip(actual) {
        let near = match (lanes(expected), lanes(actual)) {
            (Some(a), Some(b)) if steps > 0 && expected.key() == actual.key() => {
                a.iter().zip(b).all(|(a, b)| u32::from(a.abs_diff(b)) <= steps)
            }
            _ => expected == actual,
        };
        same("frame", near, expected, actual)?;
    }
    Ok(())
}

fn lanes(frame: &CanFrame) -> Option<[i16; 4]> {
    frame.all_eight().map(|b| [0, 2, 4, 6].map(|at| i16::from_be_bytes([b[at], b[at + 1]])))
}

fn decode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let frame = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    let bytes = *frame.all_eight().ok_or("a feedback frame has eight bytes")?;
    if frame.is_extended_id() || !FEEDBACK_IDS.contains(&frame.raw_id()) {
        return Err(format!("{frame} is no motor's feedback, and must not be decoded"));
    }
    let raw = RawFeedback::unpack(&bytes);
    for (field, expected) in vector.object("expect")?.into_expectations()? {
        match field.as_str() {
            "as_c620" => physical(&[&M3508], &frame, expected, tolerance)?,
            "as_c610" => physical(&[&M2006], &frame, expected, tolerance)?,
            // The feedback is the same in both modes.
            "as_gm6020" => {
                physical(&[&GM6020_CURRENT, &GM6020_VOLTAGE], &frame, expected, tolerance)?;
            }
            "as_gm6020_current" => physical(&[&GM6020_CURRENT], &frame, expected, tolerance)?,
            "as_gm6020_voltage" => physical(&[&GM6020_VOLTAGE], &frame, expected, tolerance)?,
            "angle_deg" => value(&GM6020_CURRENT, &frame, &field, &expected, tolerance)?,
            other => tolerance.raw(other, &expected, raw_field(&raw, other)?)?,
        }
    }
    Ok(())
}

fn raw_field(raw: &RawFeedback, field: &str) -> Check<i64> {
    match field {
        "angle_raw" => Ok(raw.angle.into()),
        "rotor_rpm" => Ok(raw.rpm.into()),
        "current_raw" => Ok(raw.current.into()),
        "byte6" => Ok(raw.temperature.into()),
        other => Err(unknown(other)),
    }
}

/// Expected outcome of the frame at motors of these models.
fn physical(
    models: &[&'static Model],
    frame: &CanFrame,
    expected: Value,
    tolerance: &mut Tolerance,
) -> Check {
    let expected = Fields::of("as_…", expected)?.into_expectations()?;
    for model in models {
        for (field, expected) in &expected {
            value(model, frame, field, expected, tolerance)?;
        }
    }
    Ok(())
}

/// One physical value of a motor that received the frame.
fn value(
    model: &'static Model,
    frame: &CanFrame,
    field: &str,
    expected: &Value,
    tolerance: &mut Tolerance,
) -> Check {
    let stock = received(model, frame, model.gear)?;
    let rotor = received(model, frame, Gear::DIRECT)?;
    let degree = 360.0 / f64::from(TURN);
    let rpm = 1.0 / f64::from(model.gear.ratio());
    let (lsb, actual) = match field {
        "current_A" => (model.amps_per_count.into(), stock.current().map(|amps| amps.get())),
        "temp_C" => (1.0, stock.temperature().map(|celsius| celsius.get())),
        "torque_Nm" => {
            let step = model.rotor_torque_constant * model.amps_per_count * model.gear.ratio();
            (step.into(), stock.torque().map(|torque| torque.get()))
        }
        "angle_deg" => (degree, Some(rotor.angle.get())),
        "rotor_rpm" => (1.0, Some(rotor.speed.get())),
        "output_rpm" => (rpm, Some(stock.speed.get())),
        "output_rpm_m3508" if *model == M3508 => (rpm, Some(stock.speed.get())),
        "output_rpm_m2006" if *model == M2006 => (rpm, Some(stock.speed.get())),
        other => return Err(unknown(other)),
    };
    let what = format!("{} {field}", model.name);
    match actual {
        Some(actual) => tolerance
            .float(field, lsb, expected, actual)
            .map_err(|error| format!("{what}: {error}")),
        None => same(&what, expected.is_null(), expected, &"nothing"),
    }
}

/// The feedback of a motor that received the frame from its bus. Where no device of the model has
/// the frame's identifier, the payload comes with one that it has.
fn received(model: &'static Model, frame: &CanFrame, gear: Gear) -> Check<Feedback> {
    let has = |id: &u8| model.feedback_id(*id).is_ok_and(|own| Id::Standard(own) == frame.id());
    let id = (1..=model.last_id).find(has).unwrap_or(1);
    let own = model.feedback_id(id).map_err(|error| error.to_string())?;
    let bytes = frame.all_eight().ok_or("a feedback frame has eight bytes")?;
    let at = Micros::from_millis(1);
    let mut motor =
        Dji::new(dji::Config::new(model, id).with_gear(gear)).map_err(|error| error.to_string())?;
    let mut alone = motor.clone();
    let switch = ArmSwitch::new();
    let mut bus = MotorBus::new(&switch);
    let id = bus.attach(&mut motor, Safety::COAST).map_err(|error| error.to_string())?;
    let frame = CanFrame::eight_bytes(own, *bytes);
    if bus.on_frame(&frame, at) != Dispatch::Motor(id) {
        return Err(format!("the bus does not give {frame} to its motor"));
    }
    alone.unpack_feedback(&frame, at, Link::Online).map_err(|error| error.to_string())?;
    let status = bus.status(id, at).ok_or("the motor is gone")?;
    if status.feedback != alone.feedback() {
        return Err("a motor decodes differently on a bus".into());
    }
    Ok(status.feedback)
}

fn convert(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let model = model(&inputs.text("model")?)?;
    let expected = vector.object("expect")?.into_expectations()?;
    let current = match model.effort {
        Effort::Current(full) => inputs.optional("current_A").map(|amps| (amps, full)),
        Effort::Voltage => None,
    };
    // Numerator and denominator of the share of full scale that is asked for.
    let share = if let Some((amps, full)) = current {
        Some((float(&amps)?, f64::from(full)))
    } else if let Some(raw) = inputs.optional("raw_request") {
        Some((float(&raw)?, f64::from(model.full_scale)))
    } else {
        let share = inputs.optional("voltage_fraction").or_else(|| inputs.optional("duty"));
        share.map(|share| float(&share)).transpose()?.map(|share| (share, 1.0))
    };
    match share {
        Some((part, whole)) => command(model, part / whole, &expected, tolerance)?,
        None => feedback(model, &mut inputs, &expected, tolerance)?,
    }
    inputs.finish()
}

/// The raw command for a share of full scale.
fn command(
    model: &'static Model,
    share: f64,
    expected: &Map<String, Value>,
    tolerance: &mut Tolerance,
) -> Check {
    let effort = effort(model, share);
    for (field, value) in expected {
        if field != "raw_i16" {
            return Err(unknown(field));
        }
        tolerance.raw(field, value, model.raw_command(effort).into())?;
        // An infinite target never gets as far as this.
        if effort.is_finite() {
            let frames = driven(&[(model, 1, effort)])?;
            let raw = frames.first().and_then(lanes).ok_or("the motor sends no command")?[0];
            let on_bus = tolerance.raw(field, value, raw.into());
            on_bus.map_err(|error| format!("on a bus: {error}"))?;
        }
    }
    Ok(())
}

/// In the unit the model's commands are in.
fn effort(model: &Model, share: f64) -> f32 {
    let full = match model.effort {
        Effort::Current(amps) => amps,
        Effort::Voltage => 1.0,
    };
    #[expect(clippy::cast_possible_truncation, reason = "f32 is what targets are made of")]
    return (share * f64::from(full)) as f32;
}

/// The physical values of raw feedback fields.
fn feedback(
    model: &'static Model,
    inputs: &mut Fields,
    expected: &Map<String, Value>,
    tolerance: &mut Tolerance,
) -> Check {
    let mut bytes = [0; 8];
    let mut found = false;
    for (field, at) in [("angle_raw", 0), ("rotor_rpm", 2), ("current_raw", 4)] {
        if let Some(value) = inputs.optional(field) {
            let (low, high) = (i64::from(i16::MIN), i64::from(u16::MAX));
            let raw = integer(&value)?;
            same(field, (low..=high).contains(&raw), &"16 bits", &raw)?;
            bytes[at..at + 2].copy_from_slice(&raw.to_be_bytes()[6..]);
            found = true;
        }
    }
    if let Some(value) = inputs.optional("byte6") {
        bytes[6] = narrow(&value)?;
        found = true;
    }
    if !found {
        return Err(format!("this runner finds nothing to convert for a {}", model.name));
    }
    let id = model.feedback_id(1).map_err(|error| error.to_string())?;
    let frame = CanFrame::eight_bytes(id, bytes);
    expected
        .iter()
        .try_for_each(|(field, expected)| value(model, &frame, field, expected, tolerance))
}

fn sequence(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let angles = inputs.list("angle_raw")?;
    inputs.finish()?;
    let mut expect = vector.object("expect")?;
    let field = "total_counts_from_first";
    let expected = expect.list(field)?;
    expect.finish()?;
    compare(field, &expected, &totals(TURN.into(), &angles)?, tolerance)?;
    for model in [&M3508, &M2006, &GM6020_CURRENT, &GM6020_VOLTAGE] {
        for (direction, sign) in [(Direction::Forward, 1), (Direction::Reversed, -1)] {
            let config = dji::Config::new(model, 1).with_direction(direction);
            let motor = Dji::new(config).map_err(|error| error.to_string())?;
            let totals = motor_totals(motor, sign, &angles)?;
            let compared = compare(field, &expected, &totals, tolerance);
            compared.map_err(|error| format!("{} {direction:?}: {error}", model.name))?;
        }
    }
    Ok(())
}

/// A motor's total angle after each frame, times `sign`, from the first.
fn motor_totals(mut motor: Dji, sign: i64, angles: &[Value]) -> Check<Vec<i64>> {
    let id = motor.model().feedback_id(1).map_err(|error| error.to_string())?;
    let gear = motor.model().gear;
    let per_turn = CountsPerTurn::new(8192 * gear.rotor_turns(), gear.output_turns());
    let mut first = None;
    let total = |(at, angle): (Micros, &Value)| {
        let [high, low] = narrow::<u16>(angle)?.to_be_bytes();
        let frame = CanFrame::eight_bytes(id, [high, low, 0, 0, 0, 0, 0, 0]);
        motor.unpack_feedback(&frame, at, Link::Online).map_err(|error| error.to_string())?;
        let total = motor.feedback().total_angle.counts_at(per_turn);
        Ok(sign * (total - *first.get_or_insert(total)))
    };
    (1..).map(Micros::from_millis).zip(angles).map(total).collect()
}

/// A device of a vector: model and identifier, as far as such a device can exist.
fn device(value: &Value) -> Check<(&'static Model, Option<u8>, Option<&Value>)> {
    let parts = value.as_array().map(Vec::as_slice);
    let (name, id, raw) = match parts {
        Some([name, id]) => (name, id, None),
        Some([name, id, raw]) => (name, id, Some(raw)),
        _ => return Err(format!("no device: {value}")),
    };
    Ok((model(&text(name)?)?, u8::try_from(integer(id)?).ok(), raw))
}

fn config(vector: &mut Fields) -> Check {
    let mut inputs = vector.object("inputs")?;
    let devices = inputs.list("devices")?;
    inputs.finish()?;
    let mut wanted = Vec::new();
    for listed in &devices {
        match device(listed)? {
            (model, id, None) => wanted.push((model, id)),
            _ => return Err(format!("no device of a configuration: {listed}")),
        }
    }
    let mut expect = vector.object("expect")?;
    let accepted = expect.flag("accepted")?;
    expect.finish()?;
    same("accepted", attachable(&wanted) == accepted, &accepted, &!accepted)?;
    // The second one is in the way: the order must not matter.
    wanted.reverse();
    same("accepted in reverse order", attachable(&wanted) == accepted, &accepted, &!accepted)
}

/// Whether these devices can share a bus, as far as their identifiers go: a bus has no more than
/// [`MotorBus::CAPACITY`] motors.
fn attachable(devices: &[(&'static Model, Option<u8>)]) -> bool {
    let motors = devices.iter().map(|&(model, id)| Dji::new(dji::Config::new(model, id?)).ok());
    let Some(mut motors) = motors.collect::<Option<Vec<_>>>() else { return false };
    if motors.len() > MotorBus::CAPACITY {
        let wirings: Vec<_> = motors.iter().map(CanMotor::can_ids).collect();
        return (1..wirings.len()).all(|index| {
            wirings[..index].iter().all(|other| wirings[index].clash(other).is_none())
        });
    }
    let switch = ArmSwitch::new();
    let mut bus = MotorBus::new(&switch);
    motors.iter_mut().all(|motor| bus.attach(motor, Safety::COAST).is_ok())
}

fn encode_bus(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    inputs.ignore(&["meaning"]);
    let devices = inputs.list("devices")?;
    inputs.finish()?;
    let mut batch = TxBatch::new();
    let mut efforts = Vec::new();
    for listed in &devices {
        let (model, Some(id), Some(raw)) = device(listed)? else {
            return Err(format!("no device with a command: {listed}"));
        };
        let raw: i16 = narrow(raw)?;
        let (frame, lane) = model.command_lane(id).map_err(|error| error.to_string())?;
        batch.lane(frame, lane, raw.to_be_bytes()).map_err(|error| error.to_string())?;
        let share = f64::from(raw) / f64::from(model.full_scale);
        efforts.push((model, id, effort(model, share), share.abs() <= 1.0));
    }
    let mut expected = Vec::new();
    for value in vector.list("frames")? {
        expected.push(frame(Fields::of("frames", value)?)?.ok_or("no classic CAN frame")?);
    }
    let sort = |frames: &mut Vec<CanFrame>| frames.sort_by_key(CanFrame::key);
    match vector.optional("order") {
        Some(order) if text(&order)? != "any" => return Err(format!("order {order}")),
        _ => sort(&mut expected),
    }
    let steps = tolerance.steps("slots_raw_i16");
    let mut lanes = batch.frames().to_vec();
    sort(&mut lanes);
    same_frames(&expected, &lanes, steps)?;
    // A motor never asks for more than full scale; a lane takes any number.
    if efforts.len() <= MotorBus::CAPACITY && efforts.iter().all(|&(.., within)| within) {
        let efforts: Vec<_> =
            efforts.into_iter().map(|(m, id, effort, _)| (m, id, effort)).collect();
        let mut frames = driven(&efforts)?;
        sort(&mut frames);
        let compared = same_frames(&expected, &frames, steps);
        compared.map_err(|error| format!("real motors: {error}"))?;
    }
    Ok(())
}

/// The frames of a bus of motors, each of which is given this effort, when their soft start is
/// over.
fn driven(devices: &[(&'static Model, u8, f32)]) -> Check<Vec<CanFrame>> {
    let mut motors = Vec::new();
    let mut feedback = Vec::new();
    for &(model, id, _) in devices {
        motors.push(Dji::new(dji::Config::new(model, id)).map_err(|error| error.to_string())?);
        let own = model.feedback_id(id).map_err(|error| error.to_string())?;
        feedback.push(CanFrame::eight_bytes(own, [0; 8]));
    }
    let switch = ArmSwitch::new();
    switch.arm().map_err(|error| error.to_string())?;
    let mut bus = MotorBus::new(&switch);
    let mut ids = Vec::new();
    for motor in &mut motors {
        ids.push(bus.attach(motor, Safety::COAST).map_err(|error| error.to_string())?);
    }
    let mut batch = TxBatch::new();
    for now in (1..=50).map(Micros::from_millis) {
        for frame in &feedback {
            bus.on_frame(frame, now);
        }
        for (&id, &(model, _, effort)) in ids.iter().zip(devices) {
            let target = match model.effort {
                Effort::Current(_) => Target::Current(Amps::new(effort)),
                Effort::Voltage => Target::Duty(effort),
            };
            bus.command(id, target, now).map_err(|error| error.to_string())?;
        }
        batch.clear();
        bus.tick(now, Seconds::new(0.001), &mut batch).map_err(|error| error.to_string())?;
    }
    Ok(batch.frames().to_vec())
}

/// No motor may take the frame: neither those the vector lists, nor, if it lists none, a motor of
/// any model with any identifier.
fn reject(vector: &mut Fields) -> Check {
    let Some(frame) = frame(vector.object("frame")?)? else {
        return Ok(()); // It cannot even arrive.
    };
    let mut devices = Vec::new();
    if let Some(inputs) = vector.optional("inputs") {
        let mut inputs = Fields::of("inputs", inputs)?;
        for listed in inputs.list("devices")? {
            match device(&listed)? {
                (model, Some(id), None) => devices.push((model, id)),
                _ => return Err(format!("no device of a configuration: {listed}")),
            }
        }
        inputs.finish()?;
    } else {
        for model in [&M3508, &M2006, &GM6020_CURRENT, &GM6020_VOLTAGE] {
            devices.extend((1..=model.last_id).map(|id| (model, id)));
        }
    }
    for (model, id) in devices {
        let mut motor = Dji::new(dji::Config::new(model, id)).map_err(|error| error.to_string())?;
        let mut alone = motor.clone();
        let name = alone.name();
        let switch = ArmSwitch::new();
        let mut bus = MotorBus::new(&switch);
        let id = bus.attach(&mut motor, Safety::COAST).map_err(|error| error.to_string())?;
        let at = Micros::from_millis(1);
        let taken = matches!(bus.on_frame(&frame, at), Dispatch::Motor(_))
            || bus.status(id, at).is_none_or(|status| status.feedback != Feedback::default())
            || alone.unpack_feedback(&frame, at, Link::Online).is_ok()
            || alone.feedback() != Feedback::default();
        same("rejected", !taken, &"an error", &format!("{name} takes {frame}"))?;
    }
    Ok(())
}
