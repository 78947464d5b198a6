use rc10_motor::{DriveMode, Link, SafeState};

use crate::case::Case;
use crate::outcome::{Findings, Outcome};
use crate::rig::Rig;

pub(super) fn link_timeout(case: &Case<'_>, found: &mut Findings) {
    let motor = case.motor();
    let period = u32::try_from(motor.report_period().get() / 1000).unwrap_or(u32::MAX);
    let timeout = motor.link_timeout();
    // From the last report on, which may be a period old when the next one stays away.
    found
        .note(case.going(SafeState::Hold, |rig| keeps_on(rig, timeout.saturating_sub(period + 2))));
    found.note(case.going(SafeState::Hold, |rig| is_lost(rig, timeout, period)));
}

/// Silent for less than its time-out, it runs on.
fn keeps_on(rig: &mut Rig<'_>, silence: u32) -> Outcome {
    let lost = rig.status().counters.lost;
    rig.esc.set_feedback(false);
    for past in 0..silence + 50 {
        if past == silence {
            rig.esc.set_feedback(true);
        }
        rig.tick(Some(rig.cruise()));
        let (status, state) = (rig.status(), rig.esc.state());
        let is_on = status.drive == DriveMode::Run
            && status.link == Link::Online
            && status.counters.lost == lost;
        let (drive, link) = (status.drive, status.link);
        rig.must(is_on, || {
            format!("silent for {silence} ms, its link is {link:?}, it may {drive:?}")
        })?;
        rig.must(!state.open && state.torque >= 0.2 * rig.load(), || {
            format!(
                "silent for {silence} ms, it may {drive:?}, and has {:.3} N m after {past} ms",
                state.torque
            )
        })?;
    }
    Ok(())
}

/// Silent for longer, it is lost: not before, and not later.
fn is_lost(rig: &mut Rig<'_>, timeout: u32, period: u32) -> Outcome {
    rig.esc.set_feedback(false);
    for past in 1..=timeout + 30 {
        rig.tick(Some(rig.cruise()));
        let status = rig.status();
        let is_lost = status.link == Link::Lost;
        let (link, drive) = (status.link, status.drive);
        let is_early = is_lost && past + period + 1 < timeout;
        let is_late = !is_lost && past > timeout + 3;
        let agrees = is_lost == (drive == DriveMode::Coast);
        rig.must(!is_early && !is_late && agrees, || {
            format!("silent for {past} of {timeout} ms, its link is {link:?}, it may {drive:?}")
        })?;
    }
    rig.esc.set_load(0.0);
    rig.esc.set_feedback(true);
    rig.watch();
    rig.goes_again(rig.cruise(), "heard again")?;
    rig.was_soft("heard again")
}
