//! A robot's program.

/// The program of a robot: `main`, and all that stands beside the robot's own tasks.
///
/// ```ignore
/// rc10_board::robot! {
///     robot: my_robot;                              // its crate
///     buses: three_buses(bus_1, bus_2, bus_3);      // or: two_buses(bus_1, bus_2)
///     console: 921_600;                             // baud
///     imu: wit;                                     // an HWT101 or WT901 on a serial port: may be left out
///     tasks: |shared| task::run(shared);            // a future: several of them by `join`
/// }
/// ```
///
/// `outputs: [First];` behind the console switches on these outputs only, of a board that has them.
///
/// Switches to ground, at the board's part `switches`, are further arguments of the tasks, up to eight:
/// `tasks: |shared, index| task::run(shared, index);`. Each is an `InputPin` with a pull-up, low while it is closed.
///
/// The IMU is on the serial port that the board has for it. A board with an IMU soldered on takes no notice of it.
///
/// RS-485 lines, the board's parts `rs485` and `rs485_2`, stand between the buses and the console, one clause each:
/// `line: rs485 at 4_000_000, replies in REPLY;`.
///
/// The robot's crate has `Ports`, `Motors` and `table::{BUSES, RECEIVER}`, as `rc10_motor::motors!` and its
/// table make them, and `Shared`, which is a [`rc10_tasks::Common`].
///
/// Tasks that run, most urgent first:
///
/// | priority | what | when it stands still |
/// |---|---|---|
/// | P0 | time | – |
/// | P3 | the supervisor: makes the motors safe if the buses do not tick | the watchdog restarts the chip |
/// | P6 | the buses, every millisecond, by the interrupt of UART9 | the supervisor, within 10 ms |
/// | P7 | the line, by the interrupt of UART8; the interrupts of all UARTs | the watchdog |
/// | thread | the robot's tasks, remote control, console, status, feeding the watchdog | the watchdog, 80 ms |
///
/// A panic or a fault sends every motor's frame of no torque, and restarts the chip. Without the crystal the robot
/// cannot be armed. What keeps it from starting is told in the log.
#[macro_export]
macro_rules! robot {
    (
        robot: $robot:ident;
        buses: $buses:ident($($bus:ident),+);
        $(line: $line:ident at $baud:expr, replies in $reply:expr;)*
        console: $console:expr;
        $(imu: $imu:ident;)?
        $(outputs: [$($output:ident),*];)?
        tasks: |$shared:ident $(, $switch:ident)*| $tasks:expr;
    ) => {
        $crate::rc10_bsp::crash_handlers!();

        mod program {
            use $crate::board::{Soldered, SwitchParts};
            use $crate::embassy_futures::join::join4;
            use $crate::rc10_bsp::serial::{self, Serial, SerialReceiver};
            use $crate::rc10_bsp::{can::Bus, supervisor};
            use $crate::rc10_motor::MotorBus;
            use $crate::rc10_tasks::remote;
            use $crate::robot::Unstartable;
            use $crate::static_cell::{ConstStaticCell, StaticCell};
            use ::embassy_executor::Spawner;
            use ::embassy_stm32::interrupt::{InterruptExt, Priority};
            use ::embassy_stm32::peripherals::{IWDG1, UART5, USART1};
            use ::embassy_stm32::{Peri, bind_interrupts, interrupt};
            use ::embassy_time::Instant;
            use $robot::table::{BUSES, RECEIVER};
            use $robot::{Motors, Ports, Shared};

            #[allow(unused_imports, reason = "what the arguments name")]
            use super::*;

            const _: () = assert!(
                RECEIVER.serial().is_some(),
                "a receiver that speaks in pulses needs a program of its own: see rc10-firmware"
            );

            bind_interrupts!(struct Irqs {
                TIM7 => supervisor::Interrupt;
                USART1 => serial::Interrupt<USART1>;
                DMA1_STREAM0 => serial::Interrupt<USART1>;
                DMA1_STREAM1 => serial::Interrupt<USART1>;
                UART5 => serial::Interrupt<UART5>;
                DMA1_STREAM2 => serial::Interrupt<UART5>;
            });

            // Large values are made where they stay: moved, they would go over the stack.
            static PORTS: StaticCell<Ports> = StaticCell::new();
            static SHARED: StaticCell<Shared<'static>> = StaticCell::new();
            static MOTORS: ConstStaticCell<Motors> = ConstStaticCell::new(Motors::new());
            static MOTOR_BUSES: [StaticCell<MotorBus<'static>>; BUSES] =
                [const { StaticCell::new() }; BUSES];

            $crate::executor! {
                /// Runs the buses.
                CONTROL on UART9
            }

            #[::embassy_executor::main]
            async fn main(spawner: Spawner) {
                if let Err(why) = start(spawner, $crate::robot::begin()) {
                    why.tell();
                }
            }

            // Not inlined, so that its stack is free again when the tasks run.
            #[inline(never)]
            fn start(spawner: Spawner, board: $crate::board::Board) -> Result<(), Unstartable> {
                let shared = &*SHARED.init_with(|| Shared::new($crate::robot::ports(&PORTS)));
                $crate::robot::check_chip(&shared.switch);
                let mut motors = $crate::robot::buses(&MOTOR_BUSES, &shared.switch);
                let mut lines = $crate::motor_lines!(shared $(, $reply)*);
                MOTORS.take().attach(
                    &mut motors.each_mut().map(|bus| &mut **bus),
                    &mut lines.each_mut().map(|line| &mut **line),
                )?;

                interrupt::UART9.set_priority(Priority::P6);
                let ports = [$(Bus::start(board.$bus)),+];
                let started = Instant::now();
                let buses = $crate::robot::$buses(ports, motors, &shared.ports.buses)?;
                CONTROL.start(interrupt::UART9).spawn(buses);
                supervisor::start(board.supervisor, Irqs, Priority::P3);
                $crate::start_lines!(shared, lines, board $(, $line at $baud)*);

                let text = $crate::robot::console_port(board.text, Irqs, Priority::P7, $console)?;
                $($crate::start_imu!(shared, spawner, board, $imu);)?
                let remote = $crate::robot::remote(board.remote, Irqs, RECEIVER, Priority::P7)?;
                let (soldered, switches) = (board.soldered, board.switches);
                let others = others(shared, board.watchdog, text, started, remote, soldered, switches)?;
                spawner.spawn(others);
                Ok(())
            }

            #[::embassy_executor::task]
            async fn others(
                $shared: &'static Shared<'static>,
                watchdog: Peri<'static, IWDG1>,
                text: Serial,
                quiet: Instant,
                receiver: SerialReceiver,
                soldered: Soldered,
                switches: SwitchParts,
            ) {
                let tend = $crate::robot::tend($shared, watchdog, text, quiet);
                let outputs = $crate::outputs!($([$($output),*])?);
                let serve = $crate::board::serve($shared, soldered, outputs);
                $crate::switches!(switches $(, $switch)*);
                join4($tasks, remote::listen($shared, RECEIVER, receiver), tend, serve).await;
            }
        }
    };
}

/// The outputs of supply that are switched on: these, or all.
#[doc(hidden)]
#[macro_export]
macro_rules! outputs {
    () => {
        $crate::Output::ALL
    };
    ([$($output:ident),*]) => {
        &[$($crate::Output::$output),*]
    };
}
