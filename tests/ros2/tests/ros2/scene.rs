//! A robot in a thread, a bridge in another, a router, and a node.

use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use hiroz::Builder as _;
use hiroz::context::{ZContext, ZContextBuilder};
use hiroz::node::ZNode;
use rc10_cli::live::ros2::{Bridge, NodeArgs};
use rc10_cli::live::{RobotConnection, Source};
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_cli::run::running::Running;
use rc10_cli::run::simulation::Simulation;
use rc10_cli::{Description, Simulated, robot_for_good};
use rc10_sim::remote::{Controls, Switch};
use rc10_time::Micros;
use zenoh::Wait as _;

const BAUD: u32 = 921_600;

/// Armed, by hand; armed, by a PC; and disarmed.
pub const BY_HAND: Controls = Controls::REST;
pub const AUTO: Controls = Controls { right_switch: Switch::Up, ..Controls::REST };
pub const OFF: Controls = Controls { right_switch: Switch::Down, ..Controls::REST };

/// What is seen of a robot every millisecond.
#[derive(Clone, Debug, Default)]
pub struct Look {
    pub signals: Vec<Option<f64>>,
    /// Along x and about z, m/s and rad/s.
    pub speed: [f64; 2],
    /// How far the robot is behind the wall clock.
    pub lag: Duration,
}

type Watch = Box<dyn FnMut(&mut dyn Running, &Look) + Send>;

/// The two ends of a line, and what is done to the robot.
#[derive(Default)]
struct Ends {
    to_robot: Mutex<Vec<u8>>,
    to_pc: Mutex<Vec<u8>>,
    controls: Mutex<Controls>,
    unplugged: AtomicBool,
    restarts: AtomicBool,
    ended: AtomicBool,
    look: Mutex<Look>,
}

/// A robot that runs as fast as the wall clock.
pub struct World {
    ends: Arc<Ends>,
    thread: Option<JoinHandle<()>>,
}

/// Makes a robot anew.
pub type Make = fn() -> Box<dyn Running>;

pub fn simulated<R: Simulated>() -> Box<dyn Running> {
    Box::new(Simulation::new(robot_for_good::<R>().unwrap(), 1, Some(BAUD)).unwrap())
}

/// The program of a robot on the emulated chip, which `cargo xtask emulate` has built.
pub fn emulated<R: Simulated>(name: &str) -> Box<dyn Running> {
    let folder = std::path::PathBuf::from(std::env::var_os("RC10_FIRMWARE").unwrap());
    let program = std::fs::read(folder.with_file_name(name)).unwrap();
    let setup = Setup { seed: 1, console: Some(BAUD), ..Setup::default() };
    Box::new(Emulation::new(&program, robot_for_good::<R>().unwrap(), &setup).unwrap())
}

impl World {
    pub fn new(make: Make, mut watch: Watch) -> Self {
        let ends = Arc::new(Ends { controls: Mutex::new(OFF), ..Ends::default() });
        let (inside, step) = (Arc::clone(&ends), Micros::from_millis(1));
        let thread = thread::spawn(move || {
            while !inside.ended.load(Relaxed) {
                let mut robot = make();
                let line = robot.console().unwrap().clone();
                inside.restarts.store(false, Relaxed);
                let began = Instant::now();
                while !inside.ended.load(Relaxed) && !inside.restarts.load(Relaxed) {
                    let controls = *inside.controls.lock().unwrap();
                    robot.operator().unwrap().hold(controls, None);
                    let bytes = std::mem::take(&mut *inside.to_robot.lock().unwrap());
                    line.send(&bytes);
                    let until = robot.now() + step;
                    robot.run_to(until).unwrap();
                    let bytes = line.take();
                    if !inside.unplugged.load(Relaxed) {
                        inside.to_pc.lock().unwrap().extend(bytes);
                    }
                    let due = began + Duration::from_micros(until.get());
                    let twist = robot.base().map(|it| it.twist());
                    let look = Look {
                        signals: robot.signals(until),
                        speed: twist.map_or([0.0; 2], |it| [it.x.hypot(it.y), it.yaw]),
                        lag: Instant::now().saturating_duration_since(due),
                    };
                    watch(&mut *robot, &look);
                    *inside.look.lock().unwrap() = look;
                    thread::sleep(due.saturating_duration_since(Instant::now()));
                }
            }
        });
        Self { ends, thread: Some(thread) }
    }

    pub fn quiet(make: Make) -> Self {
        Self::new(make, Box::new(|_, _| {}))
    }

    pub fn hold(&self, controls: Controls) {
        *self.ends.controls.lock().unwrap() = controls;
    }

    pub fn look(&self) -> Look {
        self.ends.look.lock().unwrap().clone()
    }

    pub fn unplug(&self, is_unplugged: bool) {
        self.ends.unplugged.store(is_unplugged, Relaxed);
    }

    pub fn restart(&self) {
        self.ends.restarts.store(true, Relaxed);
    }

    /// Arms it by hand: the switches first as they must be.
    pub fn arm(&self) {
        self.hold(OFF);
        thread::sleep(Duration::from_millis(400));
        self.hold(BY_HAND);
        thread::sleep(Duration::from_millis(400));
    }

    pub fn connection(&self) -> RobotConnection<'static> {
        connection(Arc::clone(&self.ends))
    }

    pub fn bridge(&self, args: &NodeArgs, description: &Description) -> Runs {
        let (ends, args) = (Arc::clone(&self.ends), args.clone());
        let (estimate, yaw) = (description.estimate, description.yaw);
        let ended = Arc::new(AtomicBool::new(false));
        let is_ended = Arc::clone(&ended);
        let refused = Arc::new(Mutex::new(String::new()));
        let tell = Arc::clone(&refused);
        let thread = thread::spawn(move || {
            let mut bridge = Bridge::new(connection(ends), &args, estimate, yaw).unwrap();
            while !is_ended.load(Relaxed) {
                bridge.step().unwrap();
                *tell.lock().unwrap() = format!("{:?}", bridge.commands());
            }
        });
        Runs { ended, thread: Some(thread), commands: refused }
    }
}

impl Drop for World {
    fn drop(&mut self) {
        self.ends.ended.store(true, Relaxed);
        let _ = self.thread.take().unwrap().join();
    }
}

fn connection(ends: Arc<Ends>) -> RobotConnection<'static> {
    let source = Box::new(Line { ends, began: Instant::now() });
    RobotConnection { source, name: "the robot".into(), baud: BAUD, is_real: true }
}

/// A bridge that runs; dropped, it ends.
pub struct Runs {
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// What it says of its commands.
    pub commands: Arc<Mutex<String>>,
}

impl Drop for Runs {
    fn drop(&mut self) {
        self.ended.store(true, Relaxed);
        let result = self.thread.take().unwrap().join();
        assert!(result.is_ok() || thread::panicking());
    }
}

/// The PC's end of the line.
struct Line {
    ends: Arc<Ends>,
    began: Instant,
}

impl Source for Line {
    fn exchange(&mut self, out: &[u8]) -> anyhow::Result<(Vec<u8>, Micros)> {
        if !self.ends.unplugged.load(Relaxed) {
            self.ends.to_robot.lock().unwrap().extend(out);
        }
        let until = Instant::now() + Duration::from_millis(4);
        loop {
            let bytes = std::mem::take(&mut *self.ends.to_pc.lock().unwrap());
            let now = Instant::now();
            if !bytes.is_empty() || now >= until {
                let since = u64::try_from(self.began.elapsed().as_micros()).unwrap();
                return Ok((bytes, Micros::new(since)));
            }
            thread::sleep(Duration::from_micros(300));
        }
    }
}

/// A router; dropped, it ends.
pub struct Router {
    session: zenoh::Session,
    pub port: u16,
}

impl Router {
    pub fn new() -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        Self::at(port)
    }

    pub fn at(port: u16) -> Self {
        let mut config = zenoh::Config::default();
        for (key, value) in [
            ("mode", "\"router\"".to_owned()),
            ("listen/endpoints", format!("[\"tcp/127.0.0.1:{port}\"]")),
            ("scouting/multicast/enabled", "false".to_owned()),
        ] {
            config.insert_json5(key, &value).unwrap();
        }
        Self { session: zenoh::open(config).wait().unwrap(), port }
    }

    pub fn args(&self) -> NodeArgs {
        let router = format!("tcp/127.0.0.1:{}", self.port);
        NodeArgs { router, namespace: String::new(), domain: Some(0), rate: 50 }
    }

    /// A node of `hiroz`.
    pub fn node(&self, name: &str) -> (ZContext, ZNode) {
        let builder = ZContextBuilder::default().with_router_endpoint(self.args().router).unwrap();
        let retry = serde_json::json!({"period_init_ms": 100, "period_max_ms": 200});
        let context = builder.with_json("connect/retry", retry).with_domain_id(0).build().unwrap();
        let node = context.create_node(name).build().unwrap();
        (context, node)
    }
}

impl Drop for Router {
    fn drop(&mut self) {
        let _ = self.session.close().wait();
    }
}

/// Waits until something is so.
#[track_caller]
pub fn until(what: &str, limit: Duration, mut is_so: impl FnMut() -> bool) -> Duration {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < limit, "never: {what}");
        thread::sleep(Duration::from_millis(2));
    }
    began.elapsed()
}
