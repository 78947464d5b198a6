//! Who is meant, and what a frame is: the two bytes of a VESC's identifier.

use core::fmt;

use embedded_can::ExtendedId;

/// The number a VESC is set to, 0 ..= 254.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VescId(u8);

/// The id that every VESC listens to.
const EVERY: u8 = 255;

impl VescId {
    /// The highest number: 254.
    pub const LAST: Self = Self(EVERY - 1);

    /// `None` for 255, which means all of them.
    #[must_use]
    pub const fn new(id: u8) -> Option<Self> {
        if id == EVERY { None } else { Some(Self(id)) }
    }

    /// The number.
    #[inline]
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl fmt::Display for VescId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Who is to take a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Address {
    /// This VESC.
    One(VescId),
    /// All VESCs on the bus (id 255).
    Every,
}

impl From<VescId> for Address {
    fn from(id: VescId) -> Self {
        Self::One(id)
    }
}

impl Address {
    /// The lowest byte of the identifier.
    #[inline]
    #[must_use]
    pub const fn byte(self) -> u8 {
        match self {
            Self::One(id) => id.0,
            Self::Every => EVERY,
        }
    }
}

macro_rules! packets {
    ($($variant:ident = $number:literal $name:literal,)*) => {
        /// What a frame is: bits 15 to 8 of its identifier, as named and numbered in bldc's
        /// `datatypes.h` (`CAN_PACKET_ID`).
        ///
        /// Also those that are not for robots, so that a frame on the bus can be named: packets 5
        /// to 8 carry the VESC's serial protocol, 28, 55, 56 and 63 set up encoders and bit rates.
        /// Nothing in this crate sends them.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        pub enum Packet {
            $(#[doc = concat!("`", $name, "`")] $variant = $number,)*
        }

        impl Packet {
            /// The packet of a number; `None` if it is none of these.
            #[must_use]
            pub const fn from_number(number: u8) -> Option<Self> {
                match number {
                    $($number => Some(Self::$variant),)*
                    _ => None,
                }
            }

            /// As the firmware's source names it, without `CAN_PACKET_`.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }
    };
}

packets! {
    SetDuty = 0 "SET_DUTY",
    SetCurrent = 1 "SET_CURRENT",
    SetCurrentBrake = 2 "SET_CURRENT_BRAKE",
    SetRpm = 3 "SET_RPM",
    SetPos = 4 "SET_POS",
    FillRxBuffer = 5 "FILL_RX_BUFFER",
    FillRxBufferLong = 6 "FILL_RX_BUFFER_LONG",
    ProcessRxBuffer = 7 "PROCESS_RX_BUFFER",
    ProcessShortBuffer = 8 "PROCESS_SHORT_BUFFER",
    Status = 9 "STATUS",
    SetCurrentRel = 10 "SET_CURRENT_REL",
    SetCurrentBrakeRel = 11 "SET_CURRENT_BRAKE_REL",
    SetCurrentHandbrake = 12 "SET_CURRENT_HANDBRAKE",
    SetCurrentHandbrakeRel = 13 "SET_CURRENT_HANDBRAKE_REL",
    Status2 = 14 "STATUS_2",
    Status3 = 15 "STATUS_3",
    Status4 = 16 "STATUS_4",
    Ping = 17 "PING",
    Pong = 18 "PONG",
    ConfCurrentLimits = 21 "CONF_CURRENT_LIMITS",
    ConfStoreCurrentLimits = 22 "CONF_STORE_CURRENT_LIMITS",
    ConfCurrentLimitsIn = 23 "CONF_CURRENT_LIMITS_IN",
    ConfStoreCurrentLimitsIn = 24 "CONF_STORE_CURRENT_LIMITS_IN",
    ConfFocErpms = 25 "CONF_FOC_ERPMS",
    ConfStoreFocErpms = 26 "CONF_STORE_FOC_ERPMS",
    Status5 = 27 "STATUS_5",
    PollTs5700n8501 = 28 "POLL_TS5700N8501_STATUS",
    ConfBatteryCut = 29 "CONF_BATTERY_CUT",
    ConfStoreBatteryCut = 30 "CONF_STORE_BATTERY_CUT",
    Shutdown = 31 "SHUTDOWN",
    UpdatePidPosOffset = 55 "UPDATE_PID_POS_OFFSET",
    PollRotorPos = 56 "POLL_ROTOR_POS",
    Status6 = 58 "STATUS_6",
    UpdateBaud = 63 "UPDATE_BAUD",
}

impl Packet {
    /// Its number.
    #[inline]
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The identifier of this packet with an address: the receiver's if it is a command, the
    /// sender's if it is a status.
    #[inline]
    #[must_use]
    pub fn id(self, address: impl Into<Address>) -> ExtendedId {
        let raw = u32::from(u16::from_be_bytes([self.number(), address.into().byte()]));
        // Sixteen bits always fit; the compiler knows.
        ExtendedId::new(raw).unwrap_or(ExtendedId::ZERO)
    }
}

impl fmt::Display for Packet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_vesc_has_the_number_of_all() {
        assert_eq!(VescId::new(255), None);
        assert_eq!(VescId::new(254).map(VescId::get), Some(254));
        assert_eq!(VescId::new(0).map(VescId::get), Some(0));
        assert_eq!(Address::Every.byte(), 255);
    }

    #[test]
    fn identifiers_are_packet_and_address() {
        let id = VescId::new(100).unwrap();
        for (packet, raw) in [
            (Packet::SetDuty, 0x64),
            (Packet::SetPos, 0x464),
            (Packet::SetCurrentRel, 0xA64),
            (Packet::Status2, 0xE64),
            (Packet::Ping, 0x1164),
            (Packet::Status6, 0x3A64),
        ] {
            assert_eq!(packet.id(id).as_raw(), raw, "{packet}");
        }
        assert_eq!(Packet::UpdateBaud.id(Address::Every).as_raw(), 0x3FFF);
    }

    #[test]
    fn numbers_and_packets_are_one_to_one() {
        let known = (0..=255).filter_map(|number| {
            let packet = Packet::from_number(number)?;
            assert_eq!(packet.number(), number);
            Some(packet)
        });
        assert_eq!(known.count(), 34);
    }
}
