//! `rc10 drive` at serial ports: an RS-485 line, a receiver; pseudo-terminals, and simulated devices behind them.

use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle, sleep};
use std::time::{Duration, Instant};

use rc10_cli::formats::slcan::{Adapter, Flow};
use rc10_cli::robot::remote::{Receiver, ReceiverPort, ReceiverWire, mixer};
use rc10_cli::world::environment::Environment;
use rc10_cli::{CommandLine, Simulated as _};
use rc10_sim::remote::{Controls, Remote, Stick, Switch};
use rc10_sim::{EscState, Tasks, World};
use rc10_time::Micros;
use rustix::io::ioctl_fionbio;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use serde_json::{Value, json};

use super::{
    Hand, Motors, PACE, arm_state, have_no_torque, is_driven_by, state, turn as wheels_turn,
};
use crate::common::served::{JSON, Started, http, page_of, start, until};

/// Two legs on a line and a wheel on a bus; the left stick turns all.
mod legs {
    use rc10::motor::unitree::{GoM8010, LineConfig};
    use rc10::prelude::*;
    use rc10::sim::prelude::*;

    rc10::robot! {
        board Legs;
        line rs485 at 4_000_000, replies in Micros::new(200);
        motors {
            Left: GoM8010 = Entry::new(Line(1), LineConfig::new(0)),
            Right: GoM8010 = Entry::new(Line(1), LineConfig::new(1)),
            Wheel: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
        }
    }

    impl Program for Robot {
        async fn run(shared: &Shared<'_>) -> ! {
            let (mut arming, mut every) = (Arming::of::<Self>(), Every::millis(10));
            loop {
                every.next().await;
                if let Some(remote) = shared.obey(&mut arming) {
                    let speed = Target::Speed(Rpm::new(remote.left.y * 100.0));
                    Name::ALL.iter().for_each(|name| shared.command(*name, speed));
                }
            }
        }
    }

    impl Simulated for Robot {
        fn description() -> Description {
            Description {
                remote: Some(RemoteControl::of::<Self>(&[], None)),
                ..Description::of_program::<Self>(|_| Plant::inertia(0.01))
            }
        }
    }
}

/// No test by itself: the program of that robot, as the tests below start it.
#[test]
fn the_program_of_the_legs() {
    let Ok(arguments) = std::env::var("RC10_LEGS") else { return };
    let ports = legs::Ports::new();
    let (shared, mut motors) = (legs::Shared::new(&ports), legs::Motors::new());
    let robot = rc10_cli::robot_of::<legs::Robot>(&shared, &mut motors).unwrap();
    let command = CommandLine::parse(["legs"].into_iter().chain(arguments.split(' ')));
    let done = command.and_then(|it| it.run_to(robot, &mut std::io::stdout()));
    if let Err(why) = &done {
        eprintln!("rc10: {why:#}");
    }
    std::process::exit(done.map_or(2, i32::from));
}

fn drive_legs(arguments: &[&str]) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "drive::serial::the_program_of_the_legs", "--nocapture"]);
    let pace = PACE.to_string();
    let all = [&["drive", "--page", "0", "--pace", &pace], arguments].concat();
    command.env("RC10_LEGS", all.join(" ")).env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR"));
    command
}

fn begin(command: &mut Command) -> (Started, u16) {
    let (drive, line) =
        start(command.env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR")), "http://");
    (drive, page_of(&line))
}

/// A serial port of this PC, and what is behind it, in a thread of its own.
struct Cable {
    path: PathBuf,
    /// Ends it; the cable is out.
    stop: Arc<[AtomicBool; 2]>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.stop[0].store(true, Relaxed);
        let _ = self.thread.take().unwrap().join();
        let _ = fs::remove_file(&self.path);
    }
}

impl Cable {
    /// What is behind it gets the time and what came, and says something.
    fn begin<B: FnMut(Micros, &[u8]) -> Vec<u8>>(
        name: &str,
        make: impl FnOnce() -> B + Send + 'static,
    ) -> Self {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("drive-{name}"));
        let _ = fs::remove_file(&path);
        let stop = Arc::<[AtomicBool; 2]>::default();
        let (end, place) = (Arc::clone(&stop), path.clone());
        let thread = Some(thread::spawn(move || {
            let (mut behind, mut buffer) = (make(), [0; 4096]);
            let mut port: Option<File> = None;
            let began = Instant::now();
            while !end[0].load(Relaxed) {
                if end[1].load(Relaxed) {
                    if port.take().is_some() {
                        fs::remove_file(&place).unwrap();
                    }
                } else if port.is_none() {
                    // No program that is started meanwhile keeps it.
                    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
                    let ours = openpt(flags).unwrap();
                    grantpt(&ours).and_then(|()| unlockpt(&ours)).unwrap();
                    ioctl_fionbio(&ours, true).unwrap();
                    symlink(ptsname(&ours, []).unwrap().to_str().unwrap(), &place).unwrap();
                    port = Some(ours.into());
                }
                let heard = port.as_mut().and_then(|it| it.read(&mut buffer).ok()).unwrap_or(0);
                let now = began.elapsed().mul_f64(PACE).as_micros();
                let said = behind(Micros::new(now.try_into().unwrap()), &buffer[..heard]);
                if let Some(port) = &mut port {
                    // Without a program at the other end it is lost.
                    let _ = port.write_all(&said);
                }
                sleep(Duration::from_micros(500));
            }
        }));
        until("the port is there", || path.exists());
        Self { path, stop, thread }
    }

    fn unplug(&self, is_out: bool) {
        self.stop[1].store(is_out, Relaxed);
    }

    fn place(&self, what: &str) -> String {
        format!("{what}={}", self.path.display())
    }
}

type Seen = Arc<Mutex<Vec<EscState>>>;

/// The legs behind an adapter that keeps what it hears for some time.
fn line(name: &str, keeps: Micros) -> (Cable, Seen) {
    let seen = Seen::default();
    let told = Arc::clone(&seen);
    let cable = Cable::begin(name, move || {
        let mut around = Environment::new(&legs::Robot::description(), 1).unwrap();
        let (mut port, mut tasks) = (around.lines[0].port(), Tasks::new());
        let mut kept = VecDeque::new();
        move |now, heard: &[u8]| {
            port.send(heard);
            around.run(&mut tasks, now);
            *told.lock().unwrap() = around.motors[..2].iter().map(rc10_sim::Esc::state).collect();
            kept.extend(port.take_received().into_iter().map(|byte| (now + keeps, byte)));
            let due = kept.iter().take_while(|(at, _)| *at <= now).count();
            kept.drain(..due).map(|(_, byte)| byte).collect()
        }
    });
    (cable, seen)
}

/// The wheel behind an adapter for its bus.
fn wheel(name: &str) -> (Cable, Seen) {
    let seen = Seen::default();
    let told = Arc::clone(&seen);
    let cable = Cable::begin(name, move || {
        let mut around = Environment::new(&legs::Robot::description(), 1).unwrap();
        let mut adapter = Adapter::new(around.wires[0].clone(), Flow::Lossy(65_536), true);
        let mut tasks = Tasks::new();
        move |now, heard: &[u8]| {
            around.run(&mut tasks, now);
            adapter.hear();
            *told.lock().unwrap() = vec![around.motors[2].state()];
            for command in adapter.take(heard) {
                adapter.answer(command);
            }
            adapter.out().drain(..).collect()
        }
    });
    (cable, seen)
}

fn legs_turn(seen: &Seen) -> bool {
    let legs = seen.lock().unwrap();
    legs.len() == 2 && legs.iter().all(|it| it.output_rpm > 20.0)
}

fn legs_stand(seen: &Seen) -> bool {
    let legs = seen.lock().unwrap();
    legs.len() == 2 && legs.iter().all(|it| it.output_rpm.abs() < 1.0)
}

fn trouble(page: u16, with: &str) -> bool {
    state(page)["trouble"].as_str().is_some_and(|it| it.starts_with(with))
}

#[test]
fn legs_on_a_real_line_turn_are_unplugged_and_come_back_and_a_bus_beside_goes_on() {
    let (cable, legs) = line("legs", Micros::ZERO);
    let wheel = Motors::begin();
    let bus = format!("1=tcp:127.0.0.1:{}", wheel.port);
    let begin = || begin(&mut drive_legs(&["--bus", &bus, "--line", &cable.place("1")]));
    let wheel_turns = || wheel.wheels().first().is_some_and(|it| it.output_rpm > 20.0);

    let (mut drive, page) = begin();
    until("the robot knows itself", || state(page)["whole"] == true);
    until("the robot tells its state", || arm_state(page) == Some(0));
    until("the legs stand", || legs_stand(&legs));
    let hand = Hand::take(page);
    let hold = |stick, switch| hand.hold(stick, switch);
    is_driven_by(page, hold, || legs_turn(&legs) && wheel_turns());

    // Without its cable a leg locks by itself; the wheel goes on.
    cable.unplug(true);
    until("it is told", || trouble(page, "line 1: "));
    until("the legs stand", || legs_stand(&legs));
    for _ in 0..50 {
        assert!(legs_stand(&legs) && wheel_turns());
        sleep(Duration::from_millis(100));
    }
    cable.unplug(false);
    until("it is well again", || state(page)["trouble"].is_null());
    until("the legs turn", || legs_turn(&legs));

    drop(hand);
    until("the legs stand", || legs_stand(&legs));
    let hand = Hand::take(page);
    is_driven_by(page, |stick, switch| hand.hold(stick, switch), || legs_turn(&legs));
    // What a real leg does then is not published.
    drive.0.kill().unwrap();
    until("the legs stand", || legs_stand(&legs));
    drop(hand);

    let (_drive, page) = begin();
    until("the robot tells its state", || arm_state(page) == Some(0));
    sleep(Duration::from_secs(2));
    assert!(legs_stand(&legs));
}

#[test]
fn adapters_that_were_gone_at_once_come_back_to_a_disarmed_robot() {
    let ((line, legs), (bus, wheel)) = (line("mixed-line", Micros::ZERO), wheel("mixed-bus"));
    let (_drive, page) =
        begin(&mut drive_legs(&["--bus", &bus.place("1"), "--line", &line.place("1")]));
    let wheel_turns = || wheel.lock().unwrap().iter().any(|it| it.output_rpm > 20.0);
    let has_torque = || wheel.lock().unwrap().iter().any(|it| it.command != 0);
    let all_turn = || legs_turn(&legs) && wheel_turns();
    until("the robot knows itself", || state(page)["whole"] == true);
    until("the robot tells its state", || arm_state(page) == Some(0));
    let hand = Hand::take(page);
    let hold = |stick, switch| hand.hold(stick, switch);

    // One alone comes back as itself.
    is_driven_by(page, hold, all_turn);
    for (cable, its) in [(&line, "line 1: "), (&bus, "bus 1: ")] {
        cable.unplug(true);
        until("it is told", || trouble(page, its));
        cable.unplug(false);
        until("it is well again", || state(page)["trouble"].is_null());
        until("all turn", all_turn);
    }

    line.unplug(true);
    until("it is told", || trouble(page, "line 1: "));
    bus.unplug(true);
    until("it is told", || trouble(page, "bus 1: "));
    assert_eq!(arm_state(page), Some(1));
    let is_disarmed = || {
        until("it is disarmed", || arm_state(page) == Some(0));
        // The wheel coasts.
        until("it has no torque", || !has_torque());
        for _ in 0..20 {
            assert!(arm_state(page) == Some(0) && !has_torque() && !legs_turn(&legs));
            sleep(Duration::from_millis(100));
        }
    };
    // Each of them, also if a hand has armed in between.
    bus.unplug(false);
    is_disarmed();
    is_driven_by(page, hold, wheel_turns);
    line.unplug(false);
    is_disarmed();
    assert_eq!(state(page)["trouble"], Value::Null);
    is_driven_by(page, hold, all_turn);
}

#[test]
fn how_long_an_adapter_keeps_bytes_decides_how_often_a_leg_is_commanded() {
    let runs = [0, 2, 16].map(|keeps| {
        thread::spawn(move || {
            let (cable, _) = line(&format!("kept-{keeps}"), Micros::from_millis(keeps));
            let mut command = drive_legs(&["--line", &cable.place("1"), "--seconds", "1"]);
            let output = command.stdout(Stdio::null()).output().unwrap();
            let text = String::from_utf8(output.stderr).unwrap();
            println!("{keeps} ms: {text}");
            let told = text.split("line 1: ").nth(1).unwrap();
            let mut words = told.split([' ', ',']);
            let answered: u32 = words.next().unwrap().parse().unwrap();
            let after = told.split("after ").nth(1).unwrap().split(' ').next().unwrap();
            (answered, after.parse::<f64>().unwrap(), text)
        })
    });
    let [at_once, two, sixteen] = runs.map(|it| it.join().unwrap());
    // A busy machine loses a leg at times, which is asked seldom then.
    assert!(at_once.0 > 20 && at_once.1 < 1.9, "{at_once:?}");
    assert!(two.0 > 20 && two.1 > 2.0 && two.1 > at_once.1, "{two:?}");
    // Nothing within the five of a reply.
    assert!(
        sixteen.0 == 0 && sixteen.2.contains("commands without a reply in time"),
        "{sixteen:?}"
    );
}

/// A receiver at a port, its transmitter in a hand: left stick and right switch; `None` says nothing.
type Held = Arc<Mutex<Option<(f64, i8)>>>;

fn receiver(kind: Receiver) -> (Cable, Held) {
    let held = Held::default();
    let hand = Arc::clone(&held);
    let cable = Cable::begin(kind.name(), move || {
        let (mut world, remote) = (World::new(1), Remote::new());
        remote.set_mixer(mixer(&kind.channels()));
        let ReceiverPort::Serial(mut port) = ReceiverWire::new(kind, &mut world, &remote).port()
        else {
            panic!("no bytes")
        };
        move |now, _: &[u8]| {
            let at = *hand.lock().unwrap();
            if let Some((y, switch)) = at {
                let right_switch = match switch {
                    -1 => Switch::Down,
                    0 => Switch::Middle,
                    _ => Switch::Up,
                };
                let left = Stick { x: 0.0, y };
                remote.set(Controls { left, right_switch, ..Controls::REST });
            }
            world.advance(now);
            let said = port.take_received();
            if at.is_some() { said } else { Vec::new() }
        }
    });
    (cable, held)
}

fn is_driven_by_its_own(kind: Receiver) {
    let (cable, held) = receiver(kind);
    let motors = Motors::begin();
    let hold = |stick, switch| *held.lock().unwrap() = Some((stick, switch));
    let stays_disarmed = |page| {
        for _ in 0..40 {
            assert_eq!(arm_state(page), Some(0), "{kind}");
            assert!(have_no_torque(&motors));
            sleep(Duration::from_millis(100));
        }
    };
    // Plugged in with its switch where it arms.
    hold(0.0, 0);
    let bus = format!("1=tcp:127.0.0.1:{}", motors.port);
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    command.args(["drive", "--page", "0", "--pace", &PACE.to_string(), "--bus", &bus]);
    let (_drive, page) = begin(command.args(["--remote", &cable.place(kind.name())]));
    until("the robot knows itself", || state(page)["whole"] == true);
    until("the robot tells its state", || arm_state(page).is_some());
    stays_disarmed(page);
    // The page has no remote beside it.
    let (_, refused) = http(page, "POST", "/drive", JSON, &json!("take").to_string());
    let refused: Value = serde_json::from_str(&refused).unwrap();
    assert!(refused.to_string().contains("a real robot is driven by its own"), "{refused}");

    let lose = |how: &str, lose: &dyn Fn()| {
        is_driven_by(page, hold, || wheels_turn(&motors));
        lose();
        let lost = Instant::now();
        while !have_no_torque(&motors) {
            assert!(lost.elapsed() < Duration::from_secs(60), "{kind}, {how}");
            sleep(Duration::from_millis(5));
        }
        let after = lost.elapsed().mul_f64(PACE).as_millis();
        println!("{kind}, {how}: no torque after {after} ms");
        // 120 without a frame, 50 without a command, and the machine's.
        assert!(after < 300, "{kind}, {how}: {after} ms");
        until("it is disarmed", || arm_state(page) == Some(0));
    };
    lose("unplugged", &|| cable.unplug(true));
    until("it is told", || trouble(page, "remote: "));
    hold(0.0, 0);
    cable.unplug(false);
    until("it is well again", || state(page)["trouble"].is_null());
    stays_disarmed(page);
    lose("silent", &|| *held.lock().unwrap() = None);
}

#[test]
fn a_dr16_drives_at_a_serial_port_and_is_lost_in_time() {
    is_driven_by_its_own(Receiver::Dr16);
}

#[test]
fn sbus_drives_at_a_serial_port_and_is_lost_in_time() {
    is_driven_by_its_own(Receiver::Sbus);
}

#[test]
fn crsf_drives_at_a_serial_port_and_is_lost_in_time() {
    is_driven_by_its_own(Receiver::Crsf);
}

#[test]
fn wrong_lines_and_receivers_are_told() {
    let (cable, _) = line("wrong", Micros::ZERO);
    let there = cable.path.display();
    let says = |command: &mut Command| {
        let output = command.stdout(Stdio::null()).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    for (arguments, words) in [
        (vec!["--line=/dev/ttyUSB0".into()], "it is to be N=PORT, such as 1=/dev/ttyACM0"),
        (vec![format!("--line=2={there}")], "--line 2: the robot has lines 1 to 1"),
        (vec![format!("--line=0={there}")], "--line 0: the robot has lines 1 to 1"),
        (vec!["--line=1=tcp:127.0.0.1:1".into()], "a line needs a serial port of this PC"),
        (vec!["--line=1=/dev/none".into()], "line 1: /dev/none: there is no such port"),
        (
            vec![format!("--line=1={there}"), format!("--remote={there}")],
            "one adapter for each bus, line and remote",
        ),
        (
            vec![format!("--line=1={there}"), format!("--bus=1={there}")],
            "one adapter for each bus, line and remote",
        ),
    ] {
        let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
        let (code, text) = says(&mut drive_legs(&arguments));
        assert!(code == Some(2) && text.contains(words), "{arguments:?}: {code:?} {text}");
    }
    let motors = Motors::begin();
    let bus = format!("--bus=1=tcp:127.0.0.1:{}", motors.port);
    for (argument, words) in [
        ("--line=1=/dev/none", "--line 1: the robot has no RS-485 lines"),
        ("--remote=/dev/none", "remote: /dev/none: there is no such port"),
        ("--remote=ppm=/dev/none", "--remote: ppm sends pulses, which no serial port hears"),
        ("--remote=spektrum=/dev/none", "there is no such receiver: dr16, sbus, crsf or vt03"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
        let (code, text) = says(command.args(["drive", "--page", "0", &bus, argument]));
        assert!(code == Some(2) && text.contains(words), "{argument}: {code:?} {text}");
    }
}
