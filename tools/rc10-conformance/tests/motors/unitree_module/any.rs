//! Whatever it is told and whatever it hears, what it sends is in order.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rc10_can::embedded_can::{ExtendedId, Id};
use rc10_can::{CanFrame, Micros};
use rc10_motor::rc10_app::{Degrees, NewtonMetres, Rpm, Seconds, TotalAngle};
use rc10_motor::unitree::{GoModule, ModuleConfig};
use rc10_motor::{
    CanMotor, DriveMode, Gains, Impedance, Link, Motor, Request, Target, Tick, TxBatch,
};
use rc10_sim::unitree_module::{Asked, Command};

use super::codecs::number;

#[derive(Clone, Debug)]
enum Event {
    Hear(u32, [u8; 8], u64),
    Aim(Target),
    Ask(Request),
    Tick(DriveMode, f32),
}

fn target() -> impl Strategy<Value = Target> {
    let impedance = (number(1e3), number(300.0), number(30.0), number(100.0), number(5.0))
        .prop_map(|(angle, speed, torque, kp, kd)| {
            Target::Impedance(Impedance {
                angle: Degrees::new(angle),
                speed: Rpm::new(speed),
                torque: NewtonMetres::new(torque),
                kp: kp.abs(),
                kd: kd.abs(),
            })
        });
    prop_oneof![
        3 => impedance,
        1 => number(30.0).prop_map(|x| Target::Torque(NewtonMetres::new(x))),
        1 => number(300.0).prop_map(|x| Target::Speed(Rpm::new(x))),
        1 => number(720.0).prop_map(|x| Target::Angle(Degrees::new(x))),
        1 => any::<i64>().prop_map(|x| Target::TotalAngle(TotalAngle::from_microdegrees(x))),
        1 => Just(Target::Coast),
    ]
}

fn request() -> impl Strategy<Value = Request> {
    prop_oneof![
        Just(Request::SetZero),
        Just(Request::ClearFault),
        number(30.0).prop_map(|x| Request::TorqueLimit(NewtonMetres::new(x))),
        (number(1.0), number(1.0), number(1.0))
            .prop_map(|(kp, ki, kd)| Request::SpeedGains(Gains { kp, ki, kd })),
    ]
}

fn event() -> impl Strategy<Value = Event> {
    let drive = prop_oneof![
        1 => Just(DriveMode::Off),
        1 => Just(DriveMode::Coast),
        1 => Just(DriveMode::Brake),
        1 => Just(DriveMode::Hold),
        4 => Just(DriveMode::Run),
    ];
    // Mostly answers that lead on: states of a motor that follows, gains of zero.
    let id = prop_oneof![
        4 => Just(0x1D00_1223_u32),
        2 => Just(0x1E00_0200),
        1 => (0..1_u32 << 26).prop_map(|low| 0x1C00_0200 | low & !0xF00),
    ];
    let data = prop_oneof![1 => Just([0; 8]), 1 => any::<[u8; 8]>()];
    prop_oneof![
        4 => (id, data, 0..20_000_u64).prop_map(|(id, data, after)| Event::Hear(id, data, after)),
        2 => target().prop_map(Event::Aim),
        1 => request().prop_map(Event::Ask),
        6 => (drive, 0.0005..0.01_f32).prop_map(|(drive, dt)| Event::Tick(drive, dt)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 1000,
        rng_seed: RngSeed::Fixed(10),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_tick_sends_one_good_frame_and_nothing_drives_while_off(events in vec(event(), 0..80)) {
        let mut motor = GoModule::new(ModuleConfig::new(3, 2)).unwrap();
        let mut at = Micros::ZERO;
        for event in events {
            match event {
                Event::Hear(id, data, after) => {
                    at += Micros::new(after);
                    let id = Id::Extended(ExtendedId::new(id).unwrap());
                    let link = if after > 10_000 { Link::Lost } else { Link::Online };
                    let _ = motor.unpack_feedback(&CanFrame::eight_bytes(id, data), at, link);
                }
                Event::Aim(target) => drop(motor.set_target(target)),
                Event::Ask(request) => drop(motor.request(request)),
                Event::Tick(drive, dt) => {
                    motor.update(&Tick { dt: Seconds::new(dt), ..Tick::new(drive) });
                    let mut tx = TxBatch::new();
                    motor.pack_command(&mut tx).unwrap();
                    prop_assert_eq!(tx.frames().len(), 1);
                    let command = Command::unpack(&tx.frames()[0]).unwrap().unwrap();
                    prop_assert_eq!((command.module, command.motor), (3, 2));
                    if let Asked::Control { status, motion, answered } = command.asked {
                        prop_assert!(status < 2 && answered);
                        prop_assert!(motion.torque.abs() <= 128.0);
                    }
                    let locks = matches!(command.asked, Asked::Control { status: 0, .. });
                    prop_assert!(locks || (drive != DriveMode::Off && motor.fault().is_none()));
                }
            }
            let seen = motor.feedback();
            prop_assert!(seen.speed.is_finite() && seen.total_angle.degrees().is_finite());
            prop_assert!((0.0..360.0).contains(&seen.angle.get()), "{:?}", seen.angle);
            // The angle within the turn is that of all turns.
            let apart = seen.total_angle.microdegrees().rem_euclid(360_000_000) as f64 * 1e-6
                - f64::from(seen.angle.get());
            prop_assert!(apart.abs() < 1e-4 || apart.abs() > 359.999, "{apart}");
        }
    }
}
