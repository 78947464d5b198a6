//! The verdict of a run: refusals, problems and their sentences, exit codes, and how far
//! the shipped robots are from the thresholds of `docs/verdict.md`.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "common/mixed.rs"]
mod common_mixed;
#[path = "common/made.rs"]
mod made;
#[path = "common/scratch.rs"]
mod scratch;

#[path = "verdict/beginners.rs"]
mod beginners;
#[path = "verdict/faults.rs"]
mod faults;
#[path = "verdict/gains.rs"]
mod gains;
#[path = "verdict/hours.rs"]
mod hours;
#[path = "verdict/robots.rs"]
mod robots;
#[path = "verdict/wrong.rs"]
mod wrong;

use rc10_can::Micros;
use rc10_cli::figures::Figures;
use rc10_cli::problems::Severity;
use rc10_cli::recording::Recording;

/// The problems of a run, a line each.
fn problems(recording: &Recording) -> String {
    let figures = Figures::of(recording);
    let lines = figures.found(Severity::Problem).map(ToString::to_string);
    lines.collect::<Vec<_>>().join("\n")
}
