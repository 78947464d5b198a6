//! What the tree depends on: licences, sources and names, as deny.toml has them. It is what cargo-deny does,
//! but for advisories: to compile that takes minutes.

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::cargo::{answer, host, root};

/// A licence for a PC's tools.
const OF_PC: &str = "MPL-2.0";

/// Looks at every package of every workspace. Fails if one is not as it has to be, or a lock file
/// is stale.
pub fn run() -> Result<()> {
    let text = fs::read_to_string(root().join("deny.toml"))?;
    let list = text.split_once("\nallow = [").and_then(|(_, rest)| rest.split_once(']'));
    let (list, _) = list.context("deny.toml has no allowed licences")?;
    let allowed: Vec<&str> = list.split('"').skip(1).step_by(2).collect();
    // Each workspace has one.
    let mut locks = Command::new("git");
    let locks = answer(locks.args(["ls-files", "*Cargo.lock"]).current_dir(root()));
    for lock in locks.context("git does not list the lock files")?.lines() {
        let mut tree = host("tree --workspace --all-features --target all --prefix none");
        tree.args(["--format", "{p}|{l}"]).current_dir(root().join(lock).with_file_name(""));
        let tree = answer(&mut tree).with_context(|| format!("{lock}: is it stale?"))?;
        let is_of_pc = tree.contains("rc10-cli v");
        let allowed = allowed.iter().copied().filter(|it| is_of_pc || *it != OF_PC).collect();
        let count = look(&tree, &allowed).with_context(|| lock.to_owned())?;
        println!("{lock}: {count} packages of others");
    }
    Ok(())
}

/// The number of packages of others in the output of `cargo tree`.
fn look(tree: &str, allowed: &BTreeSet<&str>) -> Result<usize> {
    let lines: BTreeSet<&str> = tree.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    let (mut own, mut others) = (BTreeSet::new(), BTreeSet::new());
    for line in lines.into_iter().filter(|line| !line.is_empty()) {
        let (package, license) = line.split_once('|').context("cargo tree")?;
        let mut words = package.split(' ').filter(|word| *word != "(proc-macro)");
        let (name, _, from) = (words.next().unwrap_or_default(), words.next(), words.next());
        // What is of crates.io has nothing there.
        let Some(from) = from else {
            ensure!(is_allowed(license, allowed), "{package} has the license `{license}`");
            others.insert(package);
            continue;
        };
        ensure!(
            from.starts_with("(/") || from.get(2..3) == Some(":"),
            "{package}: not of crates.io"
        );
        own.insert(name);
    }
    let double = others.iter().find(|it| own.contains(it.split(' ').next().unwrap_or_default()));
    ensure!(double.is_none(), "{double:?} is called as one of the project's own");
    Ok(others.len())
}

/// Whether one can keep to a licence: at least one of those between each two ANDs is allowed.
fn is_allowed(license: &str, allowed: &BTreeSet<&str>) -> bool {
    let is_one = |part: &str| {
        let part = part.trim_matches(['(', ')']).replace(" OR ", "/");
        part.split('/').any(|one| allowed.contains(one.trim()))
    };
    license.split(" AND ").all(is_one)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_allowed_is_named() {
        let allowed = BTreeSet::from(["MIT", "Apache-2.0", "Unicode-3.0"]);
        let look = |tree: &str| look(tree, &allowed).map_err(|error| error.to_string());
        let good = "rc10 v0.1.0 (/tree)|MIT\n\na v1.0.0|MIT/GPL-3.0\na v1.0.0|MIT/GPL-3.0 (*)\n\
                    b v2.0.0 (proc-macro)|(MIT OR Apache-2.0) AND Unicode-3.0\n";
        assert_eq!(look(good), Ok(2));
        let bad = |line: &str, why: &str| {
            let said = look(&format!("{good}{line}")).unwrap_err();
            assert!(said.contains(why), "{said}");
        };
        bad("c v1.0.0|GPL-3.0", "c v1.0.0 has the license `GPL-3.0`");
        bad("c v1.0.0|MIT AND GPL-3.0", "has the license");
        bad("c v1.0.0|", "has the license");
        bad("c v1.0.0 (https://example.org/c#0123)|MIT", "not of crates.io");
        bad("c v1.0.0 (registry `other`)|MIT", "not of crates.io");
        bad("rc10 v9.0.0|MIT", "one of the project's own");
    }
}
