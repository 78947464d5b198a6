//! Reading, writing and saving a motor's settings. All frames go to 0x7FF and name the motor in
//! their first two bytes; it answers on its `MST_ID`, where feedback arrives as well. So a frame is
//! a [`Reply`] only while one is awaited, and only if it [answers](Reply::answers) what was asked.

use rc10_app::ConfigError;
use rc10_can::CanFrame;

use super::wire::{DeviceId, REGISTERS};
use crate::can_ids::standard;
use crate::feedback::Fault;
use crate::motor::FrameError;
use crate::pending::check_timeout;

/// A register, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Register(pub u8);

impl Register {
    /// Silence after which the motor stops, in steps of 50 µs (so the vendor's tool); whole.
    pub const TIMEOUT: Self = Self(9);
    /// `CTRL_MODE`, the number of a [`Mode`](super::Mode); whole.
    pub const MODE: Self = Self(10);
    /// `PMAX`, rad.
    pub const POSITION_LIMIT: Self = Self(21);
    /// `VMAX`, rad/s.
    pub const VELOCITY_LIMIT: Self = Self(22);
    /// `TMAX`, N m.
    pub const TORQUE_LIMIT: Self = Self(23);
    /// Bit rate: 0 125k, 1 200k, 2 250k, 3 500k, 4 1M; whole.
    pub const BIT_RATE: Self = Self(35);

    /// Whether it holds a whole number, not an f32 (manual of J10010L, register table).
    #[must_use]
    pub const fn is_whole(self) -> bool {
        matches!(self.0, 7..=10 | 13..=16 | 35 | 36)
    }

    /// Four bytes, little endian, as what this register holds.
    pub(super) const fn value_of(self, bits: u32) -> Value {
        if self.is_whole() { Value::Whole(bits) } else { Value::Real(f32::from_bits(bits)) }
    }
}

/// Names and units of registers (manual of J10010L; the vendor's `DM_variable`), in capitals. No
/// unit: a plain number, or the sources do not tell.
pub(super) const NAMES: [(u8, &str, &str); 45] = [
    (0, "UV_VALUE", "V"),
    (1, "KT_VALUE", "N m/A"),
    (2, "OT_VALUE", "degC"),
    (3, "OC_VALUE", ""),
    (4, "ACC", ""),
    (5, "DEC", ""),
    (6, "MAX_SPD", "rad/s"),
    (7, "MST_ID", ""),
    (8, "ESC_ID", ""),
    (9, "TIMEOUT", "ms"),
    (10, "CTRL_MODE", ""),
    (11, "DAMP", ""),
    (12, "INERTIA", ""),
    (13, "HW_VER", ""),
    (14, "SW_VER", ""),
    (15, "SN", ""),
    (16, "NPP", ""),
    (17, "RS", ""),
    (18, "LS", ""),
    (19, "FLUX", ""),
    (20, "GR", ""),
    (21, "PMAX", "rad"),
    (22, "VMAX", "rad/s"),
    (23, "TMAX", "N m"),
    (24, "I_BW", ""),
    (25, "KP_ASR", ""),
    (26, "KI_ASR", ""),
    (27, "KP_APR", ""),
    (28, "KI_APR", ""),
    (29, "OV_VALUE", "V"),
    (30, "GREF", ""),
    (31, "DETA", ""),
    (32, "V_BW", ""),
    (33, "IQ_C1", ""),
    (34, "VL_C1", ""),
    (35, "CAN_BR", ""),
    (36, "SUB_VER", ""),
    (50, "U_OFF", ""),
    (51, "V_OFF", ""),
    (52, "K1", ""),
    (53, "K2", ""),
    (54, "M_OFF", ""),
    (55, "DIR", ""),
    (80, "P_M", "rad"),
    (81, "XOUT", "rad"),
];

/// The value of a register.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Value {
    /// An f32.
    Real(f32),
    /// A whole number.
    Whole(u32),
}

impl Value {
    /// The bits on the wire, little endian.
    pub(super) const fn bits(self) -> u32 {
        match self {
            Self::Real(real) => real.to_bits(),
            Self::Whole(whole) => whole,
        }
    }
}

/// A read or write of a register, or another command on the registers' identifier.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Access {
    /// Reads a register.
    Read(Register),
    /// Hold this, until the power is cut. Out of range, the old value stays and is answered.
    Write(Register, Value),
    /// Keep all values without power: while disabled only, up to 30 ms, about 10,000 times.
    Save,
    /// Send a feedback; the answer is that, and no [`Reply`].
    Refresh,
}

pub(super) const READ: u8 = 0x33;
pub(super) const WRITE: u8 = 0x55;
pub(super) const SAVE: u8 = 0xAA;
pub(super) const REFRESH: u8 = 0xCC;

impl Access {
    /// The frame that asks for it: eight bytes for a write, else four.
    ///
    /// # Errors
    /// [`ConfigError`] for a number that is not finite, or not what the register holds.
    pub fn pack(&self, id: DeviceId) -> Result<CanFrame, ConfigError> {
        let [low, high] = id.raw().to_le_bytes();
        let short =
            |operation, last| CanFrame::exact(standard(REGISTERS), [low, high, operation, last]);
        Ok(match *self {
            Self::Read(register) => short(READ, register.0),
            Self::Save => short(SAVE, 1),
            Self::Refresh => short(REFRESH, 0),
            Self::Write(register, value) => {
                let real = f32::from_bits(value.bits());
                let must_be = match value {
                    Value::Real(real) if !real.is_finite() => Some("finite"),
                    Value::Real(_) if register.is_whole() => Some("a whole number"),
                    Value::Whole(_) if !register.is_whole() => Some("an f32"),
                    Value::Real(_) | Value::Whole(_) => None,
                };
                if let Some(must_be) = must_be {
                    return Err(ConfigError::new("register value", real, must_be));
                }
                let [a, b, c, d] = value.bits().to_le_bytes();
                let data = [low, high, WRITE, register.0, a, b, c, d];
                CanFrame::eight_bytes(standard(REGISTERS), data)
            }
        })
    }
}

/// The answer of a motor to an [`Access`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reply {
    /// The motor's `CAN_ID`.
    pub id: u16,
    /// What a register holds; `None`: everything is saved.
    pub held: Option<(Register, Value)>,
    /// It answers a write (0x55). Some models answer one like a read (0x33), too.
    pub is_written: bool,
}

impl Reply {
    /// From a frame that came with the motor's `MST_ID` while a reply was awaited.
    ///
    /// # Errors
    /// [`FrameError`]: [`NotMine`](FrameError::NotMine) by its identifier or its third byte,
    /// [`Unexpected`](FrameError::Unexpected) for a value that is infinite or NaN.
    pub fn unpack(frame: &CanFrame) -> Result<Self, FrameError> {
        if frame.is_extended_id() || frame.is_remote() {
            return Err(FrameError::NotMine);
        }
        let &[low, high, operation, last, ref value @ ..] = frame.bytes() else {
            return Err(FrameError::Length);
        };
        let register = Register(last);
        let held = match operation {
            READ | WRITE => Some((register, held(register, value)?)),
            SAVE if last == 1 => None,
            _ => return Err(FrameError::NotMine),
        };
        let id = u16::from_le_bytes([low, high]);
        Ok(Self { id, held, is_written: operation == WRITE })
    }

    /// Whether this is motor `id`'s answer to `access`. A refused write answers another value.
    pub fn answers(&self, id: DeviceId, access: &Access) -> bool {
        let fits = match (access, &self.held) {
            (Access::Read(asked), Some((register, _))) => asked == register && !self.is_written,
            (Access::Write(asked, _), Some((register, _))) => asked == register,
            (Access::Save, None) => true,
            _ => false,
        };
        fits && self.id == id.raw()
    }
}

fn held(register: Register, bytes: &[u8]) -> Result<Value, FrameError> {
    let bytes = bytes.try_into().map_err(|_| FrameError::Length)?;
    match register.value_of(u32::from_le_bytes(bytes)) {
        Value::Real(real) if !real.is_finite() => Err(FrameError::Unexpected),
        value => Ok(value),
    }
}

const LAST_REGISTER: u8 = 81;

/// A reply, or why a frame that looks like one is invalid; `None` for a frame that can be feedback.
///
/// As a feedback it would be a shaft at its range's end that turns out at a third of its speed.
pub(super) fn reply_to(id: DeviceId, frame: &CanFrame) -> Option<Result<Reply, FrameError>> {
    let &[low, high, operation, register, ..] = frame.bytes() else { return None };
    let is_reply = u16::from_le_bytes([low, high]) == id.raw()
        && match operation {
            READ | WRITE => register <= LAST_REGISTER,
            SAVE => register == 1,
            _ => false,
        };
    is_reply.then(|| Reply::unpack(frame))
}

/// The registers compared with the configuration before enabling, and the fault if they differ.
pub(super) const CHECKED: [(Register, &str); 5] = [
    (Register::MODE, "register 10 (CTRL_MODE) is another control mode"),
    (Register::POSITION_LIMIT, "register 21 (PMAX, rad) is another limit"),
    (Register::VELOCITY_LIMIT, "register 22 (VMAX, rad/s) is another limit"),
    (Register::TORQUE_LIMIT, "register 23 (TMAX, N m) is another limit"),
    (Register::TIMEOUT, "register 9 (TIMEOUT, ms) is 0, which is never, or too long"),
];
/// The code of such a fault, less the register's number.
const NOT_AS_CONFIGURED: u32 = 0x100;
pub(super) const NO_ANSWER: Fault =
    Fault::new(0x1FF, "it answers, but not when asked for its registers");
/// Two limits that differ by this share are one: 12.566 and 4π.
const SAME: f32 = 1e-3;

/// The fault of a register that holds `held`; `None` if it is as wanted. A [time-out](Register::TIMEOUT)
/// may be shorter, and is in ms.
pub(super) fn check(
    &(register, text): &(Register, &'static str),
    held: Value,
    wanted: f32,
) -> Option<Fault> {
    let fault = Fault::new(NOT_AS_CONFIGURED + u32::from(register.0), text);
    let held = match held {
        Value::Whole(steps) if register == Register::TIMEOUT => {
            return check_timeout(steps, wanted, fault);
        }
        Value::Whole(held) => held as f32,
        Value::Real(held) => held,
    };
    let is_good = (held - wanted).abs() <= wanted * SAME;
    (!is_good).then_some(Fault { differs: Some([held, wanted]), ..fault })
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::string::ToString;

    fn packed(id: u16, access: Access) -> Result<std::string::String, ConfigError> {
        access.pack(DeviceId::new(id).unwrap()).map(|frame| frame.to_string())
    }

    fn reply(data: &[u8]) -> Result<Reply, FrameError> {
        Reply::unpack(&CanFrame::data_frame(standard(0x11), data).unwrap())
    }

    #[test]
    fn requests_have_the_bytes_of_the_vendor_code() {
        for (id, access, bytes) in [
            (1, Access::Read(Register::POSITION_LIMIT), "7FF#01003315"),
            (0x12, Access::Read(Register::MODE), "7FF#1200330A"),
            (0x105, Access::Refresh, "7FF#0501CC00"),
            (2, Access::Save, "7FF#0200AA01"),
            (7, Access::Write(Register::TIMEOUT, Value::Whole(20_000)), "7FF#07005509204E0000"),
            (3, Access::Write(Register(21), Value::Real(12.5)), "7FF#0300551500004841"),
        ] {
            assert_eq!(packed(id, access).unwrap(), bytes, "{access:?}");
        }
    }

    #[test]
    fn a_value_of_the_wrong_type_is_not_sent() {
        for (register, value, error) in [
            (Register::MODE, Value::Real(1.0), "a whole number"),
            (Register::POSITION_LIMIT, Value::Whole(12), "an f32"),
            (Register::POSITION_LIMIT, Value::Real(f32::NAN), "finite"),
        ] {
            assert_eq!(packed(1, Access::Write(register, value)).unwrap_err().must_be, error);
        }
    }

    #[test]
    fn replies_are_read_and_matched() {
        let one = DeviceId::new(1).unwrap();
        let read = Access::Read(Register(21));
        let write = Access::Write(Register(21), Value::Real(12.5));
        let holds = reply(&[1, 0, 0x33, 21, 0, 0, 0x48, 0x41]).unwrap();
        assert_eq!(holds.held, Some((Register(21), Value::Real(12.5))));
        assert!(!holds.is_written);
        assert!(holds.answers(one, &read) && holds.answers(one, &write));
        assert!(!holds.answers(DeviceId::new(0x101).unwrap(), &read));
        assert!(!holds.answers(one, &Access::Read(Register(22))));
        assert!(!holds.answers(one, &Access::Save));
        let written = reply(&[7, 0, 0x55, 10, 2, 0, 0, 0]).unwrap();
        assert_eq!(
            (written.id, written.held, written.is_written),
            (7, Some((Register::MODE, Value::Whole(2))), true)
        );
        let seven = DeviceId::new(7).unwrap();
        assert!(written.answers(seven, &Access::Write(Register::MODE, Value::Whole(2))));
        assert!(!written.answers(seven, &Access::Read(Register::MODE)));
        for saved in [&[1, 0, 0xAA, 1][..], &[1, 0, 0xAA, 1, 0, 0, 0, 0]] {
            assert!(reply(saved).unwrap().answers(one, &Access::Save));
        }
    }

    #[test]
    fn what_is_no_reply_says_why() {
        assert_eq!(reply(&[1, 0, 0x33]), Err(FrameError::Length));
        assert_eq!(reply(&[1, 0, 0x33, 21, 0, 0, 0]), Err(FrameError::Length));
        assert_eq!(reply(&[1, 0, 0x34, 21, 0, 0, 0, 0]), Err(FrameError::NotMine));
        assert_eq!(reply(&[1, 0, 0xAA, 2, 0, 0, 0, 0]), Err(FrameError::NotMine));
        let infinite = reply(&[1, 0, 0x33, 21, 0, 0, 0x80, 0x7F]);
        assert_eq!(infinite, Err(FrameError::Unexpected));
        let remote = CanFrame::remote_frame(standard(0x11), 8).unwrap();
        assert_eq!(Reply::unpack(&remote), Err(FrameError::NotMine));
    }
}
