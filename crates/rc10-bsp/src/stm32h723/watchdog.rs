//! The independent watchdog: if it is not fed in time, it resets the chip.

use embassy_stm32::peripherals::IWDG1;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, pac};
use embassy_time::Duration;

use super::{crash, supervisor};

/// A watchdog that is fed only while everything that must run, runs.
///
/// It cannot be stopped once started, and a debugger that holds the core does not hold it: a core that
/// stands protects no motor, and a restart is the only thing left that does. With the feature
/// `freeze-watchdog` it holds still then, for breakpoints in a program without motors.
///
/// A reset by it sends no coast image: nothing runs any more that could. If the
/// [`supervisor`](crate::supervisor) still ran, it has sent it long before; else the motors keep
/// their last command until their own timeout, or until the restarted program's first frames.
///
/// Erasing flash stalls the core for up to two seconds: not with a shorter timeout than that.
pub struct Watchdog {
    driver: IndependentWatchdog<'static, IWDG1>,
    is_set: bool,
    /// Looks of the supervisor from feeding until it is about to bite: five eighths of the timeout, of which its
    /// oscillator may leave nine tenths.
    looks: u32,
}

impl Watchdog {
    /// Starts the watchdog. `timeout` is 125 µs ..= 32 s, up to 9 % longer cold or hot (29.4 ..=
    /// 33.6 kHz for 32; data sheet, LSI). Takes up to 1 ms.
    ///
    /// # Panics
    /// If `timeout` is longer than 32 s.
    #[must_use]
    pub fn start(peripheral: Peri<'static, IWDG1>, timeout: Duration) -> Self {
        #[cfg(feature = "freeze-watchdog")]
        pac::DBGMCU.apb4fzr1().modify(|w| w.set_iwdg1(true));
        let micros = u32::try_from(timeout.as_micros()).unwrap_or(u32::MAX);
        let mut driver = IndependentWatchdog::new(peripheral, micros);
        driver.unleash();
        // The oscillator starts only now, and only it takes prescaler and reload value over: until
        // then the watchdog counts down from its reset value, 512 ms. Feeding it afterwards makes
        // the first period as long as all others. Bounded: the watchdog must not hang the start.
        let status = || pac::IWDG1.sr().read();
        let is_set = (0..100).any(|_| {
            let is_set = !status().pvu() && !status().rvu();
            if !is_set {
                cortex_m::asm::delay(4_800); // 10 us at least
            }
            is_set
        });
        driver.pet();
        let looks = micros / supervisor::PERIOD * 5 / 8;
        crash::fed(looks);
        Self { driver, is_set, looks }
    }

    /// Whether it took its timeout; if not, its oscillator fails, and it may be of no use.
    #[must_use]
    pub const fn is_set(&self) -> bool {
        self.is_set
    }

    /// Feeds the watchdog if `alive` says so; passes on what it said.
    pub fn feed_if(&mut self, alive: impl FnOnce() -> bool) -> bool {
        let alive = alive();
        if alive {
            self.driver.pet();
            crash::fed(self.looks);
        }
        alive
    }
}
