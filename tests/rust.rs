//! `docs/rust.md`: each of its errors, made in the robot that `rc10 new` writes, is what the compiler says.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

const PAGES: [&str; 2] = [include_str!("../docs/rust.md"), include_str!("../docs/rust.zh-CN.md")];

/// The blocks of a language.
fn blocks<'p>(page: &'p str, language: &str) -> Vec<&'p str> {
    let begin = format!("```{language}\n");
    page.split(&begin).skip(1).map(|rest| rest.split("\n```").next().unwrap()).collect()
}

/// What is told of each error: what is written, and what the compiler says.
fn errors(page: &str) -> Vec<(Vec<&str>, &str)> {
    let sections = page.split("\n### ").skip(1);
    sections.map(|section| (blocks(section, "diff"), blocks(section, "text")[0])).collect()
}

/// Lines of a `diff` that begin so.
fn lines(diff: &str, sign: char) -> String {
    diff.lines()
        .filter_map(|line| line.strip_prefix(sign))
        .map(|line| format!("{line}\n"))
        .collect()
}

/// A line of an error without the number of the source's line.
fn unnumbered(line: &str) -> &str {
    line.trim_start().trim_start_matches(|sign: char| sign.is_ascii_digit()).trim()
}

#[test]
fn both_languages_have_the_same_blocks() {
    let [english, chinese] =
        PAGES.map(|page| (errors(page), blocks(page, "rust,standalone_crate").len()));
    assert_eq!(english, chinese);
    assert_eq!(english.0.len(), 10);
}

#[test]
fn the_compiler_says_what_the_page_says() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let place = root.join("target/rust-page");
    let _ = fs::remove_dir_all(&place);
    fs::create_dir_all(&place).unwrap();
    fs::write(place.join("Cargo.toml"), "[workspace]\nmembers = [\"error*\"]\nresolver = \"3\"\n")
        .unwrap();
    fs::copy(root.join("Cargo.lock"), place.join("Cargo.lock")).unwrap();
    let errors = errors(PAGES[0]);
    for (number, (diffs, _)) in errors.iter().enumerate() {
        let folder = place.join(format!("error{number}"));
        fs::create_dir_all(folder.join("src")).unwrap();
        let manifest = format!(
            "[package]\nname = \"error{number}\"\nedition = \"2024\"\n\n[features]\nsim = []\n\n[dependencies]\n\
             rc10 = {{ path = {:?} }}\n",
            root.join("crates/rc10")
        );
        fs::write(folder.join("Cargo.toml"), manifest).unwrap();
        let mut left = diffs.clone();
        for file in ["lib.rs", "table.rs", "task.rs"] {
            let mut text =
                fs::read_to_string(root.join("examples/starter/src").join(file)).unwrap();
            left.retain(|diff| {
                let is_here = text.matches(&lines(diff, '-')).count() == 1;
                if is_here {
                    text = text.replace(&lines(diff, '-'), &lines(diff, '+'));
                }
                !is_here
            });
            fs::write(folder.join("src").join(file), text).unwrap();
        }
        assert!(left.is_empty(), "not in the starter: {left:?}");
    }

    let output = Command::new(env!("CARGO"))
        .args(["check", "--offline", "--keep-going", "--message-format=json", "--target-dir"])
        .arg(root.join("target/declaration"))
        .current_dir(&place)
        .env_remove("CARGO_TARGET_DIR")
        .env_remove("RUSTFLAGS")
        .output()
        .unwrap();
    let mut said: BTreeMap<String, String> = BTreeMap::new();
    for line in String::from_utf8(output.stdout).unwrap().lines() {
        let message: Value = serde_json::from_str(line).unwrap();
        if message["reason"] == "compiler-message" && message["message"]["level"] == "error" {
            let name = message["target"]["name"].as_str().unwrap().to_owned();
            *said.entry(name).or_default() += message["message"]["rendered"].as_str().unwrap();
        }
    }
    for (number, (_, told)) in errors.iter().enumerate() {
        let said = said.get(&format!("error{number}")).map(String::as_str).unwrap_or_default();
        assert!(!said.is_empty(), "{told}\n{}", String::from_utf8_lossy(&output.stderr));
        let mut lines = said.lines().map(unnumbered);
        for line in told.lines() {
            assert!(lines.any(|said| said == unnumbered(line)), "not said: {line}\n{said}");
        }
    }
}
