//! `rc10 new`: a folder of one's own, whole or not at all. That what it holds compiles, drives, and runs on the
//! emulated chip, is a step of the check.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[path = "common/scratch.rs"]
mod scratch;

use std::fs;
use std::path::Path;
use std::process::Command;

use scratch::Scratch;

/// `rc10 new` in a folder: whether it succeeds, and what it says.
fn new(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    let output = command.arg("new").args(arguments).current_dir(folder).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8(text).unwrap())
}

/// Names in a folder.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_robot_has_its_own_name_throughout() {
    let folder = Scratch::new("new-named");
    fs::create_dir_all(&*folder).unwrap();
    let (done, text) = new(&folder, &["night-owl"]);
    assert!(done && text.contains("cd night-owl"), "{text}");
    assert_eq!(names(&folder), ["night-owl"]);
    let place = folder.join("night-owl");
    let read = |file: &str| fs::read_to_string(place.join(file)).unwrap();
    for (file, words) in [
        ("Cargo.toml", "name = \"night-owl\""),
        ("Cargo.toml", "night-owl-robot = { path = \"robot\" }"),
        ("src/main.rs", "use night_owl::"),
        ("robot/Cargo.toml", "name = \"night-owl-robot\""),
        ("firmware/src/main.rs", "robot: night_owl_robot;"),
        ("firmware/Cargo.toml", "[profile.release.package.night-owl-firmware]"),
        (".cargo/config.toml", "-Tlink.x"),
        ("firmware/.cargo/config.toml", "DEFMT_LOG"),
    ] {
        assert!(read(file).contains(words), "{file}: no {words}\n{}", read(file));
    }
    for file in ["Cargo.toml", "README.md", "src/lib.rs", "src/simulation.rs", "tests/drive.rs"] {
        assert!(!read(file).contains("starter"), "{file}: {}", read(file));
    }
    // The program is small, and so is all that stands beside table and task.
    let lines = |file: &str| {
        let text = read(file);
        let lines = text.lines().map(str::trim);
        lines.filter(|line| !line.is_empty() && !line.starts_with("//")).count()
    };
    let sum: usize = ["src/lib.rs", "src/main.rs", "src/simulation.rs", "robot/src/lib.rs"]
        .into_iter()
        .chain(["firmware/src/main.rs", "firmware/build.rs"])
        .map(lines)
        .sum();
    assert!(lines("firmware/src/main.rs") <= 40 && sum <= 150, "{sum} lines");
}

#[test]
fn it_may_point_at_a_commit() {
    let folder = Scratch::new("new-git");
    fs::create_dir_all(&*folder).unwrap();
    let (done, text) =
        new(&folder, &["owl", "--git", "https://example.org/rc10.git", "--rev", "0123abc"]);
    assert!(done, "{text}");
    for file in ["Cargo.toml", "firmware/Cargo.toml"] {
        let text = fs::read_to_string(folder.join("owl").join(file)).unwrap();
        let wanted = "rc10-motor = { git = \"https://example.org/rc10.git\", rev = \"0123abc\"";
        assert!(text.contains(wanted) && !text.contains("path = \"/"), "{file}: {text}");
    }
    let (done, text) = new(&folder, &["other", "--git", "https://example.org/rc10.git"]);
    assert!(!done && text.contains("--rev"), "{text}");
}

#[test]
fn what_cannot_be_is_refused_and_leaves_nothing() {
    let folder = Scratch::new("new-refused");
    fs::create_dir_all(&*folder).unwrap();
    for (name, why) in [
        ("Demo", "is no name"),
        ("9lives", "is no name"),
        ("a b", "is no name"),
        ("../up", "is no name"),
        ("-x", "unexpected argument"),
        ("a--b", "is no name"),
        ("", "is no name"),
        ("match", "is a word of Rust"),
        ("anyhow", "there is a package anyhow"),
        ("rc10", "there is a package rc10"),
    ] {
        let (done, text) = new(&folder, &[name]);
        assert!(!done && text.contains(why), "{name}: {text}");
    }
    let (done, text) = new(&folder, &["demo", "--board", "arduino"]);
    assert!(!done && text.contains("h723zg"), "{text}");
    assert!(names(&folder).is_empty());
    // Taken.
    fs::write(folder.join("demo"), "mine").unwrap();
    let (done, text) = new(&folder, &["demo"]);
    assert!(!done && text.contains("already"), "{text}");
    assert_eq!(fs::read_to_string(folder.join("demo")).unwrap(), "mine");
    assert_eq!(names(&folder), ["demo"]);
    // A folder that does not exist cannot be written: gone while one stands in it.
    let gone = folder.join("gone");
    fs::create_dir(&gone).unwrap();
    let script = format!("rmdir {0:?} && {1:?} new demo", gone, env!("CARGO_BIN_EXE_rc10"));
    let output = Command::new("sh").args(["-c", &script]).current_dir(&gone).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && text.contains("cannot write the folder demo"), "{text}");
}
