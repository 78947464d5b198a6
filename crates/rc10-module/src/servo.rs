//! Hobby servos: an angle is the width of a pulse, 50 times a second. Nothing comes back.
//!
//! The output is a [`SetDutyCycle`] whose duty is the pulse in microseconds, of a period of 20,000.

use embedded_hal::pwm::SetDutyCycle;
use rc10_app::{ConfigError, Degrees};

/// What a servo gets while the robot is not armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WhenDisarmed {
    /// The last pulse: it holds where it is.
    Hold,
    /// No pulse: most servos let go, some hold.
    NoPulse,
}

/// Settings of a servo: which angle is which pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Two different angles, with their pulses: 500 to 2500 µs. It never goes beyond them.
    pub ends: [(Degrees, u16); 2],
    /// What it gets while the robot is not armed.
    pub when_disarmed: WhenDisarmed,
}

impl Config {
    /// Checks the numbers.
    pub const fn check(&self) -> Result<(), ConfigError> {
        let [(from, first), (to, last)] = self.ends;
        let range = to.get() - from.get();
        if !range.is_finite() || range == 0.0 {
            return Err(ConfigError::new("ends", to.get(), "an angle other than the first one"));
        }
        let wrong = if 500 <= first && first <= 2500 { last } else { first };
        let is_pulse = 500 <= wrong && wrong <= 2500;
        ConfigError::check(is_pulse, "ends", wrong as f32, "a pulse of 500 to 2500 us")
    }

    /// The pulse of an angle, µs; `None` for one that is not finite.
    #[must_use]
    pub fn pulse(&self, angle: Degrees) -> Option<u16> {
        let [(from, first), (to, last)] = self.ends;
        let share = (angle - from).get() / (to - from).get();
        let (first, last) = (f32::from(first), f32::from(last));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "500 to 2500")]
        let pulse = |share: f32| (first + (last - first) * share.clamp(0.0, 1.0) + 0.5) as u16;
        angle.get().is_finite().then(|| pulse(share))
    }
}

/// A servo. It gets no pulse before its first angle, and none after a restart of the chip, whichever it is.
///
/// ```
/// use rc10_module::rc10_app::Degrees;
/// use rc10_module::servo::{Config, Servo, WhenDisarmed};
/// # let (output, is_armed) = (rc10_sim::Servo::default(), true);
/// const GRIPPER: Config = Config {
///     ends: [(Degrees::new(0.0), 1000), (Degrees::new(90.0), 2000)],
///     when_disarmed: WhenDisarmed::Hold,
/// };
/// # let seen = output.clone();
/// let mut gripper = Servo::new(output, GRIPPER)?;
/// // In a task, every period.
/// gripper.drive(Some(Degrees::new(45.0)), is_armed);
/// # assert_eq!(seen.pulse(), Some(1500.0));
/// # Ok::<(), rc10_module::rc10_app::ConfigError>(())
/// ```
#[derive(Debug)]
pub struct Servo<P> {
    output: P,
    config: Config,
}

impl<P: SetDutyCycle> Servo<P> {
    /// A servo without a pulse.
    ///
    /// # Errors
    /// If the settings are no servo's.
    pub fn new(output: P, config: Config) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self { output, config })
    }

    /// Sends it to an angle, if the robot is armed, or lets it go by `None`. An angle that is not finite changes
    /// nothing, nor does an output that fails.
    pub fn drive(&mut self, angle: Option<Degrees>, is_armed: bool) {
        let pulse = match (is_armed, self.config.when_disarmed) {
            (true, _) => angle.map_or(Some(0), |angle| self.config.pulse(angle)),
            (false, WhenDisarmed::Hold) => None,
            (false, WhenDisarmed::NoPulse) => Some(0),
        };
        if let Some(pulse) = pulse {
            let _ = self.output.set_duty_cycle(pulse);
        }
    }
}
