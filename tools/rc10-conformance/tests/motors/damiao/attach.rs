use super::{cascade, config, controls, motor};
use crate::motors::{clash, sent_in};
use rc10_app::{PidConfig, Rpm};
use rc10_can::embedded_can::StandardId;
use rc10_motor::damiao::{Config, Control, Damiao, Limits, Model, models};
use rc10_motor::dji::{self, Dji, M3508};
use rc10_motor::{CanMotor, Clash, DriveMode, Motor, Request, Tick, TxBatch};
use rc10_time::Micros;

fn at(can_id: u16, master_id: u16) -> Damiao {
    Damiao::new(Config::new(models::J4310, can_id, master_id, Control::Velocity)).unwrap()
}

#[test]
fn configurations_that_cannot_be_are_refused_by_name() {
    let field = |can_id, master_id, control| {
        let error = Damiao::new(Config::new(models::J4310, can_id, master_id, control)).err()?;
        Some([error.part, error.field].join(".").trim_start_matches('.').to_string())
    };
    for (can_id, master_id, wrong) in [
        (0x11, 0x31, None),
        (0x01, 0x00, None),
        (0x4FE, 0x7FE, Some("MST_ID")),
        (0x4FE, 0x7F0, None),
        (0x4FF, 0x31, Some("CAN_ID")),
        (0x500, 0x31, Some("CAN_ID")),
        (0x0FF, 0x31, Some("CAN_ID")),
        (0x011, 0x111, Some("MST_ID")),
        (0x011, 0x7FF, Some("MST_ID")),
        (0x011, 0x800, Some("MST_ID")),
        (0x000, 0x000, Some("MST_ID")),
    ] {
        assert_eq!(
            field(can_id, master_id, Control::Velocity).as_deref(),
            wrong,
            "{can_id:#x} {master_id:#x}"
        );
    }
    let speed = Rpm::new(100.0);
    let strong = PidConfig { output_limit: 10.1, ..cascade().speed };
    let fast = PidConfig { output_limit: 290.0, ..cascade().angle };
    for (control, wrong) in [
        (Control::PositionVelocity { speed: Rpm::new(0.0) }, "speed"),
        (Control::PositionVelocity { speed: Rpm::new(f32::NAN) }, "speed"),
        (Control::PositionVelocity { speed: Rpm::new(290.0) }, "speed"),
        (Control::ForcePosition { speed, torque_share: 0.0 }, "torque_share"),
        (Control::ForcePosition { speed, torque_share: 1.1 }, "torque_share"),
        (Control::ForcePosition { speed, torque_share: f32::NAN }, "torque_share"),
        (
            Control::Mit(rc10_motor::rc10_app::Cascade { speed: strong, ..cascade() }),
            "speed.output_limit",
        ),
        (
            Control::Mit(rc10_motor::rc10_app::Cascade { angle: fast, ..cascade() }),
            "angle.output_limit",
        ),
    ] {
        assert_eq!(field(0x11, 0x31, control).as_deref(), Some(wrong), "{control:?}");
    }
    // The frame's own end, below this model's VMAX.
    let fast = Control::ForcePosition { speed: Rpm::new(1000.0), torque_share: 1.0 };
    let error = Damiao::new(Config::new(models::H3510, 1, 0, fast)).unwrap_err();
    assert_eq!((error.field, error.must_be), ("speed", "at most 100 rad/s"));
    let limits = Limits::new(12.5, f32::NAN, 10.0);
    let error = Damiao::new(Config::new(Model { name: "own", limits }, 1, 0, Control::Velocity))
        .unwrap_err();
    assert_eq!(error.field, "velocity");
}

#[test]
fn neighbours_that_would_be_taken_for_commands_are_refused() {
    // DJI feedback 0x201 to 0x20B looks like a velocity command.
    for id in 1..=8_u16 {
        let mut wheel = Dji::new(dji::Config::new(&M3508, id.try_into().unwrap())).unwrap();
        let taken = StandardId::new(0x200 + id).unwrap().into();
        assert_eq!(clash(&mut at(id, 0x31), &mut wheel), Some(Clash::Confuses(taken)));
        assert_eq!(clash(&mut at(0x10 + id, 0x31 + id), &mut wheel), None);
    }
    // Of each other.
    let answer = StandardId::new(0x12).unwrap().into();
    let refused = clash(&mut at(0x02, 0x12), &mut at(0x12, 0x22));
    assert_eq!(refused, Some(Clash::Confuses(answer)));
    // The low byte decides.
    assert!(clash(&mut at(0x11, 0x31), &mut at(0x111, 0x32)).is_some());
    // One MST_ID for several, if the four bits that fit into feedback differ.
    assert_eq!(clash(&mut at(0x01, 0x00), &mut at(0x02, 0x00)), None);
    let shared = clash(&mut at(0x01, 0x00), &mut at(0x11, 0x00));
    assert_eq!(shared, Some(Clash::RxFrames(StandardId::ZERO.into())));
}

/// Whatever the state, the frames that leave it without torque are those that disable it.
#[test]
fn the_coast_image_disables_it() {
    for (control, image) in controls().into_iter().zip([
        &["011#FFFFFFFFFFFFFFFD"][..],
        &["111#FFFFFFFFFFFFFFFD", "011#FFFFFFFFFFFFFFFD"],
        &["211#FFFFFFFFFFFFFFFD", "011#FFFFFFFFFFFFFFFD"],
        &["311#FFFFFFFFFFFFFFFD", "011#FFFFFFFFFFFFFFFD"],
    ]) {
        let mut tx = TxBatch::new();
        motor(control).coast_frames(&mut tx).unwrap();
        let frames: Vec<_> = tx.frames().iter().map(ToString::to_string).collect();
        assert_eq!(frames, image);
    }
}

/// Register frames of two motors have one identifier, and do not take each other's place.
#[test]
fn register_frames_of_two_motors_keep_apart() {
    let mut streams = Vec::new();
    for control in controls() {
        let mut motor = Damiao::new(config(control).verify_limits(false)).unwrap();
        motor.request(Request::ReadRegister(80)).unwrap();
        let tx = sent_in(&mut motor, &Tick::new(DriveMode::Off));
        let mut entries = tx.entries();
        let (command, commands) = entries.next().unwrap();
        let (frame, stream) = entries.next().unwrap();
        assert_eq!(frame.to_string(), "7FF#11003350");
        assert_ne!(commands, stream);
        // One of its own identifiers, so no other motor's stream.
        assert_eq!((command.raw_id() & 0xFF, stream & 0xFF), (0x11, 0x11));
        streams.push(stream);
    }
    assert!(streams.iter().all(|stream| stream >> 8 <= 3));
}

#[test]
fn a_model_of_ones_own_is_a_name_and_limits() {
    let limits = Limits::new(3.2, 40.0, 8.0);
    let mine = Model { name: "DM-mine", limits };
    let motor = Damiao::new(Config::new(mine, 0x21, 0x41, Control::Velocity)).unwrap();
    assert_eq!(motor.name().to_string(), "DM-mine id 33");
    assert_eq!(motor.can_ids().link_timeout(), Micros::from_millis(10));
    let bytes = size_of::<Damiao>();
    assert!(bytes <= 816, "{bytes} bytes of the bus's memory");
}
