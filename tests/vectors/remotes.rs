//! Vectors of remote controls: protocols `dbus`, `sbus`, `crsf`, `vt03` and `ppm`.

use rc10_module::remote::{
    Crsf, CrsfFrame, Dbus, DbusFrame, Ppm, Sbus, SbusFrame, Switch, Vt03, Vt03Frame, pulse_width,
};
use rc10_time::Micros;
use serde_json::Value;

use crate::fields::{Check, Fields, Tolerance, integer, narrow, same, unknown};
use crate::streams::{expectations, in_order, received, understood};
use crate::wire::compare;

/// One vector of protocol `dbus`.
pub fn dbus(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    understood(received(Dbus, kind, vector, tolerance, dbus_values)?, kind)
}

/// One vector of protocol `sbus`.
pub fn sbus(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    match kind {
        "convert" => convert(vector, tolerance),
        _ => understood(received(Sbus, kind, vector, tolerance, sbus_values)?, kind),
    }
}

/// One vector of protocol `crsf`.
pub fn crsf(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    match kind {
        "convert" => convert(vector, tolerance),
        _ => understood(received(Crsf, kind, vector, tolerance, crsf_values)?, kind),
    }
}

/// One vector of protocol `vt03`.
pub fn vt03(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    understood(received(Vt03, kind, vector, tolerance, vt03_values)?, kind)
}

/// One vector of protocol `ppm`: what comes of edges, all frames or the only one.
pub fn ppm(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    if !matches!(kind, "sequence" | "stream") {
        return understood(false, kind);
    }
    let mut inputs = vector.object("inputs")?;
    let (mut ppm, mut at, mut heard) = (Ppm::default(), 0, Vec::new());
    ppm.edge(Micros::ZERO);
    for interval in inputs.list("edge_intervals_us")? {
        at += narrow::<u64>(&interval)?;
        heard.extend(ppm.edge(Micros::new(at)));
    }
    inputs.finish()?;
    let mut expect = vector.object("expect")?;
    let expected = match expect.optional("frames") {
        Some(Value::Array(frames)) => frames,
        Some(other) => return Err(format!("`frames` is no list: {other}")),
        None => match expect.take("frame")? {
            Value::Null => Vec::new(),
            frame => vec![frame],
        },
    };
    expect.finish()?;
    in_order(&expected, &heard, tolerance, |channels, expected, tolerance| {
        let expected = expected.as_array().ok_or("a frame that is no list")?;
        compare("frame", expected, &channels.map(i64::from), tolerance)
    })
}

/// The pulse a raw channel stands for.
fn convert(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let raw = narrow(&inputs.take("raw")?)?;
    inputs.finish()?;
    let mut expect = vector.object("expect")?;
    tolerance.float("us", 0.625, &expect.take("us")?, pulse_width(raw))?;
    expect.finish()
}

/// A flag, as true or false or as 1 or 0.
fn flag(field: &str, expected: &Value, actual: bool) -> Check {
    let wanted = match expected {
        Value::Bool(wanted) => *wanted,
        number => match integer(number)? {
            0 => false,
            1 => true,
            other => return Err(format!("`{field}` is no flag: {other}")),
        },
    };
    same(field, wanted == actual, expected, &actual)
}

fn list(field: &str, expected: &Value, actual: &[i64], tolerance: &mut Tolerance) -> Check {
    let expected = expected.as_array().ok_or_else(|| format!("`{field}` is no list"))?;
    compare(field, expected, actual, tolerance)
}

/// DJI's number of a position.
const fn position(switch: Switch) -> i64 {
    match switch {
        Switch::Up => 1,
        Switch::Down => 2,
        Switch::Middle => 3,
    }
}

/// Channels without their middle, as DJI's code has them.
fn dbus_values(frame: &DbusFrame, expected: &Value, tolerance: &mut Tolerance) -> Check {
    let centred = |raw: u16| i64::from(raw) - 1024;
    let [right_x, right_y, left_x, left_y] = frame.channels.map(centred);
    for (field, value) in expectations(expected)? {
        let actual = match field.as_str() {
            "ch0_right_h" => right_x,
            "ch1_right_v" => right_y,
            "ch2_left_h" => left_x,
            "ch3_left_v" => left_y,
            "wheel" => centred(frame.wheel),
            "switch_right_bits5_4" => position(frame.right_switch),
            "switch_left_bits7_6" => position(frame.left_switch),
            "keys_u16" => frame.keys.into(),
            "mouse" => {
                let [x, y, z] = frame.mouse.motion.map(i64::from);
                for (field, value) in Fields::of("mouse", value)?.into_expectations()? {
                    match field.as_str() {
                        "x" => tolerance.raw(&field, &value, x)?,
                        "y" => tolerance.raw(&field, &value, y)?,
                        "z" => tolerance.raw(&field, &value, z)?,
                        "left" => flag(&field, &value, frame.mouse.left)?,
                        "right" => flag(&field, &value, frame.mouse.right)?,
                        other => return Err(unknown(other)),
                    }
                }
                continue;
            }
            other => return Err(unknown(other)),
        };
        tolerance.raw(&field, &value, actual)?;
    }
    Ok(())
}

fn sbus_values(frame: &SbusFrame, expected: &Value, tolerance: &mut Tolerance) -> Check {
    for (field, value) in expectations(expected)? {
        match field.as_str() {
            "channels" => list(&field, &value, &frame.channels.map(i64::from), tolerance)?,
            "ch17" => flag(&field, &value, frame.digital[0])?,
            "ch18" => flag(&field, &value, frame.digital[1])?,
            "frame_lost" => flag(&field, &value, frame.frame_lost)?,
            "failsafe" => flag(&field, &value, frame.failsafe)?,
            other => return Err(unknown(other)),
        }
    }
    Ok(())
}

fn crsf_values(frame: &CrsfFrame, expected: &Value, tolerance: &mut Tolerance) -> Check {
    for (field, value) in expectations(expected)? {
        let actual = match (field.as_str(), frame) {
            ("type", CrsfFrame::Channels(_)) => 0x16,
            ("type", CrsfFrame::Link(_)) => 0x14,
            ("channels", CrsfFrame::Channels(channels)) => {
                list(&field, &value, &channels.map(i64::from), tolerance)?;
                continue;
            }
            ("uplink_rssi1_dBm", CrsfFrame::Link(link)) => link.uplink_rssi[0].into(),
            ("uplink_rssi2_dBm", CrsfFrame::Link(link)) => link.uplink_rssi[1].into(),
            ("uplink_lq", CrsfFrame::Link(link)) => link.uplink_quality.into(),
            ("uplink_snr", CrsfFrame::Link(link)) => link.uplink_snr.into(),
            ("antenna", CrsfFrame::Link(link)) => link.antenna.into(),
            ("rf_mode", CrsfFrame::Link(link)) => link.rf_mode.into(),
            ("tx_power_enum", CrsfFrame::Link(link)) => link.transmit_power.into(),
            ("downlink_rssi_dBm", CrsfFrame::Link(link)) => link.downlink_rssi.into(),
            ("downlink_lq", CrsfFrame::Link(link)) => link.downlink_quality.into(),
            ("downlink_snr", CrsfFrame::Link(link)) => link.downlink_snr.into(),
            (other, _) => return Err(unknown(other)),
        };
        tolerance.raw(&field, &value, actual)?;
    }
    Ok(())
}

fn vt03_values(frame: &Vt03Frame, expected: &Value, tolerance: &mut Tolerance) -> Check {
    let [left, right, middle] = frame.mouse_buttons.map(i64::from);
    for (field, value) in expectations(expected)? {
        let actual = match field.as_str() {
            "ch" => {
                list(&field, &value, &frame.channels.map(i64::from), tolerance)?;
                continue;
            }
            "mouse" => {
                list(&field, &value, &frame.mouse_motion.map(i64::from), tolerance)?;
                continue;
            }
            "mode" => match frame.mode {
                Switch::Down => 0,
                Switch::Middle => 1,
                Switch::Up => 2,
            },
            "pause" => frame.pause.into(),
            "fn1" => frame.left_button.into(),
            "fn2" => frame.right_button.into(),
            "wheel" => frame.wheel.into(),
            "trigger" => frame.trigger.into(),
            "mouse_l" => left,
            "mouse_r" => right,
            "mouse_m" => middle,
            "keys_u16" => frame.keys.into(),
            other => return Err(unknown(other)),
        };
        tolerance.raw(&field, &value, actual)?;
    }
    Ok(())
}
