//! Inputs: the usual, the extreme, and the impossible.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::RngSeed;
use rc10_app::{
    Amps, CountsPerTurn, Degrees, FeedForward, Gear, Gravity, PidConfig, Rpm, RpmPerSecond,
    Seconds, TotalAngle,
};
use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_motor::dji::{
    self, Dji, FeedbackRate, GM6020_CURRENT, GM6020_VOLTAGE, M2006, M3508, Model,
};
use rc10_motor::rc10_app::Cascade;
use rc10_motor::rc10_app::Direction;
use rc10_motor::{Gains, Motion, Request, Target};

/// A number of cases, from the same seed in every run.
pub fn cases(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(10);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

/// Any f32, NaN and infinities included.
pub fn number() -> impl Strategy<Value = f32> {
    number_below(1e4)
}

/// Any f32, NaN and infinities included; mostly those up to `usual`, either way.
pub fn number_below(usual: f32) -> impl Strategy<Value = f32> {
    const SPECIAL: [f32; 7] =
        [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN];
    prop_oneof![
        4 => -usual..usual,
        2 => any::<u32>().prop_map(f32::from_bits),
        1 => select(&SPECIAL[..]),
    ]
}

/// Any f32 but NaN and infinities.
fn finite() -> impl Strategy<Value = f32> {
    number().prop_map(|number| if number.is_finite() { number } else { f32::MAX })
}

/// Any identifier, those that DJI motors use more often.
pub fn id() -> impl Strategy<Value = Id> {
    let standard = prop_oneof![0x1FE..=0x20C_u16, 0..=0x7FF_u16];
    let extended = prop_oneof![0x1FE..=0x20C_u32, 0..=0x1FFF_FFFF_u32];
    prop_oneof![
        3 => standard.prop_map(|raw| Id::Standard(StandardId::new(raw).unwrap())),
        1 => extended.prop_map(|raw| Id::Extended(ExtendedId::new(raw).unwrap())),
    ]
}

/// Any frame.
pub fn frame() -> impl Strategy<Value = CanFrame> {
    frame_of(id(), vec(any::<u8>(), 0..=8))
}

/// A frame with one of these identifiers and data; now and then a remote request instead.
pub fn frame_of(
    id: impl Strategy<Value = Id>,
    data: impl Strategy<Value = Vec<u8>>,
) -> impl Strategy<Value = CanFrame> {
    (id, data, prop::bool::weighted(0.1)).prop_map(|(id, data, remote)| {
        let frame = if remote {
            CanFrame::remote_frame(id, data.len())
        } else {
            CanFrame::data_frame(id, &data)
        };
        frame.unwrap()
    })
}

/// Identifiers of these numbers, standard or extended.
pub fn either(raw: impl Strategy<Value = u16>) -> impl Strategy<Value = Id> {
    (raw, any::<bool>()).prop_map(|(raw, extended)| {
        if extended {
            Id::Extended(ExtendedId::new(raw.into()).unwrap())
        } else {
            Id::Standard(StandardId::new(raw).unwrap())
        }
    })
}

/// Any standard identifier.
pub fn standard() -> impl Strategy<Value = Id> {
    (0..=0x7FF_u16).prop_map(|raw| Id::Standard(StandardId::new(raw).unwrap()))
}

fn gear() -> impl Strategy<Value = Gear> {
    const EXTREME: [(u32, u32); 5] =
        [(1, 0xFFFF), (0xFFFF, 1), (0xFFFF, 0xFFFF), (1, 1), (3591, 187)];
    let teeth = prop_oneof![select(&EXTREME[..]), (1..=0xFFFF_u32, 1..=0xFFFF_u32)];
    teeth.prop_map(|(rotor, output)| Gear::new(rotor, output).unwrap())
}

/// Any gains that pass validation.
fn cascade() -> impl Strategy<Value = Cascade> {
    let pid = || {
        (finite(), finite(), finite(), finite(), finite(), any::<bool>()).prop_map(
            |(kp, ki, kd, limit, integral_limit, separated)| PidConfig {
                derivative_filter: Seconds::new(if separated { 0.01 } else { 0.0 }),
                tracking: if separated { 20.0 } else { 0.0 },
                integral_limit: integral_limit.abs(),
                integral_separation: if separated { 10.0 } else { f32::INFINITY },
                deadband: if separated { 0.5 } else { 0.0 },
                ..PidConfig::within(limit.abs().max(f32::MIN_POSITIVE))
                    .kp(kp.abs())
                    .ki(ki.abs())
                    .kd(kd.abs())
            },
        )
    };
    let gravity = (0..3_u8, finite(), number()).prop_map(|(kind, effort, level)| match kind {
        0 => Gravity::None,
        1 => Gravity::Lift(effort),
        _ => {
            let level = if level.is_finite() { level } else { 0.0 };
            Gravity::Arm { effort, level: Degrees::new(level) }
        }
    });
    let feed_forward = (any::<bool>(), finite(), finite(), finite(), gravity).prop_map(
        |(is_plain, friction, speed, acceleration, gravity)| {
            let (friction, acceleration) = (friction.abs(), acceleration.abs());
            let whole = FeedForward { friction, per_rpm: speed, per_rpm_s: acceleration, gravity };
            if is_plain { FeedForward::of_speed(speed) } else { whole }
        },
    );
    (pid(), pid(), any::<u8>(), finite(), feed_forward).prop_map(
        |(speed, angle, outer_divider, acceleration, feed_forward)| Cascade {
            speed,
            angle,
            outer_divider,
            acceleration: RpmPerSecond::new(acceleration.abs().max(f32::MIN_POSITIVE)),
            feed_forward,
        },
    )
}

pub fn model() -> impl Strategy<Value = &'static Model> {
    select(vec![&M3508, &M2006, &GM6020_CURRENT, &GM6020_VOLTAGE])
}

/// Any DJI motor as it comes out of its box.
fn stock() -> impl Strategy<Value = dji::Config> {
    (model(), 1..=8_u8)
        .prop_map(|(model, id)| dji::Config::new(model, (id - 1) % model.last_id + 1))
}

/// Any DJI motor as it comes out of its box.
pub fn stock_motor() -> impl Strategy<Value = Dji> {
    stock().prop_map(|config| Dji::new(config).unwrap())
}

/// Any DJI motor, however it is set up.
pub fn motor() -> impl Strategy<Value = Dji> {
    let rate = select(vec![FeedbackRate::Hz1000, FeedbackRate::Hz125]);
    let gear = prop::option::of(gear());
    let cascade = prop::option::weighted(0.2, cascade());
    (stock(), gear, any::<bool>(), rate, cascade).prop_map(
        |(mut config, gear, reversed, rate, cascade)| {
            if let Some(gear) = gear {
                config = config.with_gear(gear);
            }
            if reversed {
                config = config.with_direction(Direction::Reversed);
            }
            let largest = config.cascade.speed.output_limit;
            config.cascade = cascade.unwrap_or(config.cascade);
            let limit = &mut config.cascade.speed.output_limit;
            *limit = limit.min(largest);
            Dji::new(config.with_feedback_rate(rate)).unwrap()
        },
    )
}

pub fn total_angle() -> impl Strategy<Value = TotalAngle> {
    let counted = (any::<i64>(), any::<u32>(), any::<u32>()).prop_map(|(counts, per, turns)| {
        TotalAngle::from_counts(counts, CountsPerTurn::new(per, turns))
    });
    prop_oneof![any::<i32>().prop_map(TotalAngle::from_degrees), counted]
}

/// Any target, also such as no motor takes.
pub fn target() -> impl Strategy<Value = Target> {
    prop_oneof![
        Just(Target::Coast),
        number().prop_map(|amps| Target::Current(Amps::new(amps))),
        number().prop_map(Target::Duty),
        number().prop_map(|rpm| Target::Speed(Rpm::new(rpm))),
        number().prop_map(|degrees| Target::Angle(Degrees::new(degrees))),
        total_angle().prop_map(Target::TotalAngle),
        (proptest::option::of(total_angle()), number(), number(), number()).prop_map(
            |(angle, speed, acceleration, effort)| {
                let (speed, acceleration) = (Rpm::new(speed), RpmPerSecond::new(acceleration));
                Target::Motion(Motion { angle, speed, acceleration, inertia: 0.5 * effort, effort })
            }
        ),
    ]
}

/// Any request, also such as no motor grants.
pub fn request() -> impl Strategy<Value = Request> {
    let gains = || (number(), number(), number()).prop_map(|(kp, ki, kd)| Gains { kp, ki, kd });
    prop_oneof![
        Just(Request::SetZeroOfDriven),
        Just(Request::ClearFault),
        number().prop_map(|amps| Request::CurrentLimit(Amps::new(amps))),
        prop_oneof![Just(0.0), 0.0..25.0_f32]
            .prop_map(|amps| Request::CurrentLimit(Amps::new(amps))),
        gains().prop_map(Request::SpeedGains),
        gains().prop_map(Request::AngleGains),
    ]
}
