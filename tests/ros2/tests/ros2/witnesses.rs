//! `hiroz` and `zenoh-ros2-sdk` read every topic and send every command.

use std::collections::BTreeMap;
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use hiroz::Builder as _;
use hiroz::parameter::{Parameter, ParameterClient, ParameterTarget, ParameterValue};
use hiroz_msgs::diagnostic_msgs::DiagnosticArray;
use hiroz_msgs::geometry_msgs::{Twist, Vector3};
use hiroz_msgs::nav_msgs::Odometry;
use hiroz_msgs::sensor_msgs::{BatteryState, Imu, JointState};
use hiroz_msgs::std_msgs::Float64;
use hiroz_msgs::std_srvs::srv::Trigger;
use hiroz_msgs::std_srvs::{TriggerRequest, TriggerResponse};
use hiroz_msgs::tf2_msgs::TFMessage;
use rc10_cli::Simulated as _;

use crate::python::{python, script};

use super::scene::{AUTO, Make, Router, World, emulated, simulated, until};

const LONG: Duration = Duration::from_secs(20);

fn twist(x: f64, turn: f64) -> Twist {
    let vector = |x, z| Vector3 { x, y: 0.0, z };
    Twist { linear: vector(x, 0.0), angular: vector(0.0, turn) }
}

/// A runtime for the clients of services.
fn wait<T>(work: impl Future<Output = T>) -> T {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    runtime.block_on(work)
}

/// The newest message of each topic.
macro_rules! hear {
    ($node:expr, $($name:ident: $Type:ty = $topic:expr;)+) => {
        $(
            let $name: Arc<Mutex<Option<$Type>>> = Arc::default();
            let _keep = $node.create_sub::<$Type>($topic).build_with_callback({
                let newest = Arc::clone(&$name);
                move |message| *newest.lock().unwrap() = Some(message)
            }).unwrap();
        )+
    };
}

/// A node of hiroz reads every topic of the swerve robot and gives every command.
fn hiroz_reads_and_commands(make: Make) {
    let (router, world) = (Router::new(), World::quiet(make));
    let bridge = world.bridge(&router.args(), &swerve::Robot::description());
    let (_context, node) = router.node("witness");
    hear!(node,
        joints: JointState = "/joint_states";
        odometry: Odometry = "/odom";
        tf: TFMessage = "/tf";
        diagnostics: DiagnosticArray = "/diagnostics";
        heading: Float64 = "/signals/odometry_heading";
    );
    until("every topic is heard", LONG, || {
        joints
            .lock()
            .unwrap()
            .as_ref()
            .is_some_and(|it| it.position.iter().all(|it| it.is_finite()))
            && odometry.lock().unwrap().is_some()
            && tf.lock().unwrap().is_some()
            && heading.lock().unwrap().is_some()
            && diagnostics
                .lock()
                .unwrap()
                .as_ref()
                .is_some_and(|it| it.status.len() == 1 + 8 + 2 + 1)
    });
    let names = joints.lock().unwrap().as_ref().unwrap().name.clone();
    assert_eq!(names.len(), 8, "{names:?}");
    world.arm();
    world.hold(AUTO);
    let give = node.create_pub::<Twist>("/cmd_vel").build().unwrap();
    // A neutral one first, then forward.
    let mut count = 0;
    let went = until("it drives", LONG, || {
        count += 1;
        give.publish(&twist(if count < 10 { 0.0 } else { 0.5 }, 0.0)).unwrap();
        thread::sleep(Duration::from_millis(18));
        world.look().speed[0] > 0.4
    });
    println!("it drove after {went:?}; {}", bridge.commands.lock().unwrap());
    until("odometry says so", LONG, || {
        give.publish(&twist(0.5, 0.0)).unwrap();
        thread::sleep(Duration::from_millis(18));
        let odometry = odometry.lock().unwrap().clone().unwrap();
        (odometry.twist.twist.linear.x - 0.5).abs() < 0.1 && odometry.pose.pose.position.x > 0.1
    });
    let joints = joints.lock().unwrap().clone().unwrap();
    assert!(joints.velocity.iter().any(|it| it.abs() > 1.0), "{joints:?}");
    until("it stands without commands", LONG, || world.look().speed[0] < 0.02);

    let client = ParameterClient::new(Arc::new(node), ParameterTarget::new("/", "rc10")).unwrap();
    let names = wait(client.list(&[] as &[&str], None)).unwrap().names;
    assert!(names.len() >= 16, "{names:?}");
    let name = names.iter().find(|it| it.ends_with("limit")).unwrap();
    let value = |value| [Parameter::new(name.clone(), ParameterValue::Double(value))];
    let set = wait(client.set(&value(4.5))).unwrap();
    assert!(set[0].successful, "{set:?}");
    let set = wait(client.set(&value(1e9))).unwrap();
    assert!(!set[0].successful && !set[0].reason.is_empty(), "{set:?}");
    assert_eq!(wait(client.get(&[name])).unwrap(), [ParameterValue::Double(4.5)]);

    let (_context, node) = router.node("asks");
    let call = |name: &str| -> TriggerResponse {
        let client = node.create_client::<Trigger>(name).build().unwrap();
        wait(client.call_with_timeout(&TriggerRequest {}, LONG)).unwrap()
    };
    let refused = call(&format!("/set_zero/{}", joints.name[0]));
    assert!(!refused.success && refused.message.contains("disarmed"), "{refused:?}");
    let done = call(&format!("/clear_fault/{}", joints.name[0]));
    println!("clear_fault: {done:?}");
    assert!(call("/disarm").success);
    let done = call(&format!("/set_zero/{}", joints.name[0]));
    assert!(done.success, "{done:?}");
    assert!(call("/stop").success);
    until("diagnostics tell the stop", LONG, || {
        let diagnostics = diagnostics.lock().unwrap().clone().unwrap();
        let robot = diagnostics.status.iter().find(|it| it.name.ends_with("robot"));
        robot.is_some_and(|it| it.message.contains("arm EStopped"))
    });
}

#[test]
fn hiroz_reads_and_commands_the_simulated_robot() {
    hiroz_reads_and_commands(simulated::<swerve::Robot>);
}

#[test]
#[ignore = "needs the firmware: RC10_FIRMWARE, as cargo xtask emulate has it"]
fn hiroz_reads_and_commands_the_emulated_robot() {
    hiroz_reads_and_commands(|| emulated::<swerve::Robot>("swerve-firmware"));
}

/// What a robot with an IMU and motors that tell their voltage has besides.
#[test]
fn imu_and_battery_are_told_where_the_robot_has_them() {
    let (router, world) = (Router::new(), World::quiet(simulated::<omni::Robot>));
    let _bridge = world.bridge(&router.args(), &omni::Robot::description());
    let (_context, node) = router.node("witness");
    hear!(node, imu: Imu = "/imu"; battery: BatteryState = "/battery";);
    until("both are heard", LONG, || {
        imu.lock().unwrap().is_some() && battery.lock().unwrap().is_some()
    });
    let battery = battery.lock().unwrap().clone().unwrap();
    assert!((20.0..30.0).contains(&battery.voltage), "{battery:?}");
}

/// A node in Python by other authors: what it hears in 6 s, and that it drives.
fn python_reads_and_commands(make: Make) {
    let Some(python) = python() else { return };
    let (router, world) = (Router::new(), World::quiet(make));
    let bridge = world.bridge(&router.args(), &swerve::Robot::description());
    let fastest = Arc::new(Mutex::new(0.0_f64));
    let mut child = Command::new(python)
        .arg(script("ros2.py"))
        .args([router.port.to_string(), env!("CARGO_TARGET_TMPDIR").to_owned()])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    world.arm();
    world.hold(AUTO);
    let until = std::time::Instant::now() + 2 * LONG;
    let status = loop {
        if std::time::Instant::now() > until {
            child.kill().unwrap();
        }
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        let speed = world.look().speed[0];
        let mut fastest = fastest.lock().unwrap();
        *fastest = fastest.max(speed);
        thread::sleep(Duration::from_millis(5));
    };
    let mut said = String::new();
    std::io::Read::read_to_string(&mut child.stdout.take().unwrap(), &mut said).unwrap();
    assert!(status.success(), "{said}");
    println!("{said}\n{}", bridge.commands.lock().unwrap());
    let heard: BTreeMap<String, serde_json::Value> = serde_json::from_str(&said).unwrap();
    for topic in
        ["/joint_states", "/odom", "/tf", "/diagnostics", "/rosout", "/signals/odometry_heading"]
    {
        let told = &heard[topic];
        assert!(told["count"].as_u64().unwrap() > 0, "{topic}: {told}");
        assert_eq!(told["same_cdr"], true, "{topic}: {told}");
        assert_eq!(told["same_hash"], true, "{topic}: {told}");
    }
    assert_eq!(heard["/joint_states"]["names"].as_array().unwrap().len(), 8);
    assert_eq!(heard["disarm"]["success"], true, "{said}");
    assert_eq!(heard["disarm"]["same_hash"], true, "{said}");
    let fastest = *fastest.lock().unwrap();
    assert!((0.3..0.7).contains(&fastest), "{fastest} m/s");
}

#[test]
fn zenoh_ros2_sdk_reads_and_commands_the_simulated_robot() {
    python_reads_and_commands(simulated::<swerve::Robot>);
}

#[test]
#[ignore = "needs the firmware: RC10_FIRMWARE, as cargo xtask emulate has it"]
fn zenoh_ros2_sdk_reads_and_commands_the_emulated_robot() {
    python_reads_and_commands(|| emulated::<swerve::Robot>("swerve-firmware"));
}
