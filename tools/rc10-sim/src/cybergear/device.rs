use rc10_can::CanFrame;
use rc10_time::Micros;

use super::Model;
use super::parameters::Parameters;
use super::wire::{self, Command, Motion, Report};
use crate::device::{Beyond, Device, EscFault, Outbox, Taken, Winding};
use crate::motor::Shaft;

/// Whether a device moves its motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The motor is not driven.
    #[default]
    Reset,
    /// The motor is driven as the run mode says.
    Run,
}

/// The number of a simulated chip; its last byte is the motor's first identifier.
const CHIP: [u8; 7] = *b"RC10CYB";
/// Number of steps of a device's own loops in a physics step (*assumed*: 20 kHz).
const LOOPS: f64 = 2.0;

/// A simulated CyberGear or RobStride.
#[must_use]
pub struct CyberGear {
    model: Model,
    /// The behaviour of reports beyond their range: no source tells.
    pub beyond: Beyond,
    id: u8,
    chip: [u8; 8],
    /// The host that spoke to it last.
    host: u8,
    /// Whether it moves its motor.
    pub mode: Mode,
    motion: Motion,
    /// The parameters that types 17 and 18 reach.
    pub parameters: Parameters,
    saved: Parameters,
    /// Six bits of feedback.
    faults: u8,
    /// Bits of a fault frame.
    details: u32,
    /// Whether faults stay when they are cleared, because their cause is still there.
    pub lasting: bool,
    /// A fault frame is due.
    tells: bool,
    /// The shaft's angle that counts as zero, rad of [`Shaft::radians`].
    zero: f64,
    /// The zero that a RobStride keeps without power.
    saved_zero: f64,
    placed: bool,
    integral: f64,
    jog: f64,
    last_heard: Micros,
    next_report: Option<Micros>,
    /// A CyberGear whose bit rate was changed: 1 is 1 Mbit/s. Takes effect at power-on.
    bit_rate: u8,
    deaf: bool,
    /// The number of times that its flash was written.
    pub saves: u32,
}

impl CyberGear {
    /// A model with an identifier, as it is sold otherwise.
    pub const fn new(model: &Model, id: u8) -> Self {
        let [a, b, c, d, e, f, g] = CHIP;
        Self {
            model: *model,
            beyond: Beyond::Saturates,
            id,
            chip: [a, b, c, d, e, f, g, id],
            host: 0,
            mode: Mode::Reset,
            motion: Motion { position: 0.0, velocity: 0.0, kp: 0.0, kd: 0.0, torque: 0.0 },
            parameters: Parameters::new(model),
            saved: Parameters::new(model),
            faults: 0,
            details: 0,
            lasting: false,
            tells: false,
            zero: 0.0,
            saved_zero: 0.0,
            placed: false,
            integral: 0.0,
            jog: 0.0,
            last_heard: Micros::ZERO,
            next_report: None,
            bit_rate: 1,
            deaf: false,
            saves: 0,
        }
    }

    /// With a time-out that it keeps without power, in 50 µs: a RobStride's.
    pub const fn with_timeout(mut self, steps: u32) -> Self {
        self.parameters.timeout = steps;
        self.saved.timeout = steps;
        self
    }

    /// The six fault bits of its feedback, and those of its fault frame.
    pub const fn faults(&self) -> (u8, u32) {
        (self.faults, self.details)
    }

    /// Position of its shaft as it counts it, rad, all turns included.
    pub fn position(&self, shaft: &Shaft) -> f64 {
        shaft.radians() - self.zero
    }

    fn fail(&mut self, bit: u8, details: u32) {
        self.faults |= bit;
        self.details |= details;
        self.tells = true;
        self.stop();
    }

    fn stop(&mut self) {
        self.mode = Mode::Reset;
        self.motion = Motion::default();
        self.integral = 0.0;
        self.jog = 0.0;
    }

    fn is_well(&self) -> bool {
        self.faults == 0 && self.details == 0
    }

    fn report(&self, shaft: &Shaft) -> Report {
        Report {
            mode: if self.mode == Mode::Run { 2 } else { 0 },
            faults: self.faults,
            position: self.beyond.of(self.position(shaft), self.model.position),
            velocity: shaft.speed,
            torque: shaft.torque(),
            temperature: shaft.temperature,
        }
    }

    fn feedback(&self, unasked: bool, shaft: &Shaft) -> CanFrame {
        wire::feedback(unasked, self.id, self.host, &self.report(shaft), &self.model)
    }

    /// Sets the angle of the shaft when power comes: nothing but the rotor's angle within its turn
    /// is known to a CyberGear; a RobStride knows the output's, from its saved zero (*assumed*,
    /// both).
    fn place(&mut self, shaft: &Shaft) {
        let (turn, zero) = if self.model.robstride {
            (std::f64::consts::TAU, self.saved_zero)
        } else {
            (std::f64::consts::TAU / shaft.plant.gear_ratio, 0.0)
        };
        let within = (shaft.radians() - zero + turn / 2.0).rem_euclid(turn) - turn / 2.0;
        self.zero = shaft.radians() - within;
        self.placed = true;
    }

    fn obey(&mut self, command: Command, host: u8, shaft: &Shaft) -> Option<CanFrame> {
        match command {
            Command::Identify => return Some(wire::identity(self.id, self.chip)),
            Command::Motion(motion) if self.mode == Mode::Run => self.motion = motion,
            Command::Enable if self.is_well() => self.mode = Mode::Run,
            Command::Motion(_) | Command::Enable => (),
            Command::Stop { clear } => {
                self.stop();
                if clear && !self.lasting {
                    (self.faults, self.details) = (0, 0);
                }
            }
            Command::SetZero => self.zero = shaft.radians(),
            Command::SetId(id) => {
                self.id = id;
                return Some(wire::identity(self.id, self.chip));
            }
            Command::Read(index) => {
                let value = self.parameters.read(index, &self.model, self.position(shaft), shaft);
                return Some(wire::parameter(self.id, host, index, value));
            }
            Command::Write(index, value) => {
                // Feedback tells nothing of a parameter that there is not.
                if self.parameters.write(index, value, &self.model) == Some(())
                    && (index, value[0]) == (0x7005, 7)
                {
                    let field = f64::from(u16::from_be_bytes([value[2], value[3]]));
                    let speed = (field / 65_535.0 * 2.0 - 1.0) * self.model.velocity;
                    self.jog = if value[1] == 1 { speed } else { 0.0 };
                    self.mode = if self.is_well() { Mode::Run } else { Mode::Reset };
                }
            }
            Command::SaveOrBitRate(data) if self.model.robstride => {
                if data == [1, 2, 3, 4, 5, 6, 7, 8] {
                    self.saved = self.parameters;
                    self.saved_zero = self.zero;
                    self.saves += 1;
                }
            }
            Command::SaveOrBitRate(data) => {
                if (1..=4).contains(&data[0]) {
                    self.bit_rate = data[0];
                }
                return Some(wire::identity(self.id, self.chip));
            }
            Command::Report(on) => {
                self.next_report = on.then(|| self.last_heard + self.report_period());
            }
        }
        Some(self.feedback(false, shaft))
    }

    fn report_period(&self) -> Micros {
        Micros::from_millis(5 + 5 * u64::from(self.parameters.report_interval))
    }

    /// The current it drives, A, by its run mode.
    fn current(&mut self, shaft: &Shaft) -> f64 {
        let Self { parameters, motion, model, .. } = *self;
        let constant = model.torque_constant;
        let (position, velocity) = (self.position(shaft), shaft.speed);
        let most = f64::from(parameters.torque_limit) / constant;
        let toward = |place: f64| {
            let speed = f64::from(parameters.position_gain) * (place - position);
            let limit = f64::from(parameters.velocity_limit);
            speed.clamp(-limit, limit)
        };
        let current = match parameters.run_mode {
            0 => {
                let torque = motion.kp * (motion.position - position)
                    + motion.kd * (motion.velocity - velocity)
                    + motion.torque;
                torque.clamp(-model.torque, model.torque) / constant
            }
            1 | 5 => self.regulate(toward(parameters.position.into()), velocity),
            2 => self.regulate(parameters.velocity.into(), velocity),
            3 => parameters.current.into(),
            4 => self.regulate(toward(0.0), velocity),
            _ => self.regulate(self.jog, velocity),
        };
        current.clamp(-most, most)
    }

    /// The velocity loop: A. A RobStride's gain has another unit, which no manual tells: it is
    /// scaled so that what it is sold with gives full current at a third of full speed.
    fn regulate(&mut self, wanted: f64, velocity: f64) -> f64 {
        let [kp, ki] = self.parameters.velocity_gains.map(f64::from);
        let limit = f64::from(self.parameters.current_limit);
        let scale = if self.model.robstride {
            self.model.current / (self.model.velocity / 3.0) / 6.0
        } else {
            1.0
        };
        let error = wanted - velocity;
        self.integral = (self.integral + ki * LOOPS * scale * error).clamp(-limit, limit);
        (kp * scale * error + self.integral).clamp(-limit, limit)
    }
}

impl Device for CyberGear {
    fn set_id(&mut self, id: u8) -> bool {
        self.id = id;
        true
    }

    fn power_on(&mut self, _shaft: &Shaft, now: Micros, _phase: Micros) {
        self.stop();
        self.parameters = self.saved;
        // Commands are not kept.
        let Parameters { run_mode, current, velocity, position, .. } = Parameters::new(&self.model);
        self.parameters = Parameters { run_mode, current, velocity, position, ..self.parameters };
        (self.faults, self.details, self.tells, self.lasting) = (0, 0, false, false);
        self.placed = false;
        self.next_report = None;
        self.last_heard = now;
        self.deaf = self.bit_rate != 1;
    }

    fn receive(&mut self, frame: &CanFrame, shaft: &Shaft, now: Micros, out: &mut Outbox) -> Taken {
        if self.deaf {
            return Taken::NotMine;
        }
        let Some((target, host, command)) = wire::read(frame, &self.model) else {
            return Taken::NotMine;
        };
        if target != self.id {
            return Taken::NotMine;
        }
        let Some(command) = command else { return Taken::Malformed };
        if !self.placed {
            self.place(shaft);
        }
        self.last_heard = now;
        // Motion control has a torque where the others have the host.
        if !matches!(command, Command::Motion(_)) {
            self.host = host;
        }
        if let Some(answer) = self.obey(command, host, shaft) {
            out.push(answer);
        }
        Taken::Yes
    }

    fn next_event(&self) -> Option<Micros> {
        if self.tells { Some(Micros::ZERO) } else { self.next_report }
    }

    fn advance(&mut self, shaft: &Shaft, now: Micros, out: &mut Outbox) {
        if std::mem::take(&mut self.tells) && !self.deaf {
            let warnings = u32::from(shaft.temperature >= self.model.hot);
            out.push(wire::faults(self.id, self.host, self.details, warnings));
        }
        if let Some(due) = self.next_report
            && now >= due
        {
            self.next_report = Some(due + self.report_period());
            out.push(self.feedback(true, shaft));
        }
    }

    fn drive(&mut self, shaft: &Shaft, now: Micros) -> Winding {
        if !self.placed {
            self.place(shaft);
        }
        if shaft.temperature >= self.model.too_hot && self.faults & TOO_HOT == 0 {
            self.fail(TOO_HOT, 1);
        }
        // A RobStride's time-out: back to mode reset (*assumed*; its unit is in the manual).
        let timeout = u64::from(self.parameters.timeout) * 50;
        if timeout > 0 && self.mode == Mode::Run && now.since(self.last_heard).get() > timeout {
            self.stop();
        }
        match self.mode {
            Mode::Reset => Winding::Open,
            Mode::Run => Winding::Current(self.current(shaft)),
        }
    }

    fn inject(&mut self, fault: EscFault) -> bool {
        // A bit of the feedback, and one of the fault frame, which has more of them.
        let (bit, details) = match fault {
            EscFault::UnderVoltage => (1 << 0, 1 << 2),
            EscFault::OverCurrent => (1 << 1, 1 << 16),
            EscFault::OverTemperature => (TOO_HOT, 1 << 0),
            EscFault::Encoder => (1 << 3, 1 << 7),
            // The feedback has no bit for it.
            EscFault::OverVoltage => (0, 1 << 3),
            EscFault::CommunicationLost => return false,
        };
        self.fail(bit, details);
        true
    }
}

const TOO_HOT: u8 = 1 << 2;
