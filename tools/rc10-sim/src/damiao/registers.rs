//! The registers of a device: manual of J10010L, register table, and the table of damiao-motor
//! 1.0.6. Ranges are the tables'; values of our own are marked in [`Registers::of`].

use super::DamiaoConfig;
use super::codec::Limits;

/// Numbers of registers that mean something to the device here.
pub(super) mod number {
    pub const UNDER_VOLTAGE: u8 = 0;
    pub const OVER_TEMPERATURE: u8 = 2;
    pub const ACCELERATION: u8 = 4;
    pub const DECELERATION: u8 = 5;
    pub const MASTER_ID: u8 = 7;
    pub const DEVICE_ID: u8 = 8;
    pub const TIMEOUT: u8 = 9;
    pub const MODE: u8 = 10;
    pub const POSITION_LIMIT: u8 = 21;
    pub const VELOCITY_LIMIT: u8 = 22;
    pub const TORQUE_LIMIT: u8 = 23;
    pub const OVER_VOLTAGE: u8 = 29;
    pub const SUPPLY: u8 = 60;
    pub const BRIDGE_TEMPERATURE: u8 = 61;
    pub const WINDING_TEMPERATURE: u8 = 62;
    pub const MOTOR_POSITION: u8 = 80;
    pub const OUTPUT_POSITION: u8 = 81;
}

/// The values that a register takes.
enum Takes {
    /// Nothing.
    Nothing,
    /// A whole number in this range.
    Whole(u32, u32),
    /// A number between these; the ends belong to it.
    Real(f32, f32),
}

/// Whether there is such a register, and what it takes.
fn takes(register: u8) -> Option<Takes> {
    use Takes::{Nothing, Real, Whole};
    const ABOVE_ZERO: f32 = f32::MIN_POSITIVE;
    Some(match register {
        0 => Real(10.0, f32::MAX),
        1 | 25..=28 => Real(0.0, f32::MAX),
        2 => Real(80.0, 200.0),
        3 | 30 => Real(ABOVE_ZERO, 1.0),
        4 | 6 | 21..=23 | 29 => Real(ABOVE_ZERO, f32::MAX),
        5 => Real(-f32::MAX, -ABOVE_ZERO),
        7 | 8 => Whole(0, 0x7FF),
        9 => Whole(0, u32::MAX),
        10 => Whole(1, 4),
        24 | 33 => Real(100.0, 10_000.0),
        31 => Real(1.0, 30.0),
        32 => Real(ABOVE_ZERO, 500.0),
        34 => Real(ABOVE_ZERO, 10_000.0),
        35 => Whole(0, 4),
        11..=20 | 36 | 50..=56 | 59..=65 | 80 | 81 => Nothing,
        _ => return None,
    })
}

const COUNT: usize = 82;

/// All of them, as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Registers([u32; COUNT]);

impl Registers {
    /// As a device leaves the factory, but for what the configuration says.
    pub(super) fn of(config: &DamiaoConfig) -> Self {
        use number::{
            ACCELERATION, DECELERATION, DEVICE_ID, MASTER_ID, MODE, OVER_TEMPERATURE, OVER_VOLTAGE,
            POSITION_LIMIT, TIMEOUT, TORQUE_LIMIT, UNDER_VOLTAGE, VELOCITY_LIMIT,
        };
        let DamiaoConfig { can_id, master_id, mode, limits, timeout, acceleration, plant, .. } =
            *config;
        let mut registers = Self([0; COUNT]);
        #[expect(clippy::cast_possible_truncation, reason = "registers are single precision")]
        for (number, real) in [
            (UNDER_VOLTAGE, 15.0),
            (1, 0.0),
            // Our value: the manuals recommend at most 100.
            (OVER_TEMPERATURE, 100.0),
            (3, 0.99),
            (ACCELERATION, acceleration),
            (DECELERATION, -acceleration),
            (6, limits.velocity),
            (11, plant.viscous_friction),
            (12, plant.rotor_inertia),
            (17, plant.resistance),
            (20, plant.gear_ratio),
            (POSITION_LIMIT, limits.position),
            (VELOCITY_LIMIT, limits.velocity),
            (TORQUE_LIMIT, limits.torque),
            (24, 1000.0),
            // Our value: the range that data sheets name, and a little more.
            (OVER_VOLTAGE, 60.0),
            (30, 1.0),
            (31, 4.0),
            (59, plant.current_limit),
        ] {
            registers.set_real(number, real as f32);
        }
        for (number, whole) in [
            (MASTER_ID, master_id.into()),
            (DEVICE_ID, can_id.into()),
            (TIMEOUT, timeout),
            (MODE, mode as u32),
            (14, 5013),
            (16, 14),
            (35, 4),
        ] {
            registers.0[usize::from(number)] = whole;
        }
        registers
    }

    pub(super) fn whole(&self, register: u8) -> u32 {
        self.0[usize::from(register)]
    }

    pub(super) fn real(&self, register: u8) -> f64 {
        f32::from_bits(self.whole(register)).into()
    }

    pub(super) fn set_real(&mut self, register: u8, value: f32) {
        self.0[usize::from(register)] = value.to_bits();
    }

    /// The value of a register, as it answers; `None` if there is no such register.
    pub(super) fn read(&self, register: u8) -> Option<[u8; 4]> {
        takes(register)?;
        Some(self.whole(register).to_le_bytes())
    }

    /// Takes four bytes, if the register takes such, and answers what it holds then; `None` if there
    /// is no such register.
    pub(super) fn write(&mut self, register: u8, bytes: [u8; 4]) -> Option<[u8; 4]> {
        let raw = u32::from_le_bytes(bytes);
        let fits = match takes(register)? {
            Takes::Nothing => false,
            Takes::Whole(low, high) => (low..=high).contains(&raw),
            Takes::Real(low, high) => (low..=high).contains(&f32::from_bits(raw)),
        };
        if fits {
            self.0[usize::from(register)] = raw;
        }
        self.read(register)
    }

    pub(super) fn limits(&self) -> Limits {
        Limits {
            position: self.real(number::POSITION_LIMIT),
            velocity: self.real(number::VELOCITY_LIMIT),
            torque: self.real(number::TORQUE_LIMIT),
        }
    }
}
