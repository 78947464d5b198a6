use crate::config::ConfigError;
use crate::text::Text;

/// Why waypoints are no path. They are counted from 0, as in the list.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{}", self.text())]
pub enum PathError {
    /// A path has two waypoints at least.
    TooFewWaypoints,
    /// A number of a waypoint that cannot be used.
    Waypoint {
        /// The waypoint.
        waypoint: usize,
        /// The field of the waypoint.
        error: ConfigError,
    },
    /// A waypoint less than a millimetre from the one before.
    SamePlace {
        /// The later of the two.
        waypoint: usize,
    },
    /// An arc, or two with one leg between them, that takes more of a leg than there is.
    ArcTooWide {
        /// The waypoint with the wider arc.
        waypoint: usize,
        /// Length that the arcs take, in metres.
        takes: f32,
        /// The leg's length, in metres.
        length: f32,
    },
    /// An arc where the path goes back within 10 degrees: only a stop, radius 0, is possible.
    TurnsBack {
        /// The waypoint.
        waypoint: usize,
    },
}

impl PathError {
    /// The message, for a `const`, which cannot use [`Display`](core::fmt::Display).
    pub const fn text(&self) -> Text {
        let (waypoint, text) = match self {
            Self::TooFewWaypoints => {
                return Text::new().push("a path has two waypoints at least");
            }
            Self::Waypoint { waypoint, .. }
            | Self::SamePlace { waypoint }
            | Self::ArcTooWide { waypoint, .. }
            | Self::TurnsBack { waypoint } => (*waypoint, Text::new().push("waypoint ")),
        };
        let text = text.push_number(waypoint as u64).push(": ");
        match self {
            Self::TooFewWaypoints => text,
            Self::Waypoint { error, .. } => error.add_to(text),
            Self::SamePlace { .. } => text.push("at the place of the one before"),
            Self::ArcTooWide { takes, length, .. } => text
                .push("its arc takes ")
                .push_float(*takes)
                .push(" m of a leg of ")
                .push_float(*length)
                .push(" m, with the arc at the leg's other end"),
            Self::TurnsBack { .. } => text.push("the path turns back, which no arc can round off"),
        }
    }
}

/// Why a base cannot drive along a path.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// A base of plain wheels, whose heading must be the path's direction.
    #[error("a base that cannot move sideways")]
    CannotMoveSideways,
    /// A limit that cannot be used.
    #[error(transparent)]
    Limits(ConfigError),
    /// The start is faster than it could slow down within the limits.
    #[error("faster at the start than the path allows, {allowed} m/s")]
    TooFast {
        /// Highest speed at the start, in m/s.
        allowed: f32,
    },
}
