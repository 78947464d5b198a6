//! The flash of a simulated robot's kept parameters: in memory, or in a file that outlasts the run.

use std::fs::{File, OpenOptions};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use rc10_module::store::{Cells, WORD, Word};

use crate::terminal::tell;

/// Words of a sector: fewer than of a chip, so that they are erased now and then.
const WORDS: u32 = 256;
const BYTES: usize = 2 * WORDS as usize * WORD;

/// Two sectors, erased when new.
#[derive(Debug)]
pub struct KeptFlash {
    bytes: Vec<u8>,
    file: Option<File>,
}

impl Default for KeptFlash {
    fn default() -> Self {
        Self { bytes: vec![0xFF; BYTES], file: None }
    }
}

impl KeptFlash {
    /// What a file holds, which is made if it is not there. Fails if it cannot be read or written,
    /// or is something else by its length: it would be erased.
    pub fn open(path: &Path) -> Result<Self> {
        let name = path.display();
        let file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = file.with_context(|| format!("cannot open {name}"))?;
        let mut bytes = Vec::new();
        // No more than tells a foreign file.
        (&file)
            .take(BYTES as u64 + 1)
            .read_to_end(&mut bytes)
            .with_context(|| format!("cannot read {name}"))?;
        if bytes.is_empty() {
            bytes = vec![0xFF; BYTES];
            file.write_all(&bytes).with_context(|| format!("cannot write {name}"))?;
        }
        ensure!(
            bytes.len() == BYTES,
            "{name} is no file of kept parameters: those have {BYTES} bytes"
        );
        Ok(Self { bytes, file: Some(file) })
    }

    fn range(sector: u32, word: u32) -> std::ops::Range<usize> {
        let first = (sector * WORDS + word) as usize * WORD;
        first..first + WORD
    }

    /// Writes what has changed to the file.
    fn keep(&mut self, range: std::ops::Range<usize>) {
        let (Some(file), Some(bytes)) = (&mut self.file, self.bytes.get(range.clone())) else {
            return;
        };
        let outcome =
            file.seek(SeekFrom::Start(range.start as u64)).and_then(|_| file.write_all(bytes));
        if let Err(why) = outcome {
            tell(format_args!("the file of the kept parameters: {why}"));
        }
    }
}

impl Cells for KeptFlash {
    fn words(&self) -> u32 {
        WORDS
    }

    fn read(&mut self, sector: u32, word: u32) -> Word {
        let bytes = self.bytes.get(Self::range(sector, word));
        bytes.and_then(|it| it.first_chunk().copied()).unwrap_or([0; WORD])
    }

    fn program(&mut self, sector: u32, word: u32, bytes: &Word) {
        let range = Self::range(sector, word);
        // As of a flash, which only clears bits.
        for (old, new) in self.bytes.iter_mut().skip(range.start).zip(bytes) {
            *old &= new;
        }
        self.keep(range);
    }

    fn erase(&mut self, sector: u32) {
        let range = Self::range(sector, 0).start..Self::range(sector + 1, 0).start;
        self.bytes.iter_mut().take(range.end).skip(range.start).for_each(|byte| *byte = 0xFF);
        self.keep(range);
    }
}
