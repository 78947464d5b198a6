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
//! arms nothing by itself. An emergency stop ends when no switch stops any more and the switch
//! of `disarm` disarms.
//!
//! **It never believes in a lost remote.** Without a good frame for 100 ms, or when the receiver
//! itself says that it hears nothing, every motor takes its safe state; if frames come back within a
//! second, the robot goes on. After a second it is disarmed.
//!
//! ```
//! use rc10_can::Micros;
//! use rc10_message::Stamped;
//! use rc10_module::remote::{Receiver, Remote, Switch};
//! use rc10_motor::{ArmState, ArmSwitch};
//! use rc10_tasks::{Arming, ArmingConfig};
//!
//! const ARMING: ArmingConfig = ArmingConfig::DEFAULT.checked(Receiver::Dr16);
//! let (switch, mut arming) = (ArmSwitch::new(), Arming::new(ARMING));
//! let mut hear = |right_switch, millis| {
//!     let now = Micros::from_millis(millis);
//!     let value = Remote { right_switch, ..Remote::default() };
//!     let _ = arming.step(Some(Stamped { value, at: now }), &switch, now);
//!     switch.state()
//! };
//! assert_eq!(hear(Switch::Up, 10), ArmState::Disarmed);
//! assert_eq!(hear(Switch::Down, 20), ArmState::Disarmed);
//! assert_eq!(hear(Switch::Up, 30), ArmState::Armed);
//! ```

use core::fmt;

use rc10_can::Micros;
use rc10_message::Stamped;
use rc10_module::remote::{Receiver, Remote, RemoteLink, Switch, Watch};
use rc10_motor::{ArmState, ArmSwitch};

/// The switches that arm, disarm and stop a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ArmingConfig {
    /// Disarms. Every other position of the same switch arms.
    pub disarm: SwitchAt,
    /// Stops, if a switch is to do so.
    pub stop: Option<SwitchAt>,
}

/// A switch in a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SwitchAt {
    /// The switch.
    pub switch: SwitchName,
    /// Its position.
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
    /// Right switch down: disarmed. Left switch down: emergency stop.
    pub const DEFAULT: Self = Self {
        disarm: SwitchAt::new(SwitchName::Right, Switch::Down),
        stop: Some(SwitchAt::new(SwitchName::Left, Switch::Down)),
    };

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

/// Arms, suspends, disarms and stops a robot as its remote says.
#[derive(Clone, Copy, Debug)]
pub struct Arming {
    config: ArmingConfig,
    watch: Watch,
    link: RemoteLink,
    /// Time of the newest frame that was looked at.
    heard: Option<Micros>,
    /// The switch disarmed since the robot was last stopped or its remote lost: it may be armed.
    may_arm: bool,
}

impl Arming {
    /// One that has heard nothing.
    #[must_use]
    pub const fn new(config: ArmingConfig) -> Self {
        let (watch, link) = (Watch::new(), RemoteLink::Lost);
        Self { config, watch, link, heard: None, may_arm: false }
    }

    /// Whether the remote is heard, as of the last step.
    #[must_use]
    pub const fn link(&self) -> RemoteLink {
        self.link
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
        }
        self.link = self.watch.link(now);
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
                self.may_arm = false;
                None
            }
        }
    }

    fn follow(&mut self, remote: &Remote, switch: &ArmSwitch) {
        if self.config.stop.is_some_and(|stop| stop.is_on(remote)) {
            switch.emergency_stop();
            self.may_arm = false;
        } else if self.config.disarm.is_on(remote) {
            switch.reset();
            switch.disarm();
            self.may_arm = true;
        } else {
            switch.resume();
            if core::mem::take(&mut self.may_arm) {
                // Refused while the robot is stopped, or unfit: the status says which.
                let _ = switch.arm();
            }
        }
    }
}

#[cfg(test)]
mod tests;
