//! Whatever arrives and whatever is asked: no panic, no number that is none, and no torque where
//! there must be none.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_can::embedded_can::ExtendedId;
use rc10_can::{CanFrame, Micros};
use rc10_motor::cybergear::models::ALL;
use rc10_motor::cybergear::{Config, CyberGear};
use rc10_motor::{
    CanMotor, DriveMode, Gains, Impedance, Link, Motor, Request, Target, Tick, TxBatch,
};

use super::ADDRESS;

#[derive(Clone, Copy, Debug)]
enum Event {
    Frame(u8, u8, [u8; 8]),
    Tick(DriveMode),
    Target(Target),
    Request(Request),
    /// Time passes without anything, ms.
    Pause(u16),
}

fn number() -> impl Strategy<Value = f32> {
    prop_oneof![4 => -100.0..100.0_f32, 1 => any::<f32>()]
}

fn target() -> impl Strategy<Value = Target> {
    prop_oneof![
        number().prop_map(|x| Target::Torque(NewtonMetres::new(x))),
        number().prop_map(|x| Target::Speed(Rpm::new(x))),
        number().prop_map(|x| Target::Angle(Degrees::new(x))),
        any::<i64>().prop_map(|x| Target::TotalAngle(TotalAngle::from_microdegrees(x))),
        (number(), number(), number(), 0.0..5.0_f32).prop_map(|(angle, speed, torque, kd)| {
            Target::Impedance(Impedance {
                angle: Degrees::new(angle),
                speed: Rpm::new(speed),
                torque: NewtonMetres::new(torque),
                kp: 10.0 * kd,
                kd,
            })
        }),
        Just(Target::Coast),
    ]
}

fn request() -> impl Strategy<Value = Request> {
    prop_oneof![
        Just(Request::SetZero),
        Just(Request::ClearFault),
        Just(Request::StoreZero),
        Just(Request::SaveRegisters),
        any::<u16>().prop_map(Request::ReadRegister),
        (any::<u16>(), any::<u32>())
            .prop_map(|(index, value)| Request::WriteRegister(index, value)),
        number().prop_map(|x| Request::TorqueLimit(NewtonMetres::new(x))),
        number().prop_map(|kp| Request::SpeedGains(Gains { kp, ki: kp, kd: 0.0 })),
    ]
}

fn event() -> impl Strategy<Value = Event> {
    let kind =
        prop_oneof![6 => Just(2_u8), 2 => Just(17), 1 => Just(21), 1 => Just(24), 1 => any::<u8>()];
    // Mostly without faults, so that it gets to run.
    let upper = prop_oneof![8 => Just(0x80_u8), 3 => Just(0), 1 => any::<u8>()];
    let data = prop_oneof![
        3 => any::<[u8; 8]>(),
        1 => Just([0x05, 0x70, 0, 0, 0, 0, 0, 0]),
    ];
    const DRIVES: [DriveMode; 6] = [
        DriveMode::Off,
        DriveMode::Coast,
        DriveMode::Brake,
        DriveMode::Hold,
        DriveMode::Run,
        DriveMode::Run,
    ];
    prop_oneof![
        8 => (kind, upper, data).prop_map(|(kind, upper, data)| Event::Frame(kind & 0x1F, upper, data)),
        8 => select(&DRIVES[..]).prop_map(Event::Tick),
        2 => target().prop_map(Event::Target),
        1 => request().prop_map(Event::Request),
        1 => any::<u16>().prop_map(Event::Pause),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2048, failure_persistence: None, ..Default::default() })]

    #[test]
    fn nothing_upsets_it(which in 0..8_usize, events in vec(event(), 1..120)) {
        let mut motor = CyberGear::new(Config::new(ALL[which], ADDRESS)).unwrap();
        let mut now = Micros::from_millis(1);
        let mut silent = 11_u32;
        let low = u32::from(ADDRESS.motor) << 8 | u32::from(ADDRESS.host);
        for event in events {
            match event {
                Event::Frame(kind, upper, data) => {
                    let id = u32::from(kind) << 24 | u32::from(upper) << 16 | low;
                    let id = ExtendedId::new(id).unwrap();
                    let link = if silent > 10 { Link::Lost } else { Link::Online };
                    let _ = motor.unpack_feedback(&CanFrame::eight_bytes(id, data), now, link);
                    silent = 0;
                }
                Event::Target(target) => drop(motor.set_target(target)),
                Event::Request(request) => drop(motor.request(request)),
                Event::Pause(millis) => {
                    now += Micros::from_millis(millis.into());
                    silent += u32::from(millis);
                }
                Event::Tick(drive) => {
                    now += Micros::from_millis(1);
                    motor.update(&Tick::new(drive));
                    silent += 1;
                    let mut tx = TxBatch::new();
                    motor.pack_command(&mut tx).unwrap();
                    let may_move = drive != DriveMode::Off && motor.fault().is_none();
                    for frame in tx.frames() {
                        let kind = frame.raw_id() >> 24;
                        prop_assert!(may_move || !matches!(kind, 1 | 3), "{:?} {}", drive, frame);
                        // Coasting is all zeros, whatever the target.
                        if drive == DriveMode::Coast && kind == 1 {
                            prop_assert_eq!(frame.raw_id(), 0x017F_FF01);
                            prop_assert_eq!(&frame.bytes()[4..], &[0; 4]);
                        }
                    }
                    let _ = motor.response();
                }
            }
            let feedback = motor.feedback();
            prop_assert!(feedback.speed.is_finite());
            prop_assert!((0.0..360.0).contains(&feedback.angle.get()));
            let within = feedback.total_angle.within_turn().get();
            let apart = (within - feedback.angle.get()).abs();
            prop_assert!(apart < 1e-3 || (360.0 - apart) < 1e-3, "{} {:?}", within, feedback);
        }
    }
}
