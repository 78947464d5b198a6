use std::cell::RefCell;

use embassy_time::{Instant, Timer};
use embedded_io_async::ErrorKind;
use rc10_module::remote::{
    NotSerial, Parity, Receiver, Remote, RemoteLink, Switch, Watch, listen, listen_pulses,
};
use rc10_module::{Counters, Reception};
use rc10_time::Micros;

use crate::clock::{Line, run_until};

const DBUS: [u8; 18] = [0x6C, 0xA1, 0x34, 0x5B, 0x28, 0xED, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x94, 6];
const SBUS: [u8; 25] = [
    0x0F, 0xE0, 0x03, 0x1F, 0x2B, 0xC0, 0x37, 0x71, 0x56, 0x80, 0x0F, 0x7C, 0xAC, 0x60, 0xC5, 0xC4,
    0x27, 0x0E, 0x3E, 0xF0, 0x81, 0x0F, 0x7C, 0x00, 0x00,
];
const CRSF: [u8; 26] = [
    0xC8, 0x18, 0x16, 0xE0, 0x03, 0x1F, 0x2B, 0xC0, 0x37, 0x71, 0x56, 0x80, 0x0F, 0x7C, 0xAC, 0x60,
    0xC5, 0xC4, 0x27, 0x0E, 0x3E, 0xF0, 0x81, 0x0F, 0x7C, 0xF9,
];
const VT03: [u8; 21] = [
    0xA9, 0x53, 0x90, 0x01, 0x32, 0xFA, 0x98, 0x88, 0x28, 0x0A, 0xD2, 0x04, 0x1F, 0xEF, 0x0A, 0x00,
    0x04, 0x11, 0x02, 0xE7, 0x39,
];

/// The remotes that a receiver's task hears of a line until a second after its end.
fn heard(receiver: Receiver, mut line: Line) -> (Vec<(Remote, u64)>, Counters) {
    let start = Instant::now().as_micros();
    line.events.iter_mut().for_each(|(at, _)| *at += start);
    let heard = RefCell::new(Vec::new());
    let reception = Reception::new();
    let end = start + line.now + 1_000_000;
    let hear = |remote, at: Micros| heard.borrow_mut().push((remote, at.get() - start));
    assert_eq!(run_until(end, listen(receiver, receiver.channels(), line, &reception, hear)), None);
    (heard.into_inner(), reception.read())
}

fn byte_ns(receiver: Receiver) -> u64 {
    let serial = receiver.serial().expect("one on a UART");
    u64::from(serial.character_bits()) * 1_000_000_000 / u64::from(serial.baud)
}

const SERIAL: [(Receiver, &[u8]); 4] = [
    (Receiver::Dr16, &DBUS),
    (Receiver::Sbus, &SBUS),
    (Receiver::Crsf, &CRSF),
    (Receiver::Vt03, &VT03),
];

#[test]
fn a_uart_is_set_as_the_receiver_wants() {
    let set = |receiver: Receiver| {
        receiver.serial().map(|s| (s.baud, s.parity == Parity::Even, s.stop_bits, s.inverted))
    };
    assert_eq!(set(Receiver::Dr16), Some((100_000, true, 1, true)));
    assert_eq!(set(Receiver::Sbus), Some((100_000, true, 2, true)));
    assert_eq!(set(Receiver::Crsf), Some((420_000, false, 1, false)));
    assert_eq!(set(Receiver::Vt03), Some((921_600, false, 1, false)));
    assert_eq!(set(Receiver::Ppm), None);
}

#[test]
fn every_frame_is_heard_with_the_time_of_its_last_byte() {
    for (receiver, frame) in SERIAL {
        let mut line = Line { now: 5000, ..Line::default() };
        let mut ends = Vec::new();
        for _ in 0..5 {
            line.send(frame, byte_ns(receiver));
            ends.push(line.now);
            line.now += 7000;
        }
        let (heard, counters) = heard(receiver, line);
        assert_eq!(heard.len(), 5, "{receiver:?}");
        for ((remote, at), end) in heard.iter().zip(ends) {
            assert!((end..end + 20).contains(at), "{receiver:?}: {end} {at}");
            assert_eq!(*remote, heard[0].0);
        }
        assert_eq!((counters.frames, counters.damaged, counters.skipped), (5, 0, 0));
    }
}

#[test]
fn remotes_say_what_their_frames_do() {
    let only = |receiver, frame: &[u8]| {
        let mut line = Line::default();
        line.send(frame, byte_ns(receiver));
        let (heard, _) = heard(receiver, line);
        assert_eq!(heard.len(), 1);
        heard[0].0
    };
    let dbus = only(Receiver::Dr16, &DBUS);
    assert_eq!((dbus.right.x, dbus.right.y, dbus.left.x, dbus.left.y), (-1.0, 1.0, -1.0, 1.0));
    assert_eq!((dbus.right_switch, dbus.left_switch), (Switch::Down, Switch::Middle));
    assert_eq!((dbus.dial, dbus.failsafe), (1.0, false));
    for remote in [only(Receiver::Sbus, &SBUS), only(Receiver::Crsf, &CRSF)] {
        let (left, right) = (remote.left, remote.right);
        assert_eq!((right.x, right.y, left.y, left.x), (0.0, 0.0, -1.0, 0.0));
        assert_eq!((remote.right_switch, remote.left_switch), (Switch::Down, Switch::Up));
        assert_eq!((remote.more_switches, remote.dial), ([Switch::Middle; 2], -1.0));
    }
    let vt03 = only(Receiver::Vt03, &VT03);
    assert!(vt03.right.x < -0.9 && vt03.right.y > 0.85 && vt03.left.y < 0.0 && vt03.left.x > 0.0);
    assert_eq!((vt03.right_switch, vt03.left_switch), (Switch::Down, Switch::Up));
}

#[test]
fn the_frame_after_a_fault_is_heard() {
    for (receiver, frame) in SERIAL {
        let mut line = Line::default();
        line.send(&frame[..9], byte_ns(receiver));
        line.now += byte_ns(receiver) / 1000;
        line.events.push_back((line.now, Err(ErrorKind::Other)));
        line.send(&frame[10..], byte_ns(receiver));
        for _ in 0..2 {
            line.now += 7000;
            line.send(frame, byte_ns(receiver));
        }
        let (heard, counters) = heard(receiver, line);
        assert_eq!((heard.len(), counters.port_errors), (2, 1), "{receiver:?}");
        assert_eq!(counters.skipped as usize, frame.len() - 1);
    }
}

#[test]
fn noise_glued_to_a_frame_is_not_heard_as_another() {
    let mut line = Line::default();
    // A byte of noise: the frame's first seventeen bytes and it are eighteen.
    line.send(&[0xFF, 0x03], byte_ns(Receiver::Dr16));
    line.send(&DBUS, byte_ns(Receiver::Dr16));
    line.now += 12_000;
    line.send(&DBUS, byte_ns(Receiver::Dr16));
    let (heard, counters) = heard(Receiver::Dr16, line);
    assert_eq!((heard.len(), counters.damaged, counters.skipped), (1, 1, 20));
}

#[test]
fn a_receiver_that_lost_its_remote_is_no_news() {
    let mut line = Line::default();
    for flags in [0, 4, 4, 12, 0] {
        let mut frame = SBUS;
        frame[23] = flags;
        line.send(&frame, byte_ns(Receiver::Sbus));
        line.now += 11_000;
    }
    let (frames, _) = heard(Receiver::Sbus, line);
    assert_eq!(
        frames.iter().map(|(remote, _)| remote.failsafe).collect::<Vec<_>>(),
        [false, true, false]
    );
    let mut watch = Watch::new();
    let freshness = frames.iter().map(|(remote, at)| {
        watch.heard(remote, Micros::new(*at));
        watch.link(Micros::new(*at))
    });
    assert!(freshness.eq([RemoteLink::Online, RemoteLink::Interrupted, RemoteLink::Online]));

    let lost = [0xC8, 12, 0x14, 130, 130, 0, 0, 0, 0, 0, 0, 0, 0, 0x8E];
    let found = [0xC8, 12, 0x14, 70, 70, 99, 0, 0, 0, 0, 0, 0, 0, 0x3F];
    let mut line = Line::default();
    for frame in [&CRSF[..], &lost, &CRSF, &found, &CRSF] {
        line.send(frame, byte_ns(Receiver::Crsf));
        line.now += 4000;
    }
    let (frames, counters) = heard(Receiver::Crsf, line);
    assert_eq!((counters.frames, counters.damaged), (5, 0));
    let failsafe: Vec<_> = frames.iter().map(|(remote, _)| remote.failsafe).collect();
    assert_eq!(failsafe, [false, true, true, false]);
}

#[test]
fn pulses_are_heard_as_pulses_only() {
    let reception = Reception::new();
    let refused = run_until(
        0,
        listen(Receiver::Ppm, Receiver::Ppm.channels(), Line::default(), &reception, |_, _| {}),
    );
    assert_eq!(refused, Some(Err(NotSerial)));

    let mut edges = vec![0];
    for _ in 0..3 {
        for interval in [1000, 2000, 1500, 1500, 2000, 1000, 1500, 1000, 8500] {
            edges.push(edges[edges.len() - 1] + interval);
        }
    }
    let (mut edges, end) = (edges.clone().into_iter().peekable(), edges[edges.len() - 1]);
    let next = async || {
        let Some(at) = edges.peek().copied() else { return std::future::pending().await };
        Timer::at(Instant::from_micros(at)).await;
        edges.next();
        Micros::new(at)
    };
    let heard = RefCell::new(Vec::new());
    let hear = |remote: Remote, at: Micros| heard.borrow_mut().push((remote, at.get()));
    assert!(
        run_until(end + 1000, listen_pulses(Receiver::Ppm.channels(), next, &reception, hear))
            .is_none()
    );
    let heard = heard.into_inner();
    // 2.1 ms behind the last channel's end, not at the next frame's begin.
    assert_eq!((heard.len(), heard[1].1), (2, end - 8500 + 2100));
    let remote = heard[0].0;
    assert_eq!((remote.left.x, remote.left.y, remote.right.y), (-1.0, 1.0, 0.0));
    assert_eq!((remote.right_switch, remote.left_switch), (Switch::Down, Switch::Up));
    assert_eq!(remote.more_switches, [Switch::Middle, Switch::Up]);
    assert_eq!((reception.read().frames, reception.read().damaged), (2, 0));
}
