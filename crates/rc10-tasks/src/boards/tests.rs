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
}

impl Scene {
    fn new() -> Self {
        let switches = [ArmSwitch::new(), ArmSwitch::new()];
        let bonds = [Role::Leads, Role::Follows];
        let bonds = [0, 1].map(|it| Bond::new(bonds[it], BOARDS.declaration, &switches[it]));
        let (now, links) = (Micros::from_millis(1000), [Link::Lost; 2]);
        Self { switches, bonds, links, now, is_whole: true, on_wire: Vec::new() }
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
                self.bonds[1 - from].hear(from as u8, &bytes, self.now);
            }
            for board in 0..2 {
                let (link, beat) = self.bonds[board].step(&self.switches[board], self.now);
                self.links[board] = link;
                self.on_wire.extend(beat.filter(|_| self.is_whole).map(|beat| (board, beat)));
            }
        }
        self.states()
    }

    fn states(&self) -> [ArmState; 2] {
        [0, 1].map(|it| self.switches[it].state())
    }

    fn armed() -> Self {
        let mut scene = Self::new();
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
    for _ in 0..2000 {
        let (mut scene, mut acts) = (Scene::armed(), Vec::new());
        for _ in 0..12 {
            acts.push(random(8));
            match acts[acts.len() - 1] {
                0 => scene.switches[0].disarm(),
                1 => drop(scene.switches[0].arm()),
                2 => scene.switches[0].emergency_stop(),
                3 => scene.switches[1].emergency_stop(),
                4 => scene.reset(),
                5 => scene.is_whole = !scene.is_whole,
                6 => scene.restart(random(2) as usize),
                _ => scene.switches[0].suspend(),
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
    // But behind a silence numbers begin anew, and what was known stays.
    heard.start(Micros::new(u64::MAX), period);
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
