//! Judges a run: its problems, its base's path, its events.

pub(crate) mod base;
pub(crate) mod consistency;
pub mod doctor;
pub mod happened;
pub mod path;
pub mod searches;

use crate::recording::Recording;
use crate::recording::problem::Problem;

/// Searches for findings of one sort each. To add one, write a function and a line here.
const SEARCHES: [fn(&Recording, &mut Vec<Problem>); 13] = [
    searches::robot,
    searches::heading,
    searches::mechanisms,
    searches::motors,
    searches::efforts,
    searches::buses,
    searches::lines,
    searches::remote,
    searches::parts,
    consistency::identifiers,
    consistency::runaways,
    base::base_and_wheels,
    consistency::not_checked,
];

/// Everything that was found in a run.
pub fn problems(recording: &Recording) -> Vec<Problem> {
    let mut found = Vec::new();
    SEARCHES.iter().for_each(|search| search(recording, &mut found));
    found
}
