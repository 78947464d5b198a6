//! The registers of both chips (data sheet, sections 5.2 to 5.5), and what may stand in them.

use super::{Error, Part};

/// Set in the address of a register that is read (6.1).
pub const READ: u8 = 0x80;
/// The identity of the chip; on both chips.
pub const CHIP_ID: u8 = 0x00;
/// Written to a chip's `SOFTRESET`.
pub const RESET: u8 = 0xB6;

/// Accelerometer `ACC_ERR_REG` (5.3.2).
pub const ERRORS: u8 = 0x02;
/// The bits of [`ERRORS`] that mean something: `error_code` and `fatal_err`.
pub const ERROR_BITS: u8 = 0b0001_1101;
/// Accelerometer, six bytes of data (5.3.4).
pub const ACCELERATION: u8 = 0x12;
/// Accelerometer, three bytes of its clock, which counts each 39.0625 µs (5.3.5).
pub const TIME: u8 = 0x18;
/// Accelerometer, two bytes of temperature (5.3.7).
pub const TEMPERATURE: u8 = 0x22;
/// Number of the accelerometer's registers from [`CHIP_ID`] to the temperature.
pub const ACC_ALL: usize = 0x24;
const ACC_CONF: u8 = 0x40;
const ACC_RANGE: u8 = 0x41;
const ACC_PWR_CONF: u8 = 0x7C;
const ACC_PWR_CTRL: u8 = 0x7D;
/// Accelerometer (5.3.20).
pub const ACC_SOFTRESET: u8 = 0x7E;

/// Gyroscope, six bytes of data (5.5.2).
pub const RATE: u8 = 0x02;
const GYRO_RANGE: u8 = 0x0F;
const GYRO_BANDWIDTH: u8 = 0x10;
const GYRO_LPM1: u8 = 0x11;
/// Number of the gyroscope's registers from [`CHIP_ID`] to `GYRO_LPM1`.
pub const GYRO_ALL: usize = 0x12;
/// Gyroscope (5.5.7).
pub const GYRO_SOFTRESET: u8 = 0x14;

/// The accelerometer's range (5.3.10).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AccelerationRange {
    /// ±3 g.
    G3 = 0,
    /// ±6 g: a robot that hits a wall gets there.
    #[default]
    G6 = 1,
    /// ±12 g.
    G12 = 2,
    /// ±24 g.
    G24 = 3,
}

impl AccelerationRange {
    /// The end of the range, in standard gravities.
    #[must_use]
    pub const fn g(self) -> f32 {
        (3_u8 << self as u8) as f32
    }
}

/// The rate at which the accelerometer measures (5.3.9).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AccelerationRate {
    /// 100 Hz.
    Hz100 = 0x8,
    /// 200 Hz.
    Hz200 = 0x9,
    /// 400 Hz.
    Hz400 = 0xA,
    /// 800 Hz.
    Hz800 = 0xB,
    /// 1600 Hz: each of a thousand readings a second is a new one.
    #[default]
    Hz1600 = 0xC,
}

/// Smoothing by the accelerometer; at 1600 Hz 280, 234 and 145 Hz come through (4.4.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AccelerationFilter {
    /// Widest.
    Normal = 0xA,
    /// Two samples are one.
    Half = 0x9,
    /// Four samples are one: motors and wheels shake a robot.
    #[default]
    Quarter = 0x8,
}

/// The gyroscope's range (5.5.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RotationRange {
    /// ±2000 °/s: a turn in 0.18 s.
    #[default]
    Degrees2000 = 0,
    /// ±1000 °/s.
    Degrees1000 = 1,
    /// ±500 °/s.
    Degrees500 = 2,
    /// ±250 °/s.
    Degrees250 = 3,
    /// ±125 °/s.
    Degrees125 = 4,
}

impl RotationRange {
    /// The end of the range, °/s.
    #[must_use]
    pub const fn degrees(self) -> f32 {
        (2000_u16 >> self as u8) as f32
    }

    /// The rotation of a raw 1, rad/s (5.5.2: the end of the range is 32,767).
    pub const fn rate_of_one(self) -> f32 {
        self.degrees().to_radians() / 32_767.0
    }
}

/// The bandwidth of the gyroscope, and the rate at which it measures (5.5.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RotationBandwidth {
    /// 532 Hz at 2000 Hz.
    Hz532At2000 = 0,
    /// 230 Hz at 2000 Hz.
    Hz230At2000 = 1,
    /// 116 Hz at 1000 Hz.
    #[default]
    Hz116At1000 = 2,
    /// 47 Hz at 400 Hz.
    Hz47At400 = 3,
    /// 23 Hz at 200 Hz.
    Hz23At200 = 4,
    /// 12 Hz at 100 Hz.
    Hz12At100 = 5,
    /// 64 Hz at 200 Hz.
    Hz64At200 = 6,
    /// 32 Hz at 100 Hz.
    Hz32At100 = 7,
}

/// Settings of both chips. The default is right for a robot that is read at 1 kHz.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// The accelerometer's range.
    pub acceleration_range: AccelerationRange,
    /// The rate at which the accelerometer measures.
    pub acceleration_rate: AccelerationRate,
    /// The accelerometer's smoothing.
    pub acceleration_filter: AccelerationFilter,
    /// The gyroscope's range.
    pub rotation_range: RotationRange,
    /// The gyroscope's bandwidth, and the rate at which it measures.
    pub rotation_bandwidth: RotationBandwidth,
}

/// The value that a register shall have.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    pub part: Part,
    pub register: u8,
    pub value: u8,
    /// The bits of it that come back as they were written.
    mask: u8,
}

impl Setting {
    /// `Ok` if the value that was read from the register is the one that it shall have.
    pub const fn check<E>(&self, read: u8) -> Result<(), Error<E>> {
        let Self { part, register, value: wrote, mask } = *self;
        if (read ^ wrote) & mask == 0 {
            Ok(())
        } else {
            Err(Error::NotKept { part, register, wrote, read })
        }
    }
}

impl Config {
    /// The accelerometer's settings as they are written (4.1.1: awake, then on), in pairs.
    pub(super) const fn accelerometer(&self) -> [[Setting; 2]; 2] {
        const fn setting(register: u8, value: u8, mask: u8) -> Setting {
            Setting { part: Part::Accelerometer, register, value, mask }
        }
        let conf = (self.acceleration_filter as u8) << 4 | self.acceleration_rate as u8;
        [
            [setting(ACC_PWR_CONF, 0x00, 0xFF), setting(ACC_PWR_CTRL, 0x04, 0xFF)],
            [
                setting(ACC_CONF, conf, 0xFF),
                setting(ACC_RANGE, self.acceleration_range as u8, 0b0000_0011),
            ],
        ]
    }

    pub(super) const fn gyroscope(&self) -> [Setting; 3] {
        const fn setting(register: u8, value: u8, mask: u8) -> Setting {
            Setting { part: Part::Gyroscope, register, value, mask }
        }
        [
            setting(GYRO_RANGE, self.rotation_range as u8, 0b0000_0111),
            // Bit 7 is always 1.
            setting(GYRO_BANDWIDTH, 0x80 | self.rotation_bandwidth as u8, 0b0000_1111),
            // Neither suspended nor deeply so.
            setting(GYRO_LPM1, 0x00, 0b1010_0000),
        ]
    }
}

/// Temperature of two bytes, °C; `None` if the chip has none yet (5.3.7).
pub fn temperature([high, low]: [u8; 2]) -> Option<f32> {
    if high == 0x80 {
        return None;
    }
    // Eleven bits with a sign, an eighth of a degree each, from 23 °C on.
    let eighths = i16::from_be_bytes([high, low]) >> 5;
    Some(f32::from(eighths) * 0.125 + 23.0)
}
