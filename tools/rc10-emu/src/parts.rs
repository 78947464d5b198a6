//! The parts beside the chip on a board: an IMU, a heater for it, a key.
//!
//! Motion and temperature change once a millisecond, with the log, and with reports and restarts.

use std::sync::{Arc, Mutex};

use rc10_sim::imu::bmi088::{Bmi088, Motion, Part};
use rc10_sim::{Base, Nanos};

use crate::board::{Board, Heater};
use crate::peripherals::{Soc, SpiDevice, lock};
use crate::w25q64::W25Q64;

/// A BMI088 on an SPI, switched on at time zero: one handle of it, as its two halves are.
#[derive(Clone, Debug, Default)]
pub struct Imu(Arc<Mutex<Bmi088>>);

impl Imu {
    /// Looks at it, or changes what it feels.
    pub fn with<R>(&self, with: impl FnOnce(&mut Bmi088) -> R) -> R {
        with(&mut lock(&self.0))
    }

    /// One of its two chips, to be attached to an SPI.
    pub fn half(&self, part: Part) -> impl SpiDevice + use<> {
        Half { imu: self.clone(), part }
    }
}

struct Half {
    imu: Imu,
    part: Part,
}

impl SpiDevice for Half {
    fn understands(&self, mode: u8, clock_hz: u64) -> bool {
        Bmi088::understands(mode, clock_hz)
    }

    fn select(&mut self, _now: Nanos) {
        self.imu.with(|imu| imu.select(self.part));
    }

    fn deselect(&mut self, now: Nanos) {
        self.imu.with(|imu| imu.deselect(self.part, now));
    }

    fn exchange(&mut self, sent: u16, now: Nanos) -> u16 {
        // It does not know frames of another length than a byte.
        let sent = u8::try_from(sent & 0xFF).unwrap_or(0);
        self.imu.with(|imu| imu.exchange(self.part, sent, now)).into()
    }
}

/// The warming of an IMU beside a heater: a first-order law. The numbers are assumptions that fit
/// the notes of `COD_UniFramework_H7`: a duty of 5 % was too little for 40 °C, 25 % enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermal {
    /// °C of everything around, and of the die at power-on.
    pub ambient: f64,
    /// Kelvin above the ambient for each watt, in the end.
    pub kelvin_per_watt: f64,
    /// Time constant, seconds.
    pub time_constant: f64,
}

impl Default for Thermal {
    /// 25 °C, 12 K/W, 30 s.
    fn default() -> Self {
        Self { ambient: 25.0, kelvin_per_watt: 12.0, time_constant: 30.0 }
    }
}

impl Thermal {
    /// The temperature in °C after some seconds with a power in watts.
    pub fn after(&self, celsius: f64, watts: f64, seconds: f64) -> f64 {
        let in_the_end = self.ambient + self.kelvin_per_watt * watts;
        in_the_end + (celsius - in_the_end) * (-seconds / self.time_constant).exp()
    }
}

/// The parts beside a chip.
pub struct Parts {
    /// The board's BMI088.
    pub imu: Option<Imu>,
    /// The board's W25Q64JV.
    pub memory: Option<W25Q64>,
    heater: Option<Heater>,
    /// How the heater warms the IMU.
    pub thermal: Thermal,
    /// Millivolts.
    pub(crate) supply: u32,
    /// The base that the IMU is in the middle of, level.
    pub base: Option<Base>,
    /// How long the heater was on, at the time of the last look.
    heated: (Nanos, Nanos),
}

impl Parts {
    /// Puts a board's parts on its chip's pins.
    pub(crate) fn new(board: &Board, soc: &mut Soc, seed: u64) -> Self {
        let thermal = Thermal::default();
        let imu = board.imu.map(|wiring| {
            let imu = Imu::default();
            imu.with(|imu| imu.celsius = thermal.ambient);
            for (part, select) in [
                (Part::Accelerometer, wiring.accelerometer_select),
                (Part::Gyroscope, wiring.gyroscope_select),
            ] {
                soc.attach_spi(wiring.spi, select, Box::new(imu.half(part)));
            }
            imu
        });
        if let Some(Heater { pin: (port, pin), .. }) = board.heater {
            soc.watch_pin(port, pin, Nanos::ZERO);
        }
        let memory = board.memory.map(|_| {
            let memory = W25Q64::new(seed);
            soc.attach_memory(Box::new(memory.clone()));
            memory
        });
        soc.set_supply(board.supply, Nanos::ZERO);
        let heated = (Nanos::ZERO, Nanos::ZERO);
        Self {
            imu,
            memory,
            heater: board.heater,
            thermal,
            supply: board.supply,
            base: None,
            heated,
        }
    }

    /// Motion and temperature of the IMU now: called once a millisecond.
    pub(crate) fn advance(&mut self, soc: &mut Soc, now: Nanos) {
        let Some(imu) = &self.imu else { return };
        if let Some(base) = &self.base {
            let motion = Motion::of(base);
            imu.with(|imu| imu.motion = motion);
        }
        let Some(Heater { pin: (port, pin), ohms }) = self.heater else { return };
        let on = soc.high_time(port, pin, now).unwrap_or(Nanos::ZERO);
        let (last, on_before) = std::mem::replace(&mut self.heated, (now, on));
        let (passed, heated) = (now.since(last).get(), on.since(on_before).get());
        if passed == 0 {
            return;
        }
        let volts = f64::from(self.supply) / 1000.0;
        let watts = heated as f64 / passed as f64 * volts * volts / f64::from(ohms.max(1));
        let seconds = passed as f64 / 1e9;
        imu.with(|imu| imu.celsius = self.thermal.after(imu.celsius, watts, seconds));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At 24 V on 47 ohms.
    #[test]
    fn a_duty_of_5_per_cent_is_too_little_for_40_degrees_and_25_per_cent_is_not() {
        let thermal = Thermal::default();
        let warmest = |duty: f64| thermal.after(25.0, duty * 24.0 * 24.0 / 47.0, 1000.0);
        assert!(warmest(0.05) < 35.0, "{}", warmest(0.05));
        assert!((50.0..70.0).contains(&warmest(0.25)), "{}", warmest(0.25));
        assert!((thermal.after(40.0, 0.0, 1e6) - 25.0).abs() < 1e-9);
        // Two halves of a time are that time.
        let half = thermal.after(thermal.after(25.0, 1.0, 5.0), 1.0, 5.0);
        assert!((half - thermal.after(25.0, 1.0, 10.0)).abs() < 1e-12);
    }
}
