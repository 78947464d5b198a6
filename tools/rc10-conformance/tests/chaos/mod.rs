//! Seeded random stories: everything that can happen to a motor, at any time and in any order. What
//! must hold is looked at in every millisecond, and at the end everything is well again.
//!
//! `RC10_STORIES=500 cargo test -p rc10-conformance --test all chaos` tells more of them, `RC10_STORY=7`
//! only number 7.

mod line;
mod random;
mod scene;
mod story;
mod watch;

use rc10_conformance::Declaration;
use rc10_motor::CanMotor;
use rc10_motor::rc10_app::Direction;
use rc10_motor::unitree::GoM8010;
use rc10_sim::{Bus, Esc, Line};

use crate::conformance::{Check, all_pass};
use line::LineScene;
use scene::CanScene;

/// Stories of a motor, unless `RC10_STORIES` asks for more.
const STORIES: u64 = 60;

/// The numbers of the stories to tell.
pub fn seeds() -> std::ops::Range<u64> {
    let first = std::env::var("RC10_STORY").ok().and_then(|text| text.parse().ok());
    let count = std::env::var("RC10_STORIES").ok().and_then(|text| text.parse().ok());
    first.map_or(0..count.unwrap_or(STORIES), |first| first..first + count.unwrap_or(1))
}

/// The stories.
struct Stories;

impl Check for Stories {
    fn check<M: CanMotor + 'static>(
        declared: &Declaration,
        motor: impl Fn(u8) -> M,
        device: impl Fn(&Bus, u8) -> Esc,
    ) -> Result<(), String> {
        seeds().try_for_each(|seed| {
            let mut motor = motor(declared.ids[0]);
            CanScene::play(declared, &mut motor, &device, seed)
                .map_err(|what| format!("story {seed}: {what}"))
        })
    }

    fn check_line(
        declared: &Declaration,
        motor: impl Fn(u8) -> GoM8010,
        device: impl Fn(&Line, u8) -> Esc,
    ) -> Result<(), String> {
        seeds().try_for_each(|seed| {
            LineScene::play(declared, &mut motor(declared.ids[0]), &device, seed)
                .map_err(|what| format!("story {seed}: {what}"))
        })
    }
}

#[test]
fn one_half_of_the_motors() {
    all_pass::<Stories>(Direction::Forward, 0, 2);
}

#[test]
fn the_other_half() {
    all_pass::<Stories>(Direction::Forward, 1, 2);
}
