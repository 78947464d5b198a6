//! Which pin carries which signal with which alternate function. A pin with another one is not
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
];

/// Whether a pin is set up to carry a signal. `ports`: A first.
pub(super) fn is_connected(ports: &[Port], signal: Signal) -> bool {
    let of_signal = PLACES.iter().filter(|(other, _)| *other == signal);
    of_signal.flat_map(|(_, places)| *places).any(|&(port, pin, function)| {
        ports
            .get(port as usize - 'A' as usize)
            .is_some_and(|port| port.alternate(pin) == Some(function))
    })
}
