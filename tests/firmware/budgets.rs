//! What the firmware may take, and what it took when it was last looked at.

use std::fs;
use std::path::Path;

use rc10_emu::{Figures, Image};

/// Static RAM and the deepest stack together, bytes.
const RAM: u32 = 29 * 1024;
/// Flash, bytes.
const FLASH: u32 = 64 * 1024;
/// Instructions of all in one second with eleven motors at 1 kHz.
const SECOND: u64 = 12_000_000;
/// Instructions of one more received frame.
const FRAME: u64 = 300;
/// So many more instructions in a tick than it took with this compiler are too many, and so many
/// fewer are to be written down.
const TICK_TOLERANCE: u64 = 100;
/// The same for a received frame.
const FRAME_TOLERANCE: u64 = 20;

/// A compiler, and the instructions per tick and per received frame with it.
struct Baseline {
    compiler: String,
    tick: u64,
    frame: u64,
}

fn baselines() -> Vec<Baseline> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/firmware/baselines.txt");
    let text = fs::read_to_string(file).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    lines
        .map(|line| {
            let mut fields = line.split('|').map(str::trim);
            let mut field = || fields.next().unwrap_or_else(|| panic!("baselines.txt: {line}"));
            Baseline {
                compiler: field().to_owned(),
                tick: field().parse().unwrap(),
                frame: field().parse().unwrap(),
            }
        })
        .collect()
}

/// Prints what the firmware takes and judges it.
///
/// # Panics
/// If something is above its budget, or above what it was with the same compiler.
pub fn judge(program: &[u8], figures: &Figures, second: u64, tick: u64, frame: u64) {
    let image = Image::parse(program).unwrap();
    let ram = image.ram + figures.stack_bytes;
    let million = |count: u64| count as f64 * 1e-6;
    println!("flash               {:>8} of {FLASH} bytes", image.flash);
    println!(
        "static RAM + stack  {:>8} of {RAM} bytes ({} + {})",
        ram, image.ram, figures.stack_bytes
    );
    println!(
        "a second            {:>8.2} of {:.0} million instructions",
        million(second),
        million(SECOND)
    );
    println!("a received frame    {frame:>8} of {FRAME} instructions");
    println!("a tick              {tick:>8} instructions");
    assert!(image.flash <= FLASH && ram <= RAM && second <= SECOND && frame <= FRAME);
    let compiler = image.compiler.expect("the firmware says what it was compiled with");
    let Some(known) = baselines().into_iter().find(|known| known.compiler == compiler) else {
        println!("no baseline for {compiler}: write one into tests/firmware/baselines.txt");
        println!("{compiler} | {tick} | {frame}");
        return;
    };
    println!(
        "with this compiler  {:>8} a tick, {} a received frame, last time",
        known.tick, known.frame
    );
    let line = format!("tests/firmware/baselines.txt: {compiler} | {tick} | {frame}");
    assert!(tick.abs_diff(known.tick) < TICK_TOLERANCE, "if this is meant, write {line}");
    assert!(frame.abs_diff(known.frame) < FRAME_TOLERANCE, "if this is meant, write {line}");
}
