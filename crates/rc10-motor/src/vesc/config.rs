//! What is set in a VESC, and what its motor on our side has to know of it.

use rc10_app::{Amps, ConfigError};
use rc10_can::Micros;

use super::{Shaft, Status, VescId};
use rc10_app::Direction;

/// Below this rate of `STATUS`, in Hz, a motor is not controlled well: its
/// [`Condition`](crate::Condition) is `SlowFeedback`.
pub const CONTROL_HZ: u16 = 200;

/// How often each status frame comes, in Hz, as set in VESC Tool; 0: never.
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
    #[inline]
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
    #[must_use]
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
    /// What [`DriveMode::Brake`](crate::DriveMode::Brake) brakes with, 0 ..= `limit`.
    pub brake: Amps,
    /// What [`DriveMode::Hold`](crate::DriveMode::Hold) holds with, 0 ..= `limit`. It flows as long as the
    /// shaft is held, and heats.
    pub handbrake: Amps,
}

/// A VESC as it is set up, to be checked by [`Vesc::new`](super::Vesc::new).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// The id set in it.
    pub id: VescId,
    /// Pole pairs, gear, slowest regulated speed.
    pub shaft: Shaft,
    /// Which way the output shaft counts.
    pub direction: Direction,
    /// How often its status frames come.
    pub status: StatusRates,
    /// How often a command is repeated, in Hz: 1 ..= 1000, and three times within the timeout.
    pub command_hz: u16,
    /// The timeout set in it ("Timeout" under App Settings): it lets go when commands stop for so
    /// long.
    pub timeout: Micros,
    /// What the motor may be given.
    pub currents: Currents,
    /// Whether its position controller knows the angle of the output shaft, by an encoder that sits
    /// there: only then is a [`Target::Angle`](crate::Target::Angle) left to it (`SET_POS`).
    /// `STATUS_4` is needed to see that angle.
    pub encoder_on_shaft: bool,
    /// Our own number: who asks, in a PING. No VESC of the bus may have it.
    pub asker: VescId,
}

impl Config {
    /// Turning forward, [`StatusRates::CONTROL`], commands at 200 Hz, a timeout of 200 ms, no
    /// encoder on the output shaft, asked by number 254.
    #[must_use]
    pub const fn new(id: VescId, shaft: Shaft, currents: Currents) -> Self {
        Self {
            id,
            shaft,
            direction: Direction::Forward,
            status: StatusRates::CONTROL,
            command_hz: 200,
            timeout: Micros::from_millis(200),
            currents,
            encoder_on_shaft: false,
            asker: VescId::LAST,
        }
    }

    /// Whether every field can be used.
    ///
    /// # Errors
    /// The first field that cannot, and what it must be.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let status = self.status;
        let fastest = status.status_1;
        check("status_1", fastest.into(), (1..=1000).contains(&fastest), "1 to 1000 Hz")?;
        let [_, others @ ..] = status.all();
        let names = ["status_2", "status_3", "status_4", "status_5", "status_6"];
        for (name, rate) in names.into_iter().zip(others) {
            check(name, rate.into(), rate <= fastest, "at most as often as `status_1`")?;
        }
        let commands = self.command_hz;
        check("command_hz", commands.into(), (1..=1000).contains(&commands), "1 to 1000 Hz")?;
        #[expect(clippy::cast_precision_loss, reason = "for a message")]
        let timeout = self.timeout.get() as f32 * 1e-6;
        let repeated = self.timeout.get().saturating_mul(commands.into()) >= 3_000_000;
        check("timeout", timeout, repeated, "three periods of `command_hz` or more (seconds)")?;
        let Currents { limit, brake, handbrake } = self.currents;
        let limit = limit.get();
        check("limit", limit, limit > 0.0 && limit.is_finite(), "finite and positive")?;
        for (name, amps) in [("brake", brake.get()), ("handbrake", handbrake.get())] {
            check(name, amps, (0.0..=limit).contains(&amps), "0 to `limit`")?;
        }
        let minimum = self.shaft.minimum().get();
        check("minimum", minimum, minimum >= 0.0 && minimum.is_finite(), "finite, not negative")?;
        let seen = !self.encoder_on_shaft || status.status_4 > 0;
        check("status_4", status.status_4.into(), seen, "above 0 with `encoder_on_shaft`")?;
        let own = f32::from(self.asker.get());
        check("asker", own, self.asker != self.id, "another number than `id`")
    }
}

pub(super) fn check(
    field: &'static str,
    value: f32,
    good: bool,
    must_be: &'static str,
) -> Result<(), ConfigError> {
    if good { Ok(()) } else { Err(ConfigError::new(field, value, must_be)) }
}
