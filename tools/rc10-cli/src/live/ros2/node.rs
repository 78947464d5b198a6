//! The node: what it publishes. A put may wait for a router that is slow: so they are made by a thread of their own.

use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Result, anyhow};
use hiroz::context::{ZContext, ZContextBuilder};
use hiroz::msg::{SerdeCdrSerdes, ZMessage};
use hiroz::node::ZNode;
use hiroz::pubsub::ZPub;
use hiroz::{Builder, MessageTypeInfo, TypeHash, WithTypeInfo};
use hiroz_msgs::builtin_interfaces::Time;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::args::NodeArgs;

/// Messages that may wait for the thread that publishes them.
const WAITING: usize = 256;

/// Work of the thread that publishes.
type Work = Box<dyn FnOnce() + Send>;

/// A thread that publishes.
#[derive(Clone)]
pub struct Outbox(SyncSender<Work>);

impl Outbox {
    pub fn new() -> Result<Self> {
        let (sender, receiver) = sync_channel::<Work>(WAITING);
        thread::Builder::new().name("rc10 ros2".into()).spawn(move || {
            while let Ok(work) = receiver.recv() {
                work();
            }
        })?;
        Ok(Self(sender))
    }

    /// Has work done; whether there was room for it.
    pub fn put(&self, work: impl FnOnce() + Send + 'static) -> bool {
        !matches!(self.0.try_send(Box::new(work)), Err(TrySendError::Full(_)))
    }
}

/// Publishes a topic.
pub struct Publisher<T: ZMessage> {
    publisher: Arc<ZPub<T, T::Serdes>>,
    outbox: Outbox,
}

impl<T: ZMessage + WithTypeInfo> Publisher<T>
where
    T::Serdes: Send + Sync,
{
    pub fn new(node: &ZNode, topic: &str, outbox: &Outbox) -> Result<Self> {
        let publisher = Arc::new(sound(node.create_pub::<T>(topic).build())?);
        Ok(Self { publisher, outbox: outbox.clone() })
    }

    /// Publishes a message; whether it is not lost here.
    pub fn publish(&self, message: T) -> bool {
        let publisher = Arc::clone(&self.publisher);
        // Without a router it goes nowhere: that is told elsewhere.
        self.outbox.put(move || drop(publisher.publish(&message)))
    }
}

/// `rcl_interfaces/Log`, which `hiroz-msgs` has not.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Log {
    pub stamp: Time,
    pub level: u8,
    pub name: String,
    pub msg: String,
    pub file: String,
    pub function: String,
    pub line: u32,
}

impl ZMessage for Log {
    type Serdes = SerdeCdrSerdes<Self>;
}

impl WithTypeInfo for Log {}

impl MessageTypeInfo for Log {
    fn type_name() -> &'static str {
        "rcl_interfaces::msg::dds_::Log_"
    }

    fn type_hash() -> TypeHash {
        let hash = "RIHS01_e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac";
        TypeHash::from_rihs_string(hash).unwrap_or_else(TypeHash::zero)
    }
}

/// The connection to the router, which comes and goes.
pub fn context(args: &NodeArgs) -> Result<ZContext> {
    let mut builder = sound(ZContextBuilder::default().with_router_endpoint(&args.router))?
        // At once again after a router's restart.
        .with_json(
            "connect/retry",
            json!({
                "period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1.5,
            }),
        );
    if let Some(domain) = args.domain {
        builder = builder.with_domain_id(domain as usize);
    }
    sound(builder.build())
}

/// An error of zenoh as one of ours.
pub fn sound<T>(result: hiroz::Result<T>) -> Result<T> {
    result.map_err(|why| anyhow!("zenoh: {why}"))
}

/// Nanoseconds of the PC's clock, as ROS counts them.
pub fn unix_nanos() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// The time now, as a message has it.
pub fn stamp() -> Time {
    let nanos = unix_nanos();
    Time {
        sec: i32::try_from(nanos / 1_000_000_000).unwrap_or(i32::MAX),
        nanosec: u32::try_from(nanos % 1_000_000_000).unwrap_or_default(),
    }
}

/// A name as ROS allows it.
pub fn ros_name(label: &str) -> String {
    let safe = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '_' };
    let name: String = label.to_lowercase().chars().map(safe).collect();
    if name.starts_with(|letter: char| letter.is_ascii_digit()) { format!("_{name}") } else { name }
}
