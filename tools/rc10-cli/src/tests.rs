//! The team's robot for unit tests. That crate's own description is made with another build of this one.

use rc10_motor::MotorBus;
use team::Shared;
use team::table::{BASE, Name};

use crate::{Base, Description, Plant, Robot};

pub fn description() -> Description {
    let base = Some(Base::of(BASE.wheels, &BASE.geometry));
    Description { base, ..Description::of(|_: Name| Plant::inertia(0.01)) }
}

pub fn robot<'r>(shared: &'r Shared<'_>, buses: [MotorBus<'r>; 3]) -> Robot<'r> {
    Robot::on(description(), buses, [], shared)
}
