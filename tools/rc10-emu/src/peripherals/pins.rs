//! The pins of each signal, by alternate function. Source: stm32-metapac 21.0.0, STM32H723ZG.

use std::sync::LazyLock;

use super::gpio::Port;
use super::soc::port_index;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Signal {
    /// FDCAN1 is 0.
    CanReceive(usize),
    CanTransmit(usize),
    /// Index in the table of UARTs.
    SerialReceive(usize),
    SerialTransmit(usize),
    SerialEnable(usize),
    /// Index in the table of timers, and channel 0 to 3.
    Timer(usize, usize),
    TimerComplement(usize, usize),
    /// SPI1 is 0.
    SpiClock(usize),
    SpiIn(usize),
    SpiOut(usize),
    /// Index in the table of I2Cs.
    I2cClock(usize),
    I2cData(usize),
    /// Of port 1 of the OCTOSPIs: select, clock, data lines 0 to 3.
    Octo(usize),
}

/// Port (A is 0), pin, alternate function.
type Place = (usize, usize, u32);

/// Signals of a kind, from index or channel 0 on, and a text of places for each.
type Kind = (fn(usize) -> Signal, &'static [&'static str]);

/// All signals, with their pins and alternate functions.
#[rustfmt::skip]
const SIGNALS: &[Kind] = &[
    (Signal::CanReceive, &["A11:9 B8:9 D0:9", "B5:9 B12:9", "D12:5 F6:2 G10:2"]),
    (Signal::CanTransmit, &["A12:9 B9:9 D1:9", "B6:9 B13:9", "D13:5 F7:2 G9:2"]),
    (Signal::SerialReceive, &[
        "A10:7 B7:7 B15:4", "A3:7 D6:7", "B11:7 C11:7 D9:7", "A1:8 A11:6 B8:8 C11:8 D0:8",
        "B5:14 B12:14 D2:8", "C7:7 G9:7", "A8:11 B3:11 E7:7 F6:7", "E0:8", "D14:11 G0:11",
        "E2:4 G11:4",
    ]),
    (Signal::SerialTransmit, &[
        "A9:7 B6:7 B14:4", "A2:7 D5:7", "B10:7 C10:7 D8:7", "A0:8 A12:6 B9:8 C10:8 D1:8",
        "B6:14 B13:14 C12:8", "C6:7 G14:7", "A15:11 B4:11 E8:7 F7:7", "E1:8", "D15:11 G1:11",
        "E3:11 G12:4",
    ]),
    (Signal::SerialEnable, &[
        "A12:7", "A1:7 D4:7", "B14:7 D12:7", "A15:8 B14:8", "C8:8", "G8:7 G12:7", "E9:7 F8:7",
        "D15:8", "D13:11", "G14:4",
    ]),
    (|channel| Signal::Timer(0, channel), &[
        "A0:1 A5:1 A15:1", "A1:1 B3:1", "A2:1 B10:1", "A3:1 B11:1",
    ]),
    (|channel| Signal::Timer(1, channel), &[
        "A6:2 B4:2 C6:2", "A7:2 B5:2 C7:2", "B0:2 C8:2", "B1:2 C9:2",
    ]),
    (|channel| Signal::Timer(2, channel), &[
        "B6:2 D12:2", "B7:2 D13:2", "B8:2 D14:2", "B9:2 D15:2",
    ]),
    (|channel| Signal::Timer(3, channel), &["A0:2", "A1:2", "A2:2", "A3:2"]),
    (|channel| Signal::Timer(6, channel), &["B14:2", "B15:2"]),
    (|channel| Signal::Timer(7, channel), &["A6:9 F8:9"]),
    (|channel| Signal::Timer(8, channel), &["A7:9 F9:9"]),
    (|channel| Signal::Timer(9, channel), &[
        "F0:13 F6:13 G12:13", "F1:13 F7:13 G13:13", "F2:13 F8:13 G14:13", "F3:13 F9:13",
    ]),
    (|channel| Signal::Timer(10, channel), &["F11:14", "F12:14", "F13:14", "F14:14"]),
    (|channel| Signal::Timer(11, channel), &[
        "A8:1 E9:1", "A9:1 E11:1", "A10:1 E13:1", "A11:1 E14:1",
    ]),
    (|channel| Signal::TimerComplement(11, channel), &[
        "A7:1 B13:1 E8:1", "B0:1 B14:1 E10:1", "B1:1 B15:1 E12:1",
    ]),
    (|channel| Signal::Timer(12, channel), &["C6:3", "C7:3", "C8:3", "C9:3"]),
    (|channel| Signal::TimerComplement(12, channel), &["A5:3 A7:3", "B0:3 B14:3", "B1:3 B15:3"]),
    (|channel| Signal::Timer(13, channel), &["B8:1 F6:1"]),
    (|channel| Signal::TimerComplement(13, channel), &["B6:1 F8:1"]),
    (|channel| Signal::Timer(14, channel), &["B9:1 F7:1"]),
    (|channel| Signal::TimerComplement(14, channel), &["B7:1 F9:1"]),
    (Signal::SpiClock, &[
        "A5:5 B3:5 G11:5", "A9:5 A12:5 B10:5 B13:5 D3:5", "B3:6 C10:6", "E2:5 E12:5", "F7:5",
    ]),
    (Signal::SpiIn, &["A6:5 B4:5 G9:5", "B14:5 C2:5", "B4:6 C11:6", "E5:5 E13:5", "F8:5"]),
    (Signal::SpiOut, &[
        "A7:5 B5:5 D7:5", "B15:5 C1:5 C3:5", "B2:7 B5:7 C12:6 D6:5", "E6:5 E14:5", "F9:5 F11:5",
    ]),
    (Signal::I2cClock, &["B6:4 B8:4", "B10:4 F1:4", "A8:4", "A8:6 C11:4 F1:6"]),
    (Signal::I2cData, &["B7:4 B9:4", "B11:4 F0:4", "C9:4", "C9:6 C10:4 F0:6"]),
    (Signal::Octo, &[
        "B6:10 B10:9 C11:9 E11:11 G6:10", "A3:12 B2:9 F10:9", "A2:6 B1:4 B12:12 C3:9 C9:9 D11:9 F8:10",
        "B0:4 C10:9 D12:9 F9:10", "A3:6 A7:10 B13:4 C2:9 E2:9 F7:10", "A1:9 A6:6 D13:9 F6:10",
    ]),
];

static PLACES: LazyLock<Vec<(Signal, Vec<Place>)>> = LazyLock::new(|| {
    let signals = SIGNALS.iter().flat_map(|(signal, places)| {
        let places = places.iter().map(|places| places.split(' ').filter_map(place).collect());
        (0..).map(signal).zip(places)
    });
    signals.collect()
});

fn place(text: &str) -> Option<Place> {
    let (port, rest) = text.split_at_checked(1)?;
    let (pin, function) = rest.split_once(':')?;
    Some((port_index(port.parse().ok()?)?, pin.parse().ok()?, function.parse().ok()?))
}

/// Port (A is 0) and first pin that are set up to carry a signal. `ports`: A first.
pub(super) fn pin_of(ports: &[Port], signal: Signal) -> Option<(usize, usize)> {
    let of_signal = PLACES.iter().filter(|(other, _)| *other == signal);
    of_signal.flat_map(|(_, places)| places).find_map(|&(port, pin, function)| {
        (ports.get(port)?.alternate(pin)? == function).then_some((port, pin))
    })
}

/// The signal that a pin carries as it is set up.
pub(super) fn signal_at(ports: &[Port], port: usize, pin: usize) -> Option<Signal> {
    let function = ports.get(port)?.alternate(pin)?;
    let here = (port, pin, function);
    PLACES.iter().find(|(_, places)| places.contains(&here)).map(|&(signal, _)| signal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_is_read() {
        let texts = SIGNALS.iter().flat_map(|(_, places)| *places).flat_map(|it| it.split(' '));
        let places = PLACES.iter().map(|(_, places)| places.len()).sum::<usize>();
        assert_eq!((places, PLACES.len()), (texts.count(), 111));
        assert!(PLACES.contains(&(Signal::SpiOut(4), vec![(5, 9, 5), (5, 11, 5)])));
    }
}
