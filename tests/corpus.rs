//! Inputs that fuzzing once found worth keeping, given to every decoder again. `cargo xtask fuzz`
//! finds more.
#![expect(clippy::cast_possible_truncation, reason = "streams of a test are short")]

#[path = "../crates/rc10-module/tests/streams/observed.rs"]
mod observed;
#[path = "../fuzz/src/streams.rs"]
mod streams;
#[path = "../fuzz/src/targets.rs"]
mod targets;
#[path = "../fuzz/src/tools.rs"]
mod tools;
#[expect(dead_code, reason = "the tests of the parsers need more of it")]
#[path = "../crates/rc10-module/tests/streams/wire.rs"]
mod wire;
#[path = "../crates/rc10-module/tests/streams/wires.rs"]
mod wires;

use std::fs;
use std::path::Path;

use rc10_cli::live::request;

#[test]
fn every_target_takes_its_corpus() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    for (name, feed) in targets::TARGETS {
        let folder = fuzz.join("corpus").join(name);
        let files: Vec<_> =
            fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path()).collect();
        assert!(files.len() >= 5, "{} has next to nothing", folder.display());
        for file in files {
            println!("{}", file.display());
            feed(&fs::read(file).unwrap());
        }
        assert!(fuzz.join("fuzz_targets").join(format!("{name}.rs")).exists());
    }
}
