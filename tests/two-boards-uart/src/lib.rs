//! Two boards on a UART, for tests: the leading one has the remote, the following one a wheel.
#![cfg_attr(not(feature = "sim"), no_std)]
#![forbid(unsafe_code)]
#![allow(clippy::float_cmp, reason = "a value comes as it was told, bit for bit")]

pub mod follower;
pub mod leader;
pub mod noise;
#[cfg(feature = "sim")]
pub mod simulation;

use rc10::tasks::boards::{Boards, Role, Topic};
use rc10::time::Micros;

/// Bits a second.
pub const BAUD: u32 = 921_600;
/// The speed of the wheel, rpm, a count, and the sum of both. The leading board tells it.
pub const WISH: Topic<[f32; 3]> = Topic::new(1, Role::Leads, Micros::from_millis(10));
/// A count, twice that, wrong wishes, wishes that the following board did not hear, those that it says are lost.
pub const STATE: Topic<[f32; 5]> = Topic::new(2, Role::Follows, Micros::from_millis(5));
/// They are on UART 7 of the leading board, on UART 10 of the following one.
pub const BOARDS: Boards = Boards::over_uart(BAUD, &[WISH.entry(), STATE.entry()]);

/// Finds gaps in a count.
#[derive(Default)]
pub struct Gaps {
    last: f32,
    /// Values that were not heard.
    pub gaps: f32,
}

impl Gaps {
    /// Takes the count of the newest value.
    pub fn see(&mut self, count: f32) {
        if count != self.last && self.last != 0.0 {
            self.gaps += count - self.last - 1.0;
        }
        self.last = count;
    }
}
