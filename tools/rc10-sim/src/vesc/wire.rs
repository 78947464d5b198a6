//! A VESC's frames, from the VESC's side. Numbers are signed, highest byte first.

use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id};

use crate::device::Taken;

/// A command to a VESC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// Packet 0: share of the supply voltage, -1 ..= 1.
    Duty(f64),
    /// Packet 1: A.
    Current(f64),
    /// Packet 2: A.
    Brake(f64),
    /// Packet 3: electrical rpm.
    Speed(f64),
    /// Packet 4: degrees.
    Position(f64),
    /// Packet 10: share of the current limit.
    CurrentShare(f64),
    /// Packet 11: share of the braking limit.
    BrakeShare(f64),
    /// Packet 12: A.
    Handbrake(f64),
    /// Packet 13: share of the braking limit.
    HandbrakeShare(f64),
    /// Packet 17, with the id of the asking node.
    Ping(u8),
    /// Packets 21 and 22 (which also writes the flash).
    CurrentLimits {
        /// Most negative current, A.
        min: f64,
        /// Most positive current, A.
        max: f64,
        /// Whether they survive power-off.
        is_stored: bool,
    },
    /// Packet 31.
    Shutdown,
}

impl Order {
    /// The command in a frame to the VESC of this id.
    ///
    /// The firmware from 6.00 on takes a current of six or more bytes for one with a delay, which
    /// it reads first: so does this. All other packets are taken only at their exact lengths; the
    /// firmware does not look. Fails with what becomes of another frame: it is for another device,
    /// or has a length that its packet never has.
    pub fn parse(frame: &CanFrame, id: u8) -> Result<Self, Taken> {
        let raw = frame.raw_id();
        let to = raw.to_be_bytes()[3];
        if !frame.is_extended_id() || frame.is_remote() || raw > 0xFFFF || (to != id && to != 255) {
            return Err(Taken::NotMine);
        }
        let bytes = frame.bytes();
        let word = |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok());
        let number = |at, scale| word(at).map(|word| f64::from(i32::from_be_bytes(word)) / scale);
        let (length, order) = match raw >> 8 {
            0 => (4, number(0, 1e5).map(Self::Duty)),
            1 if bytes.len() >= 6 => (bytes.len(), number(2, 1e3).map(Self::Current)),
            1 => (4, number(0, 1e3).map(Self::Current)),
            2 => (4, number(0, 1e3).map(Self::Brake)),
            3 => (4, number(0, 1.0).map(Self::Speed)),
            4 => (4, number(0, 1e6).map(Self::Position)),
            10 => (4, number(0, 1e5).map(Self::CurrentShare)),
            11 => (4, number(0, 1e5).map(Self::BrakeShare)),
            12 => (4, number(0, 1e3).map(Self::Handbrake)),
            13 => (4, number(0, 1e5).map(Self::HandbrakeShare)),
            17 => (1, bytes.first().copied().map(Self::Ping)),
            packet @ (21 | 22) => {
                let limits = number(0, 1e3).zip(number(4, 1e3));
                let is_stored = packet == 22;
                (8, limits.map(|(min, max)| Self::CurrentLimits { min, max, is_stored }))
            }
            31 => (0, Some(Self::Shutdown)),
            _ => return Err(Taken::NotMine),
        };
        order.filter(|_| bytes.len() == length).ok_or(Taken::Malformed)
    }
}

/// A report of a VESC, unasked or asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Report {
    /// Packet 9: electrical rpm, A (negative while the motor generates), share of the voltage.
    Status1 {
        /// Electrical rpm.
        erpm: f64,
        /// A.
        current: f64,
        /// -1 ..= 1.
        duty: f64,
    },
    /// Packet 14: ampere hours drawn and fed back.
    Status2(f64, f64),
    /// Packet 15: watt hours drawn and fed back.
    Status3(f64, f64),
    /// Packet 16.
    Status4 {
        /// °C.
        transistors: f64,
        /// °C.
        motor: f64,
        /// Current of the supply, A.
        input: f64,
        /// Angle of the position controller, degrees.
        position: f64,
    },
    /// Packet 27.
    Status5 {
        /// Six an electrical turn; goes round.
        steps: i32,
        /// V.
        supply: f64,
    },
    /// Packet 58: V at the three analogue inputs, and the PPM input.
    Status6([f64; 4]),
    /// Packet 18, to the id that asked.
    Pong(u8),
}

impl Report {
    /// Its frame, from the VESC of this id. Numbers are cut off towards zero, as the firmware does,
    /// and saturate, as it does not.
    pub fn frame(&self, id: u8) -> CanFrame {
        let words = |[first, second]: [f64; 2]| word(first) << 32 | word(second);
        let halves = |[first, second]: [f64; 2]| half(first) << 16 | half(second);
        let (packet, data) = match *self {
            Self::Status1 { erpm, current, duty } => {
                (9, word(erpm) << 32 | halves([current * 10.0, duty * 1e3]))
            }
            Self::Status2(used, charged) => (14, words([used, charged].map(|hours| hours * 1e4))),
            Self::Status3(used, charged) => (15, words([used, charged].map(|hours| hours * 1e4))),
            Self::Status4 { transistors, motor, input, position } => {
                let temperatures = halves([transistors * 10.0, motor * 10.0]);
                (16, temperatures << 32 | halves([input * 10.0, position * 50.0]))
            }
            Self::Status5 { steps, supply } => {
                (27, word(steps.into()) << 32 | halves([supply * 10.0, 0.0]))
            }
            Self::Status6(inputs) => {
                let [first, second, third, pulses] = inputs.map(|value| value * 1e3);
                (58, halves([first, second]) << 32 | halves([third, pulses]))
            }
            Self::Pong(asker) => return CanFrame::exact(identifier(18, asker), [id, 0]),
        };
        CanFrame::eight_bytes(identifier(packet, id), data.to_be_bytes())
    }
}

fn identifier(packet: u8, id: u8) -> Id {
    let raw = u32::from(u16::from_be_bytes([packet, id]));
    ExtendedId::new(raw).unwrap_or(ExtendedId::ZERO).into()
}

#[expect(clippy::cast_possible_truncation, reason = "saturation is meant")]
fn word(value: f64) -> u64 {
    (value as i32).cast_unsigned().into()
}

#[expect(clippy::cast_possible_truncation, reason = "saturation is meant")]
fn half(value: f64) -> u64 {
    (value as i16).cast_unsigned().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(raw: u32, data: &[u8]) -> Result<Order, Taken> {
        let id = ExtendedId::new(raw).unwrap();
        Order::parse(&CanFrame::data_frame(id, data).unwrap(), 7)
    }

    #[test]
    fn orders_are_told_from_strangers() {
        assert_eq!(order(0x007, &[0, 0, 0xC3, 0x50]), Ok(Order::Duty(0.5)));
        assert_eq!(order(0x1FF, &[0, 0, 0x27, 0x10]), Ok(Order::Current(10.0)));
        assert_eq!(order(0x307, &[0xFF, 0xFF, 0xFF, 0xFE]), Ok(Order::Speed(-2.0)));
        assert_eq!(order(0x1107, &[9]), Ok(Order::Ping(9)));
        assert_eq!(order(0x108, &[0; 4]), Err(Taken::NotMine));
        assert_eq!(order(0x1_0107, &[0; 4]), Err(Taken::NotMine));
        assert_eq!(order(0x907, &[0; 8]), Err(Taken::NotMine));
        assert_eq!(order(0x307, &[0; 8]), Err(Taken::Malformed));
        assert_eq!(order(0x307, &[0; 3]), Err(Taken::Malformed));
        // 10 A in eight bytes, as the firmware from 6.00 on understands them.
        let padded = [0, 0, 0x27, 0x10, 0, 0, 0, 0];
        assert_eq!(order(0x107, &padded), Ok(Order::Current(655_360.0)));
    }

    #[test]
    fn reports_have_the_bytes_of_the_firmware() {
        let report = Report::Status1 { erpm: 100_000.0, current: 45.7, duty: -0.25 };
        assert_eq!(report.frame(0x17).to_string(), "00000917#000186A001C9FF06");
        let report = Report::Status5 { steps: -5, supply: 24.5 };
        assert_eq!(report.frame(1).to_string(), "00001B01#FFFFFFFB00F50000");
        assert_eq!(Report::Pong(200).frame(23).to_string(), "000012C8#1700");
    }
}
