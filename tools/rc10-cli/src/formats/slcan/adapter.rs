use std::collections::VecDeque;

use rc10_can::CanFrame;
use rc10_sim::{Bus, TraceEntry};

use crate::formats::slcan::{BELL, DONE, Lines, Malformed, SlcanCommand, write_frame};

/// `V`: hardware 01, software 01.
const VERSION: &[u8] = b"V0101";
/// `N`.
const SERIAL_NUMBER: &[u8] = b"NRC10";
/// `S8`: 1 Mbit/s, the rate of every simulated bus.
const BUS_BIT_RATE: u8 = 8;
/// Status flag of Lawicel's manual: transmit queue full.
const TRANSMIT_FULL: u8 = 1 << 1;
const DATA_OVERRUN: u8 = 1 << 3;
const TRANSMIT_QUEUE: usize = 64;
const TIME_PERIOD_MILLIS: u64 = 60_000;

/// State of the adapter's channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Closed: the adapter hears and sends nothing.
    Closed,
    /// Open to hear, not to send.
    Listening,
    /// Open to hear and to send.
    Open,
}

/// Counters of an adapter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames of the wire that were written to the client.
    pub to_client: u64,
    /// Frames of the client that were taken for the wire.
    pub from_client: u64,
    /// Frames of the wire that the client was too slow to read.
    pub not_read: u64,
    /// Frames of the client that came while the channel was closed or only listening.
    pub not_open: u64,
    /// Frames of the client that came while its transmit queue was full.
    pub queue_full: u64,
    /// Frames of the client that still wait for the bus.
    pub not_sent: u64,
    /// Invalid lines.
    pub malformed: u64,
    /// Times that the channel was opened at another bit rate than the bus's.
    pub wrong_bit_rate: u64,
}

/// Flow control for a client that does not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Lossy: beyond this number of unread bytes, received frames are lost and counted.
    Lossy(usize),
    /// Lossless: everything is kept, and the caller waits for the client.
    Lossless,
}

/// An adapter between a client's bytes and a simulated wire: a state machine without input, output
/// and clock. The caller advances the world and calls [`hear`](Self::hear).
///
/// The client is a foreign node on the wire (see [`Bus::inject`]) and does not hear its own frames.
pub struct Adapter {
    wire: Bus,
    flow: Flow,
    /// The wire's controller belongs to this adapter: it acknowledges while the channel is open.
    has_controller: bool,
    lines: Lines,
    channel: Channel,
    bit_rate: u8,
    times: bool,
    status: u8,
    /// Frames that were sent, and not seen on the wire yet.
    waiting: VecDeque<CanFrame>,
    out: Vec<u8>,
    counts: Counts,
}

impl Adapter {
    /// Creates an adapter with a closed channel. `has_controller`: the wire's controller is this
    /// adapter's, because no robot is on the wire.
    pub fn new(wire: Bus, flow: Flow, has_controller: bool) -> Self {
        let adapter = Self {
            wire,
            flow,
            has_controller,
            lines: Lines::default(),
            channel: Channel::Closed,
            bit_rate: BUS_BIT_RATE,
            times: false,
            status: 0,
            waiting: VecDeque::new(),
            out: Vec::new(),
            counts: Counts::default(),
        };
        adapter.plug();
        adapter
    }

    /// The commands that the client's bytes complete, for [`answer`](Self::answer).
    pub fn take(&mut self, bytes: &[u8]) -> Vec<Result<SlcanCommand, Malformed>> {
        self.lines.take(bytes)
    }

    /// Executes a command. Returns whether the client has let time pass with it (lockstep): by a
    /// frame, or by an empty line while the channel is open.
    pub fn answer(&mut self, command: Result<SlcanCommand, Malformed>) -> bool {
        let is_done = match command {
            Ok(command) => self.execute(command),
            Err(Malformed) => {
                self.counts.malformed += 1;
                false
            }
        };
        self.out.push(if is_done { DONE } else { BELL });
        match command {
            Ok(SlcanCommand::Nothing) => self.channel != Channel::Closed,
            Ok(SlcanCommand::Send(_)) => is_done,
            _ => false,
        }
    }

    /// Executes a command, and writes what stands before the end of its answer; `false`: refused.
    fn execute(&mut self, command: SlcanCommand) -> bool {
        match command {
            SlcanCommand::Nothing => {}
            SlcanCommand::Send(frame) => return self.send(frame),
            SlcanCommand::Switch(channel) => return self.switch(channel),
            SlcanCommand::BitRate(rate) => self.bit_rate = rate,
            SlcanCommand::Version => self.out.extend(VERSION),
            SlcanCommand::SerialNumber => self.out.extend(SERIAL_NUMBER),
            SlcanCommand::Status => {
                let flags = std::mem::take(&mut self.status);
                self.out.extend(format!("F{flags:02X}").into_bytes());
            }
            SlcanCommand::Times(times) => self.times = times,
        }
        true
    }

    fn switch(&mut self, channel: Channel) -> bool {
        if channel != Channel::Closed && self.bit_rate != BUS_BIT_RATE {
            self.counts.wrong_bit_rate += 1;
            return false;
        }
        self.channel = channel;
        self.plug();
        true
    }

    fn plug(&self) {
        if self.has_controller {
            self.wire.set_cut(self.channel != Channel::Open);
        }
    }

    fn send(&mut self, frame: CanFrame) -> bool {
        if self.channel != Channel::Open {
            self.counts.not_open += 1;
            return false;
        }
        if self.waiting.len() >= TRANSMIT_QUEUE {
            self.counts.queue_full += 1;
            self.status |= TRANSMIT_FULL;
            return false;
        }
        self.wire.inject(&frame);
        self.waiting.push_back(frame);
        self.counts.from_client += 1;
        true
    }

    /// Takes the wire's frames since the last call.
    pub fn hear(&mut self) {
        for entry in self.wire.take_trace() {
            // The foreign node sends in order. An ESC that sends the very same frame meanwhile
            // changes nothing: the client hears one of the two.
            if !entry.from_controller && self.waiting.front() == Some(&entry.frame) {
                self.waiting.pop_front();
            } else if self.channel != Channel::Closed {
                self.write(&entry);
            }
        }
    }

    fn write(&mut self, entry: &TraceEntry) {
        if matches!(self.flow, Flow::Lossy(room) if self.out.len() >= room) {
            self.counts.not_read += 1;
            self.status |= DATA_OVERRUN;
            return;
        }
        let time = self.times.then(|| (entry.end.get() / 1_000_000 % TIME_PERIOD_MILLIS) as u16);
        write_frame(&mut self.out, &entry.frame, time);
        self.counts.to_client += 1;
    }

    /// The bytes for the client; the caller removes those that it has passed on.
    pub const fn out(&mut self) -> &mut Vec<u8> {
        &mut self.out
    }

    /// Counters of the traffic so far.
    pub fn counts(&self) -> Counts {
        Counts { not_sent: self.waiting.len() as u64, ..self.counts }
    }
}

#[cfg(test)]
mod tests {
    use rc10_sim::{BusConfig, Esc, EscConfig, Model, World};
    use rc10_time::Micros;

    use super::*;

    struct Bench {
        world: World,
        wire: Bus,
        adapter: Adapter,
        escs: Vec<Esc>,
    }

    impl Bench {
        /// A wire with C620s and an adapter with the wire's controller.
        fn new(escs: u8, flow: Flow) -> Self {
            let mut world = World::new(5);
            let wire = world.add_bus(BusConfig::default());
            let add = |id| wire.add_esc(EscConfig::new(Model::C620, id)).unwrap();
            let escs = (1..=escs).map(add).collect();
            let adapter = Adapter::new(wire.clone(), flow, true);
            Self { world, wire, adapter, escs }
        }

        /// Sends a text and lets milliseconds pass; what is answered and received.
        fn say(&mut self, text: &str, millis: u64) -> String {
            for command in self.adapter.take(text.as_bytes()) {
                self.adapter.answer(command);
            }
            self.world.advance(self.world.now() + Micros::from_millis(millis));
            self.adapter.hear();
            String::from_utf8(std::mem::take(self.adapter.out())).unwrap()
        }
    }

    #[test]
    fn an_open_channel_hears_and_sends() {
        let mut bench = Bench::new(1, Flow::Lossless);
        assert_eq!(bench.say("C\rS8\r\rO\rO\r", 0), "\r\r\r\r\r");
        assert_eq!(bench.adapter.channel, Channel::Open);
        let heard = bench.say("", 10);
        let frames: Vec<_> = heard.split_terminator('\r').collect();
        assert!((9..=11).contains(&frames.len()), "{heard:?}");
        assert!(frames.iter().all(|line| line.starts_with("t2018") && line.len() == 21));
        // 4 A to the motor. It obeys, and the client does not hear itself.
        let heard = bench.say("t20080CCD000000000000\r", 2);
        assert!(heard.starts_with("\rt2018") && !heard.contains("t200"), "{heard:?}");
        assert_eq!(bench.escs[0].state().command, 0x0CCD);
        assert_eq!(bench.adapter.counts().from_client, 1);
        assert_eq!(bench.adapter.counts().not_sent, 0);
    }

    #[test]
    fn a_closed_channel_hears_nothing_and_a_listening_one_sends_nothing() {
        let mut bench = Bench::new(2, Flow::Lossless);
        const SEND: &str = "t20080CCD000000000000\r";
        assert_eq!(bench.say(SEND, 10), "\x07");
        bench.say("L\r", 0);
        let heard = bench.say(SEND, 10);
        assert!(heard.starts_with("\x07t20"), "{heard:?}");
        bench.say("C\r", 0);
        assert_eq!(bench.say("", 10), "");
        assert_eq!(bench.escs[0].state().commands, 0);
        assert_eq!(bench.adapter.counts().not_open, 2);
    }

    /// Without a node that acknowledges, frames do not count. An open channel acknowledges.
    #[test]
    fn without_the_robot_the_adapter_acknowledges_while_it_is_open() {
        let mut bench = Bench::new(1, Flow::Lossless);
        assert_eq!(bench.say("L\r", 10), "\r");
        assert_eq!(bench.wire.counters().frames, 0);
        assert!(bench.say("O\r", 10).starts_with("\rt2018"));
        let frames = bench.wire.counters().frames;
        assert_eq!(bench.say("C\r", 10), "\r");
        assert!(bench.wire.counters().frames <= frames + 1);
    }

    #[test]
    fn what_is_no_command_changes_nothing() {
        let mut bench = Bench::new(1, Flow::Lossless);
        bench.say("O\rZ1\r", 0);
        let (counts, channel) = (bench.adapter.counts(), bench.adapter.channel);
        assert_eq!(bench.say("X\rt2018\rS9\rt20080CCD0000000000001\r", 0), "\x07".repeat(4));
        assert_eq!(bench.adapter.counts(), Counts { malformed: 4, ..counts });
        assert_eq!(bench.adapter.channel, channel);
        bench.say("", 10);
        assert_eq!(bench.escs[0].state().commands, 0);
    }

    #[test]
    fn at_another_bit_rate_the_channel_stays_closed() {
        let mut bench = Bench::new(1, Flow::Lossless);
        assert_eq!(bench.say("S6\rO\rL\r", 5), "\r\x07\x07");
        assert_eq!(bench.adapter.counts().wrong_bit_rate, 2);
        assert!(bench.say("S8\rO\r", 5).starts_with("\r\rt2018"));
    }

    #[test]
    fn questions_are_answered_and_times_are_milliseconds_of_the_minute() {
        let mut bench = Bench::new(2, Flow::Lossless);
        assert_eq!(bench.say("V\rN\rF\r", 0), "V0101\rNRC10\rF00\r");
        bench.say("", 59_990);
        let heard = bench.say("O\rZ1\r", 20);
        let times: Vec<_> = heard
            .split_terminator('\r')
            .filter(|line| line.starts_with("t201"))
            .filter_map(|line| Some(u16::from_str_radix(line.get(21..)?, 16).unwrap()))
            .collect();
        assert!((19..=21).contains(&times.len()), "{heard:?}");
        assert!(times[0].abs_diff(59_990) <= 1, "{times:?}");
        assert!(times.windows(2).all(|pair| pair[1] == (pair[0] + 1) % 60_000), "{times:?}");
        let heard = bench.say("Z0\r", 2);
        assert!(
            heard.split('\r').filter(|line| line.starts_with('t')).all(|line| line.len() == 21)
        );
    }

    #[test]
    fn unread_frames_are_counted_and_reported() {
        let mut bench = Bench::new(1, Flow::Lossy(100));
        bench.say("O\r", 0);
        let heard = bench.say("", 50);
        let Counts { to_client, not_read, .. } = bench.adapter.counts();
        assert_eq!(heard.len() as u64, 22 * to_client);
        assert_eq!((to_client, to_client + not_read), (5, 50));
        assert_eq!(bench.say("F\rF\r", 0), "F08\rF00\r");
    }

    #[test]
    fn a_full_transmit_queue_refuses_and_says_so() {
        let mut bench = Bench::new(1, Flow::Lossless);
        bench.say("O\r", 0);
        bench.wire.set_held_dominant(true);
        let answers = bench.say(&"t1230\r".repeat(66), 1);
        assert_eq!(answers, "\r".repeat(64) + "\x07\x07");
        let counts = bench.adapter.counts();
        assert_eq!((counts.from_client, counts.queue_full, counts.not_sent), (64, 2, 64));
        assert_eq!(bench.say("F\r", 0), "F02\r");
        bench.wire.set_held_dominant(false);
        bench.say("", 100);
        assert_eq!(bench.adapter.counts().not_sent, 0);
    }
}
