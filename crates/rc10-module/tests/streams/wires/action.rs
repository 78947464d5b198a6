use rc10_module::positioning::{self, action::Pose};

use super::super::wire::{Guard, Source, Wire};

/// ACTION: 115,200 baud 8N1, 28 bytes, no checksum.
#[derive(Clone, Copy, Debug)]
pub struct Action;

const LENGTH: usize = 28;

/// The six numbers.
fn numbers(frame: &[u8]) -> [f32; 6] {
    std::array::from_fn(|at| f32::from_le_bytes(frame[2 + 4 * at..][..4].try_into().unwrap()))
}

impl Wire for Action {
    type Protocol = positioning::Action;

    const BYTE_NS: u64 = 86_806;
    const HEADER: &'static [u8] = &[0x0D, 0x0A];
    const GUARD: Guard = Guard::Shape;

    fn protocol(self) -> positioning::Action {
        positioning::Action
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let mut frame = vec![0x0D, 0x0A];
        for _ in 0..6 {
            frame.extend(source.float(1e6).to_le_bytes());
        }
        frame.extend([0x0A, 0x0D]);
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let frame = bytes.get(..LENGTH)?;
        // A comparison with NaN is false.
        let good = frame.starts_with(&[0x0D, 0x0A])
            && frame.ends_with(&[0x0A, 0x0D])
            && numbers(frame).iter().all(|number| number.abs() <= 1e6);
        good.then_some(LENGTH)
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        Some(numbers(frame).map(f64::from).to_vec())
    }

    fn told(self, message: &Pose) -> Vec<f64> {
        let [yaw, x_angle, y_angle] = [message.yaw, message.x_angle, message.y_angle];
        let angles = [yaw, x_angle, y_angle].map(|angle| angle.get());
        let rest = [message.x, message.y, message.yaw_rate];
        [angles, rest].concat().into_iter().map(f64::from).collect()
    }
}
