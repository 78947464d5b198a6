//! Golden files: what oracles that are not ours say about rc10-app. `crates/rc10-app/tests/golden` has a
//! Python script for each, with numpy, scipy and ruckig, and what it printed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::cargo::{answer, paths, root, run as run_command};

/// Numbers may differ by this much of themselves from one processor to the next: libraries of linear
/// algebra sum in another order.
const DIFFERS: f64 = 1e-6;

/// Makes all golden files anew; with `check` compares them with those that are there instead. Fails
/// if there is no Python, a script fails, or a file is not what its script makes.
pub fn run(check: bool) -> Result<()> {
    let (folder, python) = (folder(), python()?);
    let mut scripts = paths(&folder)?;
    scripts.retain(|path| path.extension().is_some_and(|extension| extension == "py"));
    scripts.sort();
    ensure!(!scripts.is_empty(), "{} has no scripts", folder.display());
    for script in scripts {
        let made = answer(Command::new(&python).arg(&script))
            .with_context(|| format!("{} fails", script.display()))?;
        let file = script.with_extension("csv");
        if check {
            let there = fs::read_to_string(&file).with_context(|| file.display().to_string())?;
            compare(&there, &made).with_context(|| format!("{} is stale", file.display()))?;
            println!("golden: {} lines of {} are as made", made.lines().count(), name(&file));
        } else {
            fs::write(&file, made + "\n")?;
            println!("golden: {}", name(&file));
        }
    }
    Ok(())
}

fn name(file: &Path) -> String {
    file.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Fails with the first line in which a number or a word differs.
fn compare(there: &str, made: &str) -> Result<()> {
    for (number, (old, new)) in (1..).zip(there.lines().zip(made.lines())) {
        let same = |(old, new): (&str, &str)| {
            let numbers = old.parse::<f64>().ok().zip(new.parse::<f64>().ok());
            numbers.map_or(old == new, |(old, new)| {
                let near = (old - new).abs() <= DIFFERS * old.abs().max(1.0);
                near || old.total_cmp(&new).is_eq()
            })
        };
        let is_same = old.split(',').count() == new.split(',').count()
            && old.split(',').zip(new.split(',')).all(same);
        ensure!(is_same, "line {number}: {old}, now {new}");
    }
    let (old, new) = (there.lines().count(), made.lines().count());
    ensure!(old == new, "{old} lines, now {new}");
    Ok(())
}

fn folder() -> PathBuf {
    root().join("crates/rc10-app/tests/golden")
}

/// The interpreter of a virtual environment with exactly what `requirements.txt` says. Fails if
/// there is no Python, or the packages cannot be installed.
pub fn python() -> Result<PathBuf> {
    let requirements = folder().join("requirements.txt");
    let wanted = fs::read_to_string(&requirements)?;
    let place = root().join("target/golden-python");
    let python = place.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    // Written last.
    let stamp = place.join("requirements.txt");
    if fs::read_to_string(&stamp).is_ok_and(|there| there == wanted) {
        return Ok(python);
    }
    crate::setup::python()?;
    if place.exists() {
        fs::remove_dir_all(&place)?;
    }
    run_command(Command::new("python3").args(["-m", "venv"]).arg(&place))?;
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    let exact = ["--no-deps", "--require-hashes", "--only-binary", ":all:", "-r"];
    run_command(Command::new(&python).args(install).args(exact).arg(&requirements))?;
    fs::write(&stamp, wanted)?;
    Ok(python)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_stale_is_named_by_its_line() {
        assert!(compare("a,b\n1,2.5\n", "a,b\n1.0000000001,2.5").is_ok());
        let error = |there, made| format!("{:#}", compare(there, made).unwrap_err());
        assert_eq!(error("a,b\n1,2\n", "a,b\n1,3"), "line 2: 1,2, now 1,3");
        assert_eq!(error("a\n", "b"), "line 1: a, now b");
        assert_eq!(error("a\n1\n", "a"), "2 lines, now 1");
    }
}
