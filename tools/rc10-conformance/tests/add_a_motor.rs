//! The guide `docs/add-a-motor.md`: its motor, compiled and run, and its code blocks compared with
//! these sources, so that neither changes without the other.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![allow(clippy::cast_possible_truncation, reason = "the device's numbers saturate")]

#[path = "add_a_motor/declared.rs"]
mod declared;
#[path = "add_a_motor/device.rs"]
mod device;
#[path = "add_a_motor/motor.rs"]
mod motor;
#[path = "add_a_motor/robot.rs"]
mod robot;

use rc10_conformance::{RULES, check};

use declared::declared;
use device::plug_in;
use motor::{Command, Finch, Report};

#[test]
fn the_codec_agrees_with_the_table() {
    assert_eq!(Command::Disable.pack(), [0, 0, 0]);
    assert_eq!(Command::Enable.pack(), [1, 0, 0]);
    assert_eq!(Command::Torque(1.5).pack(), [2, 0x05, 0xDC]);
    assert_eq!(Command::Torque(-1.5).pack(), [2, 0xFA, 0x24]);
    assert_eq!(Command::Torque(1e9).pack(), [2, 0x7F, 0xFF]);
    assert_eq!(Command::Torque(f32::NAN).pack(), [2, 0, 0]);
    assert_eq!(Command::ClearError.pack(), [3, 0, 0]);

    let report = Report::unpack(&[0x40, 0, 0x04, 0xB0, 0xFF, 0x9C, 1, 2]).unwrap();
    assert_eq!((report.angle, report.enabled, report.error), (0x4000, true, 2));
    assert!((report.rpm - 120.0).abs() < 1e-3 && (report.amps + 1.0).abs() < 1e-3);
    assert_eq!(Report::unpack(&[0, 0, 0, 0, 0, 0, 7, 0]), None);
}

#[test]
fn identifiers_that_no_motor_has_are_refused() {
    assert!(Finch::new(0).is_err());
    let refused = Finch::new(64).unwrap_err();
    assert_eq!(refused.to_string(), "`id` is 64, but must be 1 to 63");
}

#[test]
fn it_keeps_the_rules() -> Result<(), rc10_conformance::Report> {
    check(&declared(), |id| Finch::new(id).unwrap(), plug_in)
}

/// The sources that the guide shows.
const SOURCES: [&str; 5] = [
    include_str!("add_a_motor/motor.rs"),
    include_str!("add_a_motor/device.rs"),
    include_str!("add_a_motor/declared.rs"),
    include_str!("add_a_motor/robot.rs"),
    include_str!("add_a_motor.rs"),
];

const GUIDES: [(&str, &str); 2] = [
    ("docs/add-a-motor.md", include_str!("../../../docs/add-a-motor.md")),
    ("docs/add-a-motor.zh-CN.md", include_str!("../../../docs/add-a-motor.zh-CN.md")),
];

/// The blocks of a guide that are fenced as Rust.
fn blocks(guide: &str) -> Vec<&str> {
    let fences = guide.split("```rust\n").skip(1);
    fences.map(|rest| rest.split("```").next().unwrap()).collect()
}

/// Lines without their indentation: a guide may show a part of a function.
fn flat(code: &str) -> String {
    code.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n")
}

#[test]
fn every_code_block_of_the_guides_stands_in_these_sources() {
    let sources = SOURCES.map(flat);
    for (name, guide) in GUIDES {
        let blocks = blocks(guide);
        assert!(blocks.len() > 8, "{name} shows {} blocks of code", blocks.len());
        for block in blocks {
            let found = sources.iter().any(|source| source.contains(&flat(block)));
            assert!(found, "{name} shows what is not in the example:\n{block}");
        }
    }
}

#[test]
fn both_guides_show_the_same_code_and_every_rule() {
    let [(_, english), (_, chinese)] = GUIDES;
    assert_eq!(blocks(english), blocks(chinese));
    for (name, guide) in GUIDES {
        for rule in RULES {
            assert!(guide.contains(&format!("`{}`", rule.name)), "{name} lacks {}", rule.name);
        }
    }
    for rule in RULES {
        assert!(english.contains(&format!("| `{}` | {} |", rule.name, rule.text)), "{}", rule.name);
    }
}
