//! `docs/modules`: every parser has a line in the index, each line a page, and each page what a page
//! must have; the example in it is the one that is tested.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The lines of the index: module, wire, parser, driver, states.
fn index() -> Vec<[String; 5]> {
    let page = read("docs/modules/README.md");
    let table = page.lines().filter(|line| line.starts_with("| ["));
    let cells =
        |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().into()).collect();
    table.map(|line| <Vec<String> as TryInto<_>>::try_into(cells(line)).unwrap()).collect()
}

/// The page that a line of the index is about.
fn page(line: &[String; 5]) -> &str {
    line[0].split_once("](").unwrap().1.trim_end_matches(')')
}

/// All sources of a folder.
fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else {
            let text = fs::read_to_string(&path).unwrap();
            found.push((path, text));
        }
    }
    found
}

#[test]
fn every_parser_has_a_line_in_the_index() {
    let index = index();
    let parsers: BTreeSet<&str> = index.iter().map(|line| line[2].trim_matches('`')).collect();
    let mut found = 0;
    for (path, text) in sources(&root().join("crates/rc10-module/src")) {
        // Declarations stand at the beginning of a line; examples and tests do not.
        for parser in text.lines().filter_map(|line| line.strip_prefix("impl Protocol for ")) {
            let parser = parser.trim_end_matches(" {");
            assert!(parsers.contains(parser), "{parser} of {} is not in the index", path.display());
            found += 1;
        }
    }
    assert!(found >= 9, "{found} parsers");
    // Those that are no `Protocol`.
    let others = ["Ppm", "Bmi088", "ws2812::Strip", "IncrementalEncoder", "LimitSwitch", "Servo"];
    assert_eq!(parsers.len(), found + others.len(), "{parsers:?}");
    for other in others {
        assert!(parsers.contains(other), "{other} is not in the index");
    }
}

#[test]
fn every_page_is_in_the_index() {
    let index = index();
    let linked: BTreeSet<&str> = index.iter().map(page).collect();
    assert_eq!(linked.len(), index.len(), "two modules on one page");
    for file in fs::read_dir(root().join("docs/modules")).unwrap() {
        let name = file.unwrap().file_name().into_string().unwrap().replace(".zh-CN.md", ".md");
        let is_about_many = ["README.md", "ranging.md"].contains(&name.as_str());
        assert!(is_about_many || linked.contains(name.as_str()), "{name} is not in the index");
    }
}

#[test]
fn every_page_says_how_to_wire_it_what_is_on_the_wire_and_who_says_so() {
    let wiring = read("docs/wiring.md");
    let sources = ["Source: ", "Sources: ", "## Source\n"];
    for line in index() {
        let name = page(&line);
        let text = read(&format!("docs/modules/{name}"));
        assert!(text.contains("\n## Wiring"), "{name} has no wiring");
        let part = text
            .split_once("Pins of our board: part `")
            .unwrap_or_else(|| panic!("{name}: no part"));
        let (part, rest) = part.1.split_once('`').unwrap();
        assert!(
            rest.starts_with(" of [wiring.md](../wiring.md)."),
            "{name} has no link to the pins"
        );
        assert!(wiring.contains(&format!("| `{part}` |")), "{name}: wiring.md has no part {part}");
        assert!(sources.iter().any(|word| text.contains(word)), "{name} has no source");
        assert!(text.contains("`rc10_module::"), "{name} does not say where its code is");
        let has_frame = text.contains("\n## Frame");
        let is_on_a_wire = line[1].contains("bytes") || line[1].contains("pulses");
        assert!(has_frame || !is_on_a_wire, "{name} has no frame");
    }
}

#[test]
fn the_example_of_the_index_is_the_one_that_is_tested() {
    let flat = |code: &str| {
        code.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n")
    };
    let streams = "crates/rc10-module/tests/streams";
    let tested = ["example.rs", "wires/wren.rs", "main.rs"]
        .map(|file| flat(&read(&format!("{streams}/{file}"))));
    let page = read("docs/modules/README.md");
    let blocks: Vec<_> =
        page.split("```rust\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert!(blocks.len() >= 4, "{}", blocks.len());
    for block in blocks {
        assert!(tested.iter().any(|code| code.contains(&flat(block))), "not tested:\n{block}");
    }
}
