//! `rc10 live` and related commands: a robot that runs, watched, tuned and recorded.
//!
//! * [`Client`]: the PC's end of a link, without the port. [`Session`]: with it.
//! * [`SourceArgs`]: the choice of the robot. `reach`: robots that other programs keep; `shared`: their line.
//! * [`plan`]: the signals and their rates. [`LiveRecord`]: a record of them.
//! * [`Judge`]: problems, as in a report. [`table_lines`]: changes for the robot's table. [`Viewers`]: other programs' viewers.
//! * `drive`: a robot that runs on this PC, on real buses. `playback`: a record on the same page.
//! * `hands`: pages that drive a simulated robot by its remote. `field`: where its base is.
//!   `broken`: what goes wrong with it.
//! * `ros2`: the robot as a ROS 2 node, over zenoh.
//! * [`Web`]: the page with its robot in the same browser.
//! * [`Pages`]: a web server for this PC alone. [`request`]: its rules. [`History`]: its values.

pub(crate) mod black_box;
pub(crate) mod broken;
pub(crate) mod client;
pub(crate) mod commands;
pub(crate) mod connection;
pub(crate) mod device;
pub(crate) mod drive;
pub(crate) mod field;
#[cfg(feature = "viewers")]
pub(crate) mod foxglove;
#[cfg(not(feature = "viewers"))]
#[path = "no_foxglove.rs"]
pub(crate) mod foxglove;
pub(crate) mod hands;
pub(crate) mod history;
pub(crate) mod judge;
pub(crate) mod line;
pub(crate) mod page;
pub(crate) mod plan;
pub(crate) mod playback;
pub(crate) mod port;
pub(crate) mod reach;
pub(crate) mod record;
pub mod request;
pub mod ros2;
pub(crate) mod server;
pub(crate) mod session;
pub(crate) mod shared;
pub(crate) mod source;
pub(crate) mod table;
pub(crate) mod viewers;
pub(crate) mod web;

pub use crate::live::line::{RobotConnection, Source};
pub use crate::live::source::{PlaceArgs, RunningArgs, SourceArgs};
pub use crate::world::console::BAUD;
pub use black_box::{BlackBoxArgs, black_box};
pub use client::{
    Answer, Client, KeptValue, Losses, NOT_HEARD, Parameter, Sample, Signal, Urgency, frame,
};
pub use commands::{
    ForgetArgs, GetArgs, ParamsArgs, RecordArgs, SaveArgs, SetArgs, StopArgs, forget, get, params,
    record, save, set, stop_robot,
};
pub use connection::Reply;
pub use device::{DeviceArgs, device};
pub use history::{History, POINTS, thin};
pub use judge::{Advice, Judge};
pub use page::{LiveArgs, live};
pub use plan::{Line, Topic, plan, watch, watch_at};
pub use rc10_link::{Action, Urgent};
pub use record::LiveRecord;
pub use ros2::{Ros2Args, ros2};
pub use server::{PageRequest, Pages, Shown};
pub use session::{Session, full_name};
pub use table::table_lines;
pub use viewers::{ViewerArgs, Viewers, signal_name};
pub use web::Web;
