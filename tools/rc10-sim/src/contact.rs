//! Switches and markers on the shafts of motors.

use std::cell::Cell;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::digital::{ErrorType, InputPin};

use crate::Nanos;
use crate::fault::Defect;
use crate::handles::Esc;

/// One turn, degrees.
const TURN: f64 = 360.0;

/// A contact that a motor's shaft closes in a part of its turn: a switch at a cam, a marker that passes
/// a photo interrupter. It is also the input that it pulls low while it is closed, and that a resistor
/// pulls up.
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
    from: f64,
    width: f64,
    defect: Rc<Cell<Option<Defect>>>,
    /// Whether the shaft closed it when it was looked at last, and since when.
    edge: Rc<Cell<(bool, Nanos)>>,
}

/// For how long a contact bounces, and from one change of it to the next.
const BOUNCING: Nanos = Nanos::new(10_000_000);
const BOUNCE: u64 = 700_000;

impl Contact {
    /// On the output shaft of a motor, closed between two of its angles: degrees since the start, in any
    /// turn, the lower one first.
    ///
    /// # Errors
    /// If it would never be closed, or never open.
    pub fn new(shaft: &Esc, closed: [f64; 2]) -> Result<Self, NoRange> {
        let [from, to] = closed;
        let width = to - from;
        if from.is_finite() && width > 0.0 && width < TURN {
            let (defect, edge) = (Rc::default(), Rc::default());
            Ok(Self { shaft: shaft.clone(), from, width, defect, edge })
        } else {
            Err(NoRange { closed })
        }
    }

    /// Whether it is closed now: where the shaft truly is.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        let closed = (self.shaft.state().load_degrees - self.from).rem_euclid(TURN) < self.width;
        let now = self.shaft.now();
        if self.edge.get().0 != closed {
            self.edge.set((closed, now));
        }
        match self.defect.get() {
            Some(Defect::Stuck) => true,
            Some(Defect::Torn) => false,
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
        Ok(!self.is_closed())
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(self.is_closed())
    }
}

/// A contact that would never be closed, or never open.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "closed from {} to {} degrees is no part of a turn: less than all of it, the lower angle first",
    .closed[0], .closed[1]
)]
pub struct NoRange {
    /// Where it was to be closed.
    pub closed: [f64; 2],
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
    }
}
