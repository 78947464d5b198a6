//! The topics of a record, live, for [Foxglove](https://docs.foxglove.dev).

use std::sync::Arc;

use anyhow::{Context as _, Result};
use foxglove::{ChannelBuilder, Context, PartialMetadata, RawChannel, Schema, WebSocketServer};

use super::client::Sample;
use super::plan::{Topic, messages};

/// A server that runs until the program ends.
pub struct Foxglove {
    port: u16,
    context: Arc<Context>,
    topics: Vec<Topic>,
    channels: Vec<Arc<RawChannel>>,
}

impl Foxglove {
    /// Serves viewers on this PC at this port (0: any free one); fails if the port is taken.
    pub fn new(port: u16) -> Result<Self> {
        let context = Context::new();
        let server = WebSocketServer::new().name("RC10").bind("127.0.0.1", port).context(&context);
        let server = server.start_blocking();
        let server = server.with_context(|| format!("--foxglove: port {port} cannot be had"))?;
        Ok(Self { port: server.port(), context, topics: Vec::new(), channels: Vec::new() })
    }

    /// The address for a viewer.
    pub fn address(&self) -> String {
        format!("ws://127.0.0.1:{}", self.port)
    }

    /// Declares the topics of a robot; fails if two have one name.
    pub fn meet(&mut self, topics: &[Topic]) -> Result<()> {
        if self.topics == topics {
            return Ok(());
        }
        self.channels.drain(..).for_each(|channel| channel.close());
        for topic in topics {
            let schema = Schema::new(topic.schema_name(), "ros2msg", topic.schema().into_bytes());
            let channel = ChannelBuilder::new(&topic.name)
                .context(&self.context)
                .message_encoding("cdr")
                .schema(schema)
                .add_metadata("label", &topic.label);
            self.channels.push(channel.build_raw().with_context(|| topic.name.clone())?);
        }
        self.topics = topics.to_vec();
        Ok(())
    }

    /// Sends a sample at the robot's time. A slow viewer loses the oldest.
    pub fn take(&mut self, sample: &Sample) {
        let at = PartialMetadata::with_log_time(sample.at.get() * 1000);
        // No message can fail here.
        let _ = messages(&self.topics, sample, |topic, bytes| {
            self.channels[topic].log_with_meta(bytes, at);
            Ok(())
        });
    }
}
