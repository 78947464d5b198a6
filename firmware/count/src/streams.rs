//! Each serial protocol through a stream: good frames, and the most laborious garbage.

use core::hint::black_box;

use rc10_module::imu::Wit;
use rc10_module::positioning::{Action, Rc9};
use rc10_module::ranging::{Jrt, Stp23l, TfMini};
use rc10_module::referee::Referee;
use rc10_module::remote::{Crsf, Dbus, Sbus, Vt03};
use rc10_module::vision::RmVision;
use rc10_module::{Protocol, Stream};
use rc10_time::Micros;

/// Measures all of them.
pub fn measure() {
    action();
    crsf();
    dbus();
    jrt();
    rc9();
    referee();
    rm_vision();
    sbus();
    stp23l();
    tfmini();
    vt03();
    wit();
}

/// Bytes and the time of their arrival.
type Piece<'b> = (&'b [u8], Micros);

/// Each good frame is a piece: the line is idle behind it.
fn good<P: Protocol>(protocol: P, frames: &[&[u8]], receive: fn(&mut Stream<P>, &Piece<'_>)) {
    let mut stream = Stream::new(protocol);
    for round in 0..8 {
        for frame in frames {
            let at = Micros::from_millis(20).get() * u64::from(stream.counters().frames + 1);
            receive(black_box(&mut stream), &(black_box(frame), Micros::new(at)));
        }
        if stream.counters().frames as usize != frames.len() * (round + 1)
            || stream.counters().skipped != 0
        {
            // An invalid frame.
            cortex_m::asm::udf();
        }
    }
}

/// Bytes of garbage that a measured call takes.
const GARBAGE: usize = 1024;
/// Bytes that a port gives at once.
const PIECE: usize = 64;

/// Noise; and each of these patterns again and again, which look like frames as often as can be.
fn garbage<P: Protocol>(
    protocol: fn() -> P,
    patterns: &[&[u8]],
    receive_noise: fn(&mut Stream<P>, &[u8; GARBAGE]),
    receive: fn(&mut Stream<P>, &[u8; GARBAGE]),
) {
    let mut noise = 1_u32;
    let mut bytes = [0; GARBAGE];
    bytes.fill_with(|| {
        // Numerical Recipes' generator; its upper bits are the good ones.
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (noise >> 24) as u8
    });
    receive_noise(&mut Stream::new(protocol()), black_box(&bytes));
    for pattern in patterns {
        for (to, from) in bytes.iter_mut().zip(pattern.iter().cycle()) {
            *to = *from;
        }
        receive(&mut Stream::new(protocol()), black_box(&bytes));
    }
}

/// Takes bytes, and the silence behind them.
#[inline(always)]
fn take<P: Protocol>(stream: &mut Stream<P>, (bytes, at): Piece<'_>) {
    stream.receive(bytes, at, |message| {
        black_box(message);
    });
    stream.receive(&[], at + Micros::from_millis(5), |message| {
        black_box(message);
    });
}

/// Takes bytes that are no frames, in pieces from a time on.
#[inline(always)]
fn take_pieces<P: Protocol>(stream: &mut Stream<P>, bytes: &[u8; GARBAGE], mut at: Micros) {
    for piece in bytes.chunks(PIECE) {
        at += Micros::from_millis(10);
        take(stream, (piece, at));
    }
}

/// The three measured functions of a protocol, and what they are given.
macro_rules! stream {
    ($name:ident: $protocol:expr, $type:ty, $good:literal, $noise:literal, $garbage:literal,
     frames: $frames:expr, patterns: $patterns:expr) => {
        fn $name() {
            // SAFETY: nothing else has this name.
            #[unsafe(export_name = $good)]
            #[inline(never)]
            fn receive(stream: &mut Stream<$type>, piece: &Piece<'_>) {
                take(stream, *piece);
            }

            // SAFETY: nothing else has this name.
            #[unsafe(export_name = $garbage)]
            #[inline(never)]
            fn receive_garbage(stream: &mut Stream<$type>, bytes: &[u8; GARBAGE]) {
                take_pieces(stream, bytes, Micros::ZERO);
            }

            // SAFETY: nothing else has this name.
            #[unsafe(export_name = $noise)]
            #[inline(never)]
            fn receive_noise(stream: &mut Stream<$type>, bytes: &[u8; GARBAGE]) {
                // From another time on than the above, or the two are made one function.
                take_pieces(stream, bytes, Micros::from_millis(10));
            }

            good($protocol, &$frames, receive);
            garbage(|| $protocol, &$patterns, receive_noise, receive_garbage);
        }
    };
}

stream! {
    action: Action, Action, "count_28_stream_action", "count_1024_noise_action", "count_1024_garbage_action",
    frames: [
        b"\x0D\x0A\x00\x00\x48\x41\x00\x00\x80\xBE\x00\x00\x00\x3F\x00\x50\x9A\x44\x00\x90\x29\xC4\x00\x00\x70\x40\x0A\x0D",
    ],
    patterns: [b"\x0D\x0A", b"\x0D"]
}

stream! {
    crsf: Crsf, Crsf, "count_26_stream_crsf", "count_1024_noise_crsf", "count_1024_garbage_crsf",
    frames: [
        b"\xC8\x18\x16\xE0\x03\x1F\xF8\xC0\x07\x3E\xF0\x81\x0F\x7C\xE0\x03\x1F\xF8\xC0\x07\x3E\xF0\x81\x0F\x7C\xAD",
        b"\xC8\x18\x16\x00\x0C\xC0\xFF\x01\x00\xA0\x84\xD5\x54\xD0\xCF\x57\x01\x15\x50\x01\x15\x50\x01\x15\x50\x47",
        b"\xC8\x18\x16\xE0\x03\x1F\x2B\xC0\x37\x71\x56\x80\x0F\x7C\xAC\x60\xC5\xC4\x27\x0E\x3E\xF0\x81\x0F\x7C\xF9",
    ],
    patterns: [b"\xC8\x3E", b"\xC8", b"\xC8\x18\x16"]
}

stream! {
    dbus: Dbus, Dbus, "count_18_stream_dbus", "count_1024_noise_dbus", "count_1024_garbage_dbus",
    frames: [
        b"\x00\x04\x20\x00\x01\xF8\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x04",
        b"\xFF\x13\x60\xFF\x08\x68\x00\x80\xFF\x7F\xFF\xFF\x00\x01\x01\x00\x94\x06",
        b"\x6C\xA1\x34\x5B\x28\xED\x0C\xFE\xEE\x02\x00\x00\x00\x00\x30\x01\x4D\x05",
    ],
    // Three frames and a half: none of them is believed.
    patterns: [b"\x00\x04\x20\x00\x01\xF8\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x04"]
}

stream! {
    jrt: Jrt, Jrt, "count_13_stream_jrt", "count_1024_noise_jrt", "count_1024_garbage_jrt",
    frames: [
        b"\xAA\x00\x00\x22\x00\x03\x00\x00\x10\xE1\x00\x78\x8E",
        b"\xAA\x00\x00\x22\x00\x03\x00\x00\x00\x00\x00\x00\x25",
    ],
    patterns: [b"\xAA", b"\xAA\x00\x00\x22\x00\x03"]
}

stream! {
    rc9: Rc9 { unchecked: false }, Rc9, "count_24_stream_rc9", "count_1024_noise_rc9", "count_1024_garbage_rc9",
    frames: [
        b"\xFC\xFB\x02\x10\x00\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0A\x0B\x0C\x0D\x0E\x0F\x3D\x51\xFD\xFE",
    ],
    patterns: [b"\xFC", b"\xFC\xFB\x01\x40"]
}

stream! {
    referee: Referee, Referee, "count_23_stream_referee", "count_1024_noise_referee", "count_1024_garbage_referee",
    frames: [
        b"\xA5\x0E\x00\x01\x69\x02\x02\x00\x00\x00\x00\x00\x00\x00\x00\x3C\x00\x0C\x00\x00\x00\xDE\x65",
    ],
    patterns: [b"\xA5", b"\xA5\x2C\x01\x00\x28"]
}

stream! {
    rm_vision: RmVision, RmVision, "count_48_stream_rm_vision", "count_1024_noise_rm_vision", "count_1024_garbage_rm_vision",
    frames: [
        b"\xA5\x47\x00\x00\x40\x40\x00\x00\x00\x3F\xCD\xCC\xCC\x3D\xCD\xCC\x4C\x3E\x00\x00\x80\x3F\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x40\x00\x00\x80\x3E\x9A\x99\x99\x3E\xCD\xCC\x4C\x3D\x48\x98",
    ],
    // One byte again and again; and as dense as packets with radii that are not negative can begin.
    patterns: [b"\xA5", b"\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\xA5\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00"]
}

stream! {
    sbus: Sbus, Sbus, "count_25_stream_sbus", "count_1024_noise_sbus", "count_1024_garbage_sbus",
    frames: [
        b"\x0F\xE0\x03\x1F\xF8\xC0\x07\x3E\xF0\x81\x0F\x7C\xE0\x03\x1F\xF8\xC0\x07\x3E\xF0\x81\x0F\x7C\x00\x00",
        b"\x0F\x00\x0C\xC0\xFF\x01\x00\xA0\x84\xD5\x54\xD0\xCF\x57\x01\x15\x50\x01\x15\x50\x01\x15\x50\x03\x00",
        b"\x0F\xE0\x03\x1F\x2B\xC0\x37\x71\x56\x80\x0F\x7C\xAC\x60\xC5\xC4\x27\x0E\x3E\xF0\x81\x0F\x7C\x0C\x00",
    ],
    patterns: [b"\x0F"]
}

stream! {
    stp23l: Stp23l, Stp23l, "count_195_stream_stp23l", "count_1024_noise_stp23l", "count_1024_garbage_stp23l",
    frames: [
        include_bytes!("stp23l.bin"),
    ],
    patterns: [b"\xAA", b"\xAA\xAA\xAA\xAA\x00\x02\x00\x00\xB8\x00"]
}

stream! {
    tfmini: TfMini, TfMini, "count_9_stream_tfmini", "count_1024_noise_tfmini", "count_1024_garbage_tfmini",
    frames: [
        b"\x59\x59\x7B\x00\xD7\x11\x90\x09\xAE",
        b"\x59\x59\xB0\x04\x64\x00\xC9\x08\x9B",
    ],
    patterns: [b"\x59"]
}

stream! {
    vt03: Vt03, Vt03, "count_21_stream_vt03", "count_1024_noise_vt03", "count_1024_garbage_vt03",
    frames: [
        b"\xA9\x53\x00\x04\x20\x00\x01\x18\x00\x08\x00\x00\x00\x00\x00\x00\x00\x00\x00\x52\x8C",
        b"\xA9\x53\x90\x01\x32\xFA\x98\x88\x28\x0A\xD2\x04\x1F\xEF\x0A\x00\x04\x11\x02\xE7\x39",
    ],
    patterns: [b"\xA9", b"\xA9\x53"]
}

stream! {
    wit: Wit, Wit, "count_11_stream_wit", "count_1024_noise_wit", "count_1024_garbage_wit",
    frames: [
        b"\x55\x51\x00\x08\x00\xFC\x00\x40\xC4\x09\xB7",
        b"\x55\x53\x00\x20\x00\xC0\xFF\x7F\x00\x00\x06",
        b"\x55\x52\x00\xC0\x64\x00\xC8\x00\x00\x00\x93",
    ],
    patterns: [b"\x55"]
}
