//! Budgets of the firmware, and its cost when it was last measured.

use std::fs;
use std::path::Path;

use rc10_emu::{Figures, Image};

/// Static RAM and the deepest stack together, bytes.
const RAM: u32 = 64 * 1024;
/// Flash, bytes.
const FLASH: u32 = 200 * 1024;
/// Instructions of all in one second with eleven motors at 1 kHz.
pub const SECOND: u64 = 16_000_000;
/// Instructions of one more received frame.
const FRAME: u64 = 160;
/// A tick that takes this many more instructions than it took with this compiler is too long; one
/// that takes this many fewer is to be written down.
const TICK_TOLERANCE: u64 = 100;
/// The same for a received frame.
const FRAME_TOLERANCE: u64 = 20;

/// A compiler, and the instructions per tick and per received frame with it.
struct Baseline {
    compiler: String,
    tick: u64,
    frame: u64,
}

/// A line each, `compiler | tick | frame`; lines that begin with # say something else.
fn baselines(text: &str) -> Vec<Baseline> {
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.trim().is_empty());
    lines
        .map(|line| {
            let fields: Vec<_> = line.split('|').map(str::trim).collect();
            let [compiler, tick, frame] = fields[..] else { panic!("baselines.txt: {line}") };
            let number =
                |text: &str| text.parse().unwrap_or_else(|_| panic!("baselines.txt: {line}"));
            Baseline { compiler: compiler.to_owned(), tick: number(tick), frame: number(frame) }
        })
        .collect()
}

/// Compares with what it was with the same compiler, if it is one of those in `text`.
fn compare(text: &str, compiler: &str, tick: u64, frame: u64) -> Result<(), String> {
    let line = format!("{compiler} | {tick} | {frame}");
    let Some(known) = baselines(text).into_iter().find(|known| known.compiler == compiler) else {
        println!("no baseline for this compiler: write one into tests/firmware/baselines.txt");
        println!("{line}");
        return Ok(());
    };
    println!("last time           {:>8} a tick, {} a received frame", known.tick, known.frame);
    let is_as_before =
        tick.abs_diff(known.tick) < TICK_TOLERANCE && frame.abs_diff(known.frame) < FRAME_TOLERANCE;
    if is_as_before {
        return Ok(());
    }
    Err(format!("if this is meant, write into tests/firmware/baselines.txt: {line}"))
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
        "a second            {:>8.2} of {:.1} million instructions",
        million(second),
        million(SECOND)
    );
    println!("a received frame    {frame:>8} of {FRAME} instructions");
    println!("a tick              {tick:>8} instructions");
    for (what, taken, budget) in [
        ("flash", image.flash.into(), FLASH.into()),
        ("static RAM and stack", ram.into(), RAM.into()),
        ("instructions of a second", second, SECOND),
        ("instructions of a received frame", frame, FRAME),
    ] {
        assert!(taken <= budget, "{what}: {taken} of {budget}");
    }
    let compiler = image.compiler.expect("the firmware says what it was compiled with");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/firmware/baselines.txt");
    let compared = compare(&fs::read_to_string(file).unwrap(), &compiler, tick, frame);
    assert!(compared.is_ok(), "{}", compared.unwrap_err());
}

#[test]
fn baselines_are_kept() {
    let known = "# compiler | tick | frame\n\nrustc 1.2 (x) | 4000 | 150\nrustc 1.3 (y)|3900|140\n";
    let compare = |compiler, tick, frame| compare(known, compiler, tick, frame).is_ok();
    assert!(compare("rustc 1.2 (x)", 4000, 150) && compare("rustc 1.3 (y)", 3900, 140));
    assert!(compare("rustc 1.2 (x)", 4099, 169) && compare("rustc 1.2 (x)", 3901, 131));
    assert!(!compare("rustc 1.2 (x)", 4100, 150) && !compare("rustc 1.2 (x)", 3900, 150));
    assert!(!compare("rustc 1.2 (x)", 4000, 170) && !compare("rustc 1.2 (x)", 4000, 130));
    // Nothing is known of this one.
    assert!(compare("rustc 1.2", 9000, 250));
}

#[test]
fn the_file_of_baselines_can_be_read() {
    baselines(include_str!("baselines.txt"));
}
