//! `rc10 live --foxglove` before Foxglove's own client from npm, which decodes by the schemas alone. Without
//! npm it says so, and nothing is tested.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;

struct Started(Child);

impl Drop for Started {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The client with what it needs, if there is npm.
fn client() -> Option<PathBuf> {
    if Command::new("npm").arg("--version").output().is_err() {
        eprintln!("SKIPPED: no npm on this machine: Foxglove's client is not tried");
        return None;
    }
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join("node");
    fs::create_dir_all(&place).unwrap();
    for name in ["package.json", "package-lock.json", "foxglove.js"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../node").join(name);
        fs::copy(from, place.join(name)).unwrap();
    }
    let output =
        Command::new("npm").args(["ci", "--no-audit", "--no-fund"]).current_dir(&place).output();
    let output = output.unwrap();
    assert!(output.status.success(), "npm ci: {}", String::from_utf8_lossy(&output.stderr));
    Some(place.join("foxglove.js"))
}

#[test]
fn foxglove_sees_what_the_robot_says() {
    let Some(script) = client() else { return };
    // The same values by another way: JSON, as PlotJuggler takes it.
    let udp = UdpSocket::bind("127.0.0.1:0").unwrap();
    udp.set_read_timeout(Some(Duration::from_secs(600))).unwrap();
    let (place, end) = (udp.local_addr().unwrap(), UdpSocket::bind("127.0.0.1:0").unwrap());
    let mut live = Command::new(env!("CARGO_BIN_EXE_viewers"))
        .args(["live", "--sim", "--script", "--page", "0", "--foxglove=0", "--plotjuggler"])
        .arg(place.to_string())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(live.stdout.take().unwrap()).lines();
    let _live = Started(live);
    let line = lines.next().unwrap().unwrap();
    let url = line.strip_prefix("foxglove  ").unwrap_or_else(|| panic!("{line}"));
    let told = std::thread::spawn(move || {
        let mut told: BTreeMap<u64, Value> = BTreeMap::new();
        let mut bytes = vec![0; 65_536];
        // It ends with an empty one.
        while let Ok(count @ 1..) = udp.recv(&mut bytes) {
            let value: Value = serde_json::from_slice(&bytes[..count]).unwrap();
            #[expect(clippy::cast_possible_truncation, reason = "a time of a test")]
            let at = (value["timestamp"].as_f64().unwrap() * 1e6).round() as u64;
            if let Some(wheel) = value.get("wheel_front_left").filter(|it| it["speed"].is_number())
            {
                told.insert(at, wheel.clone());
            }
        }
        told
    });
    let output = Command::new("node").arg(script).args([url, "4"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    drop(_live);
    end.send_to(&[], place).unwrap();
    let told = told.join().unwrap();

    let mut heard = output.stdout.lines().map(|line| {
        let line = line.unwrap();
        serde_json::from_str::<Value>(&line).unwrap_or_else(|_| panic!("{line}"))
    });
    assert_eq!(heard.next().unwrap()["protocol"], "foxglove.sdk.v1");
    let mut topics: BTreeMap<String, usize> = BTreeMap::new();
    let (mut compared, mut fastest) = (0, 0.0_f64);
    for message in heard {
        let topic = message["topic"].as_str().unwrap();
        *topics.entry(topic.to_owned()).or_default() += 1;
        if topic != "/motors/wheel_front_left" {
            continue;
        }
        let at = message["nanoseconds"].as_u64().unwrap() / 1000;
        let Some(wheel) = told.get(&at) else { continue };
        for name in ["speed", "total_angle", "current", "drive"] {
            // NaN is null here, and not told there.
            let value = &message["values"][name];
            assert_eq!(value.as_f64(), wheel.get(name).and_then(Value::as_f64), "{name} at {at}");
        }
        compared += 1;
        fastest = fastest.max(wheel["speed"].as_f64().unwrap().abs());
    }
    assert!(compared > 200 && fastest > 50.0, "{compared} messages, {fastest} rpm, {topics:?}");
    // Motors often, all else now and then.
    let count = |topic: &str| topics.get(topic).copied().unwrap_or(0);
    assert_eq!(
        topics
            .keys()
            .filter(|it| it.matches('/').count() == 2 && it.starts_with("/motors/"))
            .count(),
        11
    );
    for slow in ["/robot", "/buses/1", "/motors/gimbal_yaw/health"] {
        assert!((15..=60).contains(&count(slow)), "{slow}: {topics:?}");
    }
}
