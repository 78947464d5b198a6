//! A BMI088 from its own side: what it does with bytes that come in while a chip select is low,
//! written from the data sheet BST-BMI088-DS001. It shares nothing with the driver.

use std::cell::RefCell;

use std::rc::Rc;

use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::{self, ErrorKind, ErrorType, Operation, SpiDevice};

/// The world turns and pulls like this, in the sensor's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// m/s².
    pub acceleration: [f64; 3],
    /// rad/s.
    pub rotation: [f64; 3],
}

/// What the wires do to a transfer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Wires {
    #[default]
    Good,
    /// The controller reports an error.
    Error,
    /// MISO hangs at this level; what is written still arrives.
    Stuck(u8),
    /// Nothing arrives, and MISO floats high.
    Cut,
}

#[derive(Debug)]
pub struct Accelerometer {
    pub id: u8,
    pub errors: u8,
    /// A reset takes it back to I²C: the data sheet says no, users say that it does.
    pub reset_forgets_spi: bool,
    /// A register that takes nothing.
    pub deaf: Option<u8>,
    pub is_frozen: bool,
    registers: [u8; 128],
    speaks_spi: bool,
    ready: u64,
    awake: u64,
    written: u64,
}

#[derive(Debug)]
pub struct Gyroscope {
    pub id: u8,
    pub deaf: Option<u8>,
    pub is_frozen: bool,
    registers: [u8; 128],
    ready: u64,
    latched: [u8; 6],
    measured: u64,
}

/// The package: both chips, and virtual time in ns.
#[derive(Debug)]
pub struct Package {
    pub now: u64,
    pub motion: Motion,
    pub celsius: f64,
    pub wires: Wires,
    pub accelerometer: Accelerometer,
    pub gyroscope: Gyroscope,
    /// The two chip selects are swapped.
    pub is_swapped: bool,
    noise: u64,
    pub transferred: usize,
}

const MS: u64 = 1_000_000;
/// A byte at 10 MHz.
const BYTE: u64 = 800;

impl Package {
    /// Switched on at time zero, level and at rest.
    pub fn new() -> Self {
        let accelerometer = Accelerometer {
            id: 0x1E,
            errors: 0,
            reset_forgets_spi: false,
            deaf: None,
            is_frozen: false,
            registers: [0; 128],
            speaks_spi: false,
            ready: 0,
            awake: u64::MAX,
            written: 0,
        };
        let gyroscope = Gyroscope {
            id: 0x0F,
            deaf: None,
            is_frozen: false,
            registers: [0; 128],
            ready: 0,
            latched: [0; 6],
            measured: 0,
        };
        let motion = Motion { acceleration: [0.0, 0.0, 9.80665], rotation: [0.0; 3] };
        let mut package = Self {
            now: 0,
            motion,
            celsius: 31.0,
            wires: Wires::Good,
            accelerometer,
            gyroscope,
            is_swapped: false,
            noise: 0x9E37_79B9_7F4A_7C15,
            transferred: 0,
        };
        package.lose_supply();
        package
    }

    /// The supply goes and comes back at once.
    pub fn lose_supply(&mut self) {
        self.accelerometer.speaks_spi = false;
        self.reset_accelerometer();
        self.reset_gyroscope();
    }

    /// It starts again on its own, the gyroscope does not.
    pub fn reset_accelerometer(&mut self) {
        let chip = &mut self.accelerometer;
        chip.registers = [0; 128];
        // Reset values of the register map, 5.2: suspended, 100 Hz, 6 g.
        (chip.registers[0x40], chip.registers[0x41], chip.registers[0x7C]) = (0xA8, 0x01, 0x03);
        (chip.ready, chip.awake) = (self.now + MS, u64::MAX);
    }

    fn reset_gyroscope(&mut self) {
        let chip = &mut self.gyroscope;
        chip.registers = [0; 128];
        chip.registers[0x10] = 0x80;
        chip.ready = self.now + 30 * MS;
        chip.latched = [0; 6];
    }

    /// -1, 0 or 1.
    fn noise(&mut self) -> f64 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        (self.noise % 3) as f64 - 1.0
    }

    fn axes(&mut self, values: [f64; 3], one: f64) -> [u8; 6] {
        let mut bytes = [0; 6];
        for (axis, value) in values.into_iter().enumerate() {
            let raw = (value / one).round() + self.noise();
            let [low, high] = (raw.clamp(-32768.0, 32767.0) as i16).to_le_bytes();
            (bytes[2 * axis], bytes[2 * axis + 1]) = (low, high);
        }
        bytes
    }

    fn read_accelerometer(&mut self, register: u8) -> u8 {
        if self.now < self.accelerometer.ready {
            return 0;
        }
        let is_on = self.accelerometer.registers[0x7D] == 0x04
            && self.accelerometer.registers[0x7C] == 0x00;
        let is_awake = is_on && self.now >= self.accelerometer.awake;
        match register {
            0x00 => self.accelerometer.id,
            0x02 => self.accelerometer.errors,
            // Latched when the first byte of a burst is read; noise between bytes would be a fault.
            0x12 if is_awake && !self.accelerometer.is_frozen => {
                let range = f64::from(3_u8 << (self.accelerometer.registers[0x41] & 3));
                let bytes = self.axes(self.motion.acceleration, range * 9.80665 / 32768.0);
                self.accelerometer.registers[0x12..0x18].copy_from_slice(&bytes);
                let ticks = (self.now / 39_062).to_le_bytes();
                self.accelerometer.registers[0x18..0x1B].copy_from_slice(&ticks[..3]);
                bytes[0]
            }
            0x18 if is_awake && !self.accelerometer.is_frozen => {
                let ticks = (self.now / 39_062).to_le_bytes();
                self.accelerometer.registers[0x18..0x1B].copy_from_slice(&ticks[..3]);
                ticks[0]
            }
            0x22 if !is_awake => 0x80,
            0x22 | 0x23 => {
                let eighths = ((self.celsius - 23.0) * 8.0).round() as i16;
                ((eighths << 5).to_be_bytes())[usize::from(register - 0x22)]
            }
            other => self.accelerometer.registers[usize::from(other & 0x7F)],
        }
    }

    fn write_accelerometer(&mut self, register: u8, value: u8) {
        let chip = &mut self.accelerometer;
        let is_suspended = chip.registers[0x7C] == 0x03;
        // 6.1: after a write in suspend mode comes 450 µs of nothing; a write in that is lost.
        let is_too_soon = self.now < chip.written + 450_000;
        if self.now < chip.ready || is_too_soon || chip.deaf == Some(register) {
            return;
        }
        if is_suspended {
            chip.written = self.now;
        }
        match (register, value) {
            (0x7E, 0xB6) => {
                chip.speaks_spi &= !chip.reset_forgets_spi;
                return self.reset_accelerometer();
            }
            // Configuration registers take nothing while the chip sleeps.
            (0x40 | 0x41, _) if is_suspended => return,
            (0x7D, 0x04) => chip.awake = self.now + 450_000,
            _ => {}
        }
        if matches!(register, 0x40 | 0x41 | 0x7C | 0x7D) {
            chip.registers[usize::from(register)] = value;
        }
    }

    fn read_gyroscope(&mut self, register: u8) -> u8 {
        if self.now < self.gyroscope.ready {
            return 0;
        }
        match register {
            0x00 => self.gyroscope.id,
            0x02 => {
                // By bandwidth, 5.5.5.
                let rates = [2000, 2000, 1000, 400, 200, 100, 200, 100];
                let rate = rates[usize::from(self.gyroscope.registers[0x10] & 7)];
                let measured = self.now / (1_000_000_000 / rate);
                let sleeps = self.gyroscope.registers[0x11] & 0xA0 != 0;
                if measured != self.gyroscope.measured && !self.gyroscope.is_frozen && !sleeps {
                    let range = f64::from(2000_u16 >> (self.gyroscope.registers[0x0F] & 7));
                    let one = range.to_radians() / 32767.0;
                    self.gyroscope.latched = self.axes(self.motion.rotation, one);
                    self.gyroscope.measured = measured;
                }
                self.gyroscope.latched[0]
            }
            0x03..=0x07 => self.gyroscope.latched[usize::from(register - 2)],
            0x10 => self.gyroscope.registers[0x10] | 0x80,
            other => self.gyroscope.registers[usize::from(other & 0x7F)],
        }
    }

    fn write_gyroscope(&mut self, register: u8, value: u8) {
        if self.now < self.gyroscope.ready || self.gyroscope.deaf == Some(register) {
            return;
        }
        match (register, value) {
            (0x14, 0xB6) => self.reset_gyroscope(),
            (0x0F..=0x11, _) => self.gyroscope.registers[usize::from(register)] = value,
            _ => {}
        }
    }

    /// One byte out and one in, `at` bytes after the chip select fell.
    fn exchange(&mut self, chip: Chip, at: usize, address: u8, byte: u8) -> u8 {
        self.now += BYTE;
        self.transferred += 1;
        if self.wires == Wires::Cut {
            return 0xFF;
        }
        let is_read = address & 0x80 != 0;
        let register = |skip: usize| (address & 0x7F).wrapping_add((at - skip) as u8);
        let answer = match chip {
            // MISO is not driven.
            Chip::Accelerometer if !self.accelerometer.speaks_spi => 0xFF,
            Chip::Accelerometer if is_read && at >= 2 => self.read_accelerometer(register(2)),
            Chip::Gyroscope if is_read && at >= 1 => self.read_gyroscope(register(1)),
            Chip::Accelerometer if !is_read && at >= 1 => {
                self.write_accelerometer(register(1), byte);
                0x00
            }
            Chip::Gyroscope if !is_read && at >= 1 => {
                self.write_gyroscope(register(1), byte);
                0x00
            }
            // While the address comes in, and the accelerometer's dummy byte.
            _ => 0xA5,
        };
        match self.wires {
            Wires::Stuck(level) => level,
            _ => answer,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chip {
    Accelerometer,
    Gyroscope,
}

/// The package as its wires are shared: two SPI devices and a delay.
#[derive(Clone, Debug)]
pub struct Shared(pub Rc<RefCell<Package>>);

impl Shared {
    pub fn new() -> Self {
        Self(Rc::new(RefCell::new(Package::new())))
    }

    pub fn device(&self, chip: Chip) -> Device {
        Device { shared: self.clone(), chip }
    }

    pub fn with<R>(&self, with: impl FnOnce(&mut Package) -> R) -> R {
        with(&mut self.0.borrow_mut())
    }
}

impl DelayNs for Shared {
    async fn delay_ns(&mut self, ns: u32) {
        self.with(|package| package.now += u64::from(ns));
    }
}

#[derive(Debug)]
pub struct Device {
    shared: Shared,
    chip: Chip,
}

/// The bus failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusFault;

impl spi::Error for BusFault {
    fn kind(&self) -> ErrorKind {
        ErrorKind::ModeFault
    }
}

impl ErrorType for Device {
    type Error = BusFault;
}

impl SpiDevice for Device {
    async fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusFault> {
        let mut package = self.shared.0.borrow_mut();
        if package.wires == Wires::Error {
            return Err(BusFault);
        }
        let chip = match (self.chip, package.is_swapped) {
            (chip, false) => chip,
            (Chip::Accelerometer, true) => Chip::Gyroscope,
            (Chip::Gyroscope, true) => Chip::Accelerometer,
        };
        let (mut at, mut address) = (0, 0);
        let mut exchange = |byte: u8| {
            if at == 0 {
                address = byte;
            }
            let answer = package.exchange(chip, at, address, byte);
            at += 1;
            answer
        };
        for operation in operations {
            match operation {
                Operation::Write(bytes) => bytes.iter().for_each(|&byte| {
                    exchange(byte);
                }),
                Operation::Read(bytes) => bytes.fill_with(|| exchange(0)),
                Operation::TransferInPlace(bytes) => {
                    bytes.iter_mut().for_each(|byte| *byte = exchange(*byte));
                }
                other => unimplemented!("{other:?}"),
            }
        }
        // 6.1: the rising edge of its chip select makes the accelerometer speak SPI, once it has
        // started.
        let is_seen = package.wires != Wires::Cut && package.now >= package.accelerometer.ready;
        if chip == Chip::Accelerometer && is_seen {
            package.accelerometer.speaks_spi = true;
        }
        Ok(())
    }
}

/// Runs a future that waits for nothing but the delay above.
pub fn run<F: Future>(future: F) -> F::Output {
    embassy_futures::block_on(future)
}
