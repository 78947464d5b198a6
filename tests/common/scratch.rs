//! Folders of tests, below the target directory.

use std::fs;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process;

/// An empty folder for one test of one process: two runs that share a target directory do not
/// meet. It is removed at the end, but after a failed test it stays.
pub struct Scratch(PathBuf);

impl Scratch {
    /// `name` is unique among the tests of one program.
    pub fn new(name: &str) -> Self {
        let name = format!("{name}-{}", process::id());
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        // An earlier process may have had the same number.
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }
}

impl Deref for Scratch {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl AsRef<Path> for Scratch {
    fn as_ref(&self) -> &Path {
        self
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            let _ = fs::remove_dir_all(&self.0);
        }
    }
}
