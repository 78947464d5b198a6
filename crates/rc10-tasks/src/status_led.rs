//! The state of the robot on an LED strip.

use embassy_time::{Duration, Ticker};
use rc10_module::led::pattern::{State, colour};
use rc10_module::remote::RemoteLink;
use rc10_motor::{ArmState, Link, MotorStatus};
use smart_leds_trait::{RGB8, SmartLedsWriteAsync};

/// Period in which the strip is written: a beat of its rhythms.
const PERIOD: Duration = Duration::from_millis(100);

/// The status LED's task: shows what `state` says on a strip with this number of LEDs, for ever.
pub async fn run<S>(mut strip: S, leds: usize, mut state: impl FnMut() -> State) -> !
where
    S: SmartLedsWriteAsync<Color = RGB8>,
{
    let mut ticker = Ticker::every(PERIOD);
    loop {
        let (state, now) = (state(), rc10_message::now());
        // A strip that cannot be written shows that by itself; the robot goes on.
        let _ = strip.write((0..leds).map(|led| colour(state, now, led))).await;
        ticker.next().await;
    }
}

/// The most important state that a strip can show, of a robot with these motors.
#[must_use]
pub fn state(
    arm: ArmState,
    remote: RemoteLink,
    motors: impl IntoIterator<Item = MotorStatus>,
) -> State {
    let is_well = |status: MotorStatus| status.link == Link::Online && status.fault.is_none();
    match (arm, remote) {
        (ArmState::EStopped, _) => State::Stopped,
        (_, RemoteLink::Lost) => State::LinkLost,
        (ArmState::Suspended, _) | (_, RemoteLink::Interrupted) => State::Suspended,
        _ if !motors.into_iter().all(is_well) => State::Fault,
        (ArmState::Armed, _) => State::Armed,
        (ArmState::Disarmed, _) => State::Disarmed,
    }
}
