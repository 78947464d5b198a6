//! A robot's program.

/// The program of a robot: `main`, and all that stands beside the robot's own tasks.
///
/// ```ignore
/// rc10_board::program!(my_robot);                       // its crate
/// rc10_board::program!(my_robot, outputs: [First]);     // of a board that has them, only these outputs are on
/// rc10_board::program!(my_robot::chassis::Chassis);     // of a robot of two boards: its crate, module and `board`
/// ```
///
/// The robot's crate has what `rc10::robot!` makes, and `Robot` is a [`Program`](rc10_tasks::Program).
///
/// Tasks that run, most urgent first:
///
/// | priority | what | when it stands still |
/// |---|---|---|
/// | P0 | time | – |
/// | P3 | the supervisor: makes the motors safe if the buses do not tick | the watchdog restarts the chip |
/// | P6 | the buses, every millisecond, by the interrupt of UART9 | the supervisor, within 10 ms |
/// | P7 | the lines, by the interrupt of UART8; the interrupts of all UARTs and timers | the watchdog |
/// | thread | the robot's tasks, remote control, console, status, feeding the watchdog | the watchdog, 80 ms |
///
/// So no log, maths or script delays a motor, nor does a noisy serial line, which waits while a DMA receives.
///
/// A panic or a fault sends every motor's frame of no torque, and restarts the chip. Without the crystal the robot
/// cannot be armed. What keeps it from starting is told in the log.
#[macro_export]
macro_rules! program {
    ($robot:ident $(, outputs: [$($output:ident),*])?) => {
        $crate::program! { [$robot] [$robot::__parts] $(, outputs: [$($output),*])? }
    };
    ($robot:ident::$module:ident::$Board:ident $(, outputs: [$($output:ident),*])?) => {
        $crate::program! { [$robot::$module] [$robot::$Board] $(, outputs: [$($output),*])? }
    };
    ([$($robot:ident)::+] [$($parts:ident)::+] $(, outputs: [$($output:ident),*])?) => {
        $crate::rc10_bsp::crash_handlers!();

        mod program {
            use $crate::board::{self, Board, Soldered};
            use $crate::embassy_executor::{self, Executor, InterruptExecutor, Spawner};
            use $crate::embassy_stm32::gpio::Input;
            use $crate::embassy_stm32::interrupt::{self, InterruptExt, Priority};
            use $crate::embassy_stm32::peripherals::{IWDG1, UART5, USART1};
            use $crate::embassy_stm32::{Peri, bind_interrupts};
            use $crate::embassy_time::Instant;
            use $crate::rc10_bsp::can::FdcanPort;
            use $crate::rc10_bsp::pulse_input::PulseInput;
            use $crate::rc10_bsp::serial::{self, Serial, SerialReceiver};
            use $crate::rc10_bsp::servo::ServoOutput;
            use $crate::rc10_bsp::voltage::VoltageInput;
            use $crate::rc10_bsp::{CORE_CLOCK, supervisor};
            use $crate::rc10_message::Cycles;
            use $crate::rc10_motor::embassy::BusPort;
            use $crate::rc10_motor::{MotorBus, Names};
            use $crate::rc10_tasks::live::Kept;
            use $crate::rc10_tasks::{Declared, Program, remote};
            use $crate::robot::{self, Unstartable};
            use $crate::static_cell::{ConstStaticCell, StaticCell};
            use $($robot)::+::{Motors, Name, Ports, Robot, Shared};

            const BUSES: usize = <Name as Names>::BUSES.len();
            const SERIALS: usize = Robot::SERIALS.len();
            const CONTACTS: usize = Robot::CONTACTS.len();
            const VOLTAGES: usize = Robot::VOLTAGES.len();
            const SERVOS: usize = Robot::SERVOS.len();

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
            static EXECUTOR: StaticCell<Executor> = StaticCell::new();

            /// Cycles of each wake, in which a bus sends and the next computes; without the interrupt's own.
            static TICKS: Cycles = Cycles::new(CORE_CLOCK.0);

            $crate::executor! {
                /// Runs the buses.
                CONTROL on UART9, measured by TICKS
            }
            #[$crate::cortex_m_rt::entry]
            fn main() -> ! {
                EXECUTOR.init(Executor::new()).run(|spawner| {
                    if let Err(why) = start(spawner, robot::begin()) {
                        why.tell();
                    }
                })
            }

            // Not inlined, so that its stack is free again when the tasks run.
            #[inline(never)]
            fn start(spawner: Spawner, board: Board) -> Result<(), Unstartable> {
                let shared = SHARED.init_with(|| Shared::new(robot::ports(&PORTS)));
                shared.bus_cycles = Some(&TICKS);
                let shared = &*shared;
                robot::check_chip(&shared.switch);
                robot::record(shared.ports);
                let kept = robot::kept(&shared.switch, Robot::MUST_HAVE);
                let mut motors = robot::buses(&MOTOR_BUSES, &shared.switch);
                let mut lines = $($parts)::+!([$crate::motor_lines] shared);
                MOTORS.take().attach(
                    &mut motors.each_mut().map(|bus| &mut **bus),
                    &mut lines.each_mut().map(|line| &mut **line),
                )?;

                interrupt::UART9.set_priority(Priority::P6);
                let ports = robot::start_buses(board.bus_1, board.bus_2, board.bus_3);
                let started = Instant::now();
                CONTROL.start(interrupt::UART9).spawn(buses(ports, motors, shared.ports.buses)?);
                supervisor::start(board.supervisor, Irqs, Priority::P3);
                $($parts)::+!([$crate::start_lines] shared, lines, board);

                let text = robot::console_port(board.text, Irqs, Priority::P7, Robot::CONSOLE)?;
                spawner.spawn(tend(shared, board.watchdog)?);
                spawner.spawn(console(shared, text, started + robot::BETWEEN, kept)?);
                if Robot::RECEIVER.serial().is_some() {
                    let port = robot::remote(board.remote, Irqs, Robot::RECEIVER, Priority::P7)?;
                    spawner.spawn(listen(shared, port)?);
                } else {
                    spawner.spawn(listen_pulses(shared, $crate::start_pulses!(board))?);
                }
                $($parts)::+!([$crate::start_parts] shared, spawner, board);
                spawner.spawn(serve(shared, board.soldered)?);
                spawner.spawn(run(shared)?);
                // A bus wakes every third of a millisecond. All else wakes between, to leave them punctual.
                while started.elapsed() < robot::BETWEEN {}
                Ok(())
            }

            /// All buses: frames in, motors, frames out, every millisecond.
            #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
            fn buses(
                ports: [FdcanPort; BUSES],
                motors: [&'static mut MotorBus<'static>; BUSES],
                shared: &'static [BusPort],
            ) -> impl Future<Output = ()> {
                robot::run(ports, motors, shared)
            }

            #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
            async fn tend(shared: &'static Shared<'static>, watchdog: Peri<'static, IWDG1>) {
                robot::tend(shared, watchdog).await;
            }

            #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
            async fn console(
                shared: &'static Shared<'static>,
                text: Serial,
                quiet: Instant,
                kept: Kept,
            ) {
                robot::console(shared, text.split(), quiet, kept).await;
            }

            #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
            async fn listen(shared: &'static Shared<'static>, port: SerialReceiver) {
                remote::listen(shared, Robot::RECEIVER, Robot::CHANNELS, port).await;
            }

            #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
            async fn listen_pulses(shared: &'static Shared<'static>, mut input: PulseInput) {
                let edges = async || input.rising_edge().await;
                remote::listen_pulses(shared, Robot::CHANNELS, edges).await;
            }

            #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
            async fn parts(
                shared: &'static Shared<'static>,
                serials: [Serial; SERIALS],
                contacts: [Input<'static>; CONTACTS],
                voltages: [VoltageInput; VOLTAGES],
                servos: [ServoOutput; SERVOS],
            ) {
                let voltages = voltages.map(|mut input| async move || input.read().await);
                Robot::parts(shared, serials, contacts, voltages, servos).await;
            }

            #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
            async fn serve(shared: &'static Shared<'static>, soldered: Soldered) {
                board::serve(shared, soldered, $crate::outputs!($([$($output),*])?)).await;
            }

            #[embassy_executor::task(embassy_executor = $crate::embassy_executor)]
            async fn run(shared: &'static Shared<'static>) -> ! {
                Robot::run(shared).await
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
