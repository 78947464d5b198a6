//! The black box of a chip, as it lies in its memory: [`rc10_motor::record::ring`].

use rc10_motor::record::ring::{self, Memory, Reader, WORDS};

/// The symbol of the program.
pub(crate) const NAME: &str = "RC10_BLACK_BOX";
/// All of it.
pub(crate) const BYTES: usize = 4 * WORDS;

/// What is read of a black box as it is filled.
pub(crate) struct BlackBox {
    reader: Box<Reader>,
    memory: Box<Memory>,
}

impl Default for BlackBox {
    fn default() -> Self {
        let memory = vec![0; WORDS].into_boxed_slice();
        Self {
            reader: Box::new(Reader::NEW),
            memory: memory.try_into().unwrap_or_else(|_| Box::new([0; WORDS])),
        }
    }
}

impl BlackBox {
    /// A memory, if it is that of a black box in which something is.
    pub(crate) fn of(memory: &[u8]) -> Option<Self> {
        let mut it = Self::default();
        it.fill(memory);
        (memory.len() == BYTES && it.is_kept()).then_some(it)
    }

    /// Takes a copy, at the end of which the memory began like this; what was overwritten meanwhile is taken out of it.
    /// Returns how many blocks that are.
    pub(crate) fn copied(&mut self, copy: &mut [u8], end: &[u8]) -> usize {
        self.fill(end);
        let newest = self.memory[ring::NEWEST];
        self.fill(copy);
        let gone = ring::trim(&mut self.memory, newest);
        for (bytes, word) in copy.as_chunks_mut::<4>().0.iter_mut().zip(&*self.memory) {
            *bytes = word.to_le_bytes();
        }
        gone
    }

    /// Whether something is in it.
    pub(crate) fn is_kept(&self) -> bool {
        ring::is_kept(&self.memory)
    }

    fn fill(&mut self, memory: &[u8]) {
        for (word, bytes) in self.memory.iter_mut().zip(memory.as_chunks().0) {
            *word = u32::from_le_bytes(*bytes);
        }
    }

    /// The words that came since the last call; of all of its entries the first time.
    pub(crate) fn news(&mut self) -> Vec<u32> {
        let mut words = Vec::new();
        self.reader.read(&self.memory, &mut |entry| words.extend(entry));
        words
    }

    /// The same of another memory.
    pub(crate) fn news_of(&mut self, memory: &[u8]) -> Vec<u32> {
        self.fill(memory);
        self.news()
    }

    /// A word of its head.
    pub(crate) fn word(&self, at: usize) -> u32 {
        self.memory[at]
    }
}
