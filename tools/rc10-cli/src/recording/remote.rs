//! The track of a remote control in a run: its samples, and each loss with what followed.

use rc10_can::Micros;
use rc10_module::Counters;
use rc10_sim::remote::Sent;

use crate::recording::sample::RemoteSample;
use crate::robot::remote::{Lost, Receiver};

/// The track of a remote: what its receiver sent, and what the robot did while it was lost.
#[derive(Clone, Debug)]
pub struct RemoteTrack {
    /// The kind of receiver.
    pub receiver: Receiver,
    /// Counters of the frames that the receiver sent.
    pub sent: Sent,
    /// Counters of the frames that the robot heard, if it tells them.
    pub heard: Option<Counters>,
    /// Each time that the remote was lost.
    pub losses: Vec<Loss>,
    /// One per sample.
    pub samples: Vec<RemoteSample>,
}

/// One time that the remote was lost, and what followed. To 100 µs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loss {
    /// The time in which its transmitter was off.
    pub lost: Lost,
    /// The time at which the last good frame had ended on the receiver's wire; `None` if there had
    /// been none.
    pub last_frame: Option<Micros>,
    /// The time since when every motor that may not hold had obeyed commands of no current.
    pub coasting: Option<Micros>,
    /// The time at which the first good frame after it had ended on the wire.
    pub back: Option<Micros>,
    /// The time at which the motors were driven again without a new arming.
    pub resumed: Option<Micros>,
    /// The time at which the robot was disarmed or stopped, so that it must be armed anew: at once,
    /// if it was that already. Of a robot that does not say so: the time at which motors that hold
    /// let go, too.
    pub disarmed: Option<Micros>,
}

impl Loss {
    /// One that nothing has followed yet.
    pub(crate) const fn new(lost: Lost) -> Self {
        Self { lost, last_frame: None, coasting: None, back: None, resumed: None, disarmed: None }
    }

    /// The time from the last good frame until the motors coasted, if any was driven when it was
    /// lost.
    #[must_use]
    pub fn reaction(&self) -> Option<Micros> {
        let coasting = self.coasting.filter(|time| *time > self.lost.from)?;
        Some(coasting.since(self.last_frame?))
    }

    /// Nothing more will follow from it.
    pub(crate) const fn is_settled(&self) -> bool {
        self.resumed.is_some() || self.disarmed.is_some()
    }
}
