//! The docs as one site, by mdBook: every page in English and in Chinese.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::cargo::{answer, root, run as run_command};

/// The parts with their titles and the chapters, in order. What is indented is below the chapter before.
const CHAPTERS: &str = include_str!("book/chapters.txt");

/// What mdBook reads beside them.
const OTHERS: [(&str, &str); 3] = [
    ("book.toml", include_str!("book/book.toml")),
    ("src/chinese.js", include_str!("book/chinese.js")),
    ("theme/head.hbs", include_str!("book/head.hbs")),
];

/// Folder, code and name of a language; a word of the page of failures, for the search.
const LANGUAGES: [[&str; 4]; 2] =
    [["en", "en", "English", "unplugged"], ["zh", "zh-CN", "中文", "卸力"]];

/// What is wrong, if this file of the book is not there, or not its part behind a `#`.
type Wanted = Vec<(String, String)>;

/// Where a page is in the book: its language, and its path without ending.
fn place(page: &str) -> (usize, String) {
    let stem = page.strip_suffix(".md").unwrap_or(page);
    let (language, stem) = stem.strip_suffix(".zh-CN").map_or((0, stem), |stem| (1, stem));
    (language, stem.replace("docs/", "").replace("README", "index"))
}

fn is_chapter(page: &str) -> bool {
    page.ends_with(".md") && CHAPTERS.lines().any(|line| place(line.trim()).1 == place(page).1)
}

/// What a page's link leads to, from the root of the tree.
fn target(page: &str, link: &str) -> Option<String> {
    let page = root().join(page);
    let file =
        if link.is_empty() { page } else { page.with_file_name(link) }.canonicalize().ok()?;
    let file = file.strip_prefix(root().canonicalize().ok()?).ok()?;
    Some(file.to_string_lossy().replace('\\', "/"))
}

/// A page's text with other links: `to` gets each one's words and address. Blocks of code stay.
fn relinked(text: &str, mut to: impl FnMut(&str, &str) -> String) -> String {
    let mut written = String::new();
    for (index, part) in text.split("```").enumerate() {
        let mut rest = part;
        written += if index == 0 { "" } else { "```" };
        while let Some((before, after)) = rest.split_once("](").filter(|_| index % 2 == 0) {
            let (before, words) = before.rsplit_once('[').unwrap_or(("", before));
            let (link, after) = after.split_once(')').unwrap_or((after, ""));
            written += before;
            written += &to(words, link);
            rest = after;
        }
        written += rest;
    }
    written
}

/// A page as mdBook reads it: with a link to its twin at its top, in place of its own.
fn written(page: &str, text: &str, wanted: &mut Wanted) -> String {
    let (language, path) = place(page);
    let up = "../".repeat(path.matches('/').count() + 1);
    let [folder, _, name, _] = LANGUAGES[1 - language];
    let mut lines = text.lines().filter(|line| !line.starts_with(&format!("[{name}](")));
    let title = lines.next().unwrap_or_default();
    let mut top = format!("[{name}]({up}{folder}/{path}.html)");
    if path == "browser" && root().join("target/web/index.html").exists() {
        top += &format!(" · [**{}**]({up}drive/index.html)", title.trim_start_matches("# "));
    }
    let rest = relinked(&lines.collect::<Vec<_>>().join("\n"), |words, link| {
        if link.contains("://") {
            return format!("[{words}]({link})");
        }
        let file = link.split('#').next().unwrap_or_default();
        let target = target(page, file).unwrap_or_default();
        let (its_language, its_path) = place(&target);
        if target.is_empty() || is_chapter(&target) {
            let part = link.trim_start_matches(file);
            let html = format!("{}/{its_path}.html{part}", LANGUAGES[its_language][0]);
            if its_language != language && its_path != path && !target.is_empty() {
                wanted.push((format!("{page}: {link} is of the other language"), String::new()));
            }
            wanted.push((format!("{page}: {link} leads nowhere"), html.clone()));
            return format!("[{words}]({up}{html})");
        }
        if target.starts_with("docs/pictures/") {
            return format!("[{words}]({up}{its_path})");
        }
        let manifest = include_str!("../../Cargo.toml").split_once("\nrepository = \"");
        match manifest.and_then(|(_, address)| address.split('"').next()) {
            Some(address) => format!("[{words}]({address}/blob/main/{target})"),
            None if target.ends_with(words.trim_matches('`')) => format!("`{target}`"),
            None => format!("{words} (`{target}`)"),
        }
    });
    format!("{title}\n\n{top}\n{rest}\n")
}

/// All pages, from the root of the tree.
fn pages() -> Result<String> {
    let mut git = Command::new("git");
    git.args(["ls-files", "--cached", "--others", "--exclude-standard", "*.md"]);
    answer(git.current_dir(root())).context("git does not list the pages")
}

fn write(file: &Path, text: &str) -> Result<()> {
    fs::create_dir_all(file.parent().context("a file without a folder")?)?;
    fs::write(file, text).with_context(|| file.display().to_string())
}

/// Writes a language's chapters, and mdBook's list of them.
fn write_sources(language: usize, folder: &Path, wanted: &mut Wanted) -> Result<()> {
    let mut summary = "# Summary\n".to_owned();
    for line in CHAPTERS.lines().filter(|line| !line.is_empty()) {
        if let Some((english, chinese)) = line.trim_start_matches("# ").split_once(" | ") {
            summary += &format!("\n# {}\n\n", [english, chinese][language]);
            continue;
        }
        let english = line.trim_start();
        let page = english.replace(".md", [".md", ".zh-CN.md"][language]);
        let file = format!("{}.md", place(&page).1);
        match fs::read_to_string(root().join(&page)) {
            Ok(text) => {
                let title = text.lines().next().unwrap_or_default().trim_start_matches("# ");
                summary += &line.replace(english, &format!("- [{title}]({file})\n"));
                write(&folder.join("src").join(file), &written(&page, &text, wanted))?;
            }
            Err(_) => wanted.push((format!("{page} is missing"), String::new())),
        }
    }
    write(&folder.join("src/SUMMARY.md"), &summary)?;
    OTHERS.iter().try_for_each(|(name, text)| write(&folder.join(name), text))
}

/// Makes `target/book` by mdBook. Fails if a page is in no chapter or lacks its twin, a link leads
/// nowhere, or a search does not find.
pub fn run(mdbook: &Path) -> Result<()> {
    let book = root().join("target/book");
    let mut wanted = Vec::new();
    for page in pages()?.lines().filter(|page| page.starts_with("docs/") && !is_chapter(page)) {
        wanted.push((format!("{page} is in no chapter"), String::new()));
    }
    for (index, [folder, code, ..]) in LANGUAGES.iter().enumerate() {
        let sources = root().join("target/book-sources").join(folder);
        write_sources(index, &sources, &mut wanted)?;
        let mut build = Command::new(mdbook);
        build.arg("build").arg(sources).arg("--dest-dir").arg(book.join(folder));
        run_command(build.env("MDBOOK_BOOK__LANGUAGE", code))?;
    }
    write(&book.join("index.html"), include_str!("book/index.html"))?;
    for (from, to) in [("docs/pictures/.", "pictures"), ("target/web/.", "drive")] {
        if root().join(from).exists() {
            run_command(Command::new("cp").arg("-r").arg(root().join(from)).arg(book.join(to)))?;
        }
    }
    wanted.sort_unstable();
    let is_wrong = |(_, wanted): &&(String, String)| {
        let (file, part) = wanted.split_once('#').unwrap_or((wanted, ""));
        let html = fs::read_to_string(book.join(file)).unwrap_or_default();
        html.is_empty() || !part.is_empty() && !html.contains(&format!("id=\"{part}\""))
    };
    let wrong: Vec<_> = wanted.iter().filter(is_wrong).map(|(what, _)| what.as_str()).collect();
    ensure!(wrong.is_empty(), "{} in the book:\n{}", wrong.len(), wrong.join("\n"));
    for [folder, _, _, word] in LANGUAGES {
        let page = format!("file://{}/{folder}/index.html?search={word}", book.display());
        let mut chromium = Command::new("chromium");
        chromium.args(["--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", &page]);
        match answer(chromium.arg("--virtual-time-budget=10000")) {
            Some(shown) => {
                let is_found = shown.contains("href=\"failures.html?highlight=");
                ensure!(is_found, "{page} does not find the page of failures");
            }
            None => {
                let is_there = answer(Command::new("chromium").arg("--version")).is_some();
                ensure!(!is_there, "{page}: Chromium does not show it");
                println!("no browser here: the search is not tested");
            }
        }
    }
    println!("{}: {} links between its pages", book.join("index.html").display(), wanted.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A heading as the address of its part.
    fn anchor(heading: &str) -> String {
        let text = heading.trim_start_matches('#').trim().to_lowercase().replace(' ', "-");
        text.chars().filter(|it| it.is_alphanumeric() || ['-', '_'].contains(it)).collect()
    }

    #[test]
    fn every_link_of_every_page_leads_to_a_file_and_to_a_part_of_it() {
        let mut checked = 0;
        for page in pages().unwrap().lines() {
            let text = fs::read_to_string(root().join(page)).unwrap();
            let same = relinked(&text, |words, link| {
                let (file, part) = link.split_once('#').unwrap_or((link, ""));
                if link.contains("://") {
                    return format!("[{words}]({link})");
                }
                let to = target(page, file).unwrap_or_else(|| panic!("{page}: {link}"));
                if !part.is_empty() {
                    let text = fs::read_to_string(root().join(&to)).unwrap();
                    let mut prose = text.split("```").step_by(2).flat_map(str::lines);
                    let is_there = prose.any(|line| line.starts_with('#') && anchor(line) == part);
                    assert!(is_there, "{page}: {link}");
                }
                checked += 1;
                format!("[{words}]({link})")
            });
            assert_eq!(same, text, "{page} with its own links");
        }
        assert!(checked > 300, "{checked}");
    }
}
