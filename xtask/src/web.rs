//! The page in a browser alone: one folder of static files, `target/web`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use object::build::elf::Builder;

use crate::cargo::{answer, host, root, run as run_command};
use crate::firmware::{DM_MC02, ON_DM_MC02, TWO_BOARDS, build_with, robots};
use crate::setup::wasm;

/// The module's target.
const TARGET: &str = "wasm32-wasip1";
/// Files that the page needs as they are.
const PAGE: &str = "tools/rc10-web/page";
/// Of the shim that gives the module a clock and files in memory (`tools/rc10-web/package.json`).
const SHIM: &str = "node_modules/@bjorn3/browser_wasi_shim";

/// Makes the folder and has Chromium look at it. Fails if it cannot be made, or something of it is
/// not as it should be.
pub fn check(rustc: Option<&Path>) -> Result<()> {
    let folder = run(rustc)?;
    let test = "test --package rc10-tool --test all -- --ignored --show-output web::";
    run_command(host(test).env("RC10_WEB", folder))
}

/// Makes the folder, and says where it is. Fails if a part of it cannot be made, or is missing.
pub fn run(rustc: Option<&Path>) -> Result<PathBuf> {
    let folder = root().join("target/web");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    for inside in ["robots", "wasi"] {
        fs::create_dir_all(folder.join(inside))?;
    }
    let boards = programs(&folder.join("robots"), rustc)?;
    page(&folder, &boards)?;
    shim(&folder.join("wasi"))?;
    wasm(TARGET)?;
    run_command(&mut host(&format!(
        "build --profile page --target {TARGET} --package rc10-web --lib"
    )))?;
    let module = root().join("target").join(TARGET).join("page/rc10_web.wasm");
    fs::copy(&module, folder.join("rc10.wasm")).with_context(|| module.display().to_string())?;
    println!("{}: serve it by any file server, such as python3 -m http.server", folder.display());
    Ok(folder)
}

/// The robots' programs, as they are flashed but without what only a debugger reads: `{"robot": ["board", ..], ..}`.
fn programs(folder: &Path, rustc: Option<&Path>) -> Result<String> {
    let mut all = Vec::new();
    // The page has one chip.
    for package in robots()?.into_iter().filter(|package| package != TWO_BOARDS) {
        let name = package.trim_end_matches("-firmware");
        let mut boards = vec!["h723zg"];
        boards.extend(Some(DM_MC02).filter(|_| ON_DM_MC02.contains(&package.as_str())));
        // A program for another board lies in the default one's place until that is built again.
        for board in boards.iter().rev() {
            let elf = build_with(&package, Some(*board), rustc)?;
            let file = fs::read(&elf)?;
            let mut program = Builder::read(&*file)?;
            let sections = program.sections.iter_mut();
            sections.filter(|it| it.name.starts_with(b".debug")).for_each(|it| it.delete = true);
            let mut stripped = Vec::new();
            program.write(&mut stripped)?;
            fs::write(folder.join(format!("{name}-{board}.elf")), stripped)?;
        }
        all.push(format!("{name:?}: {boards:?}"));
    }
    Ok(format!("{{{}}}", all.join(", ")))
}

/// The page of `rc10 live`, before which a script puts its own other end.
fn page(folder: &Path, boards: &str) -> Result<()> {
    let page = answer(&mut host("run --quiet --package rc10-web")).context("no page")?;
    let from = root().join(PAGE);
    let before = format!("const ROBOTS = {boards};\n{}", fs::read_to_string(from.join("web.js"))?);
    ensure!(page.contains("/*BEFORE*/"), "the page has no place for web.js");
    fs::write(folder.join("index.html"), page.replace("/*BEFORE*/", &before))?;
    fs::copy(from.join("worker.js"), folder.join("worker.js"))?;
    Ok(())
}

fn shim(folder: &Path) -> Result<()> {
    let place = root().join("target/web-npm");
    fs::create_dir_all(&place)?;
    for name in ["package.json", "package-lock.json"] {
        fs::copy(root().join("tools/rc10-web").join(name), place.join(name))?;
    }
    let mut npm = Command::new("npm");
    run_command(npm.args(["ci", "--no-audit", "--no-fund"]).current_dir(&place))
        .context("npm brings the module's clock and files")?;
    for name in [
        "index.js",
        "wasi.js",
        "wasi_defs.js",
        "fd.js",
        "fs_mem.js",
        "fs_opfs.js",
        "strace.js",
        "debug.js",
    ] {
        fs::copy(place.join(SHIM).join("dist").join(name), folder.join(name))?;
    }
    fs::copy(place.join(SHIM).join("LICENSE-MIT"), folder.join("LICENSE"))?;
    Ok(())
}
