//! The kit itself: a motor that breaks one rule is caught by that rule, and by no other.
#![allow(clippy::cast_possible_truncation, reason = "the device's numbers saturate")]
#![allow(clippy::cast_precision_loss, reason = "small numbers")]
#![allow(dead_code, reason = "a part of the guide's motor is not used here")]

#[path = "add_a_motor/declared.rs"]
mod declared;
#[path = "add_a_motor/device.rs"]
mod device;
#[path = "add_a_motor/motor.rs"]
mod motor;
mod spoil;
mod spoiled;
mod sprung;

use rc10_app::Rpm;
use rc10_conformance::{Claim, Declaration, RULES, Report, check, check_line};
use rc10_motor::rc10_app::Direction;
use rc10_motor::unitree::{GoM8010, LineConfig};
use rc10_sim::unitree_line::{GoM8010 as Device, plant};

use crate::conformance::unitree_line;
use declared::declared;
use device::plug_in;
use motor::Finch;
use spoil::Spoil;
use spoiled::Spoiled;
use sprung::{Slip, check_sprung};

fn check_spoiled(declared: &Declaration, spoil: Spoil) -> Result<(), Report> {
    check(declared, |id| Spoiled::new(Finch::new(id).unwrap(), spoil), plug_in)
}

#[test]
fn a_motor_that_keeps_the_rules_passes() -> Result<(), Report> {
    check(&declared(), |id| Finch::new(id).unwrap(), plug_in)?;
    // What spoils the others lets it pass if it spoils nothing.
    check_spoiled(&declared(), Spoil::Nothing)
}

#[test]
fn each_rule_has_a_motor_that_breaks_it() {
    let mut wrong = Vec::new();
    for rule in RULES {
        let is_broken = Spoil::ALL.iter().any(|(name, _)| *name == rule.name)
            || Slip::ALL.iter().any(|(name, _)| *name == rule.name);
        if !is_broken && !DECLARED.contains(&rule.name) {
            wrong.push(format!("no motor breaks {}", rule.name));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// Each is caught by its rule alone.
fn are_caught(spoils: &[(&str, Spoil)]) {
    let mut wrong = Vec::new();
    for (rule, spoil) in spoils {
        match check_spoiled(&declared(), *spoil) {
            Ok(()) => wrong.push(format!("{rule}: {spoil:?} passes")),
            Err(report) if report.broken().ne([*rule]) => {
                wrong.push(format!("{rule} by {spoil:?}: {report}"));
            }
            Err(_) => (),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn each_rule_catches_a_motor_that_breaks_it() {
    are_caught(&Spoil::ALL[..Spoil::ALL.len() / 2]);
}

#[test]
fn each_further_motor_is_caught_by_the_rule_it_breaks() {
    are_caught(&Spoil::ALL[Spoil::ALL.len() / 2..]);
}

#[test]
fn an_impedance_that_slips_is_caught() {
    for (rule, slip) in Slip::ALL {
        let report = check_sprung(slip).unwrap_err();
        // A wrong start is one after a restart, too.
        let others = report.broken().filter(|broken| *broken != "restart");
        assert_eq!(others.collect::<Vec<_>>(), [rule], "{slip:?}: {report}");
    }
}

#[test]
fn a_motor_that_turns_the_wrong_way_in_the_mirror_is_caught() {
    let reversed = Declaration { direction: Direction::Reversed, ..declared() };
    let report = check_spoiled(&reversed, Spoil::Nothing).unwrap_err();
    assert!(report.broken().any(|rule| rule == "feedback-is-true"), "{report}");
    assert!(report.broken().any(|rule| rule == "gets-going"), "{report}");
    assert!(report.to_string().starts_with("Finch F10 id 1, reversed: "), "{report}");
}

/// Rules that a declaration breaks, not a motor.
const DECLARED: [&str; 1] = ["every-target-is-tried"];

#[test]
fn a_declaration_that_says_too_little_or_too_much_is_caught() {
    let untried = Declaration { trials: declared().trials[1..].to_vec(), ..declared() };
    let no_reason = Declaration { holds: Claim::Cannot(""), ..declared() };
    let backwards = Declaration { cruise: Rpm::new(-5.0), ..declared() };
    let one_id = Declaration { ids: [1, 1], ..declared() };
    for wrong in [untried, no_reason] {
        let report = check_spoiled(&wrong, Spoil::Nothing).unwrap_err();
        assert_eq!(report.broken().collect::<Vec<_>>(), DECLARED, "{report}");
    }
    for wrong in [backwards, one_id] {
        let report = check_spoiled(&wrong, Spoil::Nothing).unwrap_err();
        assert!(report.broken().any(|rule| rule == DECLARED[0]), "{report}");
    }
}

/// A motor of a line, its device with another identifier by so much.
fn check_on_line(hold_gives: f64, softness: f64, other: u8) -> Report {
    let good = unitree_line::declared(Direction::Forward);
    let declared = Declaration { hold_gives, softness, ..good };
    let device = |wire: &rc10_sim::Line, id: u8| {
        wire.add(Device::new(id + other), plant().with_load_inertia(0.01))
    };
    check_line(&declared, |id| GoM8010::new(LineConfig::new(id)).unwrap(), device).unwrap_err()
}

#[test]
fn a_motor_of_a_line_is_caught_too() {
    let gives = check_on_line(5.0, 0.12, 0);
    assert_eq!(gives.broken().collect::<Vec<_>>(), ["holds"], "{gives}");
    let kicks = check_on_line(14.0, 0.03, 0);
    assert!(kicks.broken().any(|rule| rule == "restart"), "{kicks}");
    let deaf = check_on_line(14.0, 0.12, 5);
    assert!(deaf.broken().any(|rule| rule == "gets-going"), "{deaf}");
    assert!(["disarm", "lost", "fault-waits"].iter().all(|rule| deaf.unchecked.contains(rule)));
}

#[test]
fn a_report_names_every_broken_rule_in_words_and_says_when() {
    let report = check_spoiled(&declared(), Spoil::NeverEnables).unwrap_err();
    assert!(report.broken().any(|rule| rule == "gets-going"), "{report}");
    assert!(report.unchecked.contains(&"disarm"), "{report}");
    let text = report.to_string();
    assert!(text.starts_with("Finch F10 id 1: "), "{text}");
    let first = text.lines().next().unwrap();
    let cause = "gets-going: armed and commanded it makes 0.0 rpm, not 120 (at 2.060000 s)";
    assert_eq!(first, format!("Finch F10 id 1: {cause}"), "{text}");
    assert_eq!(format!("{report:?}"), text);
    assert!(text.contains("not tried to the end: "), "{text}");
}

#[test]
fn a_wrong_codec_is_named_in_the_first_line() {
    for (spoil, cause) in [
        (
            Spoil::SwapsSpeed,
            "feedback-is-true: turned by hand it says -2943.8 rpm, and makes 65.3 (",
        ),
        (Spoil::TenthOfTorque, "follows: torque 2.5 N m: 0.250 N m at best: 0.100 times that"),
    ] {
        let report = check_spoiled(&declared(), spoil).unwrap_err().to_string();
        let first = report.lines().next().unwrap();
        assert!(first.starts_with(&format!("Finch F10 id 1: {cause}")), "{spoil:?}: {report}");
    }
}

#[test]
fn rules_have_names_that_differ_and_texts() {
    for (index, rule) in RULES.iter().enumerate() {
        assert!(RULES[..index].iter().all(|other| other.name != rule.name), "{}", rule.name);
        assert!(rule.text.ends_with('.') && rule.text.len() > 20, "{}", rule.name);
    }
}
