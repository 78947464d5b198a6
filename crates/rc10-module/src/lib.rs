//! Parts that are no motors: remotes, laser ranging, IMUs, positioning, LED strips.
//!
//! **Parsers do no input and output.** A [`Protocol`] says what bytes are; a [`Stream`] finds its
//! frames. **One driver loop serves every serial device**: [`listen`] reads any
//! [`embedded_io_async::Read`] and hands over messages; what was lost stands in [`Reception`].
//!
//! This crate knows no board and no motors. `docs/modules` has a page for each device.
//!
//! # In a firmware of your own
//!
//! A task listens, and keeps what it hears with its time; a reader says how old it may be:
//!
//! ```
//! use embedded_io_async::Read;
//! use rc10_message::Latest;
//! use rc10_module::rc10_time::Micros;
//! use rc10_module::ranging::{Range, TfMini};
//! use rc10_module::{Reception, listen};
//!
//! /// How far the wall is, and when that was measured.
//! static WALL: Latest<Range, 1> = Latest::new();
//! /// What was heard, and what was lost on the wire.
//! static RECEPTION: Reception = Reception::new();
//!
//! /// A task. `port` is a UART of any HAL, set as the device's page says (115,200 baud 8N1).
//! async fn laser(port: impl Read) -> ! {
//!     listen(port, TfMini, &RECEPTION, |measured, at| WALL.set(measured.range(), at)).await
//! }
//!
//! /// It measures every 10 ms: after five missing values the distance is not known.
//! fn wall(now: Micros) -> Option<u32> {
//!     match WALL.newer_than(Micros::from_millis(50), now)? {
//!         Range::Distance(millimetres) => Some(millimetres),
//!         // It measured, and found nothing, or doubts it: no distance either.
//!         Range::OutOfRange | Range::Unreliable(_) | Range::Fault(_) => None,
//!     }
//! }
//! # mod wire { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/docs/wire.rs")); }
//! # let said = &[7, 7, 0x59, 0x59, 0x7B, 0x00, 0xD7, 0x11, 0x90, 0x09, 0xAE];
//! # let mut world = rc10_sim::World::new(1);
//! # let mut task = core::pin::pin!(laser(wire::Wire(said)));
//! # assert_eq!(wall(world.now()), None);
//! # let mut run = |millis| {
//! #     let _ = world.run(task.as_mut(), Micros::from_millis(millis));
//! #     world.now()
//! # };
//!
//! // A frame behind two bytes of noise; then the plug is pulled.
//! let now = run(1);
//! assert_eq!(wall(now), Some(1230));
//! assert_eq!((RECEPTION.read().frames, RECEPTION.read().skipped), (1, 2));
//! let now = run(60);
//! assert_eq!(wall(now), None);
//! ```
//!
//! A remote is the same with [`remote::listen`]; [`remote::Watch`] says how fresh it is. The binary
//! brings an `embassy_time` driver and a [`critical_section`](https://docs.rs/critical-section).
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod encoder;
pub mod imu;
pub mod led;
pub mod limit_switch;
mod listen;
pub mod positioning;
pub mod ranging;
pub mod referee;
pub mod remote;
pub mod servo;
pub mod store;
mod stream;
mod sum;
pub mod vision;

pub use listen::{Reception, listen};
pub use stream::{Buffer, Counters, Found, Pause, Protocol, Stream};
// Whose types stand in what devices say: who uses the crate needs no other.
pub use {rc10_app, rc10_time};
