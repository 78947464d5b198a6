/// Methods of a motor, in its `impl Motor`, by which it only hands on what a part of it says.
macro_rules! handed_on {
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
