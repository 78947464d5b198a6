//! `rc10 ros2` begins before its robot is plugged in.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use crate::scratch::Scratch;

use super::scene::{Router, until};

/// A program that ends with the test.
struct Started(Child);

impl Drop for Started {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A bridge to this port, and what it says.
fn bridge(router: &Router, folder: &Scratch, port: &str) -> (Started, Arc<Mutex<Vec<String>>>) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_ros2"))
        .args(["ros2", "--domain", "0", "--router", &router.args().router, "--port", port])
        // Robots that run on this PC are others'.
        .env("XDG_RUNTIME_DIR", folder.join(""))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let said: Arc<Mutex<Vec<String>>> = Arc::default();
    let hears = Arc::clone(&said);
    thread::spawn(move || {
        lines.map_while(Result::ok).for_each(|it| hears.lock().unwrap().push(it));
    });
    (Started(child), said)
}

fn count(said: &Mutex<Vec<String>>, text: &str) -> usize {
    said.lock().unwrap().iter().filter(|it| it.contains(text)).count()
}

const LONG: Duration = Duration::from_secs(20);

#[test]
fn a_robot_that_is_plugged_in_later_is_waited_for() {
    let (router, folder) = (Router::new(), Scratch::new("ros2-late"));
    let link = folder.join("console");
    let (_bridge, said) = bridge(&router, &folder, link.to_str().unwrap());
    until("it waits", LONG, || count(&said, "there is no such port; it is waited for") == 1);
    // Some attempts.
    thread::sleep(Duration::from_millis(500));
    let mut robot = Command::new(env!("CARGO_BIN_EXE_ros2"));
    robot.args(["pty", "--console", "--link"]).arg(&link).stdout(Stdio::null());
    let _robot = Started(robot.spawn().unwrap());
    until("it is there", LONG, || count(&said, "described itself; it takes commands") == 1);
    assert_eq!(count(&said, "no such port"), 1, "{said:?}");
    // A serial server that is not there yet either.
    let (_bridge, said) = bridge(&router, &folder, "tcp:127.0.0.1:1");
    until("it waits", LONG, || count(&said, "; it is waited for") == 1);
}

#[test]
fn a_simulated_robot_that_begins_later_is_waited_for() {
    let (router, folder) = (Router::new(), Scratch::new("ros2-late-sim"));
    let (_bridge, said) = bridge(&router, &folder, "sim");
    until("it waits", LONG, || count(&said, "`sim` runs on this PC; it is waited for") == 1);
    let mut robot = Command::new(env!("CARGO_BIN_EXE_ros2"));
    robot.args(["live", "--sim", "--page", "0"]).env("XDG_RUNTIME_DIR", folder.join(""));
    let _robot = Started(robot.stdout(Stdio::null()).spawn().unwrap());
    until("it is there", LONG, || count(&said, "described itself; it takes commands") == 1);
    assert_eq!(count(&said, "waited for"), 1, "{said:?}");
}

#[test]
fn a_name_that_no_port_has_is_an_error() {
    let (router, folder) = (Router::new(), Scratch::new("ros2-name"));
    for (port, why) in [
        ("ttyUSB0", "none has such a name"),
        ("sim:page", "none has such a name"),
        ("tcp:127.0.0.1", "HOST:PORT"),
    ] {
        let (mut bridge, said) = bridge(&router, &folder, port);
        until(port, LONG, || bridge.0.try_wait().unwrap().is_some_and(|it| !it.success()));
        until(port, LONG, || count(&said, why) == 1);
    }
}
