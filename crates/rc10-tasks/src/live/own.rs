use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use rc10_app::mechanism::Stage;

use super::Commanded;

/// A value of a robot's own that a PC may watch. Setting it is one store.
#[derive(Debug)]
pub struct Signal {
    /// Name of the signal.
    pub label: &'static str,
    /// Unit of the signal; empty if it has no unit.
    pub unit: &'static str,
    /// If it is a state: the names of its values from 0 on, with commas between.
    pub states: &'static str,
    value: AtomicU32,
}

impl Signal {
    /// One without a value.
    #[must_use]
    pub const fn new(label: &'static str, unit: &'static str) -> Self {
        Self { label, unit, states: "", value: AtomicU32::new(f32::NAN.to_bits()) }
    }

    /// A state, by the names of its values from 0 on.
    pub(super) const fn state(label: &'static str, states: &'static str) -> Self {
        Self { states, ..Self::new(label, "") }
    }

    /// One that counts.
    pub(super) const fn counter(label: &'static str, unit: &'static str) -> Self {
        Self { value: AtomicU32::new(0), ..Self::new(label, unit) }
    }

    /// Counts one more, of one that [counts](Self::counter).
    pub(super) fn count(&self) {
        self.set(self.get() + 1.0);
    }

    /// Gives it a value; NaN takes it away.
    #[inline]
    pub fn set(&self, value: f32) {
        self.value.store(value.to_bits(), Ordering::Relaxed);
    }

    /// Returns the value; NaN while the signal has none.
    #[inline]
    #[must_use]
    pub fn get(&self) -> f32 {
        f32::from_bits(self.value.load(Ordering::Relaxed))
    }
}

/// The stage of a mechanism of the robot's own, for its log, the page and the verdict of a run: one that
/// gave up is a problem, and so is one that has not begun though the robot is armed.
#[derive(Debug)]
pub struct Mechanism(Signal);

impl Mechanism {
    /// One that has not begun.
    #[must_use]
    pub const fn new(label: &'static str) -> Self {
        Self(Signal { label, unit: "", states: Stage::NAMES, value: AtomicU32::new(0) })
    }

    /// Says how far it is, in each step.
    #[inline]
    pub fn tell(&self, stage: Stage) {
        self.0.set(f32::from(stage as u8));
    }

    /// The signal that it is.
    #[must_use]
    pub const fn signal(&self) -> &Signal {
        &self.0
    }
}

/// A switch or marker of the robot's own: closed while it is pressed. A PC sees 1 and 0.
#[derive(Debug)]
pub struct Contact(Signal);

impl Contact {
    /// One that has not been read.
    #[must_use]
    pub const fn new(label: &'static str) -> Self {
        Self(Signal { states: "open,closed", ..Signal::new(label, "") })
    }

    /// Says how it was read.
    pub fn set(&self, is_closed: bool) {
        self.0.set(f32::from(u8::from(is_closed)));
    }

    /// Whether it was closed when it was read last, a millisecond ago at most; one that was never read is open.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.0.get() > 0.0
    }

    /// The signal that it is.
    #[must_use]
    pub const fn signal(&self) -> &Signal {
        &self.0
    }
}

impl Signal {
    /// The stage in which it gave up, if it is of a [`Mechanism`] that did.
    #[must_use]
    pub fn failure(&self) -> Option<Stage> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a stage's number, or beyond them"
        )]
        let stage = *Stage::ALL.get(self.get() as usize)?;
        (!self.states.is_empty() && stage.gave_up()).then_some(stage)
    }
}

/// A number of a robot's own that a PC may change, within a range. Reading it is one load.
#[derive(Debug)]
pub struct Parameter {
    /// Name of the parameter.
    pub label: &'static str,
    /// Unit of the parameter; empty if it has no unit.
    pub unit: &'static str,
    /// The lowest and the highest value.
    pub range: [f32; 2],
    /// The value in the robot's table, which it has at power-on unless another one is kept.
    pub initial: f32,
    value: AtomicU32,
    was_read: AtomicBool,
}

impl Parameter {
    /// One with this value.
    ///
    /// # Panics
    /// If the value is not in the range, or one of them is not finite; in a `const` that is a compile
    /// error.
    #[must_use]
    pub const fn new(
        label: &'static str,
        unit: &'static str,
        initial: f32,
        range: [f32; 2],
    ) -> Self {
        let [least, most] = range;
        assert!(least.is_finite() && most.is_finite(), "the range of a parameter is not finite");
        assert!(least <= initial && initial <= most, "a parameter is not within its range");
        let (value, was_read) = (AtomicU32::new(initial.to_bits()), AtomicBool::new(false));
        Self { label, unit, range, initial, value, was_read }
    }

    /// Returns the value, for a task.
    #[inline]
    #[must_use]
    pub fn get(&self) -> f32 {
        self.was_read.store(true, Ordering::Relaxed);
        self.peek()
    }

    /// Returns the value, for a PC.
    pub(super) fn peek(&self) -> f32 {
        f32::from_bits(self.value.load(Ordering::Relaxed))
    }

    /// Whether it differs from its value in the table.
    #[must_use]
    pub fn is_changed(&self) -> bool {
        self.peek().to_bits() != self.initial.to_bits()
    }

    /// Whether a task has read it.
    #[must_use]
    pub fn was_read(&self) -> bool {
        self.was_read.load(Ordering::Relaxed)
    }

    /// Gives it a value that is in its range.
    pub(super) fn set(&self, value: f32) {
        self.value.store(value.to_bits(), Ordering::Relaxed);
    }
}

/// The signals and parameters of a robot's own: [`live!`](crate::live!) makes them. `()` has none.
pub trait Live {
    /// What a PC may command: an [`Auto`](super::Auto), or `()`, nothing.
    fn auto(&self) -> impl Commanded
    where
        Self: Sized;
    /// Shows each signal, always in the same order.
    fn signals<'l>(&'l self, see: &mut dyn FnMut(&'l Signal));
    /// Shows each parameter. The same.
    fn parameters<'l>(&'l self, see: &mut dyn FnMut(&'l Parameter));
}

impl Live for () {
    fn auto(&self) -> impl Commanded {}
    fn signals<'l>(&'l self, _: &mut dyn FnMut(&'l Signal)) {}
    fn parameters<'l>(&'l self, _: &mut dyn FnMut(&'l Parameter)) {}
}

/// How many things are shown.
pub(super) fn count<T>(show: impl FnOnce(&mut dyn FnMut(T))) -> u16 {
    let mut count = 0;
    show(&mut |_| count += 1);
    count
}

/// The thing with this number of those that are shown.
pub(super) fn nth<T>(at: u16, show: impl FnOnce(&mut dyn FnMut(T))) -> Option<T> {
    let (mut left, mut found) = (Some(at), None);
    show(&mut |it| {
        if left == Some(0) {
            found = Some(it);
        }
        left = left.and_then(|left| left.checked_sub(1));
    });
    found
}

/// Declares what a robot has of its [own](crate::Common::own), a field for each: signals and parameters for a PC,
/// and topics of its tasks. What it has none of is left out.
///
/// ```
/// rc10_tasks::live! {
///     /// What can be watched and tuned.
///     pub struct Own {
///         auto {
///             "vx", "m/s", 1.5; // what a PC may command, and at most
///             "vy", "m/s", 1.5;
///             "wz", "rad/s", 4.0;
///         }
///         mechanisms {
///             arm: "arm"; // its stage
///         }
///         contacts {
///             bottom: "lift bottom"; // `contact bottom: input_1;` in `robot!` reads it
///         }
///         signals {
///             tilt: "lift tilt", "deg";
///         }
///         parameters {
///             shooting: "shooting speed", "rpm", 1500.0, [0.0, 6000.0];
///         }
///         fields {
///             /// The height that the arm shall have: what its tasks share.
///             height: rc10_message::Latest<f32, 1>;
///         }
///     }
/// }
///
/// let own = Own::default();
/// own.tilt.set(0.3);
/// # let homing = rc10_app::mechanism::Homing::new();
/// own.arm.tell(homing.stage());
/// assert_eq!((own.tilt.get(), own.shooting.get()), (0.3, 1500.0));
/// ```
///
/// A value that is not in its range does not compile where the struct is made in a `const` or `static`.
#[macro_export]
macro_rules! live {
    (
        $(#[$meta:meta])* $vis:vis struct $Name:ident {
            $(auto { $($channel:literal, $channel_unit:literal, $most:expr;)+ })?
            $(mechanisms { $($mechanism:ident: $mechanism_label:literal;)* })?
            $(contacts { $($contact:ident: $contact_label:literal;)* })?
            $(signals { $($signal:ident: $signal_label:literal, $signal_unit:literal;)* })?
            $(parameters { $($parameter:ident: $label:literal, $unit:literal, $initial:expr, $range:expr;)* })?
            $(fields { $($(#[$of:meta])* $field:ident: $Type:ty;)* })?
        }
    ) => {
        $(#[$meta])*
        $vis struct $Name {
            $(
                /// What a PC may command.
                pub auto: $crate::live::Auto<{ [$($channel),+].len() }>,
            )?
            $($(#[doc = $mechanism_label] pub $mechanism: $crate::live::Mechanism,)*)?
            $($(#[doc = $contact_label] pub $contact: $crate::live::Contact,)*)?
            $($(#[doc = $signal_label] pub $signal: $crate::live::Signal,)*)?
            $($(#[doc = $label] pub $parameter: $crate::live::Parameter,)*)?
            $($($(#[$of])* pub $field: $Type,)*)?
        }

        impl Default for $Name {
            // Always inlined, so that it is made where it stays and does not pass over the stack.
            #[inline(always)]
            fn default() -> Self {
                Self {
                    $(auto: const { $crate::live::Auto::new([$($crate::live::AutoChannel::new(
                        concat!("auto ", $channel), $channel_unit, $most,
                    )),+]) },)?
                    $($($mechanism: $crate::live::Mechanism::new($mechanism_label),)*)?
                    $($($contact: $crate::live::Contact::new($contact_label),)*)?
                    $($($signal: $crate::live::Signal::new($signal_label, $signal_unit),)*)?
                    $($($parameter: const { $crate::live::Parameter::new($label, $unit, $initial, $range) },)*)?
                    $($($field: <$Type>::default(),)*)?
                }
            }
        }

        impl $crate::live::Live for $Name {
            fn auto(&self) -> impl $crate::live::Commanded {
                $crate::or_unit_value!($(&self.auto, $($channel),+)?)
            }
            fn signals<'l>(&'l self, see: &mut dyn FnMut(&'l $crate::live::Signal)) {
                $crate::or_unit_value!($(self.auto.signals(see), $($channel),+)?);
                $($(see(self.$mechanism.signal());)*)?
                $($(see(self.$contact.signal());)*)?
                $($(see(&self.$signal);)*)?
                let _ = see;
            }
            fn parameters<'l>(&'l self, see: &mut dyn FnMut(&'l $crate::live::Parameter)) {
                $($(see(&self.$parameter);)*)?
                let _ = see;
            }
        }
    };
}

/// A value before the channels that there are, or `()`.
#[doc(hidden)]
#[macro_export]
macro_rules! or_unit_value {
    () => {
        ()
    };
    ($value:expr, $($channel:literal),+) => {
        $value
    };
}
