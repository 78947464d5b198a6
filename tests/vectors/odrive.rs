//! Vectors of protocol `odrive`: through the codec.

use rc10_app::{Amps, NewtonMetres};
use rc10_can::CanFrame;
use rc10_can::embedded_can::Id;
use rc10_motor::odrive::{
    AxisState, Command, ControlMode, Firmware, InputMode, Message, Node, Query,
};
use serde_json::Value;

use crate::fields::{Check, Fields, Tolerance, float, frame, integer, same, text, unknown};
use crate::lk::words;

/// One vector of protocol `odrive`.
pub fn run(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    match kind {
        "encode" => encode(vector, tolerance),
        "decode" => decode(vector, tolerance),
        "id" => id(vector, tolerance),
        "reject" => reject(vector),
        other => Err(format!("this runner does not know the kind `{other}`")),
    }
}

/// A command to an axis: `set_input_vel 2.5 rev/s, torque_ff -0.25`, or the same in fields.
struct Order {
    name: String,
    node: i64,
    /// Numbers, each with the word before it if there is one.
    values: Vec<(Option<String>, f64)>,
}

impl Order {
    fn of(inputs: &mut Fields) -> Check<Self> {
        let words = words(&inputs.text("op")?)?;
        let (name, rest) = words.split_first().ok_or("an empty `op`")?;
        let mut order = Self { name: name.clone(), node: inputs.integer("node")?, values: vec![] };
        let mut label = None;
        for word in rest {
            match (word.parse(), mode(name, word)) {
                (Ok(value), _) => order.values.push((label.take(), value)),
                _ if ["rev", "rev/s", "turns", "turns/s", "nm", "a", "v"].contains(&&**word) => {}
                (_, Some((kind, number))) => {
                    label = None;
                    order.values.push((Some(kind.into()), number));
                }
                _ => {
                    let unused = label.replace(word.clone());
                    same("op", unused.is_none(), &"a number", &unused.unwrap_or_default())?;
                }
            }
        }
        same("op", label.is_none(), &"a number", &label.unwrap_or_default())?;
        for (_, aliases) in LABELS {
            for alias in *aliases {
                if let Some(value) = inputs.optional(alias) {
                    order.values.push((Some((*alias).into()), float(&value)?));
                }
            }
        }
        Ok(order)
    }

    /// Takes the value of that label, or the first without any.
    fn take(&mut self, label: &str) -> Option<f64> {
        let aliases =
            LABELS.iter().find(|(name, _)| *name == label).map_or(&[][..], |(_, all)| all);
        let named = self
            .values
            .iter()
            .position(|(name, _)| name.as_deref().is_some_and(|name| aliases.contains(&name)));
        let first = || self.values.iter().position(|(name, _)| name.is_none());
        named.or_else(first).map(|index| self.values.remove(index).1)
    }

    fn number(&mut self, label: &str) -> Check<f32> {
        let value = self.take(label).ok_or_else(|| format!("no {label}"))?;
        #[expect(clippy::cast_possible_truncation, reason = "f32 is what commands are made of")]
        Ok(value as f32)
    }

    /// A feed-forward, which may be left out.
    fn feed_forward(&mut self, label: &str) -> f32 {
        self.number(label).unwrap_or_default()
    }

    fn frame(&mut self) -> Check<CanFrame> {
        let node = node(self.node)?;
        let name = self.name.clone();
        let command = match name.as_str() {
            "set_axis_state" | "set_axis_requested_state" | "set_state" => {
                Command::State(AxisState::new(whole(self.take("state"))?))
            }
            "set_controller_mode" | "set_controller_modes" => Command::Modes(
                control_mode(whole(self.take("control"))?)?,
                input_mode(whole(self.take("input"))?)?,
            ),
            "set_input_pos" => Command::Position {
                position: self.number("position")?,
                velocity: self.feed_forward("velocity feed-forward"),
                torque: NewtonMetres::new(self.feed_forward("torque feed-forward")),
            },
            "set_input_vel" => Command::Velocity {
                velocity: self.number("velocity")?,
                torque: NewtonMetres::new(self.feed_forward("torque feed-forward")),
            },
            "set_input_torque" => Command::Torque(NewtonMetres::new(self.number("torque")?)),
            "set_limits" => Command::Limits {
                velocity: self.number("velocity limit")?,
                current: Amps::new(self.number("current limit")?),
            },
            "clear_errors" => Command::ClearErrors,
            "get_encoder_estimates" => return self.last(Query::Estimates.pack(node)),
            "get_iq" => return self.last(Query::Currents.pack(node)),
            "get_bus_voltage_current" => return self.last(Query::Supply.pack(node)),
            other => return Err(format!("this runner does not know the command `{other}`")),
        };
        // The neutral frame stands in for a value that is not a number.
        self.last(command.pack(node).unwrap_or_else(|error| error.neutral))
    }

    /// The frame, if nothing of the order is left.
    fn last(&self, frame: CanFrame) -> Check<CanFrame> {
        let left = &self.values;
        same("op", left.is_empty(), &"all of it", &format!("{left:?} left over")).map(|()| frame)
    }
}

const LABELS: &[(&str, &[&str])] = &[
    ("state", &["state", "axis_state", "requested_state"]),
    ("control", &["control_mode", "control", "mode"]),
    ("input", &["input_mode", "input"]),
    ("position", &["pos", "input_pos", "position", "pos_rev"]),
    ("velocity", &["vel", "input_vel", "velocity", "vel_rev_s"]),
    ("torque", &["torque", "input_torque", "torque_nm"]),
    ("velocity feed-forward", &["vel_ff"]),
    ("torque feed-forward", &["torque_ff", "input_torque_ff"]),
    ("velocity limit", &["vel", "vel_limit", "velocity", "velocity_limit"]),
    ("current limit", &["current", "current_limit", "cur"]),
];

/// A mode by its name: of which kind, and its number.
fn mode(command: &str, word: &str) -> Option<(&'static str, f64)> {
    let (control, input) = (|number| Some(("control", number)), |number| Some(("input", number)));
    if !command.starts_with("set_controller_mode") {
        return None;
    }
    match word {
        "voltage" => control(0.0),
        "torque" => control(1.0),
        "velocity" => control(2.0),
        "position" => control(3.0),
        "inactive" => input(0.0),
        "passthrough" => input(1.0),
        "vel_ramp" => input(2.0),
        "pos_filter" => input(3.0),
        "trap_traj" => input(5.0),
        "torque_ramp" => input(6.0),
        _ => None,
    }
}

fn whole(value: Option<f64>) -> Check<u8> {
    let value = value.ok_or("a number is missing")?;
    #[expect(clippy::cast_possible_truncation, reason = "compared with what it came from")]
    let whole = value as u8;
    let near = (f64::from(whole) - value).abs() < 1e-9;
    same("number", near, &"0 to 255", &value).map(|()| whole)
}

fn control_mode(number: u8) -> Check<ControlMode> {
    let modes =
        [ControlMode::Voltage, ControlMode::Torque, ControlMode::Velocity, ControlMode::Position];
    modes.into_iter().nth(number.into()).ok_or_else(|| format!("no control mode {number}"))
}

fn input_mode(number: u8) -> Check<InputMode> {
    let modes = [
        InputMode::Inactive,
        InputMode::Passthrough,
        InputMode::VelocityRamp,
        InputMode::PositionFilter,
        InputMode::MixChannels,
        InputMode::Trapezoid,
        InputMode::TorqueRamp,
        InputMode::Mirror,
        InputMode::Tuning,
    ];
    modes.into_iter().nth(number.into()).ok_or_else(|| format!("no input mode {number}"))
}

fn node(number: i64) -> Check<Node> {
    let node = u8::try_from(number).ok().and_then(Node::new);
    node.ok_or_else(|| format!("there is no node {number}"))
}

fn encode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let mut order = Order::of(&mut inputs)?;
    inputs.finish()?;
    let actual = order.frame()?;
    let expected = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    let near = match (expected.all_eight(), actual.all_eight()) {
        // Only the feed-forwards of a position are steps of anything.
        (Some(a), Some(b)) if order.name == "set_input_pos" => {
            let near = |(a, b): (&[u8], &[u8]), steps: u32| {
                let short = |bytes: &[u8]| i16::from_le_bytes([bytes[0], bytes[1]]);
                u32::from(short(a).abs_diff(short(b))) <= steps
            };
            expected.key() == actual.key()
                && a[..4] == b[..4]
                && near((&a[4..6], &b[4..6]), tolerance.steps("vel_ff"))
                && near((&a[6..], &b[6..]), tolerance.steps("torque_ff"))
        }
        _ => {
            tolerance.steps("raw");
            expected == actual
        }
    };
    same("frame", near, &expected, &actual)
}

fn decode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let frame = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    let Id::Standard(id) = frame.id() else { return Err("an extended identifier".into()) };
    let (mut node, number) = Node::of(id);
    if let Some(inputs) = vector.optional("inputs") {
        let mut inputs = Fields::of("inputs", inputs)?;
        node = self::node(inputs.integer("node")?)?;
        inputs.finish()?;
    }
    let message = Message::from_frame(&frame, node).map_err(|error| error.to_string())?;
    for (field, expected) in vector.object("expect")?.into_expectations()? {
        match field.as_str() {
            "node" => tolerance.raw(&field, &expected, node.number().into())?,
            "cmd" => tolerance.raw(&field, &expected, number.into())?,
            other => value(&message, other, &expected, tolerance)?,
        }
    }
    Ok(())
}

fn value(message: &Message, field: &str, expected: &Value, tolerance: &mut Tolerance) -> Check {
    let actual = match (message, field) {
        (Message::Heartbeat(heartbeat), _) => {
            let bit = |set| same(field, expected.as_bool() == Some(set), expected, &set);
            let [motor, encoder, controller] = heartbeat.details;
            return match field {
                "axis_error" | "error" => {
                    let fault = Firmware::V0_5.fault(heartbeat.errors);
                    let code = fault.map_or(0, |fault| fault.code);
                    tolerance.raw(field, expected, code.into())
                }
                "axis_state" | "state" => {
                    tolerance.raw(field, expected, heartbeat.state.number().into())
                }
                "motor_error" | "motor_error_flag" => bit(motor & 1 == 1),
                "encoder_error" | "encoder_error_flag" => bit(encoder & 1 == 1),
                "controller_error" | "controller_error_flag" => bit(controller & 1 == 1),
                "trajectory_done" | "trajectory_done_flag" => bit(controller >> 7 == 1),
                other => Err(unknown(other)),
            };
        }
        (Message::Estimates(estimates), "pos_rev" | "pos") => estimates.position,
        (Message::Estimates(estimates), "vel_rev_s" | "vel") => estimates.velocity,
        (Message::Currents(currents), "iq_setpoint") => currents.setpoint.get(),
        (Message::Currents(currents), "iq_measured") => currents.measured.get(),
        (Message::Supply(supply), "bus_V") => supply.voltage,
        (Message::Supply(supply), "bus_A") => supply.current.get(),
        (_, other) => return Err(unknown(other)),
    };
    tolerance.float(field, 0.0, expected, actual)
}

fn id(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let node = node(inputs.integer("node")?)?;
    let message = whole(Some(float(&inputs.take("cmd")?)?))?;
    same("cmd", message < 32, &"five bits", &message)?;
    inputs.finish()?;
    for (field, expected) in vector.object("expect")?.into_expectations()? {
        match field.as_str() {
            "id" | "can_id" => {
                tolerance.raw(&field, &expected, node.can_id(message).as_raw().into())?;
            }
            other => return Err(unknown(other)),
        }
    }
    Ok(())
}

fn reject(vector: &mut Fields) -> Check {
    let Some(fields) = vector.optional("frame") else {
        // A node that no identifier can carry.
        let mut inputs = vector.object("inputs")?;
        let number = inputs.integer("node")?;
        inputs.ignore(&["cmd"]);
        inputs.finish()?;
        return same("rejected", node(number).is_err(), &"an error", &number);
    };
    let Some(frame) = frame(Fields::of("frame", fields)?)? else {
        return Ok(()); // It cannot even arrive.
    };
    let mut nodes: Vec<_> = (0..=63).filter_map(Node::new).collect();
    if let Some(inputs) = vector.optional("inputs") {
        let mut inputs = Fields::of("inputs", inputs)?;
        nodes = vec![node(integer(&inputs.take("node")?)?)?];
        if let Some(reason) = inputs.optional("why") {
            text(&reason)?;
        }
        inputs.finish()?;
    }
    for node in nodes {
        let taken = Message::from_frame(&frame, node).is_ok();
        same("rejected", !taken, &"an error", &format!("node {} takes {frame}", node.number()))?;
    }
    Ok(())
}
