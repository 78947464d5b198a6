//! Drives every peripheral driver that the robot's firmware does not use, one after the other, and
//! says what came of it: a line each, into the debug probe's buffer and on the line of text.
//!
//! It needs devices at its wires: `tests/firmware/selftest.rs`, or `docs/wiring.md`'s table.
#![no_std]
#![no_main]

mod buses;
mod can;
mod memory;
mod motors;
mod report;
mod serial_ports;
mod timers;

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::peripherals::{
    DMA1_CH7, DMA2_CH4, DMA2_CH5, DMA2_CH6, DMA2_CH7, I2C2, TIM24, USART1, USART3,
};
use embassy_stm32::{bind_interrupts, dma, exti, i2c, timer};
use rc10_board::board::Board;
use rc10_board::{start_pulses, start_serial};
use rc10_bsp::serial::{Serial, SerialConfig};
use rc10_bsp::{dma_buffer, pulse_output, serial};

use crate::report::Report;

rc10_bsp::crash_handlers!();

bind_interrupts!(struct Irqs {
    USART1 => serial::Interrupt<USART1>;
    DMA1_STREAM0 => serial::Interrupt<USART1>;
    DMA1_STREAM1 => serial::Interrupt<USART1>;
    USART3 => serial::Interrupt<USART3>;
    DMA1_STREAM3 => serial::Interrupt<USART3>;
    DMA1_STREAM4 => serial::Interrupt<USART3>;
    DMA1_STREAM7 => pulse_output::Interrupt<DMA1_CH7>;
    DMA2_STREAM4 => dma::InterruptHandler<DMA2_CH4>;
    DMA2_STREAM5 => dma::InterruptHandler<DMA2_CH5>;
    I2C2_EV => i2c::EventInterruptHandler<I2C2>;
    I2C2_ER => i2c::ErrorInterruptHandler<I2C2>;
    DMA2_STREAM6 => dma::InterruptHandler<DMA2_CH6>;
    DMA2_STREAM7 => dma::InterruptHandler<DMA2_CH7>;
    TIM24 => timer::CaptureCompareInterruptHandler<TIM24>;
    EXTI2 => exti::InterruptHandler<embassy_stm32::interrupt::typelevel::EXTI2>;
    EXTI3 => exti::InterruptHandler<embassy_stm32::interrupt::typelevel::EXTI3>;
});

/// Interrupt priority of all peripherals, like that of the robot's firmware.
const PRIORITY: Priority = Priority::P7;

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = Board::new(rc10_bsp::initialise(rc10_board::board::CRYSTAL));
    // embassy-stm32 leaves its own drivers' at the most urgent.
    interrupt::DMA2_STREAM4.set_priority(PRIORITY);
    interrupt::DMA2_STREAM5.set_priority(PRIORITY);
    interrupt::TIM24.set_priority(PRIORITY);
    interrupt::EXTI2.set_priority(PRIORITY);
    interrupt::EXTI3.set_priority(PRIORITY);
    let (ring, buffer) = (dma_buffer!(u8; 64), dma_buffer!(u8; 128));
    let text = SerialConfig::new(115_200);
    let Ok(text) = Serial::start(board.text, Irqs, &text, ring, buffer, PRIORITY) else {
        panic!("115200 baud are possible");
    };
    let mut report = Report::new(text);
    report.run("CAN", can::exchange(board.bus_2, board.standby)).await;
    let echo = start_serial!(board, uart_10, 115_200);
    report.run("serial", serial_ports::echo(echo)).await;
    report.run("serial faults", serial_ports::faults(board.uart_3)).await;
    let line = start_serial!(board, rs485, 4_000_000);
    report.run("RS-485", motors::line(spawner, line)).await;
    report.run("SPI", buses::spi(board.spi)).await;
    report.run("I2C", buses::i2c(board.i2c)).await;
    let (first, second) = (board.servo_1.start(), board.servo_2.start());
    let servos = [first, second, board.servo_3.start(), board.servo_4.start()];
    report.run("servo", timers::servo(servos, board.capture)).await;
    report.run("encoders", timers::encoders(board.encoders)).await;
    report.run("switches", timers::switches(board.switches)).await;
    let pulses = start_pulses!(board);
    report.run("pulses", timers::pulses(pulses)).await;
    report.run("strip", timers::strip(board.strip)).await;
    report.run("memory", memory::protection()).await;
    report.conclude().await;
}
