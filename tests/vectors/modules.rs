//! Vectors of the modules on a serial line: protocols `tfmini`, `jrt_laser`, `stp23l`, `wit_imu`,
//! `action` and `rc9`. All go through the stream that finds their frames.

use rc10_module::imu::{Wit, wit};
use rc10_module::positioning::action::{self, Coordinate, Pose};
use rc10_module::positioning::{Action, Rc9, rc9};
use rc10_module::ranging::jrt::{self, Answer, Speed};
use rc10_module::ranging::{Jrt, Stp23l, TfMini, stp23l, tfmini};
use serde_json::{Value, json};

use crate::fields::{Check, Fields, Tolerance, float, narrow, same, unknown};
use crate::streams::{expectations, heard, received, understood};
use crate::unitree::uart;

/// The bytes that `encode` makes of the vector's inputs are those of its frame.
fn encode(vector: &mut Fields, pack: impl Fn(&mut Fields) -> Check<Vec<u8>>) -> Check {
    let mut inputs = vector.object("inputs")?;
    let actual = pack(&mut inputs)?;
    inputs.finish()?;
    let expected = uart(vector.object("frame")?)?;
    same("bytes", expected == actual, &hexadecimal(&expected), &hexadecimal(&actual))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn flag(field: &str, expected: &Value, actual: bool) -> Check {
    same(field, expected.as_bool() == Some(actual), expected, &actual)
}

/// A list of numbers, each with a step of `lsb`.
fn floats(
    field: &str,
    lsb: f64,
    expected: &Value,
    actual: &[f32],
    tolerance: &mut Tolerance,
) -> Check {
    let expected = expected.as_array().ok_or_else(|| format!("`{field}` is no list"))?;
    let count = (expected.len(), actual.len());
    same(field, count.0 == count.1, &count.0, &count.1)?;
    let mut pairs = expected.iter().zip(actual);
    pairs.try_for_each(|(expected, actual)| tolerance.float(field, lsb, expected, *actual))
}

/// A list of whole numbers.
fn integers(
    field: &str,
    expected: &Value,
    actual: impl Iterator<Item = i64>,
    tolerance: &mut Tolerance,
) -> Check {
    let expected = expected.as_array().ok_or_else(|| format!("`{field}` is no list"))?;
    crate::wire::compare(field, expected, &actual.collect::<Vec<_>>(), tolerance)
}

/// One vector of protocol `tfmini`.
pub fn tfmini(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let known = received(TfMini, kind, vector, tolerance, |message, expected, tolerance| {
        let tfmini::Measurement { centimetres, strength, temperature } = *message;
        for (field, value) in &expectations(expected)? {
            match field.as_str() {
                "distance_cm" => tolerance.raw(field, value, centimetres.into())?,
                "distance_mm" => tolerance.raw(field, value, i64::from(centimetres) * 10)?,
                "strength" => tolerance.raw(field, value, strength.into())?,
                "temp_C" => tolerance.float(field, 0.125, value, temperature.get())?,
                "reliable" => flag(field, value, message.is_reliable())?,
                other => return Err(unknown(other)),
            }
        }
        Ok(())
    })?;
    understood(known, kind)
}

/// One vector of protocol `jrt_laser`.
pub fn jrt(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    if kind == "encode" {
        return encode(vector, |inputs| {
            let operation = inputs.text("op")?;
            Ok(jrt_command(&operation)?.pack().to_vec())
        });
    }
    let known = received(Jrt, kind, vector, tolerance, |answer, expected, tolerance| {
        for (field, value) in &expectations(expected)? {
            let actual: i64 = match (field.as_str(), *answer) {
                ("addr", Answer::Result { address, .. } | Answer::Error { address, .. }) => {
                    address.into()
                }
                ("distance_mm", Answer::Result { millimetres, .. }) => millimetres.into(),
                ("signal_quality", Answer::Result { quality, .. }) => quality.into(),
                ("error" | "error_code", Answer::Error { code, .. }) => code.into(),
                (other, _) => return Err(unknown(other)),
            };
            tolerance.raw(field, value, actual)?;
        }
        Ok(())
    })?;
    understood(known, kind)
}

fn jrt_command(operation: &str) -> Check<jrt::Command> {
    let speed = |name| match name {
        "auto" => Ok(Speed::Auto),
        "slow" => Ok(Speed::Slow),
        "fast" => Ok(Speed::Fast),
        other => Err(format!("this runner does not know the speed `{other}`")),
    };
    let words: Vec<_> = operation.split_whitespace().collect();
    Ok(match words.as_slice() {
        ["laser", "on"] => jrt::Command::LaserOn,
        ["laser", "off"] => jrt::Command::LaserOff,
        ["one-shot" | "once", name] => jrt::Command::Once(speed(name)?),
        ["continuous", name] => jrt::Command::Continuously(speed(name)?),
        ["stop"] | ["stop", "continuous"] => jrt::Command::Stop,
        ["read"] | ["read", "result" | "distance" | "measurement"] => jrt::Command::Read,
        _ => return Err(format!("this runner does not know the operation `{operation}`")),
    })
}

/// One vector of protocol `stp23l`.
pub fn stp23l(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let known = received(Stp23l, kind, vector, tolerance, |message, expected, tolerance| {
        let stp23l::Measurement { points, timestamp } = message;
        let points = points.iter();
        for (field, value) in &expectations(expected)? {
            let points = points.clone();
            match field.as_str() {
                "distances_mm" => {
                    let distances = points.map(|point| point.millimetres.into());
                    integers(field, value, distances, tolerance)?;
                }
                "confidence" => {
                    let confidence = points.map(|point| point.confidence.into());
                    integers(field, value, confidence, tolerance)?;
                }
                "noise" => {
                    integers(field, value, points.map(|point| point.noise.into()), tolerance)?;
                }
                "peak" => {
                    integers(field, value, points.map(|point| point.peak.into()), tolerance)?;
                }
                "timestamp" => tolerance.raw(field, value, (*timestamp).into())?,
                other => return Err(unknown(other)),
            }
        }
        Ok(())
    })?;
    understood(known, kind)
}

/// One vector of protocol `wit_imu`.
pub fn wit(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    if kind == "encode" {
        return encode(vector, |inputs| {
            let operation = inputs.text("op")?;
            Ok(wit_command(&operation)?.pack().to_vec())
        });
    }
    let known = received(Wit, kind, vector, tolerance, |message, expected, tolerance| {
        for (field, value) in &expectations(expected)? {
            match (field.as_str(), message) {
                ("acc_g", wit::Message::Acceleration { g, .. }) => {
                    floats(field, 16.0 / 32768.0, value, g, tolerance)?;
                }
                ("temp_C", wit::Message::Acceleration { temperature, .. }) => {
                    tolerance.float(field, 0.01, value, temperature.get())?;
                }
                ("gyro_dps", wit::Message::Rate { degrees_per_second }) => {
                    floats(field, 2000.0 / 32768.0, value, degrees_per_second, tolerance)?;
                }
                ("angle_deg", wit::Message::Angle { roll, pitch, yaw }) => {
                    let angles = [roll, pitch, yaw].map(|angle| angle.get());
                    floats(field, 180.0 / 32768.0, value, &angles, tolerance)?;
                }
                (other, _) => return Err(unknown(other)),
            }
        }
        Ok(())
    })?;
    understood(known, kind)
}

fn wit_command(operation: &str) -> Check<wit::Command> {
    use wit::{Baud, Rate};
    let unknown = || format!("this runner does not know the operation `{operation}`");
    // Text in brackets explains, except a rate.
    let words = operation.split([' ', '(', ')']);
    let words: Vec<_> =
        words.filter(|word| !matches!(*word, "" | "set" | "output" | "return")).collect();
    Ok(match words.as_slice() {
        ["unlock"] => wit::Command::Unlock,
        ["save"] => wit::Command::Save,
        ["z-axis" | "z" | "yaw", "zero"] | ["z-axis" | "z" | "yaw", "zero", "HWT101"] => {
            wit::Command::ZeroYaw
        }
        ["rate", rate] | ["rate", rate, "Hz"] => {
            wit::Command::Rate(match rate.trim_end_matches("Hz") {
                "1" => Rate::Hz1,
                "2" => Rate::Hz2,
                "5" => Rate::Hz5,
                "10" => Rate::Hz10,
                "20" => Rate::Hz20,
                "50" => Rate::Hz50,
                "100" => Rate::Hz100,
                "125" => Rate::Hz125,
                "200" => Rate::Hz200,
                _ => return Err(unknown()),
            })
        }
        ["baud", baud] | ["baud", "rate", baud] => wit::Command::Baud(match *baud {
            "4800" => Baud::B4800,
            "9600" => Baud::B9600,
            "19200" => Baud::B19200,
            "38400" => Baud::B38400,
            "57600" => Baud::B57600,
            "115200" => Baud::B115200,
            "230400" => Baud::B230400,
            "460800" => Baud::B460800,
            "921600" => Baud::B921600,
            _ => return Err(unknown()),
        }),
        _ => return Err(unknown()),
    })
}

/// One vector of protocol `action`.
pub fn action(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    if kind == "encode" {
        return encode(vector, |inputs| {
            let operation = inputs.text("op")?;
            action_command(&operation).map(|bytes| bytes.to_vec())
        });
    }
    let known = received(Action, kind, vector, tolerance, |pose, expected, tolerance| {
        let Pose { yaw, x_angle, y_angle, x, y, yaw_rate } = *pose;
        let [yaw, x_angle, y_angle] = [yaw, x_angle, y_angle].map(|angle| angle.get());
        if expected.is_array() {
            let numbers = [yaw, x_angle, y_angle, x, y, yaw_rate];
            return floats("frames", 0.0, expected, &numbers, tolerance);
        }
        for (field, value) in &expectations(expected)? {
            let actual = match field.as_str() {
                "yaw_deg" => yaw,
                "x_angle_deg" => x_angle,
                "y_angle_deg" => y_angle,
                "pos_x_mm" => x,
                "pos_y_mm" => y,
                "yaw_rate" => yaw_rate,
                other => return Err(unknown(other)),
            };
            tolerance.float(field, 0.0, value, actual)?;
        }
        Ok(())
    })?;
    understood(known, kind)
}

fn action_command(operation: &str) -> Check<[u8; 8]> {
    let words: Vec<_> = operation.split_whitespace().collect();
    let (coordinate, value) = match words.as_slice() {
        ["set", "yaw" | "angle", value] | ["set", "yaw", value, "deg"] => (Coordinate::Yaw, value),
        ["set", "x" | "X", value] | ["set", "x" | "X", value, "mm"] => (Coordinate::X, value),
        ["set", "y" | "Y", value] | ["set", "y" | "Y", value, "mm"] => (Coordinate::Y, value),
        _ => return Err(format!("this runner does not know the operation `{operation}`")),
    };
    let value = value.parse().map_err(|_| format!("no number: {value}"))?;
    action::set(coordinate, value).map_err(|error| error.to_string())
}

/// One vector of protocol `rc9`.
pub fn rc9(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    if kind == "encode" {
        return encode(vector, rc9_frame);
    }
    let known = received(Rc9::default(), kind, vector, tolerance, |frame, expected, tolerance| {
        for (field, value) in &expectations(expected)? {
            match field.as_str() {
                "id" => tolerance.raw(field, value, frame.id().into())?,
                "len" => tolerance.raw(field, value, frame.data().len() as i64)?,
                "floats" => {
                    let numbers = frame.floats().ok_or("its data are no finite numbers")?;
                    floats(field, 0.0, value, &numbers, tolerance)?;
                }
                "bytes" => {
                    integers(field, value, frame.data().iter().map(|&b| b.into()), tolerance)?;
                }
                other => return Err(unknown(other)),
            }
        }
        // Whatever can be received can be sent.
        let packed = frame.pack();
        let (again, _) = heard(Rc9::default(), &packed, packed.len());
        same("sent again", again == [*frame], &json!("the same"), &format!("{again:?}"))
    })?;
    understood(known, kind)
}

fn rc9_frame(inputs: &mut Fields) -> Check<Vec<u8>> {
    let id = narrow(&inputs.take("id")?)?;
    let frame = if let Some(numbers) = inputs.optional("floats") {
        let numbers = numbers.as_array().ok_or("`floats` is no list")?;
        #[expect(clippy::cast_possible_truncation, reason = "the wire has 32 bits")]
        let numbers: Check<Vec<f32>> =
            numbers.iter().map(|number| float(number).map(|number| number as f32)).collect();
        rc9::Frame::of_floats(id, &numbers?)
    } else {
        let data: Check<Vec<u8>> = inputs.list("bytes")?.iter().map(narrow).collect();
        rc9::Frame::new(id, &data?)
    };
    Ok(frame.map_err(|error| error.to_string())?.pack().to_vec())
}
