use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use rc10_can::{CanFrame, IdPattern};
use rc10_time::Micros;

/// A received frame with its arrival time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// The frame.
    pub frame: CanFrame,
    /// The time at which it arrived.
    pub at: Micros,
}

/// A selection of frames for a [`Subscription`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// Those that no motor claims.
    Unclaimed,
    /// Those of a pattern, motors' feedback included.
    Pattern(IdPattern),
}

/// All subscriptions of a bus are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("all {} subscriptions of the bus are taken", Subscriptions::COUNT)]
pub struct NoFreeSubscription;

/// Frames that wait for one subscriber.
const DEPTH: usize = 8;

struct Place {
    state: Mutex<CriticalSectionRawMutex, Cell<State>>,
    frames: Channel<CriticalSectionRawMutex, Received, DEPTH>,
}

#[derive(Clone, Copy)]
struct State {
    filter: Option<Filter>,
    lost: u32,
}

pub(super) struct Subscriptions {
    places: [Place; Self::COUNT],
    changes: AtomicU32,
}

impl Subscriptions {
    pub(super) const COUNT: usize = 4;

    pub(super) const fn new() -> Self {
        Self {
            places: [const {
                Place {
                    state: Mutex::new(Cell::new(State { filter: None, lost: 0 })),
                    frames: Channel::new(),
                }
            }; Self::COUNT],
            changes: AtomicU32::new(0),
        }
    }

    pub(super) fn subscribe(&self, filter: Filter) -> Result<Subscription<'_>, NoFreeSubscription> {
        let take = |place: &&Place| {
            place.state.lock(|state| {
                let free = state.get().filter.is_none();
                if free {
                    state.set(State { filter: Some(filter), lost: 0 });
                }
                free
            })
        };
        let place = self.places.iter().find(take).ok_or(NoFreeSubscription)?;
        place.frames.clear();
        self.changes.fetch_add(1, Ordering::Release);
        Ok(Subscription { place, changes: &self.changes })
    }

    /// Changes whenever a subscription begins or ends.
    pub(super) fn changes(&self) -> u32 {
        self.changes.load(Ordering::Acquire)
    }

    pub(super) fn filters(&self) -> impl Iterator<Item = Filter> {
        self.places.iter().filter_map(|place| place.state.lock(Cell::get).filter)
    }

    /// Gives a frame to all who want it. A subscriber that does not keep up loses it, and knows.
    pub(super) fn deliver(&self, received: Received, claimed: bool) {
        for place in &self.places {
            let wanted = place.state.lock(Cell::get).filter.is_some_and(|filter| match filter {
                Filter::Unclaimed => !claimed,
                Filter::Pattern(pattern) => pattern.matches(&received.frame),
            });
            if wanted && place.frames.try_send(received).is_err() {
                place.state.lock(|state| {
                    let State { filter, lost } = state.get();
                    state.set(State { filter, lost: lost.saturating_add(1) });
                });
            }
        }
    }
}

/// A stream of frames from a bus; dropping it ends it.
pub struct Subscription<'p> {
    place: &'p Place,
    changes: &'p AtomicU32,
}

impl Subscription<'_> {
    /// The next frame. Cancel safe: a frame is either returned or still there.
    pub async fn next(&mut self) -> Received {
        self.place.frames.receive().await
    }

    /// The next frame, if one is there.
    pub fn try_next(&mut self) -> Option<Received> {
        self.place.frames.try_receive().ok()
    }

    /// Frames lost so far because they came faster than they were taken.
    pub fn lost(&self) -> u32 {
        self.place.state.lock(Cell::get).lost
    }
}

impl Drop for Subscription<'_> {
    fn drop(&mut self) {
        self.place.state.lock(|state| state.set(State { filter: None, lost: 0 }));
        self.changes.fetch_add(1, Ordering::Release);
    }
}
