//! Limits that the models are sold with.

use crate::mit::Limits;

/// A model and its factory limits. They are settings (registers 21 to 23), and what the vendor
/// ships has changed over the years: compare them with the registers before moving anything.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model {
    /// As the vendor writes it.
    pub name: &'static str,
    /// PMAX, VMAX and TMAX.
    pub limits: Limits,
}

macro_rules! models {
    ($($(#[$note:meta])* $model:ident, $name:literal: $p:literal, $v:literal, $t:literal;)*) => {
        $(
            #[doc = concat!(
                $name, ": ±", stringify!($p), " rad, ±", stringify!($v), " rad/s, ±",
                stringify!($t), " N m."
            )]
            $(#[$note])*
            pub const $model: Model = Model { name: $name, limits: Limits::of($p, $v, $t) };
        )*

        /// All of them.
        pub const ALL: &[Model] = &[$($model),*];
    };
}

// PMAX, VMAX, TMAX. Source: the vendor's dm-tools of 2025, with what its older DM_CAN says where
// that differs; JH11: openarm and damiao-motor 1.0.6.
models! {
    J3507, "DM-J3507": 12.566, 50.0, 5.0;
    J4310, "DM-J4310": 12.5, 30.0, 10.0;
    J4310_48V, "DM-J4310-48V": 12.5, 50.0, 10.0;
    /// Older: 8 rad/s.
    J4340, "DM-J4340": 12.5, 10.0, 28.0;
    /// Older: 10 rad/s.
    J4340_48V, "DM-J4340-48V": 12.5, 20.0, 28.0;
    /// Older: 20 N m.
    J6006, "DM-J6006": 12.5, 45.0, 12.0;
    J6248, "DM-J6248": 12.566, 20.0, 120.0;
    /// Older: 40 N m.
    J8006, "DM-J8006": 12.5, 45.0, 20.0;
    J8009, "DM-J8009": 12.5, 45.0, 54.0;
    J10010L, "DM-J10010L": 12.5, 25.0, 200.0;
    J10010, "DM-J10010": 12.5, 20.0, 200.0;
    H3510, "DM-H3510": 12.5, 280.0, 1.0;
    H6215, "DM-H6215": 12.5, 45.0, 10.0;
    G6220, "DM-G6220": 12.5, 45.0, 10.0;
    JH11, "DM-JH11": 12.5, 10.0, 12.0;
    S3519, "DM-S3519": 12.5, 2000.0, 2.0;
}

#[cfg(test)]
mod tests {
    #[test]
    fn all_limits_can_be_used() {
        for model in super::ALL {
            assert_eq!(model.limits.checked(), Ok(model.limits), "{}", model.name);
        }
    }
}
