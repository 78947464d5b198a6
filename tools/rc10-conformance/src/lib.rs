//! Rules that every motor of [`rc10_motor`] keeps, as tests for a motor of your own: [`check`] puts it and its simulated device on a wire and runs all of them, and [`check_line`]
//! those that do not speak of CAN frames on a motor of an RS-485 line. [`Bench`] and [`LineBench`]
//! are for tests of what only your motor does. A [`Dummy`] is a motor without a device.
//!
//! * [`RULES`]: the list. The documentation and what is run are the same table.
//! * [`Declaration`]: what your motor says it can do, with a [`Trial`] for each kind of target, and a
//!   reason for what it cannot ([`Claim::Cannot`]).
//! * [`Report`]: every [`Breach`] with the rule, what happened, and when in virtual time.
//!
//! The motors of `rc10-motor` are checked in `tests/conformance.rs`; `tests/rule_breakers.rs` has a
//! motor that breaks each rule. `docs/add-a-motor.md` leads from a manual to a motor that passes.
//!
//! ```
//! use rc10_app::{Amps, NewtonMetres, Rpm};
//! use rc10_conformance::{Claim, Declaration, RULES, Trial, check};
//! use rc10_motor::Target;
//! use rc10_motor::dji::{self, Dji, M3508};
//! use rc10_sim::{EscConfig, Model};
//!
//! let declared = Declaration::new([1, 2], Rpm::new(100.0), NewtonMetres::new(6.0))
//!     .with_trials(&[Trial::new(Target::Speed(Rpm::new(200.0)), 5.0, 1000)]);
//! let declared = Declaration { disables: Claim::Cannot("it has no enable command"), ..declared };
//! let report = check(
//!     &declared,
//!     |id| Dji::new(dji::Config::new(&M3508, id)).unwrap(),
//!     |wire, id| wire.add_esc(EscConfig::new(Model::C620, id)).unwrap(),
//! )
//! .unwrap_err();
//! // It takes currents and angles too, which the declaration does not try.
//! assert_eq!(report.broken().next(), Some("every-target-is-tried"));
//! assert!(RULES.iter().any(|rule| rule.name == "every-target-is-tried"));
//! ```
#![forbid(unsafe_code)]

mod bench;
mod case;
mod check;
mod declaration;
mod dummy;
mod harness;
mod line_bench;
mod mirror;
mod outcome;
mod recorder;
mod report;
mod rig;
mod rules;

pub use bench::Bench;
pub use check::{check, check_line};
pub use declaration::{Claim, Declaration, Trial};
pub use dummy::{Acts, Dummy};
pub use line_bench::LineBench;
pub use report::{Breach, Report};
pub use rules::{RULES, Rule};
