//! `SocketCAN`'s port before a socket whose messages are built here by hand, as linux/can.h lays them out: machines of a
//! check have no CAN in their kernel.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::io::{Error, ErrorKind, Read as _, Write as _};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixDatagram;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use rc10_cli::formats::slcan::BELL;
use rc10_cli::formats::slcan::socket::{SocketPort, is_full};

/// Flags of an identifier: extended, a remote request, an error frame, whose class is bus-off.
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const BUS_OFF: u32 = 1 << 29 | 0x40;

/// `struct can_frame`: identifier, length, three bytes of no meaning, eight bytes.
fn message(id: u32, data: &[u8], len: usize) -> [u8; 16] {
    let mut message = [0; 16];
    message[..4].copy_from_slice(&id.to_ne_bytes());
    message[4] = len.try_into().unwrap();
    message[8..8 + data.len()].copy_from_slice(data);
    message
}

fn pair() -> (UnixDatagram, SocketPort) {
    let (kernel, ours) = UnixDatagram::pair().unwrap();
    kernel.set_nonblocking(true).unwrap();
    (kernel, OwnedFd::from(ours).try_into().unwrap())
}

/// Frames as the kernel has them, and as lines.
fn frames() -> [([u8; 16], &'static str); 5] {
    [
        (message(0x201, &[0xAB, 0xCD], 2), "t2012ABCD\r"),
        (message(0x7FF, &[1, 2, 3, 4, 5, 6, 7, 8], 8), "t7FF80102030405060708\r"),
        (message(EXTENDED | 0x1234_5678, &[0xFE], 1), "T123456781FE\r"),
        (message(REMOTE | 0x009, &[], 8), "r0098\r"),
        (message(EXTENDED | REMOTE | 0x1F, &[], 0), "R0000001F0\r"),
    ]
}

#[test]
fn frames_go_both_ways_whole() {
    let (kernel, mut port) = pair();
    let (mut buffer, mut heard) = ([0; 7], Vec::new());
    for (message, _) in frames() {
        kernel.send(&message).unwrap();
    }
    let end = loop {
        match port.read(&mut buffer) {
            Ok(count) => heard.extend(&buffer[..count]),
            Err(error) => break error.kind(),
        }
    };
    let lines = frames().map(|(_, line)| line).concat();
    assert_eq!((String::from_utf8(heard).unwrap(), end), (lines.clone(), ErrorKind::WouldBlock));

    // What an adapter is told beside frames says nothing here; a line in two pieces is one.
    let text = ["\r\rC\rS8\rZ0\rO\r", &lines].concat();
    for piece in text.as_bytes().chunks(9) {
        assert_eq!(port.write(piece).unwrap(), piece.len());
    }
    for (message, line) in frames() {
        let mut sent = [0xFF; 17];
        assert_eq!(kernel.recv(&mut sent).unwrap(), 16);
        assert_eq!(sent[..16], message, "{line}");
    }
    assert_eq!(kernel.recv(&mut [0; 17]).unwrap_err().kind(), ErrorKind::WouldBlock);
}

#[test]
fn a_full_queue_bus_off_and_an_end_are_told() {
    let (kernel, mut port) = pair();
    let mut sent = 0;
    // The queue is this machine's: some frames fit.
    let told = loop {
        assert_eq!(port.write(b"t20018F\r").unwrap(), 8);
        let mut buffer = [0; 9];
        match port.read(&mut buffer) {
            Ok(count) => break buffer[..count].to_vec(),
            Err(error) => assert_eq!(error.kind(), ErrorKind::WouldBlock),
        }
        sent += 1;
        assert!(sent < 100_000);
    };
    assert_eq!(told, [BELL]);
    let there = std::iter::from_fn(|| kernel.recv(&mut [0; 17]).ok()).count();
    assert!(there == sent && sent > 0, "{there} of {sent}");

    kernel.send(&message(BUS_OFF, &[], 8)).unwrap();
    assert_eq!(port.read(&mut [0; 9]).unwrap_err().to_string(), "bus-off");
    drop(kernel);
    // A program that another test begins has this end of the socket for a moment, too.
    let end = (0..10_000).find_map(|_| {
        sleep(Duration::from_millis(1));
        port.write(b"t2000\r").err()
    });
    let end = end.unwrap();
    assert_ne!(end.kind(), ErrorKind::WouldBlock);
}

#[test]
fn a_full_queue_of_linux_is_no_end() {
    // ENOBUFS and EAGAIN; ENETDOWN and ENODEV.
    assert!([105, 11].iter().all(|it| is_full(&Error::from_raw_os_error(*it))));
    assert!([100, 19].iter().all(|it| !is_full(&Error::from_raw_os_error(*it))));
}

#[test]
fn an_interface_that_is_not_there_is_told_with_what_helps() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewers"));
    let output = command.args(["drive", "--page", "0", "--bus", "1=nocan7"]).output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("nocan7: no CAN interface that is up; ip link set nocan7 up"), "{text}");
}
