//! Ports of this PC, serial ones and those of servers: how they are opened, and why not.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
#[cfg(unix)]
use std::os::fd::OwnedFd;
use std::time::Duration;

use anyhow::{Context, Result, anyhow, ensure};
use rc10_module::remote::{Parity, SerialSettings};
#[cfg(unix)]
use rustix::{fs, termios};

use crate::args::address;

/// Bytes in both directions; a read waits for a few milliseconds.
pub(super) trait Port: Read + Write + Send {
    /// Bytes that were written and have not left, if the system says so.
    fn unsent(&self) -> u32 {
        0
    }
}
impl Port for TcpStream {}
impl Port for Box<dyn serialport::SerialPort> {
    fn unsent(&self) -> u32 {
        self.bytes_to_write().unwrap_or(0)
    }
}

/// Time limit for a serial server to connect, and to take what is sent.
const CONNECTS: Duration = Duration::from_millis(1000);
const TAKES: Duration = Duration::from_millis(200);

/// Settings of a serial port without parity.
pub(super) const fn plain(baud: u32) -> SerialSettings {
    SerialSettings { baud, parity: Parity::None, stop_bits: 1, inverted: false }
}

/// Opens a serial port, or tcp:HOST:PORT. A read waits for this time.
pub(super) fn open_port(
    name: &str,
    settings: SerialSettings,
    patience: Duration,
) -> Result<Box<dyn Port>> {
    let Some(text) = name.strip_prefix("tcp:") else { return serial(name, settings, patience) };
    let stream = TcpStream::connect_timeout(&address(text).context("tcp:HOST:PORT")?, CONNECTS);
    with_limits(stream.with_context(|| format!("{name}: nothing answers there"))?, patience)
}

pub(super) fn with_limits(stream: TcpStream, patience: Duration) -> Result<Box<dyn Port>> {
    if patience.is_zero() {
        stream.set_nonblocking(true)?;
    } else {
        stream.set_read_timeout(Some(patience))?;
    }
    stream.set_write_timeout(Some(TAKES))?;
    stream.set_nodelay(true)?;
    Ok(Box::new(stream))
}

/// Why a port cannot be opened that is not there, and may come.
pub(super) fn missing(why: String) -> io::Error {
    io::Error::new(ErrorKind::NotFound, why)
}

/// Whether that is why.
pub(super) fn is_missing(why: &anyhow::Error) -> bool {
    use ErrorKind::{ConnectionRefused, HostUnreachable, NetworkUnreachable, NotFound, TimedOut};
    let may_come = [NotFound, ConnectionRefused, HostUnreachable, NetworkUnreachable, TimedOut];
    why.downcast_ref::<io::Error>().is_some_and(|it| may_come.contains(&it.kind()))
}

/// Whether a serial port can have this name.
fn is_port_name(name: &str) -> bool {
    let number = name.trim_start_matches(r"\\.\").strip_prefix("COM");
    if cfg!(windows) {
        number.is_some_and(|it| it.parse::<u16>().is_ok())
    } else {
        name.starts_with('/')
    }
}

fn serial(name: &str, settings: SerialSettings, patience: Duration) -> Result<Box<dyn Port>> {
    use serialport::{Parity as Bit, StopBits};
    let SerialSettings { baud, parity, stop_bits, .. } = settings;
    let is_checked = parity == Parity::Even;
    let parity = if is_checked { Bit::Even } else { Bit::None };
    let stop_bits = if stop_bits == 2 { StopBits::Two } else { StopBits::One };
    let port = serialport::new(name, baud).parity(parity).stop_bits(stop_bits).timeout(patience);
    // For the settings that `serialport` has no word for: opened twice, as it keeps the port for itself from then on.
    #[cfg(unix)]
    let terminal = is_checked.then(|| second(name));
    let port = port.open().map_err(|error| refusal(name, &error))?;
    #[cfg(unix)]
    if let Some(terminal) = terminal {
        leave_damaged_out(&terminal?).with_context(|| name.to_owned())?;
    }
    fits(name, baud, port.baud_rate().unwrap_or(baud))?;
    Ok(Box::new(port))
}

#[cfg(unix)]
fn second(name: &str) -> rustix::io::Result<OwnedFd> {
    use fs::OFlags;
    fs::open(name, OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK, fs::Mode::empty())
}

/// Bytes with a wrong parity are left out, so that their frame is too short, as on a board: else they come as zeros.
#[cfg(unix)]
fn leave_damaged_out(terminal: &OwnedFd) -> rustix::io::Result<()> {
    let mut modes = termios::tcgetattr(terminal)?;
    modes.input_modes |= termios::InputModes::IGNPAR;
    termios::tcsetattr(terminal, termios::OptionalActions::Now, &modes)
}

/// Some adapters take the nearest rate that they have, and say which.
fn fits(name: &str, asked: u32, has: u32) -> Result<()> {
    let fits = asked.abs_diff(has) <= asked / 33;
    ensure!(fits, "{name}: it has {has} bits a second, not {asked}: another adapter is needed");
    Ok(())
}

/// Why a serial port cannot be opened, and what helps.
fn refusal(name: &str, error: &serialport::Error) -> anyhow::Error {
    use serialport::ErrorKind as Kind;
    let text = error.to_string().to_lowercase();
    let why = match error.kind() {
        Kind::Io(ErrorKind::PermissionDenied) if cfg!(windows) => {
            format!("{name}: another program has it open")
        }
        Kind::Io(ErrorKind::PermissionDenied) => format!(
            "{name}: no permission. Once: sudo usermod -aG dialout $USER, and log in again; or a udev \
             rule: SUBSYSTEM==\"tty\", MODE=\"0666\" in /etc/udev/rules.d/60-rc10.rules"
        ),
        Kind::NoDevice | Kind::Io(ErrorKind::NotFound) => {
            if text.contains("busy") || text.contains("lock") {
                format!("{name}: another program has it open")
            } else if is_port_name(name) {
                return missing(format!("{name}: there is no such port")).into();
            } else {
                format!("{name}: there is no such port, and none has such a name")
            }
        }
        _ if text.contains("busy") => format!("{name}: another program has it open"),
        _ => format!("{name}: {error}"),
    };
    anyhow!(why)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn bytes_with_a_wrong_parity_are_left_out() {
        use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
        let near = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&near).and_then(|()| unlockpt(&near)).unwrap();
        let name = ptsname(&near, Vec::new()).unwrap().into_string().unwrap();
        let settings = SerialSettings { parity: Parity::Even, ..plain(100_000) };
        let _port = serial(&name, settings, Duration::ZERO).unwrap();
        let modes = termios::tcgetattr(&near).unwrap().input_modes;
        assert!(modes.contains(termios::InputModes::IGNPAR), "{modes:?}");
    }

    #[test]
    fn a_rate_that_an_adapter_has_not_is_told() {
        let told = |asked, has| fits("COM4", asked, has).err().map(|why| why.to_string());
        assert_eq!(told(100_000, 100_000), None);
        // An FT232R's 13/4 of 3 MHz.
        assert_eq!(told(921_600, 923_077), None);
        let why = "COM4: it has 115200 bits a second, not 100000: another adapter is needed";
        assert_eq!(told(100_000, 115_200).as_deref(), Some(why));
    }
}
