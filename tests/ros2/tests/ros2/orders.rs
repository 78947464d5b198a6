//! Robot, bridge, router and node are unplugged and restarted in any order: they are back, no stale command is executed,
//! and the first one is neutral. How many orders: `RC10_ROS2_ORDERS`.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use hiroz::Builder as _;
use hiroz::context::ZContext;
use hiroz::msg::ZMessage;
use hiroz::node::ZNode;
use hiroz::pubsub::ZPub;
use hiroz_msgs::geometry_msgs::{Twist, Vector3};
use rc10_cli::Simulated as _;
use rc10_cli::live::ros2::{Bridge, NodeArgs};
use rc10_cli::run::running::Running;

use super::scene::{AUTO, BY_HAND, Look, OFF, Router, Runs, World, simulated};

/// A node that commands, each command by a value of its own.
pub struct Node {
    _context: ZContext,
    _node: ZNode,
    pub give: ZPub<Twist, <Twist as ZMessage>::Serdes>,
}

impl Node {
    pub fn new(router: &Router) -> Self {
        let (context, node) = router.node("commander");
        let give = node.create_pub::<Twist>("/cmd_vel").build().unwrap();
        Self { _context: context, _node: node, give }
    }
}

/// What was sent, and what the robot was seen to take.
#[derive(Default)]
struct Log {
    /// Values, and when they were sent.
    sent: VecDeque<(f32, Instant)>,
    /// The value taken last; zero before the first.
    taken: f32,
    /// When one above zero was taken last.
    driven: Option<Instant>,
    /// A zero was taken since the last loss.
    had_neutral: bool,
    /// Since when there is no command.
    silent: Option<Instant>,
    oldest: Duration,
    /// How far the robot was behind the clock at most.
    behind: Duration,
    judged: u64,
    faults: Vec<String>,
}

/// The robot is not looked at while this machine has no time for it.
const BEHIND: Duration = Duration::from_millis(5);
/// Asked for; what is asserted is twice as much, which a busy PC keeps, too.
const BACK: Duration = Duration::from_secs(1);

impl Log {
    /// Looks at what the robot goes by now: the value of its first channel, if that is 50 ms old at most.
    fn look(&mut self, look: &Look) {
        self.behind = self.behind.max(look.lag);
        let value = look.signals.first().copied().flatten().map(|it| it as f32);
        let Some(value) = value else {
            // A loss for the robot is 100 ms without a command: 50 ms later than this, or 100.
            let silent = *self.silent.get_or_insert_with(Instant::now);
            self.had_neutral &= silent.elapsed() < Duration::from_millis(100);
            self.taken = f32::NAN;
            return;
        };
        self.silent = None;
        let is_new = value.to_bits() != self.taken.to_bits();
        self.taken = value;
        if value == 0.0 {
            self.had_neutral = true;
            return;
        }
        let now = Instant::now();
        self.driven = Some(now);
        if look.lag > BEHIND {
            return;
        }
        self.judged += 1;
        match self.sent.iter().rev().find(|it| it.0 == value) {
            Some((_, sent)) => {
                let age = now - *sent;
                self.oldest = self.oldest.max(age);
                // The robot's clock may be behind by as much.
                if age > Duration::from_millis(50) + 2 * BEHIND {
                    self.faults.push(format!("{value} was driven {age:?} after it was sent"));
                }
            }
            None => self.faults.push(format!("{value} was never sent")),
        }
        if is_new && !self.had_neutral {
            self.faults.push(format!("{value} was taken before a neutral one"));
        }
    }
}

/// Numbers by chance, the same in each run.
struct Chance(u64);

impl Chance {
    fn below(&mut self, most: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % most
    }
}

struct Scene {
    world: World,
    router: Option<Router>,
    port: u16,
    bridge: Option<Runs>,
    node: Option<Node>,
    log: Arc<Mutex<Log>>,
    count: u32,
}

impl Scene {
    fn new() -> Self {
        let log = Arc::new(Mutex::new(Log::default()));
        let seen = Arc::clone(&log);
        let watch = move |_: &mut dyn Running, look: &Look| seen.lock().unwrap().look(look);
        let world = World::new(simulated::<swerve::Robot>, Box::new(watch));
        let router = Router::new();
        let bridge = Some(world.bridge(&router.args(), &swerve::Robot::description()));
        let (port, node) = (router.port, Some(Node::new(&router)));
        Self { world, router: Some(router), port, bridge, node, log, count: 0 }
    }

    /// Sends a command every 20 ms for a time: some that are not neutral first, then three that are, and on.
    fn give(
        &mut self,
        time: Duration,
        mut is_enough: impl FnMut(&Log) -> bool,
    ) -> Option<Duration> {
        let began = Instant::now();
        let mut at = 0_u32;
        while began.elapsed() < time {
            if let Some(node) = &self.node {
                self.count += 1;
                let value =
                    if (4..7).contains(&(at % 10)) { 0.0 } else { 0.2 + self.count as f32 * 1e-6 };
                let mut log = self.log.lock().unwrap();
                log.sent.push_back((value, Instant::now()));
                if log.sent.len() > 500 {
                    log.sent.pop_front();
                }
                drop(log);
                let linear = Vector3 { x: value.into(), y: 0.0, z: 0.0 };
                // Without a router it goes nowhere.
                let _ = node.give.publish(&Twist { linear, angular: Vector3::default() });
                at += 1;
            }
            thread::sleep(Duration::from_millis(20));
            if is_enough(&self.log.lock().unwrap()) {
                return Some(began.elapsed());
            }
        }
        None
    }

    fn break_one(&mut self, what: u64) {
        match what {
            0 => self.world.unplug(true),
            1 => {
                self.world.hold(OFF);
                self.world.restart();
            }
            2 => self.bridge = None,
            3 => self.router = None,
            _ => self.node = None,
        }
    }

    fn mend_one(&mut self, what: u64) {
        match what {
            0 => self.world.unplug(false),
            1 => {}
            2 => {
                let args = self.args();
                self.bridge = Some(self.world.bridge(&args, &swerve::Robot::description()));
            }
            3 => self.router = Some(Router::at(self.port)),
            _ => self.node = Some(Node::new(self.router.as_ref().unwrap())),
        }
    }

    fn args(&self) -> NodeArgs {
        let router = format!("tcp/127.0.0.1:{}", self.port);
        NodeArgs { router, domain: Some(0), rate: 50, ..Default::default() }
    }
}

const NAMES: [&str; 5] = ["line", "robot", "bridge", "router", "node"];

#[test]
fn after_any_order_it_is_back_and_drives_by_no_stale_command() {
    let orders = std::env::var("RC10_ROS2_ORDERS").map_or(12, |it| it.parse::<u64>().unwrap());
    let mut scene = Scene::new();
    let (mut chance, mut times, mut slow) = (Chance(1), Vec::new(), 0);
    scene.world.arm();
    scene.world.hold(AUTO);
    assert!(scene.give(Duration::from_secs(20), |log| log.driven.is_some()).is_some());
    for order in 0..orders {
        // Some of the five, in any order, with any time between, and mended in another one.
        let mut broken: Vec<u64> = (0..5).filter(|_| chance.below(5) < 2).collect();
        if broken.is_empty() {
            broken.push(order % 5);
        }
        for at in (1..broken.len()).rev() {
            broken.swap(at, chance.below(at as u64 + 1) as usize);
        }
        for what in &broken {
            scene.break_one(*what);
            let pause = Duration::from_millis(chance.below(150));
            scene.give(pause, |_| false);
        }
        scene.give(Duration::from_millis(120 + chance.below(200)), |_| false);
        let words: Vec<_> = broken.iter().map(|it| NAMES[*it as usize]).collect();
        // The router before the node, which a node of ROS needs to begin.
        broken.sort_by_key(|what| (*what == 4, chance.below(100)));
        scene.log.lock().unwrap().behind = Duration::ZERO;
        let mut began = Instant::now();
        for what in &broken {
            began = Instant::now();
            scene.mend_one(*what);
        }
        if broken.contains(&1) {
            // Its operator arms it again: that takes its time.
            scene.give(Duration::from_millis(500), |_| false);
            scene.world.hold(BY_HAND);
            scene.give(Duration::from_millis(300), |_| false);
            scene.world.hold(AUTO);
            began = Instant::now();
        }
        scene.log.lock().unwrap().driven = None;
        let back = scene.give(Duration::from_secs(10), |log| log.driven.is_some());
        assert!(back.is_some(), "order {order}, {words:?}: never back");
        let (back, mut log) = (began.elapsed(), scene.log.lock().unwrap());
        let behind = log.behind;
        println!(
            "{order}: {words:?}: back after {} ms, the robot {} ms behind",
            back.as_millis(),
            behind.as_millis()
        );
        if back > 2 * BACK {
            log.faults.push(format!("order {order}, {words:?}: back after {back:?}"));
        }
        slow += u64::from(back > BACK && behind <= 4 * BEHIND);
        times.push(back);
    }
    let log = scene.log.lock().unwrap();
    times.sort_unstable();
    println!(
        "{orders} orders: back after {:?} at half of them, {:?} at 90 %, {:?} at 99 %, {:?} at most, {} after more than a \
         second though the robot was in time; oldest command that was driven: {:?}; {} looks",
        times[times.len() / 2],
        times[times.len() * 9 / 10],
        times[times.len() * 99 / 100],
        times.last().unwrap(),
        slow,
        log.oldest,
        log.judged
    );
    assert!(log.faults.is_empty(), "{:#?}", &log.faults[..log.faults.len().min(20)]);
    assert!(log.judged > 20 * orders);
}

/// A bridge hears its robot meanwhile.
#[test]
fn a_bridge_without_a_router_begins_at_once() {
    let world = World::quiet(simulated::<swerve::Robot>);
    let args = NodeArgs { router: "tcp/127.0.0.1:1".into(), rate: 50, ..NodeArgs::default() };
    let began = Instant::now();
    let _bridge = Bridge::new(world.connection(), &args, None, None).unwrap();
    assert!(began.elapsed() < Duration::from_millis(400), "{:?}", began.elapsed());
}
