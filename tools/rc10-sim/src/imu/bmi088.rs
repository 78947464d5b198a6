//! A Bosch BMI088 from its own side: what its two chips do with the bytes that come in while their
//! chip selects are low. It began as the model in the tests of `rc10-module`'s driver, by the same
//! reader of the data sheet BST-BMI088-DS001: it shares no code with the driver, and may share its
//! mistakes.
//!
//! Modelled: the accelerometer's way from I²C to SPI and its dummy byte, start-up and suspend
//! times, ranges, data rates, sensor time, temperature, resets. Both chips are exact but for their
//! 16 bits and a noise of one digit. Not modelled: their filters and drift, interrupts, FIFOs, the
//! self-test.
//!
//! Belief only, not measured: that the accelerometer's `ACC_CONF` and `ACC_RANGE` take nothing
//! while it is suspended; that 0x80, which says that there is no temperature, stands in the first
//! of its two bytes only; whether a reset keeps SPI ([`Chip::reset_forgets_spi`]); that
//! the 450 µs until it measures begin when it is both on and not suspended.

use crate::base::GRAVITY;
use crate::{Base, Nanos};

/// Acceleration and rotation that the sensor feels, in its own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// m/s²: gravity shows as an acceleration upwards.
    pub acceleration: [f64; 3],
    /// rad/s.
    pub rotation: [f64; 3],
}

impl Motion {
    /// Level and at rest.
    pub const REST: Self = Self { acceleration: [0.0, 0.0, GRAVITY], rotation: [0.0; 3] };

    /// Level in the middle of a base now, z up or, upside down, z down: gravity and the base's yaw rate. How the base
    /// gathers speed is left out.
    pub fn of(base: &Base) -> Self {
        let along = |value| [0.0, 0.0, base.imu_sign() * value];
        Self { acceleration: along(GRAVITY), rotation: along(base.twist().yaw) }
    }
}

/// One of the two chips in the package.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// With the temperature sensor.
    Accelerometer,
    /// The other.
    Gyroscope,
}

/// Bytes exchanged since a chip select fell, and the first of them.
#[derive(Clone, Copy, Debug, Default)]
struct Transaction {
    bytes: u8,
    address: u8,
}

/// One of the two chips: what is not as it should be, and its state.
#[derive(Clone, Debug)]
pub struct Chip {
    /// Number of the chip: 0x1E of a good accelerometer, 0x0F of a good gyroscope.
    pub id: u8,
    /// `ACC_ERR_REG`: 0 of a good one.
    pub errors: u8,
    /// A reset takes an accelerometer back to I²C: the data sheet seems to say no, users say that it
    /// does.
    pub reset_forgets_spi: bool,
    /// A register that takes nothing.
    pub deaf: Option<u8>,
    /// Whether it measures nothing new.
    pub is_frozen: bool,
    registers: [u8; 128],
    ready: Nanos,
    /// Number of the latest measurement in the registers.
    measured: Option<u64>,
    transaction: Transaction,
    // Of an accelerometer only.
    speaks_spi: bool,
    /// Time at which it measures: some time after it is on and not suspended.
    awake: Option<Nanos>,
    written: Option<Nanos>,
    /// Number of the latest measurement of the temperature.
    warmth: Option<u64>,
}

impl Chip {
    fn new(id: u8) -> Self {
        Self {
            id,
            errors: 0,
            reset_forgets_spi: false,
            deaf: None,
            is_frozen: false,
            registers: [0; 128],
            ready: Nanos::ZERO,
            measured: None,
            transaction: Transaction::default(),
            speaks_spi: false,
            awake: None,
            written: None,
            warmth: None,
        }
    }

    const fn register(&self, register: u8) -> u8 {
        self.registers[register as usize]
    }

    fn set(&mut self, register: u8, values: &[u8]) {
        let first = usize::from(register);
        self.registers[first..first + values.len()].copy_from_slice(values);
    }
}

/// Data sheet, 5.2 and 5.5: addresses of the registers that do something here.
mod accelerometer {
    pub const ID: u8 = 0x00;
    pub const ERRORS: u8 = 0x02;
    pub const DATA: u8 = 0x12;
    pub const TIME: u8 = 0x18;
    pub const TEMPERATURE: u8 = 0x22;
    pub const CONFIG: u8 = 0x40;
    pub const RANGE: u8 = 0x41;
    pub const POWER_CONFIG: u8 = 0x7C;
    pub const POWER: u8 = 0x7D;
    /// Those that keep what is written; the last four (pins and routes of interrupts, the self-test)
    /// do nothing else.
    pub const STORED: [u8; 8] = [CONFIG, RANGE, POWER_CONFIG, POWER, 0x53, 0x54, 0x58, 0x6D];
    pub const RESET: u8 = 0x7E;
}
mod gyroscope {
    pub const ID: u8 = 0x00;
    pub const DATA: u8 = 0x02;
    pub const RANGE: u8 = 0x0F;
    pub const BANDWIDTH: u8 = 0x10;
    pub const POWER: u8 = 0x11;
    pub const RESET: u8 = 0x14;
    /// Those that keep what is written; the last three (interrupts) do nothing else.
    pub const STORED: [u8; 6] = [RANGE, BANDWIDTH, POWER, 0x15, 0x16, 0x18];
}
/// The value that resets either chip.
const SOFT_RESET: u8 = 0xB6;
/// Start-up times: data sheet, 3 and 6.1.
const ACCELEROMETER_STARTS: Nanos = Nanos::new(1_000_000);
const GYROSCOPE_STARTS: Nanos = Nanos::new(30_000_000);
/// After a write in suspend mode comes that long nothing, and so it takes to wake up: data sheet,
/// 6.1 and 4.1.1.
const WAKE_UP: Nanos = Nanos::new(450_000);
/// Sixteen ticks of the sensor time, 39.0625 µs each: data sheet, 5.3.6.
const SIXTEEN_TICKS_NS: u64 = 625_000;
/// Period of the temperature's measurements: data sheet, 5.3.7.
const WARMTH_NS: u64 = 1_280_000_000;
/// Periods of the accelerometer's data rates from 12.5 Hz (5) to 1600 Hz (12): data sheet, 5.3.10.
const SLOWEST_NS: u64 = 80_000_000;
/// Data rates by bandwidth setting: data sheet, 5.5.5.
const RATES: [u64; 8] = [2000, 2000, 1000, 400, 200, 100, 200, 100];

/// The package with both chips.
#[derive(Clone, Debug)]
pub struct Bmi088 {
    /// The motion that it feels now.
    pub motion: Motion,
    /// Temperature of the die, degrees Celsius.
    pub celsius: f64,
    /// The accelerometer.
    pub accelerometer: Chip,
    /// The gyroscope.
    pub gyroscope: Chip,
    noise: u64,
}

impl Default for Bmi088 {
    /// Switched on at time zero, level and at rest, 25 °C.
    fn default() -> Self {
        let (accelerometer, gyroscope) = (Chip::new(0x1E), Chip::new(0x0F));
        let noise = 0x9E37_79B9_7F4A_7C15;
        let motion = Motion::REST;
        let mut package = Self { motion, celsius: 25.0, accelerometer, gyroscope, noise };
        package.lose_supply(Nanos::ZERO);
        package
    }
}

impl Bmi088 {
    /// Whether it follows an SPI clock of this mode (0 to 3) and frequency: data sheet, 6.1.
    pub const fn understands(mode: u8, clock_hz: u64) -> bool {
        (mode == 0 || mode == 3) && clock_hz <= 10_000_000
    }

    /// The supply goes and comes back at once.
    pub fn lose_supply(&mut self, now: Nanos) {
        self.accelerometer.speaks_spi = false;
        self.reset_accelerometer(now);
        self.reset_gyroscope(now);
    }

    /// Restarts the accelerometer; the gyroscope goes on.
    pub fn reset_accelerometer(&mut self, now: Nanos) {
        let chip = &mut self.accelerometer;
        chip.registers = [0; 128];
        // Reset values of the register map, 5.2: 100 Hz, 6 g, suspended.
        chip.set(accelerometer::CONFIG, &[0xA8]);
        chip.set(accelerometer::RANGE, &[0x01]);
        chip.set(accelerometer::POWER_CONFIG, &[0x03]);
        (chip.ready, chip.awake, chip.written) = (now + ACCELEROMETER_STARTS, None, None);
        (chip.measured, chip.warmth) = (None, None);
    }

    fn reset_gyroscope(&mut self, now: Nanos) {
        let chip = &mut self.gyroscope;
        chip.registers = [0; 128];
        chip.set(gyroscope::BANDWIDTH, &[0x80]);
        (chip.ready, chip.measured) = (now + GYROSCOPE_STARTS, None);
    }

    /// A chip select fell.
    pub fn select(&mut self, part: Part) {
        self.chip(part).transaction = Transaction::default();
    }

    /// A chip select rose. The first time that it does, the accelerometer begins to speak SPI, once
    /// it has started: data sheet, 6.1.
    pub fn deselect(&mut self, part: Part, now: Nanos) {
        if part == Part::Accelerometer && now >= self.accelerometer.ready {
            self.accelerometer.speaks_spi = true;
        }
    }

    /// A byte in, and the one that goes out meanwhile.
    pub fn exchange(&mut self, part: Part, sent: u8, now: Nanos) -> u8 {
        let chip = self.chip(part);
        if chip.transaction.bytes == 0 {
            chip.transaction.address = sent;
        }
        let Transaction { bytes: before, address } = chip.transaction;
        // The address goes round: so may the count.
        chip.transaction.bytes = before.checked_add(1).unwrap_or(128);
        if part == Part::Accelerometer && !chip.speaks_spi {
            // MISO is not driven.
            return 0xFF;
        }
        let is_read = address & 0x80 != 0;
        // The accelerometer sends a byte of no meaning before a register's contents.
        let first = if is_read && part == Part::Accelerometer { 2 } else { 1 };
        let Some(offset) = before.checked_sub(first) else { return 0xA5 };
        let register = (address & 0x7F).wrapping_add(offset) & 0x7F;
        if now < chip.ready || !is_read && chip.deaf == Some(register) {
            return 0;
        }
        match (part, is_read) {
            (Part::Accelerometer, true) => return self.read_accelerometer(register, now),
            (Part::Gyroscope, true) => return self.read_gyroscope(register, now),
            (Part::Accelerometer, false) => self.write_accelerometer(register, sent, now),
            (Part::Gyroscope, false) => self.write_gyroscope(register, sent, now),
        }
        0
    }

    const fn chip(&mut self, part: Part) -> &mut Chip {
        match part {
            Part::Accelerometer => &mut self.accelerometer,
            Part::Gyroscope => &mut self.gyroscope,
        }
    }

    /// -1, 0 or 1.
    const fn noise(&mut self) -> f64 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        match self.noise % 3 {
            0 => -1.0,
            1 => 0.0,
            _ => 1.0,
        }
    }

    fn axes(&mut self, values: [f64; 3], one: f64) -> [u8; 6] {
        let mut bytes = [0; 6];
        for (axis, value) in bytes.chunks_exact_mut(2).zip(values) {
            let raw = (value / one).round() + self.noise();
            #[expect(clippy::cast_possible_truncation, reason = "clamped to its range")]
            let raw = raw.clamp(-32_768.0, 32_767.0) as i16;
            axis.copy_from_slice(&raw.to_le_bytes());
        }
        bytes
    }

    fn read_accelerometer(&mut self, register: u8, now: Nanos) -> u8 {
        let chip = &self.accelerometer;
        let is_awake = chip.awake.is_some_and(|awake| now >= awake);
        match register {
            accelerometer::ID => return chip.id,
            accelerometer::ERRORS => return chip.errors,
            // The first byte of a burst latches them all.
            accelerometer::DATA if is_awake && !chip.is_frozen => {
                self.measure_acceleration(now);
                self.latch_time(now);
            }
            accelerometer::TIME if is_awake && !chip.is_frozen => self.latch_time(now),
            // No temperature.
            accelerometer::TEMPERATURE if !is_awake => return 0x80,
            accelerometer::TEMPERATURE => self.measure_warmth(now),
            _ => {}
        }
        self.accelerometer.register(register)
    }

    fn measure_acceleration(&mut self, now: Nanos) {
        let chip = &self.accelerometer;
        let rate = chip.register(accelerometer::CONFIG) & 0xF;
        let period = SLOWEST_NS >> rate.clamp(5, 12).abs_diff(5);
        let range = f64::from(3_u8 << (chip.register(accelerometer::RANGE) & 3));
        let measured = Some(now.get() / period);
        if chip.measured != measured {
            let bytes = self.axes(self.motion.acceleration, range * GRAVITY / 32_768.0);
            self.accelerometer.measured = measured;
            self.accelerometer.set(accelerometer::DATA, &bytes);
        }
    }

    fn latch_time(&mut self, now: Nanos) {
        let ticks = (now.get() * 16 / SIXTEEN_TICKS_NS).to_le_bytes();
        self.accelerometer.set(accelerometer::TIME, &ticks[..3]);
    }

    fn measure_warmth(&mut self, now: Nanos) {
        let number = Some(now.get() / WARMTH_NS);
        if self.accelerometer.warmth == number {
            return;
        }
        self.accelerometer.warmth = number;
        // 11 bits of 1/8 degree from 23 °C on.
        let eighths = ((self.celsius - 23.0) * 8.0).round().clamp(-1023.0, 1023.0);
        #[expect(clippy::cast_possible_truncation, reason = "clamped to its range")]
        let bytes = ((eighths as i16) << 5).to_be_bytes();
        self.accelerometer.set(accelerometer::TEMPERATURE, &bytes);
    }

    fn write_accelerometer(&mut self, register: u8, value: u8, now: Nanos) {
        let chip = &mut self.accelerometer;
        let is_suspended = chip.register(accelerometer::POWER_CONFIG) == 0x03;
        // A write within the pause after another is lost.
        if chip.written.is_some_and(|written| now < written + WAKE_UP) {
            return;
        }
        if is_suspended {
            chip.written = Some(now);
        }
        match (register, value) {
            (accelerometer::RESET, SOFT_RESET) => {
                chip.speaks_spi &= !chip.reset_forgets_spi;
                return self.reset_accelerometer(now);
            }
            // Configuration registers take nothing while the chip sleeps.
            (accelerometer::CONFIG | accelerometer::RANGE, _) if is_suspended => return,
            _ => {}
        }
        if accelerometer::STORED.contains(&register) {
            chip.set(register, &[value]);
        }
        // On, and not suspended.
        let is_on = chip.register(accelerometer::POWER) == 0x04
            && chip.register(accelerometer::POWER_CONFIG) == 0x00;
        chip.awake = is_on.then(|| chip.awake.unwrap_or(now + WAKE_UP));
    }

    fn read_gyroscope(&mut self, register: u8, now: Nanos) -> u8 {
        match register {
            gyroscope::ID => return self.gyroscope.id,
            // The first byte of a burst latches them all.
            gyroscope::DATA => self.measure_rotation(now),
            _ => {}
        }
        let value = self.gyroscope.register(register);
        if register == gyroscope::BANDWIDTH { value | 0x80 } else { value }
    }

    fn measure_rotation(&mut self, now: Nanos) {
        let chip = &self.gyroscope;
        let bandwidth = chip.register(gyroscope::BANDWIDTH) & 7;
        let measured = Some(now.get() / (1_000_000_000 / RATES[usize::from(bandwidth)]));
        // Suspended, or deeply so.
        let sleeps = chip.register(gyroscope::POWER) & 0xA0 != 0;
        if measured == chip.measured || chip.is_frozen || sleeps {
            return;
        }
        let range = 2000_u16 >> (chip.register(gyroscope::RANGE) & 7);
        let bytes = self.axes(self.motion.rotation, f64::from(range).to_radians() / 32_767.0);
        self.gyroscope.measured = measured;
        self.gyroscope.set(gyroscope::DATA, &bytes);
    }

    fn write_gyroscope(&mut self, register: u8, value: u8, now: Nanos) {
        if (register, value) == (gyroscope::RESET, SOFT_RESET) {
            self.reset_gyroscope(now);
        } else if gyroscope::STORED.contains(&register) {
            self.gyroscope.set(register, &[value]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// One transaction; what came in.
    fn transfer(package: &mut Bmi088, part: Part, sent: &[u8], now: u64) -> Vec<u8> {
        package.select(part);
        let now = Nanos::new(now);
        let heard = sent.iter().map(|&byte| package.exchange(part, byte, now)).collect();
        package.deselect(part, now);
        heard
    }

    fn running() -> Bmi088 {
        let mut package = Bmi088::default();
        // To SPI; out of suspend, on.
        transfer(&mut package, Part::Accelerometer, &[0x80, 0], 40 * MS);
        for (at, bytes) in [(41, [0x7C, 0x00]), (42, [0x7D, 0x04]), (43, [0x40, 0xAC])] {
            transfer(&mut package, Part::Accelerometer, &bytes, at * MS);
        }
        package
    }

    #[test]
    fn identities_after_the_start_and_the_first_select() {
        let mut package = Bmi088::default();
        let id = |package: &mut Bmi088, part, now| {
            *transfer(package, part, &[0x80, 0, 0], now).last().unwrap_or(&0)
        };
        assert_eq!(id(&mut package, Part::Accelerometer, 2 * MS), 0xFF, "I2C");
        assert_eq!(id(&mut package, Part::Accelerometer, 3 * MS), 0x1E);
        assert_eq!(transfer(&mut package, Part::Gyroscope, &[0x80, 0], 29 * MS), [0xA5, 0]);
        assert_eq!(transfer(&mut package, Part::Gyroscope, &[0x80, 0], 30 * MS), [0xA5, 0x0F]);
    }

    #[test]
    fn gravity_and_turning_in_digits() {
        let mut package = running();
        package.motion.rotation = [0.0, 0.0, 1000.0_f64.to_radians()];
        let read = [0x92, 0, 0, 0, 0, 0, 0, 0];
        let heard = transfer(&mut package, Part::Accelerometer, &read, 50 * MS);
        let z = i16::from_le_bytes([heard[6], heard[7]]);
        assert!((5460..=5462).contains(&z), "a g of 6: {z}");
        let heard = transfer(&mut package, Part::Gyroscope, &[0x82, 0, 0, 0, 0, 0, 0], 50 * MS);
        let z = i16::from_le_bytes([heard[5], heard[6]]);
        assert!((16383..=16385).contains(&z), "half of 2000 degrees a second: {z}");
    }

    /// 450 us after the later of both writes, in either order; a second "on" changes nothing.
    #[test]
    fn it_wakes_up_when_it_is_on_and_not_suspended() {
        for order in [[[0x7C, 0x00], [0x7D, 0x04]], [[0x7D, 0x04], [0x7C, 0x00]]] {
            let mut package = Bmi088::default();
            transfer(&mut package, Part::Accelerometer, &[0x80, 0], 40 * MS);
            for (at, bytes) in [41, 42].into_iter().zip(order) {
                transfer(&mut package, Part::Accelerometer, &bytes, at * MS);
            }
            let mut warmth =
                |now| transfer(&mut package, Part::Accelerometer, &[0xA2, 0, 0], now)[2];
            assert_eq!((warmth(42 * MS + 449_999), warmth(42 * MS + 450_000)), (0x80, 2));
            transfer(&mut package, Part::Accelerometer, &[0x7D, 0x04], 43 * MS);
            let mut warmth =
                |now| transfer(&mut package, Part::Accelerometer, &[0xA2, 0, 0], now)[2];
            assert_eq!(warmth(43 * MS + 1), 2);
        }
    }

    #[test]
    fn sixteen_ticks_of_the_sensor_time_are_625_microseconds() {
        let mut package = running();
        let mut time = |now| {
            let heard = transfer(&mut package, Part::Accelerometer, &[0x98, 0, 0, 0, 0], now);
            u32::from_le_bytes([heard[2], heard[3], heard[4], 0])
        };
        assert_eq!(time(100 * MS), 2_560);
        assert_eq!((time(600_000 * MS - 1), time(600_000 * MS)), (15_359_999, 15_360_000));
    }

    #[test]
    fn each_chip_has_its_data_rate() {
        let mut package = running();
        let mut read = |part, now| {
            let sent = if part == Part::Gyroscope { [0x82, 0, 0, 0] } else { [0x92, 0, 0, 0] };
            package.motion.acceleration[0] += 1.0;
            package.motion.rotation[0] += 1.0;
            transfer(&mut package, part, &sent, now)
        };
        // 1600 Hz: a new one at every 625 us.
        let first = read(Part::Accelerometer, 50 * MS);
        assert_eq!(read(Part::Accelerometer, 50 * MS + 624_999), first);
        assert_ne!(read(Part::Accelerometer, 50 * MS + 625_000), first);
        // 2000 Hz.
        let first = read(Part::Gyroscope, 50 * MS);
        assert_eq!(read(Part::Gyroscope, 50 * MS + 499_999), first);
        assert_ne!(read(Part::Gyroscope, 50 * MS + 500_000), first);
    }

    #[test]
    fn the_temperature_is_measured_every_1_28_seconds() {
        let mut package = running();
        let mut read = |celsius, now| {
            package.celsius = celsius;
            let heard = transfer(&mut package, Part::Accelerometer, &[0xA2, 0, 0, 0], now);
            [heard[2], heard[3]]
        };
        assert_eq!(read(40.125, 60 * MS), [17, 1 << 5]);
        assert_eq!(read(10.0, 1279 * MS), [17, 1 << 5]);
        assert_eq!(read(10.0, 1280 * MS), [0xF3, 0]);
        assert_eq!(read(-40.0, 2560 * MS), [0xC1, 0]);
    }
}
