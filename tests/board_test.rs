//! `rc10 board-test` as a person calls it, with a program in the place of probe-rs. `firmware/first_board.rs` has
//! the rest.
#![cfg(unix)]

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::common::scratch::Scratch;
use crate::emulate::program_that_reads;

/// Has one user at a time, as a probe; goes on until it is interrupted by hand.
const PROBE_RS: &str = r#"#!/bin/sh
if [ "$1" = --version ]; then echo "probe-rs 0.29.1 (git commit: 0)"; exit; fi
if [ -e "$0.busy" ] && kill -0 "$(cat "$0.busy")" 2>/dev/null; then echo "Error: the probe is in use" >&2; exit 1; fi
echo $$ > "$0.busy"
echo "$@" >> "$0.calls"
case "$1" in
read)
    case "$5" in
    0x5200201c) echo "1c16aafc" ;;
    0x4000a804) echo "00000040" ;;
    *) echo "00000000" ;;
    esac
    rm "$0.busy"; exit ;;
run) echo "INFO start, power came"; echo "INFO HSI is +0.31 %" ;;
esac
trap 'rm "$0.busy"; exit' INT
while :; do sleep 0.05; done
"#;

fn board_test(folder: &Path, arguments: &[&str], answers: &str) -> (Option<i32>, String) {
    let path = std::env::var("PATH").unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_rc10"))
        .args(["board-test", "program.elf"])
        .args(arguments)
        .current_dir(folder)
        .env("PATH", format!("{}:{path}", folder.display()))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(answers.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

/// Outcomes of the steps in the file, in their order.
fn outcomes(file: &str) -> Vec<(String, String)> {
    let records = file.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let steps = records.filter(|it| it.get("step").is_some());
    steps.map(|it| (text(&it["step"]), text(&it["outcome"]))).collect()
}

#[test]
fn what_was_done_stays_and_is_gone_on_with() {
    let folder = Scratch::new("board-test");
    let probe_rs = folder.join("probe-rs");
    fs::write(&probe_rs, PROBE_RS).unwrap();
    fs::set_permissions(&probe_rs, fs::Permissions::from_mode(0o755)).unwrap();
    fs::write(folder.join("program.elf"), program_that_reads(0x5802_4400)).unwrap();
    let file = folder.join("board-test.jsonl");
    let read = || fs::read_to_string(&file).unwrap();

    // Steps 3 to 6, and 7 with a termination that is missing and then is there; no number; 10, and an end in 11.
    let answers = "\n25.000\nPG4 at ground\ns\n60\nabout 60\n120,5\nr\n60\n60\n60\n\n\nq\n";
    let (code, text) = board_test(&folder, &[], answers);
    assert_eq!(code, Some(0), "{text}");
    let wrong = "✗ bus 2: a termination is missing (120.5 ohms)";
    for words in [wrong, "that is no number", "BOR_LEV is 3", "goes on from here"] {
        assert!(text.contains(words), "{words} is not in: {text}");
    }
    let told = |step: &str, outcome: &str| (step.to_owned(), outcome.to_owned());
    let expected = [
        ("3", "told"),
        ("4", "told"),
        ("5", "told"),
        ("6", "skipped"),
        ("7", "wrong"),
        ("7", "told"),
        ("8", "told"),
        ("9", "right"),
        ("10", "told"),
    ];
    assert_eq!(outcomes(&read()), expected.map(|(step, outcome)| told(step, outcome)));
    let heading: Value = serde_json::from_str(read().lines().next().unwrap()).unwrap();
    assert_eq!((&heading["board"], &heading["chip"]), (&"h723zg".into(), &"STM32H723ZG".into()));
    assert_eq!(heading["probe"], "probe-rs 0.29.1 (git commit: 0)");
    assert_eq!(heading["sha256"].as_str().unwrap().len(), 64);

    // Cut off in the middle of what step 10 said: that and what was left out are done again, the rest is not.
    let whole = read();
    let cut = whole.find("{\"step\":\"10\"").unwrap() + 9;
    fs::write(&file, &whole[..cut]).unwrap();
    let (code, text) = board_test(&folder, &[], "s\n\n\n");
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("has 6 steps already"), "{text}");
    assert!(text.contains("✓ it starts; INFO HSI is +0.31 %"), "{text}");
    // No robot speaks here.
    assert!(text.contains("✗ too few lines of the log"), "{text}");
    let expected = [("6", "skipped"), ("10", "told"), ("11", "right"), ("12", "wrong")];
    let all = outcomes(&read());
    assert_eq!(all[all.len() - 4..], expected.map(|(step, outcome)| told(step, outcome)));
    let text = "\"text\":\"INFO start, power came\"";
    let line = read().lines().find(|line| line.contains(text)).map(str::to_owned);
    assert!(line.is_some_and(|line| line.starts_with("{\"from\":\"log\",\"at\":")), "{}", read());

    // One step alone, by reads: nothing else holds the probe meanwhile.
    let (code, text) = board_test(&folder, &["--step", "14"], "");
    assert!(code == Some(0) && text.contains("✓ no bus is restricted"), "{text}");
    let calls = fs::read_to_string(folder.join("probe-rs.calls")).unwrap();
    let run = "run --chip STM32H723ZGTx --no-catch-reset --no-catch-hardfault --log-format {L} {s} program.elf";
    assert!(
        calls.contains(run) && calls.contains("read --chip STM32H723ZGTx b32 0x4000d418 1"),
        "{calls}"
    );
    // One that was too slow to be interrupted was ended.
    let user = fs::read_to_string(folder.join("probe-rs.busy")).unwrap_or_default();
    let is_alive = |pid: &str| !pid.is_empty() && Path::new("/proc").join(pid).exists();
    assert!(!is_alive(user.trim()), "the probe was let go");

    // Another program: nothing of it was done.
    fs::write(folder.join("program.elf"), program_that_reads(0x5802_4404)).unwrap();
    let (_, text) = board_test(&folder, &[], "");
    assert!(!text.contains("steps already") && text.contains("\n3. "), "{text}");
}

#[test]
fn what_cannot_be_is_told() {
    let folder = Scratch::new("board-test-errors");
    let complains = |arguments: &[&str], words: &str| {
        let (code, text) = board_test(&folder, arguments, "");
        assert!(code == Some(2) && text.contains(words), "{arguments:?}: {code:?} {text}");
    };
    complains(&[], "cannot read program.elf");
    fs::write(folder.join("program.elf"), program_that_reads(0x5802_4400)).unwrap();
    complains(&["--step", "38"], "no step 38 is led: 3 4 5");
    complains(&["--board", "nucleo"], "there is no such board: h723zg, dm-mc02");
    complains(&["--port", "/dev/no-such-port"], "/dev/no-such-port");
    fs::write(folder.join("notes.txt"), "shopping").unwrap();
    complains(&["--out", "notes.txt"], "notes.txt is no file of rc10 board-test");
    assert_eq!(fs::read(folder.join("notes.txt")).unwrap(), b"shopping");
    complains(&["--out", "."], "cannot read .");
}
