//! Who decides what the robot does. Here it is a script of ten seconds that shows everything; a
//! remote control will take its place.

use embassy_time::{Duration, Instant, Ticker, Timer};
use rc10_app::{Degrees, Rpm, Twist};
use rc10_motor::{Link, Request};

use crate::robot::{Io, Posture};
use crate::table::{LIFT, MOTORS};

/// What happens at one moment of the script.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Act {
    /// Let the motors follow their commands.
    Arm,
    /// Move the base: m/s forward, m/s left, rad/s counter-clockwise.
    Drive(f32, f32, f32),
    /// Point the gimbal: yaw and pitch in degrees.
    Point(f32, f32),
    /// Turn the feeder, rpm.
    Feed(f32),
    /// Move the lift, degrees of its shafts.
    Lift(i32),
    /// Somebody hits the emergency stop.
    EmergencyStop,
    /// The emergency stop is released.
    Reset,
}

/// The script: milliseconds from its start, and what happens then.
pub const SCRIPT: &[(u32, &str, Act)] = &[
    (0, "arm", Act::Arm),
    (100, "square: forward", Act::Drive(1.2, 0.0, 0.0)),
    (1000, "square: left", Act::Drive(0.0, 1.2, 0.0)),
    (1900, "square: back", Act::Drive(-1.2, 0.0, 0.0)),
    (2800, "square: right", Act::Drive(0.0, -1.2, 0.0)),
    (3700, "spin", Act::Drive(0.0, 0.0, 4.0)),
    (4700, "stand", Act::Drive(0.0, 0.0, 0.0)),
    (4700, "gimbal right", Act::Point(90.0, 150.0)),
    (5200, "feeder on", Act::Feed(180.0)),
    (5500, "gimbal left", Act::Point(270.0, 210.0)),
    (6300, "gimbal ahead", Act::Point(180.0, 180.0)),
    (6500, "feeder off", Act::Feed(0.0)),
    (6800, "lift up", Act::Lift(720)),
    (8000, "drive off", Act::Drive(1.5, 0.0, 1.0)),
    (8500, "emergency stop", Act::EmergencyStop),
    (9000, "reset", Act::Reset),
    (9050, "arm again", Act::Arm),
    (9100, "lift down", Act::Lift(360)),
    (9500, "stand", Act::Drive(0.0, 0.0, 0.0)),
];

/// The script starts over after this, in milliseconds.
pub const SCRIPT_LENGTH: u32 = 10_000;

/// When the script starts, in milliseconds after power-on, if all motors are heard by then.
pub const EARLIEST_START: u64 = 100;

/// The driver task.
pub async fn run(io: &Io<'_>) -> ! {
    Timer::at(Instant::from_millis(EARLIEST_START)).await;
    wait_for_motors(io).await;
    for motor in LIFT {
        // The lift stands on its bottom at power-on. A motor that is not there has no zero.
        let _ = io.motor(motor).request(Request::SetZero).await;
    }
    let mut twist = Twist::STOP;
    let ahead = Degrees::new(180.0);
    let mut posture = Posture { yaw: ahead, pitch: ahead, ..Posture::default() };
    let start = Instant::now();
    let mut ticker = Ticker::every(Duration::from_millis(10));
    let mut script = SCRIPT.iter().cycle().zip(0_u32..);
    let mut next = script.next();
    loop {
        let elapsed = start.elapsed().as_millis();
        while let Some(((at, _, act), number)) = next {
            #[expect(clippy::cast_possible_truncation, reason = "a script of a few lines")]
            let round = u64::from(number / SCRIPT.len() as u32);
            if elapsed < round * u64::from(SCRIPT_LENGTH) + u64::from(*at) {
                break;
            }
            match *act {
                // A latched stop refuses it, and then the robot stays stopped.
                Act::Arm => drop(io.switch.arm()),
                Act::Drive(vx, vy, wz) => twist = Twist::new(vx, vy, wz),
                Act::Point(yaw, pitch) => {
                    (posture.yaw, posture.pitch) = (Degrees::new(yaw), Degrees::new(pitch));
                }
                Act::Feed(rpm) => posture.feeder = Rpm::new(rpm),
                Act::Lift(degrees) => posture.lift = degrees,
                Act::EmergencyStop => io.switch.emergency_stop(),
                Act::Reset => io.switch.reset(),
            }
            next = script.next();
        }
        let now = rc10_bsp::now();
        io.twist.set(twist, now);
        io.posture.set(posture, now);
        ticker.next().await;
    }
}

/// Waits until every motor is heard, but not for ever: a robot with a dead motor still drives.
async fn wait_for_motors(io: &Io<'_>) {
    for _ in 0..100 {
        let heard = |name| io.motor(name).status().link == Link::Online;
        if MOTORS.iter().all(|entry| heard(entry.name)) {
            return;
        }
        Timer::after(Duration::from_millis(10)).await;
    }
}
