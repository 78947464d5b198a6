//! Vectors of protocols `unitree_go` (RS-485) and `unitree_can` (CAN-to-485 module). Their
//! physical values are the rotor's; commands are tried through the gearbox as well.

use std::f64::consts::TAU;

use rc10_app::{Gear, NewtonMetres, Rpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_motor::unitree::wire::line::{self, Command, Parser};
use rc10_motor::unitree::wire::module::{self, Content, Module, Request};
use rc10_motor::unitree::wire::{
    Address, GEAR, Impedance, Motion, RawImpedance, RawMotion, RotorScale, Status,
};
use serde_json::{Map, Value};

use crate::fields::{Check, Fields, Tolerance, float, frame, integer, narrow, same, text, unknown};

/// One vector of protocol `unitree_go`.
pub fn line(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    match kind {
        "encode" => encode_line(vector, tolerance),
        "decode" => {
            let reply = received(&uart(vector.object("frame")?)?)?;
            line_values(&reply, vector.object("expect")?.into_expectations()?, tolerance)
        }
        "reject" => {
            let bytes = uart(vector.object("frame")?)?;
            let taken = line::Reply::unpack(&bytes).is_ok() || !parsed(&bytes).is_empty();
            same("rejected", !taken, &"an error", &"an answer")
        }
        "stream" => stream(vector, tolerance),
        "crc" => {
            let mut inputs = vector.object("inputs")?;
            let crc = line::crc(&bytes(&inputs.text("bytes")?)?);
            inputs.finish()?;
            let mut expect = vector.object("expect")?;
            tolerance.raw("crc", &expect.take("crc")?, crc.into())?;
            expect.finish()
        }
        "convert" => convert(vector, tolerance),
        other => Err(format!("this runner does not know the kind `{other}`")),
    }
}

/// One vector of protocol `unitree_can`.
pub fn module(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    match kind {
        "encode" => encode_module(vector, tolerance),
        "decode" => {
            let frame = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
            let reply = module::Reply::unpack(&frame).map_err(|error| error.to_string())?;
            module_values(&reply, vector.object("expect")?.into_expectations()?, tolerance)
        }
        "reject" => {
            let Some(frame) = frame(vector.object("frame")?)? else {
                return Ok(()); // It cannot even arrive.
            };
            let taken = module::Reply::unpack(&frame).is_ok();
            same("rejected", !taken, &"an error", &format!("a reply in {frame}"))
        }
        "id" => id(vector, tolerance),
        "convert" => convert(vector, tolerance),
        other => Err(format!("this runner does not know the kind `{other}`")),
    }
}

pub fn bytes(hexadecimal: &str) -> Check<Vec<u8>> {
    let byte = |pair: &[u8]| {
        let digits = std::str::from_utf8(pair).ok().filter(|digits| digits.len() == 2)?;
        u8::from_str_radix(digits, 16).ok()
    };
    let bytes: Option<_> = hexadecimal.as_bytes().chunks(2).map(byte).collect();
    bytes.ok_or_else(|| format!("no hexadecimal bytes: {hexadecimal}"))
}

/// The bytes of a frame on a UART, RS-485 or not.
pub fn uart(mut fields: Fields) -> Check<Vec<u8>> {
    let bus = fields.text("bus")?;
    if !matches!(bus.as_str(), "uart" | "rs485") {
        return Err(format!("a frame on bus `{bus}`"));
    }
    let data = bytes(&fields.text("data")?)?;
    fields.finish()?;
    Ok(data)
}

/// All that a parser finds.
fn parsed(bytes: &[u8]) -> Vec<line::Reply> {
    let mut parser = Parser::new();
    bytes.iter().filter_map(|&byte| parser.push(byte)).collect()
}

/// The answer these bytes are, alone and in a stream.
fn received(bytes: &[u8]) -> Check<line::Reply> {
    let reply = line::Reply::unpack(bytes).map_err(|error| error.to_string())?;
    let garbage = [&[0xFD, 0xFD, 0xEE, 0x00][..], bytes, bytes].concat();
    let found = parsed(&garbage);
    if found == [reply, reply] { Ok(reply) } else { Err(format!("in a stream: {found:?}")) }
}

fn address(value: &Value) -> Check<Address> {
    let id = narrow(value)?;
    if id == Address::BROADCAST.get() {
        return Ok(Address::BROADCAST);
    }
    Address::new(id).ok_or_else(|| format!("no motor has the address {id}"))
}

fn status(value: &Value) -> Check<Status> {
    match (value.as_str(), value.as_i64()) {
        (Some("lock"), _) | (_, Some(0)) => Ok(Status::LOCK),
        (Some("foc"), _) | (_, Some(1)) => Ok(Status::FOC),
        (Some("calibrate"), _) | (_, Some(2)) => Ok(Status::CALIBRATE),
        _ => Err(format!("no status to be sent: {value}")),
    }
}

/// A rotor's values, as a vector has them.
#[derive(Clone, Copy, Default)]
struct Rotor {
    tau: f64,
    omega: f64,
    theta: f64,
    kp: f64,
    kd: f64,
}

impl Rotor {
    fn take_motion(&mut self, inputs: &mut Fields) -> Check {
        self.tau = float(&inputs.take("tau_Nm")?)?;
        self.omega = float(&inputs.take("omega_rad_s")?)?;
        self.theta = float(&inputs.take("theta_rad")?)?;
        Ok(())
    }

    fn take_gains(&mut self, inputs: &mut Fields) -> Check {
        self.kp = float(&inputs.take("kp")?)?;
        self.kd = float(&inputs.take("kd")?)?;
        Ok(())
    }

    /// The same through a gearbox, in our units.
    fn behind(self, ratio: f64) -> Check<(Motion, Impedance)> {
        if self.theta.is_nan() {
            return Err("an angle that is no number cannot even be asked for".into());
        }
        #[expect(clippy::cast_possible_truncation, reason = "f32 is what these types hold")]
        Ok((
            Motion {
                torque: NewtonMetres::new((self.tau * ratio) as f32),
                speed: Rpm::new((self.omega / ratio * 60.0 / TAU) as f32),
                angle: TotalAngle::from_microdegrees(
                    ((self.theta / ratio).to_degrees() * 1e6).round() as i64,
                ),
            },
            Impedance {
                stiffness: (self.kp * ratio * ratio) as f32,
                damping: (self.kd * ratio * ratio) as f32,
            },
        ))
    }

    /// The values on the wire: asked for at the rotor, and at the output shaft.
    fn raw(self) -> Check<[(RawMotion, RawImpedance); 2]> {
        let raw = |gear: Gear, ratio| {
            let (motion, impedance) = self.behind(ratio)?;
            let shaft = RotorScale::new(gear);
            Ok::<_, String>((shaft.raw(&motion), shaft.raw_impedance(&impedance)))
        };
        Ok([raw(Gear::DIRECT, 1.0)?, raw(GEAR, 6.33)?])
    }
}

/// The raw number of one name.
fn raw_field(field: &str, motion: RawMotion, impedance: RawImpedance) -> Check<i64> {
    match field {
        "tau" => Ok(motion.torque.into()),
        "omega" => Ok(motion.speed.into()),
        "theta" => Ok(motion.angle.into()),
        "kp" => Ok(impedance.stiffness.into()),
        "kd" => Ok(impedance.damping.into()),
        other => Err(unknown(other)),
    }
}

/// Little endian, with sign, read without the codec.
fn little_endian(bytes: &[u8]) -> i64 {
    let top = bytes.last().map_or(0, |top| i64::from(top.cast_signed()));
    let rest = bytes.iter().rev().skip(1);
    rest.fold(top, |value, byte| value << 8 | i64::from(*byte))
}

/// Compares raw numbers with the bytes of a vector: name and bytes of each.
fn same_fields(
    expected: &[(&str, &[u8])],
    motion: RawMotion,
    impedance: RawImpedance,
    tolerance: &mut Tolerance,
) -> Check {
    for (field, bytes) in expected {
        let actual = raw_field(field, motion, impedance)?;
        tolerance.raw(field, &little_endian(bytes).into(), actual)?;
    }
    Ok(())
}

/// Compares raw numbers with `fields_raw` if there is such a thing, and its `crc` with the
/// vector's own bytes.
fn same_raw(
    named: Option<&Map<String, Value>>,
    crc: Option<u16>,
    motion: RawMotion,
    impedance: RawImpedance,
    tolerance: &mut Tolerance,
) -> Check {
    for (field, expected) in named.into_iter().flatten() {
        match (field.as_str(), crc) {
            ("crc", Some(crc)) => {
                same("crc", integer(expected)? == i64::from(crc), expected, &crc)?;
            }
            _ => tolerance.raw(field, expected, raw_field(field, motion, impedance)?)?,
        }
    }
    Ok(())
}

fn named_raw(vector: &mut Fields) -> Check<Option<Map<String, Value>>> {
    let named = vector.optional("fields_raw");
    named.map(|named| Fields::of("fields_raw", named)?.into_expectations()).transpose()
}

fn encode_line(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let address = address(&inputs.take("id")?)?;
    let status = status(&inputs.take("mode")?)?;
    let mut rotor = Rotor::default();
    rotor.take_motion(&mut inputs)?;
    rotor.take_gains(&mut inputs)?;
    inputs.finish()?;
    let expected = uart(vector.object("frame")?)?;
    let expected: [u8; line::COMMAND_LEN] =
        expected.try_into().map_err(|bytes| format!("no command: {bytes:?}"))?;
    let (body, crc) = expected.split_at(15);
    let crc = u16::from_le_bytes([crc[0], crc[1]]);
    same("the vector's own crc", line::crc(body) == crc, &crc, &line::crc(body))?;
    let named = named_raw(vector)?;
    for (motion, impedance) in rotor.raw()? {
        let ours = Command { address, status, motion, impedance }.pack();
        let own = line::crc(&ours[..15]).to_le_bytes();
        same("our crc", own == ours[15..], &format!("{own:?}"), &format!("{ours:?}"))?;
        let heads = (format!("{:02X?}", &body[..3]), format!("{:02X?}", &ours[..3]));
        same("head and mode", heads.0 == heads.1, &heads.0, &heads.1)?;
        let ranges = [("tau", 3..5), ("omega", 5..7), ("theta", 7..11), ("kp", 11..13)];
        let mut exact = true;
        for (field, range) in ranges.into_iter().chain([("kd", 13..15)]) {
            let wanted = little_endian(&expected[range.clone()]).into();
            tolerance.raw(field, &wanted, little_endian(&ours[range.clone()]))?;
            exact &= expected[range.clone()] == ours[range];
        }
        same_raw(named.as_ref(), Some(crc), motion, impedance, tolerance)?;
        same("bytes", !exact || ours == expected, &"the vector's", &format!("{ours:02X?}"))?;
    }
    Ok(())
}

/// The values of a reply on the line: those that the vector lists.
fn line_values(
    reply: &line::Reply,
    expected: Map<String, Value>,
    tolerance: &mut Tolerance,
) -> Check {
    for (field, expected) in &expected {
        match field.as_str() {
            "id" | "motor" => tolerance.raw(field, expected, reply.address.get().into())?,
            "mode" | "status" => tolerance.raw(field, expected, reply.status.get().into())?,
            "temp_C" => tolerance.float(field, 1.0, expected, reply.temperature.get())?,
            "merror" | "error" => {
                tolerance.raw(field, expected, reply.error.into())?;
                let code = reply.fault().map_or(0, |fault| fault.code);
                same(field, code == u32::from(reply.error), &reply.error, &code)?;
            }
            "foot_force" => tolerance.raw(field, expected, reply.foot_force.into())?,
            field => {
                value(field, reply.motion, RawImpedance::default(), expected, tolerance)?;
                if field.starts_with('k') {
                    return Err(format!("an answer on the line has no `{field}`"));
                }
            }
        }
    }
    Ok(())
}

/// A field of motion or gains, raw or physical, at the rotor; and whether the output shaft's
/// value is the same through the gearbox.
fn value(
    field: &str,
    motion: RawMotion,
    gains: RawImpedance,
    expected: &Value,
    tolerance: &mut Tolerance,
) -> Check {
    if let Some(name) = field.strip_suffix("_raw") {
        return tolerance.raw(field, expected, raw_field(name, motion, gains)?);
    }
    for (gear, ratio) in [(Gear::DIRECT, 1.0), (GEAR, 6.33_f32)] {
        let shaft = RotorScale::new(gear);
        let (moved, impedance) = (shaft.motion(motion), shaft.impedance(gains));
        let (lsb, actual) = match field {
            "tau_Nm" => (1.0 / 256.0, moved.torque.get() / ratio),
            "omega_rad_s" => {
                (TAU / 256.0, moved.speed.get() * ratio * (std::f32::consts::TAU / 60.0))
            }
            "theta_rad" => {
                // An f32 of an angle of many turns is only as good as f32 is.
                let degrees = moved.angle.degrees().get();
                (TAU / 32768.0, degrees.to_radians() * ratio)
            }
            "kp" => (1.0 / 1280.0, impedance.stiffness / (ratio * ratio)),
            "kd" => (1.0 / 1280.0, impedance.damping / (ratio * ratio)),
            other => return Err(unknown(other)),
        };
        tolerance.float(field, lsb, expected, actual)?;
    }
    Ok(())
}

fn stream(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let found = parsed(&bytes(&inputs.text("bytes")?)?);
    inputs.finish()?;
    let mut expect = vector.object("expect")?;
    let frames = expect.list("frames")?;
    expect.finish()?;
    same("frames", frames.len() == found.len(), &frames.len(), &found.len())?;
    for (reply, frame) in found.iter().zip(frames) {
        line_values(reply, Fields::of("frame", frame)?.into_expectations()?, tolerance)?;
    }
    Ok(())
}

/// The number in an operation's name: "control (mode 10)".
fn operation(inputs: &mut Fields) -> Check<String> {
    let op = inputs.text("op")?;
    let (name, mode) = op.split_once(" (mode ").unwrap_or((&op, ""));
    let number = match name {
        "control" => "10",
        "set_gains" => "11",
        "read_gains" => "12",
        "control without reply" | "control_no_reply" => "13",
        other => return Err(format!("this runner does not know the operation `{other}`")),
    };
    let mode = mode.strip_suffix(')').unwrap_or(mode);
    same("mode", mode.is_empty() || mode == number, &mode, &number)?;
    Ok(number.into())
}

/// A vector's request to a module, at the rotor and at the output shaft.
fn requests(inputs: &mut Fields, operation: &str) -> Check<Vec<Request>> {
    let mut rotor = Rotor::default();
    let mut asked = None;
    match operation {
        "10" | "13" => {
            asked = Some(status(&inputs.take("status")?)?);
            rotor.take_motion(inputs)?;
        }
        "11" => rotor.take_gains(inputs)?,
        _ => {}
    }
    let request = |(motion, impedance)| match (operation, asked) {
        ("10", Some(status)) => Request::Control(status, motion),
        ("13", Some(status)) => Request::ControlUnanswered(status, motion),
        ("11", _) => Request::SetImpedance(impedance),
        _ => Request::ReadImpedance,
    };
    Ok(rotor.raw()?.map(request).into())
}

fn whom(inputs: &mut Fields) -> Check<(Module, Address)> {
    let module: u8 = narrow(&inputs.take("module")?)?;
    let module = Module::new(module).ok_or_else(|| format!("there is no module {module}"))?;
    Ok((module, address(&inputs.take("motor")?)?))
}

fn encode_module(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let operation = operation(&mut inputs)?;
    let (module, address) = whom(&mut inputs)?;
    let requests = requests(&mut inputs, &operation)?;
    inputs.finish()?;
    let expected = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    let data = *expected.all_eight().ok_or("a request has eight bytes")?;
    let named = named_raw(vector)?;
    for request in requests {
        let ours = request.pack(module, address);
        let ids = (ours.raw_id(), ours.len(), ours.is_extended_id());
        let wanted = (expected.raw_id(), expected.len(), expected.is_extended_id());
        same("frame", ids == wanted, &expected, &ours)?;
        match request {
            Request::Control(_, motion) | Request::ControlUnanswered(_, motion) => {
                let fields = [("theta", &data[..4]), ("omega", &data[4..6]), ("tau", &data[6..])];
                same_fields(&fields, motion, RawImpedance::default(), tolerance)?;
                same_raw(named.as_ref(), None, motion, RawImpedance::default(), tolerance)?;
                same_module_bytes(&fields, motion, RawImpedance::default(), &expected, &ours)?;
            }
            Request::SetImpedance(gains) => {
                let fields = [("kd", &data[..2]), ("kp", &data[2..4])];
                same_fields(&fields, RawMotion::default(), gains, tolerance)?;
                same_raw(named.as_ref(), None, RawMotion::default(), gains, tolerance)?;
                same("rest", data[4..] == ours.bytes()[4..], &expected, &ours)?;
                same_module_bytes(&fields, RawMotion::default(), gains, &expected, &ours)?;
            }
            Request::ReadImpedance => {
                same("frame", ours == expected, &expected, &ours)?;
                let none = (RawMotion::default(), RawImpedance::default());
                same_raw(named.as_ref(), None, none.0, none.1, tolerance)?;
            }
        }
    }
    Ok(())
}

/// Bytes are the vector's where every number is.
fn same_module_bytes(
    fields: &[(&str, &[u8])],
    motion: RawMotion,
    impedance: RawImpedance,
    expected: &CanFrame,
    ours: &CanFrame,
) -> Check {
    let mut exact = true;
    for (field, bytes) in fields {
        exact &= raw_field(field, motion, impedance)? == little_endian(bytes);
    }
    same("bytes", !exact || ours == expected, expected, ours)
}

/// The values of a module's reply: those that the vector lists.
fn module_values(
    reply: &module::Reply,
    expected: Map<String, Value>,
    tolerance: &mut Tolerance,
) -> Check {
    let (kind, status, error, temperature) = match reply.content {
        Content::State { status, temperature, .. } => {
            ("state", Some(status), None, Some(temperature))
        }
        Content::Fault { status, error, .. } => ("fault", Some(status), Some(error), None),
        Content::Impedance(_) => ("gains", None, None, None),
    };
    for (field, expected) in &expected {
        match (field.as_str(), reply.content) {
            ("module", _) => tolerance.raw(field, expected, reply.module.get().into())?,
            ("motor" | "id", _) => tolerance.raw(field, expected, reply.address.get().into())?,
            ("reply", _) => same(field, text(expected)? == kind, expected, &kind)?,
            ("status" | "mode", _) => {
                let status = status.ok_or("this reply has no status")?;
                tolerance.raw(field, expected, status.get().into())?;
            }
            ("temp_C", _) => match temperature {
                Some(celsius) => tolerance.float(field, 1.0, expected, celsius.get())?,
                None => same(field, expected.is_null(), expected, &"nothing")?,
            },
            ("error" | "error_code" | "merror", _) => match error {
                Some(error) => {
                    tolerance.raw(field, expected, error.into())?;
                    same(field, reply.fault().is_some(), expected, &"no fault")?;
                }
                None => same(field, expected.is_null(), expected, &"nothing")?,
            },
            ("raw_id", Content::Fault { raw_id, .. }) => {
                tolerance.raw(field, expected, raw_id.into())?;
            }
            ("air_pressure_8bit" | "air_pressure", Content::State { air_pressure, .. }) => {
                tolerance.raw(field, expected, air_pressure.into())?;
            }
            (field, Content::State { motion, .. }) if !field.starts_with('k') => {
                value(field, motion, RawImpedance::default(), expected, tolerance)?;
            }
            (field, Content::Impedance(gains)) if field.starts_with('k') => {
                value(field, RawMotion::default(), gains, expected, tolerance)?;
            }
            (other, _) => return Err(unknown(other)),
        }
    }
    Ok(())
}

/// The identifier of a request.
fn id(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let operation = operation(&mut inputs)?;
    let (module, address) = whom(&mut inputs)?;
    let status = inputs.optional("status").map_or(Ok(Status::LOCK), |value| status(&value))?;
    inputs.finish()?;
    let request = match operation.as_str() {
        "10" => Request::Control(status, RawMotion::default()),
        "11" => Request::SetImpedance(RawImpedance::default()),
        "12" => Request::ReadImpedance,
        _ => Request::ControlUnanswered(status, RawMotion::default()),
    };
    let mut expect = vector.object("expect")?;
    let frame = request.pack(module, address);
    same("extended", frame.is_extended_id(), &"an extended identifier", &frame)?;
    tolerance.raw("ext_id", &expect.take("ext_id")?, frame.raw_id().into())?;
    expect.finish()
}

/// Through the gearbox: `tau_out_Nm`, `omega_out_rad_s`, `theta_out_rad`, `kp_out`, `kd_out` to
/// `tau_raw` or `tau_rotor_Nm` and so on.
fn convert(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    const RATIO: f64 = 6.33;
    let mut inputs = vector.object("inputs")?;
    let expected = vector.object("expect")?.into_expectations()?;
    let mut number = |field: &str, to_rotor: f64| {
        let value = inputs.optional(field);
        value.map_or(Ok(0.0), |value| Ok::<_, String>(float(&value)? * to_rotor))
    };
    let rotor = Rotor {
        tau: number("tau_out_Nm", 1.0 / RATIO)?,
        omega: number("omega_out_rad_s", RATIO)?,
        theta: number("theta_out_rad", RATIO)?,
        kp: number("kp_out", 1.0 / (RATIO * RATIO))?,
        kd: number("kd_out", 1.0 / (RATIO * RATIO))?,
    };
    inputs.finish()?;
    let [_, (motion, impedance)] = rotor.raw()?;
    for (field, expected) in &expected {
        let at_rotor = field.replace("_rotor", "");
        value(&at_rotor, motion, impedance, expected, tolerance)?;
    }
    Ok(())
}
