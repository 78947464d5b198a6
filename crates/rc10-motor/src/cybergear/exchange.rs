//! Requests that are over only when the device has answered.

use rc10_app::Seconds;

use super::wire::{self, Address, Feedback, Mode, Parameter, ParameterValue};
use crate::batch::{TxBatch, TxFull};
use crate::motor::{RequestError, Response};

/// What the device is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ask {
    /// To forget its faults: the motor itself sends that in the place of its stop.
    Clear,
    Read(Parameter),
    /// To take a value, and to say what it holds then: the answer to writing is plain feedback.
    Write(Parameter, [u8; 4]),
    /// To be at zero here.
    Zero,
    /// To keep its parameters.
    Save,
}

/// A device has so long to answer …
const PATIENCE: f32 = 0.1;
/// … or, where its flash is written, so long.
const SAVE_PATIENCE: f32 = 0.5;
/// What is lost is asked again every so many ticks. Never a save: flash wears.
const REPEAT: u16 = 16;
/// Before a save nothing is sent for so many ticks: feedback tells not what it answers, so what
/// comes afterwards must have one cause only.
const QUIET: u16 = 3;

/// A request that waits for its answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exchange {
    ask: Ask,
    elapsed: f32,
    ticks: u16,
    /// A code of the device, to be told if time runs out.
    refusal: Option<u32>,
}

pub(super) type Outcome = Result<Response, RequestError>;

impl Exchange {
    pub(super) const fn new(ask: Ask) -> Self {
        Self { ask, elapsed: 0.0, ticks: 0, refusal: None }
    }

    pub(super) const fn ask(&self) -> Ask {
        self.ask
    }

    /// Whether nothing else may be sent.
    pub(super) fn wants_quiet(&self) -> bool {
        self.ask == Ask::Save
    }

    /// Whether it changes the device, for which the robot must be disarmed.
    pub(super) const fn needs_disarmed(&self) -> bool {
        matches!(self.ask, Ask::Write(..) | Ask::Zero | Ask::Save)
    }

    /// A tick later: what became of it, if nothing will any more.
    pub(super) fn tick(&mut self, dt: Seconds) -> Option<Outcome> {
        self.elapsed += dt.get();
        self.ticks = self.ticks.saturating_add(1);
        let patience = if self.ask == Ask::Save { SAVE_PATIENCE } else { PATIENCE };
        (self.elapsed > patience)
            .then(|| Err(self.refusal.map_or(RequestError::NoReply, RequestError::Refused)))
    }

    /// What it sends in this tick, the first being number 1.
    pub(super) fn pack(&self, to: Address, tx: &mut TxBatch) -> Result<(), TxFull> {
        let turn = self.ticks % REPEAT;
        match self.ask {
            Ask::Read(parameter) if turn == 1 => tx.push(wire::read(to, parameter)),
            Ask::Write(parameter, bytes) if turn == 1 => tx.push(wire::write(to, parameter, bytes)),
            Ask::Write(parameter, _) if turn == 2 => tx.push(wire::read(to, parameter)),
            Ask::Zero if turn == 1 => tx.push(wire::set_zero(to)),
            Ask::Save if self.ticks == QUIET => tx.push(wire::save(to)),
            _ => Ok(()),
        }
    }

    /// Takes feedback: what it tells about the request.
    pub(super) fn feedback(&mut self, heard: &Feedback) -> Option<Outcome> {
        let sent = match self.ask {
            Ask::Save => self.ticks >= QUIET,
            _ => self.ticks > 0,
        };
        let done = match self.ask {
            Ask::Read(_) | Ask::Write(..) => false,
            Ask::Save => true,
            Ask::Zero => heard.position.abs() < AT_ZERO && heard.mode != Mode::Run,
            Ask::Clear => {
                let bits = heard.faults.bits();
                self.refusal = (bits != 0).then_some(bits.into());
                bits == 0
            }
        };
        (sent && done).then_some(Ok(Response::Done))
    }

    /// Takes a parameter; `None` if nobody asked for it, `Some(None)` if it does not end the
    /// request.
    #[expect(clippy::option_option, reason = "asked for or not, and over or not")]
    pub(super) fn parameter(&mut self, value: &ParameterValue) -> Option<Option<Outcome>> {
        let code = u32::from_le_bytes(value.bytes);
        match self.ask {
            Ask::Read(parameter) if parameter == value.parameter => Some(Some(if value.refused {
                Err(RequestError::Refused(UNKNOWN_PARAMETER))
            } else {
                Ok(Response::Register(code))
            })),
            Ask::Write(parameter, bytes) if parameter == value.parameter => {
                if value.refused {
                    return Some(Some(Err(RequestError::Refused(UNKNOWN_PARAMETER))));
                }
                self.refusal = Some(code);
                Some((value.bytes == bytes).then_some(Ok(Response::Done)))
            }
            _ => None,
        }
    }
}

/// The device's shaft is free while it is zeroed, and may move a little meanwhile; rad.
const AT_ZERO: f32 = 0.1;
/// What a device answers for a parameter that it does not have (RobStride manuals, type 17).
const UNKNOWN_PARAMETER: u32 = 1;
