use crate::config::ConfigError;
use crate::text::Text;
use crate::transform::{Point, RobotFrame};

/// Why a list of wheels is no base. Wheels are counted from 0, as in the list.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{}", self.text())]
pub enum BaseError {
    /// A number of a wheel that cannot be used.
    Wheel {
        /// The wheel.
        wheel: usize,
        /// The field of the wheel.
        error: ConfigError,
    },
    /// A number of the base that cannot be used.
    Config(ConfigError),
    /// The rollers of a wheel lie along its axle, within 5 degrees: it cannot push.
    RollersAlongAxle {
        /// The wheel.
        wheel: usize,
    },
    /// Two wheels without rollers that do not roll in parallel: one would drag the other sideways.
    AtOdds {
        /// The wheels.
        wheels: [usize; 2],
    },
    /// The wheels do not turn the base about this point, or hardly: no wheel has a lever.
    CannotTurn {
        /// The point about which it turns freely.
        about: Point<RobotFrame>,
    },
    /// No wheel moves the base along this direction, or holds it there.
    CannotMove {
        /// Unit vector in the robot's axes.
        along: [f32; 2],
    },
}

impl BaseError {
    /// The message, for a `const`, which cannot use [`Display`](core::fmt::Display).
    pub const fn text(&self) -> Text {
        let text = Text::new();
        match self {
            Self::Wheel { wheel, error } => {
                error.add_to(text.push("wheel ").push_number(*wheel as u64).push(": "))
            }
            Self::Config(error) => error.add_to(text),
            Self::RollersAlongAxle { wheel } => text
                .push("the rollers of wheel ")
                .push_number(*wheel as u64)
                .push(" lie along its axle: it cannot push"),
            Self::AtOdds { wheels: [first, second] } => text
                .push("wheels ")
                .push_number(*first as u64)
                .push(" and ")
                .push_number(*second as u64)
                .push(
                    " have no rollers and do not roll in parallel: they drag each other sideways",
                ),
            Self::CannotTurn { about: Point { x, y, .. } } => {
                point(text.push("the wheels cannot turn the base about "), *x, *y)
            }
            Self::CannotMove { along: [x, y] } => {
                point(text.push("the wheels cannot move or hold the base along "), *x, *y)
            }
        }
    }
}

const fn point(text: Text, x: f32, y: f32) -> Text {
    text.push("(").push_float(x).push(", ").push_float(y).push(")")
}
