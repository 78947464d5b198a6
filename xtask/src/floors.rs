//! The floors of a crate: which file imports which, by the code itself.
//!
//! A file stands one floor above the highest that it imports; the ground is floor 1. Tests are left out.
//! A name that a module hands on from another one (`pub use`) leads to that one.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemUse, UseTree, Visibility};

use crate::cargo::{paths, root};

/// The tools' crate, and the floors that it may have.
const TOOLS: &str = "tools/rc10-cli/src";
const MOST: usize = 10;

/// A module, or a name in one, from the crate's root on.
type Place = Vec<String>;

/// The parts of its own crate that a file uses.
#[derive(Default)]
struct Uses {
    module: Place,
    paths: Vec<Place>,
    /// Names that it hands on, and where they are.
    handed_on: BTreeMap<String, Place>,
    modules: BTreeSet<String>,
}

impl Uses {
    /// Takes a path of the code, if it is one of this crate.
    fn path(&mut self, path: &[String]) -> Option<Place> {
        let (first, rest) = path.split_first()?;
        let mut place = match first.as_str() {
            "crate" => Vec::new(),
            "self" => self.module.clone(),
            "super" => self.module.split_last()?.1.to_vec(),
            name if self.modules.contains(name) => [&self.module[..], &path[..1]].concat(),
            _ => return None,
        };
        for name in rest {
            match name.as_str() {
                "super" => drop(place.pop()),
                _ => place.push(name.clone()),
            }
        }
        self.paths.push(place.clone());
        Some(place)
    }

    fn tree(&mut self, before: &mut Place, tree: &UseTree, is_public: bool) {
        let (last, name) = match tree {
            UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.tree(before, &path.tree, is_public);
                before.pop();
                return;
            }
            UseTree::Group(group) => {
                return group.items.iter().for_each(|tree| self.tree(before, tree, is_public));
            }
            UseTree::Name(name) => (Some(name.ident.to_string()), name.ident.to_string()),
            UseTree::Rename(rename) => (Some(rename.ident.to_string()), rename.rename.to_string()),
            UseTree::Glob(_) => (None, String::new()),
        };
        let last = last.filter(|last| last != "self");
        let path: Place = before.iter().cloned().chain(last).collect();
        if let Some(place) = self.path(&path).filter(|_| is_public) {
            self.paths.pop();
            self.handed_on.insert(name, place);
        }
    }
}

fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|it| {
        it.path().is_ident("cfg")
            && it.parse_args::<syn::Path>().is_ok_and(|it| it.is_ident("test"))
    })
}

impl<'a> Visit<'a> for Uses {
    fn visit_item(&mut self, item: &'a Item) {
        let attributes = match item {
            Item::Mod(it) => &it.attrs,
            Item::Fn(it) => &it.attrs,
            Item::Impl(it) => &it.attrs,
            Item::Use(it) => &it.attrs,
            _ => return visit::visit_item(self, item),
        };
        if !is_test(attributes) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'a ItemUse) {
        let is_public = !matches!(item.vis, Visibility::Inherited);
        self.tree(&mut Vec::new(), &item.tree, is_public);
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        let names: Place = path.segments.iter().map(|it| it.ident.to_string()).collect();
        if names.len() > 1 {
            self.path(&names);
        }
        visit::visit_path(self, path);
    }
}

/// The files of a crate by their modules, with what they use.
fn files(source: &Path) -> Result<BTreeMap<Place, Uses>> {
    let (mut found, mut folders) = (BTreeMap::new(), vec![source.to_path_buf()]);
    while let Some(folder) = folders.pop() {
        for path in paths(&folder)? {
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            if path.extension().is_none_or(|it| it != "rs") || path.ends_with("tests.rs") {
                continue;
            }
            let within = path.strip_prefix(source)?.with_extension("");
            let mut module: Place =
                within.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            module.pop_if(|last| matches!(last.as_str(), "mod" | "lib"));
            let code = syn::parse_file(&fs::read_to_string(&path)?);
            let code = code.with_context(|| path.display().to_string())?;
            let modules = code.items.iter().filter_map(|item| match item {
                Item::Mod(it) if it.content.is_none() => Some(it.ident.to_string()),
                _ => None,
            });
            let mut uses =
                Uses { module: module.clone(), modules: modules.collect(), ..Uses::default() };
            uses.visit_file(&code);
            found.insert(module, uses);
        }
    }
    Ok(found)
}

/// The module of a place: the file in which the name is.
fn file_of(files: &BTreeMap<Place, Uses>, place: &[String]) -> Option<Place> {
    let mut place = place.to_vec();
    // A chain of names that are handed on has an end.
    for _ in 0..files.len() {
        let length =
            (0..=place.len()).rev().find(|length| files.contains_key(&place[..*length]))?;
        let (module, rest) = place.split_at(length);
        let handed = rest.first().and_then(|name| files[module].handed_on.get(name));
        match handed {
            Some(other) if other[..] != place[..=length] => {
                place = [&other[..], &rest[1..]].concat();
            }
            _ => return Some(module.to_vec()),
        }
    }
    None
}

type Arrows = BTreeMap<Place, BTreeSet<Place>>;

/// The floors of what arrows lead from and to, the ground first; what is left is in circles, or above one.
fn floors(arrows: &Arrows) -> (Vec<Vec<Place>>, Vec<Place>) {
    let (mut floors, mut placed) = (Vec::new(), BTreeSet::new());
    loop {
        let stands = |(it, uses): &(&Place, &BTreeSet<Place>)| {
            !placed.contains(*it) && uses.iter().all(|used| placed.contains(used))
        };
        let floor: Vec<Place> = arrows.iter().filter(stands).map(|(it, _)| it.clone()).collect();
        if floor.is_empty() {
            let left = arrows.keys().filter(|it| !placed.contains(*it)).cloned();
            return (floors, left.collect());
        }
        placed.extend(floor.iter().cloned());
        floors.push(floor);
    }
}

/// Prints the floors of a crate, or of the tools. Fails if files or rooms import each other in a
/// circle, or the tools have too many floors.
pub fn run(source: Option<&str>) -> Result<()> {
    let files = files(&root().join(source.unwrap_or(TOOLS)))?;
    let (mut arrows, mut rooms) = (Arrows::new(), Arrows::new());
    let room = |module: &Place| module[..module.len().min(1)].to_vec();
    for (module, uses) in &files {
        let used = uses.paths.iter().filter_map(|place| file_of(&files, place));
        let used: BTreeSet<Place> = used.filter(|used| used != module).collect();
        let others = used.iter().map(room).filter(|other| *other != room(module));
        rooms.entry(room(module)).or_default().extend(others);
        arrows.insert(module.clone(), used);
    }
    let (levels, left) = floors(&arrows);
    let (room_levels, room_left) = floors(&rooms);
    let name = |it: &Place| if it.is_empty() { "lib".to_owned() } else { it.join("::") };
    let names = |floor: &[Place]| floor.iter().map(name).collect::<Vec<_>>().join(" ");
    for (what, levels) in [("floor", &levels), ("rooms on", &room_levels)] {
        for (number, floor) in levels.iter().enumerate().rev() {
            println!("{what} {}: {}", number + 1, names(floor));
        }
    }
    let count: usize = arrows.values().map(BTreeSet::len).sum();
    println!(
        "{} files, {} floors, {count} arrows, {} rooms",
        files.len(),
        levels.len(),
        rooms.len()
    );
    ensure!(left.is_empty(), "in a circle, or above one: {}", names(&left));
    ensure!(room_left.is_empty(), "rooms in a circle, or above one: {}", names(&room_left));
    ensure!(
        source.is_some() || levels.len() <= MOST,
        "{TOOLS} has {} floors, {MOST} are allowed",
        levels.len()
    );
    Ok(())
}
