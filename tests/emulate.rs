//! The `rc10 emu` command, as a user calls it in error. tests/firmware.rs has the rest.

use std::fs;
use std::process::Command;

use crate::common::scratch::Scratch;

/// Error output of a run that ends with exit code 2.
fn complaint(arguments: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_rc10")).arg("emu").args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert!(output.stdout.is_empty());
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn what_is_no_program_is_named() {
    let folder = Scratch::new("no-program");
    let file = folder.join("no-program.elf");
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

/// An ELF file with one segment: the vector table, and a program that reads a word at `address`.
pub fn program_that_reads(address: u32) -> Vec<u8> {
    const FLASH: u32 = 0x0800_0000;
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let mut flash: Vec<u8> = words(&[0x2002_0000, FLASH + 65]);
    // All exceptions end where the program ends.
    flash.extend::<Vec<u8>>(words(&[FLASH + 69; 14]));
    // ldr r0, [pc, #4]; ldr r1, [r0]; b .; nop
    for instruction in [0x4801_u16, 0x6801, 0xE7FE, 0xBF00] {
        flash.extend(instruction.to_le_bytes());
    }
    flash.extend(address.to_le_bytes());
    let length = u32::try_from(flash.len()).unwrap();
    let mut file = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
    // An executable for Arm: entry, program headers behind this header, one of them.
    file.extend::<Vec<u8>>(words(&[0x0028_0002, 1, FLASH, 52, 0, 0x0500_0000]));
    for half in [52_u16, 32, 1, 40, 0, 0] {
        file.extend(half.to_le_bytes());
    }
    file.extend::<Vec<u8>>(words(&[1, 84, FLASH, FLASH, length, length, 5, 4]));
    file.extend(flash);
    file
}

#[test]
fn a_program_for_another_chip_is_named_as_such() {
    let folder = Scratch::new("other-chip");
    let file = folder.join("other.elf");
    let file = file.to_str().unwrap();
    let out = folder.join("other");
    for (address, what) in [
        (0xE004_2004, "the debug unit of STM32F1 to F7, G4 and L4"),
        (0x4002_3800, "the clock control of STM32F2, F4 and F7"),
        (0x4002_1000, "the clock control of STM32F0, F1, F3, G0, G4, L0 and L4"),
    ] {
        fs::write(file, program_that_reads(address)).unwrap();
        let complaint = complaint(&[file, "--out", out.to_str().unwrap()]);
        let words = format!("this ELF is not for an STM32H723: it looks for {what}, at");
        assert!(complaint.contains(file) && complaint.contains(&words), "{complaint}");
    }
}

#[test]
fn a_program_that_does_nothing_has_problems() {
    let folder = Scratch::new("idle");
    let file = folder.join("idle.elf");
    let out = folder.join("idle");
    // The reset and clock control: there on an STM32H7.
    fs::write(&file, program_that_reads(0x5802_4400)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    command.arg("emu").arg(&file).args(["--seconds", "0.1", "--strict", "--out"]).arg(&out);
    let output = command.output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(text.contains("chip: a bus has seen no frame from it"), "{text}");
    // The files that run leaves, and no values that the chip alone knows.
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(report.contains("<h1>RC10 run on an emulated chip</h1>"));
    assert!(report.contains("chip: a bus has seen no frame from it"));
    for column in ["target", "RMS error", "drive", "refused"] {
        let is_head = |line: &str| line.starts_with("motor ") && line.contains(column);
        assert!(!report.contains(&format!(">{column}</th>")) && !text.lines().any(is_head));
    }
    assert!(fs::metadata(out.join("bus3.log")).is_ok());
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
