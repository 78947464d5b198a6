//! `rc10 live` and its like: a robot that runs, watched, tuned and recorded.
//!
//! * [`Client`]: the PC's end of a link, without the port. [`Session`]: with it.
//! * [`SourceArgs`]: where the robot is. [`wire`]: a simulated console.
//! * [`plan`]: what is watched how often. [`LiveRecord`]: a record of it.
//! * [`Judge`]: its problems, as a report has them.
//! * [`Viewers`]: other people's.
//! * [`Pages`]: a web server for this PC alone; [`History`]: the values on its pages.

mod client;
mod commands;
#[cfg(feature = "viewers")]
mod foxglove;
#[cfg(not(feature = "viewers"))]
#[path = "live/no_foxglove.rs"]
mod foxglove;
mod history;
mod judge;
mod page;
mod plan;
mod record;
mod server;
mod session;
mod source;
mod viewers;
pub mod wire;

pub use client::{Answer, Client, Losses, Parameter, Sample, Signal};
pub use commands::{GetArgs, ParamsArgs, RecordArgs, SetArgs, get, params, record, set};
pub use history::{History, POINTS};
pub use judge::{Advice, Judge};
pub use page::{LiveArgs, live};
pub use plan::{Topic, plan, watch};
pub use rc10_link::Action;
pub use record::LiveRecord;
pub use server::{Pages, Shown, Wish};
pub use session::{Session, full_name};
pub use source::{BAUD, Source, SourceArgs, Way};
pub use viewers::{ViewerArgs, Viewers, signal_name};
