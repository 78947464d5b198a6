use core::convert::Infallible;

use embassy_time::{Duration, with_timeout};
use embedded_io_async::Read;
use rc10_time::Micros;

use super::{
    ChannelMap, ChannelOrder, Crsf, CrsfLink, Dbus, PPM_TRAVEL, Ppm, Receiver, Remote, SBUS_TRAVEL,
    Sbus, Vt03,
};
use crate::{Reception, listen as listen_to};

/// Listens for ever to a receiver on a UART, set by [`Receiver::serial`], and hands on the remote.
///
/// `channels` says which is what, if the receiver is not one of DJI's: [`Receiver::channels`] on most transmitters,
/// [`Receiver::check`] whether it has them. For another travel than the usual one [`listen`](crate::listen()) to
/// [`Sbus`] or [`Crsf`], and use [`SbusFrame::remote`](super::SbusFrame) or [`CrsfLink`].
///
/// # Errors
///
/// At once, if the receiver sends pulses: those are for [`listen_pulses`].
pub async fn listen(
    receiver: Receiver,
    channels: ChannelOrder,
    port: impl Read,
    reception: &Reception,
    mut hear: impl FnMut(Remote, Micros),
) -> Result<Infallible, NotSerial> {
    let map = ChannelMap::of(channels, SBUS_TRAVEL, ChannelMap::AETR);
    match receiver {
        Receiver::Dr16 => {
            listen_to(port, Dbus, reception, |frame, at| hear(frame.remote(), at)).await
        }
        Receiver::Sbus => {
            let hear = |frame: super::SbusFrame, at| {
                frame.remote(&map).into_iter().for_each(|remote| hear(remote, at));
            };
            listen_to(port, Sbus, reception, hear).await
        }
        Receiver::Crsf => {
            let mut link = CrsfLink::new(map);
            let hear = |frame, at| {
                link.hear(&frame).into_iter().for_each(|remote| hear(remote, at));
            };
            listen_to(port, Crsf, reception, hear).await
        }
        Receiver::Vt03 => {
            listen_to(port, Vt03, reception, |frame, at| hear(frame.remote(), at)).await
        }
        Receiver::Ppm => Err(NotSerial),
    }
}

/// The receiver sends pulses, no characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("the receiver is Ppm, which no UART can hear: must be one of the serial ones")]
pub struct NotSerial;

/// Listens for ever to pulses: `edges` gives each rising edge's time, `channels` says which is what. A future of `edges`
/// that is dropped must take none.
pub async fn listen_pulses(
    channels: ChannelOrder,
    mut edges: impl AsyncFnMut() -> Micros,
    reception: &Reception,
    mut hear: impl FnMut(Remote, Micros),
) -> ! {
    let map = ChannelMap::of(channels, PPM_TRAVEL, ChannelMap::AIR_JOY);
    let mut ppm = Ppm::default();
    let silence = Duration::from_micros(Ppm::SILENCE.get());
    // The last edge, until its silence is over.
    let mut last = None;
    loop {
        let next = match last {
            Some(_) => with_timeout(silence, edges()).await.ok(),
            None => Some(edges().await),
        };
        let (heard, at) = match (next, last.take()) {
            (Some(at), _) => (ppm.edge(at), *last.insert(at)),
            (None, before) => (ppm.silence(), before.unwrap_or_default() + Ppm::SILENCE),
        };
        if let Some(channels) = heard {
            hear(map.remote(&channels), at);
        }
        reception.write(ppm.counters());
    }
}
