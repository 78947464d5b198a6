//! The READMEs: their length, the robot that they show, driven; and where the links of all pages lead.

use std::fs;
use std::path::{Path, PathBuf};

use rc10_cli::judge::problems;
use rc10_cli::recording::problem::any;
use rc10_cli::{Simulated as _, simulated};
use rc10_motor::Names as _;
use rc10_time::Micros;

#[allow(dead_code, reason = "`main` is the example's")]
#[path = "../crates/rc10/examples/thirty.rs"]
mod thirty;

use thirty::{Name, Robot};

const ROBOT: &str = include_str!("../crates/rc10/examples/thirty.rs");
const READMES: [&str; 2] = [include_str!("../README.md"), include_str!("../README.zh-CN.md")];

#[test]
fn both_are_short_and_show_the_robot_that_is_compiled() {
    let (shown, _) = ROBOT.split_once("\n// So far the READMEs.").unwrap();
    assert!(shown.lines().count() <= 30, "{} lines", shown.lines().count());
    for readme in READMES {
        assert!(readme.len() <= 9_000, "{} bytes", readme.len());
        assert!(readme.contains(&format!("```rust\n{shown}```\n")), "another robot than:\n{shown}");
    }
}

#[test]
fn its_wheels_turn_as_the_sticks_say() {
    let run = simulated::<Robot>(Robot::description(), 1, Micros::from_millis(2500)).unwrap();
    let found = problems(&run);
    assert!(!any(&found), "{found:?}");
    // Half of the full speed: both forward; the left one forward and the right one back; none.
    for (millis, speeds) in
        [(190, [0.0; 2]), (980, [100.0; 2]), (1780, [100.0, -100.0]), (2490, [0.0; 2])]
    {
        for (name, expected) in [Name::Left, Name::Right].into_iter().zip(speeds) {
            let rpm = run.motors[name.index()].samples[millis / 10].rpm;
            assert!((rpm - expected).abs() < 4.0, "{name:?} at {millis} ms: {rpm} rpm");
        }
    }
}

/// The pages below a folder.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let is_ours = !path.ends_with("target") && !path.ends_with(".git");
        if path.is_dir() && is_ours {
            found.extend(pages(&path));
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
    found
}

/// A heading as the address of its part.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase().replace(' ', "-");
    text.chars().filter(|it| it.is_alphanumeric() || ['-', '_'].contains(it)).collect()
}

#[test]
fn every_link_of_every_page_leads_to_a_file_and_to_a_part_of_it() {
    let mut checked = 0;
    for page in pages(Path::new(env!("CARGO_MANIFEST_DIR"))) {
        let text = fs::read_to_string(&page).unwrap();
        let prose: String = text.split("```").step_by(2).collect();
        for link in prose.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if link.contains("://") {
                continue;
            }
            let (file, part) = link.split_once('#').map_or((link, None), |(a, b)| (a, Some(b)));
            let to = if file.is_empty() { page.clone() } else { page.with_file_name(file) };
            assert!(to.exists(), "{}: {link}", page.display());
            if let Some(part) = part {
                let text = fs::read_to_string(&to).unwrap();
                let mut prose = text.split("```").step_by(2).flat_map(str::lines);
                let is_there = prose.any(|line| line.starts_with('#') && anchor(line) == part);
                assert!(is_there, "{}: {link}", page.display());
            }
            checked += 1;
        }
    }
    assert!(checked > 300, "{checked}");
}
