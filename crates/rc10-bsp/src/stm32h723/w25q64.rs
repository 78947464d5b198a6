//! A W25Q64JV at OCTOSPI1: a serial flash of 8 MiB (data sheet, revision I).
//!
//! One data line: the four of it need a bit that not every variant has set, and 5 MB/s are more than is asked for.
#![expect(clippy::cast_possible_truncation, reason = "numbers of bytes below 8 MiB")]

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::mode::Blocking;
use embassy_stm32::ospi::{
    AddressSize, ChipSelectHighTime, Config, DummyCycles, MemorySize, MemoryType, Ospi, OspiWidth,
    TransferConfig,
};
use embassy_stm32::pac;
use embassy_stm32::peripherals::OCTOSPI1;

/// Bytes of a page.
pub const PAGE: usize = 256;
/// Bytes of the flash.
pub const BYTES: usize = 8 << 20;

/// Manufacturer, type, capacity: of the JV-IQ, and of the JV-IM.
const JEDEC: [[u8; 3]; 2] = [[0xEF, 0x40, 0x17], [0xEF, 0x70, 0x17]];

const READ: u8 = 0x0B;
const READ_ID: u8 = 0x9F;
const READ_STATUS: u8 = 0x05;
const IS_BUSY: u8 = 1;
const ENABLE_WRITE: u8 = 0x06;
const PROGRAM: u8 = 0x02;
const ERASE_64_KIB: u8 = 0xD8;

/// The flash. Its commands have no answer: one that was not carried out is seen when the page is read.
pub struct W25q64(Ospi<'static, OCTOSPI1, Blocking>);

impl W25q64 {
    /// With what `new` makes of this configuration: the four data lines are there, so that the two that are not used stand
    /// still.
    pub fn start(new: impl FnOnce(Config) -> Ospi<'static, OCTOSPI1, Blocking>) -> Self {
        // embassy-stm32's driver reads its registers before it gives it a clock.
        pac::RCC.ahb3enr().modify(|w| w.set_octospi1en(true));
        let config = Config {
            memory_type: MemoryType::Standard,
            device_size: MemorySize::_8MiB,
            // At least 50 ns.
            chip_select_high_time: ChipSelectHighTime::_5Cycle,
            // 240 MHz / 6: the flash answers within 6 ns of half a period of 12.5.
            clock_prescaler: 5,
            ..Config::default()
        };
        Self(new(config))
    }

    /// Whether it is there. One that goes on with what it did before a restart does not answer until that is done, up to 2 s.
    pub fn is_there(&mut self) -> bool {
        let mut id = [0; 3];
        let _ = self.0.blocking_read(&mut id, command(READ_ID, None, true));
        JEDEC.contains(&id)
    }

    /// Whether a page is being programmed, or some erased: meanwhile nothing is read.
    pub fn is_busy(&mut self) -> bool {
        let mut status = [IS_BUSY];
        let _ = self.0.blocking_read(&mut status, command(READ_STATUS, None, true));
        status[0] & IS_BUSY != 0
    }

    /// Reads bytes.
    pub fn read(&mut self, from: u32, to: &mut [u8]) {
        let of = TransferConfig { dummy: DummyCycles::_8, ..command(READ, Some(from), true) };
        let _ = self.0.blocking_read(to, of);
    }

    /// Begins to program a page, 0.4 to 3 ms.
    pub fn program(&mut self, page: u32, bytes: &[u8; PAGE]) {
        let _ = self.0.blocking_command(&command(ENABLE_WRITE, None, false));
        let _ = self.0.blocking_write(bytes, command(PROGRAM, Some(page * PAGE as u32), true));
    }

    /// Begins to erase the 64 KiB with a page, 0.15 to 2 s.
    pub fn erase(&mut self, page: u32) {
        let _ = self.0.blocking_command(&command(ENABLE_WRITE, None, false));
        let _ = self.0.blocking_command(&command(ERASE_64_KIB, Some(page * PAGE as u32), false));
    }
}

fn command(instruction: u8, address: Option<u32>, has_data: bool) -> TransferConfig {
    let line = |is_used| if is_used { OspiWidth::SING } else { OspiWidth::NONE };
    TransferConfig {
        iwidth: OspiWidth::SING,
        instruction: Some(instruction.into()),
        adwidth: line(address.is_some()),
        address,
        adsize: AddressSize::_24bit,
        dwidth: line(has_data),
        sioo: false,
        ..TransferConfig::default()
    }
}

/// A place for the one flash of a program, which tasks of any priority share: one that finds it in use gets nothing, and
/// does not wait.
pub struct Place {
    is_taken: AtomicBool,
    flash: UnsafeCell<Option<W25q64>>,
}

// SAFETY: the flash is touched by the one alone that has set `is_taken`.
unsafe impl Sync for Place {}

impl Place {
    /// An empty one.
    #[must_use]
    #[expect(clippy::new_without_default, reason = "it is for a static")]
    pub const fn new() -> Self {
        Self { is_taken: AtomicBool::new(false), flash: UnsafeCell::new(None) }
    }

    /// Does something with what is there; `None`: another has it.
    pub fn with<R>(&self, work: impl FnOnce(&mut Option<W25q64>) -> R) -> Option<R> {
        if self.is_taken.swap(true, Ordering::Acquire) {
            return None;
        }
        // SAFETY: see above.
        let done = work(unsafe { &mut *self.flash.get() });
        self.is_taken.store(false, Ordering::Release);
        Some(done)
    }
}
