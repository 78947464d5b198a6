use embedded_can::{Id, StandardId};
use heapless::Vec;
use rc10_can::CanFrame;

/// The frames of one tick. Motors that share a frame each write their lane of it: there is one
/// frame per identifier, other bytes zero, or one per [stream](Self::push_as) that a motor names.
#[derive(Clone, Debug, Default)]
pub struct TxBatch {
    frames: Vec<CanFrame, { Self::CAPACITY }>,
    streams: Vec<u32, { Self::CAPACITY }>,
    refused: Option<Id>,
}

/// No room in a [`TxBatch`] or a lane; [`TxBatch::refused`] says for which frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no room in the tick's batch for a frame")]
pub struct TxFull;

impl TxBatch {
    /// Frames a batch holds.
    pub const CAPACITY: usize = 16;

    /// An empty batch.
    pub const fn new() -> Self {
        Self { frames: Vec::new(), streams: Vec::new(), refused: None }
    }

    /// Adds a whole frame.
    ///
    /// # Errors
    /// [`TxFull`] if there are [`CAPACITY`](Self::CAPACITY) already.
    pub fn push(&mut self, frame: CanFrame) -> Result<(), TxFull> {
        self.push_as(frame, frame.key())
    }

    /// Adds a whole frame in place of an unsent one of the same `stream`, for devices whose
    /// identifiers say what is commanded: the [key](CanFrame::key) of an own identifier.
    ///
    /// # Errors
    /// [`TxFull`] if there are [`CAPACITY`](Self::CAPACITY) frames already.
    pub fn push_as(&mut self, frame: CanFrame, stream: u32) -> Result<(), TxFull> {
        self.frames.push(frame).map_err(|frame| self.refuse(frame.id()))?;
        // As long as the frames.
        let _ = self.streams.push(stream);
        Ok(())
    }

    /// Writes two bytes at `offset` (0 ..= 6) into the eight-byte frame of identifier `id`.
    ///
    /// # Errors
    /// [`TxFull`] if the frame had to be opened and there is no room, or the lane lies outside it.
    pub fn lane(&mut self, id: StandardId, offset: usize, bytes: [u8; 2]) -> Result<(), TxFull> {
        let key = CanFrame::key_of(id);
        // Neighbours share a frame, so the newest one is nearly always the one.
        let frame = self.frames.iter_mut().rev().find(|frame| frame.key() == key);
        match frame.map(|frame| write(frame, offset, bytes)) {
            None => self.open(id, offset, bytes),
            Some(true) => Ok(()),
            Some(false) => Err(self.refuse(id.into())),
        }
    }

    #[cold] // One motor in four: inlined, every lane pays for it.
    fn open(&mut self, id: StandardId, offset: usize, bytes: [u8; 2]) -> Result<(), TxFull> {
        let mut data = [0; 8];
        match data.get_mut(offset..).and_then(|rest| rest.first_chunk_mut()) {
            Some(lane) => *lane = bytes,
            None => return Err(self.refuse(id.into())),
        }
        self.push(CanFrame::eight_bytes(id, data))
    }

    #[cold] // An error: kept out of the way of the lanes.
    fn refuse(&mut self, id: Id) -> TxFull {
        self.refused = Some(id);
        TxFull
    }

    /// The identifier of the last frame that found no room since [`clear`](Self::clear).
    pub const fn refused(&self) -> Option<Id> {
        self.refused
    }

    /// The frames, in the order they were opened.
    pub fn frames(&self) -> &[CanFrame] {
        &self.frames
    }

    /// The frames and streams for [`CanPort::submit_as`](rc10_can::CanPort::submit_as).
    pub fn entries(&self) -> impl Iterator<Item = (&CanFrame, u32)> {
        self.frames.iter().zip(self.streams.iter().copied())
    }

    /// Forgets all frames.
    pub fn clear(&mut self) {
        self.frames.clear();
        self.streams.clear();
        self.refused = None;
    }
}

/// Writes a lane; `false` where it does not fit.
fn write(frame: &mut CanFrame, offset: usize, bytes: [u8; 2]) -> bool {
    match frame.all_eight_mut() {
        Some(data) if offset <= 6 => {
            data[offset] = bytes[0];
            data[offset + 1] = bytes[1];
            true
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(raw: u16) -> StandardId {
        StandardId::new(raw).unwrap()
    }

    #[test]
    fn lanes_of_one_id_meet_in_one_frame() {
        let mut tx = TxBatch::new();
        tx.lane(id(0x1FF), 0, [1, 2]).unwrap();
        tx.lane(id(0x200), 0, [9, 9]).unwrap();
        tx.lane(id(0x1FF), 6, [3, 4]).unwrap();
        assert_eq!(tx.frames().len(), 2);
        assert_eq!(tx.frames()[0].bytes(), [1, 2, 0, 0, 0, 0, 3, 4]);
    }

    #[test]
    fn a_full_batch_refuses_new_ids_but_not_known_lanes() {
        let mut tx = TxBatch::new();
        for raw in 0..16 {
            tx.lane(id(raw), 0, [1, 1]).unwrap();
        }
        assert_eq!(tx.lane(id(16), 0, [1, 1]), Err(TxFull));
        assert_eq!(tx.refused(), Some(id(16).into()));
        tx.lane(id(3), 2, [5, 5]).unwrap();
        assert_eq!(tx.lane(id(3), 7, [5, 5]), Err(TxFull));
        assert_eq!(tx.refused(), Some(id(3).into()));
        assert_eq!(tx.frames()[3].bytes(), [1, 1, 5, 5, 0, 0, 0, 0]);
        tx.clear();
        assert_eq!((tx.frames().len(), tx.refused()), (0, None));
    }
}
