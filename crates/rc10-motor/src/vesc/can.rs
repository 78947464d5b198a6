//! A VESC on its bus: what it occupies, and its frames in and out.

use embedded_can::{ExtendedId, Id};
use rc10_app::Amps;
use rc10_can::{CanFrame, IdPattern, Micros};

use super::{Config, Packet, Reply, Setting, UnpackError, Vesc, coast, ping};
use crate::batch::{TxBatch, TxFull};
use crate::motor::{CanMotor, FrameError, FrameKind};
use crate::wiring::{CanIds, Guard, Ownership, Rate, RxFrames, TxFrames};

/// How often a changed current limit is told again, s: no VESC says that it has taken it.
const LIMIT_PERIOD: f32 = 1.0;

impl CanMotor for Vesc {
    fn wiring(&self) -> CanIds {
        let Config { id, status, asker, command_hz, .. } = self.config;
        let exact = |packet: Packet, id| IdPattern::exact(Id::Extended(packet.id(id)));
        // Whatever is said to one VESC, or to all.
        let to = |id: u32| {
            IdPattern::masked(ExtendedId::new(id).unwrap_or(ExtendedId::ZERO), 0x1FFF_00FF)
        };
        let statuses = STATUSES.into_iter().zip(status.all()).filter(|(_, rate)| *rate > 0);
        let mut receives = statuses.map(|(packet, rate)| RxFrames {
            pattern: exact(packet, id),
            len: 8,
            rate: Rate::Hz(rate),
            guard: None,
        });
        let pong = RxFrames {
            pattern: exact(Packet::Pong, asker),
            len: 2,
            rate: Rate::Rare,
            // Who answers.
            guard: Some(Guard { byte: 0, mask: 0xFF, value: id.get() }),
        };
        let commands = TxFrames {
            pattern: to(id.get().into()),
            len: 4,
            rate: Rate::Hz(command_hz),
            share: Ownership::Whole,
        };
        let rare = |packet, len| TxFrames {
            pattern: exact(packet, id),
            len,
            rate: Rate::Rare,
            share: Ownership::Whole,
        };
        let wiring = CanIds::new("VESC", id.get().into());
        // Seven patterns at most, of eight.
        let wired = receives
            .try_fold(wiring.clone(), CanIds::receives)
            .and_then(|wiring| wiring.receives(pong))
            .and_then(|wiring| wiring.transmits(commands))
            .and_then(|wiring| wiring.transmits(rare(Packet::Ping, 1)))
            .and_then(|wiring| wiring.transmits(rare(Packet::ConfCurrentLimits, 8)))
            .and_then(|wiring| wiring.listens_to(to(0xFF)));
        wired.unwrap_or(wiring)
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError> {
        match Reply::unpack(frame) {
            Ok(Reply::Status { from, status })
                if from == self.config.id && self.config.status.of(&status) > 0 =>
            {
                Ok(self.take(status, at))
            }
            Ok(Reply::Pong { from, to, hardware })
                if from == self.config.id && to == self.config.asker =>
            {
                // Other hardware than a VESC answers with another number.
                if hardware != 0 {
                    return Err(FrameError::Unexpected);
                }
                self.watch.hear_answer();
                Ok(FrameKind::Other)
            }
            Err(UnpackError::Length(..)) if self.receives(frame) => Err(FrameError::Length),
            Ok(_) | Err(_) => Err(FrameError::NotMine),
        }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        if self.is_due {
            tx.push_as(self.frame(), self.stream)?;
            self.is_due = false;
        }
        if self.told_limit.is_some_and(|left| left <= 0.0) {
            let (min, max) = (Amps::new(-self.limit), Amps::new(self.limit));
            // A limit that is not a number was refused.
            if let Ok(frame) = (Setting::MotorCurrent { min, max }).pack(self.config.id) {
                tx.push(frame)?;
            }
            self.told_limit = Some(LIMIT_PERIOD);
        }
        if self.watch.asks() {
            tx.push(ping(self.config.id, self.config.asker))?;
            self.watch.asked();
        }
        Ok(())
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push_as(coast(self.config.id), self.stream)
    }
}

impl Vesc {
    /// Whether a frame has an identifier, and says what guards it, of its own.
    #[cold]
    fn receives(&self, frame: &CanFrame) -> bool {
        self.wiring().received().iter().any(|receive| {
            receive.pattern.matches(frame) && receive.guard.is_none_or(|own| own.passes(frame))
        })
    }
}

/// In the order of their numbers.
pub(super) const STATUSES: [Packet; 6] = [
    Packet::Status,
    Packet::Status2,
    Packet::Status3,
    Packet::Status4,
    Packet::Status5,
    Packet::Status6,
];
