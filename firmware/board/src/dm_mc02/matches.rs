//! Matches in the board's serial flash, which stay without power: `docs/replay.md`.
#![expect(clippy::cast_possible_truncation, reason = "numbers of bytes below 9 MiB")]

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::ospi::Ospi;
use embassy_stm32::peripherals::{OCTOSPI1, PA1, PA3, PB0, PB2, PD11, PE11};
use embassy_time::{Duration, Ticker};
use rc10_bsp::black_box::{RC10_BLACK_BOX, WORDS};
use rc10_bsp::w25q64::{BYTES, PAGE, Place, W25q64};
use rc10_motor::record::pages::{Flash, Keeper, Page, page_of};
use rc10_motor::record::ring;
use rc10_motor::{ArmState, ArmSwitch};
use rc10_tasks::live::{BlackBox, PIECE};

/// Period of looking whether a page is full, or written.
const LOOK: Duration = Duration::from_millis(1);
/// For so many periods a flash may go on with what it did before a restart.
const PATIENCE: u32 = 3_000;

/// Select, clock, data lines 0 to 3.
pub(super) type MemoryParts = (
    Peri<'static, OCTOSPI1>,
    Peri<'static, PE11>,
    Peri<'static, PB2>,
    Peri<'static, PD11>,
    Peri<'static, PB0>,
    Peri<'static, PA3>,
    Peri<'static, PA1>,
);

static FLASH: Place = Place::new();
/// Number of the next page, and of the newest match, once they are known.
static NEXT: [AtomicU32; 2] = [const { AtomicU32::new(u32::MAX) }; 2];

/// Bytes of the pieces before that with `NEXT`, which is one before the flash.
const RING: usize = (4 * WORDS).div_ceil(PIECE) * PIECE;

/// What a PC can fetch: the ring in RAM, [`NEXT`], the flash.
pub const BLACK_BOX: BlackBox = (RING + PIECE + BYTES, |word, to| match 4 * word {
    at if at < RING => RC10_BLACK_BOX.copy(word, to),
    RING => {
        let words = NEXT.iter().map(|it| it.load(Ordering::Relaxed).to_le_bytes());
        to.as_chunks_mut().0.iter_mut().zip(words).for_each(|(to, word)| *to = word);
        8
    }
    at => {
        let count = to.len().min((RING + PIECE + BYTES).saturating_sub(at));
        // Nothing while it is busy: it is asked for again.
        let read = FLASH.with(|flash| {
            let flash = flash.as_mut()?;
            let is_busy = flash.is_busy();
            (!is_busy).then(|| flash.read((at - RING - PIECE) as u32, &mut to[..count]))
        });
        read.flatten().map_or(0, |()| count)
    }
});

struct Pages<'f>(&'f mut W25q64);

impl Flash for Pages<'_> {
    fn is_busy(&mut self) -> bool {
        self.0.is_busy()
    }

    fn read(&mut self, page: u32) -> Page {
        let mut bytes = [0; PAGE];
        self.0.read(page * PAGE as u32, &mut bytes);
        page_of(&bytes)
    }

    fn program(&mut self, page: u32, content: &Page) {
        let mut bytes = [0; PAGE];
        let places = bytes.as_chunks_mut().0.iter_mut();
        places.zip(content).for_each(|(to, word)| *to = word.to_le_bytes());
        self.0.program(page, &bytes);
    }

    fn erase(&mut self, first: u32) {
        self.0.erase(first);
    }
}

/// Keeps the matches, for ever.
pub(super) async fn keep(memory: MemoryParts, switch: &ArmSwitch) {
    let (octospi, select, clock, data_0, data_1, data_2, data_3) = memory;
    let mut flash = W25q64::start(|config| {
        Ospi::new_blocking_quadspi(octospi, clock, data_0, data_1, data_2, data_3, select, config)
    });
    let mut ticker = Ticker::every(LOOK);
    let mut left = PATIENCE;
    while !flash.is_there() {
        left -= 1;
        if left == 0 {
            defmt::warn!("the board's serial flash does not answer: no match is kept");
            return;
        }
        ticker.next().await;
    }
    let _ = FLASH.with(|place| *place = Some(flash));
    let mut keeper = Keeper::NEW;
    loop {
        ticker.next().await;
        let is_armed = matches!(switch.state(), ArmState::Armed | ArmState::Suspended);
        let _ = FLASH.with(|flash| {
            let Some(flash) = flash else { return };
            let part = |block, from, to: &mut [u32]| {
                RC10_BLACK_BOX.with(|memory| ring::part(memory, block, from, to))
            };
            keeper.step(&mut Pages(flash), part, is_armed, rc10_message::now());
            for (place, now) in NEXT.iter().zip(keeper.next().into_iter().flatten()) {
                place.store(now, Ordering::Relaxed);
            }
        });
    }
}
