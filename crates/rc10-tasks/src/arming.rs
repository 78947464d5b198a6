//! Arming by the switches of a remote control, and the failsafe in two steps.
//!
//! | a switch of the remote | the robot is |
//! |---|---|
//! | [`ArmingConfig::disarm`] | disarmed |
//! | leaves that position | armed |
//! | [`ArmingConfig::stop`] | stopped: an emergency stop, whatever the rest says |
//!
//! **It arms only by hand**: the switch must have been seen in its disarming position since
//! power-on, since a stop, and since the remote was lost. So a switch that was left in another position
//! arms nothing by itself. Each of [`ArmingConfig::at_rest`] must be at rest in that moment: with a
//! throttle that stays where it is left the robot would drive at once. [`Arming::refused`] names the one
//! that is not, and the switch is to be moved back and forth again.
//!
//! **An emergency stop ends only by hand**, whatever began it: a switch, a PC, a bus, a task. A hand must
//! have brought the switches into the position that disarms since the stop. If they lie in it, they are
//! to be moved out of it and back.
//!
//! **One frame is no position** where something begins: to arm, and to end a stop, a position must stand
//! in [`FRAMES`] frames, [`STEADY`] apart from first to last. What stops, disarms or suspends is done by
//! the first frame.
//!
//! **It never believes in a lost remote.** Without a good frame for 100 ms, or when the receiver
//! itself says that it hears nothing, every motor takes its safe state; if frames come back within a
//! second, the robot goes on. After a second it is disarmed.
//!
//! ```
//! use rc10_time::Micros;
//! use rc10_message::Stamped;
//! use rc10_module::remote::{Receiver, Remote, Switch};
//! use rc10_motor::{ArmState, ArmSwitch};
//! use rc10_tasks::{Arming, ArmingConfig};
//!
//! const ARMING: ArmingConfig = ArmingConfig::DEFAULT.checked(Receiver::Dr16);
//! let (switch, mut arming) = (ArmSwitch::new(), Arming::new(ARMING));
//! let mut now = Micros::ZERO;
//! let mut hear = |right_switch| {
//!     for _ in 0..5 {
//!         now += Micros::from_millis(10);
//!         let value = Remote { right_switch, ..Remote::default() };
//!         let _ = arming.step(Some(Stamped { value, at: now }), &switch, now);
//!     }
//!     switch.state()
//! };
//! assert_eq!(hear(Switch::Up), ArmState::Disarmed);
//! assert_eq!(hear(Switch::Down), ArmState::Disarmed);
//! assert_eq!(hear(Switch::Up), ArmState::Armed);
//! ```

use core::fmt;

use rc10_message::Stamped;
use rc10_module::remote::{Receiver, Remote, RemoteLink, Switch, Watch};
use rc10_motor::{ArmState, ArmSwitch};
use rc10_time::Micros;

use crate::program::Program;

/// The switches that arm, disarm and stop a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ArmingConfig {
    /// Disarms. Every other position of the same switch arms.
    pub disarm: SwitchAt,
    /// Stops, if a switch is to do so.
    pub stop: Option<SwitchAt>,
    /// Controls that must be at rest for the robot to be armed: each stick and dial that moves
    /// something.
    pub at_rest: &'static [Axis],
}

/// A direction of a stick, or the dial, of a [`Remote`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Axis {
    /// The left stick to the sides.
    LeftX,
    /// The left stick to and fro.
    LeftY,
    /// The right stick to the sides.
    RightX,
    /// The right stick to and fro.
    RightY,
    /// [`Remote::dial`].
    Dial,
}

rc10_app::states!(Axis: LeftX, LeftY, RightX, RightY, Dial);

impl Axis {
    /// Both sticks.
    pub const STICKS: &'static [Self] = &[Self::LeftX, Self::LeftY, Self::RightX, Self::RightY];

    /// Where it is, -1 ..= 1.
    #[must_use]
    pub const fn of(self, remote: &Remote) -> f32 {
        match self {
            Self::LeftX => remote.left.x,
            Self::LeftY => remote.left.y,
            Self::RightX => remote.right.x,
            Self::RightY => remote.right.y,
            Self::Dial => remote.dial,
        }
    }

    /// Not a number is not at rest.
    fn is_at_rest(self, remote: &Remote) -> bool {
        self.of(remote).abs() <= AT_REST
    }

    /// Returns the name of the switch.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::LeftX => "left stick (left and right)",
            Self::LeftY => "left stick (up and down)",
            Self::RightX => "right stick (left and right)",
            Self::RightY => "right stick (up and down)",
            Self::Dial => "dial",
        }
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Up to here a stick is at rest: springs of a worn remote bring it back to within a few hundredths.
pub const AT_REST: f32 = 0.05;
/// Frames in which a position must stand to arm, or to end a stop.
pub const FRAMES: u8 = 3;
/// Time from the first to the last of them, at least.
pub const STEADY: Micros = Micros::from_millis(40);

/// A switch in a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SwitchAt {
    /// The switch.
    pub switch: SwitchName,
    /// Position of the switch.
    pub position: Switch,
}

/// A switch of a [`Remote`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SwitchName {
    /// [`Remote::left_switch`].
    Left,
    /// [`Remote::right_switch`].
    Right,
    /// The first of [`Remote::more_switches`].
    Third,
    /// The second of [`Remote::more_switches`].
    Fourth,
}

/// Why switches cannot arm a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ArmingError {
    /// One position of one switch disarms and stops: a stop could never be ended.
    SamePosition,
    /// The receiver's remote has no such switch: it would be in its middle for ever.
    NoSuchSwitch(SwitchName, Receiver),
    /// The middle of the switch that disarms stops: on the way to where it arms it would stop.
    StopOnTheWay,
    /// On a VT03 the left switch is a button, which springs back: letting it go would arm.
    Button,
}

impl SwitchName {
    /// The position of this switch on a remote.
    #[must_use]
    pub const fn of(self, remote: &Remote) -> Switch {
        match self {
            Self::Left => remote.left_switch,
            Self::Right => remote.right_switch,
            Self::Third => remote.more_switches[0],
            Self::Fourth => remote.more_switches[1],
        }
    }

    /// Whether the remotes of a receiver have this switch. Those of SBUS, CRSF and PPM have what
    /// their [`ChannelMap`](rc10_module::remote::ChannelMap) says: all four unless it is changed.
    #[must_use]
    pub const fn exists_on(self, receiver: Receiver) -> bool {
        match receiver {
            Receiver::Dr16 | Receiver::Vt03 => matches!(self, Self::Left | Self::Right),
            Receiver::Sbus | Receiver::Crsf | Receiver::Ppm => true,
        }
    }
}

impl SwitchAt {
    /// This switch in this position.
    #[must_use]
    pub const fn new(switch: SwitchName, position: Switch) -> Self {
        Self { switch, position }
    }

    /// Whether a remote has the switch in that position.
    #[must_use]
    pub fn is_on(self, remote: &Remote) -> bool {
        self.switch.of(remote) == self.position
    }
}

impl ArmingConfig {
    /// Right switch down: disarmed. Left switch down: emergency stop. Both sticks move something.
    pub const DEFAULT: Self = Self {
        disarm: SwitchAt::new(SwitchName::Right, Switch::Down),
        stop: Some(SwitchAt::new(SwitchName::Left, Switch::Down)),
        at_rest: Axis::STICKS,
    };

    fn zone(&self, remote: &Remote) -> Zone {
        if self.stop.is_some_and(|stop| stop.is_on(remote)) {
            Zone::Stops
        } else if self.disarm.is_on(remote) {
            Zone::Disarms
        } else {
            Zone::Arms
        }
    }

    /// Whether it can be used with a receiver.
    ///
    /// # Errors
    /// [`ArmingError`]
    pub const fn validate(&self, receiver: Receiver) -> Result<(), ArmingError> {
        let disarm = self.disarm;
        if !disarm.switch.exists_on(receiver) {
            return Err(ArmingError::NoSuchSwitch(disarm.switch, receiver));
        }
        let is_button = matches!((receiver, disarm.switch), (Receiver::Vt03, SwitchName::Left));
        if is_button && !matches!(disarm.position, Switch::Middle) {
            return Err(ArmingError::Button);
        }
        let Some(stop) = self.stop else { return Ok(()) };
        if !stop.switch.exists_on(receiver) {
            return Err(ArmingError::NoSuchSwitch(stop.switch, receiver));
        }
        // Comparing by `==` is not for constants.
        if stop.switch as u8 != disarm.switch as u8 {
            Ok(())
        } else if stop.position as u8 == disarm.position as u8 {
            Err(ArmingError::SamePosition)
        } else if matches!(stop.position, Switch::Middle) {
            Err(ArmingError::StopOnTheWay)
        } else {
            Ok(())
        }
    }

    /// The same, if it can be used with a receiver: to be evaluated in a `const`.
    ///
    /// # Panics
    /// If not; in a `const` that is a compile error.
    #[must_use]
    pub const fn checked(self, receiver: Receiver) -> Self {
        match self.validate(receiver) {
            Ok(()) => self,
            Err(error) => panic!("{}", error.text()),
        }
    }
}

impl ArmingError {
    const fn text(self) -> &'static str {
        match self {
            Self::SamePosition => {
                "one position of one switch disarms and stops: a stop could never be ended"
            }
            Self::NoSuchSwitch(..) => {
                "the receiver's remote has no such switch: it would be in its middle for ever"
            }
            Self::StopOnTheWay => {
                "the middle of the switch that disarms stops: on the way to where it arms it would stop"
            }
            Self::Button => {
                "the left switch of a VT03 is a button, which springs back: letting it go would arm"
            }
        }
    }
}

impl fmt::Display for ArmingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Self::NoSuchSwitch(switch, receiver) = self {
            write!(f, "{switch:?} with {receiver}: ")?;
        }
        f.write_str(self.text())
    }
}

impl core::error::Error for ArmingError {}

/// A request of a remote's switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Zone {
    Stops,
    Disarms,
    Arms,
}

/// The hand at the switches.
#[derive(Clone, Copy, Debug)]
struct Hand {
    /// In the newest frame, in this many frames since that time.
    zone: Zone,
    frames: u8,
    since: Micros,
    /// The last zone that was steady; `None` while none is known to have been before.
    steady: Option<Zone>,
    /// Whether it went from one steady zone to another since the last stop.
    has_moved: bool,
}

impl Hand {
    const UNSEEN: Self =
        Self { zone: Zone::Arms, frames: 0, since: Micros::ZERO, steady: None, has_moved: false };

    fn see(&mut self, zone: Zone, at: Micros) {
        if zone != self.zone || self.frames == 0 {
            (self.zone, self.frames, self.since) = (zone, 0, at);
        }
        self.frames = self.frames.saturating_add(1);
        if self.frames >= FRAMES && at.since(self.since) >= STEADY {
            let before = self.steady.replace(zone);
            self.has_moved |= before.is_some_and(|before| before != zone);
        }
    }

    /// The robot was stopped. A move that has begun began before.
    fn forget_moves(&mut self) {
        self.has_moved = false;
        self.steady = self.steady.filter(|steady| *steady == self.zone);
    }

    fn is_steady(&self) -> bool {
        self.steady == Some(self.zone)
    }
}

/// Arms, suspends, disarms and stops a robot as its remote says.
#[derive(Clone, Copy, Debug)]
pub struct Arming {
    config: ArmingConfig,
    watch: Watch,
    link: RemoteLink,
    /// Time of the newest frame that was looked at.
    heard: Option<Micros>,
    hand: Hand,
    /// The stops that are known.
    stops: u32,
    /// The switch disarmed since the robot was last stopped or its remote lost: it may be armed.
    may_arm: bool,
    refused: Option<Axis>,
}

impl Arming {
    /// That of a robot. A configuration that its receiver cannot have does not compile.
    #[must_use]
    pub fn of<P: Program>() -> Self {
        Self::new(
            const {
                assert!(
                    P::RECEIVER.check(P::CHANNELS).is_ok(),
                    "`CHANNELS`: the receiver has no such channel, or one is two things"
                );
                P::ARMING.checked(P::RECEIVER)
            },
        )
    }

    /// One that has heard nothing.
    #[must_use]
    pub const fn new(config: ArmingConfig) -> Self {
        Self {
            config,
            watch: Watch::new(),
            link: RemoteLink::Lost,
            heard: None,
            hand: Hand::UNSEEN,
            stops: 0,
            may_arm: false,
            refused: None,
        }
    }

    /// Whether the remote is heard, as of the last step.
    #[must_use]
    pub const fn link(&self) -> RemoteLink {
        self.link
    }

    /// The control that was not at rest when the switch was to arm, until the switch disarms.
    #[must_use]
    pub const fn refused(&self) -> Option<Axis> {
        self.refused
    }

    /// Decides, from the newest frame of the remote, at least every 20 ms. The remote, if the robot
    /// is armed and is to do what its sticks say.
    pub fn step(
        &mut self,
        newest: Option<Stamped<Remote>>,
        switch: &ArmSwitch,
        now: Micros,
    ) -> Option<Remote> {
        if let Some(Stamped { value, at }) = &newest
            && self.heard != Some(*at)
        {
            self.watch.heard(value, *at);
            self.heard = Some(*at);
            if !value.failsafe {
                self.hand.see(self.config.zone(value), *at);
            }
        }
        self.link = self.watch.link(now);
        let stops = switch.stops();
        if self.stops != stops {
            self.know_stop(stops);
        }
        match (self.link, newest) {
            (RemoteLink::Online, Some(Stamped { value, .. })) => {
                self.follow(&value, switch);
                (switch.state() == ArmState::Armed).then_some(value)
            }
            (RemoteLink::Interrupted, _) => {
                switch.suspend();
                None
            }
            _ => {
                switch.disarm();
                (self.hand, self.may_arm, self.refused) = (Hand::UNSEEN, false, None);
                None
            }
        }
    }

    fn know_stop(&mut self, stops: u32) {
        (self.stops, self.may_arm) = (stops, false);
        self.hand.forget_moves();
    }

    fn follow(&mut self, remote: &Remote, switch: &ArmSwitch) {
        match self.hand.zone {
            Zone::Stops => {
                switch.emergency_stop();
                self.know_stop(switch.stops());
            }
            Zone::Disarms => {
                switch.disarm();
                self.refused = None;
                if self.hand.is_steady() {
                    if self.hand.has_moved {
                        switch.reset_after(self.stops);
                    }
                    self.may_arm = switch.state() != ArmState::EStopped;
                }
            }
            Zone::Arms => {
                switch.resume();
                if self.hand.is_steady() && core::mem::take(&mut self.may_arm) {
                    self.arm(remote, switch);
                }
            }
        }
    }

    fn arm(&mut self, remote: &Remote, switch: &ArmSwitch) {
        self.refused = self.config.at_rest.iter().copied().find(|axis| !axis.is_at_rest(remote));
        if self.refused.is_none() {
            // Refused while the robot is stopped, or unfit: the status says which.
            let _ = switch.arm();
        }
    }
}

#[cfg(test)]
mod tests;
