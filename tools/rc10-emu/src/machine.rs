//! The chip as a whole: a program in its memories, time, and faults.

use std::cell::RefCell;
use std::collections::{BTreeSet, VecDeque};
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard};

use anyhow::{Context, Result, ensure};
use rc10_sim::{Nanos, World};

use crate::board::Board;
use crate::core::{Core, Step};
use crate::fault::ChipFault;
use crate::fdcan::{Fdcans, Node};
use crate::image::Image;
use crate::links::Links;
use crate::log::Log;
use crate::memory::{FLASH, Memory};
use crate::parts::Parts;
use crate::peripherals::{PinTime, ResetCause, Soc, lock};
use crate::profile::Profile;
use crate::time::{NANOS_PER_SECOND, periods_in};

/// Core clock at which [`Machine::set_speed`]'s figure holds: what RC10's firmware runs at.
const FULL_CLOCK_HZ: u64 = 480_000_000;
const LOG_PERIOD: Nanos = Nanos::new(1_000_000);
/// Code for injected faults, in the otherwise unused ITCM: an undefined instruction, ..
const UNDEFINED: u32 = 0x0000_0000;
/// .. a loop for a fault that masks interrupts, ..
const MASKED: u32 = 0x0000_0010;
/// .. a panic's location and the name of its file, ..
const LOCATION: u32 = 0x0000_0020;
const FILE_NAME: u32 = 0x0000_0030;
/// .. and for each exception the code that stands in for its handler: an instruction and a word.
const STAND_INS: u32 = 0x0000_0100;
/// `UDF #0`.
const UDF: [u8; 2] = [0x00, 0xDE];
/// `B` to itself.
const BRANCH_TO_SELF: [u8; 2] = [0xFE, 0xE7];
/// `LDR.W PC, [PC]`: goes on at the address in the next word.
const JUMP: [u8; 4] = [0xDF, 0xF8, 0x00, 0xF0];
/// Source location of an injected panic.
/// Protected memory into which the core may look ahead: the flash takes it for a breach (Zephyr 60449).
const PROTECTED: u32 = 0x1FF0_0000;
const PANIC_FILE: &str = "injected.rs";
const PANIC_LINE: u32 = 2300;

/// A line of the program's log, or a report: of a refused access, a pin that leads nowhere, a bit
/// rate that is not the bus's, or a core that locked up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// Time since power-on; in the log, the time at which a debug probe would have read it.
    pub at: Nanos,
    /// Description; in the log, level and message.
    pub text: String,
}

/// A line of the program's log.
pub type LogLine = Report;

/// Reports kept in full; more are only counted.
const REPORTS: usize = 32;

/// A restart of the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Restart {
    /// Time since power-on.
    pub at: Nanos,
    /// Cause of the reset.
    pub cause: ResetCause,
}

/// Differences between chips, and choices where the manual can be read in two ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Whether the FDCANs' clock calibration unit has to be bypassed before a controller may send:
    /// RM0399 59.4.5 says so, ST's HAL does not do it, and works. `true` if not said.
    pub calibration_needed: bool,
    /// Whether `RCC_RSR.RMVF` stays set until the program clears it, and holds the reset flags at
    /// zero ("set and reset by software"; ST's HAL only sets it). `true` if not said.
    pub removal_stays: bool,
    /// Whether RAM written before the supply is configured is reported: forbidden (RM0468, power
    /// control), and done by every start-up code, ST's own too. `false` if not said.
    pub reports_early_ram: bool,
    /// The board that the chip is on. The team's own if not said.
    pub board: Board,
    /// Deviation of the chip's own oscillator (HSI), in millionths: up to 1 % on a real one (data
    /// sheet, HSI characteristics). 0 if not said.
    pub hsi_deviation_ppm: i32,
    /// Whether the switches of PC2 and PC3 (`SYSCFG_PMCR`) are closed after a reset, which RM0468
    /// leaves to the package. A program that needs these pins has to close them. `true` if not
    /// said.
    pub switches_closed: bool,
    /// Names (`map::MAP`) of peripherals that say nothing, as in an emulator without them: they
    /// read as zero, take nothing, and report nothing. `ADC1` includes its common registers.
    pub silent: &'static [&'static str],
    /// Seed of the noise in all RAM when power comes, the FDCANs' too. 1 if not said.
    pub seed: u64,
}

impl Default for Options {
    /// The stricter reading of what can be read in two ways.
    fn default() -> Self {
        Self {
            calibration_needed: true,
            removal_stays: true,
            reports_early_ram: false,
            board: Board::H723ZG,
            hsi_deviation_ppm: 0,
            switches_closed: true,
            silent: &[],
            seed: 1,
        }
    }
}

/// How far one of two chips may be ahead of the other.
const AHEAD: Nanos = Nanos::new(5000);

/// Injected faults that have not struck yet.
#[derive(Default)]
struct Faults {
    /// Address and arguments at which the program goes on when it next executes anything.
    jumps: VecDeque<(u32, [u32; 3])>,
    /// The exceptions whose handlers are to hang when they are called next.
    hangs: BTreeSet<u16>,
    /// Whether interrupts are to be masked as soon as they are not.
    is_mask_due: bool,
    /// Whether something is in `jumps`, or a mask is due.
    is_due: bool,
}

/// An emulated STM32H723 with a program in its flash.
///
/// It has no wires of its own: [`connect`](Self::connect) puts its FDCANs on buses of a [`World`],
/// [`connect_serial`](Self::connect_serial) and its like its UARTs and pins on lines, and
/// [`run`](Self::run) lets chip and world go through time together.
pub struct Machine {
    core: Core,
    soc: Arc<Mutex<Soc>>,
    fdcan: Arc<Mutex<Fdcans>>,
    /// Buses with the index of their FDCAN, until a wrong bit rate is told.
    buses: RefCell<Vec<(usize, rc10_sim::Bus)>>,
    /// The parts beside the chip.
    pub parts: Parts,
    pub(crate) links: Links,
    /// The memories.
    pub memory: Memory,
    /// The program.
    pub image: Image,
    log: Log,
    lines: Vec<LogLine>,
    next_log: Nanos,
    /// Profile of the instructions.
    pub profile: Profile,
    /// Instructions per second at the full clock, if not as many as the clocks allow.
    speed: Option<u64>,
    /// Of a clock: what an instruction took at that speed beyond whole ones, in 1/speed.
    part: u64,
    faults: Faults,
    is_locked_up: bool,
    /// The core waits for the flash until then.
    stalled_until: Nanos,
    /// Time at which the last injected fault struck: the program has to execute something first.
    pub struck: Option<Nanos>,
    /// Time at which the chip ran on its final clock for the first time.
    pub ready: Option<Nanos>,
    /// The first accesses to what does not exist or has no clock.
    pub reports: Vec<Report>,
    /// The chip's restarts.
    pub restarts: Vec<Restart>,
}

impl Machine {
    /// Creates a chip, just switched on, with the program of an ELF file in its flash. Fails if the
    /// file is no program, does not fit into the memories, or says nonsense about its board.
    pub fn new(file: &[u8]) -> Result<Self> {
        Self::with(file, Options::default())
    }

    /// Creates a chip with other options than the strictest. Fails as [`new`](Self::new) does, and
    /// if a peripheral that is to be silent does not exist.
    pub fn with(file: &[u8], options: Options) -> Result<Self> {
        let image = Image::parse(file)?;
        let log = Log::new(file, &image)?;
        let memory = Memory::with(&image, options.seed)?;
        let [stack, start] = [memory.word(FLASH)?, memory.word(FLASH + 4)?];
        // The stack is full at first: its pointer may stand right behind a memory.
        ensure!(
            memory.word(stack.wrapping_sub(4)).is_ok() && start & 1 == 1 && image.holds(start & !1),
            "no vector table at {FLASH:#010x}: this is no program for an STM32H7"
        );
        let mut fdcan = Fdcans::new(options.seed);
        fdcan.set_calibration_needed(options.calibration_needed);
        fdcan.set_transceivers(options.board.transceivers);
        let fdcan = Arc::new(Mutex::new(fdcan));
        let mut soc = Soc::new(options, Arc::clone(&fdcan), memory.clone());
        for name in options.silent {
            ensure!(soc.silence(name), "there is no peripheral {name}");
        }
        let parts = Parts::new(&options.board, &mut soc, options.seed);
        if let Some((port, pin)) = options.board.key {
            soc.drive_pin(port, pin, Some(true), Nanos::ZERO);
        }
        let soc = Arc::new(Mutex::new(soc));
        let core = Core::new(&memory, Some(Arc::clone(&soc)));
        Ok(Self {
            core,
            soc,
            fdcan,
            buses: RefCell::default(),
            parts,
            links: Links::default(),
            memory,
            image,
            log,
            lines: Vec::new(),
            next_log: LOG_PERIOD,
            profile: Profile::new(),
            speed: None,
            part: 0,
            faults: Faults::default(),
            is_locked_up: false,
            stalled_until: Nanos::ZERO,
            struck: None,
            ready: None,
            reports: Vec::new(),
            restarts: Vec::new(),
        })
    }

    /// Puts FDCAN `index` (0 is FDCAN1) on a bus.
    pub fn connect(&self, index: usize, bus: &rc10_sim::Bus) {
        bus.attach(Rc::new(RefCell::new(Node::new(Arc::clone(&self.fdcan), index))));
        self.buses.borrow_mut().push((index, bus.clone()));
    }

    /// Sums up from now on how long the chip holds a pin (port 'A' ..= 'K', 0 ..= 15) high. Fails
    /// if the chip has no such pin.
    pub fn watch_pin(&mut self, port: char, pin: usize) -> Result<()> {
        ensure!(lock(&self.soc).watch_pin(port, pin, self.now()), "there is no pin P{port}{pin}");
        Ok(())
    }

    /// What a watched pin did since the last call, or since it is watched; `None`: it is not.
    pub fn take_pin_time(&mut self, port: char, pin: usize) -> Option<PinTime> {
        lock(&self.soc).take_pin_time(port, pin, self.now())
    }

    /// Keeps from now on every edge of a pin that the chip drives. Fails if the chip has no such
    /// pin.
    pub fn record_pin(&mut self, port: char, pin: usize) -> Result<()> {
        ensure!(lock(&self.soc).record_pin(port, pin, self.now()), "there is no pin P{port}{pin}");
        Ok(())
    }

    /// The priority of an external interrupt now: 0, the most urgent, to 15.
    pub fn priority(&self, interrupt: u16) -> u8 {
        // 16 exceptions of the core come before; of eight bits the upper four exist.
        self.core.priority(16 + interrupt) >> 4
    }

    /// Sets the instructions a second of the core at 480 MHz; in proportion less while it is
    /// slower. If never said, each takes the clocks of a Cortex-M4. The buses' clocks on the way to
    /// a peripheral come on top.
    pub fn set_speed(&mut self, instructions_per_second: u64) {
        (self.speed, self.part) = (Some(instructions_per_second.max(1)), 0);
    }

    /// The time.
    pub const fn now(&self) -> Nanos {
        Nanos::new(self.core.bus.time.now())
    }

    /// The board that it is on.
    pub fn board(&self) -> Board {
        lock(&self.soc).board()
    }

    /// The function that an address lies in; of a [hung](ChipFault::Hang) handler that handler.
    pub fn function_at(&self, address: u32) -> Option<&str> {
        let handler = |exception| self.memory.word(FLASH + 4 * exception).ok();
        let address = stood_in(address).map_or(Some(address), handler)?;
        Some(self.image.function_at(address)?.1)
    }

    /// The peripherals but the FDCANs.
    pub fn soc(&self) -> MutexGuard<'_, Soc> {
        lock(&self.soc)
    }

    /// The FDCANs.
    pub fn fdcan(&self) -> MutexGuard<'_, Fdcans> {
        lock(&self.fdcan)
    }

    /// The log lines since the last call.
    pub fn take_log(&mut self) -> Vec<LogLine> {
        std::mem::take(&mut self.lines)
    }

    #[cfg(test)]
    pub(crate) const fn core(&self) -> &Core {
        &self.core
    }

    /// Number of the exception that a handler handles; external interrupts start at 16. Fails if
    /// the program has no such handler.
    pub(crate) fn exception_of(&self, handler: &str) -> Result<u16> {
        let address = self.image.symbol(handler)?;
        // 16 exceptions of the core, then 163 interrupts (RM0468, NVIC chapter).
        let vector = |number: u16| self.memory.word(FLASH + 4 * u32::from(number)).ok();
        let number = (1..16 + 163).find(|&number| vector(number) == Some(address));
        number.with_context(|| format!("{handler} handles no exception"))
    }

    /// Lets a fault begin now, or end if it has an end. Fails if the program has nothing that could
    /// panic, or no such handler.
    pub fn inject(&mut self, fault: &ChipFault, begins: bool) -> Result<()> {
        self.faults.is_due = true;
        match fault {
            ChipFault::HardFault => {
                self.memory.write(UNDEFINED, &UDF)?;
                self.faults.jumps.push_back((UNDEFINED, [0; 3]));
            }
            ChipFault::Panic => {
                let panic = "core::panicking::panic_fmt";
                let mut functions = self.image.functions.iter();
                let (&address, _) = functions
                    .find(|(_, name)| *name == panic)
                    .with_context(|| format!("the program has no {panic}"))?;
                // A core::panic::Location: file name, its length, line, column.
                let length = u32::try_from(PANIC_FILE.len())?;
                let location = [FILE_NAME, length, PANIC_LINE, 1].map(u32::to_le_bytes);
                self.memory.write(LOCATION, location.as_flattened())?;
                self.memory.write(FILE_NAME, PANIC_FILE.as_bytes())?;
                // Whichever of its arguments the compiler has left: it is the location.
                self.faults.jumps.push_back((address, [LOCATION; 3]));
            }
            ChipFault::Hang(handler) => {
                let exception = self.exception_of(handler)?;
                if begins {
                    self.memory.write(stand_in(exception), &BRANCH_TO_SELF)?;
                    self.faults.hangs.insert(exception);
                } else if !self.faults.hangs.remove(&exception) {
                    // Nothing of the handler has run yet.
                    let handler = self.memory.word(FLASH + 4 * u32::from(exception))?;
                    let stand_in = stand_in(exception);
                    self.memory.write(stand_in + 4, &handler.to_le_bytes())?;
                    self.memory.write(stand_in, &JUMP)?;
                }
            }
            ChipFault::Mask if begins => {
                self.memory.write(MASKED, &BRANCH_TO_SELF)?;
                self.faults.is_mask_due = !self.core.hold(MASKED);
            }
            ChipFault::Mask => {
                if !std::mem::take(&mut self.faults.is_mask_due) {
                    self.core.release();
                }
            }
            ChipFault::CrystalStops | ChipFault::CrystalDead => self.set_crystal(!begins),
            ChipFault::CutPower if begins => {
                self.memory.lose(self.now().get());
                self.parts.memory.iter().for_each(|memory| memory.cut(self.now()));
                lock(&self.soc).reset(ResetCause::PowerOn, self.now());
                self.core.reset();
                self.faults = Faults::default();
                self.stalled_until = Nanos::new(u64::MAX);
            }
            ChipFault::CutPower => self.restart(ResetCause::PowerOn),
        }
        Ok(())
    }

    /// The board's crystal stops swinging, now, or can swing again.
    pub fn set_crystal(&mut self, alive: bool) {
        let now = self.now();
        let mut soc = lock(&self.soc);
        soc.set_crystal(alive, now);
        self.core.set_nmi(soc.nmi());
    }

    /// Whether ADC1 fails from now on: no conversion, calibration or start ends before it does no
    /// longer. Flags that are set stay.
    pub fn set_adc_fails(&mut self, fails: bool) {
        lock(&self.soc).set_adc_fails(fails, self.now());
    }

    /// The voltage at a pin from outside, in microvolts, from now on. Fails if the pin does not
    /// lead outside, or to no converter that is modelled.
    pub fn set_voltage(&mut self, port: char, pin: usize, microvolts: u32) -> Result<()> {
        let known = lock(&self.soc).set_voltage(port, pin, microvolts, self.now());
        ensure!(known, "no converter measures at P{port}{pin}");
        Ok(())
    }

    /// The board's supply (VIN) in millivolts, from now on, where the chip measures it. Fails if
    /// the chip does not, on this board.
    pub fn set_supply(&mut self, millivolts: u32) -> Result<()> {
        let now = self.now();
        let mut soc = lock(&self.soc);
        let name = soc.board().name;
        ensure!(soc.set_supply(millivolts, now), "the chip on {name} does not measure its supply");
        self.parts.advance(&mut soc, now);
        self.parts.supply = millivolts;
        Ok(())
    }

    /// Presses the board's key, or lets go of it. Fails if the board has none.
    pub fn press_key(&mut self, pressed: bool) -> Result<()> {
        let now = self.now();
        let mut soc = lock(&self.soc);
        let board = soc.board();
        let (port, pin) = board.key.with_context(|| format!("{} has no key", board.name))?;
        soc.drive_pin(port, pin, Some(!pressed), now);
        Ok(())
    }

    /// Lets chip and world go on up to a time. Fails if the program's memory makes no sense.
    pub fn run(&mut self, world: &mut World, until: Nanos) -> Result<()> {
        while self.now() < until {
            self.go_on(world, until, None)?;
        }
        Ok(())
    }

    /// Lets two chips and their world go on up to a time. One is ahead of the other by at most 5 us, and hears what the other
    /// does by so much too late: less than a tenth of the shortest frame.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_with(&mut self, other: &mut Self, world: &mut World, until: Nanos) -> Result<()> {
        loop {
            let (late, early) = if self.now() <= other.now() {
                (&mut *self, &*other)
            } else {
                (&mut *other, &*self)
            };
            if late.now() >= until {
                return Ok(());
            }
            late.go_on(world, until, Some(early.now()))?;
        }
    }

    /// Lets the chip go on up to the next event, and the world as far as all chips are.
    fn go_on(&mut self, world: &mut World, until: Nanos, other: Option<Nanos>) -> Result<()> {
        if other.is_some() {
            // The world has gone on since it was here.
            self.hear_interrupts(self.now());
        }
        let next_of_world = world.next_event();
        let mut horizon = next_of_world.min(self.next_log).min(until);
        if let Some(event) = lock(&self.soc).next_event() {
            horizon = horizon.min(event);
        }
        if let Some(other) = other {
            horizon = horizon.min(other + AHEAD);
        }
        self.execute(horizon.get());
        let now = self.now();
        let all = other.map_or(now, |other| other.min(now));
        if self.links.is_empty() {
            world.advance_to(all);
        } else {
            self.talk(world, next_of_world, all);
        }
        self.hear_interrupts(now);
        self.after(now)
    }

    fn hear_interrupts(&mut self, now: Nanos) {
        let (levels, nmi) = {
            let mut soc = lock(&self.soc);
            soc.advance(now);
            soc.take_changed();
            self.ready = self.ready.or(soc.system_ready_at());
            self.stalled_until = soc.take_stall().unwrap_or(self.stalled_until);
            let (memories, guards, flash) =
                (soc.memories_run(), soc.guards_ram(), soc.flash_state());
            self.core.bus.set_memories(memories, guards, flash);
            (soc.interrupt_levels(), soc.nmi())
        };
        self.core.set_interrupts(levels);
        self.core.set_nmi(nmi);
    }

    /// Chip and world exchange the levels of their lines, in the order of time, up to now.
    fn talk(&mut self, world: &mut World, mut next_of_world: Nanos, now: Nanos) {
        let mut soc = lock(&self.soc);
        loop {
            let next = soc.next_event().map_or(next_of_world, |event| event.min(next_of_world));
            world.advance_to(next.min(now));
            self.links.hear(&mut soc, next.min(now));
            soc.advance(next.min(now));
            self.links.speak(&mut soc, next.min(now));
            if next >= now {
                return;
            }
            next_of_world = world.next_event();
        }
    }

    /// Runs the core up to a time, or until it has changed something outside.
    fn execute(&mut self, horizon: u64) {
        let clock = lock(&self.soc).clocks().core;
        let now = self.now();
        self.core.bus.touched = false;
        if clock == 0 || self.stalled_until > now {
            // Nothing is executed, and no interrupt taken.
            let end = if clock == 0 { horizon } else { horizon.min(self.stalled_until.get()) };
            let end = end.max(now.get());
            self.core.wait(periods_in(Nanos::new(end - now.get()), clock));
            self.core.bus.time.wait_until(end);
            return;
        }
        self.core.bus.time.count_in(clock);
        let mut is_over = false;
        while !is_over {
            is_over = match self.speed {
                None if !self.faults.is_due => self.execute_many(horizon, clock),
                _ => self.execute_one(horizon, clock),
            };
        }
    }

    /// Lets the core do steps of the same exception; whether that was all for now.
    fn execute_many(&mut self, horizon: u64, clock: u64) -> bool {
        let exception = self.core.exception();
        let begin = self.core.bus.time.periods;
        let end = self.core.bus.time.periods_at(horizon);
        let mut instructions = 0;
        let is_over = loop {
            let address = self.core.program_counter();
            let (step, clocks) = self.core.step();
            if step != Step::Instruction {
                self.profile.spend(exception, instructions, self.core.bus.time.periods - begin);
                return self.stepped(step, clocks, address, exception, horizon, clock);
            }
            self.profile.instruction(address, self.core.stack_pointer());
            instructions += 1;
            self.core.bus.time.periods += clocks + self.core.take_waited();
            let is_over = self.core.bus.time.periods >= end || self.core.bus.touched;
            if is_over || self.core.exception() != exception {
                break is_over;
            }
        };
        self.profile.spend(exception, instructions, self.core.bus.time.periods - begin);
        is_over
    }

    /// Lets the core do one step; whether that was all for now.
    fn execute_one(&mut self, horizon: u64, clock: u64) -> bool {
        let (address, exception) = (self.core.program_counter(), self.core.exception());
        let (step, clocks) = self.core.step();
        self.stepped(step, clocks, address, exception, horizon, clock)
    }

    /// The core has done a step from an address in an exception; whether that was all for now.
    fn stepped(
        &mut self,
        step: Step,
        mut clocks: u64,
        address: u32,
        exception: u16,
        horizon: u64,
        clock: u64,
    ) -> bool {
        let mut instructions = 0;
        match step {
            Step::Instruction => {
                self.profile.instruction(address, self.core.stack_pointer());
                instructions = 1;
                if self.faults.is_due {
                    self.fail();
                }
            }
            Step::Entry(exception) => {
                self.profile.entry(exception, self.core.stack_pointer());
                if self.faults.hangs.remove(&exception) {
                    self.core.call(stand_in(exception), [0; 3]);
                    self.struck = Some(self.now());
                }
            }
            Step::Asleep | Step::LockedUp => {
                if step == Step::LockedUp && !std::mem::replace(&mut self.is_locked_up, true) {
                    self.report(format!("the core locked up at {address:#010x}"));
                }
                clocks = self.rest(horizon, clocks, clock);
            }
        }
        match self.speed {
            // A core that sleeps does not count instructions.
            Some(speed) if !matches!(step, Step::Asleep | Step::LockedUp) => {
                let rate = (clock.saturating_mul(speed) / FULL_CLOCK_HZ).max(1);
                self.core.bus.time.pass(1, rate);
                self.part += FULL_CLOCK_HZ;
                let taken = self.part / speed;
                self.part %= speed;
                self.core.correct_cycles(taken.cast_signed() - clocks.cast_signed());
                clocks = taken;
            }
            // The log is read every millisecond: nothing lasts longer.
            _ => self.core.bus.time.pass(clocks.min(u32::MAX.into()), clock),
        }
        let waited = self.core.take_waited();
        if waited > 0 {
            self.core.bus.time.pass(waited, clock);
        }
        self.profile.spend(exception, instructions, clocks + waited);
        self.now().get() >= horizon || self.core.bus.touched
    }

    #[cold]
    fn fail(&mut self) {
        if let Some((address, arguments)) = self.faults.jumps.pop_front() {
            self.core.call(address, arguments);
            self.struck = Some(self.now());
        } else if self.faults.is_mask_due {
            self.faults.is_mask_due = !self.core.hold(MASKED);
        }
        self.faults.is_due = self.faults.is_mask_due || !self.faults.jumps.is_empty();
    }

    /// The core sleeps until a time, or until its own timer ends: for how many clocks. Some of them
    /// are counted.
    fn rest(&mut self, horizon: u64, clocks: u64, rate: u64) -> u64 {
        let nanos = horizon.saturating_sub(self.now().get());
        let idle = (u128::from(nanos) * u128::from(rate)).div_ceil(NANOS_PER_SECOND);
        let idle = u64::try_from(idle).unwrap_or(u64::MAX).max(clocks);
        let idle = self.core.clocks_until_timer().map_or(idle, |end| end.min(idle));
        self.core.sleep(idle.saturating_sub(clocks));
        idle
    }

    /// Everything outside the core: resets, reports, the log.
    fn after(&mut self, now: Nanos) -> Result<()> {
        let reported = self.collect_reports();
        let cause = lock(&self.soc).take_reset();
        let cause =
            cause.or_else(|| self.core.take_reset_request().then_some(ResetCause::Software));
        // Earlier messages of the program come first.
        if now >= self.next_log || cause.is_some() || reported {
            self.next_log = now + LOG_PERIOD;
            let messages = self.log.messages(&self.memory)?;
            self.lines.extend(messages.into_iter().map(|text| Report { at: now, text }));
            self.compare_bit_rates();
            self.parts.advance(&mut lock(&self.soc), now);
            if self.core.looks_ahead(PROTECTED) {
                lock(&self.soc).speculate(now);
            }
        }
        if let Some(cause) = cause {
            self.restart(cause);
        }
        Ok(())
    }

    /// Restarts the chip, now. RAM keeps its contents, whatever the cause, but for a last word that was written in part.
    pub fn restart(&mut self, cause: ResetCause) {
        let now = self.now();
        self.memory.drop_partial();
        self.restarts.push(Restart { at: now, cause });
        lock(&self.soc).reset(cause, now);
        self.core.reset();
        self.log.reset();
        (self.faults, self.is_locked_up) = (Faults::default(), false);
        self.stalled_until = Nanos::ZERO;
    }

    /// Tells, once for each bus, that a controller's bits have another length than its bus's.
    fn compare_bit_rates(&mut self) {
        let mut texts = Vec::new();
        let fdcan = lock(&self.fdcan);
        self.buses.get_mut().retain(|(index, bus)| {
            let Some((own, bit)) = fdcan.bit_rate(*index) else { return true };
            let follows = bus.follows(bit);
            if !follows {
                let of_bus = 1_000_000_000 / bus.bit_time_ns().max(1);
                let (number, own, of_bus) = (index + 1, kilobits(own), kilobits(of_bus));
                texts.push(format!("FDCAN{number} runs at {own}, its bus at {of_bus}"));
            }
            follows
        });
        drop(fdcan);
        texts.into_iter().for_each(|text| self.report(text));
    }

    fn report(&mut self, text: String) {
        if self.reports.len() < REPORTS {
            self.reports.push(Report { at: self.now(), text });
        }
    }

    /// Whether there were any.
    fn collect_reports(&mut self) -> bool {
        let accesses = lock(&self.soc).take_reports();
        for access in &accesses {
            let address = self.core.program_counter();
            let function = self.image.function_at(address).map_or("?", |(_, name)| name);
            self.report(format!("{access} by {function}, before {address:#010x}"));
        }
        !accesses.is_empty()
    }
}

/// Bits a second in kbit/s, with one decimal where there is one.
fn kilobits(bits_per_second: u64) -> String {
    format!("{} kbit/s", ((bits_per_second + 50) / 100) as f64 / 10.0)
}

/// The exception that a stand-in for a handler is for.
fn stood_in(address: u32) -> Option<u32> {
    address.checked_sub(STAND_INS).map(|offset| offset / 8).filter(|&exception| exception < 256)
}

fn stand_in(exception: u16) -> u32 {
    STAND_INS + 8 * u32::from(exception)
}
