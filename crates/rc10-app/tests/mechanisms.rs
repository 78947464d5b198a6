//! Mechanisms on simulated axes: with inertia, friction, stops that give way, belts that slip, contacts
//! that bounce, and motors that fail. Every run is made of a seed.

#[path = "mechanisms/axis.rs"]
mod axis;
#[path = "mechanisms/feeding.rs"]
mod feeding;
#[path = "mechanisms/homing.rs"]
mod homing;
#[path = "mechanisms/lift.rs"]
mod lift;
