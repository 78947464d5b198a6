//! A robot's motors, declared once: one table gives names, places, ports, checks and tools all.
//!
//! ```
//! use rc10_motor::Place::Bus;
//! use rc10_motor::dji::{Config, Dji, GM6020_CURRENT, M3508};
//! use rc10_motor::rc10_app::Direction;
//! use rc10_motor::{ArmSwitch, Entry, Names, Safety, motors};
//!
//! motors! {
//!     /// Names of the robot's motors.
//!     pub enum Name;
//!     /// Where they stand.
//!     pub struct Motors;
//!     Left: Dji = Entry::new(Bus(1), wheel(1)).with_label("wheel left"),
//!     Right: Dji = Entry::new(Bus(1), wheel(2).with_direction(Direction::Reversed)).with_label("wheel right"),
//!     Turret: Dji = Entry::new(Bus(2), Config::new(&GM6020_CURRENT, 1))
//!         .with_safety(Safety::HOLD),
//! }
//!
//! const fn wheel(id: u8) -> Config {
//!     Config::new(&M3508, id)
//! }
//!
//! let switch = ArmSwitch::new();
//! let mut motors = Motors::new();
//! let [bus_1, bus_2] = motors.start(&switch)?.buses;
//! assert_eq!((bus_1.motors().count(), bus_2.motors().count()), (2, 1));
//! assert_eq!(Name::Turret.label(), "turret");
//! # Ok::<(), rc10_motor::SetupError>(())
//! ```
//!
//! A robot that cannot be does not compile, and the compiler says why:
//!
//! ```compile_fail
//! # use rc10_motor::{Entry, Place::Bus, dji::{Config, Dji, M3508}, motors};
//! motors! {
//!     pub enum Name;
//!     pub struct Motors;
//!     Left: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)).with_label("wheel left"),
//!     Right: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)).with_label("wheel right"),
//! }
//! // `wheel right` on bus 1: M3508 id 1 cannot share a bus with M3508 id 1 (`wheel left`): …
//! ```

pub(crate) mod check;
mod device;
pub(crate) mod slots;

use core::fmt;

pub use check::{SetupError, Unsound, check, load};
pub use device::{Device, OtherDevice, Wiring};
pub use slots::{MOST_BUSES, MOST_LINES, Place, Slot, Started, numbers, slots};

use rc10_app::Rpm;
use rc10_time::Micros;

use crate::supervision::Safety;

/// A line of a declaration: a motor, where it is plugged in, and how it is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Entry<C> {
    /// Label of the motor, for people: in the status, in reports and errors. No other motor has it. Empty in a
    /// declaration, it is made of the motor's name: `WheelLeft` is called "wheel left".
    pub label: &'static str,
    /// The bus or line that it is plugged into.
    pub on: Place,
    /// How it is set up: of its vendor's `Config`.
    pub config: C,
    /// The safe state, and how long a command holds.
    pub safety: Safety,
    /// The largest speed at which a PC may turn it while the robot is disarmed; `None`: it may not.
    pub jog: Option<Rpm>,
    /// How many times the gains declared a PC may set; [`MOST_GAIN`] unless it is said.
    pub most_gain: f32,
    /// How old its feedback may be at most when a command that it decided has arrived; `None`: its command arrives before
    /// its next one leaves.
    pub most_age: Option<Micros>,
}

/// The largest speed of a jog that a declaration may allow: a person stands beside the robot.
pub const MOST_JOG: Rpm = Rpm::new(300.0);

/// How many times the gains of a motor's declaration a PC may set, unless the declaration says so.
pub const MOST_GAIN: f32 = 10.0;

impl<C: Copy> Entry<C> {
    /// A motor that coasts when it may not follow its target, with the label that its name says.
    pub const fn new(on: Place, config: C) -> Self {
        Self {
            label: "",
            on,
            config,
            safety: Safety::COAST,
            jog: None,
            most_gain: MOST_GAIN,
            most_age: None,
        }
    }

    /// With a label of its own.
    pub const fn with_label(mut self, label: &'static str) -> Self {
        self.label = label;
        self
    }

    /// With this label, in UTF-8, if it has none.
    #[doc(hidden)]
    pub const fn called(mut self, label: &'static [u8]) -> Self {
        if let (true, Ok(label)) = (self.label.is_empty(), str::from_utf8(label)) {
            self.label = label;
        }
        self
    }

    /// With another safe state.
    pub const fn with_safety(mut self, safety: Safety) -> Self {
        self.safety = safety;
        self
    }

    /// Lets a PC turn it up to this speed while disarmed, to see which it is. Only with free space.
    ///
    /// # Panics
    /// If the speed is not above zero, or more than [`MOST_JOG`]; in a `const` that is a compile error.
    ///
    /// ```compile_fail,E0080
    /// # use rc10_motor::{Entry, Place::Bus, dji::{Config, M3508}, rc10_app::Rpm};
    /// const WHEEL: Config = Config::new(&M3508, 1);
    /// // a jog is slow: at most 300 rpm of the output shaft
    /// const ENTRY: Entry<Config> = Entry::new(Bus(1), WHEEL).with_jog(Rpm::new(301.0));
    /// ```
    pub const fn with_jog(mut self, fastest: Rpm) -> Self {
        assert!(fastest.get() > 0.0, "a jog has a speed above zero");
        assert!(
            fastest.get() <= MOST_JOG.get(),
            "a jog is slow: at most 300 rpm of the output shaft"
        );
        self.jog = Some(fastest);
        self
    }

    /// A PC may set gains up to this many times those declared: where the first ones are a mere guess.
    ///
    /// # Panics
    /// If it is below 1; in a `const` that is a compile error.
    pub const fn with_most_gain(mut self, times: f32) -> Self {
        assert!(times >= 1.0 && times < f32::MAX, "a gain may be as large as it is declared");
        self.most_gain = times;
        self
    }

    /// How old its feedback may be when a command that it decided has arrived, at worst: one [period](crate::plan), the times
    /// on the bus, the wait for a tick. Beyond that it does not compile. Without, each command must arrive before the next one leaves.
    pub const fn with_most_age(mut self, age: Micros) -> Self {
        self.most_age = Some(age);
        self
    }

    /// The same, of a configuration in another form.
    pub const fn with_config<D: Copy>(self, config: D) -> Entry<D> {
        let Self { label, on, safety, jog, most_gain, most_age, .. } = self;
        Entry { label, on, config, safety, jog, most_gain, most_age }
    }
}

/// The names of a robot's motors: [`motors!`](crate::motors) makes them from its declaration.
pub trait Names: Copy + fmt::Debug + 'static {
    /// All names, in the order of the declaration.
    const ALL: &'static [Self];
    /// The declaration, for checks and tools. A robot that does not use it has it not in its flash.
    const ENTRIES: &'static [Entry<Device>];
    /// Label and place of each motor.
    const SLOTS: &'static [Slot];
    /// For each bus, the largest share of it that its motors may need typically, percent.
    const BUSES: &'static [f32];
    /// Number of RS-485 lines.
    const LINES: u8;

    /// The number in the declaration, counted from 0.
    fn index(self) -> usize;

    /// Label and place of the motor.
    fn slot(self) -> &'static Slot {
        &Self::SLOTS[self.index()]
    }

    /// The motor's line in the declaration: for tools, as [`ENTRIES`](Self::ENTRIES).
    fn entry(self) -> &'static Entry<Device> {
        &Self::ENTRIES[self.index()]
    }

    /// Label of the motor.
    fn label(self) -> &'static str {
        self.slot().label
    }

    /// The whole declaration, [checked](check).
    ///
    /// # Errors
    /// [`SetupError`]: a declaration that compiles has none.
    fn check() -> Result<(), SetupError> {
        check(Self::ENTRIES, Self::BUSES, Self::LINES)
    }
}

/// Declares a robot's motors: see [`declaration`](crate::declaration).
///
/// A line for each motor: its name, its type, its [`Entry`](crate::Entry). The robot has the buses and the RS-485
/// lines up to the highest that a motor is on: at most three and two, as the boards have. `buses: [110.0, 100.0];`
/// before the motors is the share of each bus that they may need typically, percent, if it is not 100 each; above
/// that a bus may lose frames.
///
/// `unchecked` in front lets a wrong one compile, to ask [`Names::check`](crate::Names::check).
#[macro_export]
macro_rules! motors {
    (unchecked $($declaration:tt)+) => {
        $crate::motors! { @declare $($declaration)+ }
    };
    (@lines
        $(#[$name_meta:meta])* $name_vis:vis enum $Name:ident;
        $(#[$motors_meta:meta])* $motors_vis:vis struct $Motors:ident;
        buses: $buses:expr;
        $($(#[$meta:meta])* $motor:ident : $Motor:ty = $entry:expr),+ $(,)?
    ) => {
        $(#[$name_meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the names and their labels say it")]
        $name_vis enum $Name { $($(#[$meta])* $motor),+ }

        $(#[$motors_meta])*
        #[derive(Default)]
        #[allow(non_snake_case, reason = "called as the motors are")]
        $motors_vis struct $Motors { $($motor: $crate::__declaration::Held<$Motor>),+ }

        impl $crate::Names for $Name {
            const ALL: &'static [Self] = &[$(Self::$motor),+];
            const ENTRIES: &'static [$crate::Entry<$crate::Device>] =
                &[$({
                    const LABEL: &[u8] = &$crate::__declaration::label::<{
                        $crate::__declaration::label_length(stringify!($motor))
                    }>(stringify!($motor));
                    let entry = $entry.called(LABEL);
                    entry.with_config(entry.config.device())
                }),+];
            const SLOTS: &'static [$crate::Slot] =
                &$crate::__declaration::slots::<{ Self::ALL.len() }>(Self::ENTRIES);
            const BUSES: &'static [f32] = &$buses;
            const LINES: u8 = $crate::__declaration::places(Self::ENTRIES)[1] as u8;

            fn index(self) -> usize {
                self as usize
            }
        }

        #[allow(dead_code, reason = "not every robot asks for all")]
        impl $Motors {
            /// Room for the motors.
            $motors_vis const fn new() -> Self {
                Self { $($motor: $crate::__declaration::Held::new()),+ }
            }

            /// Makes the motors and attaches them to the robot's buses and lines, which have none yet.
            ///
            /// # Errors
            /// [`SetupError`](rc10_motor::SetupError) for other buses and lines than the declared.
            #[inline(never)]
            $motors_vis fn attach<'m>(
                &'m mut self,
                buses: &mut [&mut $crate::MotorBus<'m>],
                lines: &mut [&mut $crate::unitree::Rs485Bus<'m>],
            ) -> Result<(), $crate::SetupError> {
                $crate::__declaration::prepare::<$Name>(buses, lines)?;
                $($crate::__declaration::place::<$Name, _, _>(
                    &mut self.$motor, $Name::$motor, const { &$entry }, <$Motor>::new, buses, lines,
                )?;)+
                Ok(())
            }

            /// The same, with buses and lines of its own: on a chip they are too large for the stack.
            ///
            /// # Errors
            /// [`SetupError`](rc10_motor::SetupError), of a declaration that is not checked.
            $motors_vis fn start<'m>(
                &'m mut self,
                switch: &'m $crate::ArmSwitch,
            ) -> Result<$crate::Started<
                'm,
                { <$Name as $crate::Names>::BUSES.len() },
                { <$Name as $crate::Names>::LINES as usize },
            >, $crate::SetupError> {
                let mut started = $crate::Started::new(switch);
                let $crate::Started { buses, lines } = &mut started;
                self.attach(&mut buses.each_mut(), &mut lines.each_mut())?;
                Ok(started)
            }
        }
    };
    // A rule of its own, so that an error in a line is told of that line.
    (@declare
        $(#[$meta:meta])* $vis:vis enum $Name:ident; $(#[$of:meta])* $all:vis struct $Motors:ident; buses: $($lines:tt)+
    ) => {
        $crate::motors! { @lines $(#[$meta])* $vis enum $Name; $(#[$of])* $all struct $Motors; buses: $($lines)+ }
    };
    (@declare
        $(#[$name_meta:meta])* $name_vis:vis enum $Name:ident;
        $(#[$motors_meta:meta])* $motors_vis:vis struct $Motors:ident;
        $($motors:tt)+
    ) => {
        $crate::motors! { @lines
            $(#[$name_meta])* $name_vis enum $Name;
            $(#[$motors_meta])* $motors_vis struct $Motors;
            buses: [100.0; $crate::__declaration::places(<$Name as $crate::Names>::ENTRIES)[0]];
            $($motors)+
        }
    };
    ($(#[$meta:meta])* $vis:vis enum $Name:ident; $($rest:tt)+) => {
        $crate::motors! { @declare $(#[$meta])* $vis enum $Name; $($rest)+ }

        const _: () = $crate::__declaration::assert_sound(
            <$Name as $crate::Names>::ENTRIES,
            <$Name as $crate::Names>::BUSES,
            <$Name as $crate::Names>::LINES,
        );
    };
}
