//! A line that carries pulses: what counts is when its edges come.

use std::any::Any;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::{Poll, Waker};

use rc10_time::Micros;

use crate::Nanos;
use crate::world::Inner;

/// Edges that the host's port keeps; of more, the oldest are lost.
const KEPT: usize = 64;

/// The electronics of a device that sends pulses.
pub trait PulseDevice: Any {
    /// Power has come: everything volatile starts afresh. Its output is low.
    fn power_on(&mut self, now: Nanos);

    /// The time at which its output may change. In the past means now.
    fn next_event(&self) -> Option<Nanos>;

    /// The level of its output from now on.
    fn advance(&mut self, now: Nanos) -> bool;
}

/// The input of an emulated chip, in place of the host's port.
pub trait PulseEnd {
    /// The line's level from now on. Told when it is attached, and at every edge.
    fn level(&mut self, high: bool, at: Nanos);
}

/// One line and its device.
pub(crate) struct PulseLine {
    device: Box<dyn PulseDevice>,
    powered: bool,
    cut: bool,
    /// The level at the device's output, and the level that arrives.
    output: bool,
    level: bool,
    edges: VecDeque<Micros>,
    lost: u64,
    reader: Option<Waker>,
    chip: Option<Rc<RefCell<dyn PulseEnd>>>,
}

impl PulseLine {
    pub(crate) fn new(mut device: Box<dyn PulseDevice>, now: Nanos) -> Self {
        device.power_on(now);
        Self {
            device,
            powered: true,
            cut: false,
            output: false,
            level: false,
            edges: VecDeque::new(),
            lost: 0,
            reader: None,
            chip: None,
        }
    }

    pub(crate) fn next_event(&self, now: Nanos) -> Option<Nanos> {
        let device = if self.powered { self.device.next_event() } else { None };
        device.map(|at| at.max(now))
    }

    pub(crate) fn process(&mut self, now: Nanos) {
        if self.powered && self.device.next_event().is_some_and(|at| at <= now) {
            self.output = self.device.advance(now);
        }
        self.settle(now);
    }

    /// Sets the level that arrives, by the level at the output.
    fn settle(&mut self, now: Nanos) {
        let level = self.output && self.powered && !self.cut;
        if std::mem::replace(&mut self.level, level) == level {
            return;
        }
        if let Some(chip) = &self.chip {
            chip.borrow_mut().level(level, now);
        } else if level {
            if self.edges.len() == KEPT {
                self.edges.pop_front();
                self.lost += 1;
            }
            self.edges.push_back(now.micros());
        }
    }

    pub(crate) fn take_waker(&mut self) -> Option<Waker> {
        if self.edges.is_empty() { None } else { self.reader.take() }
    }
}

/// A pulse line of a [`World`](crate::World): a device, and an input of the host's.
#[derive(Clone)]
pub struct Pulses {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
}

impl Pulses {
    /// The host's input; all of them share the edges.
    pub fn port(&self) -> PulsePort {
        PulsePort { line: self.clone() }
    }

    /// Puts the input of an emulated chip in the place of the host's port.
    pub fn attach(&self, chip: Rc<RefCell<dyn PulseEnd>>) {
        self.line(|line, now| {
            chip.borrow_mut().level(line.level, now);
            line.chip = Some(chip);
        });
    }

    /// Cuts the line, or connects it again: cut it is low.
    pub fn set_cut(&self, cut: bool) {
        self.line(|line, now| {
            line.cut = cut;
            line.settle(now);
        });
    }

    /// Switches the device's power; it has it at first.
    pub fn set_power(&self, powered: bool) {
        self.line(|line, now| {
            if std::mem::replace(&mut line.powered, powered) != powered && powered {
                line.output = false;
                line.device.power_on(now);
            }
            line.settle(now);
        });
    }

    /// A look into the device, or a hand: `None` if it is not a `D`.
    pub fn with<D: PulseDevice, T>(&self, look: impl FnOnce(&mut D) -> T) -> Option<T> {
        self.line(|line, _| {
            let device: &mut dyn Any = &mut *line.device;
            device.downcast_mut().map(look)
        })
    }

    /// Edges that were not taken in time.
    pub fn lost(&self) -> u64 {
        self.line(|line, _| line.lost)
    }

    fn line<T>(&self, f: impl FnOnce(&mut PulseLine, Nanos) -> T) -> T {
        Inner::with(&self.inner, |inner, now| f(&mut inner.pulses[self.index], now))
    }
}

/// The host's input at its end of a [`Pulses`] line, which notes when rising edges come.
#[derive(Clone)]
pub struct PulsePort {
    line: Pulses,
}

impl PulsePort {
    /// The time of the next rising edge that was not taken yet; waits for it.
    pub async fn rising_edge(&mut self) -> Micros {
        poll_fn(|context| {
            self.line.line(|line, _| match line.edges.pop_front() {
                Some(edge) => Poll::Ready(edge),
                None => {
                    line.reader = Some(context.waker().clone());
                    Poll::Pending
                }
            })
        })
        .await
    }
}
