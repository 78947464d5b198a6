//! `rc10 new`: a folder of one's own, whole or not at all. That what it holds compiles, drives, and runs on the
//! emulated chip, is a step of the check.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A folder outside the checkout, removed in the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let place = std::env::temp_dir().join(format!("rc10-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&place);
        fs::create_dir_all(&place).unwrap();
        Self(place)
    }
}

impl std::ops::Deref for Scratch {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

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
    let (done, text) = new(&folder, &["night-starter"]);
    assert!(done && text.contains("cd night-starter"), "{text}");
    assert_eq!(names(&folder), ["night-starter"]);
    let place = folder.join("night-starter");
    let read = |file: &str| fs::read_to_string(place.join(file)).unwrap();
    for (file, words) in [
        ("Cargo.toml", "name = \"night-starter\""),
        ("src/main.rs", "night_starter::Robot"),
        ("firmware/Cargo.toml", "night-starter = { path = \"..\", default-features = false }"),
        ("firmware/src/main.rs", "rc10_board::program!(night_starter);"),
        ("firmware/Cargo.toml", "[profile.release.package.rc10-board]"),
        (".cargo/config.toml", "-Tlink.x"),
        ("firmware/.cargo/config.toml", "DEFMT_LOG"),
    ] {
        assert!(read(file).contains(words), "{file}: no {words}\n{}", read(file));
    }
    // It takes from the checkout what others wrote.
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("target");
    let shared = format!("build-dir = {:?}\n", target.to_str().unwrap());
    assert!(read(".cargo/config.toml").contains(&shared), "{}", read(".cargo/config.toml"));
    for file in ["Cargo.toml", "README.md", "src/lib.rs", "src/simulation.rs", "tests/drive.rs"] {
        let text = read(file).replace("night-starter", "").replace("night_starter", "");
        assert!(!text.contains("starter"), "{file}: {text}");
    }
    // It is small: lines of Rust, and of the manifests of its two packages in the checkout.
    let lines = |text: String| {
        let lines = text.lines().map(str::trim);
        lines.filter(|line| !line.is_empty() && !line.starts_with("//")).count()
    };
    let files = ["src/lib.rs", "src/main.rs", "src/simulation.rs", "src/table.rs", "src/task.rs"];
    let rust: usize =
        files.iter().chain(&["firmware/src/main.rs"]).map(|file| lines(read(file))).sum();
    assert!(rust <= 120, "{rust} lines");
    let starter = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/starter");
    let manifests = ["Cargo.toml", "firmware/Cargo.toml"];
    let manifests = manifests.map(|file| fs::read_to_string(starter.join(file)).unwrap());
    let manifests: usize = manifests.map(|text| text.lines().count()).iter().sum();
    assert!(manifests <= 55, "{manifests} lines");
}

/// What differs is the board's feature and the probe's name of the chip: two lines.
#[test]
fn it_may_be_for_the_other_board() {
    let folder = Scratch::new("new-board");
    let (done, text) = new(&folder, &["ibis", "--board", "dm-mc02"]);
    assert!(done && text.contains("for the board dm-mc02 with an STM32H723VG"), "{text}");
    let (done, text) = new(&folder, &["elk"]);
    assert!(done && text.contains("for the board h723zg with an STM32H723ZG"), "{text}");
    let differences = |file: &str| {
        let [ibis, elk] = ["ibis", "elk"].map(|name| {
            let text = fs::read_to_string(folder.join(name).join(file)).unwrap();
            text.replace(name, "NAME").lines().map(str::to_owned).collect::<Vec<_>>()
        });
        assert_eq!(ibis.len(), elk.len(), "{file}");
        let pairs = ibis.into_iter().zip(elk);
        pairs.filter(|(ibis, elk)| ibis != elk).collect::<Vec<_>>()
    };
    let pair = |ibis: &str, elk: &str| vec![(ibis.to_owned(), elk.to_owned())];
    let board = pair("default = [\"dm-mc02\"]", "default = [\"h723zg\"]");
    assert_eq!(differences("firmware/Cargo.toml"), board);
    let [(ibis, elk)] = &differences(".cargo/config.toml")[..] else { panic!("one line") };
    assert!(ibis.contains("--chip STM32H723VGTx ") && elk.contains("--chip STM32H723ZGTx "));
    for file in ["Cargo.toml", "firmware/src/main.rs", "firmware/.cargo/config.toml"] {
        assert!(differences(file).is_empty(), "{file}");
    }
    let (done, text) = new(&folder, &["bat", "--board", "nucleo"]);
    assert!(!done && text.contains("there is no such board: h723zg, dm-mc02"), "{text}");
    assert_eq!(names(&folder), ["elk", "ibis"]);
}

/// Every `config.toml` of cargo in a folder and those below it.
fn cargo_configs(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        if path.ends_with(".cargo/config.toml") {
            found.push(path);
        } else if entry.file_type().unwrap().is_dir() && name != "target" && name != ".git" {
            found.extend(cargo_configs(&path));
        }
    }
    found
}

/// Of the tree, and of a new robot: with a probe that halts it, a fault leaves the motors running.
#[test]
fn every_runner_lets_a_fault_reach_its_handler_and_a_reset_the_next_run() {
    let folder = Scratch::new("new-runners");
    assert!(new(&folder, &["ibis"]).0);
    let tree = cargo_configs(Path::new(env!("CARGO_MANIFEST_DIR")));
    for (configs, least) in [(tree, 2), (cargo_configs(&folder), 1)] {
        let texts: Vec<_> = configs.iter().map(|file| fs::read_to_string(file).unwrap()).collect();
        for text in texts.iter().filter(|text| text.contains("probe-rs run")) {
            assert!(text.contains("--chip ") || text.contains("\nPROBE_RS_CHIP = "), "{text}");
        }
        let runners: Vec<_> = texts
            .iter()
            .flat_map(|text| text.lines().map(str::to_owned).collect::<Vec<_>>())
            .filter(|line| !line.starts_with('#') && line.contains("probe-rs run"))
            .collect();
        assert!(runners.len() >= least, "{runners:?} in {configs:?}");
        for runner in runners {
            let words: Vec<_> = runner.split([' ', '"']).collect();
            for flag in ["--no-catch-reset", "--no-catch-hardfault"] {
                assert!(words.contains(&flag), "{flag} is not in: {runner}");
            }
        }
    }
}

#[test]
fn it_may_point_at_a_commit() {
    let folder = Scratch::new("new-git");
    let (done, text) =
        new(&folder, &["ibis", "--git", "https://example.org/rc10.git", "--rev", "0123abc"]);
    assert!(done, "{text}");
    for (file, package) in [("Cargo.toml", "rc10"), ("firmware/Cargo.toml", "rc10-board")] {
        let text = fs::read_to_string(folder.join("ibis").join(file)).unwrap();
        let wanted =
            format!("{package} = {{ git = \"https://example.org/rc10.git\", rev = \"0123abc\"");
        assert!(text.contains(&wanted) && !text.contains("path = \"/"), "{file}: {text}");
    }
    let config = fs::read_to_string(folder.join("ibis/.cargo/config.toml")).unwrap();
    assert!(!config.contains("build-dir"), "{config}");
    let (done, text) = new(&folder, &["other", "--git", "https://example.org/rc10.git"]);
    assert!(!done && text.contains("--rev"), "{text}");
}

#[test]
fn what_cannot_be_is_refused_and_leaves_nothing() {
    let folder = Scratch::new("new-refused");
    for (name, why) in [
        ("Demo", "is no name"),
        ("9lives", "is no name"),
        ("a b", "is no name"),
        ("../up", "is a path: the robot's name alone"),
        ("-x", "unexpected argument"),
        ("a--b", "is no name"),
        ("", "is no name"),
        ("match", "means something else"),
        ("anyhow", "there is a package anyhow"),
        ("rc10", "there is a package rc10"),
    ] {
        let (done, text) = new(&folder, &[name]);
        assert!(!done && text.contains(why), "{name}: {text}");
    }
    assert!(names(&folder).is_empty());
    // In the checkout, whose settings would be joined with the robot's.
    let (done, text) = new(Path::new(env!("CARGO_MANIFEST_DIR")), &["demo"]);
    assert!(!done && text.contains("inside RC10's checkout"), "{text}");
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
