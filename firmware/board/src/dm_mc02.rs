//! The Damiao DM-MC02: its pins, and what is soldered on.
//!
//! Source: the maker's schematic of 2024-01-24, pin map of 2024-01-27 and manual 1.1, which agree with the projects of
//! a dozen teams (`docs/dm-mc02.md`). It has an STM32H723VGT6, three CAN transceivers without a standby
//! pin and with 120 ohms each, and an inverter before the remote's UART. Nothing here was tried on the board.

#[cfg(feature = "black-box")]
mod matches;
mod soldered;

use embassy_stm32::peripherals::{
    DMA1_CH0, DMA1_CH1, DMA1_CH2, DMA1_CH3, DMA1_CH4, DMA1_CH5, DMA1_CH6, DMA1_CH7, DMA2_CH0,
    DMA2_CH1, DMA2_CH2, DMA2_CH3, DMA2_CH4, DMA2_CH5, EXTI0, EXTI1, EXTI8, EXTI9, EXTI10, EXTI11,
    EXTI12, EXTI14, EXTI15, FDCAN1, FDCAN2, FDCAN3, IWDG1, PA0, PA2, PA7, PA15, PB1, PB8, PB9,
    PB13, PB15, PC0, PC1, PC2, PC3, PC10, PC11, PC12, PC13, PC14, PC15, PD14, PE0, PE1, PE9, PE13,
    PE14, SPI2, TIM1, TIM3, TIM4, TIM5, TIM7, TIM8, TIM12, UART5, UART7, USART1, USART2, USART3,
    USART10,
};
use embassy_stm32::timer::Ch3;
use embassy_stm32::{Peri, Peripherals, pac};
use rc10_bsp::Crystal;
use rc10_bsp::can::BusParts;
use rc10_bsp::pulse_input;
use rc10_bsp::serial::{ReceiverParts, SerialParts};
use rc10_bsp::servo::ServoParts;
use rc10_bsp::voltage::VoltageParts;

use crate::UsbParts;

#[cfg(feature = "black-box")]
pub use matches::BLACK_BOX;
pub use soldered::{SETTLING, serve};

/// The board's name, as the tools know it.
pub const NAME: &str = "dm-mc02";

/// The board's chip.
pub const CHIP: &str = "STM32H723VG";

/// The board's crystal.
pub const CRYSTAL: Crystal = Crystal::new(24_000_000);

/// The remote's socket is for DBUS and SBUS, with an NPN inverter before the pin.
pub const REMOTE_HAS_INVERTER: bool = true;

/// How often the robot is armed until what a crash has left in RAM goes: the serial flash has it, too.
#[cfg(feature = "black-box")]
pub const ARMED_AFTER_CRASH: u32 = 1;

/// The board's parts, by what they are for.
pub struct Board {
    /// FDCAN1: receive PD0, transmit PD1.
    pub bus_1: BusParts<FDCAN1>,
    /// FDCAN2: receive PB5, transmit PB6.
    pub bus_2: BusParts<FDCAN2>,
    /// FDCAN3: receive PD12, transmit PD13.
    pub bus_3: BusParts<FDCAN3>,
    /// A line of text for people, or a link to another computer.
    pub text: SerialParts<USART1, DMA1_CH0, DMA1_CH1>,
    /// The receiver of a remote control that speaks serially. It only talks.
    pub remote: ReceiverParts<UART5, DMA1_CH2>,
    /// RS-485 with driver enable: Unitree motors. The maker's "485-2".
    pub rs485: SerialParts<USART2, DMA2_CH2, DMA2_CH3>,
    /// The other one, "485-1".
    pub rs485_2: SerialParts<USART3, DMA1_CH3, DMA1_CH4>,
    /// UART7, with the switched 5 V.
    pub uart_7: SerialParts<UART7, DMA1_CH5, DMA1_CH6>,
    /// USART10, with the switched 5 V.
    pub uart_10: SerialParts<USART10, DMA2_CH0, DMA2_CH1>,
    /// A servo, with the switched 5 V.
    pub servo_1: ServoParts<TIM1, PE9>,
    /// A servo, with the switched 5 V.
    pub servo_2: ServoParts<TIM1, PE13>,
    /// A servo, with the switched 5 V. (TIM2, the maker's for this pin and the next, keeps the time.)
    pub servo_3: ServoParts<TIM5, PA0>,
    /// A servo, with the switched 5 V.
    pub servo_4: ServoParts<TIM5, PA2>,
    /// A voltage, at the LCD's socket.
    pub voltage_1: VoltageParts,
    /// The receiver of a remote control that speaks in pulses, at the expansion header.
    pub pulses: PulseParts,
    /// Switches to ground, at the expansion header.
    pub switches: SwitchParts,
    /// USB, as a device of full speed.
    pub usb: UsbParts,
    /// Soldered parts, for [`serve`].
    pub soldered: Soldered,
    /// A timer that drives no pin.
    pub supervisor: Peri<'static, TIM7>,
    /// The independent watchdog.
    pub watchdog: Peri<'static, IWDG1>,
}

/// The interrupt handler of [`PulseParts`]: [`start_pulses!`](crate::start_pulses) binds it.
pub type PulseInterrupt = pulse_input::Interrupt<TIM4, Ch3>;

/// TIM4, channel 3.
pub struct PulseParts {
    /// The timer that notes when the pin rises.
    pub timer: Peri<'static, TIM4>,
    /// The pulses.
    pub pin: Peri<'static, PD14>,
}

/// Inputs, and the interrupt line of each. PE0 and PE1 would be UART8's, whose interrupt an executor has.
pub struct SwitchParts {
    /// Input 1.
    pub input_1: (Peri<'static, PE14>, Peri<'static, EXTI14>),
    /// Input 2.
    pub input_2: (Peri<'static, PE0>, Peri<'static, EXTI0>),
    /// Input 3.
    pub input_3: (Peri<'static, PE1>, Peri<'static, EXTI1>),
    /// Input 4.
    pub input_4: (Peri<'static, PC10>, Peri<'static, EXTI10>),
    /// Input 5.
    pub input_5: (Peri<'static, PC11>, Peri<'static, EXTI11>),
    /// Input 6.
    pub input_6: (Peri<'static, PC12>, Peri<'static, EXTI12>),
    /// Input 7.
    pub input_7: (Peri<'static, PB8>, Peri<'static, EXTI8>),
    /// Input 8.
    pub input_8: (Peri<'static, PB9>, Peri<'static, EXTI9>),
}

/// Soldered parts that need a program.
pub struct Soldered {
    outputs: OutputPins,
    imu: ImuParts,
    heater: (Peri<'static, TIM3>, Peri<'static, PB1>),
    lamp: (Peri<'static, TIM8>, Peri<'static, PA7>, Peri<'static, DMA1_CH7>),
    buzzer: (Peri<'static, TIM12>, Peri<'static, PB15>),
    supply: VoltageParts,
    key: (Peri<'static, PA15>, Peri<'static, EXTI15>),
    #[cfg(feature = "black-box")]
    memory: matches::MemoryParts,
}

/// Those of [`Output::ALL`], pulled down by 1 kOhm: off until switched on, and in a restart.
type OutputPins = (Peri<'static, PC14>, Peri<'static, PC13>, Peri<'static, PC15>);

/// A BMI088 on SPI2, and its chip selects.
struct ImuParts {
    peripheral: Peri<'static, SPI2>,
    clock: Peri<'static, PB13>,
    receive: Peri<'static, PC2>,
    transmit: Peri<'static, PC1>,
    receive_stream: Peri<'static, DMA2_CH4>,
    transmit_stream: Peri<'static, DMA2_CH5>,
    accelerometer: Peri<'static, PC0>,
    gyroscope: Peri<'static, PC3>,
}

impl Board {
    /// Hands out the pins. Nothing is switched on; RS-485's driver enable is pulled to receive.
    #[must_use]
    pub fn new(p: Peripherals) -> Self {
        close_analogue_switches();
        Self {
            bus_1: BusParts::new(p.FDCAN1, p.PD0, p.PD1),
            bus_2: BusParts::new(p.FDCAN2, p.PB5, p.PB6),
            bus_3: BusParts::new(p.FDCAN3, p.PD12, p.PD13),
            // UART, receive pin, transmit pin, stream that receives, stream that sends.
            text: SerialParts::new(p.USART1, p.PA10, p.PA9, p.DMA1_CH0, p.DMA1_CH1),
            remote: ReceiverParts::new(p.UART5, p.PD2, p.DMA1_CH2),
            rs485: SerialParts::new(p.USART2, p.PD6, p.PD5, p.DMA2_CH2, p.DMA2_CH3)
                .with_driver_enable(p.PD4),
            rs485_2: SerialParts::new(p.USART3, p.PD9, p.PD8, p.DMA1_CH3, p.DMA1_CH4)
                .with_driver_enable(p.PB14),
            uart_7: SerialParts::new(p.UART7, p.PE7, p.PE8, p.DMA1_CH5, p.DMA1_CH6),
            uart_10: SerialParts::new(p.USART10, p.PE2, p.PE3, p.DMA2_CH0, p.DMA2_CH1),
            servo_1: ServoParts::new(&p.TIM1, p.PE9),
            servo_2: ServoParts::new(&p.TIM1, p.PE13),
            servo_3: ServoParts::new(&p.TIM5, p.PA0),
            servo_4: ServoParts::new(&p.TIM5, p.PA2),
            voltage_1: VoltageParts::new(&p.ADC1, p.PA5),
            pulses: PulseParts { timer: p.TIM4, pin: p.PD14 },
            switches: SwitchParts {
                input_1: (p.PE14, p.EXTI14),
                input_2: (p.PE0, p.EXTI0),
                input_3: (p.PE1, p.EXTI1),
                input_4: (p.PC10, p.EXTI10),
                input_5: (p.PC11, p.EXTI11),
                input_6: (p.PC12, p.EXTI12),
                input_7: (p.PB8, p.EXTI8),
                input_8: (p.PB9, p.EXTI9),
            },
            usb: UsbParts { peripheral: p.USB_OTG_HS, plus: p.PA12, minus: p.PA11 },
            soldered: Soldered {
                outputs: (p.PC14, p.PC13, p.PC15),
                imu: ImuParts {
                    peripheral: p.SPI2,
                    clock: p.PB13,
                    receive: p.PC2,
                    transmit: p.PC1,
                    receive_stream: p.DMA2_CH4,
                    transmit_stream: p.DMA2_CH5,
                    accelerometer: p.PC0,
                    gyroscope: p.PC3,
                },
                heater: (p.TIM3, p.PB1),
                lamp: (p.TIM8, p.PA7, p.DMA1_CH7),
                buzzer: (p.TIM12, p.PB15),
                supply: VoltageParts::new(&p.ADC1, p.PC4),
                key: (p.PA15, p.EXTI15),
                #[cfg(feature = "black-box")]
                memory: (p.OCTOSPI1, p.PE11, p.PB2, p.PD11, p.PB0, p.PA3, p.PA1),
            },
            supervisor: p.TIM7,
            watchdog: p.IWDG1,
        }
    }
}

/// The package has pads `PC2_C` and `PC3_C` only: the switch to PC2 and PC3, for MISO and a chip
/// select, must be closed (zero, RM0468, `SYSCFG_PMCR`), as after a reset.
fn close_analogue_switches() {
    pac::RCC.apb4enr().modify(|w| w.set_syscfgen(true));
    let _ = pac::RCC.apb4enr().read();
    pac::SYSCFG.pmcr().modify(|w| {
        w.set_pc2so(false);
        w.set_pc3so(false);
    });
}
