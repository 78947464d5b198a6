//! The signals of each pin, by alternate function. A pin with another one is not
//! connected. Source: stm32-metapac 21.0.0, STM32H723ZG.

use super::gpio::Port;

/// A signal of a peripheral at a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Signal {
    /// FDCAN1 is 0.
    CanReceive(usize),
    CanTransmit(usize),
    /// Index in the table of UARTs.
    SerialReceive(usize),
    SerialTransmit(usize),
    /// Driver enable.
    SerialEnable(usize),
    /// Index in the table of timers, and channel 0 to 3.
    Timer(usize, usize),
    /// A channel's complementary output.
    TimerComplement(usize, usize),
    /// SPI1 is 0.
    SpiClock(usize),
    SpiIn(usize),
    SpiOut(usize),
    /// Index in the table of I2Cs.
    I2cClock(usize),
    I2cData(usize),
}

/// Port, pin, alternate function.
type Place = (char, usize, u32);

#[rustfmt::skip]
const PLACES: &[(Signal, &[Place])] = &[
    (Signal::CanReceive(0), &[('A', 11, 9), ('B', 8, 9), ('D', 0, 9)]),
    (Signal::CanTransmit(0), &[('A', 12, 9), ('B', 9, 9), ('D', 1, 9)]),
    (Signal::CanReceive(1), &[('B', 5, 9), ('B', 12, 9)]),
    (Signal::CanTransmit(1), &[('B', 6, 9), ('B', 13, 9)]),
    (Signal::CanReceive(2), &[('D', 12, 5), ('F', 6, 2), ('G', 10, 2)]),
    (Signal::CanTransmit(2), &[('D', 13, 5), ('F', 7, 2), ('G', 9, 2)]),
    (Signal::SerialReceive(0), &[('A', 10, 7), ('B', 7, 7), ('B', 15, 4)]),
    (Signal::SerialTransmit(0), &[('A', 9, 7), ('B', 6, 7), ('B', 14, 4)]),
    (Signal::SerialReceive(1), &[('A', 3, 7), ('D', 6, 7)]),
    (Signal::SerialTransmit(1), &[('A', 2, 7), ('D', 5, 7)]),
    (Signal::SerialReceive(2), &[('B', 11, 7), ('C', 11, 7), ('D', 9, 7)]),
    (Signal::SerialTransmit(2), &[('B', 10, 7), ('C', 10, 7), ('D', 8, 7)]),
    (Signal::SerialReceive(3), &[('A', 1, 8), ('A', 11, 6), ('B', 8, 8), ('C', 11, 8), ('D', 0, 8)]),
    (Signal::SerialTransmit(3), &[('A', 0, 8), ('A', 12, 6), ('B', 9, 8), ('C', 10, 8), ('D', 1, 8)]),
    (Signal::SerialReceive(4), &[('B', 5, 14), ('B', 12, 14), ('D', 2, 8)]),
    (Signal::SerialTransmit(4), &[('B', 6, 14), ('B', 13, 14), ('C', 12, 8)]),
    (Signal::SerialReceive(5), &[('C', 7, 7), ('G', 9, 7)]),
    (Signal::SerialTransmit(5), &[('C', 6, 7), ('G', 14, 7)]),
    (Signal::SerialReceive(6), &[('A', 8, 11), ('B', 3, 11), ('E', 7, 7), ('F', 6, 7)]),
    (Signal::SerialTransmit(6), &[('A', 15, 11), ('B', 4, 11), ('E', 8, 7), ('F', 7, 7)]),
    (Signal::SerialReceive(7), &[('E', 0, 8)]),
    (Signal::SerialTransmit(7), &[('E', 1, 8)]),
    (Signal::SerialReceive(8), &[('D', 14, 11), ('G', 0, 11)]),
    (Signal::SerialTransmit(8), &[('D', 15, 11), ('G', 1, 11)]),
    (Signal::SerialReceive(9), &[('E', 2, 4), ('G', 11, 4)]),
    (Signal::SerialTransmit(9), &[('E', 3, 11), ('G', 12, 4)]),
    (Signal::SerialEnable(0), &[('A', 12, 7)]),
    (Signal::SerialEnable(1), &[('A', 1, 7), ('D', 4, 7)]),
    (Signal::SerialEnable(2), &[('B', 14, 7), ('D', 12, 7)]),
    (Signal::SerialEnable(3), &[('A', 15, 8), ('B', 14, 8)]),
    (Signal::SerialEnable(4), &[('C', 8, 8)]),
    (Signal::SerialEnable(5), &[('G', 8, 7), ('G', 12, 7)]),
    (Signal::SerialEnable(6), &[('E', 9, 7), ('F', 8, 7)]),
    (Signal::SerialEnable(7), &[('D', 15, 8)]),
    (Signal::SerialEnable(8), &[('D', 13, 11)]),
    (Signal::SerialEnable(9), &[('G', 14, 4)]),
    (Signal::Timer(0, 0), &[('A', 0, 1), ('A', 5, 1), ('A', 15, 1)]),
    (Signal::Timer(0, 1), &[('A', 1, 1), ('B', 3, 1)]),
    (Signal::Timer(0, 2), &[('A', 2, 1), ('B', 10, 1)]),
    (Signal::Timer(0, 3), &[('A', 3, 1), ('B', 11, 1)]),
    (Signal::Timer(1, 0), &[('A', 6, 2), ('B', 4, 2), ('C', 6, 2)]),
    (Signal::Timer(1, 1), &[('A', 7, 2), ('B', 5, 2), ('C', 7, 2)]),
    (Signal::Timer(1, 2), &[('B', 0, 2), ('C', 8, 2)]),
    (Signal::Timer(1, 3), &[('B', 1, 2), ('C', 9, 2)]),
    (Signal::Timer(2, 0), &[('B', 6, 2), ('D', 12, 2)]),
    (Signal::Timer(2, 1), &[('B', 7, 2), ('D', 13, 2)]),
    (Signal::Timer(2, 2), &[('B', 8, 2), ('D', 14, 2)]),
    (Signal::Timer(2, 3), &[('B', 9, 2), ('D', 15, 2)]),
    (Signal::Timer(3, 0), &[('A', 0, 2)]),
    (Signal::Timer(3, 1), &[('A', 1, 2)]),
    (Signal::Timer(3, 2), &[('A', 2, 2)]),
    (Signal::Timer(3, 3), &[('A', 3, 2)]),
    (Signal::Timer(6, 0), &[('B', 14, 2)]),
    (Signal::Timer(6, 1), &[('B', 15, 2)]),
    (Signal::Timer(7, 0), &[('A', 6, 9), ('F', 8, 9)]),
    (Signal::Timer(8, 0), &[('A', 7, 9), ('F', 9, 9)]),
    (Signal::Timer(9, 0), &[('F', 0, 13), ('F', 6, 13), ('G', 12, 13)]),
    (Signal::Timer(9, 1), &[('F', 1, 13), ('F', 7, 13), ('G', 13, 13)]),
    (Signal::Timer(9, 2), &[('F', 2, 13), ('F', 8, 13), ('G', 14, 13)]),
    (Signal::Timer(9, 3), &[('F', 3, 13), ('F', 9, 13)]),
    (Signal::Timer(10, 0), &[('F', 11, 14)]),
    (Signal::Timer(10, 1), &[('F', 12, 14)]),
    (Signal::Timer(10, 2), &[('F', 13, 14)]),
    (Signal::Timer(10, 3), &[('F', 14, 14)]),
    (Signal::Timer(11, 0), &[('A', 8, 1), ('E', 9, 1)]),
    (Signal::Timer(11, 1), &[('A', 9, 1), ('E', 11, 1)]),
    (Signal::Timer(11, 2), &[('A', 10, 1), ('E', 13, 1)]),
    (Signal::Timer(11, 3), &[('A', 11, 1), ('E', 14, 1)]),
    (Signal::TimerComplement(11, 0), &[('A', 7, 1), ('B', 13, 1), ('E', 8, 1)]),
    (Signal::TimerComplement(11, 1), &[('B', 0, 1), ('B', 14, 1), ('E', 10, 1)]),
    (Signal::TimerComplement(11, 2), &[('B', 1, 1), ('B', 15, 1), ('E', 12, 1)]),
    (Signal::Timer(12, 0), &[('C', 6, 3)]),
    (Signal::Timer(12, 1), &[('C', 7, 3)]),
    (Signal::Timer(12, 2), &[('C', 8, 3)]),
    (Signal::Timer(12, 3), &[('C', 9, 3)]),
    (Signal::TimerComplement(12, 0), &[('A', 5, 3), ('A', 7, 3)]),
    (Signal::TimerComplement(12, 1), &[('B', 0, 3), ('B', 14, 3)]),
    (Signal::TimerComplement(12, 2), &[('B', 1, 3), ('B', 15, 3)]),
    (Signal::Timer(13, 0), &[('B', 8, 1), ('F', 6, 1)]),
    (Signal::TimerComplement(13, 0), &[('B', 6, 1), ('F', 8, 1)]),
    (Signal::Timer(14, 0), &[('B', 9, 1), ('F', 7, 1)]),
    (Signal::TimerComplement(14, 0), &[('B', 7, 1), ('F', 9, 1)]),
    (Signal::SpiClock(0), &[('A', 5, 5), ('B', 3, 5), ('G', 11, 5)]),
    (Signal::SpiIn(0), &[('A', 6, 5), ('B', 4, 5), ('G', 9, 5)]),
    (Signal::SpiOut(0), &[('A', 7, 5), ('B', 5, 5), ('D', 7, 5)]),
    (Signal::SpiClock(1), &[('A', 9, 5), ('A', 12, 5), ('B', 10, 5), ('B', 13, 5), ('D', 3, 5)]),
    (Signal::SpiIn(1), &[('B', 14, 5), ('C', 2, 5)]),
    (Signal::SpiOut(1), &[('B', 15, 5), ('C', 1, 5), ('C', 3, 5)]),
    (Signal::SpiClock(2), &[('B', 3, 6), ('C', 10, 6)]),
    (Signal::SpiIn(2), &[('B', 4, 6), ('C', 11, 6)]),
    (Signal::SpiOut(2), &[('B', 2, 7), ('B', 5, 7), ('C', 12, 6), ('D', 6, 5)]),
    (Signal::SpiClock(3), &[('E', 2, 5), ('E', 12, 5)]),
    (Signal::SpiIn(3), &[('E', 5, 5), ('E', 13, 5)]),
    (Signal::SpiOut(3), &[('E', 6, 5), ('E', 14, 5)]),
    (Signal::SpiClock(4), &[('F', 7, 5)]),
    (Signal::SpiIn(4), &[('F', 8, 5)]),
    (Signal::SpiOut(4), &[('F', 9, 5), ('F', 11, 5)]),
    (Signal::I2cClock(0), &[('B', 6, 4), ('B', 8, 4)]),
    (Signal::I2cData(0), &[('B', 7, 4), ('B', 9, 4)]),
    (Signal::I2cClock(1), &[('B', 10, 4), ('F', 1, 4)]),
    (Signal::I2cData(1), &[('B', 11, 4), ('F', 0, 4)]),
    (Signal::I2cClock(2), &[('A', 8, 4)]),
    (Signal::I2cData(2), &[('C', 9, 4)]),
    (Signal::I2cClock(3), &[('A', 8, 6), ('C', 11, 4), ('F', 1, 6)]),
    (Signal::I2cData(3), &[('C', 9, 6), ('C', 10, 4), ('F', 0, 6)]),
];

/// Port (A is 0) and pin that are set up to carry a signal: the first, if there are several.
/// `ports`: A first.
pub(super) fn pin_of(ports: &[Port], signal: Signal) -> Option<(usize, usize)> {
    let of_signal = PLACES.iter().filter(|(other, _)| *other == signal);
    of_signal.flat_map(|(_, places)| *places).find_map(|&(port, pin, function)| {
        let port = port as usize - 'A' as usize;
        (ports.get(port)?.alternate(pin)? == function).then_some((port, pin))
    })
}

/// The signal that a pin carries as it is set up.
pub(super) fn signal_at(ports: &[Port], port: usize, pin: usize) -> Option<Signal> {
    let function = ports.get(port)?.alternate(pin)?;
    let here = (char::from(b'A' + u8::try_from(port).ok()?), pin, function);
    PLACES.iter().find(|(_, places)| places.contains(&here)).map(|&(signal, _)| signal)
}

/// Whether a pin is set up to carry a signal.
pub(super) fn is_connected(ports: &[Port], signal: Signal) -> bool {
    pin_of(ports, signal).is_some()
}
