//! A robot that runs, for [Foxglove](https://docs.foxglove.dev/docs/sdk/websocket-server): the topics of a
//! record, live.

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
    /// The channel of each.
    channels: Vec<Arc<RawChannel>>,
}

impl Foxglove {
    /// Waits for viewers on this PC, at this port; 0 is any that is free.
    ///
    /// # Errors
    /// If the port is taken.
    pub fn new(port: u16) -> Result<Self> {
        let context = Context::new();
        let server = WebSocketServer::new().name("RC10").bind("127.0.0.1", port).context(&context);
        let server = server.start_blocking();
        let server = server.with_context(|| format!("--foxglove: port {port} cannot be had"))?;
        Ok(Self { port: server.port(), context, topics: Vec::new(), channels: Vec::new() })
    }

    /// What a viewer opens.
    pub fn address(&self) -> String {
        format!("ws://127.0.0.1:{}", self.port)
    }

    /// The robot has described itself.
    ///
    /// # Errors
    /// If two topics have one name.
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

    /// Hands a sample on, at the robot's time. A viewer that does not keep up loses the oldest.
    pub fn take(&mut self, sample: &Sample) {
        let at = PartialMetadata::with_log_time(sample.at.get() * 1000);
        // There is nothing in it that fails.
        let _ = messages(&self.topics, sample, |topic, bytes| {
            self.channels[topic].log_with_meta(bytes, at);
            Ok(())
        });
    }
}
