use std::panic::{AssertUnwindSafe, catch_unwind};

use rc10_motor::CanMotor;
use rc10_motor::unitree::GoM8010;
use rc10_sim::{Bus, Esc, Line};

use crate::case::Case;
use crate::declaration::Declaration;
use crate::harness::Connection;
use crate::outcome::Findings;
use crate::report::{Breach, Report};
use crate::rules::RULES;

/// Runs every [rule](crate::RULES) on a motor: `motor` makes a fresh one, set to an identifier, and
/// `device` puts its simulated device, set to that identifier, on a wire. Both turn the same way, or
/// the motor was made [reversed](Declaration::direction). Fails with all rules that are broken, and
/// what could not be tried.
pub fn check<M: CanMotor + 'static>(
    declared: &Declaration,
    motor: impl Fn(u8) -> M,
    device: impl Fn(&Bus, u8) -> Esc,
) -> Result<(), Report> {
    let motor = |id| Box::new(motor(id)) as Box<dyn CanMotor>;
    let connection = Connection::ByBus { motor: &motor, device: &device };
    run(&Case::new(declared, connection))
}

/// The same for a motor on an RS-485 line, without the rules that are about frames on a bus. Fails
/// with all rules that are broken, and what could not be tried.
pub fn check_line(
    declared: &Declaration,
    motor: impl Fn(u8) -> GoM8010,
    device: impl Fn(&Line, u8) -> Esc,
) -> Result<(), Report> {
    let connection = Connection::ByLine { motor: &motor, device: &device };
    run(&Case::new(declared, connection))
}

fn run(case: &Case<'_>) -> Result<(), Report> {
    let (motor, direction) = (case.motor().name(), case.declared.direction);
    let mut report = Report { motor, direction, breaches: Vec::new(), unchecked: Vec::new() };
    let mut causes = Vec::new();
    for rule in RULES {
        let mut found = Findings::default();
        let tried = catch_unwind(AssertUnwindSafe(|| (rule.check)(case, &mut found)));
        if let Err(panic) = tried {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("…");
            found.add_cause(None, format!("it panicked: {text}"));
        }
        let breach = |(at, what)| Breach { rule: rule.name, what, at };
        causes.extend(found.causes.into_iter().map(breach));
        report.breaches.extend(found.found.into_iter().map(breach));
        if found.is_stuck {
            report.unchecked.push(rule.name);
        }
    }
    report.breaches.splice(0..0, causes);
    if report.breaches.is_empty() && report.unchecked.is_empty() { Ok(()) } else { Err(report) }
}
