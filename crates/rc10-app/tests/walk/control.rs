//! Units, angles, PID, gain schedule, feed-forward and cascade.

use rc10_app::angle::shortest_way;
use rc10_app::cascade::{Seek, Step};
use rc10_app::{
    Cascade, CascadeState, CountsPerTurn, Degrees, FeedForward, GainSchedule, Gains, Gear, Gravity,
    PidConfig, PidState, RotorRpm, Rpm, RpmPerSecond, Seconds, TotalAngle, maths,
};

use super::Chance;

/// A walk of control maths.
pub fn walk(put: &mut dyn FnMut(f32)) {
    let mut chance = Chance(16);
    numbers(&mut chance, put);
    for _ in 0..20 {
        pid(&mut chance, put);
    }
    for _ in 0..20 {
        cascade(&mut chance, put);
    }
}

fn numbers(chance: &mut Chance, put: &mut dyn FnMut(f32)) {
    for _ in 0..300 {
        let (x, y) = (chance.within(1e4), chance.within(1e4));
        let (sin, cos) = maths::sin_cos(x);
        for value in [
            sin,
            cos,
            maths::sqrt(x.abs()),
            maths::fast_sqrt(x.abs()),
            maths::hypot(x, y),
            maths::exp_m1(x * 1e-3),
            maths::round(y),
            maths::within(x, 100.0),
            f32::from(maths::round_to_i16(y)),
            maths::round_to_i32(x) as f32,
            shortest_way(maths::round_to_i32(x), maths::round_to_i32(y), 360) as f32,
        ] {
            put(value);
        }
        let scale = CountsPerTurn::new(8192 * 3591, 187);
        let angle = TotalAngle::try_from_degrees(Degrees::new(x)).unwrap_or_default();
        put(angle.within_turn().get());
        put(angle.counts_at(scale) as f32);
        put(TotalAngle::from_counts(maths::round_to_i32(y).into(), scale).degrees().get());
        put(Gear::new(3591, 187).unwrap_or(Gear::DIRECT).to_output(RotorRpm::new(x)).get());
    }
}

fn gains(chance: &mut Chance) -> Gains {
    Gains { kp: chance.up_to(2.0), ki: chance.up_to(20.0), kd: chance.up_to(0.01) }
}

fn pid(chance: &mut Chance, put: &mut dyn FnMut(f32)) {
    let schedule = GainSchedule::new([(-1.0, gains(chance)), (1.0, gains(chance))]);
    let config = PidConfig {
        derivative_filter: Seconds::new(chance.up_to(0.02)),
        setpoint_weight: chance.up_to(1.0),
        tracking: if chance.within(1.0) > 0.0 { chance.up_to(100.0) } else { 0.0 },
        deadband: if chance.within(1.0) > 0.5 { 0.2 } else { 0.0 },
        integral_separation: if chance.within(1.0) > 0.5 { 30.0 } else { f32::INFINITY },
        ..PidConfig::within(chance.up_to(50.0) + 1.0).kp(1.0)
    };
    let mut state = PidState::new();
    for _ in 0..200 {
        let (setpoint, measured) = (chance.within(40.0), chance.within(40.0));
        let scheduled = schedule.map_or(config, |it| config.with_gains(it.at(chance.within(2.0))));
        let dt = Seconds::new(0.001 + chance.up_to(0.002));
        put(state.update(&scheduled, setpoint, measured, chance.within(1.0), dt));
        put(state.integral());
    }
}

fn cascade(chance: &mut Chance, put: &mut dyn FnMut(f32)) {
    let gravity = match chance.within(1.5) {
        x if x < -0.5 => Gravity::None,
        x if x < 0.5 => Gravity::Lift(x),
        x => Gravity::Arm { effort: x, level: Degrees::new(chance.within(180.0)) },
    };
    let feed_forward = FeedForward {
        friction: chance.up_to(0.3),
        per_rpm: chance.within(0.01),
        per_rpm_s: chance.up_to(0.01),
        gravity,
    };
    let config = Cascade {
        speed: PidConfig { kd: chance.up_to(1e-3), ..PidConfig::within(20.0).kp(0.4).ki(2.0) },
        angle: PidConfig::within(400.0).kp(1.0 + chance.up_to(1.0)),
        outer_divider: 10,
        acceleration: RpmPerSecond::new(500.0 + chance.up_to(500.0)),
        feed_forward,
    };
    let (mut state, mut rpm, mut degrees) = (CascadeState::new(), 0.0_f32, 0.0_f32);
    let dt = Seconds::new(0.001);
    let mut seek = Seek::Speed(0.0);
    let unloaded = |measured, count| Step { measured, load: 0.0, full: 20.0, dt, count };
    for count in 0..400_u32 {
        let phase = count / 50 % 5;
        let way = 90.0 - degrees;
        match phase {
            0 => state.seek(&config, &Seek::Speed(120.0), &unloaded(rpm, count)),
            1 => state.seek(&config, &Seek::Angle(way), &unloaded(rpm, count)),
            2 => state.give(chance.within(5.0), 20.0, dt),
            3 => {
                let load =
                    feed_forward.effort(Rpm::new(rpm), RpmPerSecond::ZERO, Degrees::new(degrees));
                let step = Step { measured: rpm, load, full: 20.0, dt, count };
                let speed = chance.within(50.0);
                let (acceleration, inertia) = (chance.within(500.0), chance.within(2.0));
                seek = Seek::Motion { way: Some(way), speed, acceleration, inertia };
                state.seek(&config, &seek, &step);
            }
            _ => state.rest(),
        }
        rpm += state.effort() * 0.5;
        degrees += rpm * 6e-3;
        put(state.effort());
        put(state.reference());
    }
    put(if matches!(seek, Seek::Motion { .. }) { 1.0 } else { 0.0 });
}
