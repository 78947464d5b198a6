//! JSON of which nothing may be overlooked, and the tolerances a vector may ask for.

use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use serde_json::{Map, Value};

/// `Err` is a message for people.
pub type Check<T = ()> = Result<T, String>;

/// An object that is taken apart field by field: fields left over in the end are an error, so no
/// condition of a vector is ignored because the runner does not know it.
pub struct Fields {
    name: &'static str,
    map: Map<String, Value>,
}

impl Fields {
    pub fn of(name: &'static str, value: Value) -> Check<Self> {
        match value {
            Value::Object(map) => Ok(Self { name, map }),
            other => Err(format!("`{name}` is no object: {other}")),
        }
    }

    pub fn optional(&mut self, field: &str) -> Option<Value> {
        self.map.remove(field)
    }

    pub fn take(&mut self, field: &str) -> Check<Value> {
        let missing = || format!("`{}` has no field `{field}`", self.name);
        self.map.remove(field).ok_or_else(missing)
    }

    pub fn object(&mut self, field: &'static str) -> Check<Self> {
        Self::of(field, self.take(field)?)
    }

    pub fn list(&mut self, field: &str) -> Check<Vec<Value>> {
        match self.take(field)? {
            Value::Array(list) => Ok(list),
            other => Err(format!("`{field}` is no list: {other}")),
        }
    }

    pub fn text(&mut self, field: &str) -> Check<String> {
        text(&self.take(field)?)
    }

    pub fn integer(&mut self, field: &str) -> Check<i64> {
        integer(&self.take(field)?)
    }

    pub fn flag(&mut self, field: &str) -> Check<bool> {
        let value = self.take(field)?;
        value.as_bool().ok_or_else(|| format!("`{field}` is neither true nor false: {value}"))
    }

    /// Fields that only explain.
    pub fn ignore(&mut self, fields: &[&str]) {
        for field in fields {
            self.map.remove(*field);
        }
    }

    /// The rest, to be gone through one by one; expecting nothing proves nothing.
    pub fn into_expectations(self) -> Check<Map<String, Value>> {
        if self.map.is_empty() {
            return Err(format!("`{}` is empty", self.name));
        }
        Ok(self.map)
    }

    /// `Ok` if everything was taken.
    pub fn finish(self) -> Check {
        let left: Vec<_> = self.map.into_iter().map(|(field, _)| field).collect();
        match left.as_slice() {
            [] => Ok(()),
            left => Err(format!("`{}` has fields this runner does not know: {left:?}", self.name)),
        }
    }
}

pub fn unknown(field: &str) -> String {
    format!("this runner does not know the field `{field}`")
}

pub fn text(value: &Value) -> Check<String> {
    value.as_str().map(Into::into).ok_or_else(|| format!("no text: {value}"))
}

/// A whole number: plain, or as text in hexadecimal.
pub fn integer(value: &Value) -> Check<i64> {
    let hexadecimal = value.as_str().and_then(|text| text.strip_prefix("0x"));
    let number = match hexadecimal {
        Some(digits) => i64::from_str_radix(digits, 16).ok(),
        None => value.as_i64(),
    };
    number.ok_or_else(|| format!("no whole number: {value}"))
}

/// A number; JSON has no infinity and no NaN, so they come as text.
pub fn float(value: &Value) -> Check<f64> {
    let number = match value {
        Value::String(text) => text.parse().ok(),
        other => other.as_f64(),
    };
    number.ok_or_else(|| format!("no number: {value}"))
}

/// Narrows a whole number to the type it is used as.
pub fn narrow<T: TryFrom<i64>>(value: &Value) -> Check<T> {
    T::try_from(integer(value)?).map_err(|_| format!("out of range: {value}"))
}

/// A frame; `None` if no classic CAN bus can carry it.
pub fn frame(mut fields: Fields) -> Check<Option<CanFrame>> {
    let bus = fields.text("bus")?;
    if bus != "can" {
        return Err(format!("a frame on bus `{bus}`"));
    }
    let raw = fields.integer("id")?;
    let id = if fields.flag("ext")? {
        u32::try_from(raw).ok().and_then(ExtendedId::new).map(Id::Extended)
    } else {
        u16::try_from(raw).ok().and_then(StandardId::new).map(Id::Standard)
    };
    let len = fields.integer("dlc")?;
    let len = usize::try_from(len).map_err(|_| format!("`dlc` is {len}"))?;
    let mut remote = false;
    for name in ["remote", "rtr"] {
        if let Some(value) = fields.optional(name) {
            remote = value.as_bool().ok_or_else(|| format!("`{name}` is {value}"))?;
        }
    }
    let data = if remote { String::new() } else { fields.text("data")? };
    if remote {
        fields.ignore(&["data"]);
    }
    fields.finish()?;
    let data = bytes(&data)?;
    if !remote && data.len() != len {
        return Err(format!("`dlc` is {len}, but there are {} data bytes", data.len()));
    }
    Ok(id.and_then(|id| {
        let frame =
            if remote { CanFrame::remote_frame(id, len) } else { CanFrame::data_frame(id, &data) };
        frame.ok()
    }))
}

fn bytes(hexadecimal: &str) -> Check<Vec<u8>> {
    let byte = |pair: &[u8]| {
        let digits = std::str::from_utf8(pair).ok().filter(|_| pair.len() == 2);
        digits.and_then(|digits| u8::from_str_radix(digits, 16).ok())
    };
    let bytes: Option<_> = hexadecimal.as_bytes().chunks(2).map(byte).collect();
    bytes.ok_or_else(|| format!("no hexadecimal bytes: {hexadecimal}"))
}

/// One number for all fields, or one for each, and whether it was asked for.
#[derive(Default)]
struct PerField {
    common: Option<f64>,
    named: Vec<(String, f64, bool)>,
}

impl PerField {
    fn of(value: Option<Value>) -> Check<Self> {
        let mut all = Self::default();
        match value {
            None => {}
            Some(Value::Object(named)) => {
                for (field, value) in named {
                    all.named.push((field, float(&value)?, false));
                }
            }
            Some(number) => all.common = Some(float(&number)?),
        }
        Ok(all)
    }

    fn field(&mut self, field: &str) -> Option<f64> {
        let Some((_, value, asked)) = self.named.iter_mut().find(|(name, ..)| name == field) else {
            return self.common;
        };
        *asked = true;
        Some(*value)
    }
}

/// Largest allowed difference of a value.
pub struct Tolerance {
    lsb: PerField,
    relative: PerField,
    absolute: PerField,
    absolute_lsb: PerField,
}

/// Tolerance of floats unless the vector has one.
const RELATIVE: f64 = 1e-5;

impl Tolerance {
    pub fn of(vector: &mut Fields) -> Check<Self> {
        Ok(Self {
            lsb: PerField::of(vector.optional("tol_lsb"))?,
            relative: PerField::of(vector.optional("rel_tol"))?,
            absolute: PerField::of(vector.optional("abs_tol"))?,
            absolute_lsb: PerField::of(vector.optional("abs_tol_lsb"))?,
        })
    }

    /// Largest allowed difference of a raw field, in steps.
    pub fn steps(&mut self, field: &str) -> u32 {
        #[expect(clippy::cast_possible_truncation, reason = "it saturates")]
        return self.lsb.field(field).unwrap_or(0.0) as u32;
    }

    /// Compares a raw field.
    pub fn raw(&mut self, field: &str, expected: &Value, actual: i64) -> Check {
        let steps = self.steps(field);
        let off = integer(expected)?.abs_diff(actual);
        same(field, off <= u64::from(steps), expected, &actual)
    }

    /// Compares a physical value, one step of whose raw field is `lsb`.
    pub fn float(&mut self, field: &str, lsb: f64, expected: &Value, actual: f32) -> Check {
        let wanted = float(expected)?;
        let relative = self.relative.field(field).unwrap_or(RELATIVE);
        let absolute = self.absolute.field(field).unwrap_or(0.0);
        let steps = self.absolute_lsb.field(field).unwrap_or(0.0);
        let bound = (relative * wanted.abs()).max(absolute).max(steps * lsb);
        // False for NaN.
        same(field, (wanted - f64::from(actual)).abs() <= bound, expected, &actual)
    }

    /// `Ok` if every field with a tolerance of its own was compared.
    pub fn finish(self) -> Check {
        let all = [self.lsb, self.relative, self.absolute, self.absolute_lsb];
        let left = all.iter().flat_map(|tolerance| &tolerance.named).find(|(.., asked)| !asked);
        left.map_or(Ok(()), |(field, ..)| Err(format!("a tolerance for `{field}`, unknown here")))
    }
}

/// `Err` with both sides unless they are the `same`.
pub fn same(
    what: &str,
    same: bool,
    expected: &impl std::fmt::Display,
    actual: &impl std::fmt::Display,
) -> Check {
    if same { Ok(()) } else { Err(format!("{what}: expected {expected}, got {actual}")) }
}
