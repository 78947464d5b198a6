//! Signals of a robot's own: values of its tasks that a run records beside the motors.
//!
//! [`Robot::signal`](crate::Robot::signal) names one. It is read every millisecond, and appears in the
//! table, the JSON and the report of `rc10 run`.

use std::rc::Rc;

use rc10_can::Micros;

/// A signal: its label, its unit, and a function that reads it.
#[derive(Clone)]
pub struct Signal<'r> {
    /// Label of the signal. Signals of one unit whose labels begin with the same word share a plot.
    pub label: &'static str,
    /// Its unit, such as "mm"; empty if it has none.
    pub unit: &'static str,
    /// If it is a state: the names of its values from 0 on, with commas between.
    pub states: &'static str,
    /// Its value at a time; `None` while it has none.
    pub read: Rc<dyn Fn(Micros) -> Option<f64> + 'r>,
}
