//! Jams: detected, cleared by reversing, given up after some tries.

use super::{Measured, MotorCommand, Stall, StallTimer, way};
use crate::TotalAngle;
use crate::config::{ConfigError, not_negative, positive};
use crate::ok;
use crate::profile::AngleSetpoint;
use crate::units::{Degrees, Direction, Rpm, Seconds};

/// When a motor counts as jammed, and how it is cleared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JamConfig {
    /// The stall of a motor that is to move. An effort of 0 leaves speed and following error.
    pub stall: Stall,
    /// An angle further away than this is to be moved to; 0 or more, above a load's pull.
    pub following_error: Degrees,
    /// How far it reverses from where it jammed; > 0.
    pub reverse: Degrees,
    /// Speed of reversing; > 0.
    pub reverse_speed: Rpm,
    /// Reverses no longer than this; > 0. It ends where the motor is blocked both ways.
    pub reverse_time: Seconds,
    /// How often it reverses before it gives up, counted anew `reverse` past the jam.
    pub tries: u8,
}

impl JamConfig {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(self.stall.validate(), in "stall");
        ok!(not_negative("following_error", self.following_error.get()));
        ok!(positive("reverse", self.reverse.get()));
        ok!(positive("reverse_speed", self.reverse_speed.get()));
        positive("reverse_time", self.reverse_time.get())
    }

    /// Where the motor is to turn, if it is to move.
    fn towards(&self, wanted: MotorCommand, measured: &Measured) -> Option<Direction> {
        let (amount, least) = match wanted {
            MotorCommand::Coast => return None,
            MotorCommand::Speed(speed) => (speed.get(), 0.0),
            MotorCommand::Angle(AngleSetpoint { angle, .. }) => {
                (angle.minus(measured.angle).degrees().get(), self.following_error.get())
            }
        };
        let towards = if amount < 0.0 { Direction::Reversed } else { Direction::Forward };
        (amount.abs() > least).then_some(towards)
    }
}

/// Whether a motor is jammed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum JamStatus {
    /// The motor is free.
    #[default]
    Free,
    /// The motor reverses.
    Clearing,
    /// The motor stands until [`Jam::reset`]: no try has helped.
    GivenUp,
}

/// State of the jam detection of one motor: commands go through it.
///
/// ```
/// use rc10_app::mechanism::{MotorCommand, Jam, JamConfig, JamStatus, Measured, Stall};
/// use rc10_app::{Degrees, Rpm, Seconds};
/// let time = Seconds::new(0.2);
/// let config = JamConfig {
///     stall: Stall { effort: 6.0, standstill: Rpm::new(5.0), time }, // A
///     following_error: Degrees::new(3.0),
///     reverse: Degrees::new(30.0),
///     reverse_speed: Rpm::new(60.0),
///     reverse_time: Seconds::new(0.5),
///     tries: 3,
/// };
/// assert_eq!(config.validate(), Ok(()));
/// let mut jam = Jam::new();
/// let (wanted, dt) = (MotorCommand::Speed(Rpm::new(120.0)), Seconds::new(0.01));
/// let stuck = Measured { effort: 10.0, ..Measured::default() };
/// for _ in 0..19 {
///     assert_eq!(jam.update(&config, wanted, &stuck, dt), wanted);
/// }
/// assert_eq!(jam.update(&config, wanted, &stuck, dt), MotorCommand::Speed(Rpm::new(-60.0)));
/// assert_eq!((jam.status(), jam.count()), (JamStatus::Clearing, 1));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jam {
    status: JamStatus,
    stall: StallTimer,
    /// Where the motor was to turn in the last step.
    towards: Option<Direction>,
    /// The newest jam that the motor has not passed yet: where, and which way it was to turn.
    jam: Option<(TotalAngle, Direction)>,
    /// Tries at it so far.
    tries: u8,
    /// For how long it has been reversing.
    time: f32,
    count: u32,
    command: MotorCommand,
}

impl Jam {
    /// Free.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether it is jammed.
    pub const fn status(&self) -> JamStatus {
        self.status
    }

    /// Jams detected so far; those of one place are counted each time.
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// Free again, after it has given up. The count stays.
    pub fn reset(&mut self) {
        *self = Self { count: self.count, ..Self::default() };
    }

    /// One step: `wanted` while free, else its own command. Time stands while it is unusable.
    ///
    /// A `dt` that is not finite and positive changes nothing, and the last command is returned again.
    pub fn update(
        &mut self,
        config: &JamConfig,
        wanted: MotorCommand,
        measured: &Measured,
        dt: Seconds,
    ) -> MotorCommand {
        if !dt.is_step() {
            return self.command;
        }
        let usable = measured.usable().is_ok();
        self.command = match self.status {
            JamStatus::GivenUp => MotorCommand::STOP,
            JamStatus::Free if usable => self.watch(config, wanted, measured, dt),
            JamStatus::Free => {
                self.stall = StallTimer::default();
                wanted
            }
            JamStatus::Clearing if usable => self.clear(config, wanted, measured, dt),
            JamStatus::Clearing => MotorCommand::STOP,
        };
        self.command
    }

    fn watch(
        &mut self,
        config: &JamConfig,
        wanted: MotorCommand,
        measured: &Measured,
        dt: Seconds,
    ) -> MotorCommand {
        let is_past = |(at, towards)| way(at, measured.angle, towards) > config.reverse.get();
        if self.jam.is_some_and(is_past) {
            (self.jam, self.tries) = (None, 0);
        }
        let towards = config.towards(wanted, measured);
        if towards != self.towards {
            (self.towards, self.stall) = (towards, StallTimer::default());
        }
        let stalled = self.stall.update(&config.stall, measured, towards, dt);
        let (Some(_), Some(towards)) = (stalled, towards) else {
            return wanted;
        };
        self.count = self.count.saturating_add(1);
        self.stall = StallTimer::default();
        if self.tries >= config.tries {
            self.status = JamStatus::GivenUp;
            return MotorCommand::Coast;
        }
        self.jam = Some((measured.angle, towards));
        self.tries += 1;
        self.time = 0.0;
        self.status = JamStatus::Clearing;
        reverse(config, towards)
    }

    fn clear(
        &mut self,
        config: &JamConfig,
        wanted: MotorCommand,
        measured: &Measured,
        dt: Seconds,
    ) -> MotorCommand {
        self.time += dt.get();
        let left = self.jam.filter(|(at, towards)| {
            let so_far = -way(*at, measured.angle, *towards);
            so_far < config.reverse.get() && self.time < config.reverse_time.get()
        });
        if let Some((_, towards)) = left {
            return reverse(config, towards);
        }
        (self.status, self.towards) = (JamStatus::Free, None);
        wanted
    }
}

fn reverse(config: &JamConfig, towards: Direction) -> MotorCommand {
    MotorCommand::Speed(config.reverse_speed * -f32::from(towards.sign()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: Seconds = Seconds::new(0.01);
    const CONFIG: JamConfig = JamConfig {
        stall: Stall { effort: 6.0, standstill: Rpm::new(5.0), time: Seconds::new(0.095) },
        following_error: Degrees::new(3.0),
        reverse: Degrees::new(30.0),
        reverse_speed: Rpm::new(60.0),
        reverse_time: Seconds::new(0.045),
        tries: 2,
    };
    const BACK: MotorCommand = MotorCommand::Speed(Rpm::new(-60.0));

    fn at(degrees: i32, effort: f32) -> Measured {
        Measured { angle: TotalAngle::from_degrees(degrees), effort, ..Measured::default() }
    }

    #[test]
    fn holding_a_load_is_no_jam_but_missing_an_angle_is() {
        let mut jam = Jam::new();
        let hold = MotorCommand::hold(TotalAngle::from_degrees(2));
        for _ in 0..1000 {
            assert_eq!(jam.update(&CONFIG, hold, &at(0, 19.0), DT), hold);
            assert_eq!(
                jam.update(&CONFIG, MotorCommand::STOP, &at(0, 19.0), DT),
                MotorCommand::STOP
            );
        }
        let hold = MotorCommand::hold(TotalAngle::from_degrees(4));
        // Pushing the other way is a load that helps.
        for _ in 0..1000 {
            assert_eq!(jam.update(&CONFIG, hold, &at(0, -19.0), DT), hold);
        }
        let steps = (1..).find(|_| jam.update(&CONFIG, hold, &at(0, 19.0), DT) == BACK);
        assert_eq!(steps, Some(10));
    }

    #[test]
    fn it_gives_up_after_its_tries_and_stands_until_reset() {
        let mut jam = Jam::new();
        let wanted = MotorCommand::Speed(Rpm::new(100.0));
        let run = |jam: &mut Jam| {
            let commands = core::array::from_fn(|_| jam.update(&CONFIG, wanted, &at(0, 19.0), DT));
            let commands: [MotorCommand; 100] = commands;
            commands.iter().filter(|command| **command == BACK).count()
        };
        // Blocked both ways: each try ends by its time, 5 steps.
        assert_eq!(run(&mut jam), 2 * 5);
        assert_eq!((jam.status(), jam.count()), (JamStatus::GivenUp, 3));
        assert_eq!(run(&mut jam), 0);
        assert_eq!(jam.update(&CONFIG, wanted, &at(0, 0.0), DT), MotorCommand::STOP);
        jam.reset();
        assert_eq!(run(&mut jam), 2 * 5);
        assert_eq!(jam.count(), 6);
    }

    #[test]
    fn tries_begin_anew_past_the_jam() {
        let mut jam = Jam::new();
        let wanted = MotorCommand::Speed(Rpm::new(100.0));
        for place in 0..50 {
            // Each 31 degrees further; reversing is done in one step.
            for _ in 0..10 {
                jam.update(&CONFIG, wanted, &at(31 * place, 19.0), DT);
            }
            assert_eq!(jam.status(), JamStatus::Clearing);
            assert_eq!(jam.update(&CONFIG, wanted, &at(31 * place - 30, 0.0), DT), wanted);
        }
        assert_eq!(jam.count(), 50);
        // Within 30 degrees it is the same jam.
        let mut jam = Jam::new();
        for place in 0..3 {
            for _ in 0..10 {
                jam.update(&CONFIG, wanted, &at(29 * place, 19.0), DT);
            }
            jam.update(&CONFIG, wanted, &at(29 * place - 30, 0.0), DT);
        }
        assert_eq!(jam.status(), JamStatus::GivenUp);
    }

    /// By its standstill alone, as of a motor that does not tell its effort.
    #[test]
    fn a_motor_that_is_turned_to_and_fro_is_not_jammed() {
        let stall = Stall { effort: 0.0, ..CONFIG.stall };
        let (config, stuck) = (JamConfig { stall, ..CONFIG }, at(0, 0.0));
        let [forward, back] = [100.0, -100.0].map(|rpm| MotorCommand::Speed(Rpm::new(rpm)));
        let [to, fro] = [90, -90].map(|to| MotorCommand::hold(TotalAngle::from_degrees(to)));
        for pair in [[forward, back], [back, forward], [to, fro], [forward, MotorCommand::STOP]] {
            let mut jam = Jam::new();
            for _ in 0..20 {
                for wanted in pair {
                    // One step short of a jam each time.
                    for _ in 0..9 {
                        assert_eq!(jam.update(&config, wanted, &stuck, DT), wanted);
                    }
                }
            }
            assert_eq!((jam.status(), jam.count()), (JamStatus::Free, 0), "{pair:?}");
            let mut jammed = || (1..).find(|_| jam.update(&config, pair[0], &stuck, DT) != pair[0]);
            assert_eq!(jammed(), Some(10), "{pair:?}");
        }
    }

    #[test]
    fn bad_input_changes_nothing() {
        let mut jam = Jam::new();
        let wanted = MotorCommand::Speed(Rpm::new(100.0));
        jam.update(&CONFIG, wanted, &at(0, 19.0), DT);
        let before = jam;
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            jam.update(&CONFIG, MotorCommand::Coast, &at(0, 19.0), Seconds::new(bad));
        }
        assert_eq!(jam, before);
        for _ in 0..1000 {
            assert_eq!(jam.update(&CONFIG, wanted, &at(0, f32::NAN), DT), wanted);
            let not_a_speed = MotorCommand::Speed(Rpm::new(f32::NAN));
            jam.update(&CONFIG, not_a_speed, &at(0, 19.0), DT);
        }
        assert_eq!(jam.status(), JamStatus::Free);
    }

    #[test]
    fn the_configuration_is_checked() {
        assert_eq!(CONFIG.validate(), Ok(()));
        let zero = Seconds::ZERO;
        let stall = Stall { time: zero, ..CONFIG.stall };
        for (bad, part, field) in [
            (JamConfig { stall, ..CONFIG }, "stall", "time"),
            (JamConfig { following_error: Degrees::new(-1.0), ..CONFIG }, "", "following_error"),
            (JamConfig { reverse: Degrees::ZERO, ..CONFIG }, "", "reverse"),
            (JamConfig { reverse_speed: Rpm::ZERO, ..CONFIG }, "", "reverse_speed"),
            (JamConfig { reverse_time: zero, ..CONFIG }, "", "reverse_time"),
        ] {
            let error = bad.validate().unwrap_err();
            assert_eq!((error.part, error.field), (part, field));
        }
    }
}
