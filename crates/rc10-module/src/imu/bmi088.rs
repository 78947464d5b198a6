//! Bosch BMI088: accelerometer and gyroscope on one SPI bus, each with a chip select.
//!
//! Source: Bosch's BST-BMI088-DS001 (1.3, 2018; sections below); times: `BMI08x_SensorAPI`.
//!
//! * SPI mode 0 or 3, 10 MHz at most, the address first; its bit 7 is set for reading (6.1).
//! * The accelerometer sends a byte of nothing first (6.1.2), and wakes in I²C, suspended (4.1).
//! * The gyroscope is ready 30 ms after a reset (4.8), the accelerometer after 1.
//!
//! One [`read`](Bmi088::read) is three transfers of 61 bytes, 50 µs at 10 MHz: all of the
//! gyroscope, all of the accelerometer, and two of its settings. So a sample is only given if the
//! chips are there, run, and are set as told: after a brown-out the scale would change without a
//! word. Chips whose clock or noise stands still are an error, too.
//!
//! Address and data are one transfer: with two, an STM32H7 with `TSIZE` = 0 was seen to clock on
//! behind the first, which shifts the answer by a bit (Zephyr issue 66326, PR 66503).
//!
//! Where a DMA cannot read all memory, the SPI device must copy.

use core::fmt;

use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::SpiDevice;

use super::{GRAVITY, Sample};

mod registers;

use registers::Setting;
pub use registers::{AccelerationFilter, AccelerationRange, AccelerationRate, Config};
pub use registers::{RotationBandwidth, RotationRange};

/// One of the two chips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Part {
    /// The accelerometer.
    Accelerometer,
    /// The gyroscope.
    Gyroscope,
}

impl Part {
    /// The chip's identity, as its register has it (5.3.1, 5.5.1).
    #[must_use]
    pub const fn chip_id(self) -> u8 {
        match self {
            Self::Accelerometer => 0x1E,
            Self::Gyroscope => 0x0F,
        }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Accelerometer => "BMI088 accelerometer",
            Self::Gyroscope => "BMI088 gyroscope",
        })
    }
}

/// There is no sample, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Error<E> {
    /// The SPI bus failed.
    #[error("SPI to the {0} failed: {1:?}")]
    Spi(Part, E),
    /// Something else answers, or nothing.
    #[error("the {part} says it is {read:#04x}, not {:#04x}: {}", .part.chip_id(), cause(*.read))]
    WrongChip {
        /// The chip that was asked.
        part: Part,
        /// The value read where [`Part::chip_id`] should be.
        read: u8,
    },
    /// A setting is not what was written: not taken, or lost since.
    #[error(
        "the {part} has {read:#04x} in register {register:#04x}, not {wrote:#04x}: did it lose its \
         supply?"
    )]
    NotKept {
        /// The chip with the setting.
        part: Part,
        /// The register.
        register: u8,
        /// The value that was written.
        wrote: u8,
        /// The value that the register has.
        read: u8,
    },
    /// The accelerometer says that it does not work: its `ACC_ERR_REG` (5.3.2).
    #[error("the BMI088 accelerometer reports an error of its own: {errors:#04x}")]
    Broken {
        /// The value of `ACC_ERR_REG`.
        errors: u8,
    },
    /// The chip stands still: each reading is the same as the one before.
    #[error("the {0} measures nothing new")]
    Stuck(Part),
}

impl<E> Error<E> {
    /// The kind of error in a few words, behind "IMU": for a status line, which has no room for more.
    #[must_use]
    pub const fn words(&self) -> &'static str {
        match self {
            Self::Spi(..) => "has errors of its SPI bus",
            Self::WrongChip { read: 0x00 | 0xFF, .. } => "does not answer",
            Self::WrongChip { .. } => "is another chip, or its selects are swapped",
            Self::NotKept { .. } => "has lost its settings",
            Self::Broken { .. } => "reports an error of its own",
            Self::Stuck(_) => "measures nothing new",
        }
    }
}

/// The likely cause of a wrong identity.
const fn cause(read: u8) -> &'static str {
    match read {
        0x00 | 0xFF => "nothing answers; power, MISO, chip select?",
        _ => "chip selects swapped, or the clock too fast?",
    }
}

/// Counters of the readings, by outcome. Each starts over after 2³².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Counters {
    /// Samples given.
    pub samples: u32,
    /// Readings and starts that the SPI bus spoilt.
    pub spi_errors: u32,
    /// Those that the chips spoilt.
    pub refused: u32,
    /// Samples with an axis at the end of its range.
    pub saturated: u32,
    /// Times the chips were set up, successful or not.
    pub starts: u32,
}

/// Bytes of the longest transfer: address, a byte of nothing, and data.
const LONGEST: usize = 2 + registers::ACC_ALL;

/// Errors in a row after which the chips are set up anew.
pub const ERRORS_BEFORE_RESTART: u8 = 3;
/// Equal readings that say the gyroscope is stuck: of a hundred at 1 kHz ten are new by noise.
const EQUAL_RATES: u8 = 100;
/// Raw values from here on are the end of the range: ±32,767, and what a filter leaves of it.
const SATURATED: u16 = 32_700;

/// A BMI088 on two SPI devices: one bus, two chip selects.
///
/// ```no_run
/// # use embedded_hal_async::{delay::DelayNs, spi::SpiDevice};
/// # use rc10_module::imu::bmi088::{Bmi088, Config};
/// # async fn example<S: SpiDevice, D: DelayNs>(accelerometer: S, gyroscope: S, delay: D) {
/// let mut imu = Bmi088::new(accelerometer, gyroscope, delay, Config::default());
/// loop {
///     // Once a millisecond:
///     match imu.read().await {
///         Ok(sample) => drop(sample.rotation),
///         Err(error) => drop(error), // report it, and read on
///     }
/// }
/// # }
/// ```
#[derive(Debug)]
pub struct Bmi088<A, G, D> {
    accelerometer: A,
    gyroscope: G,
    delay: D,
    config: Config,
    is_running: bool,
    errors_in_a_row: u8,
    /// Which pair of the accelerometer's settings is looked at next.
    checks_second: bool,
    /// The accelerometer's clock, and the raw rates, as read last.
    time: [u8; 3],
    rates: [u8; 6],
    equal_rates: u8,
    counters: Counters,
}

impl<A, G, D> Bmi088<A, G, D>
where
    A: SpiDevice,
    G: SpiDevice<Error = A::Error>,
    D: DelayNs,
{
    /// A BMI088 that is not set up yet: [`read`](Self::read) does it.
    pub const fn new(accelerometer: A, gyroscope: G, delay: D, config: Config) -> Self {
        Self {
            accelerometer,
            gyroscope,
            delay,
            config,
            is_running: false,
            errors_in_a_row: 0,
            checks_second: false,
            time: [0; 3],
            rates: [0; 6],
            equal_rates: 0,
            counters: Counters { samples: 0, spi_errors: 0, refused: 0, saturated: 0, starts: 0 },
        }
    }

    /// A new sample, at the gyroscope's rate or slower. Sets the chips up at first, and after
    /// [`ERRORS_BEFORE_RESTART`] errors in a row, in 0.12 s.
    ///
    /// Dropped half-way, nothing is lost but this sample.
    ///
    /// # Errors
    /// The reason without a sample. Call again: a chip that comes back is used again.
    pub async fn read(&mut self) -> Result<Sample, Error<A::Error>> {
        let started = if self.is_running { Ok(()) } else { self.start().await };
        let result = match started {
            Ok(()) => self.sample().await,
            Err(error) => Err(error),
        };
        let counters = &mut self.counters;
        match &result {
            Ok(sample) => {
                self.errors_in_a_row = 0;
                counters.samples = counters.samples.wrapping_add(1);
                if sample.rotation_is_saturated || sample.acceleration_is_saturated {
                    counters.saturated = counters.saturated.wrapping_add(1);
                }
            }
            Err(error) => {
                self.errors_in_a_row = self.errors_in_a_row.saturating_add(1);
                if self.errors_in_a_row >= ERRORS_BEFORE_RESTART {
                    self.is_running = false;
                }
                match error {
                    Error::Spi(..) => counters.spi_errors = counters.spi_errors.wrapping_add(1),
                    _ => counters.refused = counters.refused.wrapping_add(1),
                }
            }
        }
        result
    }

    /// Counters of the readings so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// Resets both chips, sets them up, and checks that they are.
    async fn start(&mut self) -> Result<(), Error<A::Error>> {
        self.counters.starts = self.counters.starts.wrapping_add(1);
        self.is_running = false;
        self.write(Part::Accelerometer, registers::ACC_SOFTRESET, registers::RESET).await?;
        self.write(Part::Gyroscope, registers::GYRO_SOFTRESET, registers::RESET).await?;
        self.delay.delay_ms(50).await;
        // Its chip select rises: from now on it speaks SPI. What it says here means nothing.
        self.read_registers::<1>(Part::Accelerometer, registers::CHIP_ID).await?;

        let [read] = self.read_registers(Part::Accelerometer, registers::CHIP_ID).await?;
        Self::identify(Part::Accelerometer, read)?;
        let [read] = self.read_registers(Part::Gyroscope, registers::CHIP_ID).await?;
        Self::identify(Part::Gyroscope, read)?;

        let (accelerometer, gyroscope) = (self.config.accelerometer(), self.config.gyroscope());
        for setting in accelerometer.as_flattened().iter().chain(&gyroscope) {
            self.write(setting.part, setting.register, setting.value).await?;
            // A suspended accelerometer takes 0.45 ms for a write (6.1), and for waking up (4.1.1).
            self.delay.delay_ms(1).await;
        }
        // Until the filters have settled; Bosch's driver waits 5 to 50 ms.
        self.delay.delay_ms(50).await;
        for pair in accelerometer {
            self.check_accelerometer(pair).await?;
        }
        // The gyroscope's settings are read with each sample.

        self.time = self.read_registers(Part::Accelerometer, registers::TIME).await?;
        self.delay.delay_ms(1).await;
        self.equal_rates = 0;
        self.errors_in_a_row = 0;
        self.is_running = true;
        Ok(())
    }

    async fn sample(&mut self) -> Result<Sample, Error<A::Error>> {
        let gyroscope: [u8; registers::GYRO_ALL] =
            self.read_registers(Part::Gyroscope, registers::CHIP_ID).await?;
        Self::identify(Part::Gyroscope, gyroscope[0])?;
        for setting in self.config.gyroscope() {
            setting.check(gyroscope[usize::from(setting.register)])?;
        }
        let all: [u8; registers::ACC_ALL] =
            self.read_registers(Part::Accelerometer, registers::CHIP_ID).await?;
        Self::identify(Part::Accelerometer, all[0])?;
        let [errors] = part(&all, registers::ERRORS);
        if errors & registers::ERROR_BITS != 0 {
            return Err(Error::Broken { errors });
        }
        // One pair a sample, and the other only when this one was right. A brown-out changes both.
        let [first, second] = self.config.accelerometer();
        self.check_accelerometer(if self.checks_second { second } else { first }).await?;
        self.checks_second = !self.checks_second;

        let (time, rates) = (part(&all, registers::TIME), part(&gyroscope, registers::RATE));
        if core::mem::replace(&mut self.time, time) == time {
            return Err(Error::Stuck(Part::Accelerometer));
        }
        let is_equal = core::mem::replace(&mut self.rates, rates) == rates;
        self.equal_rates = if is_equal { self.equal_rates.saturating_add(1) } else { 0 };
        if self.equal_rates >= EQUAL_RATES {
            return Err(Error::Stuck(Part::Gyroscope));
        }
        let (rates, accelerations) = (raw(rates), raw(part(&all, registers::ACCELERATION)));
        let rate = self.config.rotation_range.rate_of_one();
        let acceleration = self.config.acceleration_range.g() * GRAVITY / 32_768.0;
        Ok(Sample {
            acceleration: accelerations.map(|raw| f32::from(raw) * acceleration),
            rotation: rates.map(|raw| f32::from(raw) * rate),
            temperature: registers::temperature(part(&all, registers::TEMPERATURE)),
            acceleration_is_saturated: is_saturated(accelerations),
            rotation_is_saturated: is_saturated(rates),
        })
    }

    async fn check_accelerometer(&mut self, pair: [Setting; 2]) -> Result<(), Error<A::Error>> {
        let read: [u8; 2] = self.read_registers(Part::Accelerometer, pair[0].register).await?;
        pair[0].check(read[0])?;
        pair[1].check(read[1])
    }

    async fn write(&mut self, part: Part, register: u8, value: u8) -> Result<(), Error<A::Error>> {
        let bytes = [register, value];
        let written = match part {
            Part::Accelerometer => self.accelerometer.write(&bytes).await,
            Part::Gyroscope => self.gyroscope.write(&bytes).await,
        };
        written.map_err(|error| Error::Spi(part, error))
    }

    async fn read_registers<const N: usize>(
        &mut self,
        from: Part,
        register: u8,
    ) -> Result<[u8; N], Error<A::Error>> {
        const { assert!(N <= LONGEST - 2) };
        let mut bytes = [0; LONGEST];
        bytes[0] = registers::READ | register;
        let (behind, done) = match from {
            // The second byte is that of which nothing comes back (6.1.2).
            Part::Accelerometer => {
                (2, self.accelerometer.transfer_in_place(&mut bytes[..2 + N]).await)
            }
            Part::Gyroscope => (1, self.gyroscope.transfer_in_place(&mut bytes[..1 + N]).await),
        };
        done.map_err(|error| Error::Spi(from, error)).map(|()| part(&bytes, behind))
    }

    fn identify(part: Part, read: u8) -> Result<(), Error<A::Error>> {
        if read == part.chip_id() { Ok(()) } else { Err(Error::WrongChip { part, read }) }
    }
}

/// `N` neighbours of a chip's registers, from one on.
fn part<const N: usize>(all: &[u8], register: u8) -> [u8; N] {
    core::array::from_fn(|at| all.get(usize::from(register) + at).copied().unwrap_or_default())
}

/// Three numbers of two bytes, the low one first (5.3.4, 5.5.2).
fn raw([x_low, x, y_low, y, z_low, z]: [u8; 6]) -> [i16; 3] {
    [[x_low, x], [y_low, y], [z_low, z]].map(i16::from_le_bytes)
}

fn is_saturated(raw: [i16; 3]) -> bool {
    raw.iter().any(|axis| axis.unsigned_abs() >= SATURATED)
}
