//! Every decoder and stream parser, given arbitrary bytes. A target panics if a
//! rule is broken: no panic, no value that is not finite, bounded work, a wrong checksum yields
//! nothing, and the next good frame is found.

use std::num::NonZeroU8;

use rc10_app::{
    Amps, Degrees, Gear, NewtonMetres, PidConfig, Rpm, RpmPerSecond, Seconds, TotalAngle,
};
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_can::{CanFrame, IdPattern};
use rc10_link::frame::{AROUND, ASK, BODY, FromPc, FromRobot, Writer};
use rc10_link::samples::Head;
use rc10_link::{Ask, Tell};
use rc10_module::Stream;
use rc10_motor::damiao::Control;
use rc10_motor::dji::{self, Dji, GM6020_CURRENT, GM6020_VOLTAGE, M2006, M3508};
use rc10_motor::rc10_app::{Cascade, FeedForward};
use rc10_motor::unitree::wire::line::{Command, Parser, Reply};
use rc10_motor::unitree::{GoM8010, GoModule, LineConfig, ModuleConfig, Rs485Bus, Step};
use rc10_motor::{
    ArmSwitch, CanMotor, DriveMode, Feedback, FrameKind, Impedance, Link, Request, Safety, Target,
    Tick, TxBatch, cybergear, damiao, lk, odrive, vesc,
};
use rc10_time::Micros;

use super::request::{Door, Plots, Request as HttpRequest, read};
pub use super::streams::{
    action, crsf, dbus, jrt, ppm, rc9, referee, rm_vision, sbus, stp23l, tfmini, vt03, wit,
};
pub use super::tools::{bmi088, client, command, conversation, lines, record};

/// A target: a function of bytes.
pub type Feed = fn(&[u8]);

/// All targets, by name.
pub const TARGETS: &[(&str, Feed)] = &[
    ("dji", dji),
    ("vesc", vesc),
    ("unitree_line", unitree_line),
    ("unitree_module", unitree_module),
    ("damiao", damiao),
    ("cybergear", cybergear),
    ("lk", lk),
    ("odrive", odrive),
    ("link", link),
    ("http", http),
    ("action", action),
    ("crsf", crsf),
    ("dbus", dbus),
    ("jrt", jrt),
    ("ppm", ppm),
    ("rc9", rc9),
    ("referee", referee),
    ("rm_vision", rm_vision),
    ("sbus", sbus),
    ("stp23l", stp23l),
    ("tfmini", tfmini),
    ("vt03", vt03),
    ("wit", wit),
    ("client", client),
    ("conversation", conversation),
    ("lines", lines),
    ("record", record),
    ("bmi088", bmi088),
    ("command", command),
];

/// The link to a PC, at both ends: a whole frame is heard behind anything, however it comes in pieces;
/// what is heard before had a good CRC.
pub fn link(bytes: &[u8]) {
    let hello = Ask::Hello { version: 0x4711 };
    let mut frame = Writer::<{ ASK + AROUND }>::new();
    frame.message(&hello);
    // What was begun may claim to be as long as the longest frame.
    let filler = [0; BODY + AROUND];
    let whole: Vec<u8> = bytes.iter().chain(frame.bytes()).chain(&filler).copied().collect();
    let (mut robot, mut pc) = (Stream::new(FromPc), Stream::new(FromRobot));
    let (mut asked, mut told) = (Vec::new(), Vec::new());
    let mut rest = whole.as_slice();
    let mut size = 1;
    while !rest.is_empty() {
        let (piece, later) = rest.split_at(size.min(rest.len()));
        robot.receive(piece, Micros::ZERO, |ask| asked.push(ask));
        pc.receive(piece, Micros::ZERO, |body| told.push(body));
        (rest, size) = (later, size * 7 % 61 + 1);
    }
    assert!(asked.contains(&hello), "{asked:?}");
    assert!(told.iter().any(|body| postcard::from_bytes(body) == Ok(hello.clone())));
    for body in told {
        if let Some((head, values)) = Head::of(&body) {
            assert!(head.bytes().len() + 4 * values.len() == body.len());
        }
        let _ = postcard::take_from_bytes::<Tell<'_>>(&body);
    }
}

/// Requests to the page of `rc10 live`, one behind the other: a part of one is not answered, and what is behind it
/// changes nothing; what is refused stays so, whatever follows.
pub fn http(bytes: &[u8]) {
    let mut rest = bytes;
    loop {
        let door = Door::here(8010);
        let outcome = read(rest, &door);
        if outcome.is_err() {
            assert_eq!(outcome, read(&[rest, b"\r\n\r\n"].concat(), &door));
        }
        let Ok(Some(HttpRequest { len, target, body, .. })) = &outcome else { return };
        let (head, behind) = rest.split_at(*len);
        assert!(body.len() < head.len() && head.ends_with(body));
        assert_eq!(read(head, &door), outcome);
        assert_eq!(read(&head[..len - 1], &door), Ok(None));
        assert_eq!(read(&head[..len / 2], &door), Ok(None));
        let query = target.split_once('?').map_or("", |(_, query)| query);
        if let Some(plots) = Plots::parse(query) {
            assert!(plots.signals.len() <= 64 && plots.span[0] <= plots.span[1]);
        }
        rest = behind;
    }
}

/// Bytes, taken one after the other; zeros when there are no more.
struct Source<'b>(&'b [u8]);

impl Source<'_> {
    fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    fn word(&mut self) -> u32 {
        u32::from_le_bytes([self.byte(), self.byte(), self.byte(), self.byte()])
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// An identifier that fits one of the patterns, or any at all.
    fn id(&mut self, patterns: &[IdPattern]) -> Id {
        let choice = usize::from(self.byte());
        let noise = self.word();
        match patterns.get(choice % (patterns.len() + 1)) {
            Some(pattern) => {
                let free = !pattern.mask();
                match pattern.id() {
                    Id::Standard(id) => {
                        let raw = (u32::from(id.as_raw()) | noise & free) & 0x7FF;
                        StandardId::new(raw as u16).unwrap().into()
                    }
                    Id::Extended(id) => {
                        let raw = (id.as_raw() | noise & free) & 0x1FFF_FFFF;
                        ExtendedId::new(raw).unwrap().into()
                    }
                }
            }
            None if choice & 1 == 0 => StandardId::new((noise & 0x7FF) as u16).unwrap().into(),
            None => ExtendedId::new(noise & 0x1FFF_FFFF).unwrap().into(),
        }
    }

    /// A frame: mostly of eight bytes, now and then shorter, or a remote request.
    fn frame(&mut self, patterns: &[IdPattern]) -> CanFrame {
        let id = self.id(patterns);
        let shape = self.byte();
        let len = if shape < 0xC0 { 8 } else { usize::from(shape & 7) };
        if shape >= 0xF8 {
            return CanFrame::remote_frame(id, len).unwrap();
        }
        let data: [u8; 8] = std::array::from_fn(|_| self.byte());
        CanFrame::data_frame(id, &data[..len]).unwrap()
    }
}

fn finite(feedback: &Feedback) {
    let told = [
        Some(feedback.speed.get()),
        Some(feedback.angle.get()),
        feedback.current().map(|value| value.get()),
        feedback.torque().map(|value| value.get()),
        feedback.temperature().map(|value| value.get()),
        feedback.controller_temperature().map(|value| value.get()),
        feedback.supply().map(|value| value.get()),
    ];
    assert!(told.iter().flatten().all(|value| value.is_finite()), "{feedback:?}");
    let angle = feedback.angle.get();
    assert!((0.0..360.0).contains(&angle), "{angle} degrees in a turn");
}

/// A motor that hears anything, is told anything, and ticks.
fn motor(mut motor: impl CanMotor, bytes: &[u8]) {
    let wiring = motor.can_ids();
    let patterns: Vec<IdPattern> = wiring.received().iter().map(|one| one.pattern).collect();
    let mut source = Source(bytes);
    let mut now = Micros::ZERO;
    while !source.is_empty() {
        let step = source.byte();
        now += Micros::new(u64::from(step & 0x0F) * 700);
        match step >> 4 {
            0..=9 => {
                let frame = source.frame(&patterns);
                let before = motor.feedback();
                match motor.unpack_feedback(&frame, now, Link::Online) {
                    Ok(FrameKind::Feedback) => {
                        let at = motor.feedback().at;
                        assert!(at == now, "heard at {now}, told {at}");
                    }
                    // A fault may be told without a measurement.
                    Ok(FrameKind::Fault | FrameKind::Other) => {}
                    Err(_) => assert_eq!(motor.feedback(), before, "{frame} changed something"),
                }
            }
            10..=13 => {
                let drives = [
                    DriveMode::Off,
                    DriveMode::Coast,
                    DriveMode::Brake,
                    DriveMode::Hold,
                    DriveMode::Run,
                ];
                let drive = drives[usize::from(source.byte()) % drives.len()];
                motor.update(&Tick::new(drive));
                let mut tx = TxBatch::new();
                motor.pack_command(&mut tx).unwrap();
                for frame in tx.frames() {
                    let own = wiring.transmitted().iter().any(|sent| {
                        sent.pattern.contains(frame.id()) && usize::from(sent.len) == frame.len()
                    });
                    assert!(own, "{frame} is not in its wiring");
                }
            }
            14 => {
                let value = f32::from_bits(source.word());
                let target = match source.byte() % 8 {
                    0 => Target::Speed(Rpm::new(value)),
                    1 => Target::Angle(Degrees::new(value)),
                    2 => Target::TotalAngle(TotalAngle::from_microdegrees(
                        i64::from(source.word()) << 20,
                    )),
                    3 => Target::Duty(value),
                    4 => Target::Torque(NewtonMetres::new(value)),
                    5 => Target::Current(Amps::new(value)),
                    6 => Target::Impedance(Impedance {
                        angle: Degrees::new(value),
                        speed: Rpm::new(f32::from(source.byte())),
                        torque: NewtonMetres::new(f32::from_bits(source.word())),
                        kp: f32::from_bits(source.word()),
                        kd: 1.0,
                    }),
                    _ => Target::Handbrake(Amps::new(value)),
                };
                let _ = motor.set_target(target);
            }
            _ => {
                let _ = motor.request(match source.byte() % 4 {
                    0 => Request::SetZero,
                    1 => Request::ClearFault,
                    2 => Request::ReadRegister(source.byte().into()),
                    _ => Request::StoreZero,
                });
                let _ = motor.response();
            }
        }
        finite(&motor.feedback());
        assert!(motor.fault().is_none_or(|fault| !fault.text.is_empty()));
    }
}

/// DJI's four.
pub fn dji(bytes: &[u8]) {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let models = [&M3508, &M2006, &GM6020_CURRENT, &GM6020_VOLTAGE];
    motor(Dji::new(dji::Config::new(models[usize::from(first & 3)], 3)).unwrap(), bytes);
}

/// VESC, with all status frames.
pub fn vesc(bytes: &[u8]) {
    let scale = vesc::ElectricalScale::new(NonZeroU8::new(7).unwrap(), Gear::new(3, 1).unwrap());
    let amps = Amps::new(20.0);
    let currents = vesc::Currents { limit: amps, brake: amps, handbrake: amps };
    let status = vesc::StatusRates {
        status_1: 200,
        status_2: 10,
        status_3: 10,
        status_4: 10,
        status_5: 200,
        status_6: 10,
    };
    let config = vesc::Config::new(7, scale, currents);
    motor(vesc::Vesc::new(vesc::Config { status, ..config }).unwrap(), bytes);
}

/// Unitree's RS-485 answers, in a stream.
pub fn unitree_line(bytes: &[u8]) {
    line_master(bytes);
    let mut parser = Parser::new();
    let mut seen: Vec<u8> = Vec::new();
    for &byte in bytes {
        seen.push(byte);
        if let Some(reply) = parser.push(byte) {
            assert_good(&reply, &seen);
        }
    }
    // Whatever came before, the next good answer is found: at the latest once what looked like
    // the beginning of another one is over.
    let mut good = vec![0xFD, 0xEE, 0x13, 1, 0, 2, 0, 3, 0, 0, 0, 30, 0, 0];
    good.extend(crc_ccitt(&good).to_le_bytes());
    let mut found = 0;
    for _ in 0..2 {
        found += good.iter().filter(|byte| parser.push(**byte).is_some()).count();
    }
    assert!(found >= 1, "the next good answer is lost");
}

/// The master of a line that hears these bytes in pieces.
fn line_master(bytes: &[u8]) {
    let switch = ArmSwitch::new();
    let mut motors = [0, 3].map(|id| GoM8010::new(LineConfig::new(id)).unwrap());
    let mut line = Rs485Bus::new(&switch);
    let ids = motors.each_mut().map(|motor| line.attach(motor, Safety::HOLD).unwrap());
    switch.arm().unwrap();
    let (mut now, mut source) = (Micros::ZERO, Source(bytes));
    while !source.is_empty() {
        let step = source.byte();
        now += Micros::new(u64::from(step) * 5);
        if let Step::Wait(until) = line.poll(now) {
            assert!(until > now, "it waits for what is over");
        }
        let (piece, rest) = source.0.split_at(source.0.len().min(usize::from(step & 0x1F)));
        source.0 = rest;
        line.on_bytes(piece, now);
        for id in ids {
            let _ = line.command(id, Target::Speed(Rpm::new(f32::from(step))), now);
        }
        line.tick(now, Seconds::new(0.001));
        ids.iter().for_each(|id| finite(&line.status(*id, now).unwrap().feedback));
    }
}

fn assert_good(reply: &Reply, seen: &[u8]) {
    let start = seen.len().checked_sub(16).expect("an answer of fewer than 16 bytes");
    let answer = &seen[start..];
    let crc = crc_ccitt(&answer[..14]).to_le_bytes();
    assert_eq!(crc, answer[14..], "an answer with a wrong CRC was taken");
    assert!(reply.temperature.get().is_finite());
    // Its answer goes back onto the wire.
    let back = Command {
        address: reply.address,
        status: reply.status,
        motion: reply.motion,
        impedance: Default::default(),
    };
    assert_eq!(back.pack().len(), 17);
}

/// CRC-16/KERMIT bit by bit, without the tables of the codec under test.
fn crc_ccitt(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8)
            .fold(crc ^ u16::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { 0x8408 } else { 0 })
    })
}

/// Unitree's CAN module.
pub fn unitree_module(bytes: &[u8]) {
    motor(GoModule::new(ModuleConfig::new(2, 3)).unwrap(), bytes);
}

/// Efforts in N m.
const CASCADE: Cascade = Cascade {
    speed: PidConfig::within(5.0).kp(0.05).ki(0.5),
    angle: PidConfig::within(100.0).kp(2.0),
    outer_divider: 1,
    acceleration: RpmPerSecond::new(1000.0),
    feed_forward: FeedForward::NONE,
};

/// Damiao, in each of its modes.
pub fn damiao(bytes: &[u8]) {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let speed = Rpm::new(60.0);
    let controls = [
        Control::Mit(CASCADE),
        Control::Velocity,
        Control::PositionVelocity { speed },
        Control::ForcePosition { speed, torque_share: 0.5 },
    ];
    let control = controls[usize::from(first & 3)];
    motor(
        damiao::Damiao::new(damiao::Config::new(damiao::models::J4310, 0x11, 0x31, control))
            .unwrap(),
        bytes,
    );
}

/// CyberGear and RobStride.
pub fn cybergear(bytes: &[u8]) {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let models = cybergear::models::ALL;
    let model = models[usize::from(*first) % models.len()];
    let address = cybergear::Address { motor: 0x7F, host: 0xFD };
    motor(cybergear::CyberGear::new(cybergear::Config::new(model, address)).unwrap(), bytes);
}

/// LK, commanded alone or with others.
pub fn lk(bytes: &[u8]) {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let commands = [lk::Commands::Single, lk::Commands::MultiMotor];
    let config = lk::Config::new(lk::models::MG4010E_I10, 3, CASCADE);
    let config = config.with_commands(commands[usize::from(first & 1)]);
    motor(lk::Lk::new(config).unwrap(), bytes);
}

/// `ODrive`, in each of its modes.
pub fn odrive(bytes: &[u8]) {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let controls = [
        odrive::Control::Torque(CASCADE),
        odrive::Control::Velocity(odrive::InputMode::VelocityRamp),
        odrive::Control::Position(odrive::InputMode::Trapezoid),
    ];
    let control = controls[usize::from(*first) % controls.len()];
    let rates = odrive::Rates { currents: 100, supply: 10, ..odrive::Rates::new(1000, 100) };
    let config = odrive::Config::new(5, odrive::Firmware::V0_6, control, rates);
    let limits = odrive::Limits { speed: Rpm::new(300.0), current: Amps::new(20.0) };
    motor(odrive::ODrive::new(config.with_limits(limits)).unwrap(), bytes);
}
