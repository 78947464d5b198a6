//! The output of a run for people and programs: figures, tables, JSON, the report.

pub mod compare;
pub mod figures;
pub mod print;
pub mod report;
