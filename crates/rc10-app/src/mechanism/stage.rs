use super::{
    Axes, AxesFailure, AxesHoming, AxesHomingFailure, AxesHomingStatus, Feeder, Homing,
    HomingFailure, HomingStatus, Jam, JamStatus, OutOfTravel, Phase, Trouble,
};

/// The stages, and their names.
macro_rules! stages {
    ($($(#[$doc:meta])* $Stage:ident: $name:literal,)*) => {
        /// The stage of a mechanism, for people: the same words in a log, on a page and in a report.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        #[must_use]
        pub enum Stage {
            #[default]
            $($(#[$doc])* $Stage,)*
        }

        impl Stage {
            /// All of them, in order.
            pub const ALL: &[Self] = &[$(Self::$Stage),*];
            /// Their names in order, with commas between.
            pub const NAMES: &str = concat!($($name, ","),*);
        }
    };
}

stages! {
    /// Never updated yet.
    NotBegun: "not begun",
    /// [`Phase::First`].
    FirstTouch: "first touch",
    /// [`Phase::Touched`].
    Touched: "touched",
    /// [`Phase::BackOff`].
    BackOff: "backs off",
    /// [`Phase::Clear`].
    Clear: "backed off",
    /// [`Phase::Second`].
    SecondTouch: "second touch",
    /// Doing what was asked for.
    Ready: "ready",
    /// [`JamStatus::Clearing`].
    Clearing: "clears a jam",
    /// Given up: [`Trouble::Offline`].
    Offline: "motor offline",
    /// Given up: [`Trouble::Faulty`].
    Faulty: "motor faulty",
    /// Given up: [`Trouble::NotFinite`].
    NotFinite: "measures no number",
    /// Given up: [`Trouble::AngleGap`].
    AngleGap: "angle lost",
    /// Given up: time or travel ended before the first touch.
    NotTouched: "nothing touched",
    /// Given up: time or travel ended before it had backed off.
    NotBackedOff: "not backed off",
    /// Given up: time or travel ended before the second touch.
    NotTouchedAgain: "nothing touched again",
    /// Given up: [`HomingFailure::NeverOpened`].
    NeverOpened: "contact never opened",
    /// Given up: [`HomingFailure::TouchesDiffer`].
    TouchesDiffer: "touches differ",
    /// Given up: [`AxesHomingFailure::Spread`].
    Apart: "motors apart",
    /// Given up: [`AxesFailure::Lags`].
    Lags: "motors lag",
    /// Given up: [`OutOfTravel`].
    OutOfTravel: "out of its travel",
    /// Given up: [`JamStatus::GivenUp`].
    Jammed: "jammed",
}

impl Stage {
    /// Whether the mechanism gave up, and stands or coasts until it is begun anew.
    #[must_use]
    pub const fn gave_up(self) -> bool {
        self as u8 >= Self::Offline as u8
    }

    /// The name.
    ///
    /// ```
    /// use rc10_app::mechanism::Stage;
    /// assert_eq!(Stage::NeverOpened.name(), "contact never opened");
    /// ```
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.split(',').nth(self as usize).unwrap_or_default()
    }

    const fn on_the_way(phase: Phase) -> Self {
        match phase {
            Phase::First => Self::FirstTouch,
            Phase::Touched => Self::Touched,
            Phase::BackOff => Self::BackOff,
            Phase::Clear => Self::Clear,
            Phase::Second => Self::SecondTouch,
        }
    }
}

impl From<Trouble> for Stage {
    fn from(trouble: Trouble) -> Self {
        match trouble {
            Trouble::Offline => Self::Offline,
            Trouble::Faulty => Self::Faulty,
            Trouble::NotFinite => Self::NotFinite,
            Trouble::AngleGap => Self::AngleGap,
        }
    }
}

impl From<OutOfTravel> for Stage {
    fn from(_: OutOfTravel) -> Self {
        Self::OutOfTravel
    }
}

impl From<HomingFailure> for Stage {
    fn from(failure: HomingFailure) -> Self {
        use HomingFailure::{Motor, NeverOpened, PhaseTimeout, Timeout, TouchesDiffer, Travel};
        match failure {
            Motor(trouble) => trouble.into(),
            NeverOpened => Self::NeverOpened,
            TouchesDiffer { .. } => Self::TouchesDiffer,
            PhaseTimeout(phase) | Timeout(phase) | Travel(phase) => match phase {
                Phase::First => Self::NotTouched,
                Phase::Touched | Phase::BackOff | Phase::Clear => Self::NotBackedOff,
                Phase::Second => Self::NotTouchedAgain,
            },
        }
    }
}

impl Homing {
    /// The stage; [`Stage::Ready`] when it is done.
    pub fn stage(&self) -> Stage {
        match self.status() {
            HomingStatus::Running(_) if !self.has_begun() => Stage::NotBegun,
            HomingStatus::Running(phase) => Stage::on_the_way(phase),
            HomingStatus::Done { .. } => Stage::Ready,
            HomingStatus::Failed(failure) => failure.into(),
        }
    }
}

impl<const N: usize> AxesHoming<N> {
    /// The stage of the motor that is furthest behind; [`Stage::Ready`] when it is done.
    pub fn stage(&self) -> Stage {
        match self.status() {
            AxesHomingStatus::Failed(AxesHomingFailure::Motor { failure, .. }) => failure.into(),
            AxesHomingStatus::Failed(AxesHomingFailure::Spread { .. }) => Stage::Apart,
            _ => self.axes().iter().map(Homing::stage).min().unwrap_or_default(),
        }
    }
}

impl<const N: usize> Axes<N> {
    /// The stage.
    pub fn stage(&self) -> Stage {
        match self.failure() {
            None => Stage::Ready,
            Some(AxesFailure::Motor { trouble, .. }) => trouble.into(),
            Some(AxesFailure::Lags { .. }) => Stage::Lags,
        }
    }
}

impl Jam {
    /// The stage.
    pub const fn stage(&self) -> Stage {
        match self.status() {
            JamStatus::Free => Stage::Ready,
            JamStatus::Clearing => Stage::Clearing,
            JamStatus::GivenUp => Stage::Jammed,
        }
    }
}

impl Feeder {
    /// The stage.
    pub const fn stage(&self) -> Stage {
        self.jam().stage()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stage_has_a_name_and_those_that_gave_up_come_last() {
        assert_eq!(Stage::ALL.iter().filter(|stage| stage.gave_up()).count(), 13);
        assert!(Stage::ALL.is_sorted_by_key(|stage| stage.gave_up()));
        for (index, stage) in Stage::ALL.iter().enumerate() {
            let is_new = Stage::ALL[..index].iter().all(|other| other.name() != stage.name());
            assert!(is_new && !stage.name().is_empty(), "{stage:?}");
        }
    }

    #[test]
    fn a_homing_tells_where_it_is_and_why_it_ended() {
        assert_eq!(Homing::new().stage(), Stage::NotBegun);
        for (failure, stage) in [
            (HomingFailure::Motor(Trouble::AngleGap), Stage::AngleGap),
            (HomingFailure::Travel(Phase::First), Stage::NotTouched),
            (HomingFailure::PhaseTimeout(Phase::BackOff), Stage::NotBackedOff),
            (HomingFailure::Timeout(Phase::Second), Stage::NotTouchedAgain),
            (HomingFailure::NeverOpened, Stage::NeverOpened),
        ] {
            assert_eq!(Stage::from(failure), stage);
        }
    }
}
