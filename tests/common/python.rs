//! The virtual environment of the tests against programs in Python: below the target directory, made once with the exact
//! versions of `tests/python/requirements.txt`. Where there is no Python or no network, the tests say that they are skipped;
//! with `CI=true` they fail.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use super::scratch::Scratch;

/// The interpreter of the virtual environment; `None` if it cannot be set up.
pub fn python() -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    match PYTHON.get_or_init(environment) {
        Ok(python) => Some(python),
        Err(why) if env::var("CI").is_ok_and(|value| value == "true") => panic!("{why}"),
        Err(why) => {
            println!("SKIPPED: {why}");
            None
        }
    }
}

fn environment() -> Result<PathBuf, String> {
    let requirements = script("requirements.txt");
    let wanted = fs::read_to_string(&requirements).unwrap();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("python");
    let interpreter = if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" };
    let python = folder.join(interpreter);
    // Written last: an environment without it, or with another one, is set up anew.
    let stamp = folder.join("requirements.txt");
    if fs::read_to_string(&stamp).is_ok_and(|there| there == wanted) {
        return Ok(python);
    }
    // Made elsewhere and moved here when it is whole: another run may be at the same.
    let made = Scratch::new("python");
    let base = if cfg!(windows) { "python" } else { "python3" };
    run(Command::new(base).args(["-m", "venv"]).arg(&*made))
        .map_err(|why| format!("{why} (cargo xtask setup installs what is missing)"))?;
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    let exact = ["--no-deps", "--require-hashes", "--only-binary", ":all:", "-r"];
    run(Command::new(made.join(interpreter)).args(install).args(exact).arg(&requirements))?;
    fs::write(made.join("requirements.txt"), &wanted).unwrap();
    let is_there = || fs::read_to_string(&stamp).is_ok_and(|there| there == wanted);
    if !is_there() {
        let _ = fs::remove_dir_all(&folder);
        // Fails if the other run was first: then its environment is there.
        let moved = fs::rename(&*made, &folder);
        assert!(moved.is_ok() || is_there(), "{}: {moved:?}", folder.display());
    }
    Ok(python)
}

fn run(command: &mut Command) -> Result<Output, String> {
    let name = format!("{command:?}");
    let output = command.output().map_err(|error| format!("{name}: {error}"))?;
    if output.status.success() {
        return Ok(output);
    }
    let error = String::from_utf8_lossy(&output.stderr);
    let last = error.trim().lines().last().or(Some("no reason given"));
    Err(format!("{name}: {}", last.unwrap_or_default()))
}

/// A file of tests/python, from the package of any test.
pub fn script(name: &str) -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = package.ancestors().map(|it| it.join("tests/python"));
    let folder = folders.find(|it| it.is_dir()).expect("tests/python is in this tree");
    folder.join(name)
}
