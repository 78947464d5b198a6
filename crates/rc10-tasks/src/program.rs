//! A robot as a program: [`robot!`](crate::robot!) declares what it has, [`Program`] says what it does. Chip, simulator
//! and emulated chip run the same.
//!
//! ```
//! use rc10_motor::Place::Bus;
//! use rc10_motor::dji::{Config, Dji, M3508};
//! use rc10_motor::{Entry, Target};
//! use rc10_message::Every;
//! use rc10_tasks::{Arming, Program};
//!
//! rc10_tasks::robot! {
//!     motors {
//!         Wheel: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
//!     }
//! }
//!
//! impl Program for Robot {
//!     async fn run(shared: &Shared<'_>) -> ! {
//!         let (mut arming, mut every) = (Arming::of::<Self>(), Every::millis(10));
//!         loop {
//!             every.next().await;
//!             if let Some(remote) = shared.obey(&mut arming) {
//!                 shared.command(Name::Wheel, Target::Coast);
//!             }
//!         }
//!     }
//! }
//! # assert_eq!(rc10_motor::Names::label(Name::Wheel), "wheel");
//! ```

use embassy_time::{Duration, Ticker};
use embedded_hal::digital::InputPin;
use embedded_hal::pwm::SetDutyCycle;
use embedded_io_async::{Read, Write};
use rc10_app::Degrees;
use rc10_module::limit_switch;
pub use rc10_module::limit_switch::Active;
use rc10_module::remote::{ChannelOrder, Receiver};
use rc10_module::servo::{self, Servo};
use rc10_motor::unitree::Rs485Bus;
use rc10_motor::{ArmState, ArmSwitch, MotorBus, Names, SetupError};
use rc10_time::Micros;

use crate::arming::ArmingConfig;
use crate::common::Common;
use crate::live::{Contact, Live, Signal};

/// A part on a UART of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SerialPart {
    /// Label of the part.
    pub label: &'static str,
    /// The chip's UART: 10 for USART10.
    pub uart: u8,
    /// Bits a second, 8 data bits, no parity.
    pub baud: u32,
}

/// An RS-485 line of motors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinePart {
    /// The chip's UART: 2 for USART2.
    pub uart: u8,
    /// Bits a second, 8 data bits, no parity.
    pub baud: u32,
    /// The longest time from a command to the end of its reply.
    pub reply: Micros,
}

/// Most parts on UARTs, beside remote, console, IMU and RS-485.
pub const MOST_SERIALS: usize = 4;

/// What a robot has, as its declaration says: [`robot!`](crate::robot!) implements it.
pub trait Declared: 'static {
    /// Names of the motors.
    type Name: Names;
    /// The robot's own signals, parameters and topics.
    type Own: Live + Default;
    /// Where the motors stand.
    type Motors: Default;
    /// Its parts on UARTs.
    const SERIALS: &'static [SerialPart];
    /// Labels of its contacts, in the order of the board's inputs, and the level of a pressed one.
    const CONTACTS: &'static [(&'static str, Active)];
    /// Labels of its voltages, in the order of the board's inputs for them, each with the divider before the input.
    const VOLTAGES: &'static [(&'static str, f32)];
    /// Labels of its servos, in the order of the board's outputs for them.
    const SERVOS: &'static [&'static str];
    /// Whether an IMU is at the board's port for one.
    const HAS_IMU: bool;
    /// The number of LEDs of the strip that shows its state, and their brightness of 255.
    const STRIP: Option<(usize, u8)>;
    /// The RS-485 lines of its motors.
    const RS485: &'static [LinePart];
    /// The folder of the robot's package.
    const FOLDER: &'static str;
    /// Which board of the robot it is, as `Chassis`, if the package has several; else empty.
    const BOARD: &'static str;

    /// Makes the motors and attaches them to buses and lines, which have none yet.
    ///
    /// # Errors
    /// [`SetupError`] for other buses and lines than the declared.
    fn attach<'m>(
        motors: &'m mut Self::Motors,
        buses: &mut [&mut MotorBus<'m>],
        lines: &mut [&mut Rs485Bus<'m>],
    ) -> Result<(), SetupError>;

    /// Listens to all parts on UARTs, reads all contacts and voltages, drives all servos: ports and pins in the order
    /// of the declaration.
    fn parts(
        shared: &Common<'_, Self::Name, Self::Own>,
        serials: impl IntoIterator<Item: Read + Write>,
        contacts: impl IntoIterator<Item: InputPin>,
        voltages: impl IntoIterator<Item: AsyncFnMut() -> Option<f32>>,
        servos: impl IntoIterator<Item: SetDutyCycle>,
    ) -> impl Future<Output = ()>;
}

/// What a robot does, and what it needs of its board.
pub trait Program: Declared {
    /// The receiver of the remote control.
    const RECEIVER: Receiver = Receiver::Dr16;
    /// Which channel of the transmitter is what, of a receiver that is not one of DJI's.
    const CHANNELS: ChannelOrder = Self::RECEIVER.channels();
    /// Which switches arm, disarm and stop, and which sticks must be at rest: [`Arming::of`](crate::Arming::of) checks
    /// it against the receiver when it is compiled.
    const ARMING: ArmingConfig = ArmingConfig::DEFAULT;
    /// Bits a second at the console: 921,600, which every USB adapter can, or 2,000,000.
    const CONSOLE: u32 = 921_600;

    /// Parameters that must be kept, or the robot cannot be armed: `label` of its own, `label name` of a motor's, as
    /// `"lift left limit"`.
    const MUST_HAVE: &'static [&'static str] = &[];

    /// The robot's tasks, which do not end: several of them by `join`.
    fn run(shared: &Common<'_, Self::Name, Self::Own>) -> impl Future<Output = Never>;
}

/// The type `!`, which a trait cannot name yet.
pub type Never = <fn() -> ! as Returns>::Output;

/// What a function returns.
#[doc(hidden)]
pub trait Returns {
    /// Its type.
    type Output;
}

impl<T> Returns for fn() -> T {
    type Output = T;
}

/// Reads a contact every millisecond, for ever. A pin that cannot be read counts as high, as with a torn wire.
pub async fn read_contact(pin: impl InputPin, active: Active, contact: &Contact) -> ! {
    let mut pin = limit_switch::Contact::new(pin, active);
    let mut ticker = Ticker::every(Duration::from_millis(1));
    loop {
        contact.set(pin.is_closed());
        ticker.next().await;
    }
}

/// Reads a voltage every 10 ms, for ever; without a value the signal has none either.
pub async fn read_voltage(mut read: impl AsyncFnMut() -> Option<f32>, signal: &Signal) -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(10));
    loop {
        signal.set(read().await.unwrap_or(f32::NAN));
        ticker.next().await;
    }
}

/// Drives a servo every 10 ms, for ever, to the angle that a signal has; without one it gets no pulse.
pub async fn drive_servo(
    output: impl SetDutyCycle,
    config: servo::Config,
    angle: &Signal,
    switch: &ArmSwitch,
) {
    let Ok(mut servo) = Servo::new(output, config) else { return };
    let mut ticker = Ticker::every(Duration::from_millis(10));
    loop {
        let angle = Some(Degrees::new(angle.get())).filter(|angle| !angle.get().is_nan());
        servo.drive(angle, switch.state() == ArmState::Armed);
        ticker.next().await;
    }
}

/// Whether ports are named in their order, from the first on.
#[doc(hidden)]
pub const fn assert_in_order(ports: &[&str], name: &str) {
    let mut at = 0;
    while at < ports.len() {
        let (port, name) = (ports[at].as_bytes(), name.as_bytes());
        let is_next =
            port.len() == name.len() + 1 && port[name.len()] as usize == b'1' as usize + at;
        assert!(is_next, "inputs, voltages and servos are taken in their order: _1, _2, and so on");
        at += 1;
    }
}

/// Declares what a robot has: its motors, a line each, and before them what it has beside motors.
///
/// ```ignore
/// rc10::robot! {
///     board Chassis;                                      // of a package with two boards: which one
///     own Own;                                            // its signals, parameters and topics, by `live!`
///     imu wit;                                            // HWT101 or WT901, on a board that has none soldered on
///     strip 8, brightness 40;                             // LEDs that show its state, brightness of 255
///     line rs485 at 4_000_000, replies in REPLY;          // an RS-485 line, and how long a motor may take to reply
///     serial wall: uart_10 at 115_200, wall::listen;      // a part on a UART, and who listens to it
///     contact bottom: input_1 opens;                      // a switch to ground, by the contact that opens when it is
///                                                         // pressed, or without the word: `Own` has a contact `bottom`
///     voltage pressure: voltage_1, divider 2.0;           // measured every 10 ms: `Own` has a signal `pressure`, V
///     servo gripper: servo_1, GRIPPER;                    // its angle is the signal `gripper` of `Own`, degrees
///     motors {
///         LiftLeft: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
///     }
/// }
/// ```
///
/// All but the motors may be left out; what there is stands in this order. The ports are named as on the
/// board. The listener is an `async fn(&Shared<'_>, &Reception, impl Read + Write) -> !`.
///
/// It makes [`motors!`](rc10_motor::motors!)' `Name` and `Motors`; `Ports` and `Shared`, which its tasks share; and `Robot`,
/// which is [`Declared`](crate::program::Declared) and for which the robot implements
/// [`Program`](crate::Program).
#[macro_export]
macro_rules! robot {
    (
        $(board $board:ident;)?
        $(own $Own:ty;)?
        $(imu $imu:ident;)?
        $(strip $leds:expr, brightness $brightness:expr;)?
        $(line $line:ident at $bits:expr, replies in $reply:expr;)*
        $(serial $serial:ident: $uart:ident at $baud:expr, $listen:path;)*
        $(contact $contact:ident: $input:ident $($opens:ident)?;)*
        $(voltage $voltage:ident: $pin:ident, divider $divider:expr;)*
        $(servo $servo:ident: $output:ident, $config:expr;)*
        motors { $($motors:tt)+ }
    ) => {
        $crate::parts! {
            ($) ($($board)?)
            ($($imu)?) [$($leds)?] ($($line)*) ($($uart)*) ($($input)*)
            ($($pin)*) ($($output)*)
        }

        const _: () = $crate::program::assert_in_order(&[$(stringify!($input)),*], "input_");
        const _: () = $crate::program::assert_in_order(&[$(stringify!($pin)),*], "voltage_");
        const _: () = $crate::program::assert_in_order(&[$(stringify!($output)),*], "servo_");
        $(const _: () = assert!($config.check().is_ok(), "a servo has two different angles, with pulses of 500 to 2500 us");)*
        const _: () = assert!(
            <Robot as $crate::Declared>::RS485.len() == <Name as $crate::rc10_motor::Names>::LINES as usize,
            "the declaration has not one `line` for each RS-485 line that motors are on"
        );

        $crate::rc10_motor::motors! {
            /// Names of the robot's motors.
            pub enum Name;
            /// The robot's motors: they stand here, and buses and lines borrow them.
            pub struct Motors;
            $($motors)+
        }

        /// The ports of the robot's buses, lines and motors.
        pub type Ports = $crate::rc10_motor::embassy::Ports<
            Name,
            { <Name as $crate::rc10_motor::Names>::BUSES.len() },
            { <Name as $crate::rc10_motor::Names>::LINES as usize },
        >;

        /// Everything that the robot's tasks share.
        pub type Shared<'p> = $crate::Common<'p, Name, $crate::or_unit!($($Own)?)>;

        /// The robot: what it has is declared, what it does is its [`Program`]($crate::Program).
        #[derive(Clone, Copy, Debug)]
        pub struct Robot;

        impl $crate::program::Declared for Robot {
            type Name = Name;
            type Own = $crate::or_unit!($($Own)?);
            type Motors = Motors;
            const SERIALS: &'static [$crate::program::SerialPart] = &[$($crate::program::SerialPart {
                label: stringify!($serial),
                uart: $crate::uart!($uart),
                baud: $baud,
            }),*];
            const CONTACTS: &'static [(&'static str, $crate::program::Active)] =
                &[$((stringify!($contact), $crate::active!($($opens)?))),*];
            const VOLTAGES: &'static [(&'static str, f32)] = &[$((stringify!($voltage), $divider)),*];
            const SERVOS: &'static [&'static str] = &[$(stringify!($servo)),*];
            const HAS_IMU: bool = $crate::is_any!($($imu)?);
            const STRIP: Option<(usize, u8)> = $crate::or_none!($(($leds, $brightness))?);
            const RS485: &'static [$crate::program::LinePart] = &[$($crate::program::LinePart {
                uart: $crate::uart!($line),
                baud: $bits,
                reply: $reply,
            }),*];
            const FOLDER: &'static str = env!("CARGO_MANIFEST_DIR");
            const BOARD: &'static str = concat!($(stringify!($board))?);

            fn attach<'m>(
                motors: &'m mut Motors,
                buses: &mut [&mut $crate::rc10_motor::MotorBus<'m>],
                lines: &mut [&mut $crate::rc10_motor::unitree::Rs485Bus<'m>],
            ) -> Result<(), $crate::rc10_motor::SetupError> {
                motors.attach(buses, lines)
            }

            #[allow(unused_mut, unused_variables, reason = "a robot without such parts")]
            async fn parts(
                shared: &Shared<'_>,
                serials: impl IntoIterator<
                    Item: $crate::embedded_io_async::Read + $crate::embedded_io_async::Write,
                >,
                contacts: impl IntoIterator<Item: $crate::embedded_hal::digital::InputPin>,
                voltages: impl IntoIterator<Item: AsyncFnMut() -> Option<f32>>,
                servos: impl IntoIterator<Item: $crate::embedded_hal::pwm::SetDutyCycle>,
            ) {
                let (mut serials, mut contacts) = (serials.into_iter(), contacts.into_iter());
                let (mut voltages, mut servos) = (voltages.into_iter(), servos.into_iter());
                let mut receptions = shared.receptions.iter();
                $crate::all!(
                    $({
                        let part = serials.next().zip(receptions.next());
                        async move {
                            if let Some((port, reception)) = part {
                                $listen(shared, reception, port).await;
                            }
                        }
                    },)*
                    $({
                        let pin = contacts.next();
                        async move {
                            if let Some(pin) = pin {
                                let active = $crate::active!($($opens)?);
                                $crate::program::read_contact(pin, active, &shared.own.$contact).await;
                            }
                        }
                    },)*
                    $({
                        let read = voltages.next();
                        async move {
                            if let Some(read) = read {
                                $crate::program::read_voltage(read, &shared.own.$voltage).await;
                            }
                        }
                    },)*
                    $({
                        let output = servos.next();
                        async move {
                            if let Some(output) = output {
                                let angle = &shared.own.$servo;
                                $crate::program::drive_servo(output, $config, angle, &shared.switch).await;
                            }
                        }
                    },)*
                )
                .await;
            }
        }
    };
}

/// Hands the parts to a macro of the board: `my_robot::__parts!([rc10_board::start_parts] arguments)`. Of a package with
/// several boards the macro has the board's name.
#[doc(hidden)]
#[macro_export]
macro_rules! parts {
    (($d:tt) () $($parts:tt)*) => {
        $crate::parts! { ($d) (__parts) $($parts)* }
    };
    (($d:tt) ($board:ident) $($parts:tt)*) => {
        #[doc(hidden)]
        #[macro_export]
        macro_rules! $board {
            ([$d($d callback:tt)+] $d($d argument:tt)*) => {
                $d($d callback)+! { ($d($d argument)*) $($parts)* }
            };
        }
    };
}

/// The number of the chip's UART at a port of the boards.
#[doc(hidden)]
#[macro_export]
macro_rules! uart {
    (rs485) => {
        2
    };
    (rs485_2) => {
        3
    };
    (uart_3) => {
        3
    };
    (uart_7) => {
        7
    };
    (uart_10) => {
        10
    };
    ($other:ident) => {
        compile_error!("the boards' serial ports are uart_3, uart_7, uart_10, rs485 and rs485_2")
    };
}

/// An option of what there is.
#[doc(hidden)]
#[macro_export]
macro_rules! or_none {
    () => {
        None
    };
    ($it:expr) => {
        Some($it)
    };
}

/// The level of a pressed contact, by how it is wired.
#[doc(hidden)]
#[macro_export]
macro_rules! active {
    () => {
        $crate::program::Active::Low
    };
    (opens) => {
        $crate::program::Active::High
    };
}

/// Whether there is anything.
#[doc(hidden)]
#[macro_export]
macro_rules! is_any {
    () => {
        false
    };
    ($it:tt) => {
        true
    };
}

/// The type, or `()` without one.
#[doc(hidden)]
#[macro_export]
macro_rules! or_unit {
    () => {
        ()
    };
    ($Type:ty) => {
        $Type
    };
}

/// All of these futures at once.
#[doc(hidden)]
#[macro_export]
macro_rules! all {
    () => {
        core::future::ready(())
    };
    ($first:expr, $($more:expr,)*) => {
        $crate::embassy_futures::join::join($first, $crate::all!($($more,)*))
    };
}
