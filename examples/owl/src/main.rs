//! The robot in simulation, with the whole command line: `cargo run -- --help`.

fn main() -> std::process::ExitCode {
    rc10::sim::main_of::<owl::Robot>()
}
