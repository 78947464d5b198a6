//! `cargo run` at the root is the `rc10` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    rc10_cli::main_of::<team::Robot>()
}
