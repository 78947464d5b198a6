//! A robot's line for several programs: the one that keeps the robot running, and shells on this PC.
//!
//! Each has a link of its own: questions are numbered anew, so that an answer goes to who asked; the robot is
//! told what all of them watch, and each gets its own part of the samples. A program that does not read loses frames,
//! and one that sends much is read slowly: neither delays the robot, or a stop.

use std::collections::{BTreeSet, VecDeque};
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};

use anyhow::Result;
use rc10_link::frame::{AROUND, ASK, BODY, Said, WithCommands, Writer};
use rc10_link::samples::{Head, VALUES};
use rc10_link::{Ask, GROUPS, Tell};
use rc10_module::Stream;
use rc10_time::Micros;

use super::client::{Frames, frame};
use super::line::Source;
use super::reach::{KEY, LocalRobot};
use crate::run::running::Running;

/// Limit of connections.
const MOST: usize = 8;
/// Bytes that are read of all shells in a step: those of 4 ms on a line of 921,600 baud.
const PIECE: usize = 368;
/// Limit of bytes that a shell has not read: further frames are lost.
const ROOM: usize = 256 * 1024;
/// Limit of questions that are not answered yet.
const ASKED: usize = 256;

/// The signals that a program watches in a group.
#[derive(Default)]
struct Watched {
    period: u16,
    order: Vec<u16>,
    /// Number of the period of the newest sample.
    slot: u64,
    count: u16,
}

/// A program at the line.
struct Program {
    number: u32,
    /// The connection of a shell, and how much of the key it has said.
    shell: Option<(TcpStream, usize)>,
    asks: Stream<WithCommands>,
    heard: Vec<Said>,
    groups: [Watched; GROUPS],
    out: Vec<u8>,
}

/// The signals that the robot samples in a group, and its count of samples not taken.
#[derive(Default)]
struct Sampled {
    order: Vec<u16>,
    newest: u32,
    skipped: u32,
}

/// A robot's line, shared.
pub(super) struct Shared<'r> {
    source: Box<dyn Source + 'r>,
    now: Micros,
    listener: TcpListener,
    robot: LocalRobot,
    /// The first keeps the robot running.
    programs: Vec<Program>,
    groups: [Sampled; GROUPS],
    /// Numbers of questions, who asked, and its own number; and of commands, of which most are not answered.
    asked: VecDeque<(u16, u32, u16)>,
    commanded: VecDeque<(u16, u32, u16)>,
    next_id: u16,
    heard: Frames,
}

impl Drop for Shared<'_> {
    fn drop(&mut self) {
        self.robot.forget();
    }
}

impl Source for Shared<'_> {
    fn exchange(&mut self, out: &[u8]) -> Result<(Vec<u8>, Micros)> {
        self.admit();
        let (mut first, mut rest) = (Vec::new(), Vec::new());
        let (piece, keys) = (PIECE / self.programs.len().max(1), &self.robot.keys);
        self.programs.retain_mut(|it| it.hear(out, self.now, keys, piece).is_some());
        for at in 0..self.programs.len() {
            for said in std::mem::take(&mut self.programs[at].heard) {
                let ask = match said {
                    Said::Ask(ask) => self.pass(at, ask),
                    Said::Command(body) => {
                        rest.extend(self.pass_command(at, body));
                        continue;
                    }
                };
                let to = if matches!(ask, Ask::Urge { .. }) { &mut first } else { &mut rest };
                to.extend(frame(&ask));
            }
        }
        first.append(&mut rest);
        let (bytes, now) = self.source.exchange(&first)?;
        self.now = now;
        self.heard.take(&bytes, now).iter().for_each(|body| self.tell(body));
        self.programs.retain_mut(Program::send);
        Ok((std::mem::take(&mut self.programs[0].out), now))
    }

    fn trouble(&self) -> Option<&str> {
        self.source.trouble()
    }

    fn world(&mut self) -> Option<&mut dyn Running> {
        self.source.world()
    }
}

/// Reads what is there; `None` if the connection has ended.
fn read(mut stream: &TcpStream, bytes: &mut [u8]) -> Option<usize> {
    match stream.read(bytes) {
        Ok(0) => None,
        Ok(count) => Some(count),
        Err(error) => is_for_later(&error).then_some(0),
    }
}

fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

impl<'r> Shared<'r> {
    /// Lets shells in at a listener that does not block.
    pub(super) fn new(
        source: Box<dyn Source + 'r>,
        listener: TcpListener,
        robot: LocalRobot,
    ) -> Self {
        Self {
            source,
            now: Micros::ZERO,
            listener,
            robot,
            programs: vec![Program::new(0, None)],
            groups: Default::default(),
            asked: VecDeque::new(),
            commanded: VecDeque::new(),
            next_id: 0,
            heard: Frames::default(),
        }
    }

    /// Takes new connections. Where there is no room the oldest that has not said the key leaves.
    fn admit(&mut self) {
        for _ in 0..MOST {
            let Ok((stream, _)) = self.listener.accept() else { break };
            let number = self.programs.last().map_or(0, |it| it.number + 1);
            if self.programs.len() > MOST {
                let Some(at) = self.programs.iter().position(|it| !it.is_known()) else { break };
                self.programs.remove(at);
            }
            if stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true)).is_ok() {
                self.programs.push(Program::new(number, Some((stream, 0))));
            }
        }
    }

    /// A question as the robot gets it.
    fn pass(&mut self, at: usize, mut ask: Ask) -> Ask {
        match &mut ask {
            Ask::Watch { group, period, signals } => {
                let at_group = usize::from(*group);
                let Some(mine) = self.programs[at].groups.get_mut(at_group) else { return ask };
                (mine.period, mine.order) = (*period, signals.iter().collect());
                let of_all = self.programs.iter().map(|it| &it.groups[at_group]);
                let of_all = of_all.filter(|it| it.period > 0 && !it.order.is_empty());
                *period = of_all.clone().map(|it| it.period).min().unwrap_or_default();
                let all: BTreeSet<_> = of_all.flat_map(|it| it.order.iter().copied()).collect();
                // What has no room in a sample has no value.
                let order: Vec<_> = all.into_iter().take(VALUES).collect();
                *signals = order.iter().copied().collect();
                self.groups[at_group].order = order;
            }
            Ask::Set { id, .. } | Ask::Urge { id, .. } | Ask::Act { id, .. } => {
                self.next_id = self.next_id.wrapping_add(1);
                self.asked.push_back((self.next_id, self.programs[at].number, *id));
                *id = self.next_id;
                if self.asked.len() > ASKED {
                    self.asked.pop_front();
                }
            }
            _ => {}
        }
        ask
    }

    /// The frame of a command as the robot gets it.
    fn pass_command(&mut self, at: usize, mut body: heapless::Vec<u8, ASK>) -> Vec<u8> {
        let mut frame = Writer::<{ ASK + AROUND }>::new();
        if let Some([_, _, id @ ..]) = body.first_chunk_mut::<4>() {
            self.next_id = self.next_id.wrapping_add(1);
            let asked = (self.next_id, self.programs[at].number, u16::from_le_bytes(*id));
            self.commanded.push_back(asked);
            *id = self.next_id.to_le_bytes();
            if self.commanded.len() > ASKED {
                self.commanded.pop_front();
            }
            frame.body(&body);
        }
        frame.bytes().to_vec()
    }

    /// Hands a message of the robot on.
    fn tell(&mut self, body: &[u8]) {
        if let Some((head, words)) = Head::of(body) {
            return self.sample(head, words);
        }
        let Ok((mut tell, _)) = postcard::take_from_bytes::<Tell<'_>>(body) else { return };
        let mut only = None;
        if let Tell::Answer { id, .. } = &mut tell {
            let mut all = [&mut self.asked, &mut self.commanded].into_iter();
            let asked = all.find_map(|of| of.remove(of.iter().position(|it| it.0 == *id)?));
            let Some((_, program, own)) = asked else { return };
            (*id, only) = (own, Some(program));
        }
        let mut frame = Writer::<{ BODY + AROUND }>::new();
        frame.message(&tell);
        let to = self.programs.iter_mut().filter(|it| only.is_none_or(|only| only == it.number));
        to.for_each(|it| it.put(frame.bytes()));
    }

    /// Hands on of a sample what each program watches, no oftener than it wants.
    fn sample(&mut self, head: Head, words: &[[u8; 4]]) {
        let group = usize::from(head.group);
        let Some(all) = self.groups.get_mut(group).filter(|it| it.order.len() == words.len())
        else {
            // Of the signals that were watched before.
            return;
        };
        // The robot counts anew when it is told to watch others.
        all.skipped += head.skipped.saturating_sub(all.newest);
        all.newest = head.skipped;
        for program in &mut self.programs {
            let mine = &mut program.groups[group];
            // A quarter behind its whole multiples, where samples are.
            let period = u64::from(mine.period) * 1000;
            let slot = (head.at + period / 4).checked_div(period);
            let Some(slot) = slot.filter(|slot| *slot != mine.slot) else { continue };
            if mine.order.is_empty() {
                continue;
            }
            (mine.slot, mine.count) = (slot, mine.count.wrapping_add(1));
            let mut frame = Writer::<{ BODY + AROUND }>::new();
            let head = Head { count: mine.count, skipped: all.skipped, ..head };
            let mut known = all.order.iter().zip(words);
            for (place, signal) in frame.sample(head).iter_mut().zip(&mine.order) {
                let word = known.find(|(known, _)| *known == signal).map(|(_, word)| *word);
                *place = word.unwrap_or(f32::NAN.to_le_bytes());
            }
            frame.end_sample(mine.order.len());
            program.put(frame.bytes());
        }
    }
}

impl Program {
    fn new(number: u32, shell: Option<(TcpStream, usize)>) -> Self {
        let (groups, asks) = (Default::default(), Stream::new(WithCommands));
        Self { number, shell, asks, heard: Vec::new(), groups, out: Vec::new() }
    }

    fn is_known(&self) -> bool {
        self.shell.as_ref().is_none_or(|(_, said)| *said == KEY)
    }

    /// Hears a shell over its connection, the one that keeps the robot by `out`; `None` if it has ended or is a
    /// stranger.
    fn hear(
        &mut self,
        out: &[u8],
        now: Micros,
        [key, answer]: &[String; 2],
        most: usize,
    ) -> Option<()> {
        let mut piece = [0; PIECE];
        let bytes = match &mut self.shell {
            None => out,
            Some((stream, KEY)) => {
                let count = read(stream, &mut piece[..most])?;
                &piece[..count]
            }
            Some((stream, said)) => {
                let rest = &key.as_bytes()[*said..];
                let count = read(stream, &mut piece[..rest.len()])?;
                *said += count;
                if *said == KEY {
                    self.out.extend(answer.bytes());
                }
                return (piece[..count] == rest[..count]).then_some(());
            }
        };
        if !bytes.is_empty() {
            self.asks.receive(bytes, now, |ask| self.heard.push(ask));
        }
        Some(())
    }

    fn put(&mut self, frame: &[u8]) {
        if self.is_known() && self.out.len() + frame.len() <= ROOM {
            self.out.extend(frame);
        }
    }

    /// Sends what there is room for; whether the program is still there.
    fn send(&mut self) -> bool {
        let Some((stream, _)) = &mut self.shell else { return true };
        while !self.out.is_empty() {
            match stream.write(&self.out) {
                Ok(count) => drop(self.out.drain(..count)),
                Err(error) => return is_for_later(&error),
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use rc10_link::commands;
    use rc10_link::{Declaration, Outcome, Urgent, VERSION};

    use super::super::client::{Answer, Client};
    use super::*;

    /// A line whose robot says what a test wants, and keeps what it is asked.
    #[derive(Clone, Default)]
    struct Line(Rc<RefCell<Inside>>);

    /// What it was asked, what it says, and what it was commanded.
    type Inside = (Vec<Ask>, Vec<u8>, Vec<commands::Head>);

    impl Line {
        fn say(&self, write: impl FnOnce(&mut Writer<{ BODY + AROUND }>)) {
            let mut frame = Writer::new();
            write(&mut frame);
            self.0.borrow_mut().1.extend(frame.bytes());
        }

        fn asked(&self) -> Vec<Ask> {
            std::mem::take(&mut self.0.borrow_mut().0)
        }

        fn sample(&self, at: u64, skipped: u32, values: &[f32]) {
            self.say(|frame| {
                let head = Head { group: 1, count: 1, skipped, at };
                for (place, value) in frame.sample(head).iter_mut().zip(values) {
                    *place = value.to_le_bytes();
                }
                frame.end_sample(values.len());
            });
        }
    }

    impl Source for Line {
        fn exchange(&mut self, out: &[u8]) -> Result<(Vec<u8>, Micros)> {
            let mut inside = self.0.borrow_mut();
            let (asks, said, given) = &mut *inside;
            if !out.is_empty() {
                Stream::new(WithCommands).receive(out, Micros::ZERO, |said| match said {
                    Said::Ask(ask) => asks.push(ask),
                    Said::Command(body) => given.push(commands::Head::of(&body).unwrap().0),
                });
            }
            Ok((std::mem::take(said), Micros::ZERO))
        }
    }

    struct Scene {
        line: Line,
        shared: Shared<'static>,
        keeper: Client,
    }

    impl Scene {
        fn new() -> Self {
            let (line, listener) = (Line::default(), TcpListener::bind("127.0.0.1:0").unwrap());
            listener.set_nonblocking(true).unwrap();
            let keys = ["k".repeat(32), "a".repeat(32)];
            let port = listener.local_addr().unwrap().port();
            let (name, file) = ("sim:1".into(), "/dev/null/none".into());
            let robot = LocalRobot { name, title: String::new(), keys, port, file };
            let shared = Shared::new(Box::new(line.clone()), listener, robot);
            Self { line, shared, keeper: Client::new() }
        }

        fn connect(&self, said: &[u8]) -> TcpStream {
            let mut stream =
                TcpStream::connect(self.shared.listener.local_addr().unwrap()).unwrap();
            stream.write_all(said).unwrap();
            stream.set_nonblocking(true).unwrap();
            stream
        }

        fn step(&mut self) {
            let (bytes, now) = self.shared.exchange(&self.keeper.take_out()).unwrap();
            self.keeper.hear(&bytes, now);
        }

        /// Steps until something is so: a connection on one PC takes its time, too.
        fn until(&mut self, mut is_so: impl FnMut(&mut Self) -> bool) {
            let is_met = (0..2000).any(|_| {
                self.step();
                let is_so = is_so(self);
                std::thread::sleep(std::time::Duration::from_millis(u64::from(!is_so)));
                is_so
            });
            assert!(is_met, "never");
        }

        fn shell(&mut self) -> TcpStream {
            let stream = self.connect(&[b'k'; 32]);
            self.until(|_| read(&stream, &mut [0; 32]) == Some(32));
            stream
        }

        /// What a shell sends arrives as these questions of the robot.
        fn ask(&mut self, mut stream: &TcpStream, client: &mut Client, count: usize) -> Vec<Ask> {
            stream.write_all(&client.take_out()).unwrap();
            let mut asked = Vec::new();
            self.until(|scene| {
                asked.extend(scene.line.asked());
                asked.len() >= count
            });
            asked
        }

        fn hear(&mut self, stream: &TcpStream, client: &mut Client) {
            let mut piece = [0; 4096];
            let mut count = 0;
            self.until(|_| {
                count = read(stream, &mut piece).unwrap();
                count > 0
            });
            client.hear(&piece[..count], Micros::ZERO);
        }
    }

    #[test]
    fn an_answer_goes_to_who_asked_and_a_stop_goes_first() {
        let mut scene = Scene::new();
        let (stream, mut client) = (scene.shell(), Client::new());
        let theirs = client.set(&[(3, 1.0)]).unwrap();
        let asked = scene.ask(&stream, &mut client, 1);
        let Ask::Set { id, .. } = asked[0] else { panic!("{asked:?}") };
        let ours = scene.keeper.set(&[(4, 1.0)]).unwrap();
        assert_eq!(ours, theirs, "both count from the begin");
        scene.step();
        let Ask::Set { id: other, .. } = scene.line.asked()[0] else { panic!() };
        assert_ne!(id, other);
        scene.line.say(|it| it.message(&Tell::Answer { id, outcome: Outcome::Done }));
        scene.hear(&stream, &mut client);
        assert_eq!(scene.keeper.answer(ours), None);
        assert_eq!(client.answer(theirs), Some(Answer::Done));
        let outcome = Outcome::Register(7);
        scene.line.say(|it| it.message(&Tell::Answer { id: other, outcome }));
        scene.step();
        assert_eq!(scene.keeper.answer(ours), Some(Answer::Register(7)));
        // A shell's stop overtakes what the keeper asks in the same step.
        let mut stop = frame(&Ask::Urge { id: 1, what: Urgent::Stop });
        let last = stop.split_off(stop.len() - 1);
        (&stream).write_all(&stop).unwrap();
        for _ in 0..20 {
            scene.step();
        }
        (&stream).write_all(&last).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(50));
        let _ = scene.keeper.set(&[(4, 2.0)]);
        scene.step();
        let asked = scene.line.asked();
        assert!(matches!(asked[..], [Ask::Urge { .. }, Ask::Set { .. }]), "{asked:?}");
    }

    #[test]
    fn each_gets_its_own_signals_no_oftener_than_it_wants() {
        let mut scene = Scene::new();
        let (stream, mut client) = (scene.shell(), Client::new());
        scene.keeper.watch(1, 10, [5, 9].into_iter());
        scene.keeper.step(Micros::ZERO);
        scene.step();
        scene.line.asked();
        client.watch(1, 5, [2, 9].into_iter());
        client.step(Micros::ZERO);
        let asked = scene.ask(&stream, &mut client, 5);
        let of_group = |ask: &&Ask| matches!(ask, Ask::Watch { group: 1, .. });
        let all = [2, 5, 9].into_iter().collect();
        let wanted = Ask::Watch { group: 1, period: 5, signals: all };
        assert_eq!(asked.iter().find(of_group), Some(&wanted));
        // Late by less than a quarter, as a busy line makes it.
        for (at, late) in (0..8).zip([0, 900, 20, 0, 1000, 0, 7, 30]) {
            scene.line.sample(1_000_000 + 5000 * at + late, 3, &[2.0, 5.0, 9.0]);
        }
        // Of what was watched before.
        scene.line.sample(1_050_000, 3, &[5.0, 9.0]);
        scene.step();
        let ours = scene.keeper.take_samples();
        assert_eq!(ours.len(), 4);
        assert!(ours.iter().all(|it| it.values == [(5, 5.0), (9, 9.0)]), "{ours:?}");
        scene.hear(&stream, &mut client);
        let theirs = client.take_samples();
        assert_eq!(theirs.len(), 8);
        assert!(theirs.iter().all(|it| it.values == [(2, 2.0), (9, 9.0)]), "{theirs:?}");
        assert_eq!(scene.keeper.losses().samples + client.losses().samples, 0);
        // One that has left is not watched for.
        drop(stream);
        scene.until(|scene| scene.shared.programs.len() == 1);
        scene.keeper.step(Micros::from_millis(100));
        scene.keeper.step(Micros::from_millis(200));
        scene.step();
        let asked = scene.line.asked();
        let own = Ask::Watch { group: 1, period: 10, signals: [5, 9].into_iter().collect() };
        assert_eq!(asked.iter().find(of_group), Some(&own), "{asked:?}");
        // The robot counts anew, and nothing is thought to be skipped.
        scene.line.sample(2_000_000, 0, &[5.0, 9.0]);
        scene.line.sample(2_010_000, 1, &[5.0, 9.0]);
        scene.step();
        assert_eq!(scene.keeper.losses().skipped, 1);
    }

    #[test]
    fn more_signals_than_a_sample_holds_have_no_value() {
        let mut scene = Scene::new();
        let (stream, mut client) = (scene.shell(), Client::new());
        let most = VALUES as u16;
        scene.keeper.watch(1, 10, 0..most);
        scene.keeper.step(Micros::ZERO);
        scene.step();
        client.watch(1, 10, [most - 1, most].into_iter());
        client.step(Micros::ZERO);
        scene.line.asked();
        scene.ask(&stream, &mut client, 5);
        scene.line.sample(1_000_000, 0, &[1.0; VALUES]);
        scene.step();
        scene.hear(&stream, &mut client);
        let values = client.take_samples().pop().unwrap().values;
        assert!(values[0] == (most - 1, 1.0) && values[1].1.is_nan(), "{values:?}");
    }

    /// Its frames are lost, whole, and it holds up neither the robot nor another one.
    #[test]
    fn a_shell_that_does_not_read_loses_frames() {
        let mut scene = Scene::new();
        let (slow, quick) = (scene.shell(), scene.shell());
        let (signals, parameters, damaged, declaration) = (0, 0, [0; 3], Declaration(7));
        let (version, changes, skipped) = (VERSION, 0, 0);
        let welcome = move |at| Tell::Welcome {
            version,
            signals,
            parameters,
            at,
            changes,
            damaged,
            skipped,
            declaration,
        };
        let mut heard: Vec<u8> = Vec::new();
        let mut piece = vec![0; 1 << 20];
        let mut said = 0;
        // More than a PC keeps for a connection.
        for step in 0..200 {
            for at in 0..3000 {
                scene.line.say(|it| it.message(&welcome(3000 * step + at)));
            }
            said += scene.line.0.borrow().1.len();
            scene.step();
            let count = read(&quick, &mut piece).unwrap();
            heard.extend(&piece[..count]);
            assert!(scene.shared.programs.iter().all(|it| it.out.len() <= ROOM));
        }
        assert!(scene.shared.programs[1].out.len() > ROOM - 100, "{said} B are not enough");
        scene.until(|_| {
            let count = read(&quick, &mut piece).unwrap();
            heard.extend(&piece[..count]);
            heard.len() >= said
        });
        // What the slow one finds is whole.
        let mut client = Client::new();
        (0..4).for_each(|_| {
            let count = read(&slow, &mut piece).unwrap();
            client.hear(&piece[..count], Micros::ZERO);
            scene.step();
        });
        assert!(client.is_up(Micros::ZERO) && client.losses().damaged == 0);
    }

    #[test]
    fn strangers_are_not_heard_and_do_not_keep_shells_out() {
        let mut scene = Scene::new();
        let stop = frame(&Ask::Urge { id: 1, what: Urgent::Stop });
        let post = [b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", &[b'k'; 32][..], &stop].concat();
        let almost = [&[b'k'; 31][..], b"x", &stop].concat();
        for said in [&post, &almost, &stop] {
            let stream = scene.connect(said);
            scene.until(|_| read(&stream, &mut [0; 8]).is_none());
        }
        let silent: Vec<_> = (0..3 * MOST).map(|_| scene.connect(b"k")).collect();
        drop(scene.shell());
        assert!(scene.shared.programs.len() <= 1 + MOST);
        drop(silent);
        // Garbage behind the key is no question.
        scene.until(|scene| scene.shared.programs.len() == 1);
        let mut stream = scene.connect(&[&[b'k'; 32][..], &[0xE7; 999]].concat());
        stream.write_all(&stop).unwrap();
        assert_eq!(scene.line.asked(), []);
        scene.until(|scene| !scene.line.0.borrow().0.is_empty());
        // There are so many shells and no more.
        let shells: Vec<_> = (1..MOST).map(|_| scene.shell()).collect();
        let more = scene.connect(&[b'k'; 32]);
        scene.until(|_| read(&more, &mut [0; 8]).is_none());
        assert_eq!(scene.shared.programs.len(), 1 + 1 + shells.len());
    }

    #[test]
    fn a_command_of_a_shell_reaches_the_robot_and_its_refusal_that_shell() {
        let mut scene = Scene::new();
        let (mut one, other) = (scene.shell(), scene.shell());
        let (mut client, head) = (Client::with_first_id(40), commands::Head::default());
        client.command(commands::Head { first: 1, who: 5, count: 9, ..head }, &[0.5, 1.5]);
        one.write_all(&client.take_out()).unwrap();
        scene.until(|scene| !scene.line.0.borrow().2.is_empty());
        let given = scene.line.0.borrow().2[0];
        assert_eq!((given.first, given.who, given.count), (1, 5, 9));
        let outcome = Outcome::Refused { parameter: None, why: "too late", detail: "" };
        scene.line.say(|frame| frame.message(&Tell::Answer { id: given.id, outcome }));
        scene.hear(&one, &mut client);
        assert_eq!(client.take_refusals(), ["too late"]);
        assert_eq!(read(&other, &mut [0; 64]), Some(0));
    }
}
