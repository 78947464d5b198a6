//! The ports of the boards by their names, each started in one line, with its interrupts and streams.

/// Starts a serial port of the board, 8N1: a `Result<Serial, BaudError>`.
///
/// ```ignore
/// let port = rc10_board::start_serial!(board, uart_10, 115_200)?;
/// ```
///
/// | port | board | |
/// |---|---|---|
/// | `uart_3` | h723zg | |
/// | `uart_7`, `uart_10` | both | on the DM-MC02 with the switched 5 V |
/// | `rs485` | both | the UART drives the transceiver's enable |
/// | `rs485_2` | DM-MC02 | the same |
///
/// The baud rate is a constant. Only the ports that are started take flash.
#[macro_export]
macro_rules! start_serial {
    ($board:ident, uart_3, $baud:expr) => {
        $crate::start_serial!($board.uart_3, USART3, DMA1_STREAM3, DMA1_STREAM4, $baud)
    };
    ($board:ident, uart_7, $baud:expr) => {
        $crate::start_serial!($board.uart_7, UART7, DMA1_STREAM5, DMA1_STREAM6, $baud)
    };
    ($board:ident, uart_10, $baud:expr) => {
        $crate::start_serial!($board.uart_10, USART10, DMA2_STREAM0, DMA2_STREAM1, $baud)
    };
    ($board:ident, rs485, $baud:expr) => {
        $crate::start_serial!($board.rs485, USART2, DMA2_STREAM2, DMA2_STREAM3, $baud)
    };
    ($board:ident, rs485_2, $baud:expr) => {
        $crate::start_serial!($board.rs485_2, USART3, DMA1_STREAM3, DMA1_STREAM4, $baud)
    };
    ($board:ident, $other:ident, $baud:expr) => {
        $crate::rc10_tasks::uart!($other)
    };
    ($parts:expr, $uart:ident, $receives:ident, $sends:ident, $baud:expr) => {{
        use $crate::rc10_bsp::serial::{Interrupt, Serial, SerialConfig};
        use $crate::embassy_stm32::peripherals::$uart;
        $crate::embassy_stm32::bind_interrupts!(struct OfPort {
            $uart => Interrupt<$uart>;
            $receives => Interrupt<$uart>;
            $sends => Interrupt<$uart>;
        });
        let ring = $crate::rc10_bsp::dma_buffer!(u8; $crate::robot::ring($baud));
        let buffer = $crate::rc10_bsp::dma_buffer!(u8; 64);
        let priority = $crate::embassy_stm32::interrupt::Priority::P7;
        Serial::start($parts, OfPort, &SerialConfig::new($baud), ring, buffer, priority)
    }};
}

/// Starts the input of a receiver that speaks in pulses: a `PulseInput`.
#[cfg(feature = "h723zg")]
#[doc(hidden)]
#[macro_export]
macro_rules! start_pulses {
    ($board:ident) => {
        $crate::start_pulses_by!($board, TIM8_UP_TIM13)
    };
}

/// Starts the input of a receiver that speaks in pulses: a `PulseInput`.
#[cfg(feature = "dm-mc02")]
#[doc(hidden)]
#[macro_export]
macro_rules! start_pulses {
    ($board:ident) => {
        $crate::start_pulses_by!($board, TIM4)
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! start_pulses_by {
    ($board:ident, $interrupt:ident) => {{
        $crate::embassy_stm32::bind_interrupts!(struct OfPulses {
            $interrupt => $crate::board::PulseInterrupt;
        });
        let $crate::board::PulseParts { timer, pin } = $board.pulses;
        let priority = $crate::embassy_stm32::interrupt::Priority::P7;
        $crate::rc10_bsp::pulse_input::PulseInput::start(timer, pin, OfPulses, priority)
    }};
}

/// The RS-485 lines of a robot: an array of as many.
#[doc(hidden)]
#[macro_export]
macro_rules! motor_lines {
    (
        ($shared:ident) $imu:tt $strip:tt ($($line:ident)*) $($others:tt)*
    ) => {{
        use $crate::rc10_motor::unitree::Rs485Bus;
        let lines: [&'static mut Rs485Bus<'static>; _] = [$({
            static LINE: $crate::static_cell::StaticCell<Rs485Bus<'static>> =
                $crate::static_cell::StaticCell::new();
            let part = const { $crate::robot::line_part::<Robot>($crate::rc10_tasks::uart!($line)) };
            LINE.init(Rs485Bus::new(&$shared.switch).with_reply_timeout(part.reply)?)
        }),*];
        lines
    }};
}

/// Starts the lines, all on one executor.
#[doc(hidden)]
#[macro_export]
macro_rules! start_lines {
    ($args:tt $imu:tt $strip:tt () $($others:tt)*) => {};
    (
        ($shared:ident, $lines:ident, $board:ident) $imu:tt $strip:tt ($($line:ident)+) $($others:tt)*
    ) => {
        $crate::executor! {
            /// Runs the lines.
            LINE_CONTROL on UART8
        }
        #[embassy_executor::task(
            pool_size = <Name as Names>::LINES as usize,
            embassy_executor = $crate::embassy_executor
        )]
        fn line(
            port: Serial,
            motors: &'static mut $crate::rc10_motor::unitree::Rs485Bus<'static>,
            shared: &'static $crate::rc10_motor::embassy::Rs485Port,
        ) -> impl Future<Output = ()> {
            $crate::rc10_motor::embassy::run_rs485(port, motors, shared)
        }
        interrupt::UART8.set_priority(Priority::P7);
        let control = LINE_CONTROL.start(interrupt::UART8);
        let uarts = [$($crate::start_serial!(
            $board,
            $line,
            $crate::robot::line_part::<Robot>($crate::rc10_tasks::uart!($line)).baud
        )?),+];
        for ((uart, motors), port) in uarts.into_iter().zip($lines).zip($shared.ports.lines) {
            control.spawn(line(uart, motors, port)?);
        }
    };
}

/// Starts what a robot has beside motors, remote and console.
#[doc(hidden)]
#[macro_export]
macro_rules! start_parts {
    (
        ($shared:ident, $spawner:ident, $board:ident) ($($imu:ident)?) [$($leds:tt)*] $lines:tt
        ($($serial:ident)*) ($($input:ident)*) ($($voltage:ident)*) ($($servo:ident)*)
    ) => {
        $($crate::start_imu!($shared, $spawner, $board, $imu);)?
        $crate::start_strip!($shared, $spawner, $board, $($leds)*);
        let serials: [Serial; _] = [$($crate::start_serial!(
            $board,
            $serial,
            $crate::robot::baud::<Robot>($crate::rc10_tasks::uart!($serial))
        )?),*];
        let contacts: [Input<'static>; _] = [$($crate::robot::switch($board.switches.$input.0)),*];
        let mut dividers = Robot::VOLTAGES.iter();
        let voltages: [VoltageInput; _] = [$({
            let divider = dividers.next().map_or(1.0, |(_, divider)| *divider);
            VoltageInput::new($board.$voltage, divider)
        }),*];
        let servos: [ServoOutput; _] = [$($board.$servo.start()),*];
        if SERIALS + CONTACTS + VOLTAGES + SERVOS > 0 {
            $spawner.spawn(parts($shared, serials, contacts, voltages, servos)?);
        }
    };
}

/// Listens to the IMU, at the rate that it is sold with.
#[cfg(feature = "h723zg")]
#[doc(hidden)]
#[macro_export]
macro_rules! start_imu {
    ($shared:ident, $spawner:ident, $board:ident, wit) => {
        #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
        async fn listen_to_imu(shared: &'static Shared<'static>, port: Serial) {
            $crate::rc10_tasks::heading::listen_for(shared, port).await;
        }
        let port = $crate::start_serial!($board, uart_7, 115_200)?;
        $spawner.spawn(listen_to_imu($shared, port)?);
    };
}

/// The robot, whose IMU is soldered on.
#[cfg(feature = "dm-mc02")]
#[doc(hidden)]
#[macro_export]
macro_rules! start_imu {
    ($shared:ident, $spawner:ident, $board:ident, wit) => {};
}

/// Shows the state of the robot on an LED strip.
#[cfg(feature = "h723zg")]
#[doc(hidden)]
#[macro_export]
macro_rules! start_strip {
    ($shared:ident, $spawner:ident, $board:ident,) => {};
    ($shared:ident, $spawner:ident, $board:ident, $($any:tt)+) => {
        const STRIP: (usize, u8) = $crate::robot::strip::<Robot>();
        use $crate::rc10_bsp::pulse_output::{self, PulseOutput};
        $crate::embassy_stm32::bind_interrupts!(struct OfStrip {
            DMA1_STREAM7 => pulse_output::Interrupt<$crate::embassy_stm32::peripherals::DMA1_CH7>;
        });
        #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
        async fn show(shared: &'static Shared<'static>, output: PulseOutput) {
            $crate::robot::show::<_, { STRIP.0 }>(shared, output, STRIP.1).await;
        }
        let $crate::board::StripParts { timer, pin, stream } = $board.strip;
        let buffer = $crate::rc10_bsp::dma_buffer!(u32; $crate::robot::pulses(STRIP.0));
        let period = $crate::robot::WS2812.period;
        let output =
            PulseOutput::start(timer, pin, stream, OfStrip, period, buffer, Priority::P7);
        $spawner.spawn(show($shared, output)?);
    };
}

/// The robot, which has a lamp soldered on.
#[cfg(feature = "dm-mc02")]
#[doc(hidden)]
#[macro_export]
macro_rules! start_strip {
    ($shared:ident, $spawner:ident, $board:ident, $($any:tt)*) => {};
}
