//! Random stories of topics, latest values and services in virtual time: whatever happens, in any
//! order, nothing is lost unreported, no caller gets another's response or waits for ever.
//!
//! A failed story names its seed: `STORY=<seed> cargo test -p rc10-message --test stories` tells it
//! alone.
#![cfg(test)]
#[path = "stories/calls.rs"]
mod calls;
mod clock;
#[path = "stories/messages.rs"]
mod messages;

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Clients of the number that is told.
const STORIES: u64 = 10_000;

/// Tells all stories, or the one that is asked for.
fn tell(story: impl Fn(u64)) {
    if let Ok(seed) = std::env::var("STORY") {
        return story(seed.parse().unwrap());
    }
    for seed in 0..STORIES {
        let told = catch_unwind(AssertUnwindSafe(|| story(seed)));
        assert!(told.is_ok(), "story {seed}");
        clock::rewind();
    }
}
