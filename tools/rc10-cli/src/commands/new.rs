//! `rc10 new`: copies `examples/starter` of the checkout that this program was built from into a
//! folder of its own, under another name. So the new robot has been compiled and tested there.

use std::collections::BTreeSet;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use rc10_emu::Board;

use crate::files::Unfinished;
use crate::run::board;

/// Arguments of `rc10 new`.
#[derive(Args, Debug)]
pub struct NewArgs {
    /// Name of the robot, and of the folder that is made here: small letters, digits and hyphens
    pub name: String,
    /// The board that its firmware is for: h723zg or dm-mc02
    #[arg(long, value_name = "NAME", default_value = "h723zg", value_parser = board::named)]
    pub board: Board,
    /// RC10 from this repository, and not from the checkout that this program was built from
    #[arg(long, value_name = "URL", requires = "rev")]
    pub git: Option<String>,
    /// The commit of it
    #[arg(long, value_name = "COMMIT", requires = "git")]
    pub rev: Option<String>,
}

/// Files that are copied unchanged, but for the name.
const FILES: [&str; 9] = [
    "README.md",
    "src/lib.rs",
    "src/main.rs",
    "src/simulation.rs",
    "src/table.rs",
    "src/task.rs",
    "tests/drive.rs",
    "firmware/src/main.rs",
    "firmware/.cargo/config.toml",
];

/// Rust keywords, crates that are always there, and names that cargo or Windows reserves.
const RESERVED: &str = "abstract alloc as async aux await become box break build con const continue core crate \
    deps do dyn else enum examples extern false final fn for gen if impl in incremental let loop macro match mod \
    move mut nul override prn priv pub ref return self simulation static std struct super test trait true try \
    type typeof unsafe use where while";

/// Makes the folder, whole or not at all. Fails if the name is invalid, the folder exists or cannot
/// be written, or the checkout is gone.
pub fn new(args: &NewArgs, out: &mut dyn Write) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap_or(Path::new("."));
    ensure!(
        root.join("examples/starter").is_dir(),
        "the checkout that this rc10 was built from is gone: {}",
        root.display()
    );
    let here = std::env::current_dir().and_then(|here| here.canonicalize());
    let here = here.with_context(|| format!("cannot write the folder {} here", args.name))?;
    // Cargo would join the settings of both, and nothing would link.
    let is_inside = root.canonicalize().is_ok_and(|root| here.starts_with(root));
    ensure!(!is_inside, "here is inside RC10's checkout: make your robot beside it, such as in ..");
    let (git, board) = (args.git.clone().zip(args.rev.clone()), args.board);
    let checkout = Checkout { root: root.to_owned(), git, board };
    let name = args.name.as_str();
    let locked = checkout.read("Cargo.lock")?;
    check_name(name, &locked)?;
    let place = PathBuf::from(name);
    let is_there = fs::symlink_metadata(&place).is_ok();
    ensure!(!is_there, "{name}: there is such a file or folder already");
    let files = checkout.files(name)?;

    let beside = Unfinished(PathBuf::from(format!(".{name}.rc10-new")));
    let cannot = || format!("cannot write the folder {name} here");
    match fs::create_dir(&beside.0) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            fs::remove_dir_all(&beside.0).with_context(cannot)?;
        }
        Err(error) => return Err(error).with_context(cannot),
        Ok(()) => {}
    }
    for (file, text) in files {
        let path = beside.0.join(file);
        let folder = path.parent().unwrap_or(&beside.0);
        fs::create_dir_all(folder).with_context(cannot)?;
        fs::write(&path, text).with_context(cannot)?;
    }
    beside.put(&place).with_context(cannot)?;
    writeln!(
        out,
        "{name}  a robot on four mecanum wheels with a feeder, for the board {} with an {}; next:\n  \
         cd {name}\n  \
         cargo run               ten seconds in the simulator, and its report\n  \
         cargo test              the robot does what hands tell it\n  \
         cargo run -- emu        the firmware itself, on the emulated chip\n  \
         src/table.rs            what it has: a line for each motor\n  \
         src/task.rs             what it does",
        args.board.name, args.board.chip
    )?;
    Ok(())
}

fn check_name(name: &str, locked: &str) -> Result<()> {
    let is_word = name.starts_with(|first: char| first.is_ascii_lowercase())
        && name.bytes().all(|it| matches!(it, b'a'..=b'z' | b'0'..=b'9' | b'-'))
        && !name.ends_with('-')
        && !name.contains("--");
    ensure!(
        !name.contains(['/', '\\']),
        "`{name}` is a path: the robot's name alone, made in this folder"
    );
    ensure!(
        is_word && name.len() <= 40,
        "`{name}` is no name for a robot: small letters, digits and single hyphens, a letter first, at most 40"
    );
    let is_reserved = RESERVED.split_whitespace().any(|word| word == name);
    ensure!(!is_reserved, "`{name}` means something else to Rust or its tools: another name");
    for package in [name.to_owned(), format!("{name}-firmware")] {
        let is_taken = locked.contains(&format!("\nname = \"{package}\"\n"));
        ensure!(!is_taken, "`{name}`: there is a package {package} that robots use: another name");
    }
    Ok(())
}

/// The checkout that new robots depend on.
struct Checkout {
    root: PathBuf,
    git: Option<(String, String)>,
    board: Board,
}

impl Checkout {
    fn read(&self, file: &str) -> Result<String> {
        let path = self.root.join(file);
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
    }

    fn files(&self, name: &str) -> Result<Vec<(String, String)>> {
        let word = name.replace('-', "_");
        let renamed = |file: &str, text: &str| {
            text.replace("starter", if file.ends_with(".rs") { &word } else { name })
        };
        let mut files = Vec::new();
        for file in FILES {
            let text = self.read(&format!("examples/starter/{file}"))?;
            files.push((file.to_owned(), renamed(file, &text)));
        }
        let robot = self.read("examples/starter/Cargo.toml")?;
        let firmware = self.read("examples/starter/firmware/Cargo.toml")?;
        // In the checkout it is a member of the workspace of all programs for the chip.
        let mut own: Vec<_> = firmware.lines().collect();
        own.retain(|line| ["workspace = \"", "#"].iter().all(|it| !line.starts_with(it)));
        let own = own.join("\n") + "\n";
        let default = format!("default = [{:?}]", self.board.name);
        let own = replaced(&own, "default = [\"h723zg\"]", &default)?;

        let heading = self.workspace("Cargo.toml", "", &[&robot])?;
        let head = "[workspace]\n# It has another target, and another set of features.\n\
                    exclude = [\"firmware\"]\nresolver = \"3\"\n\n";
        let manifest = renamed("Cargo.toml", &(head.to_owned() + &heading + &robot));
        files.push(("Cargo.toml".into(), manifest));
        let heading = self.workspace("firmware/Cargo.toml", "firmware", &[&firmware])?;
        let head = "[workspace]\nresolver = \"3\"\n\n";
        let manifest = renamed("Cargo.toml", &(head.to_owned() + &heading + &own));
        files.push(("firmware/Cargo.toml".into(), manifest));
        for file in ["Cargo.lock", "firmware/Cargo.lock", "rust-toolchain.toml"] {
            files.push((file.into(), self.read(file)?));
        }
        let config = self.read(".cargo/config.toml")?;
        let config = sections(&config).into_iter().filter(|(name, _)| *name != "alias");
        let config: String = config.map(|(_, text)| text).collect();
        let chip = |board: Board| format!("--chip {}Tx ", board.chip);
        let mut config = replaced(&config, &chip(Board::default()), &chip(self.board))?;
        if self.git.is_none() {
            // With its lock files the crates of others are the same ones.
            let (line, place) = ("target-dir = \"target\"\n", self.root.join("target"));
            let shared = format!(
                "{line}# What the checkout has compiled of others need not be compiled again.\n\
                 build-dir = {:?}\n",
                place.display().to_string()
            );
            config = replaced(&config, line, &shared)?;
        }
        files.push((".cargo/config.toml".into(), config));
        files.push((".gitignore".into(), "target/\n".into()));
        Ok(files)
    }

    /// The head of a workspace's manifest, with the dependencies that the members use.
    fn workspace(&self, manifest: &str, folder: &str, members: &[&str]) -> Result<String> {
        let text = self.read(manifest)?;
        let used: BTreeSet<&str> = members
            .iter()
            .flat_map(|member| member.lines())
            .filter(|line| line.contains("workspace = true"))
            .filter_map(|line| line.split(['.', ' ']).next())
            .collect();
        let mut head = String::new();
        for (name, text) in sections(&text) {
            if name == "workspace.dependencies" {
                head += "[workspace.dependencies]\n";
                for line in text.lines() {
                    let Some((package, rest)) = line.split_once(" = ") else { continue };
                    if used.contains(package) {
                        head += &format!("{package} = {}\n", self.pointed(rest, folder)?);
                    }
                }
                head.push('\n');
            } else if let Some(package) =
                name.strip_prefix("profile.").and_then(|name| name.split_once(".package."))
            {
                // Not of this checkout's programs and tests.
                if !["count", "interop", "proptest", "rsemu", "selftest"].contains(&package.1) {
                    head += text;
                }
            } else if name == "workspace.package"
                || name.starts_with("workspace.lints.")
                || name.starts_with("profile.")
            {
                head += text;
            }
        }
        Ok(head.trim_end().to_owned() + "\n\n")
    }

    /// A dependency's line, with its path as seen from another folder.
    fn pointed(&self, rest: &str, folder: &str) -> Result<String> {
        let Some((before, after)) = rest.split_once("path = \"") else {
            return Ok(rest.to_owned());
        };
        let Some((path, after)) = after.split_once('"') else { bail!("not understood: {rest}") };
        let place = match &self.git {
            Some((url, rev)) => format!("git = {url:?}, rev = {rev:?}"),
            None => {
                let place = match path.strip_prefix("../") {
                    Some(path) => self.root.join(path),
                    None => self.root.join(folder).join(path),
                };
                format!("path = {:?}", place.display().to_string())
            }
        };
        Ok(format!("{before}{place}{after}"))
    }
}

/// Replaces a word that must stand exactly once in a text.
fn replaced(text: &str, word: &str, other: &str) -> Result<String> {
    ensure!(text.matches(word).count() == 1, "not understood: where is {word}?");
    Ok(text.replace(word, other))
}

/// The sections of a TOML file, each with the comments before it.
fn sections(text: &str) -> Vec<(&str, &str)> {
    let mut begins = Vec::new();
    let (mut at, mut comment) = (0, None);
    for line in text.split_inclusive('\n') {
        if let Some(name) = line.strip_prefix('[').and_then(|line| line.split(']').next()) {
            begins.push((comment.take().unwrap_or(at), name));
        } else if line.starts_with('#') {
            comment.get_or_insert(at);
        } else {
            comment = None;
        }
        at += line.len();
    }
    let ends = begins.iter().skip(1).map(|(begin, _)| *begin).chain([text.len()]);
    begins.iter().zip(ends).map(|((begin, name), end)| (*name, &text[*begin..end])).collect()
}
