//! A CAN interface of Linux (`SocketCAN`) behind the text of an slcan adapter.

use std::io::{Error, ErrorKind, Read, Result, Write};
use std::os::fd::OwnedFd;

use rc10_can::CanFrame;
use rc10_can::embedded_can::Frame as _;
use rustix::io::Errno;
use socketcan::{CanSocket, Socket as _, SocketOptions as _};

use crate::formats::slcan::{BELL, Lines, SlcanCommand, write_frame};

/// The class of error frames that is asked for, `CAN_ERR_BUSOFF` of linux/can/error.h.
const BUS_OFF: u32 = 0x40;
/// So much text of frames is made at once, at most.
const TEXT: usize = 2048;

/// A CAN interface as a port: frames are read and written as lines of slcan; its bit rate is set by `ip link`.
///
/// A frame that its queue does not take is answered with a bell. Bus-off, and an interface that is down or gone, is an
/// error of reading or writing.
pub struct SocketPort {
    socket: CanSocket,
    lines: Lines,
    text: Vec<u8>,
}

impl SocketPort {
    /// Opens the interface of this name. Fails if it is missing or down.
    pub fn open(name: &str) -> Result<Self> {
        let socket = CanSocket::open(name)?;
        // Of an interface that is down it is the first word.
        if let Some(error) = socket.as_raw_socket().take_error()? {
            return Err(error);
        }
        socket.set_error_filter(BUS_OFF)?;
        Self::with(socket)
    }

    fn with(socket: CanSocket) -> Result<Self> {
        socket.set_nonblocking(true)?;
        Ok(Self { socket, lines: Lines::default(), text: Vec::new() })
    }
}

/// Any socket whose messages are frames in Linux' form.
impl TryFrom<OwnedFd> for SocketPort {
    type Error = Error;

    fn try_from(socket: OwnedFd) -> Result<Self> {
        Self::with(socket.into())
    }
}

impl Read for SocketPort {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        while self.text.len() < TEXT {
            let frame = match self.socket.read_frame() {
                Ok(socketcan::CanFrame::Error(_)) => return Err(Error::other("bus-off")),
                Ok(socketcan::CanFrame::Remote(it)) => CanFrame::new_remote(it.id(), it.dlc()),
                Ok(socketcan::CanFrame::Data(it)) => CanFrame::new(it.id(), it.data()),
                Err(error) if error.kind() == ErrorKind::WouldBlock && !self.text.is_empty() => {
                    break;
                }
                Err(error) => return Err(error),
            };
            if let Some(frame) = frame {
                write_frame(&mut self.text, &frame, None);
            }
        }
        let count = self.text.len().min(buffer.len());
        buffer[..count].copy_from_slice(&self.text[..count]);
        self.text.drain(..count);
        Ok(count)
    }
}

/// Whether the socket's queue, or the interface's, takes no more. ENOBUFS has no kind of its own.
pub fn is_full(error: &Error) -> bool {
    error.kind() == ErrorKind::WouldBlock
        || error.raw_os_error() == Some(Errno::NOBUFS.raw_os_error())
}

impl Write for SocketPort {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        for line in self.lines.take(bytes) {
            let Ok(SlcanCommand::Send(frame)) = line else { continue };
            let sent = if frame.is_remote() {
                socketcan::CanFrame::new_remote(frame.id(), frame.len())
            } else {
                socketcan::CanFrame::new(frame.id(), frame.bytes())
            };
            let Some(sent) = sent else { continue };
            match self.socket.write_frame(&sent) {
                Err(error) if is_full(&error) => self.text.push(BELL),
                it => it?,
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}
