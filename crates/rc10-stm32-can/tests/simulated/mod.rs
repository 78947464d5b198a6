//! bxCAN and the small FDCAN at their end of the simulated wire, as ST's manuals describe them
//! (RM0090, bxCAN chapter; RM0440, FDCAN chapter), and the processor that they interrupt.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard};

use rc10_can::{BusError, CanFrame, ErrorState, IdPattern};
use rc10_sim::{
    Activity, Bus, BusConfig, Controller, EscConfig, Model, Nanos, Outcome, TraceEntry, World,
};
use rc10_stm32_can::{BusOff, Ended, Errors, Hardware, MAILBOXES, Port, SharedDriver};
use rc10_time::Micros;

/// Places for received frames, of both.
const FIFO: usize = 3;
/// RM0090 and RM0440: back on the bus after this many sequences of 11 recessive bits.
const RECOVERY: u64 = 128;
const SEQUENCE_NS: u64 = 11_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    BxCan,
    Fdcan,
}

pub const KINDS: [Kind; 2] = [Kind::BxCan, Kind::Fdcan];

/// A mailbox, or a transmit buffer.
#[derive(Clone, Copy)]
struct Mailbox {
    /// TXRQ, or the buffer's bit of TXBRP.
    pending: Option<CanFrame>,
    on_wire: bool,
    /// ABRQ, or the buffer's bit of TXBCR.
    abort: bool,
    /// RQCP with TXOK, or what TXBTO says once TXBRP is clear.
    ended: Option<Ended>,
    /// The abort of a frame that is not on the wire can be seen from then on.
    aborted_at: Option<Nanos>,
}

impl Mailbox {
    const EMPTY: Self =
        Self { pending: None, on_wire: false, abort: false, ended: None, aborted_at: None };
}

pub struct Registers {
    kind: Kind,
    /// From the request until the abort of a frame that is not on the wire can be seen.
    abort_time: Nanos,
    mailboxes: [Mailbox; MAILBOXES],
    offered: Option<usize>,
    fifo: Vec<CanFrame>,
    /// FOVR, or RF0L.
    overrun: bool,
    transmit_errors: u16,
    receive_errors: u16,
    last_error: Option<BusError>,
    /// BOFF, or PSR.BO.
    bus_off: bool,
    /// ERRI of bxCAN, set as it goes bus-off; INIT of FDCAN.
    told_off: bool,
    /// Sequences of recessive bits that are missing, on its way back.
    missing: Option<u64>,
    idle_since: Option<Nanos>,
    patterns: Option<Vec<IdPattern>>,
    interrupt: bool,
    /// Requests of aborts that have no effect, from now on.
    lost_aborts: u32,
    /// Restarts that are not begun, from now on: INAK does not come.
    late_restarts: u32,
    /// Frames that were loaded at this time.
    loaded: (Micros, u32),
}

/// Frames that a driver may load at one time: one that takes them out and in again would go on for ever.
const MOST_LOADED: u32 = 100;

impl Registers {
    const fn new(kind: Kind) -> Self {
        Self {
            kind,
            mailboxes: [Mailbox::EMPTY; MAILBOXES],
            abort_time: Nanos::ZERO,
            offered: None,
            fifo: Vec::new(),
            overrun: false,
            transmit_errors: 0,
            receive_errors: 0,
            last_error: None,
            bus_off: false,
            told_off: false,
            missing: None,
            idle_since: None,
            patterns: None,
            interrupt: false,
            lost_aborts: 0,
            late_restarts: 0,
            loaded: (Micros::ZERO, 0),
        }
    }

    fn end(&mut self, mailbox: usize, ended: Ended) {
        self.mailboxes[mailbox] = Mailbox { ended: Some(ended), ..Mailbox::EMPTY };
        self.interrupt = true;
    }

    fn fail(&mut self, error: BusError) {
        self.last_error = Some(error);
        // ISO 11898-1: one that is error-passive counts no missing acknowledge.
        if error == BusError::Acknowledge && self.transmit_errors >= 128 {
            return;
        }
        self.transmit_errors += 8;
        if self.transmit_errors >= 256 && !self.bus_off {
            // Whatever is in the mailboxes stays there.
            (self.bus_off, self.told_off) = (true, true);
            self.interrupt = self.kind == Kind::Fdcan;
        }
    }

    fn recovered_at(&self) -> Option<Nanos> {
        Some(self.idle_since? + Nanos::new(self.missing? * SEQUENCE_NS))
    }

    fn recover(&mut self, now: Nanos) {
        if self.recovered_at().is_some_and(|at| at <= now) {
            self.missing = None;
            self.bus_off = false;
            (self.transmit_errors, self.receive_errors) = (0, 0);
        }
    }
}

/// The registers that a program sees.
pub struct Wired {
    registers: Arc<Mutex<Registers>>,
    bus_off: BusOff,
}

impl Wired {
    fn registers(&self) -> MutexGuard<'_, Registers> {
        self.registers.lock().unwrap()
    }
}

impl Hardware for Wired {
    fn now(&self) -> Micros {
        rc10_sim::now()
    }

    fn load(&mut self, mailbox: usize, frame: &CanFrame) {
        let (now, mut registers) = (self.now(), self.registers());
        let (at, count) = registers.loaded;
        registers.loaded = (now, if at == now { count + 1 } else { 1 });
        assert!(registers.loaded.1 <= MOST_LOADED, "it loads frames for ever");
        let mailbox = &mut registers.mailboxes[mailbox];
        assert!(mailbox.pending.is_none(), "written while a frame is pending");
        *mailbox = Mailbox { pending: Some(*frame), ..Mailbox::EMPTY };
    }

    fn abort(&mut self, mailbox: usize) {
        let mut registers = self.registers();
        let Mailbox { pending, on_wire, .. } = registers.mailboxes[mailbox];
        if registers.lost_aborts > 0 {
            registers.lost_aborts -= 1;
            return;
        }
        if registers.kind == Kind::Fdcan && registers.bus_off {
            // Nothing says that INIT lets cancellations through.
            return;
        }
        match (pending, on_wire) {
            (Some(_), true) => registers.mailboxes[mailbox].abort = true,
            (Some(_), false) if registers.abort_time == Nanos::ZERO => {
                registers.end(mailbox, Ended::Aborted);
            }
            (Some(_), false) => {
                let at = Nanos::from(rc10_sim::now()) + registers.abort_time;
                registers.mailboxes[mailbox].aborted_at.get_or_insert(at);
            }
            (None, _) => (),
        }
    }

    fn ended(&mut self, mailbox: usize) -> Option<Ended> {
        self.registers().mailboxes[mailbox].ended.take()
    }

    fn receive(&mut self) -> Option<CanFrame> {
        let fifo = &mut self.registers().fifo;
        (!fifo.is_empty()).then(|| fifo.remove(0))
    }

    fn overrun(&mut self) -> bool {
        std::mem::take(&mut self.registers().overrun)
    }

    fn is_off(&mut self) -> bool {
        let mut registers = self.registers();
        if registers.kind == Kind::Fdcan {
            return registers.told_off;
        }
        let (off, fell) = (registers.bus_off, std::mem::take(&mut registers.told_off));
        drop(registers);
        self.bus_off.is_off(off, fell)
    }

    fn errors(&mut self) -> Errors {
        let mut registers = self.registers();
        let Registers { transmit_errors, receive_errors, last_error, .. } = *registers;
        if registers.kind == Kind::Fdcan {
            // Reading PSR clears LEC.
            registers.last_error = None;
        }
        let state = match transmit_errors.max(receive_errors) {
            _ if registers.bus_off => ErrorState::BusOff,
            128.. => ErrorState::Passive,
            96.. => ErrorState::Warning,
            _ => ErrorState::Active,
        };
        Errors {
            state,
            transmit: u8::try_from(transmit_errors).unwrap_or(u8::MAX),
            receive: u8::try_from(receive_errors.min(127)).unwrap(),
            last: last_error,
        }
    }

    fn restart(&mut self) -> bool {
        let mut registers = self.registers();
        if registers.late_restarts > 0 {
            registers.late_restarts -= 1;
            return false;
        }
        if registers.kind == Kind::Fdcan {
            // Setting CCE resets TXBRP, TXBTO and RXF0S.
            for mailbox in 0..MAILBOXES {
                if registers.mailboxes[mailbox].pending.is_some() {
                    registers.end(mailbox, Ended::Aborted);
                }
            }
            registers.fifo.clear();
        }
        registers.told_off = false;
        registers.missing = registers.bus_off.then_some(RECOVERY);
        drop(registers);
        self.bus_off.restarted();
        true
    }

    fn accept(&mut self, patterns: &[IdPattern]) {
        self.registers().patterns = Some(patterns.to_vec());
    }
}

/// A chip: its controller and its processor, which comes to the interrupt late.
pub struct Chip {
    registers: Arc<Mutex<Registers>>,
    shared: &'static SharedDriver<Wired>,
    /// From an event to the interrupt's handler; `None`: it is never called.
    latency: Option<Nanos>,
    handler: Option<Nanos>,
}

impl Chip {
    fn registers(&self) -> MutexGuard<'_, Registers> {
        self.registers.lock().unwrap()
    }

    fn interrupted(&mut self, at: Nanos) {
        if std::mem::take(&mut self.registers().interrupt)
            && let Some(latency) = self.latency
        {
            self.handler.get_or_insert(at + latency);
        }
    }
}

impl Controller for Chip {
    fn is_on_bus(&self) -> bool {
        !self.registers().bus_off
    }

    fn offer(&mut self, _now: Nanos) -> Option<CanFrame> {
        let mut registers = self.registers();
        let pending = |index: &usize| {
            let Mailbox { pending, aborted_at, .. } = registers.mailboxes[*index];
            pending.filter(|_| aborted_at.is_none())
        };
        // "Transmission order by identifier; in case of equal identifier values, the lower mailbox
        // number is scheduled first."
        let first = (0..MAILBOXES)
            .filter(|index| pending(index).is_some())
            .min_by_key(|index| pending(index).map(|frame| (frame.id(), frame.is_remote())));
        registers.offered = first;
        first.and_then(|index| registers.mailboxes[index].pending)
    }

    fn sending(&mut self, _start: Nanos) {
        let mut registers = self.registers();
        let offered = registers.offered.expect("it offered one");
        registers.mailboxes[offered].on_wire = true;
    }

    fn sent(&mut self, outcome: Outcome, end: Nanos) {
        {
            let mut registers = self.registers();
            let sent = registers.mailboxes.iter().position(|mailbox| mailbox.on_wire);
            let sent = sent.expect("one is on the wire");
            registers.mailboxes[sent].on_wire = false;
            match outcome {
                Outcome::Acknowledged => {
                    registers.transmit_errors = registers.transmit_errors.saturating_sub(1);
                    registers.end(sent, Ended::Sent);
                }
                Outcome::Unacknowledged => registers.fail(BusError::Acknowledge),
                Outcome::Destroyed(error) => registers.fail(error),
            }
            // "An abort request while the mailbox is in transmit state [..]: if the transmission
            // fails, the transmission is aborted and the mailbox becomes empty."
            if registers.mailboxes[sent].abort {
                registers.end(sent, Ended::Aborted);
            }
        }
        self.interrupted(end);
    }

    fn received(&mut self, frame: &CanFrame, _start: Nanos, end: Nanos) {
        {
            let mut registers = self.registers();
            registers.receive_errors = registers.receive_errors.saturating_sub(1);
            let wanted = |patterns: &Vec<IdPattern>| patterns.iter().any(|p| p.matches(frame));
            if !registers.patterns.as_ref().is_none_or(wanted) {
                return;
            }
            registers.interrupt = true;
            if registers.fifo.len() == FIFO {
                registers.overrun = true;
                if registers.kind == Kind::Fdcan {
                    // Blocking mode: the new frame is lost.
                    return;
                }
                // RFLM = 0: it overwrites the last one.
                registers.fifo.pop();
            }
            registers.fifo.push(*frame);
        }
        self.interrupted(end);
    }

    fn disturbed(&mut self, error: BusError, _at: Nanos) {
        let mut registers = self.registers();
        registers.receive_errors += 1;
        registers.last_error = Some(error);
    }

    fn wire_is(&mut self, activity: Activity, at: Nanos) {
        let mut registers = self.registers();
        let counted = match (activity, registers.idle_since) {
            (Activity::Idle, _) => 1,
            (Activity::Busy, Some(since)) => at.since(since).get() / SEQUENCE_NS,
            (Activity::Busy, None) => 0,
        };
        registers.missing = registers.missing.map(|missing| missing.saturating_sub(counted));
        registers.idle_since = (activity == Activity::Idle).then_some(at);
        registers.recover(at);
    }

    fn next_event(&self) -> Option<Nanos> {
        let registers = self.registers();
        let aborts = registers.mailboxes.iter().filter_map(|mailbox| mailbox.aborted_at);
        // Of what the program did, between the wire's events.
        let requested = registers.interrupt && self.latency.is_some() && self.handler.is_none();
        let requested = requested.then_some(Nanos::ZERO);
        aborts.chain(self.handler).chain(registers.recovered_at()).chain(requested).min()
    }

    fn advance(&mut self, now: Nanos) {
        {
            let mut registers = self.registers();
            registers.recover(now);
            for mailbox in 0..MAILBOXES {
                if registers.mailboxes[mailbox].aborted_at.is_some_and(|at| at <= now) {
                    registers.end(mailbox, Ended::Aborted);
                }
            }
        }
        self.interrupted(now);
        if self.handler.is_some_and(|at| at <= now) {
            self.handler = None;
            self.shared.on_interrupt();
            // An abort in the handler is nothing that is still to be told.
            self.registers().interrupt = false;
        }
    }
}

/// A chip and one C620 on a wire.
pub struct Bench<P = Port<Wired>> {
    pub world: World,
    pub bus: Bus,
    pub port: P,
    chip: Rc<RefCell<Chip>>,
}

impl Bench {
    /// The interrupt's handler comes 2 µs after the event.
    pub fn new(kind: Kind) -> Self {
        let mut world = World::new(1);
        let bus = world.add_bus(BusConfig::default());
        bus.add_esc(EscConfig::new(Model::C620, 1)).unwrap();
        let registers = Arc::new(Mutex::new(Registers::new(kind)));
        // As the static that it is on a chip.
        let shared: &'static SharedDriver<Wired> = Box::leak(Box::new(SharedDriver::new()));
        let port =
            shared.start(Wired { registers: Arc::clone(&registers), bus_off: BusOff::new() });
        let latency = Some(Nanos::new(2_000));
        let chip = Rc::new(RefCell::new(Chip { registers, shared, latency, handler: None }));
        let controller: Rc<RefCell<dyn Controller>> = Rc::<RefCell<Chip>>::clone(&chip);
        bus.attach(controller);
        Self { world, bus, port, chip }
    }

    /// The port by itself, for a runner.
    pub fn give_port(self) -> (Bench<()>, Port<Wired>) {
        let Self { world, bus, port, chip } = self;
        (Bench { world, bus, port: (), chip }, port)
    }
}

impl<P> Bench<P> {
    /// From an event to the interrupt's handler.
    pub fn set_latency(&self, latency: Option<u64>) {
        self.chip.borrow_mut().latency = latency.map(Nanos::new);
    }

    /// From the request until the abort of a frame that is not on the wire can be seen.
    pub fn set_abort_time(&self, nanos: u64) {
        self.chip.borrow().registers().abort_time = Nanos::new(nanos);
    }

    /// The next requests of aborts have no effect.
    pub fn lose_aborts(&self, count: u32) {
        self.chip.borrow().registers().lost_aborts = count;
    }

    /// The next restarts are not begun.
    pub fn delay_restarts(&self, count: u32) {
        self.chip.borrow().registers().late_restarts = count;
    }

    /// Lets this many microseconds pass.
    pub fn pass(&mut self, micros: u64) {
        self.world.advance(self.world.now() + Micros::new(micros));
    }

    /// The frames that the chip has sent since the last call.
    pub fn sent(&self) -> Vec<TraceEntry> {
        let mut trace = self.bus.take_trace();
        trace.retain(|entry| entry.from_controller);
        trace
    }
}
