//! The mechanisms task: gimbal, feeder and lift. Gimbal and lift follow profiles, so that they arrive
//! without a swing, and know in advance what effort that takes.

use rc10::app::{AngleLimits, AngleProfile, AngleSetpoint};
use rc10::motor::Link;
use rc10::prelude::*;

use crate::robot::Goal;
use crate::table::{FEEDER, GIMBAL_LIMITS, LIFT, LIFT_LIMITS, Name, Shared};

/// Period of the mechanisms' task.
pub const PERIOD: Micros = Micros::from_millis(10);
/// Longest age of a command that is followed.
const OLDEST_COMMAND: Micros = Micros::from_millis(100);

/// The mechanisms' task.
pub async fn run(shared: &Shared<'_>) -> ! {
    // The lift stands on its bottom at power-on. A motor that was not heard yet has no zero, and
    // does not move before it has one: of an armed robot it holds, and nothing was asked of it.
    let mut zeroed = [false; LIFT.len()];
    let (mut yaw, mut pitch, mut lift) = (None, None, None);
    let mut every = Every::new(PERIOD);
    loop {
        let tick = every.next().await;
        for (motor, zeroed) in LIFT.into_iter().zip(&mut zeroed) {
            if *zeroed {
                continue;
            }
            let port = shared.motor(motor);
            let is_online = port.status().link == Link::Online;
            *zeroed = is_online && port.request(Request::SetZeroOfDriven).await.is_ok();
        }
        shared.own.tilt.set(tilt(shared).unwrap_or(f32::NAN));
        let Some(wish) = shared.own.mechanisms.newer_than(OLDEST_COMMAND, tick.now) else {
            (yaw, pitch, lift) = (None, None, None);
            continue;
        };
        let dt = tick.dt;
        for (motor, profile, target) in
            [(Name::GimbalYaw, &mut yaw, wish.yaw), (Name::GimbalPitch, &mut pitch, wish.pitch)]
        {
            let setpoint = follow(profile, shared, &[motor], &GIMBAL_LIMITS, target, dt);
            shared.command(motor, Target::Motion(setpoint.into()));
        }
        // At its fastest as a PC has set it.
        let feeder = wish.feeder.get() / FEEDER.get() * shared.own.feeder.get();
        shared.command(Name::Feeder, Target::Speed(Rpm::new(feeder)));
        let setpoint = follow(&mut lift, shared, &LIFT, &LIFT_LIMITS, wish.lift, dt);
        for (motor, zeroed) in LIFT.into_iter().zip(zeroed) {
            if zeroed {
                shared.command(motor, Target::Motion(setpoint.into()));
            }
        }
    }
}

/// The setpoint of motors that move together, on their way to a target. The way begins where they
/// are, in the mean, as fast as they move.
#[inline(never)]
fn follow(
    profile: &mut Option<AngleProfile>,
    shared: &Shared<'_>,
    motors: &[Name],
    limits: &AngleLimits,
    goal: Goal,
    dt: Seconds,
) -> AngleSetpoint {
    let begins = profile.is_none();
    let profile = profile.get_or_insert_with(|| begin(shared, motors));
    if !begins {
        profile.update(dt);
    }
    // Limits that stand in the table can be used, and its angles are finite.
    let _ = if goal.speed == Rpm::ZERO {
        profile.set_target(limits, goal.angle, Rpm::ZERO)
    } else {
        // It is as far behind as it takes to stop: let go, it comes to a stand where the stick brought it.
        profile.set_speed(limits, goal.speed)
    };
    profile.setpoint()
}

/// Where motors are, in the mean, and as fast as they move.
fn begin(shared: &Shared<'_>, motors: &[Name]) -> AngleProfile {
    let (mut angle, mut speed) = (0, 0.0);
    for motor in motors {
        let feedback = shared.motor(*motor).status().feedback;
        angle += feedback.total_angle.microdegrees();
        speed += feedback.speed.get();
    }
    AngleProfile::from_setpoint(AngleSetpoint {
        angle: TotalAngle::from_microdegrees(angle / motors.len() as i64),
        speed: Rpm::new(speed / motors.len() as f32),
        acceleration: RpmPerSecond::ZERO,
    })
}

/// How far the lift is from level, in degrees of its shafts: they stand anywhere until each has been set
/// to zero at the bottom.
fn tilt(shared: &Shared<'_>) -> Option<f32> {
    if shared.switch.state() == ArmState::Disarmed {
        return None;
    }
    let angles = LIFT.map(|name| shared.motor(name).look(|status| status.feedback.total_angle));
    let [lowest, highest] = [angles.iter().min()?, angles.iter().max()?];
    Some(highest.minus(*lowest).degrees().get())
}
