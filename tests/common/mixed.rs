//! The command line of the mixed robot, in this process: its program is another package's.

use mixed::{Motors, Ports, Shared};
use rc10_cli::CommandLine;

/// Exit code, and what it says.
pub fn mixed(arguments: &[&str]) -> (Option<i32>, String) {
    let mut out = Vec::new();
    let arguments = ["mixed"].iter().chain(arguments);
    let done = CommandLine::parse(arguments).and_then(|command| {
        let ports = Ports::new();
        let (shared, mut motors) = (Shared::new(&ports), Motors::new());
        command.run_to(rc10_cli::robot_of::<mixed::Robot>(&shared, &mut motors)?, &mut out)
    });
    let mut text = String::from_utf8(out).unwrap();
    let code = done.unwrap_or_else(|error| {
        text += &format!("{error:#}");
        2
    });
    (Some(code.into()), text)
}
