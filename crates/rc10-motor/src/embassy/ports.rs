use core::marker::PhantomData;

use super::motors::MotorPort;
use super::port::BusPort;
use super::rs485::Rs485Port;
use crate::declaration::{MOST_BUSES, MOST_LINES, Names, Place, Slot};

/// A robot's shared side: a port for each bus and line, and its motors by name.
///
/// Other numbers of buses or lines, or another robot's names, do not compile:
///
/// ```compile_fail,E0308
/// # mod robots { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/docs/robots.rs")); }
/// # use robots::{ours, theirs};
/// static PORTS: rc10_motor::embassy::Ports<ours::Name, 1> = rc10_motor::embassy::Ports::new();
/// let wheel = PORTS.motor(theirs::Name::Lift);
/// ```
///
/// A robot's own program does the same:
///
/// ```
/// # mod robots { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/docs/robots.rs")); }
/// # use robots::ours;
/// static PORTS: rc10_motor::embassy::Ports<ours::Name, 1> = rc10_motor::embassy::Ports::new();
/// let wheel = PORTS.motor(ours::Name::Wheel);
/// ```
pub struct Ports<N, const BUSES: usize, const LINES: usize = 0> {
    /// One for each bus; bus 1 is the first.
    pub buses: [BusPort; BUSES],
    /// One for each line; line 1 is the first.
    pub lines: [Rs485Port; LINES],
    names: PhantomData<fn(N)>,
}

impl<N: Names, const BUSES: usize, const LINES: usize> Ports<N, BUSES, LINES> {
    /// Ports of buses and lines that do not run yet: they refuse all targets until they do.
    // Always inlined, so that it is made where it stays and does not pass over the stack.
    #[inline(always)]
    #[must_use]
    pub const fn new() -> Self {
        const {
            let fits = BUSES == N::BUSES.len() && LINES == N::LINES as usize;
            assert!(fits, "the declaration has other numbers of buses and lines than its `Ports`");
            let is_too_large = BUSES > MOST_BUSES || LINES > MOST_LINES;
            assert!(!is_too_large, "a robot has at most three buses and two lines");
        }
        Self {
            buses: [const { BusPort::new() }; BUSES],
            lines: [const { Rs485Port::new() }; LINES],
            names: PhantomData,
        }
    }

    /// The port of a motor.
    pub fn motor(&self, name: N) -> MotorPort<'_> {
        name.slot().port(&self.buses, &self.lines)
    }
}

/// The ports of a robot, of whatever numbers of buses and lines.
#[derive(Clone, Copy)]
pub struct PortsOf<'p, N> {
    /// One for each bus; bus 1 is the first.
    pub buses: &'p [BusPort],
    /// One for each line; line 1 is the first.
    pub lines: &'p [Rs485Port],
    names: PhantomData<fn(N)>,
}

impl<'p, N: Names> PortsOf<'p, N> {
    /// Those of the robot's buses and lines.
    ///
    /// # Panics
    /// If they are others than declared.
    #[must_use]
    pub fn new(buses: &'p [BusPort], lines: &'p [Rs485Port]) -> Self {
        assert!(buses.len() == N::BUSES.len() && lines.len() == usize::from(N::LINES));
        Self { buses, lines, names: PhantomData }
    }

    /// The port of a motor.
    #[must_use]
    pub fn motor(self, name: N) -> MotorPort<'p> {
        name.slot().port(self.buses, self.lines)
    }
}

impl<'p, N, const BUSES: usize, const LINES: usize> From<&'p Ports<N, BUSES, LINES>>
    for PortsOf<'p, N>
{
    fn from(ports: &'p Ports<N, BUSES, LINES>) -> Self {
        let Ports { buses, lines, names } = ports;
        Self { buses, lines, names: *names }
    }
}

impl Slot {
    /// The port of the motor, among those of its robot's buses and lines.
    ///
    /// # Panics
    /// If they are fewer than declared.
    #[must_use]
    pub fn port<'p>(&self, buses: &'p [BusPort], lines: &'p [Rs485Port]) -> MotorPort<'p> {
        // They are counted from 1.
        match self.on {
            Place::Bus(number) => buses[usize::from(number) - 1].motor(self.motor),
            Place::Line(number) => lines[usize::from(number) - 1].motor(self.motor),
        }
    }
}

impl<N: Names, const BUSES: usize, const LINES: usize> Default for Ports<N, BUSES, LINES> {
    fn default() -> Self {
        Self::new()
    }
}
