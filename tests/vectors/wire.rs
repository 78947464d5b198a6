//! Vectors of protocols `can_bits` (frame lengths) and `encoder` (unwrapping a counter).

use rc10_can::{CanFrame, LengthBounds};
use rc10_module::encoder::Counter;
use serde_json::{Map, Value};

use crate::fields::{Check, Fields, Tolerance, frame, narrow, unknown};

/// One vector of protocol `can_bits`.
pub fn can_bits(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    let mut inputs = vector.object("inputs")?;
    let expected = vector.object("expect")?.into_expectations()?;
    match kind {
        "encode" => {
            let frame = frame(inputs.object("frame")?)?.ok_or("no classic CAN frame")?;
            exact(&frame, &expected, tolerance)?;
        }
        "convert" => {
            let len = narrow(&inputs.take("data_bytes")?)?;
            if len > 8 {
                return Err(format!("a classic CAN frame has no {len} bytes"));
            }
            let bounds = LengthBounds::of(len, inputs.flag("ext")?);
            for (field, value) in &expected {
                tolerance.raw(field, value, bound(bounds, field)?)?;
            }
        }
        other => return Err(format!("this runner does not know the kind `{other}`")),
    }
    inputs.finish()
}

fn exact(frame: &CanFrame, expected: &Map<String, Value>, tolerance: &mut Tolerance) -> Check {
    let length = frame.wire_length();
    for (field, value) in expected {
        let actual = match field.as_str() {
            "bits_unstuffed" => length.unstuffed.into(),
            "stuff_bits" => length.stuff_bits.into(),
            "bits_total" => length.total().into(),
            "crc15" => length.crc15.into(),
            other => bound(LengthBounds::of(frame.bytes().len(), frame.is_extended_id()), other)?,
        };
        tolerance.raw(field, value, actual)?;
    }
    Ok(())
}

fn bound(bounds: LengthBounds, field: &str) -> Check<i64> {
    match field {
        "bits_min" => Ok(bounds.min.into()),
        "bits_max" => Ok(bounds.max.into()),
        "bits_typical" => Ok(bounds.typical().into()),
        other => Err(unknown(other)),
    }
}

/// One vector of protocol `encoder`.
pub fn encoder(kind: &str, vector: &mut Fields, tolerance: &mut Tolerance) -> Check {
    if kind != "sequence" {
        return Err(format!("this runner does not know the kind `{kind}`"));
    }
    let mut inputs = vector.object("inputs")?;
    let modulus = narrow(&inputs.take("modulus")?)?;
    let counts = inputs.list("counts")?;
    let totals = totals(modulus, &counts)?;
    let mut expected = vector.object("expect")?;
    compare("total_from_first", &expected.list("total_from_first")?, &totals, tolerance)?;
    expected.finish()?;
    inputs.finish()
}

/// The total after each count, from the first.
pub fn totals(modulus: u64, counts: &[Value]) -> Check<Vec<i64>> {
    let mut counter = Counter::new(modulus);
    let mut first = None;
    let total = |count| {
        counter.update(narrow(count)?).map_err(|error| error.to_string())?;
        Ok(counter.total() - *first.get_or_insert(counter.total()))
    };
    counts.iter().map(total).collect()
}

/// Compares list with list.
pub fn compare(
    field: &str,
    expected: &[Value],
    actual: &[i64],
    tolerance: &mut Tolerance,
) -> Check {
    if expected.is_empty() || expected.len() != actual.len() {
        return Err(format!("{field}: {} values for {} samples", expected.len(), actual.len()));
    }
    expected.iter().zip(actual).try_for_each(|(value, &total)| tolerance.raw(field, value, total))
}
