//! A [`CyberGear`] on its bus: what it hears, and what it sends.

use embedded_can::ExtendedId;
use rc10_app::Seconds;
use rc10_can::{CanFrame, IdPattern, Micros};

use super::{CyberGear, LINK_TIMEOUT_MICROS, LONG_SILENCE, NEAR, Seen, Step};
use crate::batch::{TxBatch, TxFull};
use crate::cybergear::exchange::{Ask, Exchange, Outcome};
use crate::cybergear::wire::{self, Address, Mode, Parameter, ParameterValue, Reply};
use crate::motor::{CanMotor, FrameError, FrameKind};
use crate::wiring::{CanIds, Ownership, Rate, RxFrames, TxFrames};

const MOTION: u32 = 1 << 24;

impl CyberGear {
    /// The low two bytes of the identifier of what it hears.
    fn replies(&self) -> u32 {
        u32::from(self.address.motor) << 8 | u32::from(self.address.host)
    }

    pub(super) fn finish(&mut self, outcome: Outcome) {
        self.exchange = None;
        self.answer = Some(outcome);
    }

    fn heard_feedback(&mut self, heard: &wire::Feedback, at: Micros) -> FrameKind {
        let since = at.since(self.seen.at);
        let runs = heard.mode == Mode::Run;
        let stopped_itself = self.step == Step::Running && !runs;
        let is_new =
            since > LINK_TIMEOUT_MICROS || stopped_itself || self.position.jumps_to(heard.steps);
        if self.position.is_known() && is_new {
            self.heard_again(heard, since);
        } else {
            self.position.follow(heard.steps, heard.velocity, since);
        }
        self.seen = Seen {
            at,
            speed: heard.velocity,
            torque: heard.torque,
            temperature: heard.temperature,
        };
        self.silence = 0.0;
        self.step = match (self.step, runs) {
            (Step::Setting, _) => Step::Checking,
            (Step::Enabling, true) => Step::Running,
            (step, _) => step,
        };
        let fault = heard.faults.gravest(self.model);
        if let Some(exchange) = &mut self.exchange
            && let Some(outcome) = exchange.feedback(heard)
        {
            let ask = exchange.ask();
            self.done(ask, heard, outcome);
        }
        if fault.is_some() {
            self.fault = self.fault.or(fault);
            return FrameKind::Fault;
        }
        FrameKind::Feedback
    }

    /// The device has done what it was asked for.
    fn done(&mut self, ask: Ask, heard: &wire::Feedback, outcome: Outcome) {
        if ask == Ask::Zero {
            self.servo.set_zero(self.position.counted());
            self.position.restart_at_zero(heard.steps);
            // A zero that is not saved is gone with the power.
            self.exchange = Some(Exchange::new(Ask::Save));
            return;
        }
        if ask == Ask::Clear {
            self.fault = None;
        }
        self.finish(outcome);
    }

    /// After a silence it is a new device; whether it still counts as before is another question.
    #[cold]
    fn heard_again(&mut self, heard: &wire::Feedback, since: Micros) {
        self.step = Step::Stopped;
        let speed = 0.5 * (self.seen.speed + heard.velocity);
        let expected = speed * Seconds::from_micros(since.get()).get();
        if self.position.has_moved_by(heard.steps, expected, NEAR + 0.5 * expected.abs()) {
            self.position.follow(heard.steps, 0.0, since);
            if since > LONG_SILENCE {
                self.position.count_gap();
            }
        } else {
            self.position.restart(heard.steps);
        }
    }

    fn heard_parameter(&mut self, value: &ParameterValue) -> Result<FrameKind, FrameError> {
        if self.step == Step::Checking && value.parameter == Parameter::RUN_MODE && !value.refused {
            self.step = if value.byte() == 0 { Step::Enabling } else { Step::Setting };
        } else {
            let taken = self.exchange.as_mut().and_then(|exchange| exchange.parameter(value));
            match taken {
                Some(Some(outcome)) => self.finish(outcome),
                Some(None) => {}
                // On a busy bus it is asked for once more before the answer is there.
                None if value.parameter == Parameter::RUN_MODE => {}
                None => return Err(FrameError::Unasked),
            }
        }
        Ok(FrameKind::Other)
    }
}

/// Any identifier of 29 bits.
fn extended(raw: u32) -> ExtendedId {
    ExtendedId::new(raw).unwrap_or(ExtendedId::MAX)
}

impl CanMotor for CyberGear {
    fn wiring(&self) -> CanIds {
        let Address { motor, .. } = self.address;
        let replies = extended(self.replies());
        let motion = extended(MOTION | u32::from(motor));
        let others = extended(motor.into());
        let rare = Rate::Rare;
        let every = Rate::EveryTick;
        let transmit = |pattern, rate| TxFrames { pattern, len: 8, rate, share: Ownership::Whole };
        let pattern = IdPattern::masked(replies, 0xFFFF);
        CanIds::new(self.model.name, motor.into())
            .receives(RxFrames { pattern, len: 8, rate: every, guard: None })
            .and_then(|w| w.transmits(transmit(IdPattern::masked(motion, 0x1F00_00FF), every)))
            .and_then(|w| w.transmits(transmit(IdPattern::masked(others, 0xFF), rare)))
            // One and two are fewer than eight.
            .unwrap_or(CanIds::new(self.model.name, motor.into()))
    }

    #[inline]
    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError> {
        // First of all: what length another's frames have is no business of this one.
        if frame.raw_id() & 0xFFFF != self.replies() {
            return Err(FrameError::NotMine);
        }
        match Reply::unpack(frame, &self.limits)? {
            Reply::Feedback(heard) => Ok(self.heard_feedback(&heard, at)),
            Reply::Parameter(value) => self.heard_parameter(&value),
            Reply::Faults(report) => Ok(match self.model.detail(report.faults) {
                Some(detail) => {
                    self.fault = Some(detail);
                    FrameKind::Fault
                }
                None => FrameKind::Other,
            }),
            Reply::Identity { .. } => Err(FrameError::NotMine),
        }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        let to = self.address;
        let before = tx.frames().len();
        if let Some(exchange) = &self.exchange {
            exchange.pack(to, tx)?;
            if exchange.wants_quiet() {
                return Ok(());
            }
        }
        match self.step {
            // One question a tick.
            _ if tx.frames().len() > before => (),
            Step::Checking => tx.push(wire::read(to, Parameter::RUN_MODE))?,
            Step::Setting => tx.push(wire::write_byte(to, Parameter::RUN_MODE, 0))?,
            Step::Stopped | Step::Enabling | Step::Running => (),
        }
        let clears = self.exchange.is_some_and(|exchange| exchange.ask() == Ask::Clear);
        let frame = match self.step {
            Step::Running => wire::motion(to.motor, &self.setpoint, &self.limits),
            Step::Enabling => wire::enable(to),
            _ if clears => wire::clear_faults(to),
            _ => wire::stop(to),
        };
        // The torque is part of the identifier: of all of them only the newest counts.
        tx.push_as(frame, CanFrame::key_of(extended(MOTION | u32::from(to.motor))))
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push(wire::stop(self.address))
    }
}
