//! SPI and I2C.

use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_time::{Duration, Instant, with_timeout};
use embedded_hal_async::i2c::I2c as _;
use embedded_hal_async::spi::SpiBus;
use rc10_board::board::{I2cParts, SpiParts};
use rc10_bsp::dma_buffer;
use rc10_bsp::i2c::{I2cBus, I2cError};
use rc10_bsp::spi::DmaSpi;

use crate::report::Outcome;
use crate::{Irqs, PRIORITY, say, want};

/// BMI088 data sheet: registers 0x00 of both halves; reading is bit 7.
const CHIP_ID: u8 = 0x80;
const ACCELEROMETER_ID: u8 = 0x1E;
const GYROSCOPE_ID: u8 = 0x0F;

/// Both halves of a BMI088 identify themselves.
pub async fn spi(parts: SpiParts) -> Outcome {
    let mut config = spi::Config::default();
    // 80 MHz / 16. embassy-stm32 takes the nearest divider, also one that is faster than asked for.
    config.frequency = Hertz(5_000_000);
    // Mode 3; the sensor takes 0 too.
    config.mode = spi::MODE_3;
    let bus = Spi::new(
        parts.peripheral,
        parts.clock,
        parts.transmit,
        parts.receive,
        parts.transmit_stream,
        parts.receive_stream,
        Irqs,
        config,
    );
    let mut bus = DmaSpi::new(bus, dma_buffer!(u8; 20));
    let mut accelerometer = Output::new(parts.accelerometer, Level::High, Speed::Medium);
    let mut gyroscope = Output::new(parts.gyroscope, Level::High, Speed::Medium);
    // The first transaction switches the accelerometer to SPI; its register comes a byte later.
    let mut bytes = [CHIP_ID, 0, 0];
    for _ in 0..2 {
        bytes = [CHIP_ID, 0, 0];
        accelerometer.set_low();
        want!(bus.transfer_in_place(&mut bytes).await.is_ok(), "the transfer failed");
        accelerometer.set_high();
    }
    want!(bytes[2] == ACCELEROMETER_ID, "the accelerometer says {:#04x}", bytes[2]);
    let mut read = [0; 20];
    gyroscope.set_low();
    // Longer than the written text: one transfer all the same.
    let transferred = bus.transfer(&mut read, &[CHIP_ID]).await;
    gyroscope.set_high();
    want!(transferred.is_ok(), "the second transfer failed");
    want!(read[1] == GYROSCOPE_ID, "the gyroscope says {:#04x}", read[1]);
    Ok(say!("a BMI088 says who it is"))
}

/// A device with 256 registers that can be read, and written ..
const DEVICE: u8 = 0x50;
/// .. but for one, ..
const READ_ONLY: u8 = 0;
/// one that holds the clock for ever, ..
const SLEEPER: u8 = 0x51;
/// .. and no node.
const ABSENT: u8 = 0x22;

/// Writes and reads, is refused, waits no longer than allowed, and frees a bus that is held.
pub async fn i2c(parts: I2cParts) -> Outcome {
    let mut bus = I2cBus::start(
        parts.peripheral,
        parts.clock,
        parts.data,
        parts.transmit_stream,
        parts.receive_stream,
        Irqs,
        Hertz(400_000),
        dma_buffer!(u8; 64),
        PRIORITY,
    );
    let mut read = [0; 4];
    want!(bus.write(DEVICE, &[0x10, 1, 2, 3, 4]).await == Ok(()), "cannot write");
    want!(bus.write_read(DEVICE, &[0x11], &mut read[..3]).await == Ok(()), "cannot read");
    want!(read == [2, 3, 4, 0], "read {read:?}");
    let recoveries = bus.recoveries();
    want!(recoveries == 0, "recovered {recoveries} times from nothing");
    let refused = bus.write(ABSENT, &[0]).await;
    want!(refused == Err(I2cError::NoAcknowledge), "without a device the answer is {refused:?}");
    let refused = bus.read(ABSENT, &mut read[..1]).await;
    want!(refused == Err(I2cError::NoAcknowledge), "a byte to no device is {refused:?}");
    // Of what comes behind a refused byte nothing gets into the next transaction.
    let refused = bus.write(DEVICE, &[READ_ONLY, 1, 2, 3]).await;
    want!(refused == Err(I2cError::NoAcknowledge), "wrote what is read-only: {refused:?}");
    want!(bus.write(DEVICE, &[0x20, 9]).await == Ok(()), "cannot write after a refusal");
    want!(bus.write_read(DEVICE, &[0x20], &mut read[..1]).await == Ok(()), "cannot read it");
    want!(read[0] == 9, "read {} after a refusal", read[0]);
    // Dropped in the middle; the next one does not wait for it.
    let began = Instant::now();
    let dropped = with_timeout(Duration::from_micros(60), bus.write(DEVICE, &[0x30; 5])).await;
    want!(dropped.is_err(), "120 us of bytes took less than 60");
    want!(bus.write_read(DEVICE, &[0x12], &mut read[..1]).await == Ok(()), "cannot read after it");
    let took = began.elapsed().as_micros();
    want!(read[0] == 3 && took < 1000, "read {} after {took} us", read[0]);
    let long = bus.write(DEVICE, &[0; 65]).await;
    want!(long == Err(I2cError::TooLong), "took 65 bytes");
    let before = bus.recoveries();
    // The other end holds the data line now, until it has seen some clocks.
    defmt::info!("hold the data line");
    embassy_time::Timer::after_millis(5).await;
    want!(bus.write_read(DEVICE, &[0x12], &mut read[..1]).await == Ok(()), "not recovered");
    want!(read[0] == 3, "read {} after recovery", read[0]);
    let recoveries = bus.recoveries() - before;
    want!(recoveries == 1, "recovered {recoveries} times");
    // False errors of the bus: one, and then two in a row.
    defmt::info!("disturb the bus");
    embassy_time::Timer::after_millis(5).await;
    want!(bus.write(DEVICE, &[0x40, 7]).await == Ok(()), "a spurious error fails a transaction");
    want!(bus.write_read(DEVICE, &[0x40], &mut read[..1]).await == Ok(()), "cannot read after one");
    let (retries, again) = (bus.retries(), bus.recoveries() - before);
    want!(read[0] == 7 && retries == 1, "read {} after {retries} retries", read[0]);
    want!(again == recoveries, "recovered from a spurious error");
    defmt::info!("disturb the bus twice");
    embassy_time::Timer::after_millis(5).await;
    let failed = bus.write(DEVICE, &[0x40, 8]).await;
    want!(failed == Err(I2cError::Bus), "two errors in a row are {failed:?}");
    want!(bus.recoveries() - before == recoveries + 1, "not recovered from two errors");
    let stuck = bus.write(SLEEPER, &[0]).await;
    let in_vain = matches!(stuck, Err(I2cError::Timeout | I2cError::Held));
    want!(in_vain, "the sleeper answered {stuck:?}");
    Ok(say!("freed after {recoveries} recovery"))
}
