//! The plots of `docs/control`, from runs of the code itself, and what both languages of its pages
//! share.
//!
//! A plot that is not the one in `docs/pictures/control` fails; `RC10_BLESS=1 cargo test --test all plots`
//! writes it anew.

#[path = "../crates/rc10-app/tests/mechanisms/axis.rs"]
#[allow(dead_code, missing_docs, clippy::cast_possible_truncation, reason = "a part is used here")]
mod axis;
mod bases;
mod drawing;
mod mechanisms;
mod odometry;
mod pages;
mod paths;
mod pid;
mod profiles;

use std::path::PathBuf;
use std::{env, fs};

use drawing::Panel;

fn check(name: &str, panels: &[Panel]) {
    let picture = drawing::svg(panels);
    let pictures = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs/pictures/control");
    let path = pictures.join(name).with_extension("svg");
    if env::var_os("RC10_BLESS").is_some() {
        fs::create_dir_all(pictures).unwrap();
        fs::write(path, picture).unwrap();
        return;
    }
    let kept = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        kept == picture,
        "{path:?} is another one now: RC10_BLESS=1 cargo test --test all plots"
    );
}

#[test]
fn pid_is_the_plot_of_its_page() {
    check("pid", &pid::panels());
}

#[test]
fn profiles_is_the_plot_of_its_page() {
    check("profiles", &profiles::panels());
}

#[test]
fn bases_is_the_plot_of_its_page() {
    check("bases", &bases::panels());
}

#[test]
fn odometry_is_the_plot_of_its_page() {
    check("odometry", &odometry::panels());
}

#[test]
fn paths_is_the_plot_of_its_page() {
    check("paths", &paths::panels());
}

#[test]
fn mechanisms_is_the_plot_of_its_page() {
    check("mechanisms", &mechanisms::panels());
}
