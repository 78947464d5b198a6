//! The verdict of a run: refusals, problems and their sentences, exit codes, and how far
//! the shipped robots are from the thresholds of `docs/verdict.md`.

mod beginners;
mod doctor;
mod faults;
mod gains;
mod hours;
mod robots;
mod wrong;

use crate::common::mixed as common_mixed;
use crate::common::scratch;
use rc10_cli::recording::Recording;
use rc10_cli::recording::problem::Severity;
use rc10_cli::show::figures::Figures;
use rc10_time::Micros;

/// The problems of a run, a line each.
fn problems(recording: &Recording) -> String {
    let figures = Figures::of(recording);
    for problem in &figures.problems {
        let headline = problem.headline();
        assert!(headline.split_whitespace().count() <= 8, "{headline}");
        assert!(headline.contains(": ") && !headline.contains("-"), "no cause: {headline}");
    }
    let lines = figures.found(Severity::Problem).map(ToString::to_string);
    lines.collect::<Vec<_>>().join("\n")
}
