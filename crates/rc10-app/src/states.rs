/// Gives an enum a list of its states (`ALL`), and their names (`NAMES`), in the order of their numbers. One
/// that is left out, or in another order, does not compile.
///
/// ```
/// enum Door {
///     Shut,
///     Open,
/// }
/// rc10_app::states!(Door: Shut, Open);
/// assert_eq!((Door::NAMES, Door::ALL.len()), ("Shut,Open", 2));
/// ```
#[macro_export]
macro_rules! states {
    ($State:ident: $first:ident $(, $name:ident)*) => {
        impl $State {
            /// All states, in the order of their numbers.
            pub const ALL: &'static [Self] = &[Self::$first $(, Self::$name)*];
            /// Names of the states in that order, with commas between.
            pub const NAMES: &'static str = concat!(stringify!($first) $(, ",", stringify!($name))*);
        }

        const _: () = {
            match $State::$first {
                $State::$first $(| $State::$name)* => {}
            }
            let mut at = 0;
            $(
                at += 1;
                assert!($State::$name as usize == at);
            )*
            assert!(at + 1 == $State::ALL.len());
        };
    };
}
