//! The chip as a whole: a program in its memories, time, and faults.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result, bail};
use rc10_sim::{Nanos, World};

use crate::core::{Core, Interpreter, Step, Wiring};
use crate::fdcan::{Fdcans, Node};
use crate::image::Image;
use crate::log::Log;
use crate::memory::Memory;
use crate::peripherals::{ResetCause, Soc};
use crate::profile::Profile;

/// Core clock at which [`Machine::set_speed`]'s figure holds: what RC10's firmware runs at.
const FULL_CLOCK_HZ: u64 = 480_000_000;
/// How often a debug probe looks for log messages.
const LOG_PERIOD: Nanos = Nanos::new(1_000_000);
/// Code that injected faults jump to, in the otherwise unused ITCM.
const INJECTED: u32 = 0x0000_0000;
/// Where an injected panic says it happened.
const PANIC_FILE: &str = "injected.rs";
const PANIC_LINE: u32 = 2300;

/// A fault in the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Injection {
    /// A panic, in file `injected.rs`, line 2300.
    Panic,
    /// An undefined instruction, which is a `HardFault` where nobody handles usage faults.
    HardFault,
    /// The handler of this exception, when it runs next, never ends.
    Hang {
        /// Number of the exception; external interrupts start at 16.
        exception: u16,
    },
    /// Interrupts are masked from now on, or unmasked again.
    MaskInterrupts(bool),
}

/// An access to something that does not exist, or has no clock.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// When.
    pub at: Nanos,
    /// What, in words.
    pub text: String,
}

/// Reports kept in full; more are only counted.
const REPORTS: usize = 32;

/// A restart of the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Restart {
    /// When.
    pub at: Nanos,
    /// Why.
    pub cause: ResetCause,
}

/// One line of the firmware's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// When a debug probe would have read it.
    pub at: Nanos,
    /// Level and message.
    pub text: String,
}

/// An emulated STM32H723 with a program in its flash.
///
/// It has no wires of its own: [`connect`](Self::connect) puts its FDCANs on buses of a [`World`],
/// and [`run`](Self::run) lets chip and world go through time together.
pub struct Machine {
    core: Interpreter,
    wiring: Wiring,
    fdcan: Arc<Mutex<Fdcans>>,
    memory: Memory,
    image: Image,
    log: Log,
    lines: Vec<LogLine>,
    next_log: Nanos,
    profile: Profile,
    now: u64,
    /// What the instructions so far took beyond `now`, in 1/rate of a nanosecond.
    fraction: u64,
    /// Instructions per second at the full clock, if not as many as the clocks allow.
    speed: Option<u64>,
    /// Where the program is to go on, with which arguments, as soon as it executes anything: a core
    /// that sleeps cannot fail.
    jump: Option<(u32, [u32; 3])>,
    /// The exception whose handler is not to end.
    hang: Option<u16>,
    struck: Option<Nanos>,
    ready: Option<Nanos>,
    reports: Vec<Report>,
    restarts: Vec<Restart>,
}

impl Machine {
    /// A chip with the program of an ELF file in its flash, just switched on.
    ///
    /// # Errors
    /// If the file is no program, or does not fit into the chip's memories.
    pub fn new(file: &[u8]) -> Result<Self> {
        let image = Image::parse(file)?;
        let log = Log::new(file, &image)?;
        let memory = Memory::with(&image)?;
        let fdcan = Arc::new(Mutex::new(Fdcans::new()));
        let wiring = Wiring {
            soc: Arc::new(Mutex::new(Soc::new(Arc::clone(&fdcan), memory.clone()))),
            now: Arc::default(),
            touched: Arc::new(AtomicBool::new(false)),
        };
        let core = Interpreter::new(&memory, Some(wiring.clone()))?;
        Ok(Self {
            core,
            wiring,
            fdcan,
            memory,
            image,
            log,
            lines: Vec::new(),
            next_log: LOG_PERIOD,
            profile: Profile::new(),
            now: 0,
            fraction: 0,
            speed: None,
            jump: None,
            hang: None,
            struck: None,
            ready: None,
            reports: Vec::new(),
            restarts: Vec::new(),
        })
    }

    /// Puts FDCAN `index` (0 is FDCAN1) on a bus.
    pub fn connect(&self, index: usize, bus: &rc10_sim::Bus) {
        bus.attach(Rc::new(RefCell::new(Node::new(Arc::clone(&self.fdcan), index))));
    }

    /// How many instructions a second the core executes when its clock is 480 MHz; in proportion
    /// less while it is slower. If never said, each takes the clocks that the interpreter reckons:
    /// those of a Cortex-M4, which waits for one instruction to end before the next begins.
    pub fn set_speed(&mut self, instructions_per_second: u64) {
        self.speed = Some(instructions_per_second.max(1));
    }

    /// The time.
    #[must_use]
    pub const fn now(&self) -> Nanos {
        Nanos::new(self.now)
    }

    /// The program.
    #[must_use]
    pub const fn image(&self) -> &Image {
        &self.image
    }

    /// The memories.
    #[must_use]
    pub const fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Where the instructions went.
    #[must_use]
    pub const fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Starts counting instructions from zero.
    pub fn restart_profile(&mut self) {
        self.profile.restart();
    }

    /// The peripherals but the FDCANs.
    pub fn soc(&self) -> MutexGuard<'_, Soc> {
        self.wiring.soc()
    }

    /// The FDCANs.
    pub fn fdcan(&self) -> MutexGuard<'_, Fdcans> {
        self.fdcan.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The log lines since the last call.
    pub fn take_log(&mut self) -> Vec<LogLine> {
        std::mem::take(&mut self.lines)
    }

    /// When the chip ran on its final clock for the first time.
    #[must_use]
    pub const fn ready(&self) -> Option<Nanos> {
        self.ready
    }

    /// When the last injected fault struck: the program has to execute something first.
    #[must_use]
    pub const fn struck(&self) -> Option<Nanos> {
        self.struck
    }

    /// The first accesses to what does not exist or has no clock.
    #[must_use]
    pub fn reports(&self) -> &[Report] {
        &self.reports
    }

    /// The chip's restarts.
    #[must_use]
    pub fn restarts(&self) -> &[Restart] {
        &self.restarts
    }

    /// Puts a fault into the program, now.
    ///
    /// # Errors
    /// If the program has nothing that could panic.
    pub fn inject(&mut self, fault: Injection) -> Result<()> {
        match fault {
            Injection::HardFault => {
                // UDF #0.
                self.memory.write(INJECTED, &[0x00, 0xDE])?;
                self.jump = Some((INJECTED, [0; 3]));
            }
            Injection::Panic => {
                let panic = "core::panicking::panic_fmt";
                let mut functions = self.image.functions.iter();
                let (&address, _) = functions
                    .find(|(_, name)| *name == panic)
                    .with_context(|| format!("the program has no {panic}"))?;
                // A core::panic::Location: file name, its length, line, column.
                let file = INJECTED + 32;
                let length = u32::try_from(PANIC_FILE.len())?;
                let location = [file, length, PANIC_LINE, 1].map(u32::to_le_bytes);
                self.memory.write(INJECTED, location.as_flattened())?;
                self.memory.write(file, PANIC_FILE.as_bytes())?;
                // Whichever of its arguments the compiler has left: it is the location.
                self.jump = Some((address, [INJECTED; 3]));
            }
            Injection::Hang { exception } => self.hang = Some(exception),
            Injection::MaskInterrupts(masked) => self.core.mask_interrupts(masked),
        }
        Ok(())
    }

    /// Lets chip and world go on up to a time.
    ///
    /// # Errors
    /// If the core locks up, or the program's memory makes no sense.
    pub fn run(&mut self, world: &mut World, until: Nanos) -> Result<()> {
        while self.now < until.get() {
            let mut horizon = world.next_event().min(self.next_log).min(until);
            if let Some(event) = self.wiring.soc().next_event() {
                horizon = horizon.min(event);
            }
            self.execute(horizon.get())?;
            let now = self.now();
            world.advance_to(now);
            let levels = {
                let mut soc = self.wiring.soc();
                soc.advance(now);
                self.ready = self.ready.or(soc.system_ready_at());
                soc.interrupt_levels()
            };
            self.core.set_interrupts(levels);
            self.after(now)?;
        }
        Ok(())
    }

    /// Runs the core up to a time, or until it has touched a peripheral.
    fn execute(&mut self, horizon: u64) -> Result<()> {
        let clock = self.wiring.soc().core_clock_hz().max(1);
        self.wiring.touched.store(false, Ordering::Relaxed);
        loop {
            let address = self.core.program_counter();
            let exception = self.core.exception();
            let (step, mut clocks) = self.core.step();
            match step {
                Step::Instruction => {
                    self.profile.instruction(address, exception, self.core.stack_pointer());
                    if let Some((address, arguments)) = self.jump.take() {
                        self.core.call(address, arguments);
                        self.struck = Some(self.now());
                    }
                }
                Step::Entry(exception) => {
                    self.profile.entry(exception, self.core.stack_pointer());
                    if self.hang == Some(exception) {
                        self.hang = None;
                        // B to itself.
                        self.memory.write(INJECTED, &[0xFE, 0xE7])?;
                        self.core.call(INJECTED, [0; 3]);
                        self.struck = Some(self.now());
                    }
                }
                Step::Asleep => {
                    let nanos = horizon.saturating_sub(self.now);
                    let idle = (u128::from(nanos) * u128::from(clock)).div_ceil(1_000_000_000);
                    let idle = u64::try_from(idle).unwrap_or(u64::MAX).max(clocks);
                    let idle = self.core.clocks_until_timer().map_or(idle, |end| end.min(idle));
                    self.core.sleep(idle.saturating_sub(clocks));
                    clocks = idle;
                }
                Step::LockedUp => bail!("the core locked up at {address:#010x}, {}", self.now()),
            }
            match self.speed {
                // A core that sleeps does not count instructions.
                Some(speed) if step != Step::Asleep => {
                    self.pass(1, (clock.saturating_mul(speed) / FULL_CLOCK_HZ).max(1));
                }
                _ => self.pass(clocks, clock),
            }
            if self.now >= horizon || self.wiring.touched.load(Ordering::Relaxed) {
                return Ok(());
            }
        }
    }

    /// Lets `count` periods of a rate go by.
    fn pass(&mut self, count: u64, rate: u64) {
        let nanos = u128::from(self.fraction) + u128::from(count) * 1_000_000_000;
        let rate = u128::from(rate);
        self.now += u64::try_from(nanos / rate).unwrap_or(u64::MAX);
        // Below the rate, which is 64 bits. Where the rate has changed, less than a nanosecond is
        // off.
        self.fraction = u64::try_from(nanos % rate).unwrap_or(0);
        self.wiring.now.store(self.now, Ordering::Relaxed);
    }

    /// What is not the core's: resets, reports, the log.
    fn after(&mut self, now: Nanos) -> Result<()> {
        self.collect_reports(now);
        let cause = self.wiring.soc().take_reset();
        let cause =
            cause.or_else(|| self.core.take_reset_request().then_some(ResetCause::Software));
        if now >= self.next_log || cause.is_some() {
            self.next_log = now + LOG_PERIOD;
            let messages = self.log.messages(&self.memory)?;
            self.lines.extend(messages.into_iter().map(|text| LogLine { at: now, text }));
        }
        if let Some(cause) = cause {
            self.restarts.push(Restart { at: now, cause });
            self.wiring.soc().reset(cause, now);
            self.core.reset();
            self.log.reset();
            (self.jump, self.hang) = (None, None);
        }
        Ok(())
    }

    fn collect_reports(&mut self, now: Nanos) {
        let accesses = self.wiring.soc().take_reports();
        for access in accesses {
            if self.reports.len() == REPORTS {
                return;
            }
            let address = self.core.program_counter();
            let function = self.image.function_at(address).map_or("?", |(_, name)| name);
            self.reports.push(Report {
                at: now,
                text: format!("{access} by {function}, before {address:#010x}"),
            });
        }
    }
}
