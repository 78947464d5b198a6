//! A VESC from the device's side: what it takes from the bus, what it puts on it, and its control
//! modes.
//!
//! Sources: vedderb/bldc, `comm/comm_can.c`, `motor/foc_math.c`, `motor/mcpwm_foc.c`,
//! `motor/mcconf_default.h`, `applications/appconf_default.h` (facts, no code).
//!
//! Estimated: the brake (no more current than the shorted winding would drive, so that it fades at
//! low speed) and the handbrake (a spring of half a field's turn, without a damper of its own). Not
//! simulated: start-up time, sensorless start, input current limits, field weakening.

mod control;
mod wire;

use rc10_can::CanFrame;
use rc10_time::Micros;

pub use control::Mode;
pub use wire::{Order, Report};

use crate::device::{Device, EscFault, NoDevice, Outbox, Taken, Winding, set_if};
use crate::motor::{STEP, Shaft};
use crate::plant::Plant;
use control::Control;

/// Configuration of a VESC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VescConfig {
    /// 0 ..= 254.
    pub id: u8,
    /// Pole pairs of the motor, 1 or more.
    pub pole_pairs: u8,
    /// Rates of STATUS to `STATUS_6`, in Hz; 0: never, as by factory default.
    pub status_hz: [u16; 6],
    /// Slower than this speed is not regulated, electrical rpm.
    pub minimum_erpm: f64,
    /// The time for which a command holds; then it lets go.
    pub timeout: Micros,
    /// Most current that drives, A.
    pub current_max: f64,
    /// Most current that brakes, A.
    pub brake_max: f64,
    /// Its position controller has an encoder on the output shaft; else it knows the field's angle.
    pub encoder_on_shaft: bool,
    /// Gains of the speed controller, in shares of the current limit per 20 electrical rpm: `s_pid_kp`
    /// and, per second, `s_pid_ki`.
    pub speed_gains: [f64; 2],
    /// The largest rate of change of its speed, electrical rpm per second: `s_pid_ramp_erpms_s`.
    pub speed_ramp: f64,
    /// Gains of the position controller, in shares of the current limit per degree, and times
    /// seconds: `p_pid_kp`, `p_pid_kd_proc`.
    pub position_gains: [f64; 2],
    /// The motor and its load.
    pub plant: Plant,
}

impl VescConfig {
    /// As it comes from the factory (bldc's `mcconf_default.h` and `appconf_default.h`), but for
    /// the plant; seven pole pairs. It reports nothing, and lets go after one second.
    pub const fn new(id: u8, plant: Plant) -> Self {
        Self {
            id,
            pole_pairs: 7,
            status_hz: [0; 6],
            minimum_erpm: 900.0,
            timeout: Micros::from_millis(1000),
            current_max: 60.0,
            brake_max: 60.0,
            encoder_on_shaft: false,
            speed_gains: [0.004, 0.004],
            speed_ramp: 25_000.0,
            position_gains: [0.025, 0.000_35],
            plant,
        }
    }
}

/// An outrunner of the size that robots drive wheels with, 270 rpm/V, on 24 V, no gearbox and no
/// load. The torque constant follows from the speed constant; resistance, inertia, friction and
/// thermal figures are estimates for such a motor.
pub const fn outrunner_270_kv() -> Plant {
    // 60 / (2 π · 270)
    let torque_constant = 0.035_368;
    Plant::motor(1.0, torque_constant, 0.06, 80.0, 1.2e-4)
        .with_friction(5e-5, 0.02, 0.025)
        .with_heating(1.5, 200.0)
}

/// The electronics of a VESC.
pub struct Vesc {
    config: VescConfig,
    control: Control,
    /// Newest order that drives, and when it came.
    last_order: Option<Micros>,
    /// Most negative and most positive motor current, A.
    pub current_limits: (f64, f64),
    /// The fault, which no CAN frame tells.
    pub fault: Option<EscFault>,
    is_off: bool,
    next_reports: [Option<Micros>; 6],
    /// Rotor turns at which the tachometer stood at zero.
    tachometer_zero: Option<f64>,
    /// Ampere hours and watt hours: drawn, fed back.
    charge: [f64; 2],
    energy: [f64; 2],
    /// The voltage of the winding now, as a share of the supply voltage.
    duty: f64,
    input_current: f64,
}

impl Vesc {
    /// A VESC that is set up like this; it goes on a bus with its plant
    /// ([`Bus::add`](crate::Bus::add)). Fails if there is no such id, motor or rate.
    pub fn new(config: VescConfig) -> Result<Self, NoDevice> {
        // Id 255 means all of them.
        if config.id == 255 {
            return Err(NoDevice("a VESC takes ids 0 to 254".into()));
        }
        if config.pole_pairs == 0 {
            return Err(NoDevice("a motor has one pole pair or more".into()));
        }
        if let Some(hz) = config.status_hz.iter().find(|hz| **hz > 1000) {
            return Err(NoDevice(format!("a VESC reports at most 1000 times a second, not {hz}")));
        }
        Ok(Self::started(config))
    }

    fn started(config: VescConfig) -> Self {
        Self {
            control: Control::default(),
            last_order: None,
            current_limits: (-config.brake_max, config.current_max),
            fault: None,
            is_off: false,
            next_reports: [None; 6],
            tachometer_zero: None,
            charge: [0.0; 2],
            energy: [0.0; 2],
            duty: 0.0,
            input_current: 0.0,
            config,
        }
    }

    /// Connects it to a motor with another number of pole pairs, 1 or more.
    pub fn set_pole_pairs(&mut self, pole_pairs: u8) {
        self.config.pole_pairs = pole_pairs.max(1);
    }

    /// The control mode.
    pub const fn mode(&self) -> Mode {
        self.control.mode
    }

    /// Switches status frames on or off, as VESC Tool does; they come at once.
    pub fn set_status_hz(&mut self, status_hz: [u16; 6], now: Micros) {
        self.config.status_hz = status_hz;
        self.schedule(now);
    }

    fn schedule(&mut self, first: Micros) {
        self.next_reports = self.config.status_hz.map(|hz| (hz > 0).then_some(first));
    }

    fn pole_pairs(&self) -> f64 {
        self.config.pole_pairs.into()
    }

    /// Angle of the position controller, degrees in 0 .. 360.
    fn position(&self, shaft: &Shaft) -> f64 {
        if self.config.encoder_on_shaft {
            shaft.radians().to_degrees().rem_euclid(360.0)
        } else {
            (shaft.rotor_angle() * self.pole_pairs()).fract() * 360.0
        }
    }

    /// The report of this index.
    fn report(&mut self, index: usize, shaft: &Shaft) -> Report {
        match index {
            0 => Report::Status1 {
                erpm: shaft.rotor_rpm() * self.pole_pairs(),
                // Its sign says whether the motor takes power or gives it.
                current: shaft.current.abs() * (shaft.current * self.duty).signum(),
                duty: self.duty,
            },
            1 => Report::Status2(self.charge[0], self.charge[1]),
            2 => Report::Status3(self.energy[0], self.energy[1]),
            3 => Report::Status4 {
                transistors: match self.fault {
                    // Where the firmware drives no current any more (`l_temp_fet_end`), and above.
                    Some(EscFault::OverTemperature) => 105.0,
                    _ => shaft.plant.ambient + 0.2 * shaft.current.abs(),
                },
                motor: shaft.temperature,
                input: self.input_current,
                position: self.position(shaft),
            },
            4 => Report::Status5 { steps: self.steps(shaft), supply: shaft.plant.supply },
            _ => Report::Status6([0.0; 4]),
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "goes round, as the firmware's int does")]
    fn steps(&mut self, shaft: &Shaft) -> i32 {
        let turns = shaft.rotor_turns();
        let zero = *self.tachometer_zero.get_or_insert(turns);
        ((turns - zero) * self.pole_pairs() * 6.0).floor() as i64 as i32
    }
}

impl Device for Vesc {
    fn set_id(&mut self, id: u8) -> bool {
        set_if(id != 255, &mut self.config.id, id)
    }

    fn power_on(&mut self, _shaft: &Shaft, now: Micros, phase: Micros) {
        *self = Self::started(self.config);
        self.schedule(now + phase);
    }

    fn period(&self) -> Micros {
        let fastest = self.config.status_hz.into_iter().max().unwrap_or(0).max(1);
        Micros::new(1_000_000 / u64::from(fastest))
    }

    fn receive(&mut self, frame: &CanFrame, _: &Shaft, now: Micros, out: &mut Outbox) -> Taken {
        let order = match Order::parse(frame, self.config.id) {
            _ if self.is_off => return Taken::NotMine,
            Ok(order) => order,
            Err(taken) => return taken,
        };
        match order {
            Order::Ping(asker) => out.push(Report::Pong(asker).frame(self.config.id)),
            Order::CurrentLimits { min, max, is_stored } => {
                self.current_limits = (min.min(0.0), max.max(0.0));
                if is_stored {
                    (self.config.brake_max, self.config.current_max) =
                        (-self.current_limits.0, self.current_limits.1);
                }
            }
            Order::Shutdown => self.is_off = true,
            order => {
                self.last_order = Some(now);
                self.control.take(&order, self.current_limits);
            }
        }
        Taken::Yes
    }

    fn next_event(&self) -> Option<Micros> {
        self.next_reports.into_iter().flatten().min()
    }

    fn advance(&mut self, shaft: &Shaft, now: Micros, out: &mut Outbox) {
        for index in 0..self.next_reports.len() {
            let Some(due) = self.next_reports[index].filter(|due| now >= *due) else { continue };
            let period = 1_000_000 / u64::from(self.config.status_hz[index].max(1));
            self.next_reports[index] = Some(due + Micros::new(period));
            let report = self.report(index, shaft);
            if !self.is_off {
                out.push(report.frame(self.config.id));
            }
        }
    }

    fn drive(&mut self, shaft: &Shaft, now: Micros) -> Winding {
        let _ = self.steps(shaft);
        let silent = self.last_order.is_some_and(|at| now.since(at) >= self.config.timeout);
        if silent {
            self.last_order = None;
            self.control = Control::default();
        }
        if self.fault.is_some() || self.is_off {
            self.control = Control::default();
        }
        let position = self.position(shaft);
        let winding = self.control.drive(&self.config, self.current_limits, shaft, position);
        let plant = &shaft.plant;
        // What the terminals see; undriven, the firmware follows the motor's own voltage.
        let volts = plant.back_emf * shaft.speed + plant.resistance * shaft.current;
        self.duty = (volts / plant.supply).clamp(-1.0, 1.0);
        self.input_current = self.duty * shaft.current;
        let hours = self.input_current.abs() * STEP / 3600.0;
        let way = usize::from(self.input_current < 0.0);
        self.charge[way] += hours;
        self.energy[way] += hours * plant.supply;
        winding
    }

    fn inject(&mut self, fault: EscFault) -> bool {
        // A time-out is no fault of a VESC.
        if fault == EscFault::CommunicationLost {
            return false;
        }
        self.fault = Some(fault);
        true
    }
}
