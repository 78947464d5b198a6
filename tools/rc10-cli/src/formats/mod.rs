//! File formats of others: candump and python-can logs, DBC, slcan.

pub mod candump;
pub mod dbc;
pub mod slcan;
