//! Whole files: written beside their place, and put there when they are whole.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::{fs, io};

use anyhow::{Context, Result};
use mcap::MAGIC;

/// Makes the folder for a run's files, if it is not there; fails if it cannot be made.
pub fn make_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))
}

pub(crate) fn unreadable(file: &Path) -> String {
    format!("cannot read {}", file.display())
}

pub(crate) fn open(file: &Path) -> Result<File> {
    File::open(file).with_context(|| unreadable(file))
}

/// Whether a file is a record, by its first bytes.
pub(crate) fn is_record(path: &Path) -> Result<bool> {
    let mut begin = Vec::new();
    let read = open(path)?.take(MAGIC.len() as u64).read_to_end(&mut begin);
    read.with_context(|| unreadable(path))?;
    Ok(begin == MAGIC)
}

/// A file or folder that is written beside its place, and removed unless it is put there.
pub(crate) struct Unfinished(pub(crate) PathBuf);

impl Unfinished {
    pub(crate) fn new(path: &Path) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        // A web page has no processes.
        let process = if cfg!(target_os = "wasi") { 0 } else { std::process::id() };
        Self(path.with_file_name(format!(".{name}.{process}")))
    }

    pub(crate) fn create(&self) -> Result<File> {
        File::create(&self.0).with_context(|| format!("cannot write {}", self.0.display()))
    }

    pub(crate) fn put(self, path: &Path) -> io::Result<()> {
        fs::rename(&self.0, path)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let _ =
            if self.0.is_dir() { fs::remove_dir_all(&self.0) } else { fs::remove_file(&self.0) };
    }
}

/// Folder for reports and pages, unless told otherwise.
pub(crate) const PAGES: &str = "target/rc10-report";

/// What `rc10 tune` has written of a motor, if it has.
pub(crate) fn tuned_page(label: &str) -> Option<String> {
    fs::read_to_string(Path::new(PAGES).join(page_name(label))).ok()
}

/// Name of the page of a motor.
pub(crate) fn page_name(label: &str) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || letter == '_';
    format!("tune-{}.html", label.replace(|letter| !is_plain(letter), "-"))
}

/// Writes a whole file or nothing.
pub(crate) fn write_file(folder: &Path, name: &str, content: &[u8]) -> Result<()> {
    let path = folder.join(name);
    let beside = Unfinished::new(&path);
    let written = fs::write(&beside.0, content).and_then(|()| beside.put(&path));
    written.with_context(|| format!("cannot write {}", path.display()))
}
