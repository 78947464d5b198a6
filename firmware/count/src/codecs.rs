//! Each vendor's codec: a frame packed from values, values unpacked from a frame.

use core::hint::black_box;

use rc10_app::{Amps, Degrees, NewtonMetres, RotorRpm, Rpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_motor::dji::{M3508, RawFeedback};
use rc10_motor::unitree::wire::{self as unitree, line, module};
use rc10_motor::{FrameError, cybergear, damiao, lk, odrive, vesc};

/// Measures all of them.
pub fn measure() {
    each(&[0.0, 3.7, -12.0, 19.9, 40.0], dji_pack);
    each(&[[0x12, 0x34, 0x01, 0xF4, 0xFF, 0x38, 35, 0]], dji_unpack);
    vescs();
    unitrees();
    damiaos();
    cybergears();
    lks();
    odrives();
}

fn each<T, O: Default>(inputs: &[T], codec: fn(&T, &mut O)) {
    let mut out = O::default();
    for input in inputs {
        codec(black_box(input), black_box(&mut out));
    }
}

/// Result of a measured function, kept so that it is not optimised away.
struct Out<T>(Option<T>);

impl<T> Default for Out<T> {
    fn default() -> Self {
        Self(None)
    }
}

/// Gives a function of its own, and a symbol to find it by, to something that is measured.
macro_rules! codec {
    ($symbol:literal, $name:ident, |$input:ident: $in:ty| -> $out:ty { $what:expr }) => {
        // SAFETY: nothing else has this name.
        #[unsafe(export_name = $symbol)]
        #[inline(never)]
        fn $name($input: &$in, out: &mut Out<$out>) {
            out.0 = Some($what);
        }
    };
}

codec!("count_1_codec_dji_pack", dji_pack, |amps: f32| -> i16 { M3508.raw_command(*amps) });
codec!("count_1_codec_dji_unpack", dji_unpack, |bytes: [u8; 8]| -> RawFeedback {
    RawFeedback::unpack(bytes)
});

fn standard(id: u16, data: [u8; 8]) -> CanFrame {
    CanFrame::eight_bytes(StandardId::new(id).unwrap_or(StandardId::ZERO), data)
}

fn extended(id: u32, data: [u8; 8]) -> CanFrame {
    let id = Id::Extended(ExtendedId::new(id).unwrap_or(ExtendedId::ZERO));
    CanFrame::eight_bytes(id, data)
}

type Packed = Result<CanFrame, vesc::NotANumber>;
type Unpacked<T> = Result<T, FrameError>;
type ForModule = (module::Request, module::Module, unitree::Address);
type Mit = (damiao::DeviceId, damiao::Setpoint);

codec!("count_1_codec_vesc_pack", vesc_pack, |to: (vesc::Command, vesc::VescId)| -> Packed {
    to.0.pack(to.1)
});
codec!("count_1_codec_vesc_unpack", vesc_unpack, |frame: CanFrame| -> Unpacked<vesc::Reply> {
    vesc::Reply::unpack(frame)
});

fn vescs() {
    use vesc::Command::{
        Brake, Current, Duty, Handbrake, Position, RelativeBrake, RelativeCurrent,
        RelativeHandbrake, Speed,
    };
    let Some(id) = vesc::VescId::new(7) else { cortex_m::asm::udf() };
    let commands = [
        Duty(0.5),
        Current(Amps::new(-12.5)),
        Brake(Amps::new(3.0)),
        Speed(vesc::ElectricalRpm::new(21_000.0)),
        Position(Degrees::new(123.4)),
        RelativeCurrent(0.3),
        RelativeBrake(2.0),
        Handbrake(Amps::new(1e9)),
        RelativeHandbrake(0.1),
    ];
    each(&commands.map(|command| (command, id)), vesc_pack);
    let data = [0x00, 0x00, 0x52, 0x08, 0xFF, 0x83, 0x01, 0xF4];
    each(&[9, 14, 15, 16, 27, 58].map(|packet| extended(packet << 8 | 7, data)), vesc_unpack);
}

codec!("count_1_crc_unitree_go_pack", line_pack, |command: line::Command| -> [u8; 17] {
    command.pack()
});
codec!(
    "count_1_crc_unitree_go_unpack",
    line_unpack,
    |bytes: [u8; 16]| -> Result<line::Reply, line::ReplyError> { line::Reply::unpack(bytes) }
);
codec!("count_1_codec_unitree_module_pack", module_pack, |request: ForModule| -> CanFrame {
    request.0.pack(request.1, request.2)
});
codec!(
    "count_1_codec_unitree_module_unpack",
    module_unpack,
    |frame: CanFrame| -> Unpacked<module::Reply> { module::Reply::unpack(frame) }
);
codec!(
    "count_1_codec_unitree_scale_pack",
    scale_pack,
    |motion: unitree::Motion| -> unitree::RawMotion { unitree::RotorScale::OUTPUT.raw(motion) }
);
codec!(
    "count_1_codec_unitree_scale_unpack",
    scale_unpack,
    |raw: unitree::RawMotion| -> unitree::Motion { unitree::RotorScale::OUTPUT.motion(*raw) }
);

fn unitrees() {
    use unitree::{Address, Motion, RawImpedance, RawMotion, Status};
    let motion = RawMotion { torque: 192, speed: -812, angle: 123_456 };
    let impedance = RawImpedance { stiffness: 512, damping: 64 };
    let (Some(address), Some(module)) = (Address::new(3), module::Module::new(2)) else {
        cortex_m::asm::udf()
    };
    each(&[line::Command { address, status: Status::FOC, motion, impedance }], line_pack);
    // A good reply: its CRC is that of the code under test, which the vectors check.
    let mut reply = [0xFD, 0xEE, 0x13, 1, 2, 3, 4, 5, 6, 7, 8, 30, 0, 0, 0, 0];
    let [low, high] = line::crc(&reply[..14]).to_le_bytes();
    (reply[14], reply[15]) = (low, high);
    each(&[reply], line_unpack);
    let requests = [
        module::Request::Control(Status::FOC, motion),
        module::Request::SetImpedance(impedance),
        module::Request::ReadImpedance,
    ];
    each(&requests.map(|request| (request, module, address)), module_pack);
    let data = [1, 2, 3, 4, 5, 6, 7, 8];
    let replies = [0x140A_131E_u32, 0x140B_1300, 0x160A_1380];
    each(&replies.map(|id| extended(id, data)), module_unpack);
    let counts_per_turn = unitree::RotorScale::OUTPUT.counts_per_turn();
    let motion = Motion {
        torque: NewtonMetres::new(3.2),
        speed: Rpm::new(-91.0),
        angle: TotalAngle::from_counts(123_456, counts_per_turn),
    };
    each(&[motion], scale_pack);
    each(&[RawMotion { torque: 192, speed: -812, angle: 123_456 }], scale_unpack);
}

const LIMITS: damiao::Limits = damiao::models::J4310.limits;
const GEAR: damiao::Limits = cybergear::models::CYBERGEAR.limits;
const SETPOINTS: [damiao::Setpoint; 3] = [
    damiao::Setpoint::COAST,
    damiao::Setpoint { position: 1.2, velocity: -3.0, kp: 20.0, kd: 1.5, torque: 0.7 },
    damiao::Setpoint { position: 99.0, velocity: 99.0, kp: 999.0, kd: 9.0, torque: -99.0 },
];

codec!("count_1_codec_damiao_pack", damiao_pack, |command: Mit| -> CanFrame {
    damiao::wire::mit(command.0, &command.1, &LIMITS)
});
codec!(
    "count_1_codec_damiao_unpack",
    damiao_unpack,
    |frame: CanFrame| -> Unpacked<damiao::Feedback> { damiao::Feedback::unpack(frame, &LIMITS) }
);

fn damiaos() {
    let Some(id) = damiao::DeviceId::new(0x11) else { cortex_m::asm::udf() };
    each(&SETPOINTS.map(|setpoint| (id, setpoint)), damiao_pack);
    each(&[standard(0x21, [0x11, 0x83, 0x45, 0x7F, 0xF8, 0x12, 40, 38])], damiao_unpack);
}

codec!("count_1_codec_cybergear_pack", cybergear_pack, |setpoint: damiao::Setpoint| -> CanFrame {
    cybergear::wire::motion(5, setpoint, &GEAR)
});
codec!(
    "count_1_codec_cybergear_unpack",
    cybergear_unpack,
    |frame: CanFrame| -> Unpacked<cybergear::Reply> { cybergear::Reply::unpack(frame, &GEAR) }
);

fn cybergears() {
    each(&SETPOINTS, cybergear_pack);
    let data = [0x83, 0x45, 0x7F, 0xF8, 0x81, 0x23, 0x01, 0x5E];
    each(&[0x0280_05FD, 0x1100_05FD, 0x1500_05FD].map(|id| extended(id, data)), cybergear_unpack);
}

const DRIVE: lk::Model = lk::Model::mg(lk::EncoderBits::Sixteen);

codec!("count_1_codec_lk_pack", lk_pack, |command: (lk::Command, lk::DriveId)| -> Packed {
    command.0.pack(command.1, &DRIVE)
});
codec!("count_1_codec_lk_multi_pack", lk_multi_pack, |raw: [i16; 4]| -> CanFrame {
    lk::pack_multi_motor(*raw)
});
codec!(
    "count_1_codec_lk_unpack",
    lk_unpack,
    |it: (CanFrame, lk::DriveId)| -> Unpacked<lk::Reply> { lk::Reply::from_frame(&it.0, it.1) }
);

fn lks() {
    let Some(id) = lk::DriveId::new(3) else { cortex_m::asm::udf() };
    let angle = TotalAngle::from_microdegrees(1_234_560_000);
    let speed_limit = Some(RotorRpm::new(100.0));
    let commands = [
        lk::Command::Off,
        lk::Command::Current(Amps::new(7.5)),
        lk::Command::Speed(RotorRpm::new(-1234.0)),
        lk::Command::TurnTo { angle, speed_limit },
        lk::Command::TurnBy { angle, speed_limit },
        lk::Command::ReadHealth,
    ];
    each(&commands.map(|command| (command, id)), lk_pack);
    each(&[[1, -2, 300, -400]], lk_multi_pack);
    let replies = [0xA1, 0x9A, 0x92, 0x94, 0x80];
    each(&replies.map(|code| (standard(0x143, [code, 35, 1, 2, 3, 4, 5, 6]), id)), lk_unpack);
}

codec!("count_1_codec_odrive_pack", odrive_pack, |to: (odrive::Command, odrive::Node)| -> Packed {
    to.0.pack(to.1)
});
codec!(
    "count_1_codec_odrive_unpack",
    odrive_unpack,
    |it: (CanFrame, odrive::Node)| -> Unpacked<odrive::Message> {
        odrive::Message::from_frame(&it.0, it.1)
    }
);

fn odrives() {
    let Some(node) = odrive::Node::new(5) else { cortex_m::asm::udf() };
    let torque = NewtonMetres::new(0.4);
    let commands = [
        odrive::Command::State(odrive::AxisState::new(8)),
        odrive::Command::Position { position: 1.5, velocity: 0.25, torque },
        odrive::Command::Velocity { velocity: -3.0, torque },
        odrive::Command::Torque(torque),
        odrive::Command::Limits { velocity: 20.0, current: Amps::new(10.0) },
    ];
    each(&commands.map(|command| (command, node)), odrive_pack);
    let data = [0, 0, 0x80, 0x3F, 0, 0, 0, 0x40];
    let frames = [0x01, 0x09, 0x14, 0x17].map(|message| standard(5 << 5 | message, data));
    each(&frames.map(|frame| (frame, node)), odrive_unpack);
}
