//! The board with the STM32H723ZG: its pins. Every pin is checked against its peripheral when this is compiled; so is
//! every DMA stream, and that nothing is used twice. `docs/wiring.md` says the same for people.
//!
//! Sources: the team's `CubeMX` project for CAN, USART1, PPM, LED strip, USB, crystal and debug
//! port; the rest is a proposal of ours.

use embassy_stm32::peripherals::{
    DMA1_CH0, DMA1_CH1, DMA1_CH2, DMA1_CH3, DMA1_CH4, DMA1_CH5, DMA1_CH6, DMA1_CH7, DMA2_CH0,
    DMA2_CH1, DMA2_CH2, DMA2_CH3, DMA2_CH4, DMA2_CH5, DMA2_CH6, DMA2_CH7, EXTI2, EXTI3, EXTI5,
    EXTI6, EXTI7, EXTI8, EXTI9, EXTI10, FDCAN1, FDCAN2, FDCAN3, I2C2, IWDG1, PA0, PA1, PA5, PA6,
    PA7, PC4, PC5, PC6, PC7, PD12, PD13, PD14, PD15, PF0, PF1, PF8, PF9, PF11, PG2, PG3, PG4, PG5,
    PG6, PG7, PG8, PG9, PG10, SPI1, TIM3, TIM4, TIM5, TIM7, TIM13, TIM23, TIM24, UART5, UART7,
    USART1, USART2, USART3, USART10,
};
use embassy_stm32::timer::Ch1;
use embassy_stm32::{Peri, Peripherals};
use rc10_bsp::Crystal;
#[cfg(feature = "black-box")]
use rc10_bsp::black_box;
use rc10_bsp::can::BusParts;
use rc10_bsp::pulse_input;
use rc10_bsp::serial::{ReceiverParts, SerialParts};
use rc10_bsp::servo::ServoParts;
use rc10_bsp::voltage::VoltageParts;
use rc10_motor::Names;
use rc10_tasks::Common;
use rc10_tasks::live::Live;

use crate::{Output, UsbParts};

/// The board's name, as the tools know it.
pub const NAME: &str = "h723zg";

/// The board's chip.
pub const CHIP: &str = "STM32H723ZG";

/// The board's crystal.
pub const CRYSTAL: Crystal = Crystal::new(25_000_000);

/// Whether the board inverts the remote's receiver, as for a DBUS socket. Here the UART does.
pub const REMOTE_HAS_INVERTER: bool = false;

/// What a PC can fetch: the ring in RAM.
#[cfg(feature = "black-box")]
pub const BLACK_BOX: rc10_tasks::live::BlackBox =
    (4 * black_box::WORDS, |word, to| black_box::RC10_BLACK_BOX.copy(word, to));

/// How often the robot is armed until what a crash has left goes.
#[cfg(feature = "black-box")]
pub const ARMED_AFTER_CRASH: u32 = 2;

/// Soldered parts that need a program: this board has none.
pub struct Soldered;

/// Serves what is soldered on.
pub async fn serve<N: Names>(
    _shared: &Common<'_, N, impl Live>,
    _soldered: Soldered,
    _outputs: &[Output],
) {
}

/// The board's parts, by what they are for.
pub struct Board {
    /// FDCAN1: receive PD0, transmit PD1. [`BusParts::with_standby`] drives a standby pin.
    pub bus_1: BusParts<FDCAN1>,
    /// FDCAN2: receive PB12, transmit PB13.
    pub bus_2: BusParts<FDCAN2>,
    /// FDCAN3: receive PF6, transmit PF7.
    pub bus_3: BusParts<FDCAN3>,
    /// A pin for a transceiver's standby, if it has one. The team's project names none.
    pub standby: Peri<'static, PG4>,
    /// A line of text for people, or a link to another computer.
    pub text: SerialParts<USART1, DMA1_CH0, DMA1_CH1>,
    /// The receiver of a remote control that speaks serially. It only talks.
    pub remote: ReceiverParts<UART5, DMA1_CH2>,
    /// A sensor: laser ranging, say.
    pub uart_3: SerialParts<USART3, DMA1_CH3, DMA1_CH4>,
    /// Another one: the IMU's, of a robot that has one.
    pub uart_7: SerialParts<UART7, DMA1_CH5, DMA1_CH6>,
    /// Another one: positioning by tracking wheels, say.
    pub uart_10: SerialParts<USART10, DMA2_CH0, DMA2_CH1>,
    /// RS-485 with driver enable: Unitree motors.
    pub rs485: SerialParts<USART2, DMA2_CH2, DMA2_CH3>,
    /// The receiver of a remote control that speaks in pulses.
    pub pulses: PulseParts,
    /// An LED strip.
    pub strip: StripParts,
    /// An IMU on SPI: BMI088.
    pub spi: SpiParts,
    /// Sensors on I2C. The pull-ups are on the board, or on them.
    pub i2c: I2cParts,
    /// A servo.
    pub servo_1: ServoParts<TIM4, PD12>,
    /// A servo.
    pub servo_2: ServoParts<TIM4, PD13>,
    /// A servo.
    pub servo_3: ServoParts<TIM4, PD14>,
    /// A servo.
    pub servo_4: ServoParts<TIM4, PD15>,
    /// A voltage.
    pub voltage_1: VoltageParts,
    /// A voltage.
    pub voltage_2: VoltageParts,
    /// A voltage.
    pub voltage_3: VoltageParts,
    /// A voltage.
    pub voltage_4: VoltageParts,
    /// A pulse to be measured.
    pub capture: CaptureParts,
    /// Two incremental encoders, one with a counter of 16 bits, one of 32.
    pub encoders: EncoderParts,
    /// Limit switches to ground.
    pub switches: SwitchParts,
    /// USB, as a device of full speed.
    pub usb: UsbParts,
    /// Nothing.
    pub soldered: Soldered,
    /// A timer that drives no pin.
    pub supervisor: Peri<'static, TIM7>,
    /// The independent watchdog.
    pub watchdog: Peri<'static, IWDG1>,
}

/// The interrupt handler of [`PulseParts`]: [`start_pulses!`](crate::start_pulses) binds it.
pub type PulseInterrupt = pulse_input::Interrupt<TIM13, Ch1>;

/// TIM13, channel 1.
pub struct PulseParts {
    /// The timer that notes when the pin rises.
    pub timer: Peri<'static, TIM13>,
    /// The pulses.
    pub pin: Peri<'static, PF8>,
}

/// TIM23, channel 4. (The team's C project uses TIM14 on this pin, which cannot ask a DMA.)
pub struct StripParts {
    /// The timer that makes the pulses.
    pub timer: Peri<'static, TIM23>,
    /// The strip's data.
    pub pin: Peri<'static, PF9>,
    /// The stream that brings their widths.
    pub stream: Peri<'static, DMA1_CH7>,
}

/// SPI1 and two chip selects.
pub struct SpiParts {
    /// The bus.
    pub peripheral: Peri<'static, SPI1>,
    /// SCK.
    pub clock: Peri<'static, PA5>,
    /// MISO.
    pub receive: Peri<'static, PA6>,
    /// MOSI.
    pub transmit: Peri<'static, PA7>,
    /// Receives.
    pub receive_stream: Peri<'static, DMA2_CH4>,
    /// Sends.
    pub transmit_stream: Peri<'static, DMA2_CH5>,
    /// Chip select of the accelerometer.
    pub accelerometer: Peri<'static, PC4>,
    /// Chip select of the gyroscope.
    pub gyroscope: Peri<'static, PC5>,
}

/// I2C2.
pub struct I2cParts {
    /// The bus.
    pub peripheral: Peri<'static, I2C2>,
    /// SCL.
    pub clock: Peri<'static, PF1>,
    /// SDA.
    pub data: Peri<'static, PF0>,
    /// Receives.
    pub receive_stream: Peri<'static, DMA2_CH6>,
    /// Sends.
    pub transmit_stream: Peri<'static, DMA2_CH7>,
}

/// TIM24, channel 1.
pub struct CaptureParts {
    /// The timer that notes the edges.
    pub timer: Peri<'static, TIM24>,
    /// The pulse.
    pub pin: Peri<'static, PF11>,
}

/// TIM3 and TIM5, channels 1 and 2 each.
pub struct EncoderParts {
    /// Counts in 16 bits.
    pub short: Peri<'static, TIM3>,
    /// Tracks A and B of the short counter.
    pub short_tracks: (Peri<'static, PC6>, Peri<'static, PC7>),
    /// Counts in 32 bits.
    pub long: Peri<'static, TIM5>,
    /// Tracks A and B of the long counter.
    pub long_tracks: (Peri<'static, PA0>, Peri<'static, PA1>),
}

/// Inputs, and the interrupt line of each.
pub struct SwitchParts {
    /// Input 1.
    pub input_1: (Peri<'static, PG2>, Peri<'static, EXTI2>),
    /// Input 2.
    pub input_2: (Peri<'static, PG3>, Peri<'static, EXTI3>),
    /// Input 3.
    pub input_3: (Peri<'static, PG5>, Peri<'static, EXTI5>),
    /// Input 4.
    pub input_4: (Peri<'static, PG6>, Peri<'static, EXTI6>),
    /// Input 5.
    pub input_5: (Peri<'static, PG7>, Peri<'static, EXTI7>),
    /// Input 6.
    pub input_6: (Peri<'static, PG8>, Peri<'static, EXTI8>),
    /// Input 7.
    pub input_7: (Peri<'static, PG9>, Peri<'static, EXTI9>),
    /// Input 8.
    pub input_8: (Peri<'static, PG10>, Peri<'static, EXTI10>),
}

impl Board {
    /// Hands out the pins. Nothing is switched on; RS-485's driver enable is pulled to receive.
    #[must_use]
    pub fn new(p: Peripherals) -> Self {
        Self {
            bus_1: BusParts::new(p.FDCAN1, p.PD0, p.PD1),
            bus_2: BusParts::new(p.FDCAN2, p.PB12, p.PB13),
            bus_3: BusParts::new(p.FDCAN3, p.PF6, p.PF7),
            standby: p.PG4,
            // UART, receive pin, transmit pin, stream that receives, stream that sends.
            text: SerialParts::new(p.USART1, p.PB7, p.PB6, p.DMA1_CH0, p.DMA1_CH1),
            remote: ReceiverParts::new(p.UART5, p.PD2, p.DMA1_CH2),
            uart_3: SerialParts::new(p.USART3, p.PD9, p.PD8, p.DMA1_CH3, p.DMA1_CH4),
            uart_7: SerialParts::new(p.UART7, p.PE7, p.PE8, p.DMA1_CH5, p.DMA1_CH6),
            uart_10: SerialParts::new(p.USART10, p.PE2, p.PE3, p.DMA2_CH0, p.DMA2_CH1),
            rs485: SerialParts::new(p.USART2, p.PD6, p.PD5, p.DMA2_CH2, p.DMA2_CH3)
                .with_driver_enable(p.PD4),
            pulses: PulseParts { timer: p.TIM13, pin: p.PF8 },
            strip: StripParts { timer: p.TIM23, pin: p.PF9, stream: p.DMA1_CH7 },
            spi: SpiParts {
                peripheral: p.SPI1,
                clock: p.PA5,
                receive: p.PA6,
                transmit: p.PA7,
                receive_stream: p.DMA2_CH4,
                transmit_stream: p.DMA2_CH5,
                accelerometer: p.PC4,
                gyroscope: p.PC5,
            },
            i2c: I2cParts {
                peripheral: p.I2C2,
                clock: p.PF1,
                data: p.PF0,
                receive_stream: p.DMA2_CH6,
                transmit_stream: p.DMA2_CH7,
            },
            servo_1: ServoParts::new(&p.TIM4, p.PD12),
            servo_2: ServoParts::new(&p.TIM4, p.PD13),
            servo_3: ServoParts::new(&p.TIM4, p.PD14),
            servo_4: ServoParts::new(&p.TIM4, p.PD15),
            voltage_1: VoltageParts::new(&p.ADC1, p.PB0),
            voltage_2: VoltageParts::new(&p.ADC1, p.PB1),
            voltage_3: VoltageParts::new(&p.ADC1, p.PC0),
            voltage_4: VoltageParts::new(&p.ADC1, p.PC1),
            capture: CaptureParts { timer: p.TIM24, pin: p.PF11 },
            encoders: EncoderParts {
                short: p.TIM3,
                short_tracks: (p.PC6, p.PC7),
                long: p.TIM5,
                long_tracks: (p.PA0, p.PA1),
            },
            switches: SwitchParts {
                input_1: (p.PG2, p.EXTI2),
                input_2: (p.PG3, p.EXTI3),
                input_3: (p.PG5, p.EXTI5),
                input_4: (p.PG6, p.EXTI6),
                input_5: (p.PG7, p.EXTI7),
                input_6: (p.PG8, p.EXTI8),
                input_7: (p.PG9, p.EXTI9),
                input_8: (p.PG10, p.EXTI10),
            },
            usb: UsbParts { peripheral: p.USB_OTG_HS, plus: p.PA12, minus: p.PA11 },
            soldered: Soldered,
            supervisor: p.TIM7,
            watchdog: p.IWDG1,
        }
    }
}
