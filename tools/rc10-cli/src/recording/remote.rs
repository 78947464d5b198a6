//! The track of a remote control in a run: its samples, and each loss with its effects.

use rc10_module::Counters;
use rc10_sim::remote::Sent;
use rc10_time::Micros;

use crate::recording::sample::RemoteSample;
use crate::robot::remote::{Lost, Receiver};

/// The track of a remote: its receiver's frames, and the robot's reactions to its losses.
#[derive(Clone, Debug)]
pub struct RemoteTrack {
    /// The kind of receiver.
    pub receiver: Receiver,
    /// Counters of the frames that the receiver sent.
    pub sent: Sent,
    /// Counters of the frames that the robot heard, if it tells them.
    pub heard: Option<Counters>,
    /// Each loss of the remote.
    pub losses: Vec<Loss>,
    /// Samples of the remote.
    pub samples: Vec<RemoteSample>,
}

/// A loss of the remote and its effects, to 100 µs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loss {
    /// The time in which the transmitter was off.
    pub lost: Lost,
    /// End of the last good frame on the receiver's wire; `None` without any.
    pub last_frame: Option<Micros>,
    /// The time since which every motor that may not hold has obeyed commands of no current.
    pub coasting: Option<Micros>,
    /// End of the first good frame after the loss on the wire.
    pub back: Option<Micros>,
    /// The time at which the motors were driven again without a new arming.
    pub resumed: Option<Micros>,
    /// The time at which the robot was disarmed or stopped (at once, if it was already), so that it
    /// must be armed anew. For a robot that does not say so: when motors that hold let go, too.
    pub disarmed: Option<Micros>,
}

impl Loss {
    pub(crate) const fn new(lost: Lost) -> Self {
        Self { lost, last_frame: None, coasting: None, back: None, resumed: None, disarmed: None }
    }

    /// Time from the last good frame until the motors coasted, if any was driven at the loss.
    pub fn reaction(&self) -> Option<Micros> {
        let coasting = self.coasting.filter(|time| *time > self.lost.from)?;
        Some(coasting.since(self.last_frame?))
    }

    /// Whether nothing more will follow.
    pub(crate) const fn is_settled(&self) -> bool {
        self.resumed.is_some() || self.disarmed.is_some()
    }
}
