//! The firmware's log: defmt frames in a ring in RAM (SEGGER RTT), read as by a debug probe.

use anyhow::{Context, Result};
use defmt_decoder::{DecodeError, Table};

use crate::image::Image;
use crate::memory::Memory;

// The control block, as defmt-rtt lays it out: 16 bytes of name, two counts, then the up channel:
// name, buffer, size, write offset, read offset, flags.
const CONTROL_BLOCK: &str = "_SEGGER_RTT";
const BUFFER: u32 = 24 + 4;
const READ: u32 = BUFFER + 12;
/// The longest valid ring: beyond it the control block is not set up yet.
const LONGEST_RING: u32 = 1 << 16;

const ID: &[u8; 10] = b"SEGGER RTT";

pub(crate) struct Log {
    table: Option<Table>,
    control_block: Option<u32>,
    bytes: Vec<u8>,
}

impl Log {
    /// Fails if the program's table of log messages cannot be read.
    pub(crate) fn new(file: &[u8], image: &Image) -> Result<Self> {
        let table = Table::parse(file).context("the table of log messages")?;
        Ok(Self {
            table,
            control_block: image.symbols.get(CONTROL_BLOCK).copied(),
            bytes: Vec::new(),
        })
    }

    fn drain(&mut self, memory: &Memory) -> Result<()> {
        let Some(block) = self.control_block else {
            return Ok(());
        };
        // As a probe does: until the program has written it, anything stands there.
        let mut id = [0; ID.len()];
        memory.read(block, &mut id)?;
        if id != *ID {
            return Ok(());
        }
        let mut words = [[0; 4]; 4];
        memory.read(block + BUFFER, words.as_flattened_mut())?;
        let [buffer, size, write, read] = words.map(u32::from_le_bytes);
        if size == 0 || size > LONGEST_RING || write >= size || read >= size {
            return Ok(());
        }
        let mut at = read;
        while at != write {
            let end = if write > at { write } else { size };
            let mut bytes = vec![0; (end - at) as usize];
            memory.read(buffer + at, &mut bytes)?;
            self.bytes.extend_from_slice(&bytes);
            at = end % size;
        }
        memory.write(block + READ, &write.to_le_bytes())
    }

    /// The messages that are complete by now, one text each. Fails if the ring does not lie in a
    /// memory.
    pub(crate) fn messages(&mut self, memory: &Memory) -> Result<Vec<String>> {
        self.drain(memory)?;
        let Some(table) = self.table.as_ref().filter(|_| !self.bytes.is_empty()) else {
            self.bytes.clear();
            return Ok(Vec::new());
        };
        let mut decoder = table.new_stream_decoder();
        decoder.received(&self.bytes);
        // Bytes of an incomplete frame wait for the next call.
        let complete = self.bytes.iter().rposition(|&byte| byte == 0).map_or(0, |last| last + 1);
        let mut messages = Vec::new();
        loop {
            match decoder.decode() {
                Ok(frame) => {
                    let level = frame.level().map_or("", |level| level.as_str());
                    messages.push(format!("{level:<5} {}", frame.display_message()));
                }
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => messages.push("(a damaged log message)".into()),
            }
        }
        self.bytes.drain(..complete);
        Ok(messages)
    }

    pub(crate) fn reset(&mut self) {
        self.bytes.clear();
    }
}
