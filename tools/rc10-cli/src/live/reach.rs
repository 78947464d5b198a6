//! Robots that other programs of this user keep running on this PC.
//!
//! Each has a file in a folder that is this user's alone: its port at 127.0.0.1, and two keys by chance. A shell
//! says the first key before anything else and is answered with the second. So nothing is heard of another
//! user or of a page in a browser, and a program that has got the port of an old file is no robot.

use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::time::Duration;
use std::{env, fmt, fs};

use anyhow::{Context, Result, bail};

use super::request::by_chance;
use crate::files::write_file;

/// Time limit of a robot's answer to the key.
const PATIENCE: Duration = Duration::from_secs(2);

/// Length of a key.
pub(super) const KEY: usize = 32;

/// A robot that runs, or did when its file was written.
pub(super) struct LocalRobot {
    /// Name on a command line: `sim:8010`, by the port of its page.
    pub(super) name: String,
    /// Name for people.
    pub(super) title: String,
    /// What a shell says, and how it is answered.
    pub(super) keys: [String; 2],
    pub(super) port: u16,
    pub(super) file: PathBuf,
}

/// The folder of this user for the files.
fn folder() -> Result<PathBuf> {
    let known = |name| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = if cfg!(windows) {
        known("LOCALAPPDATA")
    } else {
        known("XDG_RUNTIME_DIR").or_else(|| Some(known("HOME")?.join(".cache")))
    };
    Ok(base.context("this user has no folder of its own (HOME)")?.join("rc10"))
}

#[cfg(unix)]
fn make(folder: &Path) -> Result<()> {
    use std::os::unix::fs::{DirBuilderExt as _, PermissionsExt as _};
    fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)?;
    // Only its owner may do this.
    Ok(fs::set_permissions(folder, fs::Permissions::from_mode(0o700))?)
}

#[cfg(not(unix))]
fn make(folder: &Path) -> Result<()> {
    Ok(fs::create_dir_all(folder)?)
}

impl fmt::Display for LocalRobot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {}", self.title, self.name)
    }
}

impl LocalRobot {
    /// Listens for shells, and writes the file; fails without a folder for it.
    pub(super) fn announce(name: String, title: &str) -> Result<(Self, TcpListener)> {
        let folder = folder()?;
        make(&folder).with_context(|| format!("cannot make {} private", folder.display()))?;
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        listener.set_nonblocking(true)?;
        let keys = [0, 1].map(|_| by_chance());
        let (port, file) = (listener.local_addr()?.port(), name.replace(':', "-"));
        write_file(&folder, &file, format!("{port} {} {} {title}", keys[0], keys[1]).as_bytes())?;
        let file = folder.join(file);
        Ok((Self { name, title: title.to_owned(), keys, port, file }, listener))
    }

    fn read(file: PathBuf) -> Option<Self> {
        let (kind, page) = file.file_name()?.to_str()?.split_once('-')?;
        let name = is_name(kind).then(|| format!("{kind}:{page}"))?;
        let text = fs::read_to_string(&file).ok()?;
        let mut words = text.splitn(4, ' ').map(str::to_owned);
        let port = words.next()?.parse().ok()?;
        let keys = [words.next()?, words.next()?];
        Some(Self { name, title: words.next()?, keys, port, file })
    }

    /// Connects to the robot; fails, and removes the file, if that is not there.
    pub(super) fn connect(&self) -> Result<TcpStream> {
        let (address, name) = (SocketAddr::from((Ipv4Addr::LOCALHOST, self.port)), &self.name);
        let stream = TcpStream::connect_timeout(&address, PATIENCE).inspect_err(|_| self.forget());
        let mut stream = stream.with_context(|| format!("{name} has ended"))?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_nodelay(true)?;
        stream.write_all(self.keys[0].as_bytes())?;
        for letter in self.keys[1].bytes() {
            let mut heard = [0];
            stream.read_exact(&mut heard).with_context(|| format!("{name} does not answer"))?;
            if heard != [letter] {
                self.forget();
                bail!("{name} has ended, and another program has its port");
            }
        }
        Ok(stream)
    }

    pub(super) fn forget(&self) {
        let _ = fs::remove_file(&self.file);
    }
}

/// Whether this names a robot that runs: `sim`, `emu`, `drive`, or with its number.
pub(super) fn is_name(port: &str) -> bool {
    let (kind, page) = port.split_once(':').unwrap_or((port, "0"));
    ["sim", "emu", "drive"].contains(&kind) && page.parse::<u16>().is_ok()
}

/// All that answer, by their names.
pub(super) fn all() -> Vec<LocalRobot> {
    let files = folder().and_then(|folder| Ok(fs::read_dir(folder)?)).into_iter().flatten();
    let files = files.filter_map(|file| LocalRobot::read(file.ok()?.path()));
    let mut all: Vec<_> = files.filter(|it| it.connect().is_ok()).collect();
    all.sort_by(|one, other| one.name.cmp(&other.name));
    all
}
