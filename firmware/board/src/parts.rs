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
        compile_error!("the boards' serial ports are uart_3, uart_7, uart_10, rs485 and rs485_2")
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

/// Starts a serial port, and the task of what is at its other end: an `async fn` of the robot's `Shared` and the port.
/// For a function that returns a `Result<_, Unstartable>`.
///
/// ```ignore
/// rc10_board::start_listener!(shared, spawner, board, uart_10 at 115_200, wall::listen);
/// ```
#[macro_export]
macro_rules! start_listener {
    ($shared:ident, $spawner:ident, $board:ident, $port:ident at $baud:expr, $listen:path) => {{
        #[::embassy_executor::task]
        async fn listen(shared: &'static Shared<'static>, port: $crate::rc10_bsp::serial::Serial) {
            $listen(shared, port).await;
        }
        let port = $crate::start_serial!($board, $port, $baud)?;
        $spawner.spawn(listen($shared, port)?);
    }};
}

/// Starts the input of a receiver that speaks in pulses: a `PulseInput`.
///
/// ```ignore
/// let mut input = rc10_board::start_pulses!(board);
/// remote::listen_pulses(shared, async || input.rising_edge().await).await
/// ```
#[cfg(feature = "h723zg")]
#[macro_export]
macro_rules! start_pulses {
    ($board:ident) => {
        $crate::start_pulses_by!($board, TIM8_UP_TIM13)
    };
}

/// Starts the input of a receiver that speaks in pulses: a `PulseInput`.
#[cfg(feature = "dm-mc02")]
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

/// Listens to the IMU, at the rate that it is sold with.
#[cfg(feature = "h723zg")]
#[doc(hidden)]
#[macro_export]
macro_rules! start_imu {
    ($shared:ident, $spawner:ident, $board:ident, wit) => {
        use $crate::rc10_tasks::heading;
        $crate::start_listener!($shared, $spawner, $board, uart_7 at 115_200, heading::listen_for);
    };
}

/// The robot, whose IMU is soldered on.
#[cfg(feature = "dm-mc02")]
#[doc(hidden)]
#[macro_export]
macro_rules! start_imu {
    ($shared:ident, $spawner:ident, $board:ident, wit) => {};
}

/// The RS-485 lines of a robot, by their replies' time: an array of as many.
#[doc(hidden)]
#[macro_export]
macro_rules! motor_lines {
    ($shared:ident $(, $reply:expr)*) => {{
        use $crate::rc10_motor::unitree::Rs485Bus;
        let lines: [&'static mut Rs485Bus<'static>; _] = [$({
            static LINE: $crate::static_cell::StaticCell<Rs485Bus<'static>> =
                $crate::static_cell::StaticCell::new();
            LINE.init(Rs485Bus::new(&$shared.switch).with_reply_timeout($reply)?)
        }),*];
        lines
    }};
}

/// Starts the lines, two at most, both on one executor.
#[doc(hidden)]
#[macro_export]
macro_rules! start_lines {
    ($shared:ident, $lines:ident, $board:ident) => {};
    (
        $shared:ident, $lines:ident, $board:ident,
        $line:ident at $baud:expr $(, $line_2:ident at $baud_2:expr)?
    ) => {
        $crate::executor! {
            /// Runs the lines.
            LINE_CONTROL on UART8
        }
        interrupt::UART8.set_priority(Priority::P7);
        let control = LINE_CONTROL.start(interrupt::UART8);
        let mut lines = $lines.into_iter().zip(&$shared.ports.lines);
        if let Some((line, port)) = lines.next() {
            let uart = $crate::start_serial!($board, $line, $baud)?;
            control.spawn($crate::robot::line(uart, line, port)?);
        }
        $(if let Some((line, port)) = lines.next() {
            let uart = $crate::start_serial!($board, $line_2, $baud_2)?;
            control.spawn($crate::robot::line_2(uart, line, port)?);
        })?
    };
}

/// The board's inputs for switches, in their order, as many as the robot's tasks read: the others are left alone.
#[doc(hidden)]
#[macro_export]
macro_rules! switches {
    ($parts:ident $(, $switch:ident)*) => {
        $crate::switches!(
            @ $parts [first second third fourth fifth sixth seventh eighth] $($switch)*
        );
    };
    (@ $parts:ident [$($left:ident)*]) => {
        let _ = $parts;
    };
    (@ $parts:ident [$next:ident $($left:ident)*] $switch:ident $($more:ident)*) => {
        let $switch = $crate::robot::switch($parts.$next.0);
        $crate::switches!(@ $parts [$($left)*] $($more)*);
    };
    (@ $parts:ident [] $($more:ident)+) => {
        compile_error!("the boards have eight inputs for switches");
    };
}
