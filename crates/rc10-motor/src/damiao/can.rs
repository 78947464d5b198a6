//! What a motor occupies on its bus, and what goes out on it.

use rc10_can::{CanFrame, IdPattern, Micros};

use super::motor::Damiao;
use super::wire::{Mode, Operation, REGISTERS, operate, standard};
use crate::batch::{TxBatch, TxFull};
use crate::motor::{CanMotor, FrameError, FrameKind};
use crate::wiring::{CanIds, CanIdsFull, Guard, Ownership, Rate, RxFrames, TxFrames};

/// It reacts to every standard identifier with its own low byte.
const LOW_BYTE: u32 = 0xFF;

impl Damiao {
    /// The stream of its commands: all of them, to whichever identifier, take each other's place.
    fn command_stream(&self) -> u32 {
        CanFrame::key_of(self.can_id().command_id(self.mode()))
    }

    /// The stream of its register frames, whose identifier is everybody's: an identifier with its
    /// low byte that it never uses.
    fn register_stream(&self) -> u32 {
        let unused = match self.mode() {
            Mode::ForcePosition => Mode::Velocity,
            Mode::Mit | Mode::PositionVelocity | Mode::Velocity => Mode::ForcePosition,
        };
        CanFrame::key_of(self.can_id().command_id(unused))
    }

    fn wired(&self, wiring: CanIds) -> Result<CanIds, CanIdsFull> {
        let id = self.can_id();
        let [low, _] = id.raw().to_le_bytes();
        let command = |mode, len, rate| TxFrames {
            pattern: IdPattern::exact(id.command_id(mode)),
            len,
            rate,
            share: Ownership::Whole,
        };
        let register = |len| TxFrames {
            pattern: IdPattern::exact(standard(REGISTERS)),
            len,
            rate: Rate::Rare,
            share: Ownership::Guard(Guard { byte: 0, mask: 0xFF, value: low }),
        };
        let feedback = RxFrames {
            pattern: IdPattern::exact(self.master_id()),
            len: 8,
            rate: Rate::EveryTick,
            // Register replies have the whole identifier there, so the same four bits.
            guard: Some(Guard { byte: 0, mask: 0x0F, value: low & 0x0F }),
        };
        let mut wiring = wiring
            .receives(feedback)?
            .transmits(command(self.mode(), 8, Rate::EveryTick))?
            .transmits(register(4))?
            .transmits(register(8))?
            .listens_to(IdPattern::masked(id.command_id(Mode::Mit), LOW_BYTE))?;
        if self.mode() != Mode::Mit {
            wiring = wiring.transmits(command(Mode::Mit, 8, Rate::Rare))?;
        }
        if self.mode() == Mode::Velocity {
            // Shorter than the operations, which the load counts on.
            wiring = wiring.transmits(command(Mode::Velocity, 4, Rate::Rare))?;
        }
        Ok(wiring)
    }
}

impl CanMotor for Damiao {
    fn wiring(&self) -> CanIds {
        let wiring = CanIds::new(self.model().name, self.can_id().raw());
        self.wired(wiring.clone()).unwrap_or(wiring)
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError> {
        if frame.key() == CanFrame::key_of(self.master_id()) {
            self.hear(frame, at)
        } else {
            Err(FrameError::NotMine)
        }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push_as(self.command_frame(), self.command_stream())?;
        match self.register_frame() {
            Some(frame) => tx.push_as(frame, self.register_stream()),
            None => Ok(()),
        }
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push(operate(self.can_id(), self.mode(), Operation::Disable))?;
        if self.mode() == Mode::Mit {
            return Ok(());
        }
        tx.push(operate(self.can_id(), Mode::Mit, Operation::Disable))
    }
}
