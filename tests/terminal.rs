//! What a person at a terminal sees: colours, the width, progress, and what the tool does by itself.

use std::fs;
use std::process::{Command, Output};

use crate::common::scratch::Scratch;
use crate::common::served::{start, until};

fn rc10(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    command.args(arguments).env_remove("NO_COLOR").env_remove("COLUMNS").env("TERM", "xterm");
    command
}

fn text(output: &Output) -> String {
    String::from_utf8([output.stdout.clone(), output.stderr.clone()].concat()).unwrap()
}

/// The command on a terminal of its own; `None` without `script`.
fn on_a_terminal(arguments: &str, no_color: bool) -> Option<String> {
    let line = format!("{} {arguments}", env!("CARGO_BIN_EXE_rc10"));
    let mut command = Command::new("script");
    command.args(["-qec", &line, "/dev/null"]).env_remove("NO_COLOR").env_remove("COLUMNS");
    command.env("TERM", "xterm").stdin(std::process::Stdio::null());
    if no_color {
        command.env("NO_COLOR", "1");
    }
    let Ok(output) = command.output() else {
        eprintln!("SKIPPED: no `script` on this machine: no terminal");
        return None;
    };
    Some(text(&output))
}

#[test]
fn a_run_fits_80_columns_and_no_row_is_broken() {
    let folder = Scratch::new("terminal-80");
    let run = [
        "run",
        "--no-logs",
        "--mistake",
        "direction:wheel-front-left",
        "--out",
        folder.to_str().unwrap(),
    ];
    let said = text(&rc10(&run).env("COLUMNS", "80").output().unwrap());
    let widest = said.lines().max_by_key(|line| line.chars().count()).unwrap();
    println!("the widest line of a run at 80 columns: {}", widest.chars().count());
    // A path and a hash have no place to break.
    let is_prose = |line: &&str| !line.starts_with("open ") && !line.starts_with("trace ");
    for line in said.lines().filter(is_prose) {
        assert!(line.chars().count() <= 80, "{} columns: {line}", line.chars().count());
    }
    // In a table nothing that counts is lost.
    let rows = said.lines().filter(|line| line.starts_with("wheel front left ")).count();
    assert!(rows >= 2 && said.contains("RMS error") && said.contains("received"), "{said}");
    let whole = text(&rc10(&run).output().unwrap());
    assert!(whole.lines().any(|line| line.starts_with("motor ") && line.contains("malformed")));
    for command in ["run", "decode", "live", "report"] {
        let help = text(&rc10(&[command, "--help"]).output().unwrap());
        let widest = help.lines().map(|line| line.chars().count()).max().unwrap();
        println!("the widest line of {command} --help: {widest}");
        assert!(command == "decode" || widest <= 80, "{command}: {widest}");
        let wide = text(&rc10(&[command, "--help"]).env("COLUMNS", "200").output().unwrap());
        assert!(wide.lines().count() < help.lines().count(), "{command}");
    }
}

#[test]
fn a_verdict_has_colours_on_a_terminal_alone() {
    let folder = Scratch::new("terminal-colours");
    let out = folder.to_str().unwrap();
    let bad = format!("run --no-logs --seconds 3 --mistake direction:lift-front-left --out {out}");
    let good = format!("run --no-logs --seconds 3 --out {out}");
    let Some(said) = on_a_terminal(&bad, false) else { return };
    assert!(said.contains("\u{1b}[31m✗ "), "{said}");
    assert!(on_a_terminal(&good, false).unwrap().contains("\u{1b}[32m✓ All 11"));
    // The end of the progress is no colour.
    let plain = on_a_terminal(&bad, true).unwrap().replace("\r\u{1b}[K", "");
    assert!(plain.contains('✗') && !plain.contains('\u{1b}'), "{plain}");
    let run: Vec<&str> = bad.split(' ').collect();
    assert!(!text(&rc10(&run).output().unwrap()).contains('\u{1b}'));
}

#[test]
fn long_work_tells_how_far_it_is_and_cleans_up() {
    let folder = Scratch::new("terminal-progress");
    let run = format!("run --no-logs --seconds 100 --out {}", folder.to_str().unwrap());
    let Some(said) = on_a_terminal(&run, true) else { return };
    let told = said.matches(" of 100 s").count();
    println!("a run of 100 s tells its progress {told} times");
    let (before, after) = said.rsplit_once("\r\u{1b}[K").expect("the line is gone");
    assert!(told >= 1 && before.contains(" %  ") && !after.contains(" of 100 s"), "{said}");
    let run: Vec<&str> = run.split(' ').collect();
    assert!(!text(&rc10(&run).output().unwrap()).contains(" of 100 s"));
}

#[test]
#[cfg(target_os = "linux")]
fn live_opens_the_browser_and_names_a_free_port() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = Scratch::new("terminal-open");
    let (opener, asked) = (folder.join("xdg-open"), folder.join("asked"));
    fs::write(&opener, format!("#!/bin/sh\necho \"$1\" > {}\n", asked.display())).unwrap();
    fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
    let live = |path: String, arguments: &[&str]| {
        let mut command = rc10(&["live", "--sim", "--page", "0"]);
        command
            .args(arguments)
            .env("PATH", path)
            .env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR"));
        start(&mut command, "http://")
    };
    let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
    let (_live, line) = live(path, &["--open"]);
    let address = line.split_whitespace().last().unwrap();
    until("asked for its address", || {
        fs::read_to_string(&asked).unwrap_or_default().trim() == address
    });
    // Without a browser it goes on.
    let (_other, line) = live("/nowhere".into(), &["--open"]);
    assert!(line.contains("http://"));
    let port = address.trim_end_matches('/').rsplit(':').next().unwrap();
    let taken = text(&rc10(&["live", "--sim", "--page", port]).output().unwrap());
    assert!(taken.contains("--page 0 takes one that is free"), "{taken}");
}

#[test]
fn what_is_refused_says_what_would_do() {
    let folder = Scratch::new("terminal-refused");
    let file = |name: &str, bytes: &[u8]| {
        fs::write(folder.join(name), bytes).unwrap();
        folder.join(name).display().to_string()
    };
    let (empty, log) = (file("empty", b""), file("a.log", b""));
    let record = file("a.mcap", b"\x89MCAP0\r\n");
    let path = folder.join("demo").display().to_string();
    let cases: [(&[&str], &str); 7] = [
        (&["live", &empty], "a file, but no record (.mcap), and no serial port"),
        (&["plan", "--add", "1:M3508@500*2000"], "N is 1 to 255"),
        (&["faults", "--phases", "0"], "a whole number, 1 or more"),
        (&["decode", &record], "this is a record: rc10 report or rc10 csv"),
        (&["decode", &log, "--from", "2", "--to", "1"], "--to is before --from"),
        (&["run", "--fault", "hang@0.3s"], "--fault hang: rc10 run has no chip"),
        (&["new", &path], "is a path: the robot's name alone"),
    ];
    for (arguments, why) in cases {
        // A new robot is not made in this checkout.
        let output = rc10(arguments).current_dir(std::env::temp_dir()).output().unwrap();
        let said = text(&output);
        assert!(!output.status.success() && said.contains(why), "{arguments:?}: {said}");
    }
}
