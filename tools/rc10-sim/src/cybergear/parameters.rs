use std::f64::consts::TAU;

use super::Model;
use crate::motor::Shaft;

/// Parameters of types 17 and 18, from index 0x7005 on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// 0x7005: 0 motion, 1 position, 2 velocity, 3 current; RobStride also 5, position at a set
    /// speed. 4 (to zero) and 7 (jog) are not in the CyberGear manual: `python-cybergear` has them.
    pub run_mode: u8,
    /// 0x7006, A.
    pub current: f32,
    /// 0x700A, rad/s.
    pub velocity: f32,
    /// 0x700B, N m.
    pub torque_limit: f32,
    /// 0x7010 and 0x7011, gains of current, and 0x7014, its filter: kept, not simulated.
    pub(super) kept: [f32; 3],
    /// 0x7016, rad.
    pub position: f32,
    /// 0x7017, rad/s.
    pub velocity_limit: f32,
    /// 0x7018, A.
    pub current_limit: f32,
    /// 0x701E, rad/s per rad.
    pub position_gain: f32,
    /// 0x701F, 0x7020: proportional, and integral per step of the device's loop.
    pub velocity_gains: [f32; 2],
    /// 0x7026 (RobStride): 1 for 10 ms between reports, and 5 ms more for each one more.
    pub report_interval: u16,
    /// 0x7028 (RobStride): steps of 50 µs without a frame after which it stops; 0 for never.
    pub timeout: u32,
}

impl Parameters {
    /// As the model is sold (CyberGear manual, and RobStride manuals, parameter tables).
    #[expect(clippy::cast_possible_truncation, reason = "short numbers from a table")]
    pub const fn new(model: &Model) -> Self {
        let robstride = model.robstride;
        Self {
            run_mode: 0,
            current: 0.0,
            velocity: 0.0,
            torque_limit: model.torque as f32,
            kept: if robstride { [0.17, 0.012, 0.1] } else { [0.125, 0.0158, 0.1] },
            position: 0.0,
            velocity_limit: if robstride { 10.0 } else { 2.0 },
            current_limit: model.current as f32,
            position_gain: if robstride { 40.0 } else { 30.0 },
            velocity_gains: if robstride { [6.0, 0.02] } else { [1.0, 0.002] },
            report_interval: 1,
            timeout: 0,
        }
    }

    /// The value at an index, little endian; `None` if there is no such parameter. The shaft stands at
    /// `position`, rad, all turns counted.
    #[expect(clippy::cast_possible_truncation, reason = "as precise as the device tells it")]
    pub(super) fn read(
        &self,
        index: u16,
        model: &Model,
        position: f64,
        shaft: &Shaft,
    ) -> Option<[u8; 4]> {
        let real = match index {
            0x7005 => return Some([self.run_mode, 0, 0, 0]),
            // Turns of the rotor.
            0x701D if !model.robstride => {
                let turns = position * shaft.plant.gear_ratio / TAU;
                return Some(u32::from((turns as i16).cast_unsigned()).to_le_bytes());
            }
            0x7026 if model.robstride => {
                return Some(u32::from(self.report_interval).to_le_bytes());
            }
            0x7028 if model.robstride => return Some(self.timeout.to_le_bytes()),
            0x7019 => position as f32,
            0x701A => shaft.current as f32,
            0x701B => shaft.speed as f32,
            0x701C => shaft.plant.supply as f32,
            _ => {
                let mut copy = *self;
                *copy.real(index, model)?.0
            }
        };
        Some(real.to_le_bytes())
    }

    /// Sets what stands at an index. Beyond its range a value is cut off (*assumed*). `None`: there is
    /// no such parameter, it cannot be written, or not with that.
    pub(super) fn write(&mut self, index: u16, value: [u8; 4], model: &Model) -> Option<()> {
        match index {
            0x7005 => {
                let known = matches!(value[0], 0..=3)
                    || value[0] == 5 && model.robstride
                    || matches!(value[0], 4 | 7) && !model.robstride;
                self.run_mode = known.then_some(value[0])?;
            }
            0x7026 if model.robstride => {
                self.report_interval = u16::from_le_bytes([value[0], value[1]]).max(1);
            }
            0x7028 if model.robstride => self.timeout = u32::from_le_bytes(value),
            _ => {
                let number = f32::from_le_bytes(value);
                let (place, least, most) = self.real(index, model)?;
                *place = number.is_finite().then(|| number.clamp(least, most))?;
            }
        }
        Some(())
    }

    /// The place of a number that can be read and written, and its range.
    #[expect(clippy::cast_possible_truncation, reason = "ranges from a table")]
    const fn real(&mut self, index: u16, model: &Model) -> Option<(&mut f32, f32, f32)> {
        const MOST: f32 = f32::MAX;
        let (torque, speed) = (model.torque as f32, model.velocity as f32);
        let current = model.current as f32;
        Some(match index {
            0x7006 => (&mut self.current, -current, current),
            0x700A => (&mut self.velocity, -speed, speed),
            0x700B => (&mut self.torque_limit, 0.0, torque),
            0x7010 => (&mut self.kept[0], 0.0, MOST),
            0x7011 => (&mut self.kept[1], 0.0, MOST),
            0x7014 => (&mut self.kept[2], 0.0, MOST),
            0x7016 => (&mut self.position, -MOST, MOST),
            0x7017 => (&mut self.velocity_limit, 0.0, speed),
            0x7018 => (&mut self.current_limit, 0.0, current),
            0x701E => (&mut self.position_gain, 0.0, MOST),
            0x701F => (&mut self.velocity_gains[0], 0.0, MOST),
            0x7020 => (&mut self.velocity_gains[1], 0.0, MOST),
            _ => return None,
        })
    }
}
