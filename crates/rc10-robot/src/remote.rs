//! The remote control's task: its frames become a topic.

use embedded_io_async::Read;
use rc10_can::Micros;
use rc10_module::remote::{self, Receiver, Remote};

use crate::robot::Shared;

/// Listens to a receiver on a serial port that is set as the receiver needs.
pub async fn listen(shared: &Shared<'_>, receiver: Receiver, port: impl Read) -> ! {
    let _ = remote::listen(receiver, port, &shared.remote_reception, |remote, at| {
        publish(shared, &remote, at);
    })
    .await;
    core::future::pending().await
}

/// Listens to a receiver of pulses; `edges` waits for the next rising edge and says when it was.
pub async fn listen_pulses(shared: &Shared<'_>, edges: impl AsyncFnMut() -> Micros) -> ! {
    remote::listen_pulses(edges, &shared.remote_reception, |remote, at| {
        publish(shared, &remote, at);
    })
    .await
}

fn publish(shared: &Shared<'_>, remote: &Remote, at: Micros) {
    shared.remote.set(*remote, at);
}
