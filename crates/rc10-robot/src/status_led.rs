//! The LED strip that shows the state of the robot.

use rc10_module::led::pattern::State;
use rc10_module::remote::RemoteLink;
use rc10_motor::Names;
use rc10_tasks::status_led;
use smart_leds_trait::{RGB8, SmartLedsWriteAsync};

use crate::robot::Shared;
use crate::table::{LEDS, Name};

/// The status LED's task.
pub async fn run<S>(shared: &Shared<'_>, strip: S) -> !
where
    S: SmartLedsWriteAsync<Color = RGB8>,
{
    status_led::run(strip, LEDS, || state(shared)).await
}

/// The most important state that the strip can show.
#[must_use]
pub fn state(shared: &Shared<'_>) -> State {
    let remote = shared.remote_link.read().map_or(RemoteLink::Lost, |link| link.value);
    let motors = Name::ALL.iter().map(|name| shared.motor(*name).status());
    status_led::state(shared.switch.state(), remote, motors)
}
