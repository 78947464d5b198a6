extern crate std;

use std::vec::Vec;

use rc10_can::CanFrame;
use rc10_motor::dji::{Config, M3508};
use rc10_motor::{ArmState, ArmSwitch, Unfit};

use super::*;

const DRIVE: Topic<[f32; 5]> = Topic::new(1, Role::Leads, Micros::from_millis(10));
const YAW: Topic<f32> = Topic::new(2, Role::Follows, Micros::from_millis(5));
static TOPICS: &[TopicEntry] = &[DRIVE.entry(), YAW.entry()];
const BOARDS: Boards = Boards::new([(&[], 1), (&[], 1)], &[DRIVE.entry(), YAW.entry()]);
const WHEEL: Entry<Device> =
    Entry::new(Place::Bus(1), Config::new(&M3508, 1).device()).with_label("wheel");

/// Two boards, and the words between them, which take a millisecond.
struct Scene {
    switches: [ArmSwitch; 2],
    bonds: [Bond; 2],
    links: [Link; 2],
    now: Micros,
    /// Whether the wire between them is whole.
    is_whole: bool,
    on_wire: Vec<(usize, [u8; BEAT_LEN])>,
    /// What each board finds in the bytes of a UART, if that is between them.
    streams: Option<[Stream<FromBoard>; 2]>,
}

impl Scene {
    fn new() -> Self {
        Self::over(false)
    }

    fn over(is_uart: bool) -> Self {
        let streams = is_uart.then(|| [Stream::new(FromBoard), Stream::new(FromBoard)]);
        let switches = [ArmSwitch::new(), ArmSwitch::new()];
        let bonds = [Role::Leads, Role::Follows];
        let bonds = [0, 1].map(|it| Bond::new(bonds[it], BOARDS.declaration, &switches[it]));
        let (now, links) = (Micros::from_millis(1000), [Link::Lost; 2]);
        Self { switches, bonds, links, now, is_whole: true, on_wire: Vec::new(), streams }
    }

    fn restart(&mut self, board: usize) {
        let role = self.bonds[board].role;
        self.switches[board] = ArmSwitch::new();
        self.bonds[board] = Bond::new(role, BOARDS.declaration, &self.switches[board]);
    }

    fn pass(&mut self, millis: u64) -> [ArmState; 2] {
        for _ in 0..millis {
            self.now += Micros::from_millis(1);
            for (from, bytes) in std::mem::take(&mut self.on_wire) {
                self.hear(1 - from, from as u8, &bytes);
            }
            for board in 0..2 {
                let (link, beat) = self.bonds[board].step(&self.switches[board], self.now);
                self.links[board] = link;
                self.on_wire.extend(beat.filter(|_| self.is_whole).map(|beat| (board, beat)));
            }
        }
        self.states()
    }

    fn hear(&mut self, board: usize, place: u8, beat: &[u8]) {
        if self.streams.is_some() {
            self.hear_bytes(board, frame::of_board(place, beat).bytes());
        } else {
            self.bonds[board].hear(place, beat, self.now);
        }
    }

    /// Bytes of any origin come to a board, if it has a UART.
    fn hear_bytes(&mut self, board: usize, bytes: &[u8]) {
        let Some(streams) = &mut self.streams else { return };
        let (bond, now) = (&mut self.bonds[board], self.now);
        streams[board].receive(bytes, now, |(place, data)| {
            let _ = bond.hear(place, &data, now);
        });
    }

    fn states(&self) -> [ArmState; 2] {
        [0, 1].map(|it| self.switches[it].state())
    }

    fn armed() -> Self {
        Self::armed_over(false)
    }

    fn armed_over(is_uart: bool) -> Self {
        let mut scene = Self::over(is_uart);
        assert_eq!(scene.pass(20), [ArmState::Disarmed; 2]);
        scene.switches[0].arm().unwrap();
        assert_eq!(scene.pass(3), [ArmState::Armed; 2]);
        scene
    }

    /// As a hand does: the leading board's stop ends.
    fn reset(&mut self) {
        self.switches[0].disarm();
        self.switches[0].reset_after(self.switches[0].stops());
    }
}

#[test]
fn a_follower_has_the_state_of_the_leading_board_within_three_milliseconds() {
    let mut scene = Scene::armed();
    assert_eq!(scene.links, [Link::Online; 2]);
    for (act, state) in [
        (ArmSwitch::suspend as fn(&ArmSwitch), ArmState::Suspended),
        (ArmSwitch::resume, ArmState::Armed),
        (ArmSwitch::disarm, ArmState::Disarmed),
    ] {
        act(&scene.switches[0]);
        assert_eq!(scene.pass(3), [state; 2]);
    }
}

#[test]
fn a_stop_of_one_board_stops_both_and_a_hand_ends_both() {
    for board in 0..2 {
        let mut scene = Scene::armed();
        scene.switches[board].emergency_stop();
        assert_eq!(scene.pass(3), [ArmState::EStopped; 2]);
        // Nothing but the hand ends it.
        assert_eq!(scene.pass(3000), [ArmState::EStopped; 2]);
        scene.reset();
        assert_eq!(scene.pass(5), [ArmState::Disarmed; 2]);
        // And it is over.
        assert_eq!(scene.pass(3000), [ArmState::Disarmed; 2]);
        scene.switches[0].arm().unwrap();
        assert_eq!(scene.pass(3), [ArmState::Armed; 2]);
    }
}

#[test]
fn a_stop_of_a_disarmed_follower_is_not_forgotten_behind_a_cut_wire() {
    let mut scene = Scene::armed();
    scene.is_whole = false;
    scene.pass(5);
    scene.switches[1].emergency_stop();
    scene.pass(400);
    assert_eq!(scene.states(), [ArmState::Armed, ArmState::EStopped]);
    scene.is_whole = true;
    assert_eq!(scene.pass(10), [ArmState::EStopped; 2]);
}

#[test]
fn a_silent_leading_board_suspends_then_disarms_and_never_arms_by_itself() {
    let mut scene = Scene::armed();
    scene.is_whole = false;
    assert_eq!(scene.pass(13)[1], ArmState::Armed);
    assert_eq!(scene.pass(4)[1], ArmState::Suspended);
    scene.is_whole = true;
    assert_eq!(scene.pass(10), [ArmState::Armed; 2]);
    scene.is_whole = false;
    assert_eq!(scene.pass(1100)[1], ArmState::Disarmed);
    assert_eq!(scene.links[1], Link::Lost);
    scene.is_whole = true;
    assert_eq!(scene.pass(2000), [ArmState::Armed, ArmState::Disarmed]);
    scene.switches[0].disarm();
    scene.pass(5);
    scene.switches[0].arm().unwrap();
    assert_eq!(scene.pass(5), [ArmState::Armed; 2]);
}

#[test]
fn a_board_that_starts_anew_stops_none_and_is_not_armed() {
    for board in 0..2 {
        let mut scene = Scene::armed();
        for _ in 0..3 {
            scene.switches[board].emergency_stop();
            scene.pass(5);
            scene.reset();
            scene.pass(5);
        }
        scene.switches[0].arm().unwrap();
        assert_eq!(scene.pass(5), [ArmState::Armed; 2]);
        scene.restart(board);
        let states = scene.pass(50);
        let left = if board == 0 { ArmState::Disarmed } else { ArmState::Armed };
        assert_eq!(states, [left, ArmState::Disarmed]);
        scene.switches[0].disarm();
        scene.pass(5);
        scene.switches[0].arm().unwrap();
        assert_eq!(scene.pass(5), [ArmState::Armed; 2]);
    }
}

#[test]
fn words_twice_damaged_or_of_another_program_are_not_taken() {
    let mut scene = Scene::armed();
    // The leading board hangs, and its controller repeats the last frame.
    let (_, beat) = scene.bonds[0].step(&scene.switches[0], scene.now + BEAT);
    let beat = beat.unwrap();
    for _ in 0..40 {
        scene.now += Micros::from_millis(1);
        scene.bonds[1].hear(0, &beat, scene.now);
        scene.bonds[1].step(&scene.switches[1], scene.now);
    }
    assert_eq!(scene.states()[1], ArmState::Suspended);

    // And one from before, while it was armed, among those of now.
    let mut scene = Scene::armed();
    let (_, armed) = scene.bonds[0].step(&scene.switches[0], scene.now + BEAT);
    scene.pass(40);
    scene.switches[0].disarm();
    for _ in 0..100 {
        scene.bonds[1].hear(0, &armed.unwrap(), scene.now);
        scene.pass(1);
    }
    assert_eq!(scene.states(), [ArmState::Disarmed; 2]);
    scene.is_whole = false;
    for _ in 0..100 {
        scene.bonds[1].hear(0, &armed.unwrap(), scene.now);
        scene.pass(1);
    }
    assert_eq!(scene.links[1], Link::Interrupted);

    let mut scene = Scene::armed();
    for bytes in [&[0; 6][..], &[0; 8], &[9, 0, 7, 0, 0, 0, 0], &[]] {
        let before = scene.bonds[1].heard;
        scene.bonds[1].hear(0, bytes, scene.now);
        assert_eq!(scene.bonds[1].heard, before, "{bytes:?}");
    }
    // Its own, as an echo.
    for from in 1..4 {
        scene.bonds[1].hear(from, &[99, 0, 0, 0, 0, 0, 0], scene.now);
    }
    assert_eq!(scene.pass(1)[1], ArmState::Armed);

    // Other topics: never armed.
    let mut scene = Scene::new();
    scene.bonds[0].declaration ^= 1;
    scene.pass(20);
    scene.switches[0].arm().unwrap();
    assert_eq!(scene.pass(20), [ArmState::Armed, ArmState::Disarmed]);
    assert_eq!(scene.links, [Link::Different; 2]);
    // But a stop of either is one.
    scene.switches[1].emergency_stop();
    assert_eq!(scene.pass(5), [ArmState::EStopped; 2]);
}

#[test]
fn a_stop_of_a_board_that_has_just_started_ends_by_a_hand_only() {
    let mut scene = Scene::armed();
    scene.switches[0].disarm();
    scene.pass(20);
    scene.restart(1);
    scene.switches[1].emergency_stop();
    // A word of before, in which no stop of this board is open, comes first.
    let (_, beat) = scene.bonds[0].step(&scene.switches[0], scene.now + BEAT);
    scene.bonds[1].hear(0, &beat.unwrap(), scene.now + BEAT);
    assert_eq!(scene.pass(200), [ArmState::EStopped; 2]);
    scene.reset();
    assert_eq!(scene.pass(20), [ArmState::Disarmed; 2]);
}

#[test]
fn an_unfit_board_hands_a_stop_on_and_ends_none() {
    let mut scene = Scene::new();
    scene.switches[1].forbid(Unfit::Clock);
    scene.pass(20);
    scene.switches[0].arm().unwrap();
    assert_eq!(scene.pass(20), [ArmState::Armed, ArmState::Disarmed]);
    scene.switches[1].emergency_stop();
    assert_eq!(scene.pass(5), [ArmState::EStopped, ArmState::Disarmed]);
    // A leading board that cannot be stopped does not end the other one's.
    let mut scene = Scene::new();
    scene.switches[0].forbid(Unfit::Clock);
    scene.pass(20);
    scene.switches[1].emergency_stop();
    assert_eq!(scene.pass(500)[1], ArmState::EStopped);
}

#[test]
fn any_number_of_stops_behind_a_cut_wire_is_a_stop() {
    for stops in [1, 255, 256, 512] {
        let mut scene = Scene::armed();
        scene.is_whole = false;
        scene.pass(700);
        (0..stops).for_each(|_| scene.switches[1].emergency_stop());
        scene.is_whole = true;
        assert_eq!(scene.pass(7), [ArmState::EStopped; 2], "{stops}");
    }
}

#[test]
fn a_wire_that_is_cut_for_less_than_a_second_changes_nothing() {
    for cut in [20, 400, 640, 700, 980] {
        let mut scene = Scene::armed();
        scene.is_whole = false;
        scene.pass(cut);
        scene.is_whole = true;
        assert_eq!(scene.pass(10), [ArmState::Armed; 2], "{cut} ms");
    }
}

#[test]
fn of_random_orders_none_leaves_a_follower_armed_under_another_state() {
    let mut state = 1_u64;
    let mut random = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 33) % below
    };
    for round in 0..4000 {
        let (mut scene, mut acts) = (Scene::armed_over(round % 2 == 1), Vec::new());
        for _ in 0..12 {
            acts.push(random(11));
            match acts[acts.len() - 1] {
                0 => scene.switches[0].disarm(),
                1 => drop(scene.switches[0].arm()),
                2 => scene.switches[0].emergency_stop(),
                3 => scene.switches[1].emergency_stop(),
                4 => scene.reset(),
                5 => scene.is_whole = !scene.is_whole,
                6 => scene.restart(random(2) as usize),
                7 => scene.switches[0].suspend(),
                // On a UART: the wire is pulled out and plugged in within a frame, noise, what a board sends itself.
                kind => {
                    let board = random(2) as usize;
                    let (_, beat) =
                        scene.bonds[1 - board].step(&scene.switches[1 - board], scene.now + BEAT);
                    let mut bytes =
                        frame::of_board(1 - board as u8, &beat.unwrap()).bytes().to_vec();
                    match kind {
                        8 => bytes.truncate(random(16) as usize),
                        9 => bytes[random(16) as usize] ^= random(255) as u8 + 1,
                        _ => {
                            let told =
                                &scene.bonds[board].step(&scene.switches[board], scene.now + BEAT);
                            bytes = frame::of_board(board as u8, &told.1.unwrap()).bytes().to_vec();
                        }
                    }
                    scene.hear_bytes(board, &bytes);
                }
            }
            scene.pass(random(40));
            // What is on the way arrives.
            let [leads, follows] = scene.pass(20);
            let is_safe = follows != ArmState::Armed || leads == ArmState::Armed && scene.is_whole;
            assert!(is_safe, "{acts:?}: {leads:?} {follows:?}");
            if scene.is_whole && acts.ends_with(&[3]) {
                assert_eq!(leads, ArmState::EStopped, "{acts:?}");
            }
        }
        // It drives again.
        scene.is_whole = true;
        scene.pass(20);
        scene.reset();
        scene.pass(10);
        scene.switches[0].arm().unwrap();
        assert_eq!(scene.pass(10), [ArmState::Armed; 2]);
    }
}

#[test]
fn a_value_of_several_frames_is_whole_or_not_there() {
    let frames = |value: &Outgoing| value.frames().collect::<Vec<_>>();
    let mut told = Outgoing::NEW;
    let mut heard = Incoming::NEW;
    let (period, mut now) = (Micros::from_millis(10), Micros::from_millis(1000));
    let mut tell = |told: &mut Outgoing, byte: u8, len: usize| {
        now += period;
        told.set(&[byte; LONGEST][..len]);
        told.due(period, now).unwrap()
    };
    let at = Micros::new(7);
    for len in [0, 1, 6, 7, 8, 20, 21, 28] {
        let value = tell(&mut told, len as u8, len);
        let mut all = frames(&value);
        // In any order, one of them twice.
        all.reverse();
        all.insert(0, all[0].clone());
        for (frame, data) in all {
            heard.take(frame, &data, at);
        }
        assert_eq!(heard.newest(), Some((&[len as u8; LONGEST][..len], at)));
    }
    assert_eq!(heard.lost(), 0);
    // One from before is not taken.
    let before = frames(&tell(&mut told, 3, 28));
    for _ in 0..5 {
        for (frame, data) in frames(&tell(&mut told, 4, 28)) {
            heard.take(frame, &data, at);
        }
    }
    before.iter().for_each(|(frame, data)| heard.take(*frame, data, at));
    assert_eq!((heard.newest().unwrap().0, heard.lost()), (&[4; 28][..], 1));
    // But behind the other board's start numbers begin anew, and what was known stays.
    heard.start(true, period, at);
    assert_eq!(heard.newest().unwrap().0, &[4; 28]);
    before.iter().for_each(|(frame, data)| heard.take(*frame, data, at));
    assert_eq!((heard.newest().unwrap().0, heard.lost()), (&[3; 28][..], 1));
    for (frame, data) in frames(&tell(&mut told, 4, 28)) {
        heard.take(frame, &data, at);
    }
    heard.lost = 1;
    // Of two values a frame each makes none.
    let (one, other) = (frames(&tell(&mut told, 1, 14)), frames(&tell(&mut told, 2, 14)));
    heard.take(0, &one[0].1, at);
    heard.take(1, &other[1].1, at);
    assert_eq!(heard.newest().unwrap().0.len(), 28);
    heard.take(0, &other[0].1, at);
    assert_eq!((heard.newest().unwrap().0, heard.lost()), (&[2; 14][..], 2));
    // What no board sends changes nothing.
    for (frame, data) in [(3, &[0x40, 1][..]), (0, &[0x40, 1]), (1, &[]), (0, &[0xC3; 8])] {
        heard.take(frame, data, at);
        assert_eq!(heard.newest().unwrap().0, &[2; 14][..]);
    }
}

#[test]
fn a_topic_leaves_once_a_period_with_its_newest_value() {
    let mut told = Outgoing::NEW;
    let (period, mut left) = (Micros::from_millis(5), Vec::new());
    for millis in 100..120 {
        told.set(&[millis as u8]);
        if let Some(value) = told.due(period, Micros::from_millis(millis)) {
            left.push((millis, value.bytes[0]));
        }
    }
    assert_eq!(left, [(100, 100), (105, 105), (110, 110), (115, 115)]);
    // Told late, and then soon again: the next one is no earlier for that.
    for (millis, leaves) in [(124, true), (125, false), (128, false), (129, true)] {
        told.set(&[1]);
        assert_eq!(told.due(period, Micros::from_millis(millis)).is_some(), leaves, "{millis}");
    }
}

#[test]
fn values_that_a_short_silence_has_taken_are_counted() {
    let (mut told, mut heard) = (Outgoing::NEW, Incoming::NEW);
    let (period, mut now) = (Micros::from_millis(5), Micros::from_millis(1000));
    for silence in [0, 4, 20, 30] {
        for value in 0..=silence {
            now += period;
            told.set(&[7]);
            let value_told = told.due(period, now).unwrap();
            // Two silences, without a value between them.
            if silence > 0 && (value == silence || value == silence / 2) {
                heard.start(false, period, now);
            }
            if value == silence {
                value_told.frames().for_each(|(part, data)| heard.take(part, &data, now));
            }
        }
    }
    // 30 periods are too long to know how many there were.
    assert_eq!(heard.lost(), 4 + 20);
}

/// A UART's bytes as one of another bit rate samples them, bits of the line in its own bits; `None` for a wrong stop bit.
fn sampled(bytes: &[u8], ratio: f64) -> Vec<Option<u8>> {
    let bits = |byte: &u8| {
        let byte = *byte;
        (0..10).map(move |bit| bit == 9 || bit > 0 && byte >> (bit - 1) & 1 == 1)
    };
    // The line rests between two frames.
    let frames = bytes.chunks(16).flat_map(|frame| {
        frame.iter().flat_map(bits).chain(core::iter::repeat_n(true, 25)).collect::<Vec<_>>()
    });
    let line: Vec<bool> = frames.collect();
    let level = |at: f64| line.get(at as usize).copied().unwrap_or(true);
    let (mut at, mut heard) = (0.0, Vec::new());
    while at < line.len() as f64 {
        if level(at) {
            at += 0.125;
            continue;
        }
        let sample = |bit: u32| level(at + (f64::from(bit) + 0.5) / ratio);
        let byte = (1..9).fold(0, |byte, bit| byte | u8::from(sample(bit)) << (bit - 1));
        heard.push(sample(9).then_some(byte));
        at += 9.6 / ratio;
    }
    heard
}

#[test]
fn at_a_wrong_bit_rate_nothing_is_heard() {
    let mut bond = Bond::new(Role::Leads, BOARDS.declaration, &ArmSwitch::new());
    let (switch, mut bytes) = (ArmSwitch::new(), Vec::new());
    for millis in 0..20_000 {
        if let (_, Some(beat)) = bond.step(&switch, Micros::from_millis(millis)) {
            bytes.extend_from_slice(frame::of_board(0, &beat).bytes());
        }
    }
    for (ratio, is_heard) in [
        (1.0, true),
        (0.125, false),
        (0.5, false),
        (0.8, false),
        (1.25, false),
        (2.0, false),
        (8.0, false),
    ] {
        let (mut stream, mut frames) = (Stream::new(FromBoard), 0);
        for byte in sampled(&bytes, ratio) {
            match byte {
                Some(byte) => stream.receive(&[byte], Micros::ZERO, |_| frames += 1),
                None => stream.interrupt(),
            }
        }
        let counters = stream.counters();
        assert_eq!(frames, if is_heard { 4000 } else { 0 }, "{ratio}");
        assert_eq!(counters.skipped + counters.port_errors > 0, !is_heard, "{ratio} {counters:?}");
    }
}

#[test]
fn a_sound_frame_that_is_not_for_a_board_is_no_word_of_the_other() {
    let (mut stream, mut heard) = (Stream::new(FromBoard), 0);
    for byte in 0..=255 {
        let mut writer = frame::Writer::<64>::new();
        for length in 1..=12 {
            writer.body(&[byte; 12][..length]);
            stream.receive(writer.bytes(), Micros::ZERO, |_| heard += 1);
        }
    }
    // None of those begins as a board's does.
    assert_eq!(heard, 32 * 9);
}

#[test]
fn an_arm_state_has_to_leave_a_uart_within_a_millisecond_and_a_half() {
    // Alone: two of 16 bytes within a millisecond.
    for (baud, fits) in [(128_000, true), (127_999, false), (0, false)] {
        assert_eq!(is_in_time_over_uart(baud, &[], Role::Leads), fits, "{baud}");
    }
    // As the page of two boards says: frames of a board that leave at once.
    for (baud, most) in [(921_600, 7), (460_800, 3), (230_400, 1), (115_200, 0)] {
        let period = Micros::from_millis(100);
        let topics = [TopicEntry { number: 1, from: Role::Leads, period, size: 7 }; 8];
        let fits = |frames: usize| is_in_time_over_uart(baud, &topics[..frames], Role::Leads);
        assert!((fits(most) || most == 0) && !fits(most + 1), "{baud}");
    }
    // Against a line into which all comes as badly as it may.
    let mut state = 1_u64;
    let mut random = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 33) % below
    };
    let mut fit = 0;
    for _ in 0..2000 {
        let topics: Vec<_> = (1..=random(8) as u8)
            .map(|number| {
                let period = Micros::from_millis(1 + random(12));
                TopicEntry { number, from: Role::Leads, period, size: 1 + random(28) as usize }
            })
            .collect();
        let baud = 115_200 + random(1_000_000) as u32;
        let (mut waiting, mut longest) = (0.0_f64, 0.0_f64);
        for millis in 0..1000 {
            // The first one is late by all that it may be.
            if millis == 0 || (millis + 4) % 5 == 0 {
                waiting += 16.0;
            }
            for topic in &topics {
                let period = topic.period.get() / 1000;
                let early = u64::from((millis + 1) % period == 0);
                let values = if millis == 0 { 1 + u64::from(period == 1) } else { early };
                waiting += (values as usize * topic.parts() * 17) as f64;
            }
            longest = longest.max(waiting * 1e7 / f64::from(baud));
            waiting = (waiting - f64::from(baud) * 1e-4).max(0.0);
        }
        let fits = is_in_time_over_uart(baud, &topics, Role::Leads);
        assert_eq!(fits, longest <= 1500.0, "{baud} {topics:?}: {longest}");
        assert!(is_in_time_over_uart(baud.max(128_000), &topics, Role::Follows));
        fit += u32::from(fits);
    }
    assert!((500..1500).contains(&fit), "{fit}");
}

#[test]
#[should_panic(expected = "the topics do not fit on the UART of both boards")]
fn topics_that_need_more_than_a_uart_has_do_not_compile() {
    let _ = Boards::over_uart(115_200, TOPICS);
}

#[test]
fn identifiers_are_as_late_as_they_may_be() {
    // Alone on the bus: behind all.
    assert_eq!(BOARDS.first(), 0x7C0);
    // Feedback of DJI is 0x201 to 0x208, commands 0x200: the latest are still in time.
    let wheels: Vec<_> = (1..=8)
        .map(|id| Entry::new(Place::Bus(1), Config::new(&M3508, id).device()).with_label("it"))
        .collect();
    let few = Boards::new([(&wheels[..4], 1), (&[], 2)], TOPICS);
    assert_eq!(few.first(), 0x7C0);
    let on_other_bus = Boards::new([(&wheels, 2), (&[], 2)], TOPICS);
    assert_eq!(on_other_bus.first(), 0x7C0);
    let frame = few.frame(6, &[1, 2]).unwrap();
    assert_eq!(frame, CanFrame::exact(StandardId::new(0x7C6).unwrap(), [1, 2]));
    assert!(few.pattern().matches(&frame));
}

#[test]
#[should_panic(expected = "a motor of each board has the same identifier")]
fn two_boards_do_not_command_one_motor() {
    let _ = Boards::new([(&[WHEEL], 1), (&[WHEEL], 1)], TOPICS);
}

#[test]
#[should_panic(expected = "a motor of each board has the same identifier")]
fn a_frame_that_a_motor_of_the_other_board_obeys_is_one() {
    // A Damiao obeys every identifier with its own low byte: 0x201, the feedback of an M3508.
    use rc10_motor::damiao::{Config, Control, models};
    let mit = Control::Mit(M3508.cascade);
    let config = Config::new(models::J4310, 0x01, 0x31, mit).device();
    let arm = Entry::new(Place::Bus(1), config).with_label("arm");
    let _ = Boards::new([(&[WHEEL], 1), (&[arm], 1)], TOPICS);
}

#[test]
#[should_panic(expected = "at most 12 frames together")]
fn one_board_has_no_more_frames_than_the_outbox_has_room_for() {
    const MANY: [Topic<[f32; 7]>; 4] = [
        Topic::new(1, Role::Leads, Micros::from_millis(100)),
        Topic::new(2, Role::Leads, Micros::from_millis(100)),
        Topic::new(3, Role::Leads, Micros::from_millis(100)),
        Topic::new(4, Role::Leads, Micros::from_millis(100)),
    ];
    static ALL: [TopicEntry; 4] =
        [MANY[0].entry(), MANY[1].entry(), MANY[2].entry(), MANY[3].entry()];
    let _ = Boards::new([(&[], 1), (&[], 1)], &ALL);
}

#[test]
#[should_panic(expected = "the topics do not fit on the bus")]
fn a_full_bus_has_no_room_for_topics() {
    const MANY: Topic<[f32; 7]> = Topic::new(1, Role::Leads, Micros::from_millis(1));
    const MORE: Topic<[f32; 7]> = Topic::new(2, Role::Follows, Micros::from_millis(1));
    let wheels: Vec<_> = (1..=4)
        .map(|id| Entry::new(Place::Bus(1), Config::new(&M3508, id).device()).with_label("it"))
        .collect();
    let _ = Boards::new([(&wheels, 1), (&[], 1)], const { &[MANY.entry(), MORE.entry()] });
}
