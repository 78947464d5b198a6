use std::os::fd::OwnedFd;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::Duration;
use std::{fs, io};

use anyhow::{Context, Result, ensure};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, open};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

pub(super) struct Terminal {
    ours: OwnedFd,
    /// Kept open, so that clients may come and go.
    _theirs: OwnedFd,
    pub(super) path: PathBuf,
    link: Option<PathBuf>,
}

impl Terminal {
    /// Opens a pseudo-terminal that changes no byte; `link`: path of a symbolic link to it.
    pub(super) fn new(link: Option<&Path>) -> Result<Self> {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)
            .and_then(|ours| grantpt(&ours).map(|()| ours))
            .and_then(|ours| unlockpt(&ours).map(|()| ours))
            .context("cannot make a pseudo-terminal")?;
        let name = ptsname(&ours, Vec::new()).context("the pseudo-terminal has no name")?;
        let path = PathBuf::from(name.to_str().context("the pseudo-terminal's name is no text")?);
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let theirs = open(&path, flags, Mode::empty())
            .with_context(|| format!("cannot open {}", path.display()))?;
        let mut modes = tcgetattr(&theirs)?;
        modes.make_raw();
        tcsetattr(&theirs, OptionalActions::Now, &modes)?;
        rustix::io::ioctl_fionbio(&ours, true)?;
        if let Some(link) = link {
            if let Ok(found) = fs::symlink_metadata(link) {
                let is_link = found.file_type().is_symlink();
                ensure!(is_link, "{} is there, and no symbolic link", link.display());
                fs::remove_file(link)?;
            }
            symlink(&path, link).with_context(|| format!("cannot link {}", link.display()))?;
        }
        Ok(Self { ours, _theirs: theirs, path, link: link.map(Path::to_owned) })
    }

    /// Waits, at most `timeout`, until there are bytes to read or room to write.
    pub(super) fn wait(&self, read: bool, write: bool, timeout: Duration) -> Result<()> {
        let mut wanted = PollFlags::empty();
        wanted.set(PollFlags::IN, read);
        wanted.set(PollFlags::OUT, write);
        let timeout = Timespec::try_from(timeout)?;
        match poll(&mut [PollFd::new(&self.ours, wanted)], Some(&timeout)) {
            // A signal: the caller looks whether it was to stop.
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(error) => Err(error).context("cannot wait for the client"),
        }
    }

    pub(super) fn read<'b>(&self, buffer: &'b mut [u8]) -> io::Result<&'b [u8]> {
        match rustix::io::read(&self.ours, &mut *buffer) {
            Ok(count) => Ok(&buffer[..count]),
            Err(Errno::AGAIN | Errno::INTR) => Ok(&[]),
            Err(error) => Err(error.into()),
        }
    }

    /// Writes as much as there is room for, and removes it from `bytes`.
    pub(super) fn write(&self, bytes: &mut Vec<u8>) -> io::Result<()> {
        while !bytes.is_empty() {
            match rustix::io::write(&self.ours, bytes) {
                Ok(count) => drop(bytes.drain(..count)),
                Err(Errno::AGAIN | Errno::INTR) => break,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        if let Some(link) = &self.link {
            let _ = fs::remove_file(link);
        }
    }
}
