//! The Finch F10 from its own side: written from the manual's table, without a look at `motor.rs`.

use rc10_can::CanFrame;
use rc10_can::embedded_can::{Id, StandardId};
use rc10_sim::{Bus, Device, Esc, EscFault, Nonlinear, Outbox, Plant, Shaft, Taken, Winding};
use rc10_time::Micros;

/// Longest time without a command; then it opens its bridge.
const PATIENCE: Micros = Micros::from_millis(100);
const PERIOD: Micros = Micros::from_millis(1);

/// The electronics of an F10.
pub struct FinchDrive {
    id: u16,
    enabled: bool,
    torque: f64,
    error: u8,
    commanded: Micros,
    next_report: Micros,
}

impl FinchDrive {
    /// Set to an identifier.
    pub fn new(id: u8) -> Self {
        let (commanded, next_report) = (Micros::ZERO, Micros::ZERO);
        Self { id: id.into(), enabled: false, torque: 0.0, error: 0, commanded, next_report }
    }

    /// A frame it sends. Numbers that do not fit saturate, as the drive's own do.
    fn report(&self, shaft: &Shaft) -> CanFrame {
        let turns = shaft.radians() / std::f64::consts::TAU;
        let angle = (turns.rem_euclid(1.0) * 65536.0) as u16;
        let rpm = (shaft.speed * 30.0 / std::f64::consts::PI * 10.0).round() as i16;
        let current = (shaft.current * 100.0).round() as i16;
        let mut data = [0; 8];
        data[0..2].copy_from_slice(&angle.to_be_bytes());
        data[2..4].copy_from_slice(&rpm.to_be_bytes());
        data[4..6].copy_from_slice(&current.to_be_bytes());
        data[6] = self.enabled.into();
        data[7] = self.error;
        CanFrame::eight_bytes(StandardId::new(0x380 + self.id).unwrap(), data)
    }

    fn disable(&mut self) {
        (self.enabled, self.torque) = (false, 0.0);
    }
}

impl Device for FinchDrive {
    fn power_on(&mut self, _shaft: &Shaft, now: Micros, phase: Micros) {
        *self = Self { commanded: now, next_report: now + phase, ..Self::new(self.id as u8) };
    }

    fn period(&self) -> Micros {
        PERIOD
    }

    fn receive(&mut self, frame: &CanFrame, _: &Shaft, now: Micros, _: &mut Outbox) -> Taken {
        if frame.id() != Id::Standard(StandardId::new(0x300 + self.id).unwrap()) {
            return Taken::NotMine;
        }
        let &[what, high, low] = frame.bytes() else { return Taken::Malformed };
        self.commanded = now;
        match what {
            0 => self.disable(),
            1 => self.enabled = self.error == 0,
            2 if self.enabled => self.torque = f64::from(i16::from_be_bytes([high, low])) / 1000.0,
            2 => (),
            3 => {
                self.error = 0;
                self.disable();
            }
            _ => return Taken::Malformed,
        }
        Taken::Yes
    }

    fn next_event(&self) -> Option<Micros> {
        Some(self.next_report)
    }

    fn advance(&mut self, shaft: &Shaft, now: Micros, out: &mut Outbox) {
        if now >= self.next_report {
            self.next_report += PERIOD;
            out.push(self.report(shaft));
        }
    }

    fn drive(&mut self, shaft: &Shaft, now: Micros) -> Winding {
        if now.since(self.commanded) > PATIENCE {
            self.disable();
        }
        if self.enabled {
            Winding::Current(self.torque / shaft.plant.torque_constant)
        } else {
            Winding::Open
        }
    }

    fn inject(&mut self, fault: EscFault) -> bool {
        self.error = match fault {
            EscFault::OverTemperature => 1,
            EscFault::UnderVoltage => 2,
            _ => return false,
        };
        self.disable();
        true
    }
}

/// Motor, gearbox and load, from the data sheet; friction and inertia are estimates.
pub const PLANT: Plant = Plant {
    gear_ratio: 10.0,
    torque_constant: 0.5,
    back_emf: 0.5,
    resistance: 0.5,
    supply: 24.0,
    current_limit: 10.0,
    current_time_constant: 1e-3,
    rotor_inertia: 2e-5,
    load_inertia: 0.004,
    viscous_friction: 2e-3,
    coulomb_friction: 0.05,
    static_friction: 0.06,
    ambient: 25.0,
    thermal_resistance: 3.0,
    thermal_time_constant: 200.0,
    nonlinear: Nonlinear::NONE,
};

/// Puts one on a wire.
pub fn plug_in(wire: &Bus, id: u8) -> Esc {
    wire.add(FinchDrive::new(id), PLANT)
}
