//! The LED strip that shows the state of the robot.

use embassy_time::{Duration, Ticker};
use rc10_module::led::pattern::{State, colour};
use rc10_module::remote::RemoteLink;
use rc10_motor::{ArmState, Link};
use smart_leds_trait::{RGB8, SmartLedsWriteAsync};

use crate::robot::Shared;
use crate::table::{LEDS, MOTORS};

/// Period in which the strip is written: a beat of its rhythms.
const PERIOD: Duration = Duration::from_millis(100);

/// The status LED's task.
pub async fn run<S>(shared: &Shared<'_>, mut strip: S) -> !
where
    S: SmartLedsWriteAsync<Color = RGB8>,
{
    let mut ticker = Ticker::every(PERIOD);
    loop {
        let (state, now) = (state(shared), rc10_message::now());
        // A strip that cannot be written shows that by itself; the robot goes on.
        let _ = strip.write((0..LEDS).map(|led| colour(state, now, led))).await;
        ticker.next().await;
    }
}

/// The most important state that the strip can show.
#[must_use]
pub fn state(shared: &Shared<'_>) -> State {
    let arm = shared.switch.state();
    let freshness = shared.remote_link.read().map_or(RemoteLink::Lost, |freshness| freshness.value);
    let is_well = |name| {
        let status = shared.motor(name).status();
        status.link == Link::Online && status.fault.is_none()
    };
    match (arm, freshness) {
        (ArmState::EStopped, _) => State::Stopped,
        (_, RemoteLink::Lost) => State::LinkLost,
        (ArmState::Suspended, _) | (_, RemoteLink::Interrupted) => State::Suspended,
        _ if !MOTORS.iter().all(|motor| is_well(motor.name)) => State::Fault,
        (ArmState::Armed, _) => State::Armed,
        (ArmState::Disarmed, _) => State::Disarmed,
    }
}
