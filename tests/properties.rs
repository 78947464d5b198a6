//! Properties of every input, tried with thousands of them: the same ones in each run.

mod any;
mod bus;
mod cybergear;
mod damiao;
mod lk;
mod maths;
mod odrive;
mod unitree;
mod vesc;
mod wire;
mod wiring;
