//! From a node's message to the frame on the wire, in the simulator: `RC10_ROS2_LATENCY` says how often.

use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use hiroz_msgs::geometry_msgs::{Twist, Vector3};
use rc10_cli::Simulated as _;
use rc10_cli::run::running::Running;

use super::orders::Node;
use super::scene::{AUTO, Look, Router, World, simulated, until};

/// A current of a drive, raw: at rest it is far below, and at the start of a motion far above.
const MOVES: u16 = 400;

#[test]
fn from_a_message_to_the_frame_on_the_wire() {
    let times = std::env::var("RC10_ROS2_LATENCY").map_or(10, |it| it.parse::<usize>().unwrap());
    let moved: Arc<Mutex<Option<Instant>>> = Arc::default();
    let seen = Arc::clone(&moved);
    let watch = move |robot: &mut dyn Running, look: &Look| {
        let frames = robot.take_frames().into_iter().flatten().filter(|it| it.from_controller);
        let lanes = |bytes: &[u8]| {
            bytes.as_chunks::<2>().0.iter().map(|it| i16::from_be_bytes(*it).unsigned_abs()).max()
        };
        // The drives' currents: one frame of four.
        let currents = frames.filter(|it| it.frame.key() == 0x200);
        if currents.filter_map(|it| lanes(it.frame.bytes())).max() > Some(MOVES) {
            seen.lock().unwrap().get_or_insert(Instant::now() - look.lag);
        }
    };
    let router = Router::new();
    let world = World::new(simulated::<swerve::Robot>, Box::new(watch));
    let _bridge = world.bridge(&router.args(), &swerve::Robot::description());
    let node = Node::new(&router);
    let give = |x: f64| {
        let linear = Vector3 { x, ..Vector3::default() };
        node.give.publish(&Twist { linear, angular: Vector3::default() }).unwrap();
    };
    world.arm();
    world.hold(AUTO);
    let mut latencies = Vec::new();
    for round in 0..times {
        until("it stands", Duration::from_secs(10), || {
            give(0.0);
            thread::sleep(Duration::from_millis(15));
            *moved.lock().unwrap() = None;
            // Longer than a current lasts.
            (0..4).for_each(|_| {
                give(0.0);
                thread::sleep(Duration::from_millis(20));
            });
            world.look().speed[0] < 0.01 && moved.lock().unwrap().is_none()
        });
        // Any phase of the robot's ticks.
        thread::sleep(Duration::from_micros(137 * (round as u64 % 97)));
        let sent = Instant::now();
        give(1.0);
        until("a frame", Duration::from_secs(1), || moved.lock().unwrap().is_some());
        latencies.push(moved.lock().unwrap().unwrap().saturating_duration_since(sent));
    }
    latencies.sort_unstable();
    let share = |share: usize| latencies[(latencies.len() * share / 100).min(latencies.len() - 1)];
    println!(
        "{times} messages: {:?} at least, half within {:?}, 90 % within {:?}, 99 % within {:?}, {:?} at most",
        latencies[0],
        share(50),
        share(90),
        share(99),
        latencies.last().unwrap()
    );
    assert!(share(50) < Duration::from_millis(50), "{latencies:?}");
}
