//! Baud rates.
#![cfg(test)]

#[path = "../src/stm32h723/serial/config.rs"]
mod config;

use config::{BaudError, Parity, SerialConfig, StopBits};

const CLOCK: u32 = 120_000_000;

#[test]
fn the_rates_of_our_devices_are_exact_or_nearly() {
    for (baud, divisor) in [
        (4_000_000, 30),
        (1_000_000, 120),
        (921_600, 130),
        (420_000, 286),
        (230_400, 521),
        (115_200, 1042),
        (100_000, 1200),
        (9600, 12_500),
    ] {
        assert_eq!(SerialConfig::new(baud).divisor(CLOCK), Ok(divisor));
    }
}

#[test]
fn rates_that_cannot_be_are_refused_by_name() {
    for baud in [0, 1, 1200, 1831, 7_600_000, 6_200_000, 12_000_000, u32::MAX] {
        let error = SerialConfig::new(baud).divisor(CLOCK).unwrap_err();
        assert_eq!(error, BaudError { baud, clock: CLOCK });
        assert!(error.to_string().contains(&format!("baud: {baud}")), "{error}");
    }
    assert!(SerialConfig::new(1832).divisor(CLOCK).is_ok());
    assert!(SerialConfig::new(7_500_000).divisor(CLOCK).is_ok());
}

#[test]
fn a_plain_port_is_8n1() {
    let plain = SerialConfig::new(115_200);
    assert_eq!((plain.parity, plain.stop_bits), (Parity::None, StopBits::One));
    assert_ne!((Parity::Even, StopBits::Two), (Parity::Odd, StopBits::One));
    assert!(!plain.invert_receive && !plain.invert_transmit);
}
