//! The omni robot in simulation, with the whole command line: `cargo run -- --help`.

use std::process::ExitCode;

use omni::{Motors, Ports, Shared, simulation};

fn main() -> ExitCode {
    rc10_cli::main_for(&simulation::description(), |command| {
        let ports = Ports::new();
        let (shared, mut motors) = (Shared::new(&ports), Motors::new());
        command.run(simulation::robot(&shared, &mut motors)?)
    })
}
