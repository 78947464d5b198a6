//! Every decoder and stream parser, given bytes that anybody may have sent. A target panics if a
//! rule is broken: no panic, no value that is not finite, bounded work, a wrong checksum yields
//! nothing, and the next good frame is found.

use rc10_app::{Degrees, Rpm, Seconds, TotalAngle};
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_can::{CanFrame, IdPattern, Micros};
use rc10_motor::dji::{Dji, GM6020_CURRENT, GM6020_VOLTAGE, M2006, M3508};
use rc10_motor::unitree::wire::line::{Command, Parser, Reply};
use rc10_motor::unitree::wire::module;
use rc10_motor::{
    CanMotor, Drive, Feedback, Heard, Request, Target, TxBatch, cybergear, damiao, lk, odrive, vesc,
};

/// What takes bytes.
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
];

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
    let wiring = motor.wiring();
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
                match motor.unpack_feedback(&frame, now) {
                    Ok(Heard::Feedback | Heard::Fault) => {
                        let at = motor.feedback().at;
                        assert!(at == now, "heard at {now}, told {at}");
                    }
                    Ok(Heard::Other) => {}
                    Err(_) => assert_eq!(motor.feedback(), before, "{frame} changed something"),
                }
            }
            10..=13 => {
                let drives = [Drive::Off, Drive::Coast, Drive::Brake, Drive::Hold, Drive::Run];
                let drive = drives[usize::from(source.byte()) % drives.len()];
                motor.update(Seconds::new(0.001), drive);
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
                let target = match source.byte() % 4 {
                    0 => Target::Speed(Rpm::new(value)),
                    1 => Target::Angle(Degrees::new(value)),
                    2 => Target::TotalAngle(TotalAngle::from_microdegrees(
                        i64::from(source.word()) << 20,
                    )),
                    _ => Target::Duty(value),
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
                let _ = motor.answer();
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
    motor(Dji::new(models[usize::from(first & 3)], 3).unwrap(), bytes);
}

/// VESC.
pub fn vesc(bytes: &[u8]) {
    let mut source = Source(bytes);
    while !source.is_empty() {
        if let Ok(vesc::Reply::Status { status, .. }) = vesc::Reply::unpack(&source.frame(&[])) {
            assert!(
                !format!("{status:?}").contains("NaN") && !format!("{status:?}").contains("inf")
            );
        }
    }
}

/// Unitree's RS-485 answers, in a stream.
pub fn unitree_line(bytes: &[u8]) {
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

fn assert_good(reply: &Reply, seen: &[u8]) {
    let start = seen.len().checked_sub(16).expect("an answer of fewer than 16 bytes");
    let answer = &seen[start..];
    let crc = crc_ccitt(&answer[..14]).to_le_bytes();
    assert_eq!(crc, answer[14..], "an answer with a wrong CRC was taken");
    assert!(reply.temperature.get().is_finite());
    // What it says goes back onto the wire.
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
    let mut source = Source(bytes);
    while !source.is_empty() {
        let _ = module::Reply::unpack(&source.frame(&[]));
    }
}

/// Damiao.
pub fn damiao(bytes: &[u8]) {
    let limits = damiao::models::J4310.limits;
    let mut source = Source(bytes);
    while !source.is_empty() {
        let frame = source.frame(&[]);
        if let Ok(told) = damiao::Feedback::unpack(&frame, &limits) {
            assert!(told.position.abs() <= limits.position() * 1.0001);
        }
        let _ = damiao::registers::Reply::unpack(&frame);
    }
}

/// CyberGear and RobStride.
pub fn cybergear(bytes: &[u8]) {
    let mut source = Source(bytes);
    while !source.is_empty() {
        for model in cybergear::models::ALL {
            let _ = cybergear::Reply::unpack(&source.frame(&[]), &model.limits);
        }
    }
}

/// LK.
pub fn lk(bytes: &[u8]) {
    let id = lk::DriveId::new(3).unwrap();
    let mut source = Source(bytes);
    while !source.is_empty() {
        let _ = lk::Reply::from_frame(&source.frame(&[IdPattern::exact(id.can_id())]), id);
    }
}

/// `ODrive`.
pub fn odrive(bytes: &[u8]) {
    let node = odrive::Node::new(5).unwrap();
    let mut source = Source(bytes);
    while !source.is_empty() {
        let any = IdPattern::masked(node.can_id(0), 0x7E0);
        let _ = odrive::Message::from_frame(&source.frame(&[any]), node);
    }
}
