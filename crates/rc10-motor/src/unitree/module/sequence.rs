use crate::unitree::wire::module::Request;
use crate::unitree::wire::{RawImpedance, RawMotion, Status};

/// The enabling of a motor: a frame a tick, each step on a reply, repeated until that comes.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Sequence {
    step: Step,
    /// The gains written to the module last.
    given: RawImpedance,
    /// Whether they are being read back.
    asked: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
enum Step {
    /// Locked; whether the motor has reported anything since.
    Polling { answered: bool },
    /// The gains are written to the module and read back; the motor keeps `status` meanwhile.
    Setting { tick: u8, status: Status },
    /// The module has them; the motor does not follow yet.
    Enabling,
    /// The motor follows.
    Following { tick: u8 },
}

// Ticks of `Setting`. The module does not answer `SET`; polls of the motor keep the link alive.
const REST: u8 = 0;
const SET: u8 = 1;
const READ: u8 = 2;
const LAST: u8 = 5;
/// Ticks between two reads of the gains: the module may restart faster than its silence shows.
const CHECK_EVERY: u8 = 50;

impl Sequence {
    pub(super) const fn new() -> Self {
        Self { step: Step::Polling { answered: false }, given: RawImpedance::NONE, asked: false }
    }

    pub(super) const fn stop(&mut self) {
        self.step = Step::Polling { answered: false };
    }

    pub(super) const fn is_following(&self) -> bool {
        matches!(self.step, Step::Following { .. })
    }

    /// One tick of a motor that shall follow with these gains in its module.
    pub(super) fn advance(&mut self, wanted: RawImpedance) {
        self.step = match self.step {
            Step::Polling { answered: false } => return,
            Step::Polling { .. } => Step::Setting { tick: SET, status: Status::LOCK },
            Step::Setting { tick: LAST, status } => Step::Setting { tick: SET, status },
            Step::Setting { tick, status } => Step::Setting { tick: tick + 1, status },
            Step::Enabling if wanted != self.given => {
                Step::Setting { tick: SET, status: Status::LOCK }
            }
            Step::Following { .. } if wanted != self.given => {
                Step::Setting { tick: REST, status: Status::FOC }
            }
            Step::Enabling => Step::Enabling,
            Step::Following { tick } => Step::Following { tick: (tick + 1) % CHECK_EVERY },
        };
        match self.request(RawMotion::default()) {
            Request::SetImpedance(_) => self.given = wanted,
            Request::ReadImpedance => self.asked = true,
            _ => (),
        }
    }

    /// The motor reported its status.
    pub(super) fn on_state(&mut self, status: Status) {
        match self.step {
            Step::Following { .. } if status == Status::FOC => (),
            Step::Polling { .. } => self.step = Step::Polling { answered: true },
            Step::Enabling if status == Status::FOC => self.step = Step::Following { tick: 0 },
            // It has restarted.
            Step::Following { .. } | Step::Setting { status: Status::FOC, .. }
                if status != Status::FOC =>
            {
                self.stop();
            }
            Step::Enabling | Step::Following { .. } | Step::Setting { .. } => (),
        }
    }

    /// The module reported its gains. Returns whether they were being read.
    pub(super) fn on_impedance(&mut self, has: RawImpedance) -> bool {
        if !core::mem::take(&mut self.asked) {
            return false;
        }
        match self.step {
            Step::Setting { tick: READ..=LAST, status } if has == self.given => {
                self.step = match status {
                    Status::FOC => Step::Following { tick: 0 },
                    _ => Step::Enabling,
                };
            }
            // It has restarted.
            Step::Following { .. } if has != self.given => {
                self.step = Step::Setting { tick: REST, status: Status::FOC };
            }
            _ => (),
        }
        true
    }

    /// The frame of this tick; `command` where it is a motion.
    pub(super) fn request(&self, command: RawMotion) -> Request {
        match self.step {
            Step::Following { tick }
                if tick + 1 < CHECK_EVERY || self.given == RawImpedance::NONE =>
            {
                Request::Control(Status::FOC, command)
            }
            Step::Following { .. } | Step::Setting { tick: READ, .. } => Request::ReadImpedance,
            Step::Polling { .. } => Request::Control(Status::LOCK, RawMotion::default()),
            Step::Setting { tick: SET, .. } => Request::SetImpedance(self.given),
            Step::Setting { status, .. } => Request::Control(status, command),
            Step::Enabling => Request::Control(Status::FOC, command),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: RawImpedance = RawImpedance::NONE;
    const SPRING: RawImpedance = RawImpedance { stiffness: 300, damping: 20 };
    const TURNING: RawMotion = RawMotion { torque: 1, speed: 2, angle: 3 };

    /// The question that the next tick sends.
    fn next(sequence: &mut Sequence, wanted: RawImpedance) -> Request {
        sequence.advance(wanted);
        sequence.request(TURNING)
    }

    fn following(wanted: RawImpedance) -> Sequence {
        let mut sequence = Sequence::new();
        sequence.on_state(Status::LOCK);
        assert_eq!(next(&mut sequence, wanted), Request::SetImpedance(wanted));
        assert_eq!(next(&mut sequence, wanted), Request::ReadImpedance);
        assert!(sequence.on_impedance(wanted));
        assert_eq!(next(&mut sequence, wanted), Request::Control(Status::FOC, TURNING));
        sequence.on_state(Status::LOCK);
        assert_eq!(next(&mut sequence, wanted), Request::Control(Status::FOC, TURNING));
        assert!(!sequence.is_following());
        sequence.on_state(Status::FOC);
        assert!(sequence.is_following());
        sequence
    }

    #[test]
    fn nothing_goes_on_without_an_answer() {
        let mut sequence = Sequence::new();
        let poll = Request::Control(Status::LOCK, RawMotion::default());
        for _ in 0..20 {
            assert_eq!(next(&mut sequence, NONE), poll);
        }
        sequence.on_state(Status::LOCK);
        let wait = Request::Control(Status::LOCK, TURNING);
        for _ in 0..4 {
            assert_eq!(next(&mut sequence, SPRING), Request::SetImpedance(SPRING));
            assert_eq!(next(&mut sequence, SPRING), Request::ReadImpedance);
            assert!(sequence.on_impedance(NONE));
            for _ in 0..3 {
                sequence.on_state(Status::LOCK);
                assert_eq!(next(&mut sequence, SPRING), wait);
            }
        }
        assert!(!sequence.is_following());
    }

    #[test]
    fn an_answer_may_come_late_but_not_unasked() {
        let mut sequence = Sequence::new();
        assert!(!sequence.on_impedance(NONE));
        sequence.on_state(Status::LOCK);
        for _ in 0..4 {
            let _ = next(&mut sequence, SPRING);
        }
        assert!(sequence.on_impedance(SPRING));
        assert!(!sequence.on_impedance(SPRING));
        assert_eq!(next(&mut sequence, SPRING), Request::Control(Status::FOC, TURNING));
    }

    #[test]
    fn another_impedance_is_set_and_confirmed_before_it_counts() {
        let mut sequence = following(NONE);
        assert_eq!(next(&mut sequence, SPRING), Request::Control(Status::FOC, TURNING));
        assert!(!sequence.is_following());
        assert_eq!(next(&mut sequence, SPRING), Request::SetImpedance(SPRING));
        assert_eq!(next(&mut sequence, SPRING), Request::ReadImpedance);
        assert!(sequence.on_impedance(SPRING));
        assert!(sequence.is_following());
    }

    #[test]
    fn a_side_that_restarted_is_set_up_anew() {
        let mut sequence = following(NONE);
        sequence.on_state(Status::LOCK);
        assert!(!sequence.is_following());
        // A module that has forgotten its impedance is found out without any gap.
        let mut sequence = following(SPRING);
        let ticks = (1..).find(|_| next(&mut sequence, SPRING) == Request::ReadImpedance);
        assert_eq!(ticks, Some(49));
        assert!(sequence.on_impedance(SPRING) && sequence.is_following());
        let _ = (1..).find(|_| next(&mut sequence, SPRING) == Request::ReadImpedance);
        assert!(sequence.on_impedance(NONE) && !sequence.is_following());
        assert_eq!(next(&mut sequence, SPRING), Request::SetImpedance(SPRING));
        // Without an impedance there is nothing to forget.
        let mut sequence = following(NONE);
        assert!((0..200).all(|_| next(&mut sequence, NONE) != Request::ReadImpedance));
    }
}
