//! Ten sins against replay, each in a copy of the code on the emulated chip: the replay by this program names each, with its
//! tick and motor. By hand, for it builds ten programs: `cargo test --test all sins -- --ignored --nocapture`.

use std::fs;
use std::path::Path;
use std::process::Command;

use rc10_cli::replay::replayed;
use rc10_cli::robot_for_good;
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_cli::run::running::Running as _;
use rc10_sim::Nanos;

const LOOP: &str = "crates/rc10-app/src/cascade.rs";
const ERROR: &str = "let error = *reference - measured;";
const RUNNER: &str = "crates/rc10-motor/src/embassy/runner.rs";
const TAKES: &str = "crates/rc10-motor/src/embassy/motors.rs";

/// Name, file, what is replaced there, and by what.
const SINS: [(&str, &str, &str, &str); 10] = [
    (
        "another library's sine",
        LOOP,
        ERROR,
        "let error = *reference - measured; let error = error + (libm::sinf(error) - crate::maths::sin_cos(error).0);",
    ),
    (
        "another order of a sum",
        LOOP,
        "let feed_forward = of_speed + by_inertia * (1.0 + self.learned) + load;",
        "let feed_forward = load + by_inertia * (1.0 + self.learned) + of_speed + 1e-9 * (of_speed + load);",
    ),
    (
        "a clock",
        LOOP,
        ERROR,
        "let error = *reference - measured + 1e-9 * (unsafe { (0xE000_1004 as *const u32).read_volatile() } & 0xFF) as f32;",
    ),
    (
        "memory that was never written",
        LOOP,
        ERROR,
        "let error = *reference - measured + 1e-9 * (unsafe { (0x2404_FF00 as *const u32).read_volatile() } & 0xFF) as f32;",
    ),
    (
        "the size of a usize",
        LOOP,
        ERROR,
        "let error = *reference - measured + 1e-7 * size_of::<usize>() as f32;",
    ),
    (
        "the sign of a NaN",
        LOOP,
        ERROR,
        "let nan = core::hint::black_box(0.0_f32) / core::hint::black_box(0.0); \
         let error = *reference - measured + if nan.is_sign_negative() { 0.0 } else { 1e-6 };",
    ),
    (
        "a detour through f64",
        LOOP,
        "let feed_forward = of_speed + by_inertia * (1.0 + self.learned) + load;",
        "let feed_forward = (of_speed as f64 + by_inertia as f64 * (1.0 + self.learned as f64) + load as f64) as f32;",
    ),
    (
        "an input that is not recorded",
        TAKES,
        "self.recorder.given(COMMAND, motor.index(), &(target, withheld));",
        "if motor.index() != 1 { self.recorder.given(COMMAND, motor.index(), &(target, withheld)); }",
    ),
    (
        "a tick that is left out",
        RUNNER,
        "if self.bus.borrow_mut().tick_as(self.seen, now, dt, &mut self.tx).is_err() {",
        "if self.clock.ticks != 500 && self.bus.borrow_mut().tick_as(self.seen, now, dt, &mut self.tx).is_err() {",
    ),
    (
        "another rounding",
        LOOP,
        ERROR,
        "unsafe { core::arch::asm!(\"vmrs {0}, fpscr\", \"orr {0}, {0}, #0xC00000\", \"vmsr fpscr, {0}\", out(reg) _) }; \
         let error = *reference - measured;",
    ),
];

/// The files of this checkout that the firmware is made of.
fn copy(to: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let listed = Command::new("git").args(["ls-files"]).current_dir(root).output().unwrap();
    for file in String::from_utf8(listed.stdout).unwrap().lines() {
        let place = to.join(file);
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        fs::copy(root.join(file), place).unwrap();
    }
}

fn program(folder: &Path) -> Vec<u8> {
    let target = folder.join("target");
    let build =
        ["build", "--release", "--package", "team-firmware", "--features", "rc10-board/black-box"];
    let built = Command::new("cargo")
        .args(build)
        .current_dir(folder.join("firmware"))
        .env("CARGO_TARGET_DIR", &target)
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    fs::read(target.join("thumbv7em-none-eabihf/release/team-firmware")).unwrap()
}

fn outcome(program: &[u8]) -> Option<String> {
    let robot = || robot_for_good::<team::Robot>().unwrap();
    let setup = Setup { seed: 1, record: true, ..Setup::default() };
    let mut emulation = Emulation::new(program, robot(), &setup).unwrap();
    let mut words = Vec::new();
    for at in 1..=250 {
        emulation.run(Nanos::new(at * 10_000_000)).unwrap();
        words.extend(emulation.take_inputs());
    }
    replayed(&words, robot()).unwrap().1.map(|(_, said)| said)
}

#[test]
#[ignore = "builds ten programs"]
fn each_is_named_with_its_tick_and_motor() {
    let folder = std::env::temp_dir().join("rc10-sins");
    // Outside of this tree, whose settings of cargo would be theirs, too.
    copy(&folder);
    for lib in ["crates/rc10-app/src/lib.rs", "crates/rc10-motor/src/lib.rs"] {
        let place = folder.join(lib);
        let text = fs::read_to_string(&place).unwrap();
        fs::write(place, text.replace("#![forbid(unsafe_code)]", "")).unwrap();
    }
    for workspace in ["Cargo.toml", "firmware/Cargo.toml"] {
        let place = folder.join(workspace);
        let text = fs::read_to_string(&place).unwrap();
        fs::write(place, text.replace("unsafe_code = \"deny\"", "unsafe_code = \"allow\""))
            .unwrap();
    }
    assert_eq!(outcome(&program(&folder)), None, "without a sin");
    for (name, file, from, to) in SINS {
        let place = folder.join(file);
        let text = fs::read_to_string(&place).unwrap();
        assert_eq!(text.matches(from).count(), 1, "{name}: {file}");
        fs::write(&place, text.replace(from, to)).unwrap();
        let said = outcome(&program(&folder)).unwrap_or_else(|| panic!("{name} is not found"));
        println!("{name}:\n{said}\n");
        assert!(
            said.contains("the first difference is at ") && said.contains(", in tick "),
            "{said}"
        );
        assert!(said.contains("the state of `"), "{name}: {said}");
        fs::write(&place, text).unwrap();
    }
}
