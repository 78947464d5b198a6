//! A request that waits for its device: [`Pending`].

use rc10_app::ConfigError;
use rc10_time::Micros;

use crate::feedback::Fault;
use crate::motor::{DriveMode, Link, Tick};
use crate::request::{RequestError, Response};

/// The outcome of a request: a response or an error.
pub type Outcome = Result<Response, RequestError>;

/// The tries by which a question is put to a device: their number and their times.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Retry {
    /// Seconds from one try to the next.
    pub every: f32,
    /// Tries; after the last one the device has `every` seconds to answer.
    pub tries: u8,
    /// Seconds of silence before the first try.
    pub delay: f32,
    /// The device must not be driven meanwhile.
    pub only_while_off: bool,
}

impl Retry {
    /// At once, driven or not.
    pub const fn new(every: f32, tries: u8) -> Self {
        Self { every, tries, delay: 0.0, only_while_off: false }
    }

    /// The same for a device that must not be driven meanwhile.
    #[must_use]
    pub const fn only_while_off(mut self) -> Self {
        self.only_while_off = true;
        self
    }
}

/// At most one request in flight: the question, its tries, and its outcome, told once.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Pending<Q> {
    asked: Option<Asked<Q>>,
    outcome: Option<Outcome>,
    /// The link, as of the last tick.
    is_off: bool,
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
struct Asked<Q> {
    question: Q,
    retry: Retry,
    /// Tries so far, the one that is due included.
    tries: u8,
    is_due: bool,
    /// Seconds since the last try.
    waited: f32,
    /// The outcome if time runs out.
    failure: RequestError,
}

impl<Q: Copy> Pending<Q> {
    /// Nothing in flight.
    pub const fn new() -> Self {
        Self { asked: None, outcome: None, is_off: true }
    }

    /// Whether a request waits for its device, or its outcome to be taken.
    pub const fn is_busy(&self) -> bool {
        self.asked.is_some() || self.outcome.is_some()
    }

    /// `Ok` unless it is busy.
    pub fn check_free(&self) -> Result<(), RequestError> {
        if self.is_busy() { Err(RequestError::Busy) } else { Ok(()) }
    }

    /// Takes a question unless one is in flight; its first try is due in the tick after its delay.
    pub fn ask(&mut self, question: Q, retry: Retry) -> Outcome {
        self.check_free()?;
        if retry.only_while_off && !self.is_off {
            return Err(RequestError::NotWhileArmed);
        }
        self.replace(question, retry);
        Ok(Response::Pending)
    }

    /// Goes on with another question of the same request.
    pub const fn replace(&mut self, question: Q, retry: Retry) {
        self.asked = Some(Asked {
            question,
            retry,
            tries: 0,
            is_due: false,
            waited: retry.every - retry.delay,
            failure: RequestError::Timeout,
        });
    }

    /// The question in flight.
    pub const fn question(&self) -> Option<Q> {
        match &self.asked {
            Some(asked) => Some(asked.question),
            None => None,
        }
    }

    /// The question, if the device has been asked.
    pub const fn sent(&self) -> Option<Q> {
        match &self.asked {
            Some(asked) if asked.tries > 1 || asked.tries == 1 && !asked.is_due => {
                Some(asked.question)
            }
            _ => None,
        }
    }

    /// One tick later, in which a `check` of ours takes the place that no request needs, while it is `wanted`
    /// and the device is heard. Returns whether it stayed without an answer.
    pub fn update_with(&mut self, tick: &Tick, check: Q, retry: Retry, is_wanted: bool) -> bool
    where
        Q: PartialEq,
    {
        if tick.link != Link::Online {
            self.cancel_if(check);
        } else if self.asked.is_none() && is_wanted {
            self.replace(check, retry);
        }
        let was_checking = self.question() == Some(check);
        self.update(tick);
        was_checking && self.asked.is_none() && self.take_outcome().is_some()
    }

    /// Drops this question, if it is the one in flight.
    pub fn cancel_if(&mut self, question: Q)
    where
        Q: PartialEq,
    {
        if self.question() == Some(question) {
            self.cancel();
        }
    }

    /// One tick later. A question asked often enough, or not allowed to a driven device, ends: by
    /// [`RequestError::Timeout`] if it was sent, else by [`RequestError::NotWhileArmed`].
    pub fn update(&mut self, tick: &Tick) {
        self.is_off = tick.mode == DriveMode::Off;
        let is_sent = self.sent().is_some();
        let Some(asked) = &mut self.asked else { return };
        if asked.retry.only_while_off && !self.is_off {
            let error = if is_sent { RequestError::Timeout } else { RequestError::NotWhileArmed };
            return self.end(Err(error));
        }
        asked.waited += tick.dt.get();
        if asked.waited < asked.retry.every {
            return;
        }
        if asked.tries < asked.retry.tries {
            (asked.is_due, asked.tries, asked.waited) = (true, asked.tries + 1, 0.0);
        } else {
            let failure = asked.failure;
            self.end(Err(failure));
        }
    }

    /// The question that is to be sent in this tick; asked once.
    pub fn take_due(&mut self) -> Option<Q> {
        let asked = self.asked.as_mut()?;
        core::mem::take(&mut asked.is_due).then_some(asked.question)
    }

    /// Keeps a failure that does not end the request: the outcome if time runs out.
    pub fn fail_with(&mut self, failure: RequestError) {
        if let Some(asked) = &mut self.asked {
            asked.failure = failure;
        }
    }

    /// The request is over.
    pub fn end(&mut self, outcome: Outcome) {
        if self.asked.take().is_some() {
            self.outcome = Some(outcome);
        }
    }

    /// The question in flight is forgotten, and has no outcome.
    pub const fn cancel(&mut self) {
        self.asked = None;
    }

    /// The outcome, once it is known; told once.
    pub const fn take_outcome(&mut self) -> Option<Outcome> {
        self.outcome.take()
    }
}

impl<Q: Copy> Default for Pending<Q> {
    fn default() -> Self {
        Self::new()
    }
}

/// Steps of a device's time-out in a millisecond (Damiao's TIMEOUT, RobStride's canTimeout).
pub(crate) const TIMEOUT_STEPS: f32 = 20.0;

/// Whether a configuration may ask a device for such a time-out; zero is any and none.
pub(crate) const fn is_timeout(timeout: Micros) -> Result<(), ConfigError> {
    let millis = timeout.get() as f32 / 1e3;
    let is_good = millis == 0.0 || millis >= 10.0;
    ConfigError::check(is_good, "timeout", millis, "10 ms and more, or zero")
}

/// The fault of a time-out in [steps](TIMEOUT_STEPS), of which zero is never, if it is longer than `most` ms.
pub(crate) fn check_timeout(steps: u32, most: f32, fault: Fault) -> Option<Fault> {
    let held = steps as f32 / TIMEOUT_STEPS;
    let is_good = held > 0.0 && held <= most;
    (!is_good).then_some(Fault { differs: Some([held, most]), ..fault })
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    const OFF: Tick = Tick::new(DriveMode::Off);
    const RETRY: Retry = Retry::new(0.0045, 3);

    #[test]
    fn a_question_is_repeated_and_then_given_up() {
        let mut pending = Pending::new();
        assert_eq!(pending.ask('q', RETRY), Ok(Response::Pending));
        assert_eq!(pending.ask('r', RETRY), Err(RequestError::Busy));
        let mut sent = Vec::new();
        for tick in 1..100 {
            assert_eq!(pending.sent().is_some(), !sent.is_empty());
            pending.update(&OFF);
            sent.extend(pending.take_due().map(|question| (tick, question)));
            assert_eq!(pending.take_due(), None);
            if let Some(outcome) = pending.take_outcome() {
                assert_eq!((outcome, tick), (Err(RequestError::Timeout), 16));
                break;
            }
            assert!(pending.is_busy());
        }
        assert_eq!(sent, [(1, 'q'), (6, 'q'), (11, 'q')]);
        assert!(!pending.is_busy() && pending.take_outcome().is_none());
    }

    #[test]
    fn a_question_is_sent_once_it_is_taken_and_due_again_after_just_its_time() {
        let mut pending = Pending::new();
        let _ = pending.ask((), Retry::new(0.002, 2));
        pending.update(&OFF);
        assert_eq!(pending.sent(), None);
        assert_eq!(pending.take_due(), Some(()));
        assert_eq!(pending.sent(), Some(()));
        pending.update(&OFF);
        assert_eq!(pending.take_due(), None);
        pending.update(&OFF);
        assert_eq!(pending.sent(), Some(()));
        assert_eq!(pending.take_due(), Some(()));
        // Another question of the same request starts over.
        pending.replace((), RETRY);
        assert_eq!((pending.sent(), pending.question()), (None, Some(())));
    }

    #[test]
    fn an_answer_ends_it_and_is_told_once() {
        let mut pending = Pending::new();
        pending.end(Ok(Response::Done));
        assert_eq!(pending.take_outcome(), None);
        let _ = pending.ask(1, RETRY);
        pending.fail_with(RequestError::Refused(7));
        pending.update(&OFF);
        pending.end(Ok(Response::Register(3)));
        pending.end(Ok(Response::Done));
        assert!(pending.is_busy() && pending.question().is_none());
        assert_eq!(pending.take_outcome(), Some(Ok(Response::Register(3))));
        assert_eq!(pending.take_outcome(), None);
    }

    #[test]
    fn a_cancelled_question_has_no_outcome() {
        let mut pending = Pending::new();
        let _ = pending.ask((), RETRY);
        pending.cancel();
        pending.update(&OFF);
        assert!(!pending.is_busy() && pending.take_due().is_none());
    }

    #[test]
    fn a_request_interrupted_by_arming_says_whether_the_device_was_asked() {
        let retry = Retry { delay: 0.0015, ..RETRY }.only_while_off();
        for (ticks, error) in [
            (0, RequestError::NotWhileArmed),
            (1, RequestError::NotWhileArmed),
            (2, RequestError::Timeout),
        ] {
            let mut pending = Pending::new();
            assert_eq!(pending.ask((), retry), Ok(Response::Pending));
            for tick in 1..=ticks {
                pending.update(&OFF);
                assert_eq!(pending.take_due().is_some(), tick == 2);
            }
            pending.update(&Tick::new(DriveMode::Coast));
            assert_eq!(pending.take_outcome(), Some(Err(error)));
            assert_eq!(pending.ask((), retry), Err(RequestError::NotWhileArmed));
            assert_eq!(pending.ask((), RETRY), Ok(Response::Pending));
            pending.update(&Tick::new(DriveMode::Run));
            assert_eq!(pending.take_due(), Some(()));
        }
    }

    #[test]
    fn what_a_device_refuses_is_told_when_time_runs_out() {
        let mut pending = Pending::new();
        let _ = pending.ask((), Retry::new(0.01, 1));
        pending.fail_with(RequestError::Refused(7));
        for _ in 0..12 {
            pending.update(&OFF);
        }
        assert_eq!(pending.take_outcome(), Some(Err(RequestError::Refused(7))));
    }
}
