//! The black box of a chip, as it lies in its memory: [`rc10_motor::record::ring`]; and matches in its board's flash:
//! [`rc10_motor::record::pages`].

use rc10_motor::record::pages::{HEAD, Head, PAGE, PAGES, Page, page_of};
use rc10_motor::record::ring::{self, Memory, Reader, WORDS};

/// The symbol of the program.
pub(crate) const NAME: &str = "RC10_BLACK_BOX";
/// All of it.
pub(crate) const BYTES: usize = 4 * WORDS;

/// Bytes of a page.
pub(crate) const PAGE_BYTES: usize = 4 * PAGE;

/// The pages in a copy of a flash or of a part of it that are whole, and what they say of themselves.
pub(crate) fn pages(bytes: &[u8]) -> impl Iterator<Item = (Head, Page, &[u8; PAGE_BYTES])> {
    bytes.as_chunks::<PAGE_BYTES>().0.iter().filter_map(|bytes| {
        let page = page_of(bytes);
        Some((Head::of(&page, page[1] % PAGES)?, page, bytes))
    })
}

/// A block of a ring as far as its pages are there.
struct Block {
    number: u16,
    before: u32,
    bits: Vec<u32>,
    length: usize,
}

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

    /// The pages of a match in their order: the memory in the end, and the words of all entries. `None`: they are no pages.
    pub(crate) fn of_pages(bytes: &[u8]) -> Option<(Self, Vec<u32>)> {
        let (mut blocks, mut print, mut next) = (Vec::<Block>::new(), 0, None);
        for (head, page, _) in pages(bytes) {
            if head.is_first {
                let (number, before) = (head.block, head.word);
                blocks.push(Block { number, before, bits: Vec::new(), length: 0 });
            } else if next == Some(head.number) {
                print = head.word;
            } else {
                // The block has ended before: by a page that is not whole.
                continue;
            }
            let block = blocks.last_mut()?;
            block.bits.extend(&page[HEAD..]);
            block.length += head.bits(&page);
            next = (!head.is_last).then(|| head.number.wrapping_add(1));
        }
        let (mut it, mut words) = (Self::default(), Vec::new());
        let ends = blocks.iter().skip(1).chain(blocks.last()).map(|it| it.before);
        for (block, end) in blocks.iter().zip(ends) {
            let Block { number, before, bits, length } = block;
            // The reader finds the newest by the others that are there; zeros would be a block of number 0.
            it.memory.fill(u32::MAX);
            ring::put_block(&mut it.memory, *number, [*before, end], bits, *length);
            words.extend(it.news());
        }
        it.memory[ring::PRINT] = print;
        (!blocks.is_empty()).then_some((it, words))
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
