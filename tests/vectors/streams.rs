//! Vectors of bytes on a serial line: the messages that a stream finds in them, for all protocols.

use rc10_module::{Protocol, Stream};
use rc10_time::Micros;
use serde_json::{Map, Value};

use crate::fields::{Check, Fields, Tolerance, same};
use crate::unitree::{bytes, uart};

/// Compares the fields of a message with the expected ones.
pub type Compare<M> = fn(&M, &Value, &mut Tolerance) -> Check;

/// The kinds that all protocols have; the others are `Ok(false)`. All bytes come as a whole, one by
/// one, and in sevens.
pub fn received<P: Protocol<Message: std::fmt::Debug> + Copy>(
    protocol: P,
    kind: &str,
    vector: &mut Fields,
    tolerance: &mut Tolerance,
    compare: Compare<P::Message>,
) -> Check<bool> {
    match kind {
        "decode" => {
            let frame = uart(vector.object("frame")?)?;
            let expected = vector.take("expect")?;
            for pieces in [frame.len(), 1, 7] {
                let (messages, skipped) = heard(protocol, &frame, pieces);
                let [message] = messages.as_slice() else {
                    return Err(format!("in one frame: {messages:?}"));
                };
                same("bytes outside the frame", skipped == 0, &0, &skipped)?;
                compare(message, &expected, tolerance)?;
            }
        }
        "reject" => {
            let bytes = uart(vector.object("frame")?)?;
            for pieces in [bytes.len(), 1, 7] {
                let (messages, _) = heard(protocol, &bytes, pieces);
                same("rejected", messages.is_empty(), &"nothing", &format!("{messages:?}"))?;
            }
        }
        "stream" | "sequence" => {
            let mut inputs = vector.object("inputs")?;
            let bytes = bytes(&inputs.text("bytes")?)?;
            inputs.finish()?;
            let mut expect = vector.object("expect")?;
            let expected = expect.list("frames")?;
            expect.finish()?;
            for pieces in [bytes.len(), 1, 7] {
                let (messages, _) = heard(protocol, &bytes, pieces);
                in_order(&expected, &messages, tolerance, compare)?;
            }
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// Messages of a stream from bytes in pieces, and silence behind them; and the number of bytes in
/// no frame.
pub fn heard<P: Protocol>(protocol: P, bytes: &[u8], pieces: usize) -> (Vec<P::Message>, u32) {
    let (mut stream, mut heard) = (Stream::new(protocol), Vec::new());
    for piece in bytes.chunks(pieces.max(1)) {
        stream.receive(piece, Micros::ZERO, |message| heard.push(message));
    }
    stream.receive(&[], Micros::from_millis(1000), |message| heard.push(message));
    (heard, stream.counters().skipped)
}

/// As many messages as are expected, one like the other.
pub fn in_order<M: std::fmt::Debug>(
    expected: &[Value],
    messages: &[M],
    tolerance: &mut Tolerance,
    compare: impl Fn(&M, &Value, &mut Tolerance) -> Check,
) -> Check {
    let count = expected.len();
    same("frames", count == messages.len(), &count, &format!("{messages:?}"))?;
    messages.iter().zip(expected).try_for_each(|(message, one)| compare(message, one, tolerance))
}

/// The fields of what a message should be; expecting nothing proves nothing.
pub fn expectations(expected: &Value) -> Check<Map<String, Value>> {
    Fields::of("expect", expected.clone())?.into_expectations()
}

/// Refuses a vector of an unknown kind.
pub fn understood(known: bool, kind: &str) -> Check {
    if known { Ok(()) } else { Err(format!("this runner does not know the kind `{kind}`")) }
}
