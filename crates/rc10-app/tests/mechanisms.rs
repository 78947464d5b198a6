//! Mechanisms on simulated axes: with inertia, friction, stops that give way, belts that slip, contacts
//! that bounce, and motors that fail. Every run is made of a seed.

#![allow(
    clippy::cast_possible_truncation,
    reason = "simulated in f64, measured in what the mechanisms take"
)]

mod axis;
mod feeding;
mod homing;
mod lift;
