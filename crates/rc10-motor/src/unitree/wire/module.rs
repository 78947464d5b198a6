//! CAN frames of Unitree's module: extended, eight bytes, little endian (module manual V1.0).
//!
//! | identifier bits | 28–27 | 26 | 25–24 | 23–16 | 15–8 | 7–0 |
//! |---|---|---|---|---|---|---|
//! | request | module | 0 | 0 | 10 ..= 13 | address, status | 0 |
//! | state | module | 1 | 1 | air pressure | address, status | temperature i8, °C |
//! | fault | module | 1 | 1 | error | address, status | −128 |
//! | impedance | module | 1 | 2 | not to be relied on | address | 0 |
//!
//! | data | 0 ..= 1 | 2 ..= 3 | 4 ..= 5 | 6 ..= 7 |
//! |---|---|---|---|---|
//! | motion, either way | θ i32 | θ | ω i16 | τ i16 |
//! | impedance, either way | `k_spd` u16 | `k_pos` u16 | 0 | 0 |
//!
//! `k_spd` comes first: the manual and two of three drivers agree.

use embedded_can::{ExtendedId, Id};
use rc10_app::Celsius;
use rc10_can::CanFrame;

use super::{Address, RawImpedance, RawMotion, Status, fault, mode, split_mode};
use crate::feedback::Fault;
use crate::motor::FrameError;

/// Bit 26: set in what a module says.
pub(in crate::unitree) const FROM_MODULE: u32 = 1 << 26;
/// Bits 25 and 24 of a state or a fault.
pub(in crate::unitree) const STATE: u8 = 1;
/// Bits 25 and 24 of an impedance.
pub(in crate::unitree) const IMPEDANCE: u8 = 2;
/// In place of a temperature: this is a fault.
pub(in crate::unitree) const NO_TEMPERATURE: i8 = -128;

/// A module on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Module(u8);

impl Module {
    /// The number as sold, with both switches on: 3.
    pub const FACTORY: Self = Self(3);

    /// The module that switches 1 and 2 say, 0 ..= 3, else `None`.
    pub const fn new(id: u8) -> Option<Self> {
        if id <= 3 { Some(Self(id)) } else { None }
    }

    /// The number, 0 ..= 3.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

/// A request to a module about one motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// 10: a motion of the rotor, answered with a state or a fault.
    Control(Status, RawMotion),
    /// 11: how the rotor follows its motions, until the module loses power.
    SetImpedance(RawImpedance),
    /// 12: answered with what 11 set.
    ReadImpedance,
    /// 13: like 10, but answered only by a fault.
    ControlUnanswered(Status, RawMotion),
}

impl Request {
    /// The frame that asks this of one motor behind one module.
    ///
    /// ```
    /// use rc10_motor::unitree::wire::module::{Module, Request};
    /// use rc10_motor::unitree::wire::{Address, RawMotion, Status};
    /// let torque = RawMotion { torque: 192, ..RawMotion::default() };
    /// let request = Request::Control(Status::FOC, torque);
    /// let frame = request.pack(Module::FACTORY, Address::new(0).unwrap());
    /// assert_eq!(frame.to_string(), "180A1000#000000000000C000");
    /// ```
    pub fn pack(&self, module: Module, address: Address) -> CanFrame {
        let (operation, status, data) = match *self {
            Self::Control(status, motion) => (10, status, motion_data(motion)),
            Self::SetImpedance(impedance) => (11, Status::LOCK, impedance_data(impedance)),
            Self::ReadImpedance => (12, Status::LOCK, [0; 8]),
            Self::ControlUnanswered(status, motion) => (13, status, motion_data(motion)),
        };
        let id = u32::from_be_bytes([module.0 << 3, operation, mode(address, status), 0]);
        CanFrame::eight_bytes(Id::Extended(ExtendedId::new(id).unwrap_or(ExtendedId::ZERO)), data)
    }
}

fn motion_data(motion: RawMotion) -> [u8; 8] {
    let [a0, a1, a2, a3] = motion.angle.to_le_bytes();
    let [w0, w1] = motion.speed.to_le_bytes();
    let [t0, t1] = motion.torque.to_le_bytes();
    [a0, a1, a2, a3, w0, w1, t0, t1]
}

fn impedance_data(impedance: RawImpedance) -> [u8; 8] {
    let [d0, d1] = impedance.damping.to_le_bytes();
    let [p0, p1] = impedance.stiffness.to_le_bytes();
    [d0, d1, p0, p1, 0, 0, 0, 0]
}

/// A module's reply about a motor.
///
/// A frame is a motor's only if module and address are both its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reply {
    /// The module.
    pub module: Module,
    /// The motor.
    pub address: Address,
    /// The content.
    pub content: Content,
}

/// The content of a [`Reply`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Content {
    /// The motor runs, or could.
    State {
        /// The status of the motor.
        status: Status,
        /// The motion it has, of the rotor.
        motion: RawMotion,
        /// The motor's temperature, in whole degrees, from −127.
        temperature: Celsius,
        /// The upper eight bits of a pressure sensor, in units of its own.
        air_pressure: u8,
    },
    /// The motor has a fault.
    Fault {
        /// The status of the motor.
        status: Status,
        /// The vendor's `MError`.
        error: u8,
        /// The whole identifier: another driver looks for the error in bits 15 to 8.
        raw_id: u32,
    },
    /// The gains that the module has for the motor: the reply to [`Request::ReadImpedance`].
    Impedance(RawImpedance),
}

impl Reply {
    /// Takes a module's frame apart.
    ///
    /// # Errors
    /// [`FrameError::NotMine`] for a frame of no module, or a command; [`FrameError::Length`]
    /// unless eight bytes; [`FrameError::Unexpected`] for content that is not documented.
    pub fn unpack(frame: &CanFrame) -> Result<Self, FrameError> {
        let raw_id = frame.raw_id();
        if !frame.is_extended_id() || frame.is_remote() || raw_id & FROM_MODULE == 0 {
            return Err(FrameError::NotMine);
        }
        let data = frame.all_eight().ok_or(FrameError::Length)?;
        let [top, middle, mode, low] = raw_id.to_be_bytes();
        let (address, status) = split_mode(mode);
        let content = match (top & 3, low.cast_signed()) {
            (STATE, NO_TEMPERATURE) => Content::Fault { status, error: middle, raw_id },
            (STATE, temperature) => Content::State {
                status,
                motion: motion(*data),
                temperature: Celsius::new(temperature.into()),
                air_pressure: middle,
            },
            (IMPEDANCE, _) => Content::Impedance(impedance(*data)),
            _ => return Err(FrameError::Unexpected),
        };
        Ok(Self { module: Module(top >> 3 & 3), address, content })
    }

    /// The fault of the module. The code is the whole identifier: sources differ on its place.
    pub fn fault(&self) -> Option<Fault> {
        let Content::Fault { error, raw_id, .. } = self.content else { return None };
        let text = fault(error).map_or("a fault without an error", |fault| fault.text);
        Some(Fault::new(raw_id, text))
    }
}

fn motion([a0, a1, a2, a3, w0, w1, t0, t1]: [u8; 8]) -> RawMotion {
    RawMotion {
        torque: i16::from_le_bytes([t0, t1]),
        speed: i16::from_le_bytes([w0, w1]),
        angle: i32::from_le_bytes([a0, a1, a2, a3]),
    }
}

fn impedance([d0, d1, p0, p1, ..]: [u8; 8]) -> RawImpedance {
    RawImpedance { stiffness: u16::from_le_bytes([p0, p1]), damping: u16::from_le_bytes([d0, d1]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::StandardId;
    extern crate std;
    use std::string::ToString;

    fn from(id: u32, data: [u8; 8]) -> CanFrame {
        CanFrame::eight_bytes(ExtendedId::new(id).unwrap(), data)
    }

    #[test]
    fn requests_are_what_two_drivers_send() {
        let pack = |request: Request, module, address| {
            let (module, address) = (Module::new(module), Address::new(address));
            request.pack(module.unwrap(), address.unwrap()).to_string()
        };
        let motion = RawMotion { torque: -512, speed: 20, angle: -15645 };
        let control = Request::Control(Status::FOC, motion);
        assert_eq!(pack(control, 2, 14), "100A1E00#E3C2FFFF140000FE");
        let silent = Request::ControlUnanswered(Status::LOCK, motion);
        assert_eq!(pack(silent, 3, 1), "180D0100#E3C2FFFF140000FE");
        let set = Request::SetImpedance(RawImpedance { stiffness: 1920, damping: 32 });
        assert_eq!(pack(set, 0, 5), "000B0500#2000800700000000");
        assert_eq!(pack(Request::ReadImpedance, 3, 0), "180C0000#0000000000000000");
        assert_eq!(Module::new(4), None);
    }

    #[test]
    fn a_state_is_signed_in_every_field() {
        let data = [0x98, 0x00, 0xF8, 0xFF, 0xD1, 0xFC, 0xC0, 0xFE];
        let reply = Reply::unpack(&from(0x1D07_12FB, data)).unwrap();
        assert_eq!((reply.module, reply.address.get()), (Module::FACTORY, 2));
        let state = Content::State {
            status: Status::FOC,
            motion: RawMotion { torque: -320, speed: -815, angle: -524_136 },
            temperature: Celsius::new(-5.0),
            air_pressure: 7,
        };
        assert_eq!((reply.content, reply.fault()), (state, None));
    }

    #[test]
    fn a_fault_has_its_text_and_all_its_bits() {
        let reply = Reply::unpack(&from(0x1D01_1180, [0; 8])).unwrap();
        let fault = Content::Fault { status: Status::FOC, error: 1, raw_id: 0x1D01_1180 };
        assert_eq!((reply.address.get(), reply.content), (1, fault));
        assert_eq!(reply.fault(), Some(Fault::new(0x1D01_1180, "over-temperature")));
        let none = Reply::unpack(&from(0x1D00_1180, [0; 8])).unwrap();
        assert_eq!(none.fault(), Some(Fault::new(0x1D00_1180, "a fault without an error")));
    }

    #[test]
    fn damping_comes_before_stiffness() {
        let reply = Reply::unpack(&from(0x1E02_0000, [0, 1, 0x80, 0, 0, 0, 0, 0])).unwrap();
        let impedance = RawImpedance { stiffness: 128, damping: 256 };
        assert_eq!(reply.content, Content::Impedance(impedance));
    }

    #[test]
    fn each_way_to_be_no_reply_is_named() {
        let state = ExtendedId::new(0x1D80_1023).unwrap();
        let short = CanFrame::data_frame(state, &[0; 7]).unwrap();
        let remote = CanFrame::remote_frame(state, 8).unwrap();
        let standard = CanFrame::eight_bytes(StandardId::new(0x201).unwrap(), [0; 8]);
        for (frame, error) in [
            (short, FrameError::Length),
            (remote, FrameError::NotMine),
            (standard, FrameError::NotMine),
            (from(0x1900_111E, [0; 8]), FrameError::NotMine),
            (from(0x1C80_1023, [0; 8]), FrameError::Unexpected),
            (from(0x1F80_1023, [0; 8]), FrameError::Unexpected),
        ] {
            assert_eq!(Reply::unpack(&frame), Err(error), "{frame}");
        }
    }
}
