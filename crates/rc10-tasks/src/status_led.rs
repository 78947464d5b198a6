//! The state of the robot on an LED strip.

use embassy_time::{Duration, Ticker};
use rc10_module::led::pattern::{LampState, colour};
use rc10_module::remote::RemoteLink;
use rc10_motor::{ArmState, Link, MotorStatus, Names};
use smart_leds_trait::{RGB8, SmartLedsWriteAsync};

use crate::common::Common;
use crate::live::Live;
use crate::supply::OLDEST_SUPPLY;

/// Period in which the strip is written: a beat of its rhythms.
const PERIOD: Duration = Duration::from_millis(100);

/// The status LED's task: shows the [`state`] on a strip with this number of LEDs, for ever.
pub async fn run<N: Names>(
    shared: &Common<'_, N, impl Live>,
    mut strip: impl SmartLedsWriteAsync<Color = RGB8>,
    leds: usize,
) -> ! {
    let mut ticker = Ticker::every(PERIOD);
    loop {
        let (state, now) = (state(shared), rc10_message::now());
        // A strip that cannot be written shows that by itself; the robot goes on.
        let _ = strip.write((0..leds).map(|led| colour(state, now, led))).await;
        ticker.next().await;
    }
}

/// The most important state that a strip can show.
#[must_use]
pub fn state<N: Names>(shared: &Common<'_, N, impl Live>) -> LampState {
    let remote = shared.remote_link.read().map_or(RemoteLink::Lost, |link| link.value);
    let mut motors = N::ALL.iter().map(|name| shared.motor(*name).status());
    let now = rc10_message::now();
    let settles = shared.settled.read().is_some_and(|settled| now < settled.value);
    let is_there = |link: Link| link == Link::Online || (settles && link == Link::NeverSeen);
    let is_well = |status: MotorStatus| is_there(status.link) && status.fault.is_none();
    let supply = shared.supply.newer_than(OLDEST_SUPPLY, now);
    let is_refused = shared.not_at_rest.read().is_some_and(|axis| axis.value.is_some());
    let is_low = supply.is_some_and(|supply| supply.is_low());
    match (shared.switch.state(), remote) {
        (ArmState::EStopped, _) => LampState::Stopped,
        (_, RemoteLink::Lost) => LampState::LinkLost,
        (ArmState::Suspended, _) | (_, RemoteLink::Interrupted) => LampState::Suspended,
        (ArmState::Disarmed, _) if is_refused => LampState::NotAtRest,
        _ if !motors.all(is_well) => LampState::Fault,
        _ if is_low => LampState::LowSupply,
        (ArmState::Armed, _) => LampState::Armed,
        (ArmState::Disarmed, _) => LampState::Disarmed,
    }
}
