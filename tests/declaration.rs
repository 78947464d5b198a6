//! Wrong robots: each is refused when it is compiled, in the words in which it is refused when it runs.
//!
//! Each is a file of `tests/declaration/wrong` that begins with what is said of it. Here the same file is
//! compiled without the check, and asked at run time.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// The names that the files use, without the check.
#[allow(dead_code, unused_imports, reason = "each robot takes some")]
mod wrong_robots {
    pub use rc10_motor::Place::{Bus, Line};
    pub use rc10_motor::damiao::{self, Damiao};
    pub use rc10_motor::dji::{self, Dji};
    pub use rc10_motor::rc10_app::{Cascade, ConfigError, Direction};
    pub use rc10_motor::rc10_can::{CanFrame, IdPattern};
    pub use rc10_motor::rc10_time::Micros;
    pub use rc10_motor::unitree::{GoM8010, GoModule, LineConfig, ModuleConfig};
    pub use rc10_motor::vesc::Vesc;
    pub use rc10_motor::{CanIds, Entry, Frames, MotorName, OtherDevice, Rate, Safety};

    include!("declaration/src/own.rs");

    macro_rules! declare {
        ($($declaration:tt)+) => {
            rc10_motor::motors! { unchecked $($declaration)+ }
        };
    }
    pub(crate) use declare;
}

macro_rules! robots {
    ($($robot:ident),+ $(,)?) => {
        $(
            #[allow(dead_code, reason = "only its declaration is looked at")]
            mod $robot {
                use crate::declaration::wrong_robots;
                include!(concat!("declaration/wrong/", stringify!($robot), ".rs"));

                /// The error of the check at run time.
                pub fn said() -> String {
                    <Name as rc10_motor::Names>::check().unwrap_err().to_string()
                }
            }
        )+

        /// Each robot, with what is said of it at run time.
        const ROBOTS: &[(&str, fn() -> String)] = &[$((stringify!($robot), $robot::said)),+];
    };
}

robots! {
    answers_itself,
    beyond_its_limit,
    bus_zero,
    can_on_a_line,
    does_not_fit,
    every_vesc,
    expires_at_once,
    expires_too_late,
    id_beyond,
    id_of_another_model,
    id_of_none,
    late_behind_a_module,
    late_behind_vescs,
    late_own,
    line_on_a_bus,
    module_zero_beside_a_vesc,
    nine_motors,
    no_such_bus,
    no_such_line,
    not_a_gain,
    obeys_another,
    old_at_125_hz,
    old_at_once,
    old_behind_three,
    old_by_little,
    old_on_bus_3,
    old_vesc,
    old_without_bound,
    same_address,
    same_feedback,
    same_id,
    same_label,
    too_many_families,
    too_many_filters,
    too_many_patterns,
    too_many_standard_filters,
    too_much_current,
    too_much_torque,
}

/// The robots' files, with the sentence that each begins with.
fn files() -> BTreeMap<String, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/declaration/wrong");
    let file = |entry: fs::DirEntry| {
        let text = fs::read_to_string(entry.path()).unwrap();
        let sentence = text.lines().next().unwrap().strip_prefix("// says: ").unwrap();
        let name = entry.path().file_stem().unwrap().to_str().unwrap().to_owned();
        (name, sentence.to_owned())
    };
    fs::read_dir(folder).unwrap().map(|entry| file(entry.unwrap())).collect()
}

#[test]
fn a_wrong_robot_is_refused_when_it_runs() {
    let said: BTreeMap<String, String> =
        ROBOTS.iter().map(|(robot, said)| ((*robot).to_owned(), said())).collect();
    assert_eq!(said, files());
    assert!(said.len() >= 12);
}

#[test]
fn a_wrong_robot_does_not_compile_and_the_compiler_says_the_same() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let output = Command::new(env!("CARGO"))
        .args([
            "check",
            "--locked",
            "--bins",
            "--keep-going",
            "--message-format=json",
            "--target-dir",
        ])
        .arg(root.join("target/declaration"))
        .current_dir(root.join("tests/declaration"))
        .env_remove("CARGO_TARGET_DIR")
        .env_remove("RUSTFLAGS")
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let mut errors: BTreeMap<String, String> = BTreeMap::new();
    let mut compiled = Vec::new();
    for line in text.lines() {
        let message: Value = serde_json::from_str(line).unwrap();
        let name = message["target"]["name"].as_str().unwrap_or_default().to_owned();
        if message["reason"] == "compiler-artifact" && message["target"]["kind"][0] == "bin" {
            compiled.push(name.clone());
        }
        if message["reason"] == "compiler-message" && message["message"]["level"] == "error" {
            let said = &message["message"];
            *errors.entry(name).or_default() += said["rendered"].as_str().unwrap();
        }
    }
    assert_eq!(compiled, ["full_buses"], "{}", String::from_utf8_lossy(&output.stderr));
    for (robot, sentence) in files() {
        let said = errors.remove(&robot).unwrap_or_default();
        assert!(said.contains(&sentence), "{robot}: not said: {sentence}\n{said}");
    }
    assert!(errors.is_empty(), "{errors:?}");
}
