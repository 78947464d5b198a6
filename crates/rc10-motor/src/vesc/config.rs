//! Identifier, scale and limits of a VESC, as they are set in it.

use core::num::NonZeroU8;

use rc10_app::{
    Amps, Cascade, ConfigError, CountsPerTurn, Direction, ElectricalRpm, Gear, Rpm, ok,
};
use rc10_can::IdPattern;
use rc10_time::Micros;

use super::wire::{EVERY, Packet, STATUSES, Status, VescId};
use crate::can_ids::{CanIds, Frames, Guard, Ownership, Rate};
use crate::shaft::Shaft;

/// Below this it regulates no speed, as sold: `s_pid_min_erpm` in bldc's `mcconf_default.h`.
pub const DEFAULT_MINIMUM: ElectricalRpm = ElectricalRpm::new(900.0);

/// Tachometer steps per electrical turn: one per commutation step (`comm_can.md`, `STATUS_5`).
const STEPS_PER_ELECTRICAL_TURN: u32 = 6;

/// Pole pairs and gear from electrical turns to the output shaft, and the slowest speed.
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
pub struct ElectricalScale {
    /// Half the magnet poles.
    pub pole_pairs: NonZeroU8,
    /// From the motor to the output shaft.
    pub gear: Gear,
    minimum: ElectricalRpm,
}

impl ElectricalScale {
    /// A motor with half its magnet poles as pole pairs, and the firmware's own minimum speed.
    pub const fn new(pole_pairs: NonZeroU8, gear: Gear) -> Self {
        Self { pole_pairs, gear, minimum: DEFAULT_MINIMUM }
    }

    /// With the minimum that is set in the VESC ("Minimum ERPM" of its speed controller).
    #[must_use]
    pub const fn with_minimum(self, minimum: ElectricalRpm) -> Self {
        Self { minimum, ..self }
    }

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

    /// Whether this speed is regulated. At slower ones the motor is free or drags.
    pub fn regulates(&self, output: Rpm) -> bool {
        // False for NaN.
        self.to_electrical(output).get().abs() >= self.minimum.get()
    }

    /// Tachometer steps per turn of the output shaft. The tachometer goes round after 2³² of them.
    pub fn steps_per_turn(&self) -> CountsPerTurn {
        // At most 6 · 255 · 65,535: fits.
        let pairs = u32::from(self.pole_pairs.get());
        let steps = STEPS_PER_ELECTRICAL_TURN * pairs * self.gear.rotor_turns();
        CountsPerTurn::new(steps, self.gear.output_turns())
    }
}

/// Below this rate of `STATUS`, in Hz, the [`Condition`](crate::Condition) is `SlowFeedback`.
pub const CONTROL_HZ: u16 = 200;

/// Rates of the status frames, in Hz, as set in VESC Tool; 0: never.
///
/// VESC Tool knows two rates, and for each the frames that come with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

    /// The rate of the frame that says this.
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

    const fn check(&self, encoder_on_shaft: bool) -> Result<(), ConfigError> {
        const FIELDS: [&str; 6] =
            ["status_1", "status_2", "status_3", "status_4", "status_5", "status_6"];
        let (mut at, rates) = (1, self.all());
        let fastest = rates[0];
        let is_good = fastest >= 1 && fastest <= 1000;
        ok!(ConfigError::check(is_good, FIELDS[0], fastest as f32, "1 to 1000 Hz"));
        while at < rates.len() {
            let must_be = "at most as often as `status_1`";
            let is_good = rates[at] <= fastest;
            ok!(ConfigError::check(is_good, FIELDS[at], rates[at] as f32, must_be));
            at += 1;
        }
        let seen = !encoder_on_shaft || self.status_4 > 0;
        let must_be = "above 0 with `encoder_on_shaft`";
        ConfigError::check(seen, FIELDS[3], self.status_4 as f32, must_be)
    }

    /// In the order of their numbers.
    pub const fn all(&self) -> [u16; 6] {
        let &Self { status_1, status_2, status_3, status_4, status_5, status_6 } = self;
        [status_1, status_2, status_3, status_4, status_5, status_6]
    }
}

/// The currents that a motor may be given, each in amperes of the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Currents {
    /// The largest, either way, above 0; at most "Motor Current Max" and "... Max Brake".
    pub limit: Amps,
    /// The current of [`DriveMode::Brake`](crate::DriveMode::Brake), 0 ..= `limit`.
    pub brake: Amps,
    /// The current of [`DriveMode::Hold`](crate::DriveMode::Hold), 0 ..= `limit`. It heats.
    pub handbrake: Amps,
}

/// A VESC as it is set up, to be checked by [`Vesc::new`](super::Vesc::new).
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Config {
    /// The id set in it: 0 to 254.
    pub id: u8,
    /// Pole pairs, gear, slowest regulated speed.
    pub scale: ElectricalScale,
    /// Which way the output shaft counts.
    pub direction: Direction,
    /// The rates of its status frames.
    pub status: StatusRates,
    /// The rate of repeated commands, 1 ..= 1000 Hz, and three times within the timeout.
    pub command_hz: u16,
    /// The timeout set in it ("Timeout" under App Settings), after which it lets go.
    pub timeout: Micros,
    /// The currents that the motor may be given.
    pub currents: Currents,
    /// Whether an encoder on the output shaft tells its position controller the angle: only then it
    /// gets [`Target::Angle`](crate::Target::Angle) (`SET_POS`). It needs `STATUS_4`.
    pub encoder_on_shaft: bool,
    /// Motor Current Max, as set in it, to send currents as shares of that (`SET_CURRENT_REL`,
    /// `SET_CURRENT_BRAKE_REL`, `SET_CURRENT_HANDBRAKE_REL`); at least `currents.limit`. The VESC
    /// gives that share of what it allows at the time: less when it is hot, when its battery is
    /// low, and after a [`Request::CurrentLimit`](crate::Request::CurrentLimit). Only
    /// [targets](crate::Target) are sent so: safe states and angle loops of ours need amperes.
    pub relative_to: Option<Amps>,
    /// Our own number, from which a PING comes. No VESC of the bus may have it.
    pub asker: VescId,
    /// Angle loops on our side, which ask the VESC for a current: it then takes
    /// [`Target::TotalAngle`](crate::Target::TotalAngle), and [`Target::Angle`](crate::Target::Angle)
    /// also without an encoder on its shaft. Efforts of the cascade are amperes. The motor needs hall
    /// sensors or an encoder: sensorless it has no torque at rest. It stands as still as the tachometer
    /// is fine: a step is 60 degrees of the field. `status_5` has to come at [`CONTROL_HZ`] or more.
    pub angle_loops: Option<Cascade>,
}

impl Config {
    /// Forward, [`StatusRates::CONTROL`], commands at 200 Hz, 200 ms timeout, amperes, asker 254.
    pub const fn new(id: u8, scale: ElectricalScale, currents: Currents) -> Self {
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
            angle_loops: None,
        }
    }

    /// With [angle loops on our side](Self::angle_loops).
    pub const fn with_angle_loops(self, cascade: Cascade) -> Self {
        Self { angle_loops: Some(cascade), ..self }
    }

    pub(crate) const fn check(&self) -> Result<(), ConfigError> {
        ok!(self.vesc_id());
        ok!(self.status.check(self.encoder_on_shaft));
        let commands = self.command_hz;
        let is_good = commands >= 1 && commands <= 1000;
        ok!(ConfigError::check(is_good, "command_hz", commands as f32, "1 to 1000 Hz"));
        let timeout = self.timeout.get();
        let is_good = timeout.saturating_mul(commands as u64) >= 3_000_000;
        let must_be = "three periods of `command_hz` or more (seconds)";
        ok!(ConfigError::check(is_good, "timeout", timeout as f32 * 1e-6, must_be));
        let Currents { limit, brake, handbrake } = self.currents;
        let limit = limit.get();
        let is_good = limit > 0.0 && limit.is_finite();
        ok!(ConfigError::check(is_good, "limit", limit, "finite and positive"));
        let is_good = brake.get() >= 0.0 && brake.get() <= limit;
        ok!(ConfigError::check(is_good, "brake", brake.get(), "0 to `limit`"));
        let is_good = handbrake.get() >= 0.0 && handbrake.get() <= limit;
        ok!(ConfigError::check(is_good, "handbrake", handbrake.get(), "0 to `limit`"));
        let minimum = self.scale.minimum.get();
        let is_good = minimum >= 0.0 && minimum.is_finite();
        ok!(ConfigError::check(is_good, "minimum", minimum, "finite, not negative"));
        if let Some(full) = self.relative_to {
            let is_good = full.get() >= limit && full.get().is_finite();
            let must_be = "finite, `limit` or more";
            ok!(ConfigError::check(is_good, "relative_to", full.get(), must_be));
        }
        let asker = self.asker.get();
        let must_be = "another number than `id`";
        ok!(ConfigError::check(asker != self.id, "asker", asker as f32, must_be));
        let Some(cascade) = &self.angle_loops else { return Ok(()) };
        let rate = self.status.status_5;
        let must_be = "200 Hz or more, to seek angles by";
        ok!(ConfigError::check(rate >= CONTROL_HZ, "status_5", rate as f32, must_be));
        cascade.validate()
    }

    pub(super) const fn vesc_id(&self) -> Result<VescId, ConfigError> {
        match VescId::new(self.id) {
            Some(id) => Ok(id),
            None => Err(ConfigError::new("id", self.id as f32, "0 to 254 (255 is every VESC)")),
        }
    }

    /// The identifiers it occupies on its bus. Of a configuration that is [valid](Self::validate).
    pub const fn can_ids(&self) -> CanIds {
        let mut ids = CanIds::new();
        let (mut at, rates) = (0, self.status.all());
        while at < rates.len() {
            if rates[at] > 0 {
                let status = packet(STATUSES[at], self.id);
                ids = ids.receives(Frames::new(status, 8, Rate::Hz(rates[at])));
            }
            at += 1;
        }
        let from = Guard { byte: 0, mask: 0xFF, value: self.id };
        let pong = Frames::new(packet(Packet::Pong, self.asker.get()), 2, Rate::Rare);
        let limits = packet(Packet::ConfCurrentLimits, self.id);
        let command = Frames::new(commands(self.id), 4, Rate::Hz(self.command_hz));
        ids.receives(pong.owned(Ownership::Guard(from)))
            .transmits(command.with_leading(COMMANDS))
            .transmits(Frames::new(packet(Packet::Ping, self.id), 1, Rate::Rare))
            .transmits(Frames::new(limits, 8, Rate::Rare))
            .listens_to(commands(EVERY))
    }
}

const fn packet(packet: Packet, id: u8) -> IdPattern {
    IdPattern::extended((packet.number() as u32) << 8 | id as u32)
}

/// First bits of the commands that move the motor: packets 0 to 15, of which a handbrake's is 12.
const COMMANDS: u8 = 17;

/// All commands to one VESC, or to all.
const fn commands(id: u8) -> IdPattern {
    IdPattern::extended(id as u32).under(0x1FFF_00FF)
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
