//! The frames, as the device reads and writes them. Angles in rad, speeds in rad/s, torques in N·m,
//! at the output shaft.

/// Ranges of the mapped fields: registers 21 to 23.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// `PMAX`, rad.
    pub position: f64,
    /// `VMAX`, rad/s.
    pub velocity: f64,
    /// `TMAX`, N·m.
    pub torque: f64,
}

/// Largest stiffness, N·m/rad, and damping, N·m·s/rad, of MIT mode.
const STIFFNESS: f64 = 500.0;
const DAMPING: f64 = 5.0;

/// Control mode: register 10.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Spring, damper and torque.
    Mit = 1,
    /// A position, with a velocity limit.
    PositionVelocity = 2,
    /// A velocity.
    Velocity = 3,
    /// A position, with limits of velocity and torque.
    ForcePosition = 4,
}

impl Mode {
    pub(super) const ALL: [Self; 4] =
        [Self::Mit, Self::PositionVelocity, Self::Velocity, Self::ForcePosition];

    /// Offset of its commands' identifiers from the motor's own.
    pub const fn offset(self) -> u32 {
        0x100 * (self as u32 - 1)
    }
}

/// A frame of seven 0xFF and one of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// 0xFB.
    ClearError,
    /// 0xFC.
    Enable,
    /// 0xFD.
    Disable,
    /// 0xFE.
    StoreZero,
}

impl Operation {
    /// The operation in a payload; `None` for another payload.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let (last, ones) = payload.split_last()?;
        if ones != [0xFF; 7] {
            return None;
        }
        Some(match last {
            0xFB => Self::ClearError,
            0xFC => Self::Enable,
            0xFD => Self::Disable,
            0xFE => Self::StoreZero,
            _ => return None,
        })
    }
}

/// A setpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// Torque = `kp` (`position` - measured) + `kd` (`velocity` - measured) + `torque`.
    Mit {
        /// rad
        position: f64,
        /// rad/s
        velocity: f64,
        /// N·m/rad
        kp: f64,
        /// N·m·s/rad
        kd: f64,
        /// N·m
        torque: f64,
    },
    /// Go there, no faster than this.
    PositionVelocity {
        /// rad
        position: f64,
        /// rad/s
        velocity: f64,
    },
    /// Turn so fast, rad/s.
    Velocity(f64),
    /// Go there, no faster than this, with no more than this share of the largest torque.
    ForcePosition {
        /// rad
        position: f64,
        /// rad/s
        velocity: f64,
        /// 0 ..= 1
        share: f64,
    },
}

impl Setpoint {
    /// The setpoint in a payload; `None` for a length or number that the mode does not have.
    ///
    /// A velocity is four bytes, and eight are taken too: the vendor's Python code sends so.
    pub fn decode(mode: Mode, payload: &[u8], limits: &Limits) -> Option<Self> {
        let float =
            |bytes| Some(f32::from_le_bytes(bytes).into()).filter(|it: &f64| it.is_finite());
        Some(match (mode, payload) {
            (Mode::Mit, _) => {
                // One number of 64 bits, cut from its lowest bit on.
                let word = u64::from_be_bytes(payload.try_into().ok()?);
                let field = |shift: u32, bits: u32| (word >> shift) & ((1 << bits) - 1);
                Self::Mit {
                    position: unmap(field(48, 16), 16, -limits.position, limits.position),
                    velocity: unmap(field(36, 12), 12, -limits.velocity, limits.velocity),
                    kp: unmap(field(24, 12), 12, 0.0, STIFFNESS),
                    kd: unmap(field(12, 12), 12, 0.0, DAMPING),
                    torque: unmap(field(0, 12), 12, -limits.torque, limits.torque),
                }
            }
            (Mode::PositionVelocity, &[a, b, c, d, e, f, g, h]) => Self::PositionVelocity {
                position: float([a, b, c, d])?,
                velocity: float([e, f, g, h])?,
            },
            (Mode::Velocity, &([a, b, c, d] | [a, b, c, d, _, _, _, _])) => {
                Self::Velocity(float([a, b, c, d])?)
            }
            (Mode::ForcePosition, &[a, b, c, d, v0, v1, s0, s1]) => {
                let [velocity, share] = [[v0, v1], [s0, s1]].map(u16::from_le_bytes);
                if velocity > 10_000 || share > 10_000 {
                    return None;
                }
                Self::ForcePosition {
                    position: float([a, b, c, d])?,
                    velocity: f64::from(velocity) / 100.0,
                    share: f64::from(share) / 10_000.0,
                }
            }
            _ => return None,
        })
    }
}

/// Feedback frame, the answer to nearly every command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// The identifier, of which four bits are sent.
    pub id: u16,
    /// 0 disabled, 1 enabled, else what is wrong.
    pub code: u8,
    /// rad
    pub position: f64,
    /// rad/s
    pub velocity: f64,
    /// N·m
    pub torque: f64,
    /// Temperature of the power stage, °C.
    pub bridge_temperature: f64,
    /// Temperature of the winding, °C.
    pub winding_temperature: f64,
}

impl Report {
    /// The eight bytes.
    pub fn encode(&self, limits: &Limits) -> [u8; 8] {
        let nibble = (self.id & 0xF) as u8;
        let word = u64::from(self.code << 4 | nibble) << 56
            | map(self.position, 16, limits.position) << 40
            | map(self.velocity, 12, limits.velocity) << 28
            | map(self.torque, 12, limits.torque) << 16
            | degrees(self.bridge_temperature) << 8
            | degrees(self.winding_temperature);
        word.to_be_bytes()
    }
}

/// Access to a register, on 0x7FF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// 0x33.
    Read(u8),
    /// 0x55, four bytes.
    Write(u8, [u8; 4]),
    /// 0xAA 01.
    Save,
    /// 0xCC: send a report.
    Report,
}

impl Access {
    /// The motor's identifier and the access; `None` for any other payload. Four bytes or eight.
    pub fn decode(payload: &[u8]) -> Option<(u16, Self)> {
        let (head, rest) = payload.split_first_chunk::<4>()?;
        if !matches!(rest.len(), 0 | 4) {
            return None;
        }
        let [low, high, operation, register] = *head;
        let access = match (operation, register) {
            (0x33, _) => Self::Read(register),
            (0x55, _) => Self::Write(register, rest.try_into().ok()?),
            (0xAA, 0x01) => Self::Save,
            (0xCC, _) => Self::Report,
            _ => return None,
        };
        Some((u16::from_le_bytes([low, high]), access))
    }
}

fn unmap(raw: u64, bits: u32, low: f64, high: f64) -> f64 {
    let share = raw as f64 / ((1_u64 << bits) - 1) as f64;
    low + share * (high - low)
}

/// Cuts off below the step, as the vendor's code does; what lies beyond the range goes to its end.
fn map(value: f64, bits: u32, limit: f64) -> u64 {
    let most = ((1_u64 << bits) - 1) as f64;
    #[expect(clippy::cast_possible_truncation, reason = "0 ..= most")]
    return ((value + limit) / (2.0 * limit) * most).clamp(0.0, most) as u64;
}

fn degrees(celsius: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, reason = "0 ..= 255")]
    return celsius.round().clamp(0.0, 255.0) as u64;
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { position: 12.5, velocity: 30.0, torque: 10.0 };

    #[test]
    fn fields_stand_where_the_manual_puts_them() {
        // p 0xFFFF, v 0x7FF, kp 0x333, kd 0x800, t 0xFFF.
        let bytes = [0xFF, 0xFF, 0x7F, 0xF3, 0x33, 0x80, 0x0F, 0xFF];
        let Some(Setpoint::Mit { position, velocity, kp, kd, torque }) =
            Setpoint::decode(Mode::Mit, &bytes, &LIMITS)
        else {
            panic!("not understood");
        };
        assert!((position - 12.5).abs() < 1e-9 && (torque - 10.0).abs() < 1e-9);
        assert!((velocity + 30.0 / 4095.0).abs() < 1e-9, "{velocity}");
        assert!((kp - 100.0).abs() < 0.1 && (kd - 2.5).abs() < 0.01, "{kp} {kd}");
        let report = Report {
            id: 0x13,
            code: 1,
            position: 0.0,
            velocity: -30.0,
            torque: 10.0,
            bridge_temperature: 31.4,
            winding_temperature: 300.0,
        };
        assert_eq!(report.encode(&LIMITS), [0x13, 0x7F, 0xFF, 0x00, 0x0F, 0xFF, 31, 255]);
    }

    #[test]
    fn what_means_nothing_is_not_obeyed() {
        let nan = f32::NAN.to_le_bytes();
        assert_eq!(Setpoint::decode(Mode::Velocity, &nan, &LIMITS), None);
        assert_eq!(Setpoint::decode(Mode::Velocity, &[0; 5], &LIMITS), None);
        assert_eq!(Setpoint::decode(Mode::Mit, &[0; 7], &LIMITS), None);
        let fast = [0, 0, 0, 0, 0x11, 0x27, 0, 0];
        assert_eq!(Setpoint::decode(Mode::ForcePosition, &fast, &LIMITS), None);
        assert_eq!(Operation::decode(&[0xFF; 8]), None);
        assert_eq!(Access::decode(&[1, 0, 0x55, 10]), None);
        assert_eq!(Access::decode(&[1, 2, 0x33, 10]), Some((0x201, Access::Read(10))));
    }
}
