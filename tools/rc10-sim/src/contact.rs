//! Switches and markers on the shafts of motors.

use std::cell::Cell;
use std::convert::Infallible;
use std::fmt;
use std::rc::Rc;

use embedded_hal::digital::{ErrorType, InputPin};

use crate::Nanos;
use crate::fault::Defect;
use crate::handles::Esc;

/// One turn, degrees.
const TURN: f64 = 360.0;

/// Where a shaft closes a contact, in degrees since the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Closed {
    /// Between two angles in any turn, the lower one first: a cam, a marker that passes a photo interrupter.
    InEachTurn([f64; 2]),
    /// At this angle and below, over all turns: a switch at the bottom of a lift.
    Below(f64),
    /// At this angle and above, over all turns.
    Above(f64),
}

impl From<[f64; 2]> for Closed {
    fn from(range: [f64; 2]) -> Self {
        Self::InEachTurn(range)
    }
}

impl Closed {
    /// The same, seen from the shaft's other side.
    #[must_use]
    pub fn mirrored(self) -> Self {
        match self {
            Self::InEachTurn([from, to]) => Self::InEachTurn([-to, -from]),
            Self::Below(at) => Self::Above(-at),
            Self::Above(at) => Self::Below(-at),
        }
    }

    fn is_at(self, degrees: f64) -> bool {
        match self {
            Self::InEachTurn([from, to]) => (degrees - from).rem_euclid(TURN) < to - from,
            Self::Below(at) => degrees <= at,
            Self::Above(at) => degrees >= at,
        }
    }
}

/// A contact that a motor's shaft closes: a limit switch that is pressed, a marker that is seen. It is also the
/// input of its wire, which a resistor pulls up: low while it is closed, or while it is open with
/// [`opening`](Self::opening).
///
/// A contact bounces only while it has that [`Defect`].
///
/// ```
/// use embedded_hal::digital::InputPin;
/// use rc10_sim::{BusConfig, Contact, EscConfig, Model, World};
/// let mut world = World::new(1);
/// let esc = world.add_bus(BusConfig::default()).add_esc(EscConfig::new(Model::C610, 1))?;
/// let (mut here, mut elsewhere) = (Contact::new(&esc, [-3.0, 3.0])?, Contact::new(&esc, [3.0, 9.0])?);
/// assert_eq!((here.is_low(), elsewhere.is_low()), (Ok(true), Ok(false)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Contact {
    shaft: Esc,
    closed: Closed,
    opens: bool,
    defect: Rc<Cell<Option<Defect>>>,
    /// Whether the shaft closed it when it was looked at last, and since when.
    edge: Rc<Cell<(bool, Nanos)>>,
}

/// For how long a contact bounces, and from one change of it to the next.
const BOUNCING: Nanos = Nanos::new(10_000_000);
const BOUNCE: u64 = 700_000;

impl Contact {
    /// On the output shaft of a motor, closed there. Fails if it would never be closed, or never
    /// open.
    pub fn new(shaft: &Esc, closed: impl Into<Closed>) -> Result<Self, NoRange> {
        let closed = closed.into();
        let is_sound = match closed {
            Closed::InEachTurn([from, to]) => from.is_finite() && to > from && to - from < TURN,
            Closed::Below(at) | Closed::Above(at) => at.is_finite(),
        };
        if !is_sound {
            return Err(NoRange { closed });
        }
        let (defect, edge) = (Rc::default(), Rc::default());
        Ok(Self { shaft: shaft.clone(), closed, opens: false, defect, edge })
    }

    /// The same, wired by its contact that opens: the input is high while it is closed, that is pressed, and
    /// with a torn wire.
    #[must_use]
    pub fn opening(self) -> Self {
        Self { opens: true, ..self }
    }

    /// Whether it pulls its input low now.
    pub fn pulls_low(&self) -> bool {
        self.is_closed() != self.opens
    }

    /// Whether it is closed now, by what its wire tells: where the shaft truly is, but for a defect.
    pub fn is_closed(&self) -> bool {
        let closed = self.closed.is_at(self.shaft.state().load_degrees);
        let now = self.shaft.now();
        if self.edge.get().0 != closed {
            self.edge.set((closed, now));
        }
        match self.defect.get() {
            Some(Defect::Stuck) => true,
            Some(Defect::Torn) => self.opens,
            Some(Defect::Bounces) if now < self.edge.get().1 + BOUNCING => {
                closed ^ (now.get() / BOUNCE).is_multiple_of(2)
            }
            _ => closed,
        }
    }

    /// Gives it a defect, or mends it; all its clones, too.
    pub fn set_defect(&self, defect: Option<Defect>) {
        self.defect.set(defect);
    }
}

impl ErrorType for Contact {
    type Error = Infallible;
}

impl InputPin for Contact {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(!self.pulls_low())
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(self.pulls_low())
    }
}

/// A contact that would never be closed, or never open.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("closed {closed}")]
pub struct NoRange {
    /// Where it was to be closed.
    pub closed: Closed,
}

impl fmt::Display for Closed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InEachTurn([from, to]) => write!(
                f,
                "from {from} to {to} degrees is no part of a turn: less than all of it, the lower angle first"
            ),
            Self::Below(at) | Self::Above(at) => write!(f, "from {at} degrees on is no place"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BusConfig, EscConfig, Model, World};

    #[test]
    fn it_is_closed_once_a_turn() {
        let mut world = World::new(1);
        let bus = world.add_bus(BusConfig::default());
        let esc = bus.add_esc(EscConfig::new(Model::C610, 1)).unwrap();
        let mut contact = Contact::new(&esc, [-370.0, -350.0]).unwrap();
        esc.set_load(1.0);
        let (mut edges, mut was_closed) = (Vec::new(), true);
        for millis in 1..=2000 {
            world.advance(rc10_time::Micros::from_millis(millis));
            let closed = contact.is_low().unwrap();
            assert_eq!(contact.is_high(), Ok(!closed));
            if std::mem::replace(&mut was_closed, closed) != closed {
                edges.push(esc.state().load_degrees);
            }
        }
        assert!(edges.len() > 4, "{edges:?}");
        for (edge, turn) in edges.chunks(2).zip(0..) {
            let at = 360.0 * f64::from(turn);
            // It opens at 10 degrees, and closes at 350.
            assert!((edge[0] - at - 10.0).abs() < 9.0, "{edges:?}");
            assert!(edge.get(1).is_none_or(|edge| (edge - at - 350.0).abs() < 9.0), "{edges:?}");
        }
    }

    /// From a beginning above it, down over many turns.
    #[test]
    fn a_switch_at_an_end_is_closed_beyond_it_in_all_turns() {
        for (load, closed) in
            [(-1.0, Closed::Below(-800.0)), (1.0, Closed::Below(-800.0).mirrored())]
        {
            let mut world = World::new(1);
            let bus = world.add_bus(BusConfig::default());
            let esc = bus.add_esc(EscConfig::new(Model::C610, 1)).unwrap();
            let mut contact = Contact::new(&esc, closed).unwrap();
            let mut opening = contact.clone().opening();
            esc.set_load(load);
            let (mut changes, mut before) = (0, false);
            for millis in 1..=2000 {
                world.advance(rc10_time::Micros::from_millis(millis));
                let is_beyond = esc.state().load_degrees * load >= 800.0;
                assert_eq!(contact.is_closed(), is_beyond);
                assert_eq!((contact.is_low(), opening.is_low()), (Ok(is_beyond), Ok(!is_beyond)));
                changes += u32::from(std::mem::replace(&mut before, is_beyond) != is_beyond);
            }
            assert!(changes == 1 && esc.state().load_degrees * load > 1600.0);
            // A torn wire is a switch that is never reached; by its other contact it is one that is pressed.
            contact.set_defect(Some(Defect::Torn));
            opening.set_defect(Some(Defect::Torn));
            assert_eq!((contact.is_closed(), opening.is_closed()), (false, true));
            assert_eq!((contact.is_high(), opening.is_high()), (Ok(true), Ok(true)));
        }
    }

    #[test]
    fn a_range_that_is_none_is_refused() {
        let mut world = World::new(1);
        let esc =
            world.add_bus(BusConfig::default()).add_esc(EscConfig::new(Model::C610, 1)).unwrap();
        for closed in
            [[3.0, 3.0], [9.0, 3.0], [0.0, 360.0], [0.0, f64::NAN], [f64::NEG_INFINITY, 0.0]]
        {
            let error = Contact::new(&esc, closed).err().unwrap();
            assert!(error.to_string().contains("is no part of a turn"), "{error}");
        }
        let error = Contact::new(&esc, Closed::Above(f64::NAN)).err().unwrap();
        assert_eq!(error.to_string(), "closed from NaN degrees on is no place");
    }
}
