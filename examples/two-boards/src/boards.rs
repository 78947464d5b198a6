//! What the two boards tell each other.

use rc10::prelude::*;
use rc10::tasks::boards::{Boards, Role, Topic};

use crate::{chassis, gimbal};

/// How the base is to move: m/s forward, m/s to the left, rad/s.
pub const DRIVE: Topic<[f32; 3]> = Topic::new(1, Role::Leads, Micros::from_millis(10));
/// How fast the base turns, rad/s.
pub const TURNS: Topic<f32> = Topic::new(2, Role::Follows, Micros::from_millis(5));

/// Both are on the second bus of each.
pub const BOARDS: Boards = Boards::new(
    [(gimbal::Name::ENTRIES, 2), (chassis::Name::ENTRIES, 2)],
    &[DRIVE.entry(), TURNS.entry()],
);
