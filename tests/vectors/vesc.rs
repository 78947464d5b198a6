//! Vectors of protocol `vesc`, through the codec.

use std::num::NonZeroU8;

use rc10_app::{Amps, Degrees, Gear, Rpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_motor::vesc::{
    Address, Command, ElectricalRpm, ElectricalScale, Packet, Reply, Setting, Status, VescId,
    coast, ping, shutdown,
};
use serde_json::{Value, json};

use crate::fields::{Check, Fields, Tolerance, float, frame, integer, narrow, same, text, unknown};

/// One vector of protocol `vesc`.
pub fn run(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    match kind {
        "encode" => encode(vector, tolerance),
        "decode" => decode(vector, tolerance),
        "convert" | "rule" => convert(vector, tolerance),
        "id" => id(vector),
        "config" => config(vector),
        "reject" => reject(vector),
        other => Err(format!("this runner does not know the kind `{other}`")),
    }
}

/// Name of a command here, name of its number, and the command.
type OneNumber = (&'static str, &'static str, fn(f32) -> Command);

const COMMANDS: [OneNumber; 9] = [
    ("set_duty", "duty", Command::Duty),
    ("set_current", "A", |amps| Command::Current(Amps::new(amps))),
    ("set_brake", "A", |amps| Command::Brake(Amps::new(amps))),
    ("set_rpm", "erpm", |erpm| Command::Speed(ElectricalRpm::new(erpm))),
    ("set_pos", "deg", |degrees| Command::Position(Degrees::new(degrees))),
    ("set_current_rel", "rel", Command::RelativeCurrent),
    ("set_brake_rel", "rel", Command::RelativeBrake),
    ("set_handbrake", "A", |amps| Command::Handbrake(Amps::new(amps))),
    ("set_handbrake_rel", "rel", Command::RelativeHandbrake),
];

/// The same for settings, whose names may also end in `_store`.
type TwoNumbers = (&'static str, [&'static str; 2], fn([f32; 2]) -> Setting);

const SETTINGS: [TwoNumbers; 4] = [
    ("conf_limits", ["min_A", "max_A"], |[min, max]| Setting::MotorCurrent {
        min: Amps::new(min),
        max: Amps::new(max),
    }),
    ("conf_limits_in", ["min_A", "max_A"], |[min, max]| Setting::InputCurrent {
        min: Amps::new(min),
        max: Amps::new(max),
    }),
    ("conf_foc_erpms", ["openloop_rpm", "sensorless_erpm"], |[openloop, sensorless]| {
        Setting::FieldOriented {
            openloop: ElectricalRpm::new(openloop),
            sensorless: ElectricalRpm::new(sensorless),
        }
    }),
    ("conf_battery_cut", ["start_V", "end_V"], |[start, end]| Setting::BatteryCut { start, end }),
];

#[expect(clippy::cast_possible_truncation, reason = "f32 is what commands are made of")]
fn number(inputs: &mut Fields, field: &str) -> Check<f32> {
    Ok(float(&inputs.take(field)?)? as f32)
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is what speeds are made of")]
fn optional_number(inputs: &mut Fields, field: &str) -> Check<Option<f32>> {
    inputs.optional(field).map(|value| Ok(float(&value)? as f32)).transpose()
}

/// Reads a VESC's own id; 255 is invalid.
fn vesc(value: &Value) -> Check<VescId> {
    VescId::new(narrow(value)?).ok_or_else(|| format!("no VESC has the id {value}"))
}

fn address(inputs: &mut Fields) -> Check<Address> {
    let value = inputs.take("vesc_id")?;
    Ok(if integer(&value)? == 255 { Address::Every } else { vesc(&value)?.into() })
}

/// The frame of a command, and the name of its number if it has one.
fn encoded(name: &str, inputs: &mut Fields) -> Check<(CanFrame, Option<&'static str>)> {
    if name == "ping" {
        let (target, sender) = (inputs.take("target")?, inputs.take("sender")?);
        return Ok((ping(vesc(&target)?, vesc(&sender)?), None));
    }
    let to = address(inputs)?;
    if name == "shutdown" {
        return Ok((shutdown(to), None));
    }
    if let Some((_, field, command)) = COMMANDS.iter().find(|(known, ..)| *known == name) {
        let command = command(number(inputs, field)?);
        // A value that is not a number must leave the motor free, whatever was wanted.
        return Ok((command.pack(to).unwrap_or_else(|_| coast(to)), Some(field)));
    }
    let (stem, store) = name.strip_suffix("_store").map_or((name, false), |stem| (stem, true));
    let known = SETTINGS.iter().find(|(known, ..)| *known == stem);
    let (_, fields, setting) =
        known.ok_or_else(|| format!("this runner does not know the command `{name}`"))?;
    let setting = setting([number(inputs, fields[0])?, number(inputs, fields[1])?]);
    let frame = if store { setting.pack_store(to) } else { setting.pack(to) };
    Ok((frame.map_err(|error| error.to_string())?, None))
}

fn encode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let (sent, field) = encoded(&inputs.text("cmd")?, &mut inputs)?;
    inputs.finish()?;
    let expected = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    let mut steps = tolerance.steps("raw_i32");
    if let Some(field) = field {
        steps = steps.max(tolerance.steps(field));
    }
    let near = expected.key() == sent.key()
        && expected.len() == sent.len()
        && expected.bytes().chunks(4).zip(sent.bytes().chunks(4)).all(|(wanted, raw)| {
            match (wanted.try_into(), raw.try_into()) {
                (Ok(wanted), Ok(raw)) => {
                    i32::from_be_bytes(wanted).abs_diff(i32::from_be_bytes(raw)) <= steps
                }
                _ => wanted == raw,
            }
        });
    same("frame", near, &expected, &sent)?;
    if let Some(wanted) = vector.optional("raw_i32") {
        let raw = raw_i32(&sent).ok_or("this frame is not one number")?;
        tolerance.raw("raw_i32", &wanted, raw.into())?;
    }
    Ok(())
}

/// The number of a frame of four bytes.
fn raw_i32(frame: &CanFrame) -> Option<i32> {
    frame.bytes().try_into().ok().map(i32::from_be_bytes)
}

fn decode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let frame = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    let reply = Reply::unpack(&frame).map_err(|error| error.to_string())?;
    for (field, expected) in vector.object("expect")?.into_expectations()? {
        match (field.as_str(), reply) {
            ("packet", _) => {
                let actual = name(reply);
                same("packet", expected.as_str() == Some(actual), &expected, &actual)?;
            }
            ("vesc_id", Reply::Status { from: id, .. })
            | ("responder", Reply::Pong { from: id, .. })
            | ("addressed_to", Reply::Pong { to: id, .. }) => {
                tolerance.raw(&field, &expected, id.get().into())?;
            }
            ("hw_type", Reply::Pong { hardware, .. }) => {
                tolerance.raw(&field, &expected, hardware.into())?;
            }
            (_, Reply::Status { status, .. }) => value(status, &field, &expected, tolerance)?,
            (other, _) => return Err(unknown(other)),
        }
    }
    Ok(())
}

fn name(reply: Reply) -> &'static str {
    match reply {
        Reply::Pong { .. } => "PONG",
        Reply::Status { status, .. } => match status {
            Status::Motion { .. } => "STATUS",
            Status::AmpHours { .. } => "STATUS_2",
            Status::WattHours { .. } => "STATUS_3",
            Status::Temperatures { .. } => "STATUS_4",
            Status::Tachometer { .. } => "STATUS_5",
            Status::Inputs { .. } => "STATUS_6",
        },
    }
}

/// One physical value of a status.
fn value(status: Status, field: &str, expected: &Value, tolerance: &mut Tolerance) -> Check {
    let (lsb, actual) = match (field, status) {
        ("erpm", Status::Motion { speed, .. }) => {
            #[expect(clippy::cast_possible_truncation, reason = "it was an i32")]
            let erpm = speed.get() as i64;
            return tolerance.raw(field, expected, erpm);
        }
        ("tacho", Status::Tachometer { steps, .. }) => {
            return tolerance.raw(field, expected, steps.into());
        }
        ("electrical_revs", Status::Tachometer { steps, .. }) => {
            (1.0 / 6.0, turns(&scale(1, Gear::DIRECT)?, steps))
        }
        ("current_A", Status::Motion { current, .. }) => (0.1, current.get()),
        ("duty", Status::Motion { duty, .. }) => (1e-3, duty),
        ("amp_hours", Status::AmpHours { used, .. })
        | ("watt_hours", Status::WattHours { used, .. }) => (1e-4, used),
        ("amp_hours_charged", Status::AmpHours { charged, .. })
        | ("watt_hours_charged", Status::WattHours { charged, .. }) => (1e-4, charged),
        ("temp_fet_C", Status::Temperatures { transistors, .. }) => (0.1, transistors.get()),
        ("temp_motor_C", Status::Temperatures { motor, .. }) => (0.1, motor.get()),
        ("current_in_A", Status::Temperatures { input_current, .. }) => (0.1, input_current.get()),
        ("pid_pos_deg", Status::Temperatures { position, .. }) => (0.02, position.get()),
        ("v_in", Status::Tachometer { volts, .. }) => (0.1, volts),
        ("adc1_V", Status::Inputs { analogue: [volts, ..], .. })
        | ("adc2_V", Status::Inputs { analogue: [_, volts, _], .. })
        | ("adc3_V", Status::Inputs { analogue: [.., volts], .. }) => (1e-3, volts),
        ("ppm", Status::Inputs { ppm, .. }) => (1e-3, ppm),
        (other, _) => return Err(unknown(other)),
    };
    tolerance.float(field, lsb, expected, actual)
}

fn scale(pole_pairs: u8, gear: Gear) -> Check<ElectricalScale> {
    Ok(ElectricalScale::new(NonZeroU8::new(pole_pairs).ok_or("a motor without poles")?, gear))
}

/// Turns of the output shaft.
fn turns(scale: &ElectricalScale, steps: i32) -> f32 {
    TotalAngle::from_counts(steps.into(), scale.steps_per_turn()).degrees().get() / 360.0
}

/// Conversions of commands, or of speeds and angles to the other side of the gearbox.
fn convert(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let expected = vector.object("expect")?.into_expectations()?;
    if let Some(name) = inputs.optional("cmd") {
        let name = text(&name)?;
        let mut frames = Vec::new();
        if inputs.optional("any") == Some(true.into()) {
            for value in [0.0, 1.5, -1e3, 1e20] {
                frames.push(encoded(&name, &mut all_inputs(value)?)?.0);
            }
        } else {
            frames.push(encoded(&name, &mut inputs)?.0);
        }
        inputs.finish()?;
        for frame in frames {
            for (field, expected) in &expected {
                let actual = match field.as_str() {
                    "dlc" => i64::try_from(frame.len()).map_err(|error| error.to_string())?,
                    "ext_id" => frame.raw_id().into(),
                    "raw_i32" => raw_i32(&frame).ok_or("this frame is not one number")?.into(),
                    other => return Err(unknown(other)),
                };
                tolerance.raw(field, expected, actual)?;
            }
        }
        return Ok(());
    }
    let mut scale = scale(narrow(&inputs.take("pole_pairs")?)?, gear(&mut inputs)?)?;
    if let Some(minimum) = optional_number(&mut inputs, "min_erpm")? {
        scale = scale.with_minimum(ElectricalRpm::new(minimum));
    }
    let rpm = optional_number(&mut inputs, "mech_rpm")?.map(Rpm::new);
    let erpm = optional_number(&mut inputs, "erpm")?.map(ElectricalRpm::new);
    let steps = inputs.optional("tacho").map(|steps| narrow(&steps)).transpose()?;
    inputs.finish()?;
    for (field, expected) in &expected {
        let (lsb, actual) = match (field.as_str(), rpm, erpm, steps) {
            ("erpm", Some(rpm), None, None) => (1.0, scale.to_electrical(rpm).get()),
            ("regulated", Some(rpm), None, None) => {
                let actual = scale.regulates(rpm);
                same(field, *expected == Value::Bool(actual), expected, &actual)?;
                continue;
            }
            ("mech_rpm", None, Some(erpm), None) => {
                (scale.to_output(ElectricalRpm::new(1.0)).get(), scale.to_output(erpm).get())
            }
            ("mech_turns", None, None, Some(steps)) => (turns(&scale, 1), turns(&scale, steps)),
            ("mech_deg", None, None, Some(steps)) => {
                (360.0 * turns(&scale, 1), 360.0 * turns(&scale, steps))
            }
            (other, ..) => return Err(unknown(other)),
        };
        tolerance.float(field, lsb.into(), expected, actual)?;
    }
    Ok(())
}

/// Everything that any command needs, with this value.
fn all_inputs(value: f64) -> Check<Fields> {
    let mut all = json!({ "vesc_id": 1, "target": 1, "sender": 2 });
    let fields = COMMANDS.iter().map(|(_, field, _)| *field);
    for field in fields.chain(SETTINGS.iter().flat_map(|(_, fields, _)| *fields)) {
        all[field] = value.into();
    }
    Fields::of("inputs", all)
}

/// Whole turns of the rotor for one or more of the output.
fn gear(inputs: &mut Fields) -> Check<Gear> {
    let Some(teeth) = inputs.optional("gear") else { return Ok(Gear::DIRECT) };
    let gear = match teeth.as_array().map(Vec::as_slice) {
        Some([rotor, output]) => Gear::new(narrow(rotor)?, narrow(output)?),
        _ => Gear::new(narrow(&teeth)?, 1),
    };
    gear.ok_or_else(|| format!("no gear: {teeth}"))
}

fn id(vector: &mut Fields) -> Check {
    let mut inputs = vector.object("inputs")?;
    let name = inputs.text("packet")?;
    let packet = (0..=255).filter_map(Packet::from_number).find(|packet| packet.name() == name);
    let packet = packet.ok_or_else(|| format!("this runner does not know the packet `{name}`"))?;
    let actual = packet.id(address(&mut inputs)?).as_raw();
    inputs.finish()?;
    let mut expect = vector.object("expect")?;
    let expected = expect.integer("ext_id")?;
    expect.finish()?;
    same("ext_id", expected == i64::from(actual), &expected, &actual)
}

/// Whether a VESC can be set to an id.
fn config(vector: &mut Fields) -> Check {
    let mut inputs = vector.object("inputs")?;
    let id = inputs.take("vesc_id")?;
    inputs.finish()?;
    let mut expect = vector.object("expect")?;
    let accepted = expect.flag("accepted")?;
    expect.finish()?;
    same("accepted", vesc(&id).is_ok() == accepted, &accepted, &!accepted)
}

/// A frame that no VESC, or only another than that of the inputs, may have sent.
fn reject(vector: &mut Fields) -> Check {
    let id = match vector.optional("inputs") {
        None => None,
        Some(inputs) => {
            let mut inputs = Fields::of("inputs", inputs)?;
            let id = vesc(&inputs.take("vesc_id")?)?;
            inputs.finish()?;
            Some(id)
        }
    };
    let Some(frame) = frame(vector.object("frame")?)? else {
        return Ok(()); // It cannot even arrive.
    };
    let from = match Reply::unpack(&frame) {
        Err(_) => return Ok(()),
        Ok(Reply::Status { from, .. } | Reply::Pong { from, .. }) => from,
    };
    let taken = id.is_none_or(|id| id == from);
    same("rejected", !taken, &"an error", &format!("{frame} is taken"))
}
