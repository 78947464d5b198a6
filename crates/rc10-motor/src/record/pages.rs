//! A black box that outlives its power: the blocks of a [`ring`], page by page in a serial flash. Chip and PC both know
//! it from here.
//!
//! The flash is a ring of pages itself: the newest is that with the highest number. It records while the robot is armed,
//! from some blocks before until some time after: a *match*. What a crash has left in the ring is one of its own. The page `docs/replay.md` says what stands where.

use rc10_time::Micros;

use super::Hash;
use super::ring::{self, Part};

/// Words of a page.
pub const PAGE: usize = 64;
/// Pages of the flash.
pub const PAGES: u32 = 32_768;
/// Pages that are erased at once.
pub const ERASED: u32 = 256;

/// Words before the content: hash of the rest, number of the page, number of match and block, and of the block's first
/// page the stream's words before it; of others the program's fingerprint.
pub const HEAD: usize = 4;
/// Words of a block in a page.
pub const CONTENT: usize = PAGE - HEAD;
const IS_LAST: u32 = 1 << 15;
const IS_FIRST: u32 = 1 << 16;
const MATCH: u32 = 17;
/// Highest number of a match; then it is 0 again.
pub const ROUNDS: u16 = u16::MAX >> 1;

/// Erased pages before the one that is written: what a slow erase of 2 s holds up, the ring has.
const AHEAD: u32 = 256;
/// Blocks from before arming, half of the ring: a replay finds the state of all motors in them.
const BEFORE: u16 = 16;
/// Time after disarming that is recorded.
const AFTER: Micros = Micros::from_millis(2_000);

/// A page.
pub type Page = [u32; PAGE];

/// The page that these bytes are.
#[must_use]
pub fn page_of(bytes: &[u8; 4 * PAGE]) -> Page {
    let words = bytes.as_chunks().0;
    core::array::from_fn(|at| u32::from_le_bytes(words[at]))
}

/// A flash of pages. A programmed page has all its bits; what is erased has ones.
pub trait Flash {
    /// Whether the operation before is not done yet: then it takes no other.
    fn is_busy(&mut self) -> bool;
    /// Reads a page.
    fn read(&mut self, page: u32) -> Page;
    /// Begins to program an erased page.
    fn program(&mut self, page: u32, content: &Page);
    /// Begins to erase [`ERASED`] pages, from this one on.
    fn erase(&mut self, first: u32);
}

/// What a whole page says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// Number of the page since the flash was new.
    pub number: u32,
    /// Number of the match.
    pub round: u16,
    /// Number of the block.
    pub block: u16,
    /// Whether the block begins with it.
    pub is_first: bool,
    /// Whether the block ends in it, before its highest bit.
    pub is_last: bool,
    /// Of a first page the stream's words before the block, of others the program's fingerprint.
    pub word: u32,
}

impl Head {
    /// That of a page at this place; `None`: it was not written whole, or is of something else.
    #[must_use]
    pub fn of(page: &Page, place: u32) -> Option<Self> {
        let [sum, number, of, word, ..] = *page;
        let is_whole = sum == hash(page) && number % PAGES == place;
        is_whole.then_some(Self {
            number,
            round: (of >> MATCH) as u16,
            block: (of & (IS_LAST - 1)) as u16,
            is_first: of & IS_FIRST != 0,
            is_last: of & IS_LAST != 0,
            word,
        })
    }

    /// The number of the block's bits in its page.
    #[must_use]
    pub fn bits(self, page: &Page) -> usize {
        let content = &page[HEAD..];
        let end = content.iter().rposition(|word| *word != 0).unwrap_or_default();
        let highest = content[end].checked_ilog2().unwrap_or_default() as usize;
        if self.is_last { end * 32 + highest } else { CONTENT * 32 }
    }
}

fn hash(page: &Page) -> u32 {
    let mut hash = Hash::NEW;
    page[1..].iter().for_each(|word| hash.add(&word.to_le_bytes()));
    let hash = hash.get();
    hash as u32 ^ (hash >> 32) as u32
}

/// Whether a number of a page is behind another.
const fn is_behind(number: u32, other: u32) -> bool {
    number.wrapping_sub(other).cast_signed() > 0
}

/// Keeps matches, a page at a time.
pub struct Keeper {
    search: Search,
    /// The number of the next page, and up to which all are erased.
    next: u32,
    erased: u32,
    /// The number of the newest match.
    round: u16,
    /// The block of the ring that is written, and how many of its words are.
    at: Option<(u16, usize)>,
    /// Whether that is of what a crash has left, whether its first page is the first of a match, and whether what a crash has
    /// left is written.
    is_crash: bool,
    begins: bool,
    has_crash: bool,
    until: Option<Micros>,
}

/// How far the newest page is known.
enum Search {
    /// This page is looked at next, of those with which an erased part begins; and the newest number so far.
    Firsts(u32, Option<u32>),
    /// The newest part begins with this number; so many of its pages were looked at.
    Within(u32, u32),
    Done,
}

impl Keeper {
    /// One that knows nothing of its flash.
    pub const NEW: Self = Self {
        search: Search::Firsts(0, None),
        next: 0,
        erased: 0,
        round: 0,
        at: None,
        is_crash: false,
        begins: false,
        has_crash: false,
        until: None,
    };

    /// Goes on by at most one operation of the flash; `part` is [`ring::part`] of the ring that is kept.
    pub fn step(
        &mut self,
        flash: &mut impl Flash,
        mut part: impl FnMut(u16, usize, &mut [u32]) -> Part,
        is_armed: bool,
        now: Micros,
    ) {
        let mut page = [0; PAGE];
        let (block, words) = self.at.unwrap_or_default();
        let Part { newest, is_there, before, length, print, is_held } =
            part(block, words, &mut page[HEAD..]);
        let left = length.saturating_sub(words * 32);
        self.until = if is_armed { Some(now + AFTER) } else { self.until.filter(|it| now < *it) };
        // What a crash has left is a match of its own.
        let is_wanted = if is_held { !self.has_crash } else { self.until.is_some() };
        let is_written = newest == block && left < CONTENT * 32;
        if self.at.is_some() && (self.is_crash != is_held || !is_wanted && is_written) {
            self.at = None;
            return;
        }
        if is_wanted && self.at.is_none() || self.at.is_some() && !is_there {
            // The oldest, if it was overwritten: a reader sees how much is missing.
            let is_new = self.at.is_none();
            let back = if is_new && !is_held { BEFORE } else { ring::BLOCKS };
            let mut blocks = (0..back).rev().map(|back| ring::before(newest, back));
            let oldest = blocks.find(|it| part(*it, 0, &mut []).is_there).unwrap_or(newest);
            (self.at, self.is_crash, self.begins) =
                (Some((oldest, 0)), is_held, self.begins || is_new);
            return;
        }
        if flash.is_busy() {
            return;
        }
        if !matches!(self.search, Search::Done) {
            return self.look(flash);
        }
        if self.erased.wrapping_sub(self.next) < AHEAD {
            flash.erase(self.erased % PAGES);
            self.erased = self.erased.wrapping_add(ERASED);
            return;
        }
        let is_last = (newest != block || is_held) && left < CONTENT * 32;
        if self.at.is_none() || left < CONTENT * 32 && !is_last {
            return;
        }
        if is_last {
            // The highest bit that is one marks the end, which is before it.
            page[HEAD + left / 32] &= (1 << (left % 32)) - 1;
            page[HEAD + left / 32] |= 1 << (left % 32);
            page[HEAD + left / 32 + 1..].fill(0);
        }
        self.round = (self.round + u16::from(self.begins)) & ROUNDS;
        self.begins = false;
        let of = u32::from(self.round) << MATCH | u32::from(block);
        let (first, last) = (u32::from(words == 0) * IS_FIRST, u32::from(is_last) * IS_LAST);
        page[1..HEAD].copy_from_slice(&[
            self.next,
            of | first | last,
            if words == 0 { before } else { print },
        ]);
        page[0] = hash(&page);
        flash.program(self.next % PAGES, &page);
        self.next = self.next.wrapping_add(1);
        self.at = Some(if is_last { (ring::after(block), 0) } else { (block, words + CONTENT) });
        if is_last && newest == block {
            (self.has_crash, self.at) = (true, None);
        }
    }

    /// The number of the next page, and that of the newest match; `None` before they are known.
    #[must_use]
    pub const fn next(&self) -> Option<[u32; 2]> {
        if matches!(self.search, Search::Done) {
            Some([self.next, self.round as u32])
        } else {
            None
        }
    }

    /// Looks at a page, in search of the newest.
    fn look(&mut self, flash: &mut impl Flash) {
        self.search = match self.search {
            Search::Firsts(place, newest) => {
                let head = Head::of(&flash.read(place), place).map(|it| it.number);
                let head = head.filter(|it| newest.is_none_or(|newest| is_behind(*it, newest)));
                match head.or(newest) {
                    newest if place + ERASED < PAGES => Search::Firsts(place + ERASED, newest),
                    Some(newest) => {
                        self.erased = newest.wrapping_add(ERASED);
                        Search::Within(newest, 0)
                    }
                    None => Search::Done,
                }
            }
            Search::Within(first, at) => {
                let number = first.wrapping_add(at);
                let page = flash.read(number % PAGES);
                if let Some(head) = Head::of(&page, number % PAGES) {
                    self.round = head.round;
                }
                // Also one that a cut has torn.
                if page.iter().any(|word| *word != u32::MAX) {
                    self.next = number.wrapping_add(1);
                }
                if at + 1 < ERASED { Search::Within(first, at + 1) } else { Search::Done }
            }
            Search::Done => Search::Done,
        };
    }
}
