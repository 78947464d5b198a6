//! The base of a robot: its wheels, and the motors that turn and steer them.

use rc10_app::Direction;
use rc10_motor::Names;

/// A base on wheels that are turned by some of the motors.
#[derive(Clone, Debug)]
pub struct Base {
    /// The motors that turn the wheels, in the order of the chassis: indices into
    /// [`Description::motors`]. A reversed motor is mounted mirrored.
    pub(crate) wheels: Vec<usize>,
    /// The motors that steer, in the order of the steered wheels.
    pub(crate) steering: Vec<usize>,
    /// Masses and measures by the robot's table.
    pub chassis: rc10_sim::Chassis,
}

impl Base {
    /// Creates a base on these wheels, in the order of the chassis.
    ///
    /// ```
    /// use rc10_cli::Base;
    /// use rc10_sim::Chassis;
    /// # use rc10_motor::{Entry, Place::Bus, dji::{Config, Dji, M3508}, motors};
    /// # motors! {
    /// #     pub enum Name;
    /// #     pub struct Motors;
    /// #     Left: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
    /// #     Right: Dji = Entry::new(Bus(1), Config::new(&M3508, 2)),
    /// # }
    /// let base = Base::new([Name::Left, Name::Right], Chassis::differential(0.05, 0.4).with_mass(8.0));
    /// ```
    pub fn new<N: Names>(wheels: impl IntoIterator<Item = N>, chassis: rc10_sim::Chassis) -> Self {
        let wheels = wheels.into_iter().map(Names::index).collect();
        Self { wheels, steering: Vec::new(), chassis }
    }

    /// Adds the motors that steer its wheels, in the order of those. In the simulator the chassis
    /// gives the wheels' direction at power-on; a real robot calls it angle 0.
    #[must_use]
    pub fn with_steering<N: Names>(self, motors: impl IntoIterator<Item = N>) -> Self {
        Self { steering: motors.into_iter().map(Names::index).collect(), ..self }
    }

    /// Sets another mass, kg, which is spread as before.
    #[must_use]
    pub fn with_mass(self, mass: f64) -> Self {
        Self { chassis: self.chassis.with_mass(mass), ..self }
    }

    /// Creates a base with the robot's own measures, and the masses of `Chassis::default`.
    pub fn of<N: Names, const WHEELS: usize>(
        wheels: [N; WHEELS],
        base: &rc10_app::Base<WHEELS>,
    ) -> Self {
        let wheels_of_base = base.wheels().iter().map(wheel_of).collect();
        Self::new(wheels, rc10_sim::Chassis::on(wheels_of_base))
    }
}

/// The simulator's wheel with the robot's measures.
fn wheel_of(wheel: &rc10_app::Wheel) -> rc10_sim::Wheel {
    let [x, y, radius] = [wheel.place.x, wheel.place.y, wheel.radius].map(f64::from);
    let direction = f64::from(wheel.direction.get()).to_radians();
    let turned = match wheel.turns {
        Direction::Forward => 0.0,
        Direction::Reversed => std::f64::consts::PI,
    };
    let tread = match wheel.tread {
        rc10_app::Tread::Plain => rc10_sim::Tread::Plain,
        // The angle is from the axle in one, from the rolling direction in the other.
        rc10_app::Tread::Rollers(angle) => {
            rc10_sim::Tread::Rollers { slant: (90.0 + f64::from(angle.get())).to_radians().tan() }
        }
    };
    rc10_sim::Wheel { direction: direction + turned, tread, ..rc10_sim::Wheel::plain(x, y, radius) }
}
