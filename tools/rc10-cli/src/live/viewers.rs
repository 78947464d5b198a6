//! Viewers of other programs, fed while a robot runs.
//!
//! | viewer | what it gets | source |
//! |---|---|---|
//! | PlotJuggler, "UDP Server" with protocol JSON | a datagram a sample: `{"timestamp": s, "wheel_front_left": {"speed": ..}}` | its page on the UDP plug-in |
//! | Foxglove, "Foxglove WebSocket" | the topics of a record, as `ros2msg` and CDR; nothing can be changed from there | its SDK, in the feature `viewers` |
//! | VOFA+, `JustFloat` | the channels' values as `f32`, little endian, then `00 00 80 7F` | its page on data engines |
//!
//! Datagrams to a missing viewer get lost. A viewer that does not read its connection loses it, and
//! may connect again.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};

use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::{Map, Value};

use super::client::{Client, Sample, Signal};
use super::foxglove::Foxglove;
use super::plan::Topic;
use crate::args::address;

/// Choice of the viewers.
#[derive(Args, Clone, Debug, Default)]
pub struct ViewerArgs {
    /// Feed PlotJuggler's UDP server with JSON [its own port: 9870]
    #[arg(long, value_name = "HOST:PORT")]
    pub plotjuggler: Option<String>,
    /// Feed VOFA+ with JustFloat: udp:HOST:PORT sends there, tcp:HOST:PORT waits there for it
    #[arg(long, value_name = "udp|tcp:HOST:PORT", requires = "channels")]
    pub vofa: Option<String>,
    /// Feed Foxglove, which opens ws://127.0.0.1:N [N: 8765 unless told]; needs a build with --features
    /// viewers
    #[arg(
        long,
        value_name = "N",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "8765"
    )]
    pub foxglove: Option<u16>,
    #[arg(
        long = "channel",
        value_name = "NAME",
        help = "A channel of VOFA+, in their order: a signal, such as wheel_front_left.speed"
    )]
    pub(crate) channels: Vec<String>,
}

/// End of a `JustFloat` frame: a NaN that is no value.
const TAIL: [u8; 4] = [0x00, 0x00, 0x80, 0x7F];

/// Viewers of a robot.
pub struct Viewers {
    json: Option<(UdpSocket, SocketAddr)>,
    floats: Option<Floats>,
    foxglove: Option<Foxglove>,
    names: Vec<String>,
    /// Number and newest value of each channel; `None` until the robot has described itself.
    channels: Option<Vec<(u16, f32)>>,
}

enum Floats {
    Udp(UdpSocket, SocketAddr),
    Tcp(TcpListener, Vec<TcpStream>),
}

fn udp(to: SocketAddr) -> Result<UdpSocket> {
    let any: SocketAddr =
        if to.is_ipv4() { ([0, 0, 0, 0], 0).into() } else { ([0_u16; 8], 0).into() };
    let socket = UdpSocket::bind(any).context("no UDP on this PC")?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// The name of a signal for people and for other programs.
pub fn signal_name(signal: &Signal) -> String {
    let word = |text: &str| text.replace(' ', "_");
    match (signal.folder.as_str(), signal.label.as_str()) {
        ("signals", label) => word(label),
        ("motors", label) => format!("{}.{}", word(label), signal.name),
        (folder, "") => format!("{folder}.{}", signal.name),
        (folder, label) => format!("{folder}_{}.{}", word(label), signal.name),
    }
}

impl Viewers {
    /// Creates the chosen viewers; fails if an address is invalid or cannot be listened at.
    pub fn new(args: &ViewerArgs) -> Result<Self> {
        let json = args.plotjuggler.as_ref().map(|text| {
            let to = address(text).context("--plotjuggler")?;
            anyhow::Ok((udp(to)?, to))
        });
        let json = json.transpose()?;
        let floats = match args.vofa.as_deref().map(|text| text.split_once(':')) {
            None => None,
            Some(Some(("udp", text))) => {
                let to = address(text).context("--vofa")?;
                Some(Floats::Udp(udp(to)?, to))
            }
            Some(Some(("tcp", text))) => {
                let listener = TcpListener::bind(address(text).context("--vofa")?);
                let listener =
                    listener.with_context(|| format!("--vofa: cannot wait at {text}"))?;
                listener.set_nonblocking(true)?;
                Some(Floats::Tcp(listener, Vec::new()))
            }
            Some(_) => bail!("--vofa: it is to be udp:HOST:PORT or tcp:HOST:PORT"),
        };
        let foxglove = args.foxglove.map(Foxglove::new).transpose()?;
        Ok(Self { json, floats, foxglove, names: args.channels.clone(), channels: None })
    }

    /// The address for Foxglove, if it is chosen.
    pub fn address(&self) -> Option<String> {
        self.foxglove.as_ref().map(Foxglove::address)
    }

    /// Starts with a described robot and its topics; fails if a channel is no signal of it.
    pub fn meet(&mut self, client: &Client, topics: &[Topic]) -> Result<()> {
        if let Some(foxglove) = &mut self.foxglove {
            foxglove.meet(topics)?;
        }
        let all: BTreeMap<String, u16> =
            client.signals().map(|(index, signal)| (signal_name(signal), index)).collect();
        let channel = |name: &String| {
            let index = all.get(name).with_context(|| {
                let near: Vec<_> = all.keys().filter(|known| known.contains(name)).collect();
                format!("--channel {name}: there is no such signal; near it are {near:?}")
            })?;
            Ok((*index, f32::NAN))
        };
        self.channels = Some(self.names.iter().map(channel).collect::<Result<_>>()?);
        Ok(())
    }

    /// Sends a sample to the viewers.
    pub fn take(&mut self, sample: &Sample, client: &Client) {
        if let Some((socket, to)) = &self.json {
            let _ = socket.send_to(json(sample, client).as_bytes(), to);
        }
        if let Some(foxglove) = &mut self.foxglove {
            foxglove.take(sample);
        }
        let (Some(floats), Some(channels)) = (&mut self.floats, &mut self.channels) else { return };
        let mut is_new = false;
        for (index, value) in &sample.values {
            for (_, newest) in channels.iter_mut().filter(|(channel, _)| channel == index) {
                (*newest, is_new) = (*value, true);
            }
        }
        if !is_new {
            return;
        }
        let values = channels.iter().flat_map(|(_, value)| value.to_le_bytes());
        let frame: Vec<u8> = values.chain(TAIL).collect();
        match floats {
            Floats::Udp(socket, to) => drop(socket.send_to(&frame, *to)),
            Floats::Tcp(listener, readers) => {
                while let Ok((reader, _)) = listener.accept() {
                    if reader.set_nonblocking(true).is_ok() {
                        readers.push(reader);
                    }
                }
                // A frame in part would shift all that follow, so such a reader is dropped.
                readers.retain_mut(|reader| match reader.write(&frame) {
                    Ok(count) => count == frame.len(),
                    Err(error) => error.kind() == ErrorKind::WouldBlock,
                });
            }
        }
    }
}

fn json(sample: &Sample, client: &Client) -> String {
    let mut all = Map::new();
    all.insert("timestamp".into(), (sample.at.get() as f64 * 1e-6).into());
    for (index, value) in sample.values.iter().filter(|(_, value)| value.is_finite()) {
        let Some(signal) = client.signal(*index) else { continue };
        let name = signal_name(signal);
        let (thing, name) = name.split_once('.').unwrap_or((&name, "value"));
        let thing = all.entry(thing.to_owned()).or_insert_with(|| Value::Object(Map::new()));
        if let Value::Object(thing) = thing {
            thing.insert(name.to_owned(), f64::from(*value).into());
        }
    }
    Value::Object(all).to_string()
}
