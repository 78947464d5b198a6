//! A BMI088 behind an SPI in virtual time: the simulator's, which shares no code with the driver.

use std::cell::RefCell;
use std::ops::{Deref, DerefMut};
use std::rc::Rc;

use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::{self, ErrorKind, ErrorType, Operation, SpiDevice};
use rc10_sim::Nanos;
use rc10_sim::imu::bmi088::Bmi088;
pub use rc10_sim::imu::bmi088::{Motion, Part as Chip};

/// The harm that the wires do to a transfer.
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

/// The package, its wires, and virtual time in ns.
#[derive(Debug)]
pub struct Package {
    pub now: u64,
    pub wires: Wires,
    /// The two chip selects are swapped.
    pub is_swapped: bool,
    pub transferred: usize,
    chip: Bmi088,
}

/// A byte at 10 MHz.
const BYTE: u64 = 800;

impl Package {
    /// Switched on at time zero, level and at rest.
    pub fn new() -> Self {
        let (wires, chip) = (Wires::Good, Bmi088::default());
        Self { now: 0, wires, is_swapped: false, transferred: 0, chip }
    }

    /// The supply goes and comes back at once.
    pub fn lose_supply(&mut self) {
        self.chip.lose_supply(Nanos::new(self.now));
    }

    /// The accelerometer starts again on its own, the gyroscope does not.
    pub fn reset_accelerometer(&mut self) {
        self.chip.reset_accelerometer(Nanos::new(self.now));
    }

    /// A register of the accelerometer changes, and the driver did not do it.
    pub fn set_accelerometer(&mut self, register: u8, value: u8) {
        let (part, now) = (Chip::Accelerometer, Nanos::new(self.now));
        self.chip.select(part);
        for byte in [register, value] {
            self.chip.exchange(part, byte, now);
        }
        self.chip.deselect(part, now);
    }

    /// One byte out and one in.
    fn exchange(&mut self, part: Chip, byte: u8) -> u8 {
        self.now += BYTE;
        self.transferred += 1;
        if self.wires == Wires::Cut {
            return 0xFF;
        }
        let answer = self.chip.exchange(part, byte, Nanos::new(self.now));
        match self.wires {
            Wires::Stuck(level) => level,
            _ => answer,
        }
    }
}

impl Deref for Package {
    type Target = Bmi088;
    fn deref(&self) -> &Bmi088 {
        &self.chip
    }
}

impl DerefMut for Package {
    fn deref_mut(&mut self) -> &mut Bmi088 {
        &mut self.chip
    }
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
        package.chip.select(chip);
        let mut exchange = |byte: u8| package.exchange(chip, byte);
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
        if package.wires != Wires::Cut {
            let now = Nanos::new(package.now);
            package.chip.deselect(chip, now);
        }
        Ok(())
    }
}

/// Runs a future that waits for nothing but the delay above.
pub fn run<F: Future>(future: F) -> F::Output {
    embassy_futures::block_on(future)
}
