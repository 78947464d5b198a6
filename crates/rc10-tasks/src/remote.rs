//! The remote control's task: its frames become a latest value.

use embedded_io_async::Read;
use rc10_module::remote::{self, ChannelOrder, Receiver};
use rc10_motor::Names;
use rc10_time::Micros;

use crate::common::Common;
use crate::live::Live;

/// Listens to a receiver on a serial port that is set as the receiver needs.
pub async fn listen<N: Names>(
    shared: &Common<'_, N, impl Live>,
    receiver: Receiver,
    channels: ChannelOrder,
    port: impl Read,
) -> ! {
    let _ = remote::listen(receiver, channels, port, &shared.remote_reception, |remote, at| {
        shared.remote.set(remote, at);
    })
    .await;
    core::future::pending().await
}

/// Listens to a receiver of pulses; `edges` waits for the next rising edge and says when it was.
pub async fn listen_pulses<N: Names>(
    shared: &Common<'_, N, impl Live>,
    channels: ChannelOrder,
    edges: impl AsyncFnMut() -> Micros,
) -> ! {
    remote::listen_pulses(channels, edges, &shared.remote_reception, |remote, at| {
        shared.remote.set(remote, at);
    })
    .await
}
