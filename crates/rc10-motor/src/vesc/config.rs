//! Identifier, scale and limits of a VESC, as they are set in it.

use core::fmt;
use core::num::NonZeroU8;

use rc10_app::{Amps, ConfigError, CountsPerTurn, Direction, ElectricalRpm, Gear, Rpm};
use rc10_can::Micros;

use super::wire::Status;
use crate::shaft::Shaft;

/// The number a VESC is set to: 0 ..= 254.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VescId(u8);

/// The id that every VESC listens to.
pub(super) const EVERY: u8 = 255;

impl VescId {
    /// The highest number: 254.
    pub const LAST: Self = Self(EVERY - 1);

    /// `None` for 255, which means all of them.
    pub const fn new(id: u8) -> Option<Self> {
        if id == EVERY { None } else { Some(Self(id)) }
    }

    /// The number.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl fmt::Display for VescId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Below this a VESC does not regulate speed, unless it is set otherwise: `s_pid_min_erpm` in
/// bldc's `mcconf_default.h`.
pub const DEFAULT_MINIMUM: ElectricalRpm = ElectricalRpm::new(900.0);

/// Tachometer steps per electrical turn: one per commutation step (`comm_can.md`, `STATUS_5`).
const STEPS_PER_ELECTRICAL_TURN: u32 = 6;

/// Pole pairs and gear between electrical turns and the output shaft, and the slowest speed that is
/// regulated.
///
/// ```
/// use core::num::NonZeroU8;
/// use rc10_app::{Gear, Rpm};
/// use rc10_motor::vesc::{ElectricalRpm, ElectricalScale};
/// let scale = ElectricalScale::new(NonZeroU8::new(7).unwrap(), Gear::DIRECT);
/// assert_eq!(scale.to_electrical(Rpm::new(3000.0)), ElectricalRpm::new(21_000.0));
/// assert!(!scale.regulates(Rpm::new(128.0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ElectricalScale {
    pole_pairs: NonZeroU8,
    gear: Gear,
    minimum: ElectricalRpm,
}

impl ElectricalScale {
    /// Of a motor with these pole pairs (half its magnet poles) behind a gearbox, with the
    /// firmware's own minimum speed.
    pub const fn new(pole_pairs: NonZeroU8, gear: Gear) -> Self {
        Self { pole_pairs, gear, minimum: DEFAULT_MINIMUM }
    }

    /// With the minimum that is set in the VESC ("Minimum ERPM" of its speed controller).
    #[must_use]
    pub const fn with_minimum(mut self, minimum: ElectricalRpm) -> Self {
        self.minimum = minimum;
        self
    }

    /// Electrical turns per turn of the rotor.
    pub(super) fn pole_pairs(&self) -> f32 {
        self.pole_pairs.get().into()
    }

    /// The output shaft, counted by tachometer steps.
    pub(super) fn shaft(&self, direction: Direction) -> Shaft {
        let steps = STEPS_PER_ELECTRICAL_TURN * u32::from(self.pole_pairs.get());
        Shaft::new(steps, self.gear, direction)
    }

    /// The electrical speed at a speed of the output shaft.
    pub fn to_electrical(&self, output: Rpm) -> ElectricalRpm {
        ElectricalRpm::new(output.get() * (self.gear.ratio() * self.pole_pairs()))
    }

    /// The output shaft's speed at an electrical speed.
    pub fn to_output(&self, electrical: ElectricalRpm) -> Rpm {
        Rpm::new(electrical.get() / (self.gear.ratio() * self.pole_pairs()))
    }

    /// Whether the VESC regulates this speed of the output shaft. Slower ones it does not, standing
    /// still among them: the motor is left free or drags, and holds nothing.
    pub fn regulates(&self, output: Rpm) -> bool {
        // False for NaN.
        self.to_electrical(output).get().abs() >= self.minimum.get()
    }

    /// Tachometer steps per turn of the output shaft. The tachometer itself goes round after 2³²
    /// of them.
    pub fn steps_per_turn(&self) -> CountsPerTurn {
        // At most 6 · 255 · 65,535: fits.
        let pairs = u32::from(self.pole_pairs.get());
        let steps = STEPS_PER_ELECTRICAL_TURN * pairs * self.gear.rotor_turns();
        CountsPerTurn::new(steps, self.gear.output_turns())
    }
}

/// Below this rate of `STATUS`, in Hz, a motor is not controlled well: its
/// [`Condition`](crate::Condition) is `SlowFeedback`.
pub const CONTROL_HZ: u16 = 200;

/// Rates of the status frames, in Hz, as set in VESC Tool; 0: never.
///
/// VESC Tool knows two rates, and for each the frames that come with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StatusRates {
    /// `STATUS`: speed, current, duty. Without it a motor is not there.
    pub status_1: u16,
    /// `STATUS_2`: ampere hours.
    pub status_2: u16,
    /// `STATUS_3`: watt hours.
    pub status_3: u16,
    /// `STATUS_4`: temperatures, and the angle of the position controller.
    pub status_4: u16,
    /// `STATUS_5`: tachometer and supply voltage. Without it there is no angle.
    pub status_5: u16,
    /// `STATUS_6`: inputs; from firmware 6.00 on.
    pub status_6: u16,
}

impl StatusRates {
    /// Rate 1: `STATUS` and `STATUS_5` at 200 Hz. Rate 2: `STATUS_4` at 10 Hz.
    pub const CONTROL: Self = Self {
        status_1: CONTROL_HZ,
        status_2: 0,
        status_3: 0,
        status_4: 10,
        status_5: CONTROL_HZ,
        status_6: 0,
    };

    /// Of the frame that says this.
    pub(super) const fn of(&self, status: &Status) -> u16 {
        match status {
            Status::Motion { .. } => self.status_1,
            Status::AmpHours { .. } => self.status_2,
            Status::WattHours { .. } => self.status_3,
            Status::Temperatures { .. } => self.status_4,
            Status::Tachometer { .. } => self.status_5,
            Status::Inputs { .. } => self.status_6,
        }
    }

    /// In the order of their numbers.
    pub const fn all(&self) -> [u16; 6] {
        let &Self { status_1, status_2, status_3, status_4, status_5, status_6 } = self;
        [status_1, status_2, status_3, status_4, status_5, status_6]
    }
}

/// The currents that a motor may be given, each in amperes of the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Currents {
    /// Never more than this, either way. At most what "Motor Current Max" and "Motor Current Max
    /// Brake" in VESC Tool both allow. Above 0.
    pub limit: Amps,
    /// The current of [`DriveMode::Brake`](crate::DriveMode::Brake), 0 ..= `limit`.
    pub brake: Amps,
    /// The current of [`DriveMode::Hold`](crate::DriveMode::Hold), 0 ..= `limit`. It flows as long
    /// as the shaft is held, and heats.
    pub handbrake: Amps,
}

/// A VESC as it is set up, to be checked by [`Vesc::new`](super::Vesc::new).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// The id set in it.
    pub id: VescId,
    /// Pole pairs, gear, slowest regulated speed.
    pub scale: ElectricalScale,
    /// Which way the output shaft counts.
    pub direction: Direction,
    /// The rates of its status frames.
    pub status: StatusRates,
    /// The rate at which a command is repeated, in Hz: 1 ..= 1000, and three times within the
    /// timeout.
    pub command_hz: u16,
    /// The timeout set in it ("Timeout" under App Settings): it lets go when commands stop for this
    /// time.
    pub timeout: Micros,
    /// The currents that the motor may be given.
    pub currents: Currents,
    /// Whether its position controller knows the angle of the output shaft, by an encoder that sits
    /// there: only then is a [`Target::Angle`](crate::Target::Angle) left to it (`SET_POS`).
    /// `STATUS_4` is needed to see that angle.
    pub encoder_on_shaft: bool,
    /// Motor Current Max, as set in it, to send currents as shares of that (`SET_CURRENT_REL`,
    /// `SET_CURRENT_BRAKE_REL`, `SET_CURRENT_HANDBRAKE_REL`); at least `currents.limit`. The VESC
    /// gives that share of what it allows at the time: less when it is hot, when its battery is
    /// low, and after a [`Request::CurrentLimit`](crate::Request::CurrentLimit). Only
    /// [targets](crate::Target) are sent so: safe states and angle loops of ours need amperes.
    pub relative_to: Option<Amps>,
    /// Our own number, from which a PING comes. No VESC of the bus may have it.
    pub asker: VescId,
}

impl Config {
    /// Turning forward, [`StatusRates::CONTROL`], commands at 200 Hz, a timeout of 200 ms, no
    /// encoder on the output shaft, currents in amperes, asked by number 254.
    pub const fn new(id: VescId, scale: ElectricalScale, currents: Currents) -> Self {
        Self {
            id,
            scale,
            direction: Direction::Forward,
            status: StatusRates::CONTROL,
            command_hz: 200,
            timeout: Micros::from_millis(200),
            currents,
            encoder_on_shaft: false,
            relative_to: None,
            asker: VescId::LAST,
        }
    }

    /// Whether every field can be used.
    ///
    /// # Errors
    /// The first field that cannot, and what it must be.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let check = ConfigError::check;
        let status = self.status;
        let fastest = status.status_1;
        check((1..=1000).contains(&fastest), "status_1", fastest.into(), "1 to 1000 Hz")?;
        let [_, others @ ..] = status.all();
        let names = ["status_2", "status_3", "status_4", "status_5", "status_6"];
        for (name, rate) in names.into_iter().zip(others) {
            check(rate <= fastest, name, rate.into(), "at most as often as `status_1`")?;
        }
        let commands = self.command_hz;
        check((1..=1000).contains(&commands), "command_hz", commands.into(), "1 to 1000 Hz")?;
        #[expect(clippy::cast_precision_loss, reason = "for a message")]
        let timeout = self.timeout.get() as f32 * 1e-6;
        let repeated = self.timeout.get().saturating_mul(commands.into()) >= 3_000_000;
        check(repeated, "timeout", timeout, "three periods of `command_hz` or more (seconds)")?;
        let Currents { limit, brake, handbrake } = self.currents;
        let limit = limit.get();
        check(limit > 0.0 && limit.is_finite(), "limit", limit, "finite and positive")?;
        for (name, amps) in [("brake", brake.get()), ("handbrake", handbrake.get())] {
            check((0.0..=limit).contains(&amps), name, amps, "0 to `limit`")?;
        }
        let minimum = self.scale.minimum.get();
        check(minimum >= 0.0 && minimum.is_finite(), "minimum", minimum, "finite, not negative")?;
        let seen = !self.encoder_on_shaft || status.status_4 > 0;
        check(seen, "status_4", status.status_4.into(), "above 0 with `encoder_on_shaft`")?;
        let full = self.relative_to.map_or(limit, Amps::get);
        check(full >= limit && full.is_finite(), "relative_to", full, "finite, `limit` or more")?;
        let own = f32::from(self.asker.get());
        check(self.asker != self.id, "asker", own, "another number than `id`")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(pole_pairs: u8, gear: Gear) -> ElectricalScale {
        ElectricalScale::new(NonZeroU8::new(pole_pairs).unwrap(), gear)
    }

    #[test]
    fn electrical_speed_is_speed_times_pole_pairs_times_gear() {
        let planetary = Gear::new(3591, 187).unwrap();
        for (pole_pairs, gear, output, electrical) in [
            (7, Gear::DIRECT, 3000.0, 21_000.0),
            (14, Gear::DIRECT, -1500.0, -21_000.0),
            (4, Gear::DIRECT, 12_345.0, 49_380.0),
            (7, planetary, 187.0, 25_137.0),
        ] {
            let scale = scale(pole_pairs, gear);
            let there = scale.to_electrical(Rpm::new(output)).get();
            assert!((there - electrical).abs() <= 1e-6 * electrical.abs(), "{there}");
            let back = scale.to_output(ElectricalRpm::new(electrical)).get();
            assert!((back - output).abs() <= 1e-6 * output.abs(), "{back}");
        }
    }

    #[test]
    fn slow_speeds_are_known_to_be_unregulated() {
        let wheel = scale(7, Gear::DIRECT);
        for (rpm, regulated) in
            [(0.0, false), (128.5, false), (-128.5, false), (129.0, true), (-129.0, true)]
        {
            assert_eq!(wheel.regulates(Rpm::new(rpm)), regulated, "{rpm}");
        }
        assert!(!wheel.regulates(Rpm::new(f32::NAN)));
        let set = wheel.with_minimum(ElectricalRpm::new(70.0));
        assert!(set.regulates(Rpm::new(10.0)) && !set.regulates(Rpm::new(9.9)));
    }

    #[test]
    fn six_steps_of_the_tachometer_are_an_electrical_turn() {
        assert_eq!(scale(7, Gear::DIRECT).steps_per_turn(), CountsPerTurn::new(42, 1));
        let geared = scale(7, Gear::new(3591, 187).unwrap());
        assert_eq!(geared.steps_per_turn(), CountsPerTurn::new(42 * 3591, 187));
    }
}
