//! Entries as bits: what an entry is like is known from those before it, and only the difference is said.
//!
//! [`Model::entry`] says what stands in the bits, and a [`Pen`] either writes or reads them: writer and reader cannot
//! drift apart. The page `docs/replay.md` has the format.

use super::{BYTES, FRAME, KEYFRAME, OUTGOING, POLL, SENT, TICK, TOOK};

/// Most contexts that are learned; one more is for those that are not.
const SLOTS: usize = 128;
const PAIRS: usize = 256;
const GUESSES: usize = 512;
/// So many zeros say that a number is said otherwise.
pub(super) const ZEROS: u32 = 10;

/// Writes bits, or reads them.
pub(super) trait Pen {
    const WRITES: bool;

    /// A number of so many bits, 31 at most.
    fn bits(&mut self, value: u32, count: u32) -> u32;

    /// A number: its bits above the lowest `low` as so many zeros and a one, then those. As many as [`ZEROS`]: it is said
    /// otherwise. Returns the zeros, too.
    fn number(&mut self, number: u32, low: u32) -> (u32, u32);

    /// A word of the entry; a reader has none yet.
    fn get(&self, at: usize) -> u32;

    /// A word of the entry that was read.
    fn set(&mut self, at: usize, word: u32);

    /// A whole word.
    #[inline(always)]
    fn word(&mut self, value: u32) -> u32 {
        self.bits(value & 0xFFFF, 16) | self.bits(value >> 16, 16) << 16
    }
}

/// How many bits a number is likely to have, sixteenths.
#[derive(Clone, Copy)]
struct Scale(u32);

impl Scale {
    const NEW: Self = Self(4 * 16);

    /// A number; `None`: it is said otherwise.
    #[inline(always)]
    fn number<P: Pen>(&mut self, pen: &mut P, number: u32) -> Option<u32> {
        let (zeros, number) = pen.number(number, self.0 / 16);
        self.0 = (self.0 + 4 * zeros).saturating_sub(3).min(15 * 16);
        (zeros < ZEROS).then_some(number)
    }
}

/// A difference with its sign in the lowest bit.
#[inline(always)]
const fn folded(signed: i32) -> u32 {
    (signed << 1 ^ signed >> 31).cast_unsigned()
}

/// The difference.
#[inline(always)]
const fn unfolded(number: u32) -> u32 {
    number >> 1 ^ (number & 1).wrapping_neg()
}

/// A difference whose sign is below so many unused bits.
#[inline(always)]
const fn signed(difference: u32, unused: u32) -> i32 {
    difference.wrapping_shl(unused).cast_signed().wrapping_shr(unused)
}

/// A number in each entry of a slot.
#[derive(Clone, Copy)]
struct Field {
    last: u32,
    step: u32,
    scale: Scale,
    /// How often of late the last one with its step was a better guess than the last one.
    steady: i32,
    /// Its bits: it wraps above them, as an angle does.
    mask: u32,
}

impl Field {
    const NEW: Self = Self { last: 0, step: 0, scale: Scale::NEW, steady: 0, mask: 0xFFF };

    /// A whole word that is likely to be as guessed.
    #[inline(always)]
    fn word<P: Pen>(&mut self, pen: &mut P, value: u32, guess: u32) -> u32 {
        let number = self.scale.number(pen, folded(value.wrapping_sub(guess).cast_signed()));
        let value = match number {
            Some(_) if P::WRITES => value,
            Some(number) => guess.wrapping_add(unfolded(number)),
            None => pen.word(value),
        };
        (self.step, self.last) = (value.wrapping_sub(self.last), value);
        value
    }

    /// Now and then: whether its step would have been right.
    #[inline(never)]
    fn judge(&mut self, difference: u32, unused: u32) {
        let [with, without] =
            [difference.wrapping_sub(self.step), difference].map(|it| folded(signed(it, unused)));
        let better = i32::from(with < without) - i32::from(with > without);
        self.steady = (self.steady + better).clamp(-4, 4);
    }

    /// 16 bits.
    #[inline(always)]
    fn half<P: Pen>(&mut self, pen: &mut P, value: u32) -> u32 {
        let Self { last, step, mask, steady, .. } = *self;
        let unused = mask.leading_zeros();
        let guess = if steady > 0 { last.wrapping_add(step) } else { last };
        let number = if P::WRITES && value & !mask != 0 {
            u32::MAX
        } else {
            folded(signed(value.wrapping_sub(guess), unused))
        };
        let value = match self.scale.number(pen, number) {
            Some(_) if P::WRITES => value,
            Some(number) => guess.wrapping_add(unfolded(number)) & mask,
            None => {
                let value = pen.bits(value, 16);
                self.mask = mask | u32::MAX.unbounded_shr(value.leading_zeros());
                value
            }
        };
        let difference = value.wrapping_sub(last);
        if value & 7 == 0 {
            self.judge(difference, unused);
        }
        (self.last, self.step) = (value, difference);
        value
    }
}

/// What is known of entries with the same first word, and of frames also the same key.
#[derive(Clone, Copy)]
struct Slot {
    head: u32,
    key: u32,
    /// The one that has followed.
    next: u8,
    time: Field,
    /// From the time before the last to the last.
    before: u32,
    fields: [Field; 4],
}

impl Slot {
    const NEW: Self =
        Self { head: 0, key: 0, next: 0, time: Field::NEW, before: 0, fields: [Field::NEW; 4] };
}

/// Whether an entry begins with a time, goes on with a word that is much as the last one, and has a frame's key and data.
#[inline(always)]
const fn shape(head: u32) -> (bool, bool, bool) {
    let [kind, _, words, _] = head.to_le_bytes();
    match (kind, words) {
        (FRAME, 4) => (true, false, true),
        (TICK, 2) => (true, true, false),
        (TOOK, 1) => (false, true, false),
        (SENT | OUTGOING, 3) => (false, false, true),
        (POLL | BYTES, 1..) => (true, false, false),
        _ => (false, false, false),
    }
}

/// What is known from the entries so far.
pub(super) struct Model {
    slots: [Slot; SLOTS + 1],
    count: usize,
    last: [u8; 2],
    /// The slot that has followed two others.
    pairs: [u8; PAIRS],
    words: Words,
}

impl Model {
    pub(super) const NEW: Self = Self {
        slots: [Slot::NEW; SLOTS + 1],
        count: 0,
        last: [0; 2],
        pairs: [0; PAIRS],
        words: Words { guesses: [0; GUESSES], scales: [Scale::NEW; 2] },
    };

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        (self.count, self.last, self.slots[0].next) = (0, [0; 2], 0);
        self.pairs.fill(0);
        self.words.guesses.fill(0);
        self.words.scales = [Scale::NEW; 2];
    }

    /// Whether a slot is that of an entry.
    #[inline(always)]
    fn is(&self, slot: usize, head: u32, key: u32) -> bool {
        let it = &self.slots[slot.min(SLOTS)];
        it.head == head && it.key == key && slot < self.count
    }

    /// How the slot of an entry is said, and which it is: not the likely ones.
    #[inline(never)]
    fn choose(&self, head: u32, key: u32) -> (u32, usize) {
        let mut known = self.slots[..self.count].iter();
        match known.position(|it| it.head == head && it.key == key) {
            Some(slot) => (2, slot),
            // A keyframe is too rare to be learned.
            None if self.count < SLOTS && head.to_le_bytes()[0] != KEYFRAME => (3, self.count),
            None => (4, SLOTS),
        }
    }

    /// Writes or reads an entry, and returns the pen; `None`: no writer has written this. The pen goes by value, so that it
    /// stays in registers.
    #[inline(always)]
    pub(super) fn entry<P: Pen>(&mut self, mut pen: P) -> Option<P> {
        let [before, last] = self.last.map(usize::from);
        let pair = (before * 61 + last * 7) % PAIRS;
        let likely = [self.pairs[pair].into(), self.slots[last].next.into()];
        let (mut choice, mut slot) = (0, likely[0]);
        let (head, mut key) = (pen.get(0), 0);
        if P::WRITES {
            let (has_time, has_word, has_key) = shape(head);
            if has_key {
                key = pen.get(1 + usize::from(has_time) + usize::from(has_word));
            }
            if !self.is(slot, head, key) {
                (choice, slot) =
                    if self.is(likely[1], head, key) { (1, 0) } else { self.choose(head, key) };
            }
        }
        (_, choice) = pen.number(choice, 0);
        slot = match choice {
            0 | 1 => likely[choice as usize],
            2 => pen.bits(slot as u32, 7) as usize,
            3 => self.count,
            4 => SLOTS,
            _ => return None,
        };
        if choice >= 3 {
            if choice == 3 && slot < SLOTS {
                self.count += 1;
            }
            pen = self.begin(pen, slot, head, key);
        }
        if choice < 4 && slot >= self.count {
            return None;
        }
        let it = &mut self.slots[slot];
        let head = if P::WRITES { head } else { it.head };
        pen.set(0, head);
        let (has_time, has_word, has_key) = shape(head);
        let mut at = 1;
        if has_time {
            // By the step before the last: the halves of ticks take turns.
            let (guess, before) = (it.time.last.wrapping_add(it.before), it.time.step);
            let time = {
                let value = pen.get(1);
                it.time.word(&mut pen, value, guess)
            };
            it.before = before;
            pen.set(1, time);
            at = 2;
        }
        if has_word {
            let guess = it.fields[0].last;
            let word = {
                let value = pen.get(at);
                it.fields[0].word(&mut pen, value, guess)
            };
            pen.set(at, word);
            at += 1;
        }
        if has_key {
            pen.set(at, it.key);
            // Big-endian, as most motors speak.
            let mut word = pen.get(at + 1).swap_bytes();
            for (half, field) in it.fields.iter_mut().enumerate() {
                if half == 2 {
                    pen.set(at + 1, word.swap_bytes());
                    at += 1;
                    word = pen.get(at + 1).swap_bytes();
                }
                word = word << 16 | field.half(&mut pen, word >> 16);
            }
            pen.set(at + 1, word.swap_bytes());
            at += 2;
        }
        let end = usize::from(head.to_le_bytes()[2]) + 1;
        if at < end {
            pen = self.words.code(pen, at, end, (slot < SLOTS).then_some(slot));
        }
        if slot < SLOTS {
            self.pairs[pair] = slot as u8;
            self.slots[last].next = slot as u8;
            self.last = [last as u8, slot as u8];
        }
        Some(pen)
    }

    /// Says the words of an entry whose slot is new.
    #[inline(never)]
    fn begin<P: Pen>(&mut self, mut pen: P, slot: usize, head: u32, key: u32) -> P {
        let head = pen.word(head);
        let key = if shape(head).2 { pen.word(key) } else { 0 };
        self.slots[slot] = Slot { head, key, ..Slot::NEW };
        pen
    }
}

/// Words that are guessed: in a slot by their place, else by the word before.
struct Words {
    guesses: [u32; GUESSES],
    scales: [Scale; 2],
}

impl Words {
    /// So many are as guessed, and then one is not; or all of the rest are.
    #[inline(never)]
    fn code<P: Pen>(&mut self, mut pen: P, mut at: usize, end: usize, slot: Option<usize>) -> P {
        let Self { guesses, scales } = self;
        let scale = &mut scales[usize::from(slot.is_some())];
        let mut before = 0_u32;
        let place = |before: u32, at: usize| match slot {
            Some(slot) => (slot * 37 + at) % GUESSES,
            None => (before.wrapping_mul(0x9E37_79B1) >> 23) as usize,
        };
        while at < end {
            let begin = at;
            while P::WRITES && at < end && guesses[place(before, at)] == pen.get(at) {
                before = pen.get(at);
                at += 1;
            }
            let number = if at == end { 0 } else { (at - begin + 1) as u32 };
            let number = scale.number(&mut pen, number).unwrap_or_else(|| pen.bits(number, 8));
            let until = if number == 0 { end } else { end.min(begin + number as usize - 1) };
            while !P::WRITES && at < until {
                before = guesses[place(before, at)];
                pen.set(at, before);
                at += 1;
            }
            if at < end {
                let guess = &mut guesses[place(before, at)];
                let differs = *guess ^ pen.get(at);
                for byte in [0, 8, 16, 24] {
                    let differs = differs >> byte & 0xFF;
                    if pen.bits(u32::from(differs != 0), 1) != 0 {
                        *guess ^= pen.bits(differs, 8) << byte;
                    }
                }
                before = *guess;
                pen.set(at, before);
                at += 1;
            }
        }
        pen
    }
}
