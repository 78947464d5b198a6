//! The base of a robot: its wheels, and which motors turn and steer them.

use rc10_app::Direction;
use rc10_motor::Names;

/// A base on wheels that are turned by some of the motors.
#[derive(Clone, Debug)]
pub struct Base {
    /// The motors that turn the wheels, in the order of the chassis: lines of
    /// [`Description::motors`]. A reversed motor is mounted mirrored.
    pub(crate) wheels: Vec<usize>,
    /// Those that steer them, in the order of those wheels that are steered.
    pub(crate) steering: Vec<usize>,
    /// Its masses and measures, as the robot's table has them.
    pub chassis: rc10_sim::Chassis,
}

impl Base {
    /// On these wheels, in the order of the chassis.
    ///
    /// ```
    /// use rc10_cli::Base;
    /// use rc10_sim::Chassis;
    /// # use rc10_motor::{Entry, Place::Bus, dji::{Config, Dji, M3508}, motors};
    /// # motors! {
    /// #     pub enum Name;
    /// #     pub struct Motors;
    /// #     buses: [100.0];
    /// #     lines: 0;
    /// #     Left: Dji = Entry::new("left", Bus(1), Config::new(&M3508, 1)),
    /// #     Right: Dji = Entry::new("right", Bus(1), Config::new(&M3508, 2)),
    /// # }
    /// let base = Base::new([Name::Left, Name::Right], Chassis::differential(0.05, 0.4).with_mass(8.0));
    /// ```
    #[must_use]
    pub fn new<N: Names>(wheels: impl IntoIterator<Item = N>, chassis: rc10_sim::Chassis) -> Self {
        let wheels = wheels.into_iter().map(Names::index).collect();
        Self { wheels, steering: Vec::new(), chassis }
    }

    /// The same, with the motors that steer its wheels, in the order of those. In the simulator the
    /// wheels look at power-on where the chassis says; a robot that really runs says the angle 0 there.
    #[must_use]
    pub fn with_steering<N: Names>(self, motors: impl IntoIterator<Item = N>) -> Self {
        Self { steering: motors.into_iter().map(Names::index).collect(), ..self }
    }

    /// The same with another mass, kg, which is spread as before.
    #[must_use]
    pub fn with_mass(self, mass: f64) -> Self {
        Self { chassis: self.chassis.with_mass(mass), ..self }
    }

    /// The same, of the measures that the robot itself has; its masses are those of
    /// `Chassis::default`.
    #[must_use]
    pub fn of<N: Names, const WHEELS: usize>(
        wheels: [N; WHEELS],
        base: &rc10_app::Base<WHEELS>,
    ) -> Self {
        let wheels_of_base = base.wheels().iter().map(wheel_of).collect();
        Self::new(wheels, rc10_sim::Chassis::on(wheels_of_base))
    }
}

/// The world's wheel of the measures that the robot has.
fn wheel_of(wheel: &rc10_app::Wheel) -> rc10_sim::Wheel {
    let [x, y, radius] = [wheel.place.x, wheel.place.y, wheel.radius].map(f64::from);
    let direction = f64::from(wheel.direction.get()).to_radians();
    let turned = match wheel.turns {
        Direction::Forward => 0.0,
        Direction::Reversed => std::f64::consts::PI,
    };
    let tread = match wheel.tread {
        rc10_app::Tread::Plain => rc10_sim::Tread::Plain,
        // One says the angle from the axle, the other from where the wheel rolls.
        rc10_app::Tread::Rollers(angle) => {
            rc10_sim::Tread::Rollers { slant: (90.0 + f64::from(angle.get())).to_radians().tan() }
        }
    };
    rc10_sim::Wheel { direction: direction + turned, tread, ..rc10_sim::Wheel::plain(x, y, radius) }
}
