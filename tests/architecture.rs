//! `docs/architecture.md` and `docs/words.md` against the sources: files, functions, types, and
//! which crate uses which.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const HOUSE: &str = include_str!("../docs/architecture.md");
const WORDS: &str = include_str!("../docs/words.md");

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The `.rs` files under a folder, at any depth, with their texts.
fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            found.push((path, text));
        }
    }
    found
}

/// The code of a source, without its comments.
fn code(text: &str) -> String {
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

fn words(code: &str) -> impl Iterator<Item = &str> {
    code.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty())
}

/// Names in backticks, outside of blocks of code.
fn quoted(page: &str) -> impl Iterator<Item = &str> {
    let prose = page.split("```").step_by(2);
    prose.flat_map(|prose| prose.split('`').skip(1).step_by(2))
}

/// The rows of the table under a heading, without its head.
fn rows<'p>(page: &'p str, heading: &str) -> Vec<Vec<&'p str>> {
    let (_, rest) = page.split_once(heading).unwrap_or_else(|| panic!("no heading {heading}"));
    let lines = rest.lines().skip_while(|line| !line.starts_with('|'));
    let table = lines.take_while(|line| line.starts_with('|')).skip(2);
    table.map(|row| row.trim_matches('|').split('|').map(str::trim).collect()).collect()
}

/// Whether a function of this name is defined in the code.
fn defines_function(code: &str, name: &str) -> bool {
    let mut words = words(code).peekable();
    while let Some(word) = words.next() {
        if word == "fn" && words.peek() == Some(&name) {
            return true;
        }
    }
    false
}

#[test]
fn the_three_walks_name_files_and_functions_that_are_there() {
    let walks = [
        "### A received frame becomes feedback",
        "### A target becomes a frame",
        "### A stick moves a wheel",
    ];
    for walk in walks {
        let steps = rows(HOUSE, walk);
        assert!(steps.len() >= 10, "{walk}: {}", steps.len());
        for step in steps {
            let [file, functions, _] = step[..] else { panic!("other columns: {step:?}") };
            let file = file.trim_matches('`');
            let text = fs::read_to_string(root().join(file));
            let text = code(&text.unwrap_or_else(|error| panic!("{walk}: {file}: {error}")));
            let functions: Vec<_> = quoted(functions).collect();
            assert!(!functions.is_empty(), "{walk}: {file} without a function");
            for function in functions {
                assert!(defines_function(&text, function), "{walk}: no {function} in {file}");
            }
        }
    }
}

#[test]
fn every_file_that_the_page_names_is_there() {
    // Of the two vendors: all folders have the same files, and some have `wire/`.
    let motors = "crates/rc10-motor/src";
    let vendors = [format!("{motors}/dji"), format!("{motors}/unitree")];
    let mut folders = vec!["", "crates", "tools", "firmware", "crates/rc10-app/src", motors];
    folders.extend(vendors.iter().map(String::as_str));
    let mut checked = 0;
    for page in [HOUSE, WORDS] {
        for file in quoted(page).filter(|name| name.ends_with(".rs") || name.ends_with('/')) {
            let is_there = folders.iter().any(|folder| root().join(folder).join(file).exists());
            assert!(is_there, "no file {file}");
            checked += 1;
        }
    }
    assert!(checked >= 60, "{checked}");
}

/// A type (`Shaft`) or a member (`Shaft::follow`) in backticks is a word of the code.
#[test]
fn every_type_that_the_page_names_is_in_the_code() {
    let mut known = BTreeSet::new();
    for folder in ["crates", "tools", "firmware", "examples", "src"] {
        for (_, text) in sources(&root().join(folder)) {
            known.extend(words(&code(&text)).map(str::to_owned));
        }
    }
    let mut checked = 0;
    for name in quoted(HOUSE) {
        let is_path = name.contains("::");
        let is_type = name.starts_with(|c: char| c.is_ascii_uppercase())
            && name.chars().all(|c| c.is_alphanumeric() || c == '_')
            && name.contains(|c: char| c.is_ascii_lowercase());
        if !is_path && !is_type {
            continue;
        }
        for word in words(name).filter(|word| !word.starts_with(|c: char| c.is_ascii_digit())) {
            assert!(known.contains(word), "`{name}`: no {word} in the code");
            checked += 1;
        }
    }
    assert!(checked >= 150, "{checked}");
}

/// The folders of all crates: what is flashed, and what runs on a PC.
fn crates() -> impl Iterator<Item = PathBuf> {
    let folders = ["crates", "tools"].map(|top| fs::read_dir(root().join(top)).unwrap());
    folders.into_iter().flatten().map(|entry| entry.unwrap().path())
}

/// The crates that a manifest's `[dependencies]` name.
fn dependencies(folder: &Path) -> BTreeSet<String> {
    let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
    let (_, rest) = manifest.split_once("[dependencies]").unwrap_or_default();
    let lines = rest.lines().skip(1).take_while(|line| !line.starts_with('['));
    let ours = lines.filter_map(|line| line.strip_prefix("rc10-"));
    ours.map(|line| line.split(['.', ' ', '=']).next().unwrap().to_owned()).collect()
}

#[test]
fn the_crates_use_what_the_table_says_and_lower_floors_only() {
    let mut floors = BTreeMap::new();
    let (_, picture) = HOUSE.split_once("## Crates").unwrap();
    for line in picture.split("```").nth(1).unwrap().lines() {
        let mut words = line.split_whitespace();
        if let (Some("floor"), Some(floor)) = (words.next(), words.next()) {
            floors.extend(words.map(|name| (name, floor)));
        }
    }
    let told: BTreeMap<_, _> = rows(HOUSE, "A crate uses crates of lower floors only")
        .into_iter()
        .map(|row| {
            let uses = row[2].split(", ").filter(|name| *name != "-").map(str::to_owned);
            (row[0].trim_matches('`'), uses.collect::<BTreeSet<_>>())
        })
        .collect();
    let mut checked = 0;
    for folder in crates() {
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        let uses = dependencies(&folder);
        assert_eq!(told.get(name.as_str()), Some(&uses), "what {name} uses");
        for used in uses {
            let used = format!("rc10-{used}");
            assert!(floors[used.as_str()] < floors[name.as_str()], "{name} uses {used}");
        }
        checked += 1;
    }
    assert_eq!(checked, told.len(), "crates of the table");
}

/// Whether a crate's code defines this name: a type, module, function, constant, field or variant.
fn defines(code: &str, name: &str) -> bool {
    let kinds = ["struct", "enum", "trait", "type", "mod", "fn", "const", "static"];
    let mut before = "";
    for word in words(code) {
        if word == name && kinds.contains(&before) {
            return true;
        }
        before = word;
    }
    code.lines().map(str::trim).any(|line| {
        let rest = line.strip_prefix("pub ").unwrap_or(line).strip_prefix(name);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with([',', '(', ':']))
    })
}

#[test]
fn every_word_stands_once_and_is_in_the_code() {
    let mut codes = BTreeMap::new();
    let mut terms = BTreeSet::new();
    let lines = WORDS.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| term"));
    for line in lines {
        let row: Vec<_> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [term, meaning, place] = row[..] else { panic!("other columns: {line}") };
        assert!(!meaning.is_empty(), "{term}");
        for term in term.split(", ") {
            assert!(terms.insert(term), "{term} stands there twice");
        }
        let mut path = place.trim_matches('`').split("::");
        let name = path.next().unwrap().replace('_', "-");
        let code = codes.entry(name.clone()).or_insert_with(|| {
            let team = root().join("examples/team");
            let mut folders = crates().chain([team]);
            let folder = folders.find(|folder| folder.ends_with(&name)).unwrap();
            let texts = sources(&folder.join("src"));
            texts.iter().map(|(_, text)| code(text) + "\n").collect::<String>()
        });
        for part in path {
            assert!(defines(code, part), "{term}: `{place}`: no {part} in {name}");
        }
    }
    assert!(terms.len() >= 100, "{}", terms.len());
}

/// Every vendor's folder has the same files, and none uses another's.
#[test]
fn vendors_folders_are_alike_and_apart() {
    let motors = root().join("crates/rc10-motor/src");
    let table: BTreeSet<_> =
        rows(HOUSE, "A further file is for").iter().map(|row| row[0].trim_matches('`')).collect();
    let folders = fs::read_dir(&motors).unwrap().map(|entry| entry.unwrap().path());
    let folders: Vec<_> = folders.filter(|path| path.join("signals.rs").exists()).collect();
    let names = || folders.iter().map(|path| path.file_name().unwrap().to_str().unwrap());
    assert_eq!(names().collect::<BTreeSet<_>>(), table, "the folders of the table");
    for (name, folder) in names().zip(&folders) {
        for file in ["mod.rs", "config.rs", "motor.rs"] {
            assert!(folder.join(file).exists(), "{name} has no {file}");
        }
        let wire = ["wire.rs", "wire/mod.rs"];
        assert!(wire.iter().any(|file| folder.join(file).exists()), "{name} has no wire.rs");
        for (path, text) in sources(folder) {
            let code = code(&text);
            for other in names().filter(|other| *other != name) {
                let uses = [format!("crate::{other}::"), format!("crate::{other};")];
                assert!(!uses.iter().any(|used| code.contains(used)), "{path:?} uses {other}");
            }
        }
    }
}
