//! `rc10 drive`: the robot's tasks in one program, its motors in another, an slcan adapter between.

#[cfg(target_os = "linux")]
mod serial;

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle, sleep};
use std::time::{Duration, Instant};

use crate::common::served::{JSON, Started, http, page_of, start, until};
use crate::interop_python::{python, script};
use rc10_cli::formats::slcan::{Adapter, Counts, Flow};
use rc10_cli::world::environment::Environment;
use rc10_cli::{Description, Simulated as _};
use rc10_sim::{EscState, Tasks};
use rc10_time::Micros;
use serde_json::{Value, json};

/// So slow that frames and the hand's words are in time on a busy machine, too.
const PACE: f64 = 0.05;

/// The team's motors on bus 1, without a robot, behind an adapter at a TCP port, in real time.
struct Motors {
    port: u16,
    seen: Arc<Mutex<(Vec<EscState>, Counts)>>,
    /// Ends it; the cable of the adapter is out; the bus is shorted.
    stop: Arc<[AtomicBool; 3]>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Motors {
    fn drop(&mut self) {
        self.stop[0].store(true, Relaxed);
        let _ = self.thread.take().unwrap().join();
    }
}

impl Motors {
    fn begin() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let (seen, stop) = (Arc::<Mutex<_>>::default(), Arc::<[AtomicBool; 3]>::default());
        let (told, end) = (Arc::clone(&seen), Arc::clone(&stop));
        let thread = Some(thread::spawn(move || run(listener, &told, &end)));
        Self { port, seen, stop, thread }
    }

    fn wheels(&self) -> Vec<EscState> {
        self.seen.lock().unwrap().0.clone()
    }

    fn counts(&self) -> Counts {
        self.seen.lock().unwrap().1
    }

    fn unplug(&self, is_out: bool) {
        self.stop[1].store(is_out, Relaxed);
    }

    fn drive(&self) -> (Started, u16) {
        drive(self.port)
    }
}

/// The team's robot, on the adapter at this port, and the port of its page.
fn drive(adapter: u16) -> (Started, u16) {
    let bus = format!("1=tcp:127.0.0.1:{adapter}");
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    command.args(["drive", "--page", "0", "--pace", &PACE.to_string(), "--bus", &bus]);
    let (drive, line) =
        start(command.env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR")), "http://");
    (drive, page_of(&line))
}

fn run(listener: TcpListener, told: &Mutex<(Vec<EscState>, Counts)>, end: &[AtomicBool; 3]) {
    let description = Description { buses: 1, ..team::Robot::description() };
    let motors = description.motors.iter().take_while(|it| it.on.to_string() == "bus 1");
    let motors = motors.cloned().collect();
    let description = Description { motors, mechanisms: Vec::new(), ..description };
    let mut around = Environment::new(&description, 1).unwrap();
    let (mut tasks, mut buffer) = (Tasks::new(), [0; 4096]);
    let mut adapter = Adapter::new(around.wires[0].clone(), Flow::Lossy(65_536), true);
    let mut client: Option<TcpStream> = None;
    let port = listener.local_addr().unwrap();
    let mut listener = Some(listener);
    let began = Instant::now();
    while !end[0].load(Relaxed) {
        around.wires[0].set_shorted(end[2].load(Relaxed));
        let now = began.elapsed().mul_f64(PACE).as_micros();
        around.run(&mut tasks, Micros::new(now.try_into().unwrap()));
        adapter.hear();
        let states = around.motors.iter().map(rc10_sim::Esc::state).collect();
        *told.lock().unwrap() = (states, adapter.counts());
        if end[1].load(Relaxed) {
            (client, listener) = (None, None);
            adapter.out().clear();
        } else if client.is_none() {
            let listener = listener.get_or_insert_with(|| TcpListener::bind(port).unwrap());
            listener.set_nonblocking(true).unwrap();
            client = listener.accept().ok().map(|(stream, _)| stream);
            client.iter().for_each(|stream| stream.set_nonblocking(true).unwrap());
        }
        if let Some(stream) = &mut client {
            match stream.read(&mut buffer) {
                Ok(0) => client = None,
                Ok(count) => {
                    for command in adapter.take(&buffer[..count]) {
                        adapter.answer(command);
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(_) => client = None,
            }
        }
        if let Some(stream) = &mut client
            && let Ok(count) = stream.write(adapter.out())
        {
            adapter.out().drain(..count);
        }
        sleep(Duration::from_micros(500));
    }
}

/// The remote in a hand: it says where its sticks are until it is dropped.
struct Hand {
    /// Left stick forward, and the right switch: in the middle it is armed, and drives in its own axes, without an IMU.
    at: Arc<Mutex<(f64, i8)>>,
    lets_go: Arc<AtomicBool>,
}

impl Drop for Hand {
    fn drop(&mut self) {
        self.lets_go.store(true, Relaxed);
    }
}

impl Hand {
    fn take(page: u16) -> Self {
        let ask = move |wish: Value| {
            let (_, body) = http(page, "POST", "/drive", JSON, &wish.to_string());
            serde_json::from_str::<Value>(&body).unwrap()
        };
        let number = ask(json!("take"))["number"].clone();
        let (at, lets_go) = (Arc::new(Mutex::new((0.0, -1))), Arc::<AtomicBool>::default());
        let (held, end) = (Arc::clone(&at), Arc::clone(&lets_go));
        thread::spawn(move || {
            for message in (1..).take_while(|_| !end.load(Relaxed)) {
                let (stick, switch) = *held.lock().unwrap();
                let told = ask(json!([number, message, 0, stick, 0, 0, 0, 0, switch, 0, 0]));
                assert_eq!(told["refused"], Value::Null);
                sleep(Duration::from_millis(10));
            }
        });
        Self { at, lets_go }
    }

    fn hold(&self, stick: f64, switch: i8) {
        *self.at.lock().unwrap() = (stick, switch);
    }
}

fn state(page: u16) -> Value {
    serde_json::from_str(&http(page, "GET", "/state", "", "").1).unwrap()
}

fn arm_state(page: u16) -> Option<u8> {
    let state = state(page);
    let signals = state["signals"].as_array()?;
    let arm = signals.iter().find(|it| it["name"] == "arm" && it["folder"] == "robot")?;
    (0..4).find(|it| arm["value"].as_f64() == Some(f64::from(*it)))
}

fn turn(motors: &Motors) -> bool {
    let wheels = motors.wheels();
    wheels.len() == 4 && wheels.iter().all(|it| it.output_rpm.abs() > 20.0)
}

fn have_no_torque(motors: &Motors) -> bool {
    motors.wheels().iter().all(|it| it.command == 0)
}

/// Takes the remote, arms and drives; also on a machine on which the page is late at times.
fn is_driven(motors: &Motors, page: u16) -> Hand {
    until("the robot knows itself", || state(page)["whole"] == true);
    let hand = Hand::take(page);
    is_driven_by(page, |stick, switch| hand.hold(stick, switch), || turn(motors));
    hand
}

/// Arms and drives with left stick and right switch, until this turns.
fn is_driven_by(page: u16, hold: impl Fn(f64, i8), turns: impl Fn() -> bool) {
    until("the wheels turn", || {
        // Its own rule: through where it disarms. It is disarmed again if a word of the hand comes too late.
        hold(0.0, -1);
        until("it is disarmed", || arm_state(page) == Some(0));
        sleep(Duration::from_secs(4));
        hold(0.0, 0);
        let comes = |is_so: &dyn Fn() -> bool| {
            (0..300).any(|_| {
                sleep(Duration::from_millis(100));
                is_so()
            })
        };
        if !comes(&|| arm_state(page) == Some(1)) {
            return false;
        }
        hold(0.5, 0);
        comes(&turns)
    });
}

#[test]
fn real_wheels_turn_by_the_page_s_remote_and_not_without_it() {
    let motors = Motors::begin();
    let (_drive, page) = motors.drive();
    until("the robot tells its state", || arm_state(page).is_some());
    // Disarmed, whatever a script would do; nothing of it can be broken from here.
    let told = state(page);
    assert_eq!((arm_state(page), &told["is_simulated"]), (Some(0), &json!(false)));
    let wish = json!({ "break": "cut:1" }).to_string();
    let (code, why) = http(page, "POST", "/wish", JSON, &wish);
    assert!(code != 200 && why.contains("broken by hand"), "{code} {why}");
    assert!(have_no_torque(&motors));

    let hand = is_driven(&motors, page);
    let let_go = Instant::now();
    drop(hand);
    until("the wheels have no torque", || have_no_torque(&motors));
    println!("let go to no torque: {} ms", let_go.elapsed().as_millis());

    // STOP, with the stick held.
    let hand = is_driven(&motors, page);
    let wish = r#"{"do":"stop"}"#;
    // The page's patience for an answer is by its own clock, and the robot's is slow here.
    until("it is stopped", || {
        let (code, _) = http(page, "POST", "/wish", JSON, wish);
        [200, 409].contains(&code) && arm_state(page) == Some(3)
    });
    until("the wheels have no torque", || have_no_torque(&motors));
    drop(hand);
}

/// A PC that stands still, as by a program that takes all of it: the robot is stopped before its next tick.
#[test]
#[cfg(unix)]
fn behind_a_pc_that_stood_still_the_robot_is_stopped() {
    let motors = Motors::begin();
    let (drive, page) = motors.drive();
    let hand = is_driven(&motors, page);
    let signal = |name: &str| {
        let _ = Command::new("kill").args([name, &drive.0.id().to_string()]).status().unwrap();
    };
    signal("-STOP");
    sleep(Duration::from_secs_f64(0.2 / PACE));
    signal("-CONT");
    until("it is stopped", || arm_state(page) == Some(3));
    until("the wheels have no torque", || have_no_torque(&motors));
    drop(hand);
}

#[test]
fn an_adapter_that_is_unplugged_is_told_and_comes_back() {
    let motors = Motors::begin();
    let (_drive, page) = motors.drive();
    let _hand = is_driven(&motors, page);
    motors.unplug(true);
    until("it is told", || {
        state(page)["trouble"].as_str().is_some_and(|it| it.starts_with("bus 1: "))
    });
    motors.unplug(false);
    let before = motors.counts().from_client;
    until("its frames come again", || motors.counts().from_client > before + 100);
    until("it is well again", || state(page)["trouble"].is_null());
    // It was armed, and its remote is in hand.
    until("the wheels turn", || turn(&motors));
}

#[test]
fn python_can_between_is_an_adapter_like_ours() {
    let Some(python) = python() else { return };
    let motors = Motors::begin();
    let mut bridge = Command::new(python);
    bridge.arg(script("bridge.py")).arg(format!("socket://127.0.0.1:{}", motors.port));
    let (_bridge, line) = start(&mut bridge, "port ");
    let (_drive, page) = drive(line["port ".len()..].trim().parse().unwrap());
    let hand = is_driven(&motors, page);
    drop(hand);
    until("the wheels have no torque", || have_no_torque(&motors));
    assert_eq!((motors.counts().malformed, motors.counts().queue_full), (0, 0));
}

#[cfg(unix)]
#[test]
fn who_ends_it_leaves_wheels_without_torque_and_who_kills_it_does_not() {
    let motors = Motors::begin();
    for signal in ["-INT", "-TERM", "-KILL"] {
        let (mut drive, page) = motors.drive();
        let _hand = is_driven(&motors, page);
        let id = drive.0.id().to_string();
        assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
        let told = drive.0.wait().unwrap();
        if signal == "-KILL" {
            // What DJI's ESCs do then nobody has published; ours go on, as the worst that may be.
            println!(
                "killed: {:?}",
                motors.wheels().iter().map(|it| it.command).collect::<Vec<_>>()
            );
            assert!(!have_no_torque(&motors));
            continue;
        }
        assert!(told.success(), "{signal}: {told}");
        until("the wheels have no torque", || have_no_torque(&motors));
        assert_eq!(motors.counts().malformed, 0);
    }
    // The next one begins disarmed, and says so to the motors.
    let (_drive, _) = motors.drive();
    until("the wheels have no torque", || have_no_torque(&motors));
}

#[test]
fn wrong_adapters_are_told() {
    let motors = Motors::begin();
    let there = format!("tcp:127.0.0.1:{}", motors.port);
    let output = |arguments: &[String]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
        command.args(["drive", "--page", "0", "--seconds", "0.3", "--pace", &PACE.to_string()]);
        command.stdout(Stdio::null());
        let output = command.args(arguments).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    for (arguments, words) in [
        (vec![], "--bus <N=ADAPTER>"),
        (vec!["--bus".into(), "/dev/ttyACM0".into()], "it is to be N=PORT, such as 1=/dev/ttyACM0"),
        (vec!["--bus=1=".into()], "it is to be N=PORT, such as 1=/dev/ttyACM0"),
        (vec![format!("--bus=4={there}")], "--bus 4: the robot has buses 1 to 3"),
        (vec![format!("--bus=0={there}")], "--bus 0: the robot has buses 1 to 3"),
        (vec![format!("--bus=1={there}"), format!("--bus=2={there}")], "one adapter for each bus"),
        (vec!["--bus=1=/dev/none".into()], "bus 1: /dev/none: there is no such port"),
        // Without SocketCAN in it, or with it and no such interface.
        #[cfg(target_os = "linux")]
        (vec!["--bus=1=can7".into()], "bus 1: can7: "),
        (vec!["--bus=1=tcp:127.0.0.1:1".into()], "bus 1: tcp:127.0.0.1:1: nothing answers there"),
    ] {
        let (code, text) = output(&arguments);
        assert!(code == Some(2) && text.contains(words), "{arguments:?}: {code:?} {text}");
    }
    let (code, text) = output(&[format!("--bus=1={there}")]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains(" frames heard, ") && text.contains(" ticks, "), "{text}");
    assert!(!text.contains("nothing took the last frames"), "{text}");
    // What the adapter has would leave when the bus is whole again.
    motors.stop[2].store(true, Relaxed);
    let (code, text) = output(&[format!("--bus=1={there}")]);
    let told = format!("bus 1: nothing took the last frames, and {there} may hold older ones");
    assert!(code == Some(0) && text.contains(&told), "{text}");
}
