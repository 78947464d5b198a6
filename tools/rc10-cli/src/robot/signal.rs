//! A robot's own signals: values of its tasks that a run records beside the motors.
//!
//! [`Robot::signal`](crate::Robot::signal) adds one. It is read every millisecond, and appears in
//! the table, the JSON and the report of `rc10 run`.

use std::rc::Rc;

use rc10_time::Micros;

/// A signal: its label, its unit, and a function that reads it.
#[derive(Clone)]
pub struct Signal<'r> {
    /// Label of the signal. Signals of one unit whose labels begin with the same word share a plot.
    pub label: &'static str,
    /// Unit, such as "mm"; empty without one.
    pub unit: &'static str,
    /// The names of the values of a state from 0 on, with commas between; else empty.
    pub states: &'static str,
    /// Reads the value at a time; `None` without a value.
    pub read: Rc<dyn Fn(Micros) -> Option<f64> + 'r>,
}
