//! The chassis' board in simulation, with the gimbal: `cargo run --bin chassis -- --help`.

fn main() -> std::process::ExitCode {
    rc10::sim::main_of::<two_boards::chassis::Robot>()
}
