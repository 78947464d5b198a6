//! The pages of `docs/control` in two languages: the same parts, code and pictures.

use std::fs;
use std::path::PathBuf;

const FAMILIES: [&str; 6] = ["pid", "profiles", "bases", "odometry", "paths", "mechanisms"];

fn docs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs")
}

fn read(path: &str) -> String {
    let path = docs().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path:?}: {error}"))
}

/// Blocks of code, with the word behind their fence.
fn blocks(page: &str) -> Vec<&str> {
    page.split("```").skip(1).step_by(2).collect()
}

/// Lines outside of code that begin with this.
fn count(page: &str, beginning: &str) -> usize {
    let prose = page.split("```").step_by(2);
    prose.flat_map(str::lines).filter(|line| line.starts_with(beginning)).count()
}

/// Where links lead; to another language of a page is the same.
fn links(page: &str) -> Vec<String> {
    let ends = page.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    ends.map(|link| link.replace(".zh-CN", "")).collect()
}

#[test]
fn both_languages_have_the_same_parts_code_and_pictures() {
    for name in FAMILIES.into_iter().chain(["README"]) {
        let english = read(&format!("control/{name}.md"));
        let chinese = read(&format!("control/{name}.zh-CN.md"));
        for beginning in ["# ", "## ", "* ", "|", "!["] {
            assert_eq!(
                count(&english, beginning),
                count(&chinese, beginning),
                "{name}: {beginning}"
            );
        }
        assert_eq!(blocks(&english), blocks(&chinese), "{name}");
        assert_eq!(links(&english), links(&chinese), "{name}");
    }
}

#[test]
fn every_page_has_its_parts() {
    let (english, chinese) = (read("control/README.md"), read("control/README.zh-CN.md"));
    for name in FAMILIES {
        assert!(english.contains(&format!("]({name}.md)")), "{name}");
        assert!(chinese.contains(&format!("]({name}.zh-CN.md)")), "{name}");
        let page = read(&format!("control/{name}.md"));
        let parts: Vec<_> = page.lines().filter(|line| line.starts_with("## ")).collect();
        let all = ["## What it is", "## When to use it", "## Units", "## Plot", "## Example"];
        assert_eq!(parts, all, "{name}");
        assert!(page.contains(&format!("](../pictures/control/{name}.svg)")), "{name}");
        let [example] = blocks(&page)[..] else { panic!("{name}: more than one example") };
        assert!(example.starts_with("rust\n"), "{name}: it is not compiled");
    }
}

#[test]
fn every_link_of_these_pages_leads_to_a_file() {
    for name in FAMILIES.into_iter().chain(["README"]) {
        for language in ["", ".zh-CN"] {
            let page = format!("control/{name}{language}.md");
            let text = read(&page);
            for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
                assert!(docs().join("control").join(link).exists(), "{page}: {link}");
            }
        }
    }
}
