//! The `rc10 emu` command, as a user calls it in error. tests/firmware.rs has the rest.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::fs;
use std::path::Path;
use std::process::Command;

/// What it says before it ends with exit code 2.
fn complaint(arguments: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_rc10")).arg("emu").args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert!(output.stdout.is_empty());
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn what_is_no_program_is_named() {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("no-program.elf");
    let file = file.to_str().unwrap();
    // Nothing, a picture, this machine's own command.
    let own = fs::read(env!("CARGO_BIN_EXE_rc10")).unwrap();
    for bytes in [&b""[..], b"\x89PNG\r\n\x1a\n", &own] {
        fs::write(file, bytes).unwrap();
        let complaint = complaint(&[file]);
        assert!(complaint.contains(file) && complaint.contains("ELF"), "{complaint}");
    }
    assert!(complaint(&["no/such/file.elf"]).contains("cannot read no/such/file.elf"));
}

#[test]
fn faults_that_cannot_happen_are_refused() {
    for (fault, why) in [
        ("cut:2@1s", "after the end"),
        ("panic@3s", "after the end"),
        ("cut:4@0.1s", "needs a bus"),
        ("flood@0.1s", "no such fault"),
    ] {
        let complaint = complaint(&["firmware.elf", "--fault", fault]);
        assert!(complaint.contains(why), "{complaint}");
    }
}
