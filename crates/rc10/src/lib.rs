//! A robot of one's own, by one dependency and one `use`.
//!
//! * [`robot!`] declares what it has: motors, parts on serial ports, contacts.
//! * [`Program`](prelude::Program) says what it does.
//! * [`prelude`] has the names that most robots need; [`app`], [`motor`], [`module`], [`message`], [`tasks`] and
//!   [`time`] have all.
//!
//! ```
//! use rc10::prelude::*;
//!
//! rc10::robot! {
//!     motors {
//!         WheelLeft: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
//!         WheelRight: Dji = Entry::new(Bus(1), Config::new(&M3508, 2).with_direction(Direction::Reversed)),
//!     }
//! }
//!
//! impl Program for Robot {
//!     async fn run(shared: &Shared<'_>) -> ! {
//!         let (mut arming, mut every) = (Arming::of::<Self>(), Every::millis(10));
//!         loop {
//!             every.next().await;
//!             if let Some(remote) = shared.obey(&mut arming) {
//!                 shared.command(Name::WheelLeft, Target::Speed(Rpm::new(400.0 * remote.left.y)));
//!                 shared.command(Name::WheelRight, Target::Speed(Rpm::new(400.0 * remote.right.y)));
//!             }
//!         }
//!     }
//! }
//! ```
//!
//! Its feature `sim`, for a PC, has the simulator, the emulated chip and the command line in `sim`.
#![no_std]
#![forbid(unsafe_code)]

pub use rc10_tasks::{live, robot};
pub use {
    embassy_futures::join, embedded_io_async as io, rc10_app as app, rc10_message as message,
    rc10_module as module, rc10_motor as motor, rc10_tasks as tasks, rc10_time as time,
};

/// The names that most robots need.
pub mod prelude {
    pub use rc10_app::{
        Amps, Base, Body, Cascade, Degrees, Direction, FeedForward, Gear, NewtonMetres, PidConfig,
        Rpm, RpmPerSecond, Seconds, TotalAngle, Twist, TwistLimits,
    };
    pub use rc10_message::{Every, Latest, now};
    pub use rc10_module::Reception;
    pub use rc10_module::remote::{Receiver, Remote, Switch};
    pub use rc10_motor::Place::{Bus, Line};
    pub use rc10_motor::dji::{Config, Dji, GM6020_CURRENT, GM6020_VOLTAGE, M2006, M3508};
    pub use rc10_motor::{ArmState, Entry, Names, Request, Safety, Target};
    pub use rc10_tasks::{
        Arming, ArmingConfig, Axis, BaseDriver, Drive, DrivenBase, DrivenSwerve, Program,
    };
    pub use rc10_time::Micros;
}

/// The robot on a PC: simulator, emulated chip, command line.
#[cfg(feature = "sim")]
pub mod sim {
    pub use rc10_cli::*;
    pub use rc10_sim as simulator;

    /// The names that most descriptions need.
    pub mod prelude {
        pub use rc10_cli::robot::remote::ScriptLine;
        pub use rc10_cli::{
            ArmPart, Base, ContactPart, Description, Partner, Plant, RemoteControl, Shape,
            Simulated, Twin,
        };
        pub use rc10_sim::remote::{Controls, Stick, Switch};
        pub use rc10_sim::{ArmLink, Closed, Nonlinear};
        pub use rc10_time::Micros;
    }
}

/// Pages of `docs` about a robot: their examples are compiled and run.
#[cfg(all(doctest, feature = "sim"))]
mod pages {
    #[doc = include_str!("../../../docs/declaration.md")]
    mod declaration {}
    #[doc = include_str!("../../../docs/two-boards.md")]
    mod two_boards {}
    #[doc = include_str!("../../../docs/two-boards.zh-CN.md")]
    mod two_boards_in_chinese {}
    #[doc = include_str!("../../../docs/rust.md")]
    mod rust {}
    #[doc = include_str!("../../../docs/from-cpp.md")]
    mod from_cpp {}
    #[doc = include_str!("../../../docs/rust.zh-CN.md")]
    mod rust_in_chinese {}
    #[doc = include_str!("../../../docs/from-cpp.zh-CN.md")]
    mod from_cpp_in_chinese {}
}
