//! The remote control's task: its frames become a topic.

use embedded_io_async::Read;
use rc10_can::Micros;
use rc10_module::remote::{self, Receiver, Remote};

use crate::robot::Io;

/// Listens to a receiver on a serial port that is set as the receiver needs.
pub async fn listen(io: &Io<'_>, receiver: Receiver, port: impl Read) -> ! {
    let _ =
        remote::listen(receiver, port, &io.remote_reception, |remote, at| publish(io, &remote, at))
            .await;
    core::future::pending().await
}

/// Listens to a receiver of pulses; `edges` waits for the next rising edge and says when it was.
pub async fn listen_pulses(io: &Io<'_>, edges: impl AsyncFnMut() -> Micros) -> ! {
    remote::listen_pulses(edges, &io.remote_reception, |remote, at| publish(io, &remote, at)).await
}

fn publish(io: &Io<'_>, remote: &Remote, at: Micros) {
    io.remote.set(*remote, at);
}
