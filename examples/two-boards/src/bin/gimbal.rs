//! The gimbal's board in simulation, with the chassis: `cargo run --bin gimbal -- --help`.

fn main() -> std::process::ExitCode {
    rc10::sim::main_of::<two_boards::gimbal::Robot>()
}
