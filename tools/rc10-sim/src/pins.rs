//! What a robot brings at single pins: servos and voltages.

use std::cell::Cell;
use std::convert::Infallible;
use std::fmt;
use std::rc::Rc;

use embedded_hal::pwm::{ErrorType, SetDutyCycle};

/// From one pulse of a servo to the next, µs.
const PERIOD: u16 = 20_000;

/// A servo's wire: the pulse that the servo is told. It is also the output that tells it, whose duty is the pulse
/// in microseconds, of 20,000. All its clones are the same wire.
///
/// ```
/// use embedded_hal::pwm::SetDutyCycle;
/// let servo = rc10_sim::Servo::default();
/// assert_eq!(servo.pulse(), None);
/// let Ok(()) = servo.clone().set_duty_cycle(1500);
/// assert_eq!(servo.pulse(), Some(1500.0));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Servo(Rc<Cell<Option<f64>>>);

impl Servo {
    /// The newest pulse, µs; `None` while there are no pulses.
    pub fn pulse(&self) -> Option<f64> {
        self.0.get()
    }

    /// An emulated chip's pin sends pulses of so many microseconds, or none, from now on.
    pub fn tell(&self, micros: Option<f64>) {
        self.0.set(micros);
    }
}

impl ErrorType for Servo {
    type Error = Infallible;
}

impl SetDutyCycle for Servo {
    fn max_duty_cycle(&self) -> u16 {
        PERIOD
    }

    fn set_duty_cycle(&mut self, micros: u16) -> Result<(), Infallible> {
        // As the chip's output bounds it.
        self.tell((micros != 0).then(|| f64::from(micros.clamp(500, 2500))));
        Ok(())
    }
}

/// A voltage that a robot measures: of a potentiometer on a shaft, of a range finder.
#[derive(Clone)]
pub struct Voltage(Rc<dyn Fn() -> f64>);

impl Voltage {
    /// The voltage that a function gives whenever it is looked at, volts.
    pub fn new(volts: impl Fn() -> f64 + 'static) -> Self {
        Self(Rc::new(volts))
    }

    /// The voltage now.
    pub fn volts(&self) -> f64 {
        (self.0)()
    }

    /// The same, as the chip's input reads it.
    #[expect(
        clippy::unused_async,
        clippy::cast_possible_truncation,
        reason = "that one waits for its converter, and reads less exactly"
    )]
    pub async fn read(&mut self) -> Option<f32> {
        Some(self.volts() as f32)
    }
}

impl fmt::Debug for Voltage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} V", self.volts())
    }
}
