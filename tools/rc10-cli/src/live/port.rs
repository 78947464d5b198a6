//! Ports of this PC, serial ones and those of servers: how they are opened, and why not.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use anyhow::{Context, Result, bail};

use crate::args::address;

/// Bytes in both directions; a read waits for a few milliseconds.
pub(super) trait Port: Read + Write + Send {}
impl<T: Read + Write + Send> Port for T {}

/// Time limit for a serial server to connect, and to take what is sent.
const CONNECTS: Duration = Duration::from_millis(1000);
const TAKES: Duration = Duration::from_millis(200);

/// Opens a serial port, or tcp:HOST:PORT. A read waits for this time.
pub(super) fn open_port(name: &str, baud: u32, patience: Duration) -> Result<Box<dyn Port>> {
    let Some(text) = name.strip_prefix("tcp:") else { return serial(name, baud, patience) };
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

fn serial(name: &str, baud: u32, patience: Duration) -> Result<Box<dyn Port>> {
    match serialport::new(name, baud).timeout(patience).open() {
        Ok(port) => Ok(Box::new(port)),
        Err(error) => bail!("{}", refusal(name, &error)),
    }
}

/// Why a serial port cannot be opened, and what helps.
fn refusal(name: &str, error: &serialport::Error) -> String {
    use serialport::ErrorKind as Kind;
    let text = error.to_string().to_lowercase();
    match error.kind() {
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
            } else {
                format!("{name}: there is no such port")
            }
        }
        _ if text.contains("busy") => format!("{name}: another program has it open"),
        _ => format!("{name}: {error}"),
    }
}
