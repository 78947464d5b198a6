//! The tests of the whole, in one program: to link each file of them alone takes longer than to run them.
//! Those of one file: `cargo test --test all run::`.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod architecture;
mod bus_off;
mod chinese;
mod closed_loop;
mod common;
mod corpus;
mod declaration;
mod decode;
mod defects;
mod emulate;
mod following;
mod interop_python;
mod live;
mod live_drive;
mod live_everywhere;
mod live_field;
mod live_http;
mod live_kept;
mod live_page;
mod live_port;
mod live_reach;
mod live_time;
mod live_tune;
mod load;
mod messages;
mod mistakes;
mod mixed;
mod new;
mod order;
mod plots;
mod ports;
mod properties;
mod readme;
mod record;
mod remote;
mod report_page;
mod response;
mod run;
mod rust;
mod safety;
mod terminal;
mod two_joints;
mod verdict;
mod wiring;
