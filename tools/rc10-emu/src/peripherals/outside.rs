//! The world at the chip's pins: levels, characters, devices; and faults that come from there.

use rc10_sim::{Nanos, UartFault};

use super::facts::{Facts, I2CS, USARTS};
use super::gpio::{PINS, pins_where};
use super::i2c::I2cDevice;
use super::pins::{Signal, pin_of, signal_at};
use super::soc::{Soc, port_index};
use super::spi::SpiDevice;
use super::timer::{CHANNELS, TIMERS};
use super::usart::{Character, Format, Outgoing, SentByte, Usart};
use crate::board::{Pin, SupplySense};

/// A change of a pin's level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Time of the change.
    pub at: Nanos,
    /// The level from then on.
    pub high: bool,
}

/// Activity of a pin in a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinTime {
    /// Begin of that time.
    pub since: Nanos,
    /// End of it.
    pub until: Nanos,
    /// How long the pin was high.
    pub high: Nanos,
    /// How often it rose.
    pub rises: u64,
    /// The longest time high without a pause, as far back as it was watched or recorded.
    pub longest_high: Nanos,
}

impl PinTime {
    /// Share of the time that the pin was high, 0 ..= 1; 0 of no time.
    pub fn share(&self) -> f64 {
        let time = self.until.since(self.since).get();
        if time == 0 { 0.0 } else { self.high.get() as f64 / time as f64 }
    }
}

impl From<Nanos> for PinTime {
    /// No activity yet, from then on.
    fn from(since: Nanos) -> Self {
        let (high, longest_high) = (Nanos::ZERO, Nanos::ZERO);
        Self { since, until: since, high, rises: 0, longest_high }
    }
}

pub(super) struct Recorder {
    pin: (usize, usize),
    /// The signal that the pin carries now.
    signal: Option<Signal>,
    high: bool,
    edges: Option<Vec<Edge>>,
    /// Time of the last rise; of the recorder's begin, if the pin was high then.
    rose: Nanos,
    /// How long it was high since the recorder is there, up to `time.until`.
    total: Nanos,
    is_watched: bool,
    /// `until` is the time up to which `high` is summed up.
    time: PinTime,
}

impl Recorder {
    fn go_on(&mut self, high: bool, now: Nanos) {
        if self.high {
            self.time.high = self.time.high + now.since(self.time.until);
            self.total = self.total + now.since(self.time.until);
            self.time.longest_high = self.time.longest_high.max(now.since(self.rose));
        }
        self.time.until = now;
        if std::mem::replace(&mut self.high, high) == high {
            return;
        }
        if high {
            self.rose = now;
            self.time.rises += 1;
        }
        if let Some(edges) = &mut self.edges {
            edges.push(Edge { at: now, high });
        }
    }
}

pub(super) struct Jumper {
    from: (usize, usize),
    to: (usize, usize),
    level: Option<bool>,
}

/// Node that holds an I2C's data line low until enough clocks have passed.
pub(super) struct Holder {
    i2c: usize,
    clock: (usize, usize),
    data: (usize, usize),
    clocks: u32,
    clock_was_low: bool,
}

/// Port and number of a pin; `None`: there is no such pin.
fn pin_at(pin: Pin) -> Option<(usize, usize)> {
    port_index(pin.0).filter(|_| pin.1 < PINS).map(|port| (port, pin.1))
}

/// Index of the device with a number in its name.
fn index_of(table: &[Facts], number: u8) -> Option<usize> {
    table.iter().position(|facts| facts.number == number)
}

impl Soc {
    /// Drives a pin (port 'A' ..= 'K', 0 ..= 15) from outside, or lets go. `false`: no such pin.
    pub fn drive_pin(&mut self, port: char, pin: usize, level: Option<bool>, now: Nanos) -> bool {
        self.advance(now);
        let Some((port, pin)) = pin_at((port, pin)) else { return false };
        self.ports[port].drive(pin, level);
        self.pins_changed = true;
        self.settle(now);
        true
    }

    /// The level that the chip drives a pin to, as an output, a timer's channel or a driver's
    /// enable.
    pub fn pin_output(&self, port: char, pin: usize) -> Option<bool> {
        self.output_at(pin_at((port, pin))?)
    }

    fn output_at(&self, (port, pin): (usize, usize)) -> Option<bool> {
        self.output_of((port, pin), signal_at(&self.ports, port, pin))
    }

    fn output_of(&self, (port, pin): (usize, usize), signal: Option<Signal>) -> Option<bool> {
        match signal {
            Some(Signal::Timer(timer, channel)) => self.timers[timer].level(channel, false),
            Some(Signal::TimerComplement(timer, channel)) => {
                self.timers[timer].level(channel, true)
            }
            Some(Signal::SerialEnable(usart)) => self.usarts[usart].driver_level(),
            _ => self.ports[port].output(pin),
        }
    }

    /// Pins of a port that are low because of an I2C that they are connected to, a bit each.
    pub(super) fn held_low(&self, port: usize) -> u32 {
        pins_where(|pin| match signal_at(&self.ports, port, pin) {
            Some(Signal::I2cClock(i2c)) => self.i2cs[i2c].holds_low()[0],
            Some(Signal::I2cData(i2c)) => self.i2cs[i2c].holds_low()[1],
            _ => false,
        })
    }

    /// Keeps from now on the edges of a pin that the chip drives. `false`: no such pin.
    pub fn record_pin(&mut self, port: char, pin: usize, now: Nanos) -> bool {
        let recorder = self.recorder(port, pin, now);
        recorder.map(|recorder| recorder.edges.get_or_insert_default()).is_some()
    }

    /// Sums up from now on how long the chip holds a pin high. `false`: no such pin.
    pub fn watch_pin(&mut self, port: char, pin: usize, now: Nanos) -> bool {
        let Some(recorder) = self.recorder(port, pin, now) else { return false };
        recorder.go_on(recorder.high, now);
        recorder.time = PinTime::from(now);
        recorder.is_watched = true;
        true
    }

    /// What a watched pin did since the last call, or since it is watched; `None`: it is not.
    pub fn take_pin_time(&mut self, port: char, pin: usize, now: Nanos) -> Option<PinTime> {
        self.advance(now);
        let recorder = self.watched(port, pin, now)?;
        Some(std::mem::replace(&mut recorder.time, PinTime::from(now)))
    }

    /// How long a watched pin was high in all; `None`: it is not.
    pub(crate) fn high_time(&mut self, port: char, pin: usize, now: Nanos) -> Option<Nanos> {
        Some(self.watched(port, pin, now)?.total)
    }

    /// The recorder of a pin that is watched, summed up to now.
    fn watched(&mut self, port: char, pin: usize, now: Nanos) -> Option<&mut Recorder> {
        let pin = pin_at((port, pin))?;
        let mut recorders = self.recorders.iter_mut();
        let recorder = recorders.find(|recorder| recorder.pin == pin && recorder.is_watched)?;
        recorder.go_on(recorder.high, now);
        Some(recorder)
    }

    /// The recorder of a pin, which may be a new one.
    fn recorder(&mut self, port: char, pin: usize, now: Nanos) -> Option<&mut Recorder> {
        self.advance(now);
        let pin = pin_at((port, pin))?;
        let known = self.recorders.iter().position(|recorder| recorder.pin == pin);
        let index = known.unwrap_or_else(|| {
            let signal = signal_at(&self.ports, pin.0, pin.1);
            let high = self.output_of(pin, signal) == Some(true);
            self.recorders.push(Recorder {
                pin,
                signal,
                high,
                edges: None,
                rose: now,
                total: Nanos::ZERO,
                is_watched: false,
                time: PinTime::from(now),
            });
            self.recorders.len() - 1
        });
        self.watch();
        self.schedule();
        self.recorders.get_mut(index)
    }

    /// The edges of a recorded pin since the last call.
    pub fn take_edges(&mut self, port: char, pin: usize) -> Vec<Edge> {
        let mut recorders = self.recorders.iter_mut();
        let of_pin = recorders.find(|recorder| Some(recorder.pin) == pin_at((port, pin)));
        of_pin.and_then(|recorder| recorder.edges.as_mut()).map(std::mem::take).unwrap_or_default()
    }

    pub(super) fn record(&mut self, now: Nanos) {
        for index in 0..self.recorders.len() {
            let Recorder { pin, signal, high: before, .. } = self.recorders[index];
            let high = self.output_of(pin, signal) == Some(true);
            if high != before {
                self.recorders[index].go_on(high, now);
            }
        }
    }

    pub(super) fn find_signals(&mut self) {
        for recorder in &mut self.recorders {
            recorder.signal = signal_at(&self.ports, recorder.pin.0, recorder.pin.1);
        }
    }

    /// Puts a wire from a pin that the chip drives to one that listens. `false`: no such pin.
    pub fn join_pins(&mut self, from: Pin, to: Pin, now: Nanos) -> bool {
        self.advance(now);
        let (Some(from), Some(to)) = (pin_at(from), pin_at(to)) else { return false };
        self.jumpers.push(Jumper { from, to, level: None });
        self.pins_changed = true;
        self.settle(now);
        true
    }

    /// Levels go over wires between pins; whether one has changed.
    pub(super) fn carry(&mut self) -> bool {
        let mut changed = false;
        for index in 0..self.jumpers.len() {
            let Jumper { from, to: (port, pin), level } = self.jumpers[index];
            let now = self.output_at(from);
            if now != level {
                self.jumpers[index].level = now;
                self.ports[port].drive(pin, now);
                changed = true;
            }
        }
        self.pins_changed |= changed;
        changed
    }

    fn watch(&mut self) {
        let mut watched = [0_u32; TIMERS.len()];
        let recorded = self.recorders.iter().map(|recorder| recorder.signal);
        let joined = self
            .jumpers
            .iter()
            .map(|Jumper { from: (port, pin), .. }| signal_at(&self.ports, *port, *pin));
        for signal in recorded.chain(joined) {
            if let Some(Signal::Timer(timer, channel) | Signal::TimerComplement(timer, channel)) =
                signal
            {
                watched[timer] |= 1 << channel;
            }
        }
        for (timer, channels) in self.timers.iter_mut().zip(watched) {
            timer.watched = channels;
        }
    }

    /// A level, or its observers, may have changed.
    pub(super) fn look_at_pins(&mut self, now: Nanos) {
        for timer in 0..self.timers.len() {
            if self.timers[timer].listens() {
                self.show_pins(timer, false, now);
            }
        }
        for spi in self.spis.iter_mut().filter(|spi| !spi.devices.is_empty()) {
            spi.look(|(port, pin)| self.ports[port].output(pin) == Some(false), now);
        }
        self.look_at_holders(now);
        if !self.recorders.is_empty() || !self.jumpers.is_empty() {
            self.watch();
        }
    }

    pub(super) fn show_pins(&mut self, timer: usize, fresh: bool, now: Nanos) {
        let levels = (0..CHANNELS).map(|channel| {
            let pin = pin_of(&self.ports, Signal::Timer(timer, channel));
            u32::from(pin.is_some_and(|(port, pin)| self.ports[port].input(pin))) << channel
        });
        let levels = levels.sum();
        self.timers[timer].look(levels, fresh, now);
    }

    /// Sets the voltage at a pin, in microvolts. `false`: it leads to no modelled converter.
    pub fn set_voltage(&mut self, port: char, pin: usize, microvolts: u32, now: Nanos) -> bool {
        self.advance(now);
        self.board().package.bonds(port, pin) && self.adc.set_voltage((port, pin), microvolts)
    }

    /// Sets the board's supply (VIN), in millivolts. `false`: the chip does not measure it.
    pub fn set_supply(&mut self, millivolts: u32, now: Nanos) -> bool {
        self.board().supply_sense.is_some_and(|SupplySense { pin: (port, pin), divider }| {
            let microvolts = u64::from(millivolts) * 1000 / u64::from(divider.max(1));
            self.set_voltage(port, pin, u32::try_from(microvolts).unwrap_or(u32::MAX), now)
        })
    }

    /// Bytes sent at connected pins since the last call, in the order of their ends.
    pub fn take_sent(&mut self) -> Vec<SentByte> {
        let mut sent: Vec<_> =
            self.usarts.iter_mut().flat_map(|usart| std::mem::take(&mut usart.sent)).collect();
        sent.sort_by_key(|byte| (byte.end, byte.uart));
        sent
    }

    /// Feeds bytes to a UART (1 for USART1 ..= 10), one after the other, the first at `start`.
    /// `bits` is a frame's length: 10 for 8N1, 11 for 8E1, 12 for 8E2. `false`: no such UART,
    /// length or rate.
    pub fn feed_serial(
        &mut self,
        uart: u8,
        bytes: &[u8],
        baud: u32,
        bits: u32,
        start: Nanos,
    ) -> bool {
        let Some(format) = Format::of_length(bits).filter(|_| baud != 0) else { return false };
        let mut at = start;
        bytes.iter().all(|&byte| {
            let character = Character::new(byte.into(), format, baud, at);
            at = character.end();
            self.feed_character(uart, character)
        }) && index_of(&USARTS, uart).is_some()
    }

    /// Feeds a character, now or later, after those fed before. `false`: no such UART.
    pub fn feed_character(&mut self, uart: u8, character: Character) -> bool {
        self.with_usart(uart, |usart| usart.receiver.draw(character))
    }

    /// Whether a UART's receiver is on.
    pub fn listens(&self, uart: u8) -> bool {
        index_of(&USARTS, uart).is_some_and(|usart| self.usarts[usart].listens())
    }

    /// Damages the character on its way in, or feeds `otherwise`, damaged. `false`: no such UART.
    pub fn disturb_serial(
        &mut self,
        uart: u8,
        fault: UartFault,
        at: Nanos,
        otherwise: Character,
    ) -> bool {
        self.with_usart(uart, |usart| usart.receiver.disturb(fault, at, otherwise))
    }

    /// Sets the level of a UART's idle line: high unless inverted. `false`: no such UART.
    pub fn set_serial_idle(&mut self, uart: u8, high: bool) -> bool {
        self.with_usart(uart, |usart| usart.receiver.set_idle(high))
    }

    /// Keeps what a UART sends for [`take_outgoing`](Self::take_outgoing). `false`: no such UART.
    pub(crate) fn link_serial(&mut self, uart: u8) -> bool {
        self.with_usart(uart, |usart| usart.transmitter.tells = true)
    }

    /// Does something with a UART from outside. `false`: there is no such UART.
    fn with_usart(&mut self, uart: u8, act: impl FnOnce(&mut Usart)) -> bool {
        let usart = index_of(&USARTS, uart).map(|usart| act(&mut self.usarts[usart]));
        self.schedule();
        usart.is_some()
    }

    pub(crate) fn take_outgoing(&mut self, uart: u8) -> Vec<Outgoing> {
        index_of(&USARTS, uart)
            .map(|usart| std::mem::take(&mut self.usarts[usart].outgoing))
            .unwrap_or_default()
    }

    /// The level of a UART's driver enable pin, if it has one.
    pub fn driver_enable(&self, uart: u8) -> Option<bool> {
        let usart = index_of(&USARTS, uart)?;
        pin_of(&self.ports, Signal::SerialEnable(usart))?;
        self.usarts[usart].driver_level()
    }

    /// Puts a device on an SPI (1 to 5), selected by a low output. `false`: no such SPI or pin.
    pub fn attach_spi(&mut self, spi: u8, select: Pin, device: Box<dyn SpiDevice>) -> bool {
        let spi = usize::from(spi).checked_sub(1).and_then(|index| self.spis.get_mut(index));
        let (Some(spi), Some(select)) = (spi, pin_at(select)) else { return false };
        spi.attach(select, device);
        self.pins_changed = true;
        true
    }

    /// Puts a device on an I2C (1, 2, 3 or 5). `false`: there is no such I2C.
    pub fn attach_i2c(&mut self, i2c: u8, device: Box<dyn I2cDevice>) -> bool {
        index_of(&I2CS, i2c).map(|i2c| self.i2cs[i2c].devices.push(device)).is_some()
    }

    /// Lets an I2C see a false bus error in the next bytes it sends. `false`: no such I2C.
    pub fn disturb_i2c(&mut self, i2c: u8, bytes: u32) -> bool {
        index_of(&I2CS, i2c).map(|i2c| self.i2cs[i2c].disturbed += bytes).is_some()
    }

    /// Lets a device hold an I2C's data line low until it has seen some clocks from the clock pin
    /// as an output. Both lines have pull-ups from now on. `false`: no such I2C or pins.
    pub fn hold_data(&mut self, i2c: u8, clock: Pin, data: Pin, clocks: u32, now: Nanos) -> bool {
        self.advance(now);
        let (Some(i2c), Some(clock), Some(data)) =
            (index_of(&I2CS, i2c), pin_at(clock), pin_at(data))
        else {
            return false;
        };
        self.ports[clock.0].drive(clock.1, Some(true));
        self.ports[data.0].drive(data.1, Some(false));
        self.i2cs[i2c].hold(true, now);
        self.holders.push(Holder { i2c, clock, data, clocks, clock_was_low: false });
        self.pins_changed = true;
        self.settle(now);
        true
    }

    fn look_at_holders(&mut self, now: Nanos) {
        for holder in &mut self.holders {
            let (port, pin) = holder.clock;
            let low = self.ports[port].output(pin) == Some(false);
            let rose = std::mem::replace(&mut holder.clock_was_low, low) && !low;
            holder.clocks -= u32::from(rose && holder.clocks > 0);
        }
        let released = self.holders.extract_if(.., |holder| holder.clocks == 0);
        for Holder { i2c, data: (port, pin), .. } in released {
            self.ports[port].drive(pin, Some(true));
            self.i2cs[i2c].hold(false, now);
            self.pins_changed = true;
        }
    }

    /// Lets the next item of a stream (DMA 1 or 2, stream 0 to 7) fail. `false`: no such stream.
    pub fn inject_dma_error(&mut self, dma: usize, stream: usize) -> bool {
        let dma = dma.checked_sub(1).and_then(|index| self.dmas.get_mut(index));
        let stream = dma.and_then(|dma| dma.streams.get_mut(stream));
        stream.map(|stream| stream.fails = true).is_some()
    }
}
