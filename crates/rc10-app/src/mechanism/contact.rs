//! Contacts that bounce: switches and markers.

use crate::TotalAngle;
use crate::units::Seconds;

/// A contact that bounces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Debounce {
    /// Closed or open; `None` before it has been one of both for long enough.
    pub(super) state: Option<bool>,
    /// The state in the last step, and for how long without a break.
    last: (bool, f32),
    /// Where it left its state, until it is back for long enough.
    edge: Option<TotalAngle>,
}

/// A change of a contact.
#[derive(Clone, Copy)]
pub(super) struct Edge {
    pub(super) closed: bool,
    /// Where the change began.
    pub(super) angle: TotalAngle,
    /// Whether the state before was open, not unknown.
    pub(super) was_open: bool,
}

impl Debounce {
    pub(super) const NEW: Self = Self { state: None, last: (false, 0.0), edge: None };

    pub(super) fn update(
        &mut self,
        debounce: Seconds,
        closed: bool,
        angle: TotalAngle,
        dt: Seconds,
    ) -> Option<Edge> {
        let (last, lasted) = self.last;
        let lasted = if closed == last { lasted + dt.get() } else { dt.get() };
        self.last = (closed, lasted);
        let is_steady = lasted >= debounce.get();
        if self.state == Some(closed) {
            if is_steady {
                self.edge = None;
            }
            return None;
        }
        let angle = *self.edge.get_or_insert(angle);
        if !is_steady {
            return None;
        }
        self.edge = None;
        let was_open = self.state.replace(closed) == Some(false);
        Some(Edge { closed, angle, was_open })
    }

    /// Closed, and it does not bounce.
    pub(super) const fn is_steadily_closed(&self) -> bool {
        matches!(self.state, Some(true)) && self.edge.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: Seconds = Seconds::new(0.01);

    /// Feeds a contact whose axis moves 1 degree a step; the edges: closed, degrees.
    fn edges(contact: &str) -> impl Iterator<Item = (bool, i64)> {
        let mut debounce = Debounce::NEW;
        contact.chars().zip(0_i32..).filter_map(move |(state, at)| {
            let angle = TotalAngle::from_degrees(at);
            let edge = debounce.update(Seconds::new(0.025), state == '#', angle, DT)?;
            Some((edge.closed, edge.angle.microdegrees() / 1_000_000))
        })
    }

    #[test]
    fn an_edge_is_where_it_began_to_bounce() {
        assert!(edges("......#.#.##.#####").eq([(false, 0), (true, 6)]));
        assert!(edges("####.#..#.....").eq([(true, 0), (false, 4)]));
        // Noise is no edge, and does not shift the one that follows.
        assert!(edges("......#.#.........######").eq([(false, 0), (true, 18)]));
        // As long as it bounces it is neither.
        assert!(edges("#.#.#.##..##..#.#.").eq([]));
    }
}
