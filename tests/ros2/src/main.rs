//! `rc10` for the robot of `examples/swerve`, which a PC may drive, with `rc10 ros2`.

use std::process::ExitCode;

fn main() -> ExitCode {
    rc10_cli::main_of::<swerve::Robot>()
}
