//! What people and programs see of a run: figures, tables, JSON, the report.

pub mod figures;
pub mod print;
pub mod report;
