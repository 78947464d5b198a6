//! The runner must be able to fail: each public vector, spoilt in every way, has to.

use serde_json::{Value, json};

use crate::fields::Check;
use crate::{PUBLIC, Ran, read, run, run_text, vectors};

/// The public vectors of protocols that exist; all of them are right.
fn runnable() -> Check<Vec<Value>> {
    let mut runnable = vectors(&read(PUBLIC.into())?)?;
    runnable.retain(|vector| run(vector.clone()) != Ok(Ran::No));
    if runnable.len() < 40 {
        return Err(format!("only {} public vectors can be run", runnable.len()));
    }
    runnable.iter().try_for_each(|vector| run(vector.clone()).map(drop))?;
    Ok(runnable)
}

/// `Err` unless the vector fails.
fn must_fail(vector: &Value) -> Check {
    run(vector.clone()).map_or(Ok(()), |ran| Err(format!("passes ({ran:?}): {vector}")))
}

/// JSON pointers to all values below a place that contain no others.
fn leaves(vector: &Value, place: &str, found: &mut Vec<String>) {
    match vector.pointer(place) {
        Some(Value::Object(map)) => {
            map.keys().for_each(|field| leaves(vector, &format!("{place}/{field}"), found));
        }
        Some(Value::Array(list)) => {
            (0..list.len()).for_each(|index| leaves(vector, &format!("{place}/{index}"), found));
        }
        Some(_) => found.push(place.into()),
        None => {}
    }
}

/// Another value of the same sort, further off than any tolerance of the public vectors.
fn spoil(value: &Value) -> Value {
    match value {
        Value::Bool(flag) => json!(!flag),
        Value::Number(number) => match number.as_i64() {
            Some(whole) => json!(whole + 2),
            None => json!(number.as_f64().unwrap_or_default() * 1.01 + 0.001),
        },
        Value::String(text) => {
            let (rest, last) = text.split_at(text.len().saturating_sub(1));
            json!(format!("{rest}{}", if last == "1" { "2" } else { "1" }))
        }
        _ => json!(1),
    }
}

/// Each number, flag or byte string that a result is compared with, changed, must fail.
pub fn every_expectation_counts() -> Check {
    for vector in runnable()? {
        let mut places = Vec::new();
        leaves(&vector, "/expect", &mut places);
        if matches!(vector["kind"].as_str(), Some("encode" | "encode_bus")) {
            leaves(&vector, "/frame", &mut places);
            leaves(&vector, "/frames", &mut places);
        }
        if places.is_empty() && vector["kind"] != "reject" {
            return Err(format!("compares nothing: {vector}"));
        }
        for place in places {
            let mut spoilt = vector.clone();
            if let Some(value) = spoilt.pointer_mut(&place) {
                *value = spoil(value);
            }
            must_fail(&spoilt)?;
        }
        if vector["kind"] == "decode" {
            let mut refused = vector.clone();
            refused["kind"] = "reject".into();
            if let Some(map) = refused.as_object_mut() {
                map.remove("expect");
            }
            must_fail(&refused)?;
        }
    }
    Ok(())
}

/// A kind, a model or a field the runner does not know, wherever it stands, must fail.
pub fn nothing_unknown_is_skipped() -> Check {
    for vector in runnable()? {
        let mut strange = vector.clone();
        strange["kind"] = "telepathy".into();
        must_fail(&strange)?;
        let within = ["", "/inputs", "/inputs/frame", "/expect", "/expect/as_c620", "/frame"];
        for place in within.into_iter().chain(["/frames/0"]) {
            let mut strange = vector.clone();
            if let Some(Value::Object(map)) = strange.pointer_mut(place) {
                map.insert("surprise".into(), json!(1));
                must_fail(&strange)?;
            }
        }
        for place in ["/expect", "/expect/as_c620"] {
            let mut empty = vector.clone();
            if let Some(value) = empty.pointer_mut(place) {
                *value = json!({});
                must_fail(&empty)?;
            }
        }
        for place in ["/inputs/model", "/inputs/devices/0/0"] {
            let mut strange = vector.clone();
            if let Some(value) = strange.pointer_mut(place) {
                *value = "m9999".into();
                must_fail(&strange)?;
            }
        }
    }
    Ok(())
}

/// A tolerance holds to its last step, and names a field that is compared.
pub fn tolerances_are_kept() -> Check {
    let convert = |raw: i32, tolerance: Value| {
        json!({ "protocol": "dji", "kind": "convert", "inputs": {"model": "c620", "current_A": 0.3},
                "expect": {"raw_i16": raw}, "tol_lsb": tolerance })
    };
    for tolerance in [json!(1), json!({"raw_i16": 1})] {
        run(convert(247, tolerance.clone()))?;
        must_fail(&convert(248, tolerance))?;
    }
    must_fail(&convert(246, json!({"raw_i61": 1})))?;
    let decode = |tolerance: &str, value: Value| {
        let frame = json!({"bus": "can", "ext": false, "id": "0x205", "dlc": 8,
                           "data": "1234003c15552f00"});
        // 6.666 A, with 1.2 mA a step.
        let mut vector = json!({ "protocol": "dji", "kind": "decode", "frame": frame,
                                 "expect": {"as_c620": {"current_A": 6.668}} });
        vector[tolerance] = value;
        vector
    };
    must_fail(&decode("rel_tol", json!(1e-4)))?;
    must_fail(&decode("abs_tol", json!(1e-3)))?;
    must_fail(&decode("abs_tol_lsb", json!({"current_A": 1})))?;
    for (tolerance, value) in [("rel_tol", 1e-3), ("abs_tol", 2e-3), ("abs_tol_lsb", 2.0)] {
        run(decode(tolerance, json!(value)))?;
        run(decode(tolerance, json!({ "current_A": value })))?;
    }
    Ok(())
}

/// A file that is missing, broken, empty, or all about protocols that do not exist must fail.
pub fn a_useless_file_fails() -> Check {
    let skipped = json!({"vectors": [{"protocol": "morse", "kind": "decode"}]}).to_string();
    let empty = r#"{"vectors": []}"#;
    let broken = ["", "{", "[]", "{}", r#"{"vectors": 3}"#, empty, &skipped];
    let nameless = r#"{"vectors": [{"kind": "decode"}]}"#;
    for text in broken.into_iter().chain([nameless, r#"{"vectors": [7]}"#]) {
        // `run_text` would print these as if they were results.
        let outcome = vectors(text).and_then(|vectors| {
            let ran = vectors.into_iter().map(run).collect::<Check<Vec<_>>>()?;
            ran.contains(&Ran::Yes).then_some(()).ok_or_else(|| "nothing ran".into())
        });
        if outcome.is_ok() {
            return Err(format!("passes: {text}"));
        }
    }
    if run_text(empty).is_ok() || read("no/such/file.json".into()).is_ok() {
        return Err("a file without vectors passes".into());
    }
    Ok(())
}
