use rc10_module::vision::{self, Target};

use super::super::wire::{Guard, Source, Wire, crc_reflected, word};

/// `rm_vision` on a PC: 115,200 baud 8N1, 48 bytes.
#[derive(Clone, Copy, Debug)]
pub struct RmVision;

const LENGTH: usize = 48;

fn crc(bytes: &[u8]) -> u16 {
    crc_reflected(bytes, 0xFFFF, 0x8408)
}

fn float(frame: &[u8], at: usize) -> f64 {
    f32::from_le_bytes(frame[at..at + 4].try_into().unwrap()).into()
}

impl Wire for RmVision {
    type Protocol = vision::RmVision;

    const BYTE_NS: u64 = 86_806;
    const HEADER: &'static [u8] = &[0xA5];
    const GUARD: Guard = Guard::Checksum { not_over: &[] };

    fn protocol(self) -> vision::RmVision {
        vision::RmVision
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let mut frame = vec![0xA5, source.byte()];
        for at in 0..11 {
            let any = source.float(1e3);
            // No radius is negative.
            frame.extend(if [8, 9].contains(&at) { any.abs() } else { any }.to_le_bytes());
        }
        let sum = crc(&frame);
        frame.extend(sum.to_le_bytes());
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let frame = bytes.get(..LENGTH).filter(|it| it[0] == 0xA5)?;
        let is_sound = (2..46).step_by(4).all(|at| float(frame, at).is_finite())
            && [34, 38].iter().all(|at| float(frame, *at).is_sign_positive());
        (is_sound && crc(&frame[..46]) == word(frame, 46)).then_some(LENGTH)
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let bits = frame[1];
        let head = [bits % 2, bits / 2 % 8, bits / 16 % 8].map(f64::from);
        Some(head.into_iter().chain((2..46).step_by(4).map(|at| float(frame, at))).collect())
    }

    fn told(self, message: &Target) -> Vec<f64> {
        let Target { is_tracked, number, armours, place, yaw, velocity, yaw_rate, radii, rise } =
            *message;
        let head = [u8::from(is_tracked), number, armours].map(f64::from);
        let [x, y, z] = place;
        let [vx, vy, vz] = velocity;
        let [near, other] = radii;
        let rest = [x, y, z, yaw, vx, vy, vz, yaw_rate, near, other, rise].map(f64::from);
        head.into_iter().chain(rest).collect()
    }
}
