// A viewer as Foxglove publishes it for programs: subscribes to everything that a server advertises, decodes
// it by the schemas that came along, and prints what it heard, one JSON object a line.
// Usage: node foxglove.js ws://HOST:PORT SECONDS
const { FoxgloveClient } = require('@foxglove/ws-protocol');
const { parse } = require('@foxglove/rosmsg');
const { MessageReader } = require('@foxglove/rosmsg2-serialization');
const WebSocket = require('ws');

const [url, seconds] = process.argv.slice(2);
const socket = new WebSocket(url, ['foxglove.sdk.v1']);
const client = new FoxgloveClient({ ws: socket });
const readers = new Map();
client.on('error', (error) => { throw error; });
client.on('open', () => console.log(JSON.stringify({ protocol: socket.protocol })));
client.on('advertise', (channels) => {
  for (const channel of channels) {
    if (channel.encoding !== 'cdr' || channel.schemaEncoding !== 'ros2msg') throw new Error(channel.encoding);
    const reader = new MessageReader(parse(channel.schema, { ros2: true }));
    readers.set(client.subscribe(channel.id), { topic: channel.topic, reader });
  }
});
let first;
client.on('message', ({ subscriptionId, timestamp, data }) => {
  // In the robot's time, which may be slower than the clock.
  first ??= timestamp;
  if (Number(timestamp - first) > seconds * 1e9) process.exit(0);
  const { topic, reader } = readers.get(subscriptionId);
  console.log(JSON.stringify({ topic, nanoseconds: Number(timestamp), values: reader.readMessage(data) }));
});
setTimeout(() => process.exit(1), 600000);
