//! Builds the firmware of a robot for its run on the emulated chip.

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};
use rc10_emu::Board;

/// Builds the firmware in the folder `firmware` of a robot's own repository, for a board or for its
/// own; returns the path of the ELF file: of several the one whose name ends with that of the robot's board. Fails if there
/// is no program, or the build does.
pub fn build_firmware_in(repository: &str, board: &str, wanted: Wanted) -> Result<PathBuf> {
    let folder = Path::new(repository).join("firmware");
    let place = folder.display();
    ensure!(folder.is_dir(), "there is no {place} to build: say which ELF file to run");
    // Shipped robots have their settings in one place.
    let shared = format!("{repository}/../../firmware/.cargo/config.toml");
    let has_own = folder.join(".cargo").is_dir() || !Path::new(&shared).is_file();
    let settings: &[&str] = if has_own { &[] } else { &["--config", &shared] };
    let build = ["build", "--release", "--message-format=json-render-diagnostics"];
    let of_board = wanted.board.map(|board| ["--no-default-features", "--features", board.name]);
    let records = wanted.black_box.then_some(["--features", "rc10-board/black-box"]);
    let features = of_board.into_iter().flatten().chain(records.into_iter().flatten());
    let args = settings.iter().copied().chain(build).chain(features);
    let output = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(args)
        .current_dir(&folder)
        .stderr(Stdio::inherit())
        .output()
        .context("cannot start cargo to build the firmware")?;
    if !output.status.success() {
        ensure!(has_target(&folder), "the chip's target is missing: rustup target add {TARGET}");
        bail!("the firmware was not built: the error above says why");
    }
    let messages = String::from_utf8_lossy(&output.stdout);
    let messages =
        messages.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
    let programs = messages.filter_map(|it| Some(PathBuf::from(it["executable"].as_str()?)));
    let board = board.to_lowercase();
    let mut programs = programs.filter(|path| path.to_string_lossy().ends_with(&board));
    programs.next_back().with_context(|| format!("{place} has no program {board}"))
}

/// The firmware that is to be built.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted {
    /// For this board, if not for its own.
    pub board: Option<Board>,
    /// Whether it has a black box.
    pub black_box: bool,
}

const TARGET: &str = "thumbv7em-none-eabihf";

/// Whether the compiler of a folder has the chip's target, or does not say.
fn has_target(folder: &Path) -> bool {
    let ask = Command::new("rustc")
        .args(["--print", "target-libdir", "--target", TARGET])
        .current_dir(folder)
        .output();
    ask.map_or(true, |told| Path::new(String::from_utf8_lossy(&told.stdout).trim()).is_dir())
}
