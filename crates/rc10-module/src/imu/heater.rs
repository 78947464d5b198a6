//! Heats an IMU's die to a steady temperature, so that its bias stays what it was when it was learned.
//!
//! The heater is resistors on the supply: its power goes with the square of the voltage, and at full duty it is
//! more than they bear (DM-MC02: 47 ohms, 12 W at 24 V). So the loop asks for a power, and its share of time
//! follows from the measured voltage. It is off whenever the temperature or the voltage is not known.

use rc10_app::{PidConfig, PidState, Seconds};

/// A heater: what is soldered on, and how warm the die shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeaterConfig {
    /// Resistance, ohms.
    pub resistance: f32,
    /// The largest share of time for which it may be on, thousandths.
    pub most: u16,
    /// The largest mean power, W.
    pub most_power: f32,
    /// Temperature of the die, °C: some degrees above what it reaches without.
    pub target: f32,
}

/// The loop, in W by °C, for a die that 3 W warms by 20 degrees within minutes, without overshoot
/// (`tests/heater.rs`): back-calculation, because the power is bounded, a little less setpoint in
/// the proportional part, and a filter for steps of an eighth of a degree.
const LOOP: PidConfig = PidConfig {
    setpoint_weight: 0.95,
    derivative_filter: Seconds::new(5.0),
    tracking: 0.05,
    ..PidConfig::within(f32::INFINITY).kp(0.4).ki(0.004).kd(4.0)
};
/// A die outside of these does not exist, °C: the sensor's operating range (BMI088 data sheet, 1).
const PLAUSIBLE: core::ops::RangeInclusive<f32> = -40.0..=85.0;
/// Supplies outside of these do not exist, V: below, a heater would not help; above, the board is broken.
const SUPPLIES: core::ops::RangeInclusive<f32> = 9.0..=30.0;

/// The loop that heats. Feed it with what is known now: a value that is too old is not known.
#[derive(Clone, Copy, Debug)]
pub struct Heater {
    config: HeaterConfig,
    power: PidState,
}

impl Heater {
    /// A cold one.
    #[must_use]
    pub const fn new(config: HeaterConfig) -> Self {
        Self { config, power: PidState::new() }
    }

    /// The share of time to heat, thousandths, by the die's °C and the supply's V, if known.
    pub fn update(&mut self, temperature: Option<f32>, supply: Option<f32>, step: Seconds) -> u16 {
        let known = temperature
            .filter(|now| PLAUSIBLE.contains(now))
            .zip(supply.filter(|volts| SUPPLIES.contains(volts)));
        let Some((temperature, volts)) = known else {
            self.power = PidState::new();
            return 0;
        };
        let HeaterConfig { resistance, most, most_power, target } = self.config;
        let full = volts * volts / resistance;
        let share = f32::from(most) / 1000.0;
        let bound = most_power.min(full * share);
        // The integral makes up for what the proportional part does not see of the setpoint.
        let unseen = LOOP.kp * (1.0 - LOOP.setpoint_weight) * target;
        let bounded = PidConfig { output_limit: bound, integral_limit: bound + unseen, ..LOOP };
        let wanted = self.power.update(&bounded, target, temperature, 0.0, step);
        // It cannot cool: what it lacks while the board is too hot is not remembered.
        if wanted < 0.0 && self.power.integral() < unseen {
            self.power.preset(unseen);
        }
        let power = wanted.max(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "0 ..= 1000")]
        let share = (power / full * 1000.0) as u16;
        share.min(most)
    }
}
