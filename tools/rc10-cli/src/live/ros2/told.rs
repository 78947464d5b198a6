//! What a robot tells, as messages.

use std::collections::{BTreeMap, HashMap};

use anyhow::Result;
use hiroz::node::ZNode;
use hiroz_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue};
use hiroz_msgs::geometry_msgs::{Point, Quaternion, Transform, TransformStamped, Twist, Vector3};
use hiroz_msgs::nav_msgs::Odometry;
use hiroz_msgs::sensor_msgs::{BatteryState, Imu, JointState};
use hiroz_msgs::std_msgs::{Float64, Header};
use hiroz_msgs::tf2_msgs::TFMessage;
use rc10_time::Micros;

use super::node::{Log, Outbox, Publisher, ros_name, stamp};
use crate::live::client::{Client, Sample, Signal};
use crate::robot::description::PoseSignals;

/// Levels of a status.
const OK: u8 = 0;
const WARN: u8 = 1;
const ERROR: u8 = 2;

/// Severities of a log.
pub const INFO: u8 = 20;
pub const WARNING: u8 = 30;

/// All that a robot tells.
pub struct Told {
    signals: Vec<(u16, Signal)>,
    values: HashMap<u16, f32>,
    joints: Vec<Joint>,
    pose: Option<[u16; 3]>,
    pose_is_in_degrees: bool,
    yaw: Option<(u16, bool)>,
    own: Vec<(u16, Publisher<Float64>)>,
    /// The pose before, and when.
    before: Option<(Micros, [f64; 3])>,
    at: Micros,
    frames: [String; 2],
    topics: Topics,
    /// States that are told when they change, by what they are of.
    states: BTreeMap<String, String>,
    /// Messages that had no room.
    pub lost: u64,
}

struct Joint {
    name: String,
    /// Angle, speed, torque, voltage.
    signals: [Option<u16>; 4],
}

struct Topics {
    joints: Publisher<JointState>,
    odometry: Option<(Publisher<Odometry>, Publisher<TFMessage>)>,
    imu: Option<Publisher<Imu>>,
    battery: Publisher<BatteryState>,
    diagnostics: Publisher<DiagnosticArray>,
    log: Publisher<Log>,
}

impl Told {
    /// Begins to publish what a robot tells that has described itself.
    pub fn new(
        client: &Client,
        (node, outbox, namespace): (&ZNode, &Outbox, &str),
        estimate: Option<PoseSignals>,
        yaw: Option<&str>,
    ) -> Result<Self> {
        let signals: Vec<_> = client.signals().map(|(at, it)| (at, it.clone())).collect();
        let find = |folder: &str, label: &str, name: &str| {
            let is_it = |(_, it): &&(u16, Signal)| {
                (it.folder.as_str(), it.label.as_str(), it.name.as_str()) == (folder, label, name)
            };
            signals.iter().find(is_it)
        };
        let number = |label: &str, name: &str| find("motors", label, name).map(|it| it.0);
        let mut labels: Vec<_> = signals.iter().filter(|(_, it)| it.folder == "motors").collect();
        labels.dedup_by_key(|(_, it)| it.label.clone());
        let joints = labels.iter().map(|(_, it)| Joint {
            name: ros_name(&it.label),
            signals: ["total_angle", "speed", "torque", "supply"]
                .map(|name| number(&it.label, name)),
        });
        let own_signal = |label: &str| find("signals", label, "value");
        let pose = estimate.map(|labels| labels.map(own_signal));
        let pose_is_in_degrees = pose.is_some_and(|it| it[2].is_some_and(|it| it.1.unit != "rad"));
        let pose = pose.and_then(|[x, y, turn]| Some([x?.0, y?.0, turn?.0]));
        let yaw = yaw.and_then(own_signal).map(|(at, it)| (*at, it.unit != "rad"));
        let own = signals.iter().filter(|(_, it)| it.folder == "signals");
        let own = own.map(|(at, it)| {
            let topic = format!("signals/{}", ros_name(&it.label));
            Ok((*at, Publisher::new(node, &topic, outbox)?))
        });
        let odometry = match pose {
            Some(_) => {
                Some((Publisher::new(node, "odom", outbox)?, Publisher::new(node, "/tf", outbox)?))
            }
            None => None,
        };
        let imu = yaw.map(|_| Publisher::new(node, "imu", outbox)).transpose()?;
        let topics = Topics {
            joints: Publisher::new(node, "joint_states", outbox)?,
            odometry,
            imu,
            battery: Publisher::new(node, "battery", outbox)?,
            diagnostics: Publisher::new(node, "/diagnostics", outbox)?,
            log: Publisher::new(node, "/rosout", outbox)?,
        };
        let before = if namespace.is_empty() { String::new() } else { format!("{namespace}/") };
        Ok(Self {
            joints: joints.collect(),
            own: own.collect::<Result<_>>()?,
            signals,
            values: HashMap::new(),
            pose,
            pose_is_in_degrees,
            yaw,
            before: None,
            at: Micros::ZERO,
            frames: ["odom", "base_link"].map(|it| format!("{before}{it}")),
            topics,
            states: BTreeMap::new(),
            lost: 0,
        })
    }

    /// Takes a sample; tells states that have changed since.
    pub fn take(&mut self, sample: &Sample) {
        self.at = sample.at;
        self.values.extend(sample.values.iter().copied());
    }

    /// Forgets what was told, of a robot that is not there.
    pub fn forget(&mut self) {
        self.values.clear();
        self.before = None;
    }

    fn value(&self, signal: Option<u16>) -> f64 {
        signal.and_then(|it| self.values.get(&it)).map_or(f64::NAN, |it| f64::from(*it))
    }

    fn header(&self, frame: usize) -> Header {
        Header { stamp: stamp(), frame_id: self.frames[frame].clone() }
    }

    fn count(&mut self, is_sent: bool) {
        self.lost += u64::from(!is_sent);
    }

    /// Publishes the joints, the odometry, the IMU and the robot's own signals.
    pub fn publish(&mut self) {
        if self.values.is_empty() {
            return;
        }
        let of = |at: usize, scale: f64| {
            self.joints.iter().map(|it| self.value(it.signals[at]) * scale).collect()
        };
        let joints = JointState {
            header: Header { stamp: stamp(), frame_id: String::new() },
            name: self.joints.iter().map(|it| it.name.clone()).collect(),
            position: of(0, 1_f64.to_radians()),
            velocity: of(1, std::f64::consts::TAU / 60.0),
            effort: of(2, 1.0),
        };
        let mut is_sent = vec![self.topics.joints.publish(joints)];
        is_sent.extend(self.odometry());
        if let (Some(imu), Some((signal, in_degrees))) = (&self.topics.imu, self.yaw) {
            let yaw = self.value(Some(signal));
            if yaw.is_finite() {
                let mut unknown = [0.0; 9];
                // As its documentation says of what is not measured.
                unknown[0] = -1.0;
                is_sent.push(imu.publish(Imu {
                    header: self.header(1),
                    orientation: turned(if in_degrees { yaw.to_radians() } else { yaw }),
                    angular_velocity_covariance: unknown,
                    linear_acceleration_covariance: unknown,
                    ..Imu::default()
                }));
            }
        }
        for (signal, publisher) in &self.own {
            is_sent.push(publisher.publish(Float64 { data: self.value(Some(*signal)) }));
        }
        is_sent.into_iter().for_each(|it| self.count(it));
    }

    fn odometry(&mut self) -> Vec<bool> {
        let (Some(signals), Some((odometry, tf))) = (self.pose, &self.topics.odometry) else {
            return Vec::new();
        };
        let [x, y, turn] = signals.map(|it| self.value(Some(it)));
        let turn = if self.pose_is_in_degrees { turn.to_radians() } else { turn };
        if !(x + y + turn).is_finite() {
            self.before = None;
            return Vec::new();
        }
        let mut twist = Twist::default();
        if let Some((at, [was_x, was_y, was_turned])) = self.before
            && self.at > at
        {
            let dt = self.at.since(at).get() as f64 * 1e-6;
            let (dx, dy, (sin, cos)) = (x - was_x, y - was_y, turn.sin_cos());
            twist.linear.x = (cos * dx + sin * dy) / dt;
            twist.linear.y = (cos * dy - sin * dx) / dt;
            twist.angular.z = (turn - was_turned) / dt;
        }
        let mut message = Odometry {
            header: self.header(0),
            child_frame_id: self.frames[1].clone(),
            ..Odometry::default()
        };
        message.pose.pose.position = Point { x, y, z: 0.0 };
        message.pose.pose.orientation = turned(turn);
        message.twist.twist = twist;
        let transform = TransformStamped {
            header: message.header.clone(),
            child_frame_id: self.frames[1].clone(),
            transform: Transform { translation: Vector3 { x, y, z: 0.0 }, rotation: turned(turn) },
        };
        let is_sent =
            vec![odometry.publish(message), tf.publish(TFMessage { transforms: vec![transform] })];
        self.before = Some((self.at, [x, y, turn]));
        is_sent
    }

    /// Publishes the battery and the diagnostics, with those of the bridge itself.
    pub fn publish_state(&mut self, bridge: DiagnosticStatus) {
        let supplies = self.joints.iter().map(|it| self.value(it.signals[3]));
        let voltage = supplies.filter(|it| it.is_finite()).fold(f64::NAN, f64::max);
        if voltage.is_finite() {
            let unknown = f32::NAN;
            let is_sent = self.topics.battery.publish(BatteryState {
                header: Header { stamp: stamp(), frame_id: String::new() },
                voltage: voltage as f32,
                temperature: unknown,
                current: unknown,
                charge: unknown,
                capacity: unknown,
                design_capacity: unknown,
                percentage: unknown,
                present: true,
                ..BatteryState::default()
            });
            self.count(is_sent);
        }
        let mut status = vec![bridge];
        if !self.values.is_empty() {
            status.extend(self.statuses());
        }
        let header = Header { stamp: stamp(), frame_id: String::new() };
        let is_sent = self.topics.diagnostics.publish(DiagnosticArray { header, status });
        self.count(is_sent);
    }

    /// One of each motor, bus and line, and of the robot: its states as a message, all its numbers as values.
    fn statuses(&self) -> Vec<DiagnosticStatus> {
        let mut all: BTreeMap<String, DiagnosticStatus> = BTreeMap::new();
        for (at, signal) in self.signals.iter().filter(|(_, it)| it.folder != "signals") {
            let name = match signal.label.as_str() {
                "" => signal.folder.clone(),
                label => format!("{}/{}", signal.folder, ros_name(label)),
            };
            let status = all.entry(name.clone()).or_insert_with(|| DiagnosticStatus {
                name: format!("{}: {name}", self.frames[1].trim_end_matches("base_link")),
                ..DiagnosticStatus::default()
            });
            let value = self.value(Some(*at));
            let text = text_of(signal, value);
            let level = match (signal.folder.as_str(), signal.name.as_str()) {
                ("motors", "link") if text != "Online" => ERROR,
                ("motors", "fault") if value.is_finite() => ERROR,
                ("buses", "state") if text != "active" => WARN,
                ("robot", "arm") if text == "EStopped" => WARN,
                _ => OK,
            };
            status.level = status.level.max(level);
            if matches!(
                signal.name.as_str(),
                "link" | "drive" | "condition" | "state" | "arm" | "remote"
            ) {
                let before = if status.message.is_empty() { "" } else { ", " };
                status.message += &format!("{before}{} {text}", signal.name);
            }
            status.values.push(KeyValue { key: signal.name.clone(), value: text });
        }
        all.into_values().collect()
    }

    /// The states that have changed since the last look, in words: what happens.
    pub fn events(&mut self) -> Vec<(u8, String)> {
        let mut events = Vec::new();
        for (at, signal) in &self.signals {
            let is_told = match signal.folder.as_str() {
                "motors" => matches!(signal.name.as_str(), "link" | "fault"),
                "robot" => matches!(signal.name.as_str(), "arm" | "remote"),
                "signals" => !signal.states.is_empty(),
                _ => signal.name == "state",
            };
            let Some(value) = self.values.get(at).filter(|_| is_told) else { continue };
            let text = text_of(signal, f64::from(*value));
            let what = format!("{} {}", signal.label, signal.name).trim().to_owned();
            let before = self.states.insert(what.clone(), text.clone());
            if before.is_some_and(|before| before != text) {
                let is_bad = signal.name == "fault"
                    || ["Lost", "Interrupted", "EStopped"].contains(&text.as_str());
                events.push((if is_bad { WARNING } else { INFO }, format!("{what}: {text}")));
            }
        }
        events
    }

    /// Publishes a line of the log.
    pub fn log(&mut self, level: u8, text: &str) {
        let is_sent = self.topics.log.publish(Log {
            stamp: stamp(),
            level,
            name: self.frames[1].replace("base_link", "rc10").replace('/', "."),
            msg: text.to_owned(),
            ..Log::default()
        });
        self.count(is_sent);
    }
}

/// The name of a state, or the number.
fn text_of(signal: &Signal, value: f64) -> String {
    let state = if value >= 0.0 { signal.states.get(value as usize) } else { None };
    state.cloned().unwrap_or_else(|| format!("{value}"))
}

/// Turned about the vertical, rad.
fn turned(yaw: f64) -> Quaternion {
    let (z, w) = (0.5 * yaw).sin_cos();
    Quaternion { x: 0.0, y: 0.0, z, w }
}
