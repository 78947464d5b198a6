//! What a robot leaves to a PC: channels, which it drives by while a switch of the remote says so.

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use rc10_app::{RobotFrame, Twist};
use rc10_link::commands::{COMMAND_AGE, Head};
use rc10_link::frame::{FromPc, Said, WithCommands};
use rc10_link::{Ask, Declaration};
use rc10_module::Protocol;
use rc10_motor::ArmState;
use rc10_time::Micros;

use super::RobotView;
use super::own::Signal;
use super::parameters::Refusal;

/// A channel that is not commanded for this long is lost: the next command must be neutral.
pub const LOST: Micros = Micros::from_millis(100);

/// What a robot hears of a PC: its questions, and commands if it has an [`Auto`]. Of `()`, which has none, there is
/// nothing in its program.
pub trait Commanded {
    /// The protocol of what it hears.
    type Protocol: Protocol;
    /// The same.
    const PROTOCOL: Self::Protocol;

    /// Takes a command, or says by its number and a reason that it is refused; hands a question on.
    fn hear(
        &self,
        said: <Self::Protocol as Protocol>::Message,
        robot: &RobotView<'_>,
        ask: impl FnOnce(Ask),
        refuse: impl FnOnce(u16, &'static str),
    );
}

impl Commanded for () {
    type Protocol = FromPc;
    const PROTOCOL: FromPc = FromPc;

    #[inline]
    fn hear(
        &self,
        said: Ask,
        _: &RobotView<'_>,
        ask: impl FnOnce(Ask),
        _: impl FnOnce(u16, &'static str),
    ) {
        ask(said);
    }
}

/// Channels that a PC may command while the robot is armed: [`live!`](crate::live!) declares them.
///
/// A command counts for 50 ms from when it was made. It is refused, and the PC is told why, if it is older, comes
/// twice or after a newer one, has a number that is not finite, or comes from a second program while the first one
/// commands. After a loss, and after each arming, the first one must be neutral: all zero. What is beyond the limits
/// is limited. All is counted.
///
/// **A PC never arms the robot**, and what a channel says is what the robot's task makes of it.
#[derive(Debug)]
pub struct Auto<const N: usize> {
    channels: [AutoChannel; N],
    state: Signal,
    counts: [Signal; 2],
    /// What is known of each channel.
    known: Mutex<CriticalSectionRawMutex, Cell<[Known; N]>>,
}

/// A channel: a speed or an effort, of which zero is rest.
#[derive(Debug)]
pub struct AutoChannel {
    newest: Signal,
    most: f32,
}

impl AutoChannel {
    /// One with a label, a unit, and the most that it takes in both directions.
    ///
    /// # Panics
    /// If that is not above zero and finite; in a `const` that is a compile error.
    #[must_use]
    pub const fn new(label: &'static str, unit: &'static str, most: f32) -> Self {
        assert!(most > 0.0 && most.is_finite(), "a channel takes at most a number above zero");
        Self { newest: Signal::new(label, unit), most }
    }
}

/// The newest command of a channel.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    value: f32,
    /// When it was made.
    born: Micros,
    /// When it was taken; `None` if the next one must be neutral.
    taken: Option<Micros>,
    /// Whether there was one at all.
    was_taken: bool,
    who: u32,
    count: u32,
}

impl Known {
    fn commands(&self, now: Micros) -> bool {
        self.taken.is_some_and(|taken| now.since(taken) < LOST)
    }
}

/// Who drives, as a PC sees it.
const STATES: &str = "by hand,no command,commanded";

impl<const N: usize> Auto<N> {
    /// One that has heard no command.
    #[must_use]
    pub const fn new(channels: [AutoChannel; N]) -> Self {
        let known = Known {
            value: 0.0,
            born: Micros::ZERO,
            taken: None,
            was_taken: false,
            who: 0,
            count: 0,
        };
        Self {
            channels,
            state: Signal::state("auto", STATES),
            counts: [
                Signal::counter("auto refused", "commands"),
                Signal::counter("auto limited", "commands"),
            ],
            known: Mutex::new(Cell::new([known; N])),
        }
    }

    /// The newest values if `is_auto`, as a switch of the remote says; zero for a channel whose command is 50 ms old.
    /// By hand it has no values: call it in each step all the same, for it tells a PC who drives.
    pub fn values(&self, is_auto: bool) -> Option<[f32; N]> {
        let now = rc10_message::now();
        let known = self.known.lock(Cell::get);
        let mut is_commanded = false;
        let mut values = [0.0; N];
        for ((known, channel), value) in known.iter().zip(&self.channels).zip(&mut values) {
            if known.taken.is_some() && now.since(known.born).get() < COMMAND_AGE {
                (*value, is_commanded) = (known.value, true);
            } else {
                channel.newest.set(f32::NAN);
            }
        }
        self.state.set(if is_auto { f32::from(1 + u8::from(is_commanded)) } else { 0.0 });
        is_auto.then_some(values)
    }

    /// The same as a twist, of a robot whose first three channels are one.
    pub fn twist(&self, is_auto: bool) -> Option<Twist<RobotFrame>> {
        const { assert!(N >= 3, "a twist has three channels") };
        self.values(is_auto).map(|values| Twist::new(values[0], values[1], values[2]))
    }

    /// Its signals: the newest command of each channel, who drives, and what was refused and limited.
    pub fn signals<'l>(&'l self, see: &mut dyn FnMut(&'l Signal)) {
        self.channels.iter().map(|it| &it.newest).for_each(&mut *see);
        see(&self.state);
        self.counts.iter().for_each(see);
    }

    /// Takes the body of a command, or says why not.
    fn take(
        &self,
        known: &mut [Known; N],
        body: &[u8],
        robot: Declaration,
        is_armed: bool,
        now: Micros,
    ) -> Result<(), (u16, &'static str)> {
        let taken = match Head::of(body) {
            Err(id) => Err((id, "a command of another version or length")),
            Ok((head, _)) if head.declaration != robot => Err((head.id, Refusal::ANOTHER.why)),
            Ok((head, words)) => {
                let taken = self.take_words(known, &head, words, is_armed, now);
                taken.map_err(|why| (head.id, why))
            }
        };
        if taken.is_err() {
            self.counts[0].count();
        }
        taken
    }

    fn take_words(
        &self,
        all: &mut [Known; N],
        head: &Head,
        words: &[[u8; 4]],
        is_armed: bool,
        now: Micros,
    ) -> Result<(), &'static str> {
        if !is_armed {
            // What is heard before is not what the robot begins with.
            all.iter_mut().for_each(|it| it.taken = None);
            return Err("the robot is not armed");
        }
        let channels = usize::from(head.first)..usize::from(head.first) + words.len();
        let (Some(known), Some(channels)) =
            (all.get_mut(channels.clone()), self.channels.get(channels))
        else {
            return Err("there is no such channel");
        };
        let values = || words.iter().map(|word| f32::from_le_bytes(*word));
        if !values().all(f32::is_finite) {
            return Err("a number that is not finite");
        }
        // A robot that was restarted since has told a later time than it has now.
        let age = now.get().wrapping_sub(head.heard).saturating_add(u64::from(head.age) * 1000);
        if age >= COMMAND_AGE {
            return Err("it is older than 50 ms");
        }
        let is_same = |it: &Known| it.who == head.who;
        if known.iter().any(|it| it.commands(now) && !is_same(it)) {
            return Err("another program commands");
        }
        let is_next = |it: &Known| (1..1 << 31).contains(&head.count.wrapping_sub(it.count));
        if known.iter().any(|it| is_same(it) && it.was_taken && !is_next(it)) {
            return Err("it came twice, or after a newer one");
        }
        let goes_on = known.iter().all(|it| it.commands(now) && is_same(it));
        if !goes_on && values().any(|value| value.abs() > 0.0) {
            return Err("the first command after a loss must be neutral: all zero");
        }
        let share = |(value, it): (f32, &AutoChannel)| (it.most / value.abs()).min(1.0);
        let share = values().zip(channels).map(share).fold(1.0, f32::min);
        if share < 1.0 {
            self.counts[1].count();
        }
        for ((value, known), channel) in values().zip(known).zip(channels) {
            let (value, born) = (value * share, Micros::new(now.get().saturating_sub(age)));
            let (who, count) = (head.who, head.count);
            *known = Known { value, born, taken: Some(now), was_taken: true, who, count };
            channel.newest.set(value);
        }
        Ok(())
    }
}

impl<const N: usize> Commanded for &Auto<N> {
    type Protocol = WithCommands;
    const PROTOCOL: WithCommands = WithCommands;

    fn hear(
        &self,
        said: Said,
        robot: &RobotView<'_>,
        ask: impl FnOnce(Ask),
        refuse: impl FnOnce(u16, &'static str),
    ) {
        let body = match said {
            Said::Ask(said) => return ask(said),
            Said::Command(body) => body,
        };
        let is_armed = robot.switch.state() == ArmState::Armed;
        let taken = self.known.lock(|cell| {
            let (mut known, now) = (cell.get(), rc10_message::now());
            let taken = self.take(&mut known, &body, robot.declaration, is_armed, now);
            cell.set(known);
            taken
        });
        if let Err((id, why)) = taken {
            refuse(id, why);
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "it compares what was told")]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    /// A command of a program, at this time, on a robot that is armed.
    #[derive(Clone, Copy)]
    struct Told {
        head: Head,
        values: [f32; 3],
        now: u64,
        is_armed: bool,
    }

    const NEUTRAL: Told = Told {
        head: Head {
            id: 7,
            declaration: Declaration(1),
            heard: 1_000_000,
            age: 0,
            first: 0,
            who: 1,
            count: 1,
        },
        values: [0.0; 3],
        now: 1_001_000,
        is_armed: true,
    };

    impl Told {
        /// The next one of the same program, 20 ms later.
        fn next(self, values: [f32; 3]) -> Self {
            let head =
                Head { count: self.head.count + 1, heard: self.head.heard + 20_000, ..self.head };
            Self { head, values, now: self.now + 20_000, ..self }
        }

        fn body(&self) -> Vec<u8> {
            let values = self.values.iter().flat_map(|it| it.to_le_bytes());
            self.head.bytes().into_iter().chain(values).collect()
        }

        fn to(&self, robot: &mut Heard) -> Result<(), (u16, &'static str)> {
            let (robot, known) = (&robot.0, &mut robot.1);
            robot.take(known, &self.body(), Declaration(1), self.is_armed, Micros::new(self.now))
        }
    }

    /// Channels, and what is known of them: a lock needs a chip or a simulator.
    struct Heard(Auto<4>, [Known; 4]);

    impl Default for Heard {
        fn default() -> Self {
            Self(Auto::new(channels()), [Known::default(); 4])
        }
    }

    const fn channels() -> [AutoChannel; 4] {
        [
            AutoChannel::new("auto vx", "m/s", 2.0),
            AutoChannel::new("auto vy", "m/s", 2.0),
            AutoChannel::new("auto wz", "rad/s", 4.0),
            AutoChannel::new("auto turret", "rpm", 30.0),
        ]
    }

    fn newest(Heard(auto, _): &Heard) -> [f32; 3] {
        [0, 1, 2].map(|at| auto.channels[at].newest.get())
    }

    #[test]
    fn what_is_wrong_is_refused_with_its_reason_and_counted() {
        let mut auto = Heard::default();
        assert_eq!(NEUTRAL.to(&mut auto), Ok(()));
        let good = NEUTRAL.next([1.0, 0.0, 0.0]);
        assert_eq!(good.to(&mut auto), Ok(()));
        let next = good.next([0.5, 0.0, 0.0]);
        let head = next.head;
        let finite = "a number that is not finite";
        let twice = "it came twice, or after a newer one";
        let old = "it is older than 50 ms";
        let wrong = [
            (good, twice),
            (Told { head: Head { count: 1, ..head }, ..next }, twice),
            (Told { values: [f32::NAN, 0.0, 0.0], ..next }, finite),
            (Told { values: [0.0, f32::INFINITY, 0.0], ..next }, finite),
            (Told { head: Head { age: 50, ..head }, ..next }, old),
            (Told { head: Head { heard: head.heard - 49_000, ..head }, ..next }, old),
            (Told { head: Head { heard: next.now + 1, ..head }, ..next }, old),
            (Told { head: Head { who: 2, ..head }, ..next }, "another program commands"),
            (Told { head: Head { first: 2, ..head }, ..next }, "there is no such channel"),
            (
                Told { head: Head { declaration: Declaration(2), ..head }, ..next },
                Refusal::ANOTHER.why,
            ),
        ];
        for (at, (told, why)) in wrong.into_iter().enumerate() {
            assert_eq!(told.to(&mut auto), Err((7, why)), "{at}");
            assert_eq!(newest(&auto), [1.0, 0.0, 0.0], "{at}");
            assert_eq!(auto.0.counts[0].get(), at as f32 + 1.0);
        }
        // What comes in another shape has its number where that is in all of them.
        let body = next.body();
        let mut newer = body.clone();
        newer[1] = 2;
        for wrong in [&body[..body.len() - 1], &body[..20], &newer] {
            let refused =
                auto.0.take(&mut auto.1, wrong, Declaration(1), true, Micros::new(next.now));
            assert_eq!(refused, Err((7, "a command of another version or length")));
        }
        assert_eq!(next.to(&mut auto), Ok(()));
        assert_eq!(newest(&auto), [0.5, 0.0, 0.0]);
    }

    /// After a silence, after an arming, and of another program.
    #[test]
    fn the_first_command_after_a_loss_is_neutral() {
        let mut auto = Heard::default();
        let neutral = "the first command after a loss must be neutral: all zero";
        let moving = NEUTRAL.next([1.0, 0.0, 0.0]);
        assert_eq!(moving.to(&mut auto), Err((7, neutral)));
        assert_eq!(moving.next([0.0; 3]).to(&mut auto), Ok(()));
        let moving = moving.next([0.0; 3]).next([1.0; 3]);
        assert_eq!(moving.to(&mut auto), Ok(()));
        let mut late = moving.next([1.0; 3]);
        (late.now, late.head.heard) = (moving.now + 100_000, moving.now + 99_000);
        assert_eq!(late.to(&mut auto), Err((7, neutral)));
        let other = Told { head: Head { who: 2, ..late.head }, ..late };
        assert_eq!(other.to(&mut auto), Err((7, neutral)));
        assert_eq!(Told { values: [0.0; 3], ..other }.to(&mut auto), Ok(()));
        assert_eq!(other.next([1.0; 3]).to(&mut auto), Ok(()));
        // Disarmed, and armed again.
        let off = Told { is_armed: false, ..other.next([1.0; 3]).next([0.0; 3]) };
        assert_eq!(off.to(&mut auto), Err((7, "the robot is not armed")));
        let on = Told { is_armed: true, ..off.next([1.0; 3]) };
        assert_eq!(on.to(&mut auto), Err((7, neutral)));
    }

    #[test]
    fn what_is_beyond_a_limit_keeps_its_direction() {
        let mut auto = Heard::default();
        assert_eq!(NEUTRAL.to(&mut auto), Ok(()));
        assert_eq!(NEUTRAL.next([4.0, 1.0, 0.0]).to(&mut auto), Ok(()));
        assert_eq!((newest(&auto), auto.0.counts[1].get()), ([2.0, 0.5, 0.0], 1.0));
        assert_eq!(NEUTRAL.next([0.0; 3]).next([1e6, 0.0, -1e6]).to(&mut auto), Ok(()));
        assert_eq!(newest(&auto), [2.0, 0.0, -2.0]);
    }
}
