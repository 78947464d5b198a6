//! Vectors of protocol `lk`: through the codec.

use rc10_app::{Amps, Degrees, RotorRpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_motor::lk::{
    CENTIDEGREES, Command, DriveId, EncoderBits, MULTI_MOTOR_ID, Model, Motion, Reply,
    SpinDirection, pack_multi_motor,
};
use serde_json::Value;

use crate::fields::{Check, Fields, Tolerance, float, frame, integer, narrow, same, text, unknown};

/// One vector of protocol `lk`.
pub fn run(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    match kind {
        "encode" => encode(vector, tolerance),
        "decode" => decode(vector, tolerance),
        "convert" => convert(vector, tolerance),
        "id" => id(vector, tolerance),
        "reject" => reject(vector),
        other => Err(format!("this runner does not know the kind `{other}`")),
    }
}

/// A text such as `mg iq id=1 3.3 A (why)`, word by word; text in parentheses only explains.
pub fn words(sentence: &str) -> Check<Vec<String>> {
    let mut depth = 0_u32;
    let mut bare = String::new();
    for letter in sentence.chars() {
        match letter {
            '(' => depth += 1,
            ')' => depth = depth.checked_sub(1).ok_or("`)` without `(`")?,
            _ if depth > 0 => {}
            '=' | ',' | '[' | ']' | ';' | ':' => bare.push(' '),
            other => bare.extend(other.to_lowercase()),
        }
    }
    same("parentheses", depth == 0, &"closed", &sentence)?;
    Ok(bare.split_whitespace().map(Into::into).collect())
}

/// A command to a drive.
#[derive(Default)]
struct Order {
    /// The name of the order, without its parameters.
    name: String,
    model: Option<String>,
    id: Option<i64>,
    /// In the unit of the command, one or four.
    values: Vec<f64>,
    /// Whether they are steps.
    raw: bool,
    limit: Option<f64>,
    direction: Option<SpinDirection>,
}

impl Order {
    fn of(inputs: &mut Fields) -> Check<Self> {
        let mut order = Self::default();
        let sentence = inputs.optional("op").or_else(|| inputs.optional("command"));
        order.read(&text(&sentence.ok_or("no `op`")?)?)?;
        for (field, raw) in [
            ("current_A", false),
            ("speed_dps", false),
            ("angle_deg", false),
            ("iq_raw", true),
            ("raw_i16", true),
            ("power_raw", true),
        ] {
            let Some(value) = inputs.optional(field) else { continue };
            let list = if let Value::Array(list) = value { list } else { vec![value] };
            order.values.extend(list.iter().map(float).collect::<Check<Vec<_>>>()?);
            order.raw |= raw;
        }
        if let Some(limit) = inputs.optional("max_dps") {
            order.limit = Some(float(&limit)?);
        }
        if let Some(model) = inputs.optional("model") {
            order.model = Some(text(&model)?);
        }
        if let Some(id) = inputs.optional("id") {
            order.id = Some(integer(&id)?);
        }
        if let Some(way) = inputs.optional("direction") {
            order.direction = Some(direction(&text(&way)?).ok_or("no direction")?);
        }
        Ok(order)
    }

    fn read(&mut self, sentence: &str) -> Check {
        let mut name = Vec::new();
        let words = words(sentence)?;
        let mut words = words.iter().map(String::as_str).peekable();
        let number = |word: Option<&str>| -> Check<f64> {
            let word = word.ok_or("a number is missing")?;
            word.parse().map_err(|_| format!("no number: {word}"))
        };
        while let Some(word) = words.next() {
            match word {
                "id" => {
                    let id = words.next().and_then(|word| word.parse().ok());
                    self.id = Some(id.ok_or("no identifier behind `id`")?);
                }
                "max" => self.limit = Some(number(words.next())?),
                "mf" | "mg" | "ms" => self.model = Some(word.into()),
                "raw" => self.raw = true,
                // Of the number before.
                "a" | "dps" | "deg" => {}
                // `status 1` is a name, not a value.
                "status" | "state" => {
                    name.push("state");
                    name.extend(words.next_if(|next| ["1", "2", "3"].contains(next)));
                }
                word => match (word.parse(), direction(word)) {
                    (Ok(value), _) => self.values.push(value),
                    (_, Some(way)) => self.direction = Some(way),
                    _ => name.push(word),
                },
            }
        }
        self.name = name.join(" ");
        Ok(())
    }

    /// The only value.
    fn value(&mut self) -> Check<f64> {
        match std::mem::take(&mut self.values).as_slice() {
            [value] => Ok(*value),
            other => Err(format!("`{}` with {} values", self.name, other.len())),
        }
    }

    fn model(&self) -> Check<Model> {
        match self.model.as_deref() {
            Some(name) => model(name, EncoderBits::Sixteen),
            None => Ok(Model::mg(EncoderBits::Sixteen)),
        }
    }

    /// The command; fields that its order does not need must not be there.
    fn command(&mut self) -> Check<Command> {
        let name = self.name.clone();
        let model = self.model()?;
        let command = match name.as_str() {
            "off" | "shutdown" | "disable" => Command::Off,
            "stop" => Command::Stop,
            "run" | "on" | "enable" => Command::Run,
            "state1" | "status1" | "state 1" => Command::ReadHealth,
            "clear" | "clear error" | "clear errors" => Command::ClearErrors,
            "state2" | "status2" | "state 2" => Command::ReadMotion,
            "state3" | "status3" | "state 3" => Command::ReadPhaseCurrents,
            "read multi-turn" | "read multi-turn angle" => Command::ReadMultiTurn,
            "read single-turn" | "read single-turn angle" => Command::ReadSingleTurn,
            "open loop" | "open-loop" | "power" => Command::OpenLoop(steps(self.value()?)),
            "iq" | "current" | "torque" => {
                let value = self.value()?;
                let step = if self.raw { f64::from(model.amps_per_count) } else { 1.0 };
                (self.model, self.raw) = (None, false);
                Command::Current(Amps::new(single(value * step)))
            }
            "speed" => Command::Speed(rpm(self.value()?)),
            "multi-turn angle" | "multi-turn" => {
                let angle = total(self.value()?)?;
                Command::TurnTo { angle, speed_limit: self.limit.take().map(rpm) }
            }
            "increment" | "increment angle" | "incremental angle" => {
                let angle = total(self.value()?)?;
                Command::TurnBy { angle, speed_limit: self.limit.take().map(rpm) }
            }
            "single-turn angle" | "single-turn" => Command::TurnWithin {
                angle: Degrees::new(single(self.value()?)),
                direction: self.direction.take().ok_or("which way round?")?,
                speed_limit: self.limit.take().map(rpm),
            },
            other => return Err(format!("this runner does not know the command `{other}`")),
        };
        // Open loop is for MS drives alone, and its values are always steps.
        if matches!(command, Command::OpenLoop(_)) {
            (self.model, self.raw) = (None, false);
        }
        let rest = self.raw || !self.values.is_empty() || self.limit.is_some();
        let rest = rest || self.direction.is_some() || self.model.is_some();
        same("the order", !rest, &"nothing else", &format!("more than `{name}` needs"))?;
        Ok(command)
    }

    fn multi_motor(&mut self) -> Check<Option<CanFrame>> {
        if !["multi-motor iq", "multi-motor current", "multi-motor"].contains(&self.name.as_str()) {
            return Ok(None);
        }
        let &[a, b, c, d] = self.values.as_slice() else { return Err("not four values".into()) };
        let model = self.model()?;
        let raw = |value| {
            if self.raw { steps(value) } else { model.raw_current(Amps::new(single(value))) }
        };
        same("the order", self.id.is_none(), &"all drives", &"one")?;
        Ok(Some(pack_multi_motor([a, b, c, d].map(raw))))
    }
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is what commands are made of")]
fn single(value: f64) -> f32 {
    value as f32
}

#[expect(clippy::cast_possible_truncation, reason = "it saturates")]
fn steps(value: f64) -> i16 {
    value as i16
}

fn rpm(degrees_per_second: f64) -> RotorRpm {
    RotorRpm::new(single(degrees_per_second / 6.0))
}

fn total(degrees: f64) -> Check<TotalAngle> {
    same("angle", degrees.is_finite(), &"a number", &degrees)?;
    #[expect(clippy::cast_possible_truncation, reason = "it saturates")]
    Ok(TotalAngle::from_microdegrees((degrees * 1e6).round() as i64))
}

fn direction(word: &str) -> Option<SpinDirection> {
    match word {
        "cw" | "clockwise" => Some(SpinDirection::Clockwise),
        "ccw" | "counterclockwise" => Some(SpinDirection::CounterClockwise),
        _ => None,
    }
}

fn model(name: &str, encoder: EncoderBits) -> Check<Model> {
    match name.to_lowercase().as_str() {
        "mg" => Ok(Model::mg(encoder)),
        "mf" => Ok(Model::mf(encoder)),
        "ms" => Ok(Model::ms(encoder)),
        other => Err(format!("this runner does not know the model `{other}`")),
    }
}

fn drive(number: i64) -> Check<DriveId> {
    let id = u8::try_from(number).ok().and_then(DriveId::new);
    id.ok_or_else(|| format!("no drive has the identifier {number}"))
}

fn encode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let mut order = Order::of(&mut inputs)?;
    inputs.finish()?;
    let actual = match order.multi_motor()? {
        Some(frame) => frame,
        None => {
            let model = order.model()?;
            let id = drive(order.id.ok_or("no `id`")?)?;
            // The neutral frame stands in for a value that is not a number.
            order.command()?.pack(id, &model).unwrap_or_else(|error| error.neutral)
        }
    };
    let expected = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    if let Some(fields) = vector.optional("fields_raw") {
        for (field, value) in Fields::of("fields_raw", fields)?.into_expectations()? {
            tolerance.raw(&field, &value, raw_field(&actual, &field)?)?;
        }
    }
    let (field, name) = (lanes(&expected).zip(lanes(&actual)), "raw");
    let steps = i64::from(tolerance.steps(name));
    let near = match field {
        Some(((head, a), (other, b))) if expected.key() == actual.key() => {
            head == other
                && a.len() == b.len()
                && a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= steps)
        }
        _ => expected == actual,
    };
    same("frame", near, &expected, &actual)
}

/// The bytes of a command that must be exact, and its numbers.
fn lanes(frame: &CanFrame) -> Option<([u8; 4], Vec<i64>)> {
    let &[a, b, c, d, e, f, g, h] = frame.all_eight()?;
    let short = |bytes| i64::from(i16::from_le_bytes(bytes));
    if frame.key() == CanFrame::key_of(MULTI_MOTOR_ID) {
        return Some(([0; 4], [[a, b], [c, d], [e, f], [g, h]].map(short).to_vec()));
    }
    let numbers = match a {
        0xA0 | 0xA1 => vec![short([e, f]), short([g, h])],
        _ => vec![i32::from_le_bytes([e, f, g, h]).into()],
    };
    Some(([a, b, c, d], numbers))
}

fn raw_field(frame: &CanFrame, field: &str) -> Check<i64> {
    let &[_, b, c, d, e, f, g, h] = frame.all_eight().ok_or("not eight bytes")?;
    match field {
        "iq_raw" | "power_raw" => Ok(i16::from_le_bytes([e, f]).into()),
        "speed_raw" | "angle_raw" => Ok(i32::from_le_bytes([e, f, g, h]).into()),
        "max_raw" => Ok(u16::from_le_bytes([c, d]).into()),
        "direction" => Ok(b.into()),
        other => Err(unknown(other)),
    }
}

fn encoder_bits(inputs: &mut Fields) -> Check<EncoderBits> {
    match inputs.optional("encoder_bits").map(|bits| integer(&bits)).transpose()? {
        Some(14) => Ok(EncoderBits::Fourteen),
        Some(15) => Ok(EncoderBits::Fifteen),
        None | Some(16 | 18) => Ok(EncoderBits::Sixteen),
        Some(bits) => Err(format!("no encoder has {bits} bits")),
    }
}

/// The drive that a decoder is set up for; by default an MG with the identifier of the frame.
fn set_up(vector: &mut Fields, frame: &CanFrame) -> Check<(DriveId, Model)> {
    let mut inputs = match vector.optional("inputs") {
        Some(inputs) => Fields::of("inputs", inputs)?,
        None => Fields::of("inputs", Value::Object(serde_json::Map::new()))?,
    };
    let encoder = encoder_bits(&mut inputs)?;
    let name = inputs.optional("model").map(|name| text(&name)).transpose()?;
    let id = match inputs.optional("id") {
        Some(id) => integer(&id)?,
        None => i64::from(frame.raw_id()) - 0x140,
    };
    inputs.finish()?;
    Ok((drive(id)?, model(name.as_deref().unwrap_or("mg"), encoder)?))
}

fn decode(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let frame = frame(vector.object("frame")?)?.ok_or("no classic CAN frame")?;
    let (id, model) = set_up(vector, &frame)?;
    let reply = Reply::from_frame(&frame, id).map_err(|error| error.to_string())?;
    for (field, expected) in vector.object("expect")?.into_expectations()? {
        if let Some(name) = field.strip_prefix("as_") {
            let model = self::model(name, model.encoder)?;
            for (field, expected) in Fields::of("as_…", expected)?.into_expectations()? {
                value(&reply, &model, &field, &expected, tolerance)?;
            }
            continue;
        }
        match field.as_str() {
            "id" | "motor_id" => tolerance.raw(&field, &expected, id.number().into())?,
            "cmd" => {
                let byte = frame.bytes().first().copied().unwrap_or_default();
                let byte = if let Reply::Motion(motion) = reply { motion.command } else { byte };
                tolerance.raw(&field, &expected, byte.into())?;
            }
            other => value(&reply, &model, other, &expected, tolerance)?,
        }
    }
    Ok(())
}

fn value(
    reply: &Reply,
    model: &Model,
    field: &str,
    expected: &Value,
    tolerance: &mut Tolerance,
) -> Check {
    let mut float = |lsb, actual| tolerance.float(field, lsb, expected, actual);
    match (reply, field) {
        (Reply::Motion(motion), _) => self::motion(motion, model, field, expected, tolerance),
        (Reply::Health(health), "temp_C") => float(1.0, health.temperature.get()),
        (Reply::Health(health), "voltage_V") => float(0.1, health.supply),
        (Reply::Health(health), "error_bits") => {
            let bits = health.errors.bits();
            let named = health.errors.texts().count();
            same("texts", named == bits.count_ones() as usize, &"one each", &named)?;
            tolerance.raw(field, expected, bits.into())
        }
        (Reply::PhaseCurrents(currents), "temp_C") => float(1.0, currents.temperature.get()),
        (Reply::PhaseCurrents(currents), "phase_a_A" | "ia_A") => {
            float(1.0 / 64.0, currents.phases[0].get())
        }
        (Reply::PhaseCurrents(currents), "phase_b_A" | "ib_A") => {
            float(1.0 / 64.0, currents.phases[1].get())
        }
        (Reply::PhaseCurrents(currents), "phase_c_A" | "ic_A") => {
            float(1.0 / 64.0, currents.phases[2].get())
        }
        (Reply::MultiTurn(angle) | Reply::SingleTurn(angle), "angle_deg") => {
            float(0.01, angle.degrees().get())
        }
        (Reply::MultiTurn(angle), "multi_turn_deg") => float(0.01, angle.degrees().get()),
        (Reply::SingleTurn(angle), "single_turn_deg") => float(0.01, angle.degrees().get()),
        (Reply::MultiTurn(angle) | Reply::SingleTurn(angle), "angle_raw") => {
            tolerance.raw(field, expected, angle.counts_at(CENTIDEGREES))
        }
        (_, other) => Err(unknown(other)),
    }
}

fn motion(
    motion: &Motion,
    model: &Model,
    field: &str,
    expected: &Value,
    tolerance: &mut Tolerance,
) -> Check {
    let current = || model.current(motion).map(Amps::get).ok_or("there is no current");
    let degree = 360.0 / f64::from(model.encoder.counts());
    match field {
        "temp_C" => tolerance.float(field, 1.0, expected, motion.temperature().get()),
        "iq_raw" => {
            current()?;
            tolerance.raw(field, expected, motion.effort.into())
        }
        "power_raw" => tolerance.raw(field, expected, motion.effort.into()),
        "iq_A" | "current_A" => {
            tolerance.float(field, model.amps_per_count.into(), expected, current()?)
        }
        "speed_dps" => tolerance.float(field, 1.0, expected, motion.speed().get() * 6.0),
        "speed_rpm" => tolerance.float(field, 1.0 / 6.0, expected, motion.speed().get()),
        "encoder" => tolerance.raw(field, expected, motion.encoder.into()),
        "angle_deg" => {
            let angle = model.angle(motion).map_err(|error| error.to_string())?;
            tolerance.float(field, degree, expected, angle.get())
        }
        other => Err(unknown(other)),
    }
}

fn convert(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let encoder = encoder_bits(&mut inputs)?;
    let name = inputs.optional("model").map(|name| text(&name)).transpose()?;
    let model = model(name.as_deref().unwrap_or("mg"), encoder)?;
    let expected = vector.object("expect")?.into_expectations()?;
    if let Some(current) = inputs.optional("current_A") {
        inputs.finish()?;
        let raw = model.raw_current(Amps::new(single(float(&current)?)));
        return expected.iter().try_for_each(|(field, expected)| match field.as_str() {
            "raw_i16" | "iq_raw" => tolerance.raw(field, expected, raw.into()),
            other => Err(unknown(other)),
        });
    }
    let mut raw = Motion { command: 0x9C, temperature: 0, effort: 0, speed: 0, encoder: 0 };
    let mut found = false;
    for field in ["iq_raw", "speed_dps", "encoder"] {
        let Some(value) = inputs.optional(field) else { continue };
        found = true;
        match field {
            "iq_raw" => raw.effort = narrow(&value)?,
            "speed_dps" => raw.speed = narrow(&value)?,
            _ => raw.encoder = narrow(&value)?,
        }
    }
    same("inputs", found, &"something to convert", &"nothing")?;
    inputs.finish()?;
    expected.iter().try_for_each(|(field, value)| motion(&raw, &model, field, value, tolerance))
}

fn id(vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let id = drive(inputs.integer("id")?)?;
    inputs.finish()?;
    for (field, expected) in vector.object("expect")?.into_expectations()? {
        match field.as_str() {
            "can_id" | "command_id" | "reply_id" => {
                tolerance.raw(&field, &expected, id.can_id().as_raw().into())?;
            }
            "lane" => {
                let lane = id.multi_motor_lane().ok_or("not in the multi-motor frame")?;
                tolerance.raw(&field, &expected, i64::try_from(lane).unwrap_or(-1))?;
            }
            other => return Err(unknown(other)),
        }
    }
    Ok(())
}

fn reject(vector: &mut Fields) -> Check {
    let Some(fields) = vector.optional("frame") else {
        // An order that no frame can carry.
        let mut inputs = vector.object("inputs")?;
        let mut order = Order::of(&mut inputs)?;
        inputs.finish()?;
        let (model, command) = (order.model()?, order.command()?);
        let id = drive(order.id.ok_or("no `id`")?);
        let taken = id.is_ok_and(|id| command.pack(id, &model).is_ok());
        return same("rejected", !taken, &"an error", &order.name);
    };
    let Some(frame) = frame(Fields::of("frame", fields)?)? else {
        return Ok(()); // It cannot even arrive.
    };
    let mut drives: Vec<_> = (1..=32).filter_map(DriveId::new).collect();
    let mut model = Model::mg(EncoderBits::Sixteen);
    if let Some(inputs) = vector.optional("inputs") {
        let mut inputs = Fields::of("inputs", inputs)?;
        if let Some(id) = inputs.optional("id") {
            drives = vec![drive(integer(&id)?)?];
        }
        let name = inputs.optional("model").map(|name| text(&name)).transpose()?;
        model = self::model(name.as_deref().unwrap_or("mg"), encoder_bits(&mut inputs)?)?;
        inputs.finish()?;
    }
    for id in drives {
        let taken = match Reply::from_frame(&frame, id) {
            Ok(Reply::Motion(motion)) => model.angle(&motion).is_ok(),
            Ok(_) => true,
            Err(_) => false,
        };
        same("rejected", !taken, &"an error", &format!("drive {} takes {frame}", id.number()))?;
    }
    Ok(())
}
