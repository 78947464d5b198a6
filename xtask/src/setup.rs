//! Making a machine able to build for the chip.
//!
//! A `targets` line in rust-toolchain.toml is not enough: with `RUSTUP_AUTO_INSTALL=0` it installs
//! nothing. So the target is asked for explicitly; and where rustup or its server is not there, a
//! Debian machine can build the two libraries that the target needs from Debian's own packages.
//!
//! The tests against programs of others need a Python that can make virtual environments.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::cargo::{answer, free, paths, root, run};

/// The chip's target.
pub const TARGET: &str = "thumbv7em-none-eabihf";

const DEBIAN_RUSTC: &str = "/usr/bin/rustc";

/// The compiler to build for the chip with: `None` is the active toolchain's. Installs what is
/// missing.
pub fn chip_toolchain() -> Result<Option<PathBuf>> {
    if has_target(Path::new("rustc")) {
        println!("setup: the active toolchain builds for {TARGET}");
        return Ok(None);
    }
    println!("setup: the active toolchain has no {TARGET}; asking rustup for it");
    match run(Command::new("rustup").args(["target", "add", TARGET])) {
        Ok(()) if has_target(Path::new("rustc")) => return Ok(None),
        Ok(()) => println!("setup: rustup added it to another toolchain than the active one"),
        Err(error) => println!("setup: {error:#}"),
    }
    let rustc = PathBuf::from(DEBIAN_RUSTC);
    if !has_target(&rustc) {
        println!("setup: making {TARGET} from Debian's packages");
        from_debian(&rustc).context("neither rustup nor Debian could provide the chip's target")?;
    }
    println!("setup: building for the chip with RUSTC={DEBIAN_RUSTC}");
    Ok(Some(rustc))
}

/// Makes sure that there is a target for a web page.
pub fn wasm(target: &str) -> Result<()> {
    run(Command::new("rustup").args(["target", "add", target]))
}

/// Makes sure that `cargo fmt` or `cargo clippy` is there.
pub fn component(name: &str) -> bool {
    let there = || answer(Command::new("cargo").args([name, "--version"])).is_some();
    // The component of `cargo fmt` is called rustfmt.
    let component = if name == "fmt" { "rustfmt" } else { name };
    there() || run(Command::new("rustup").args(["component", "add", component])).is_ok() && there()
}

/// Makes sure that `python3` can make a virtual environment; Debian packs that apart.
pub fn python() -> Result<()> {
    let can_make_environments =
        || answer(Command::new("python3").args(["-c", "import venv, ensurepip"])).is_some();
    if !can_make_environments() {
        println!("setup: no python3 that can make virtual environments; asking Debian for one");
        install(&["python3", "python3-venv"])
            .context("install Python 3.10 or newer, with venv and ensurepip")?;
    }
    ensure!(can_make_environments(), "python3 cannot make virtual environments");
    println!("setup: python3 makes virtual environments");
    Ok(())
}

/// Makes sure that there is a browser and its driver, for the tests of the page and the report.
pub fn browser() -> Result<()> {
    let programs = ["chromium", "chromedriver"];
    let are_there =
        || programs.iter().all(|it| answer(Command::new(it).arg("--version")).is_some());
    if !are_there() {
        println!("setup: no chromium and chromedriver; asking Debian for them");
        install(&["chromium", "chromium-driver"]).context("install Chromium and its driver")?;
    }
    ensure!(are_there(), "chromium and chromedriver do not run");
    println!("setup: a browser for the tests of the page");
    Ok(())
}

/// The program that makes the book, in the target folder. To compile it takes 90 CPU seconds, once.
pub fn mdbook() -> Result<PathBuf> {
    let folder = root().join("target/mdbook");
    let mut install = free("install --quiet --locked --debug mdbook --version 0.5.4");
    // Without what serves and watches.
    install.args(["--no-default-features", "--features", "search", "--root"]).arg(&folder);
    run(install.env("CARGO_PROFILE_DEV_DEBUG", "0"))?;
    Ok(folder.join("bin/mdbook"))
}

/// The first probe-rs whose `run` knows the flags that `.cargo/config.toml` gives it (its change log,
/// 0.28.0): major and minor version.
const PROBE_RS: [u32; 2] = [0, 28];

/// Says whether a board can be flashed from here. Never fails: a board is not required.
pub fn probe() {
    let version = answer(Command::new("probe-rs").arg("--version"));
    println!("setup: {}", judge_probe_rs(version.as_deref()));
}

/// The message for an answer to `probe-rs --version`.
fn judge_probe_rs(version: Option<&str>) -> String {
    let [major, minor] = PROBE_RS;
    let wanted = format!("to flash a board, install probe-rs {major}.{minor} or newer");
    let Some(version) = version else { return format!("no probe-rs here; {wanted}") };
    // `probe-rs 0.29.1 (git commit: ..)`
    let number = version.split_whitespace().nth(1).unwrap_or_default();
    let mut parts = number.split('.').map_while(|part| part.parse::<u32>().ok());
    match (parts.next(), parts.next()) {
        (Some(major), Some(minor)) if [major, minor] >= PROBE_RS => {
            format!("probe-rs {number} flashes a board")
        }
        (Some(_), Some(_)) => format!("probe-rs {number} is too old; {wanted}"),
        _ => format!("probe-rs says {version:?}, which is no version; {wanted}"),
    }
}

/// Debian's packages, of its newest list.
fn install(packages: &[&str]) -> Result<()> {
    run(Command::new("apt-get").args(["update", "--quiet"]))?;
    let mut apt = Command::new("apt-get");
    apt.args(["install", "--quiet", "--yes", "--no-install-recommends"])
        .args(packages)
        .env("DEBIAN_FRONTEND", "noninteractive");
    run(&mut apt)
}

fn has_target(rustc: &Path) -> bool {
    let question = ["--print", "target-libdir", "--target", TARGET];
    let Some(folder) = answer(Command::new(rustc).args(question)) else {
        return false;
    };
    // The folder's name is answered whether it exists or not.
    paths(Path::new(&folder)).is_ok_and(|found| found.iter().any(|path| is_library(path, "core")))
}

fn is_library(path: &Path, name: &str) -> bool {
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    file.starts_with(&format!("lib{name}-")) && file.ends_with(".rlib")
}

/// Debian has the compiler and the library's source, but not the library for this target: build
/// it once, into the compiler's own sysroot.
fn from_debian(rustc: &Path) -> Result<()> {
    install(&["rustc-web", "rust-web-src"])?;
    let sysroot = answer(Command::new(rustc).args(["--print", "sysroot"]))
        .context("Debian's rustc does not run")?;
    let targets = Path::new(&sysroot).join("lib/rustlib");

    // An empty crate that needs `core` and `alloc` makes cargo build them.
    let work = root().join("target/chip-sysroot");
    fs::create_dir_all(work.join("src"))?;
    fs::write(
        work.join("Cargo.toml"),
        "[package]\nname = \"chip-sysroot\"\nversion = \"0.0.0\"\nedition = \"2021\"\n[workspace]\n",
    )?;
    fs::write(work.join("src/lib.rs"), "#![no_std]\nextern crate alloc;\n")?;
    let build = [
        "build",
        "--release",
        "--target",
        TARGET,
        "-Zbuild-std=core,alloc,compiler_builtins",
        "-Zbuild-std-features=compiler-builtins-mem",
    ];
    run(Command::new("cargo")
        .args(build)
        .current_dir(&work)
        .env("RUSTC", rustc)
        // -Z needs a nightly compiler, or this.
        .env("RUSTC_BOOTSTRAP", "1")
        // Without bitcode in the libraries, link-time optimisation over them fails.
        .env("RUSTFLAGS", "-Cembed-bitcode=yes")
        .env("CARGO_TARGET_DIR", work.join("target")))?;

    let built = work.join("target").join(TARGET).join("release/deps");
    let destination = targets.join(TARGET).join("lib");
    fs::create_dir_all(&destination).with_context(|| format!("{}", destination.display()))?;
    for path in paths(&built)? {
        let wanted = ["core", "alloc", "compiler_builtins"];
        if wanted.iter().any(|name| is_library(&path, name)) {
            fs::copy(&path, destination.join(path.file_name().unwrap_or_default()))?;
        }
    }
    linker(&targets)
}

/// The target links with `rust-lld`, which Debian's compiler package does not bring.
fn linker(targets: &Path) -> Result<()> {
    let details = answer(Command::new("rustc").arg("-vV")).context("rustc does not run")?;
    let Some(machine) = details.lines().find_map(|line| line.strip_prefix("host: ")) else {
        bail!("rustc does not say what machine it runs on");
    };
    let place = targets.join(machine).join("bin/rust-lld");
    if place.exists() {
        return Ok(());
    }
    let active = answer(Command::new("rustc").args(["--print", "sysroot"])).unwrap_or_default();
    let mut linker = Path::new(&active).join("lib/rustlib").join(machine).join("bin/rust-lld");
    if !linker.exists() {
        install(&["lld"])?;
        linker = PathBuf::from("/usr/bin/ld.lld");
    }
    if let Some(folder) = place.parent() {
        fs::create_dir_all(folder)?;
    }
    // A link, not a copy: the linker finds its libraries by where it really is.
    run(Command::new("ln").arg("-sfn").arg(linker).arg(place))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_probe_rs_that_refuses_the_flags_is_called_too_old() {
        for (version, said) in [
            (None, "no probe-rs here; to flash a board, install probe-rs 0.28 or newer"),
            (Some("probe-rs 0.28.0 (git commit: 0123abc)"), "probe-rs 0.28.0 flashes a board"),
            (Some("probe-rs 1.0.0"), "probe-rs 1.0.0 flashes a board"),
            (Some("probe-rs 0.27.0 (git commit: 0123abc)"), "probe-rs 0.27.0 is too old"),
            (Some("probe-rs"), "probe-rs says \"probe-rs\", which is no version"),
        ] {
            let judged = judge_probe_rs(version);
            assert!(judged.starts_with(said), "{version:?}: {judged}");
        }
    }
}
