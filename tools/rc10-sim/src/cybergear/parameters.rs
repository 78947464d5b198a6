use super::Model;

/// There is no such parameter, it cannot be written, or not with that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Unknown;

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
    /// 0x7010, 0x7011: kept, not simulated.
    pub current_gains: [f32; 2],
    /// 0x7014: kept, not simulated.
    pub current_filter: f32,
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

/// Parameters that can only be read.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Measured {
    /// 0x7019, rad, all turns counted.
    pub(super) position: f64,
    /// 0x701A, A.
    pub(super) current: f64,
    /// 0x701B, rad/s.
    pub(super) velocity: f64,
    /// 0x701C, V.
    pub(super) supply: f64,
    /// 0x701D, turns of the rotor.
    pub(super) rotor_turns: f64,
}

impl Parameters {
    /// As the model is sold (CyberGear manual, and RobStride manuals, parameter tables).
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "short numbers from a table")]
    pub const fn new(model: &Model) -> Self {
        let robstride = model.robstride;
        Self {
            run_mode: 0,
            current: 0.0,
            velocity: 0.0,
            torque_limit: model.torque as f32,
            current_gains: if robstride { [0.17, 0.012] } else { [0.125, 0.0158] },
            current_filter: 0.1,
            position: 0.0,
            velocity_limit: if robstride { 10.0 } else { 2.0 },
            current_limit: model.current as f32,
            position_gain: if robstride { 40.0 } else { 30.0 },
            velocity_gains: if robstride { [6.0, 0.02] } else { [1.0, 0.002] },
            report_interval: 1,
            timeout: 0,
        }
    }

    /// The value at an index, little endian.
    #[expect(clippy::cast_possible_truncation, reason = "as precise as the device tells it")]
    pub(super) fn read(
        &self,
        index: u16,
        model: &Model,
        measured: &Measured,
    ) -> Result<[u8; 4], Unknown> {
        let real = match index {
            0x7005 => return Ok([self.run_mode, 0, 0, 0]),
            0x701D if !model.robstride => {
                let [low, high] = (measured.rotor_turns as i16).to_le_bytes();
                return Ok([low, high, 0, 0]);
            }
            0x7026 if model.robstride => {
                let [low, high] = self.report_interval.to_le_bytes();
                return Ok([low, high, 0, 0]);
            }
            0x7028 if model.robstride => return Ok(self.timeout.to_le_bytes()),
            0x7019 => measured.position as f32,
            0x701A => measured.current as f32,
            0x701B => measured.velocity as f32,
            0x701C => measured.supply as f32,
            _ => {
                let mut copy = *self;
                *copy.real(index).ok_or(Unknown)?
            }
        };
        Ok(real.to_le_bytes())
    }

    /// Sets what stands at an index. Beyond its range a value is cut off (*assumed*).
    pub(super) fn write(
        &mut self,
        index: u16,
        value: [u8; 4],
        model: &Model,
    ) -> Result<(), Unknown> {
        match index {
            0x7005 => {
                let known = matches!(value[0], 0..=3)
                    || value[0] == 5 && model.robstride
                    || matches!(value[0], 4 | 7) && !model.robstride;
                self.run_mode = if known { value[0] } else { return Err(Unknown) };
            }
            0x7026 if model.robstride => {
                self.report_interval = u16::from_le_bytes([value[0], value[1]]).max(1);
            }
            0x7028 if model.robstride => self.timeout = u32::from_le_bytes(value),
            _ => {
                let number = f32::from_le_bytes(value);
                let largest = |field: f64| {
                    #[expect(clippy::cast_possible_truncation, reason = "a range from a table")]
                    return field as f32;
                };
                let (torque, speed) = (largest(model.torque), largest(model.velocity));
                let current = largest(model.current);
                let place = self.real(index).ok_or(Unknown)?;
                if !number.is_finite() {
                    return Err(Unknown);
                }
                *place = match index {
                    0x7006 => number.clamp(-current, current),
                    0x700A => number.clamp(-speed, speed),
                    0x700B => number.clamp(0.0, torque),
                    0x7017 => number.clamp(0.0, speed),
                    0x7018 => number.clamp(0.0, current),
                    0x7016 => number,
                    _ => number.max(0.0),
                };
            }
        }
        Ok(())
    }

    /// The place of a number that can be read and written.
    const fn real(&mut self, index: u16) -> Option<&mut f32> {
        Some(match index {
            0x7006 => &mut self.current,
            0x700A => &mut self.velocity,
            0x700B => &mut self.torque_limit,
            0x7010 => &mut self.current_gains[0],
            0x7011 => &mut self.current_gains[1],
            0x7014 => &mut self.current_filter,
            0x7016 => &mut self.position,
            0x7017 => &mut self.velocity_limit,
            0x7018 => &mut self.current_limit,
            0x701E => &mut self.position_gain,
            0x701F => &mut self.velocity_gains[0],
            0x7020 => &mut self.velocity_gains[1],
            _ => return None,
        })
    }
}
