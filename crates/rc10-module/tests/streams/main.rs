//! Every serial protocol in streams as they are: split anywhere, with garbage, damage and faults.
#![allow(clippy::cast_possible_truncation, reason = "streams of a test are short")]
#![allow(clippy::float_cmp, reason = "numbers that are exact")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod checks;
#[path = "../../../rc10-message/tests/clock/mod.rs"]
mod clock;
mod example;
mod faults;
#[path = "wires/wren.rs"]
mod made_up;
mod observed;
mod port;
mod silence;
mod wire;
mod wires;

use checks::{anything, damage, garbage_between as garbage, splits};
use faults::faults;
use made_up::Wren;
use wires::{Action, Crsf, Dbus, Jrt, Rc9, Referee, RmVision, Sbus, Stp23l, TfMini, Vt03, Wit};

/// A test for each check of each protocol.
macro_rules! protocols {
    ($($name:ident: $wire:ident, $($check:ident)+;)+) => {$(
        mod $name {
            $(
                #[test]
                fn $check() {
                    crate::$check(crate::$wire);
                }
            )+
        }
    )+};
}

protocols! {
    action: Action, splits garbage damage anything faults;
    crsf: Crsf, splits garbage damage anything faults;
    dbus: Dbus, splits anything faults;
    jrt: Jrt, splits garbage damage anything faults;
    rc9: Rc9, splits garbage damage anything faults;
    referee: Referee, splits garbage damage anything faults;
    rm_vision: RmVision, splits garbage damage anything faults;
    sbus: Sbus, splits garbage damage anything faults;
    stp23l: Stp23l, splits garbage damage anything faults;
    tfmini: TfMini, splits garbage damage anything faults;
    vt03: Vt03, splits garbage damage anything faults;
    wit: Wit, splits garbage damage anything faults;
    wren: Wren, splits garbage damage anything faults;
}
