use super::*;
use rc10_can::embedded_can::{ExtendedId, StandardId};
extern crate std;
use std::string::ToString;

fn id(raw: u8) -> VescId {
    VescId::new(raw).unwrap()
}

fn received(raw: u32, data: &[u8]) -> Result<Reply, FrameError> {
    Reply::unpack(&CanFrame::data_frame(ExtendedId::new(raw).unwrap(), data).unwrap())
}

fn status(raw: u32, data: [u8; 8]) -> Status {
    match received(raw, &data) {
        Ok(Reply::Status { status, .. }) => status,
        other => panic!("{other:?}"),
    }
}

/// Frames of bldc's own sender (firmware 7.01).
#[test]
fn commands_are_those_of_the_firmware() {
    for (command, to, frame) in [
        (Command::Duty(0.25), 1, "00000001#000061A8"),
        (Command::Current(Amps::new(51.0)), 23, "00000117#0000C738"),
        (Command::Current(Amps::new(-0.001)), 42, "0000012A#FFFFFFFF"),
        (Command::Brake(Amps::new(12.25)), 33, "00000221#00002FDA"),
        (Command::Speed(ElectricalRpm::new(-100_000.0)), 6, "00000306#FFFE7960"),
        (Command::Position(Degrees::new(180.0)), 1, "00000401#0ABA9500"),
        (Command::Position(Degrees::new(-45.25)), 11, "0000040B#FD4D8A30"),
        (Command::RelativeCurrent(0.0625), 77, "00000A4D#0000186A"),
        (Command::RelativeBrake(0.75), 2, "00000B02#000124F8"),
        (Command::Handbrake(Amps::new(5.5)), 2, "00000C02#0000157C"),
        (Command::RelativeHandbrake(0.25), 2, "00000D02#000061A8"),
    ] {
        assert_eq!(command.pack(id(to)).unwrap().to_string(), frame);
    }
    assert_eq!(coast(Address::Every).to_string(), "000001FF#00000000");
    assert_eq!(ping(id(23), id(200)).to_string(), "00001117#C8");
    assert_eq!(shutdown(id(5)).to_string(), "00001F05#");
}

#[test]
fn settings_are_those_of_the_firmware() {
    let limits = |min, max| (Amps::new(min), Amps::new(max));
    let (min, max) = limits(-60.0, 60.0);
    let setting = Setting::MotorCurrent { min, max };
    assert_eq!(setting.pack(id(1)).unwrap().to_string(), "00001501#FFFF15A00000EA60");
    let (min, max) = limits(-25.5, 40.25);
    let setting = Setting::MotorCurrent { min, max };
    assert_eq!(setting.pack_store(id(21)).unwrap().to_string(), "00001615#FFFF9C6400009D3A");
    let (min, max) = limits(-10.0, 30.0);
    let setting = Setting::InputCurrent { min, max };
    assert_eq!(setting.pack(id(1)).unwrap().to_string(), "00001701#FFFFD8F000007530");
    let (min, max) = limits(-5.0, 12.5);
    let setting = Setting::InputCurrent { min, max };
    assert_eq!(setting.pack_store(id(8)).unwrap().to_string(), "00001808#FFFFEC78000030D4");
    let setting = Setting::FieldOriented {
        openloop: ElectricalRpm::new(700.0),
        sensorless: ElectricalRpm::new(2500.0),
    };
    assert_eq!(setting.pack(id(1)).unwrap().to_string(), "00001901#000AAE60002625A0");
    assert_eq!(setting.pack_store(id(1)).unwrap().raw_id(), 0x1A01);
    let setting = Setting::BatteryCut { start: 20.0, end: 18.5 };
    assert_eq!(setting.pack(id(1)).unwrap().to_string(), "00001D01#00004E2000004844");
    assert_eq!(setting.pack_store(id(1)).unwrap().raw_id(), 0x1E01);
}

#[test]
fn beyond_the_ends_is_at_the_ends() {
    let raw = |command: Command| {
        i32::from_be_bytes(command.pack(id(0)).unwrap().bytes().try_into().unwrap())
    };
    for huge in [f32::INFINITY, f32::MAX, 3e9] {
        assert_eq!(raw(Command::Duty(huge)), 100_000);
        assert_eq!(raw(Command::RelativeCurrent(-huge)), -100_000);
        assert_eq!(raw(Command::RelativeBrake(huge)), 100_000);
        assert_eq!(raw(Command::RelativeHandbrake(-huge)), -100_000);
        assert_eq!(raw(Command::Current(Amps::new(-huge))), i32::MIN);
        assert_eq!(raw(Command::Brake(Amps::new(huge))), i32::MAX);
        assert_eq!(raw(Command::Handbrake(Amps::new(huge))), i32::MAX);
        assert_eq!(raw(Command::Speed(ElectricalRpm::new(-huge))), i32::MIN);
        assert_eq!(raw(Command::Position(Degrees::new(huge))), i32::MAX);
        assert_eq!(raw(Command::Position(Degrees::new(-huge))), i32::MIN);
    }
    // To the last step: an f32 times a million alone would be 7 steps off.
    assert_eq!(raw(Command::Position(Degrees::new(359.9))), 359_899_994);
}

#[test]
fn what_is_not_a_number_is_not_sent() {
    let nan = f32::NAN;
    for command in [
        Command::Duty(nan),
        Command::Current(Amps::new(nan)),
        Command::Brake(Amps::new(nan)),
        Command::Speed(ElectricalRpm::new(nan)),
        Command::Position(Degrees::new(nan)),
        Command::RelativeCurrent(nan),
        Command::RelativeBrake(nan),
        Command::Handbrake(Amps::new(nan)),
        Command::RelativeHandbrake(nan),
    ] {
        let (field, neutral) = (command.packet().name(), coast(id(1)));
        assert_eq!(command.pack(id(1)), Err(NotANumber { field, neutral }));
    }
    let setting = Setting::BatteryCut { start: 20.0, end: nan };
    assert_eq!(setting.pack_store(id(1)).unwrap_err().field, "CONF_STORE_BATTERY_CUT");
    let setting = Setting::MotorCurrent { min: Amps::new(nan), max: Amps::ZERO };
    assert_eq!(setting.pack(id(1)).unwrap_err().field, "CONF_CURRENT_LIMITS");
}

fn near(actual: f32, expected: f32) {
    assert!((actual - expected).abs() <= 1e-6 * expected.abs(), "{actual} {expected}");
}

/// Frames of bldc's own broadcast (firmware 7.01).
#[test]
fn statuses_are_those_of_the_firmware() {
    let bytes = [0x00, 0x01, 0x86, 0xA0, 0x01, 0xC9, 0xFF, 0x06];
    let Status::Motion { speed, current, duty } = status(0x917, bytes) else { panic!() };
    near(speed.get(), 100_000.0);
    near(current.get(), 45.7);
    near(duty, -0.25);
    let bytes = [0x00, 0x00, 0x30, 0xD4, 0x00, 0x00, 0x13, 0x88];
    let Status::AmpHours { used, charged } = status(0xE01, bytes) else { panic!() };
    near(used, 1.25);
    near(charged, 0.5);
    let bytes = [0x00, 0x03, 0xBD, 0x08, 0x00, 0x00, 0x57, 0xE4];
    let Status::WattHours { used, charged } = status(0xF01, bytes) else { panic!() };
    near(used, 24.5);
    near(charged, 2.25);
    let bytes = [0x01, 0x6D, 0x01, 0x9C, 0x00, 0x37, 0x18, 0x1F];
    let Status::Temperatures { transistors, motor, input_current, position } =
        status(0x1001, bytes)
    else {
        panic!()
    };
    near(transistors.get(), 36.5);
    near(motor.get(), 41.2);
    near(input_current.get(), 5.5);
    near(position.get(), 123.5);
    let bytes = [0xFF, 0xFF, 0xFF, 0xFB, 0x00, 0xF5, 0x12, 0x34];
    let Status::Tachometer { steps, volts } = status(0x1B01, bytes) else { panic!() };
    assert_eq!(steps, -5);
    near(volts, 24.5);
    let bytes = [0x04, 0xE2, 0x09, 0xC4, 0x02, 0xEE, 0x01, 0xF4];
    let Status::Inputs { analogue: [first, second, third], ppm } = status(0x3A01, bytes) else {
        panic!()
    };
    near(first, 1.25);
    near(second, 2.5);
    near(third, 0.75);
    near(ppm, 0.5);
    let pong = Reply::Pong { from: id(23), to: id(200), hardware: 0 };
    assert_eq!(received(0x12C8, &[0x17, 0x00]), Ok(pong));
}

#[test]
fn what_is_no_status_says_why() {
    use FrameError::{Length, NotMine};
    for (raw, len, error) in [
        (0x901, 7, Length),
        (0x1B05, 5, Length),
        (0x3A05, 0, Length),
        (0x12C8, 1, Length),
        (0x12C8, 8, Length),
        (0x1C64, 8, NotMine),
        (0x301, 4, NotMine),
        (0x1117, 1, NotMine),
        (0xFF01, 8, NotMine),
        (0x1_0901, 8, NotMine),
        (0x1000_0901, 8, NotMine),
        (0x9FF, 8, NotMine),
        (0x12FF, 2, NotMine),
    ] {
        assert_eq!(received(raw, &[0; 8][..len]), Err(error), "{raw:X} {len}");
    }
    assert_eq!(received(0x12C8, &[0xFF, 0]), Err(NotMine));
    let short = CanFrame::eight_bytes(StandardId::new(0x101).unwrap(), [0; 8]);
    assert_eq!(Reply::unpack(&short), Err(NotMine));
    let remote = CanFrame::remote_frame(Packet::Status.id(id(1)), 8).unwrap();
    assert_eq!(Reply::unpack(&remote), Err(NotMine));
}

#[test]
fn no_vesc_has_the_number_of_all() {
    assert_eq!(VescId::new(255), None);
    assert_eq!(VescId::new(254).map(VescId::get), Some(254));
    assert_eq!(VescId::new(0).map(VescId::get), Some(0));
    assert_eq!(Address::Every.byte(), 255);
}

#[test]
fn identifiers_are_packet_and_address() {
    let id = VescId::new(100).unwrap();
    for (packet, raw) in [
        (Packet::SetDuty, 0x64),
        (Packet::SetPos, 0x464),
        (Packet::SetCurrentRel, 0xA64),
        (Packet::Status2, 0xE64),
        (Packet::Ping, 0x1164),
        (Packet::Status6, 0x3A64),
    ] {
        assert_eq!(packet.id(id).as_raw(), raw, "{packet:?}");
    }
    assert_eq!(Packet::Status6.id(Address::Every).as_raw(), 0x3AFF);
}

#[test]
fn numbers_and_packets_are_one_to_one() {
    let known = (0..=255).filter_map(|number| {
        let packet = Packet::from_number(number)?;
        assert_eq!(packet.number(), number);
        Some(packet)
    });
    assert_eq!(known.count(), 26);
}
