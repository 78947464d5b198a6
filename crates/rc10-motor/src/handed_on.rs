/// Methods of a motor, in its `impl Motor`, by which it only hands on what a part of it says.
macro_rules! handed_on {
    // What stands in the brackets is of the table, and never changes.
    (state but [$($fixed:ident),*]) => {
        #[cfg(feature = "record")]
        fn save(&self, to: &mut dyn FnMut(&[u8])) {
            crate::record::save(self, to);
        }
        #[cfg(feature = "record")]
        #[allow(clippy::needless_update, reason = "a motor that has nothing but a state")]
        fn load(&mut self, from: &[u8]) -> bool {
            // It may be longer, up to a whole word.
            let saved = postcard::take_from_bytes::<Self>(from);
            saved.is_ok_and(|(it, _)| {
                *self = Self { $($fixed: self.$fixed,)* ..it };
                true
            })
        }
        #[cfg(all(feature = "record", not(target_os = "none")))]
        fn show(&self, to: &mut dyn core::fmt::Write) -> core::fmt::Result {
            writeln!(to, "{self:#?}")
        }
    };
    ($($method:ident),+ of $part:tt) => {
        $(handed_on!(@$method $part);)+
    };
    (@supports [$($part:tt)+]) => {
        fn supports(&self) -> crate::TargetSet {
            self.$($part)+.supports()
        }
    };
    (@set_target [$($part:tt)+]) => {
        fn set_target(&mut self, target: crate::Target) -> Result<(), crate::TargetError> {
            self.$($part)+.set_target(target)
        }
    };
    (@target [$($part:tt)+]) => {
        fn target(&self) -> crate::Target {
            self.$($part)+.target()
        }
    };
    (@loops [$($part:tt)+]) => {
        fn loops(&self) -> Option<crate::Loops> {
            self.$($part)+.loops().into()
        }
        fn withhold(&mut self, withheld: crate::Withheld) {
            self.$($part)+.withhold(withheld);
        }
    };
    (@fault [$($part:tt)+]) => {
        fn fault(&self) -> Option<crate::Fault> {
            self.$($part)+
        }
    };
    (@response [$($part:tt)+]) => {
        fn response(&mut self) -> Option<crate::pending::Outcome> {
            self.$($part)+.take_outcome()
        }
    };
}
