//! The kit itself: a motor that breaks one rule is caught by that rule, and by no other.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![allow(clippy::cast_possible_truncation, reason = "the device's numbers saturate")]
#![allow(clippy::cast_precision_loss, reason = "small numbers")]
#![allow(dead_code, reason = "a part of the guide's motor is not used here")]

#[path = "add_a_motor/declared.rs"]
mod declared;
#[path = "add_a_motor/device.rs"]
mod device;
#[path = "add_a_motor/motor.rs"]
mod motor;
#[path = "rule_breakers/spoil.rs"]
mod spoil;
#[path = "rule_breakers/spoiled.rs"]
mod spoiled;

use rc10_conformance::{Claim, Declaration, RULES, Report, check};

use declared::declared;
use device::plug_in;
use motor::Finch;
use spoil::Spoil;
use spoiled::Spoiled;

fn check_spoiled(declared: &Declaration, spoil: Spoil) -> Result<(), Report> {
    check(declared, |id| Spoiled::new(Finch::new(id).unwrap(), spoil), plug_in)
}

#[test]
fn a_motor_that_keeps_the_rules_passes() {
    if let Err(report) = check(&declared(), |id| Finch::new(id).unwrap(), plug_in) {
        panic!("{report}");
    }
    // What spoils the others lets it pass if it spoils nothing.
    assert_eq!(check_spoiled(&declared(), Spoil::Nothing), Ok(()));
}

#[test]
fn each_rule_catches_who_breaks_it_and_nobody_else() {
    let mut wrong = Vec::new();
    for rule in RULES {
        let is_broken = Spoil::ALL.iter().any(|(name, _)| *name == rule.name);
        if !is_broken && !DECLARED.contains(&rule.name) {
            wrong.push(format!("nobody breaks {}", rule.name));
        }
    }
    for (rule, spoil) in Spoil::ALL {
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

/// Rules that a declaration breaks, not a motor.
const DECLARED: [&str; 1] = ["every-target-is-tried"];

#[test]
fn a_declaration_that_says_too_little_or_too_much_is_caught() {
    let untried = Declaration { trials: declared().trials[1..].to_vec(), ..declared() };
    let no_reason = Declaration { holds: Claim::Cannot(""), ..declared() };
    let backwards = Declaration { cruise: rc10_app::Rpm::new(-5.0), ..declared() };
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

#[test]
fn a_report_names_every_broken_rule_in_words_and_says_when() {
    let report = check_spoiled(&declared(), Spoil::NeverEnables).unwrap_err();
    assert!(report.broken().any(|rule| rule == "gets-going"), "{report}");
    assert!(report.unchecked().contains(&"disarm"), "{report}");
    let text = report.to_string();
    assert!(text.starts_with("Finch F10 id 1: "), "{text}");
    assert!(
        text.contains(
            "\n  gets-going: armed and commanded it makes 0.0 rpm, not 120 (at 2.060000 s)"
        ),
        "{text}"
    );
    assert!(text.contains("not tried to the end: "), "{text}");
}

#[test]
fn rules_have_names_that_differ_and_texts() {
    for (index, rule) in RULES.iter().enumerate() {
        assert!(RULES[..index].iter().all(|other| other.name != rule.name), "{}", rule.name);
        assert!(rule.text.ends_with('.') && rule.text.len() > 20, "{}", rule.name);
    }
}
