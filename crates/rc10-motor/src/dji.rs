//! DJI RoboMaster motors: M3508 with C620, M2006 with C610, GM6020 in current and voltage mode.
//!
//! The controllers send their feedback by themselves (1 kHz by default); one command frame drives
//! up to four of them, two bytes each. What they do when commands stop is not documented: assume
//! that they keep the last current. They have no speed or angle control of their own, so a
//! [`Dji`] runs a [`Cascade`] at its output shaft.
//!
//! Sources: C620, C610 and GM6020 user manuals (CAN tables), RoboMaster Development-Board-C
//! examples.

pub mod signals;

use core::fmt;

use embedded_can::{Id, StandardId};
use rc10_app::maths::{round_to_i16, round_to_i32, within};
use rc10_app::{
    Amps, Celsius, ConfigError, CountsPerTurn, Degrees, Gear, NewtonMetres, PidConfig, Rpm,
    RpmPerSecond, Seconds, TotalAngle,
    angle::{nearest_movement, shortest_way, shortest_way_in_bits},
};
use rc10_can::{CanFrame, IdPattern, Micros};

use crate::batch::{TxBatch, TxFull};
use crate::motor::{
    CanMotor, DriveMode, Fault, Feedback, FrameError, FrameKind, Gains, Loops, Motor, Request,
    RequestError, Response, Target, TargetError, TargetKind, TargetSet,
};
use crate::wiring::{CanIds, Ownership, Rate, RxFrames, TxFrames};
use rc10_app::cascade::{Cascade, CascadeState};

/// Encoder counts per rotor turn, of all models: 8192.
const ENCODER_COUNTS: u32 = 1 << ENCODER_BITS;
const ENCODER_BITS: u32 = 13;

/// What tells one DJI model from another. Other controllers that speak the same protocol are one
/// more constant of this type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// As the vendor writes it.
    pub name: &'static str,
    /// Identifiers go from 1 to this.
    pub last_id: u8,
    /// Feedback comes with this plus the identifier set on the device.
    pub feedback_base: u16,
    /// Command frame of identifiers 1 ..= 4, and of 5 ..= 8.
    pub command_ids: [u16; 2],
    /// What the command means.
    pub effort: Effort,
    /// Raw command at full scale.
    pub full_scale: i16,
    /// Amperes per raw unit of the current in the feedback.
    pub amps_per_count: f32,
    /// Whether byte 6 of the feedback is a temperature.
    pub has_temperature: bool,
    /// The gearbox it is sold with.
    pub gear: Gear,
    /// Torque per ampere at the rotor, N m / A.
    pub rotor_torque_constant: f32,
    /// Gains it works well with out of the box, from a bare shaft to a usual load (wheel of a
    /// 20 kg robot: 0.029 kg m², M2006 0.002, gimbal 0.01), give or take 30 %:
    /// `tests/closed_loop.rs`.
    pub cascade: Cascade,
}

/// What a raw command stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effort {
    /// A torque-producing current; full scale is so many amperes.
    Current(f32),
    /// A voltage, as a share of full scale: the vendor documents no volts per count.
    Voltage,
}

impl Effort {
    /// Full scale, in the unit the cascade works in.
    const fn full(self) -> f32 {
        match self {
            Self::Current(amps) => amps,
            Self::Voltage => 1.0,
        }
    }
}

const fn gear(rotor: u32, output: u32) -> Gear {
    match Gear::new(rotor, output) {
        Some(gear) => gear,
        None => Gear::DIRECT,
    }
}

const fn cascade(speed: PidConfig, angle: PidConfig, acceleration: f32, forward: f32) -> Cascade {
    Cascade {
        speed,
        angle,
        outer_divider: 10,
        acceleration: RpmPerSecond::new(acceleration),
        feed_forward: forward,
    }
}

/// M3508 with its C620: ±20 A, gear 3591 : 187.
pub const M3508: Model = Model {
    name: "M3508",
    last_id: 8,
    feedback_base: 0x200,
    command_ids: [0x200, 0x1FF],
    effort: Effort::Current(20.0),
    full_scale: 16384,
    amps_per_count: 20.0 / 16384.0,
    has_temperature: true,
    gear: gear(3591, 187),
    rotor_torque_constant: 0.015_622,
    cascade: cascade(
        PidConfig::new(0.40, 2.0, 0.0, 20.0),
        PidConfig::new(1.3, 0.0, 0.0, 400.0),
        1000.0,
        0.0,
    ),
};

/// M2006 with its C610: ±10 A, gear 36 : 1. It has no temperature sensor.
pub const M2006: Model = Model {
    name: "M2006",
    last_id: 8,
    feedback_base: 0x200,
    command_ids: [0x200, 0x1FF],
    effort: Effort::Current(10.0),
    full_scale: 10000,
    amps_per_count: 10.0 / 10000.0,
    has_temperature: false,
    gear: gear(36, 1),
    rotor_torque_constant: 0.005,
    cascade: cascade(
        PidConfig::new(0.10, 0.75, 0.0, 10.0),
        PidConfig::new(1.3, 0.0, 0.0, 400.0),
        2000.0,
        0.0,
    ),
};

/// GM6020 set to current mode: ±3 A, no gearbox. The mode is set in RoboMaster Assistant (firmware
/// 1.0.11.2 or newer); a motor obeys only the mode it is set to.
pub const GM6020_CURRENT: Model = Model {
    name: "GM6020 (current mode)",
    last_id: 7,
    feedback_base: 0x204,
    command_ids: [0x1FE, 0x2FE],
    effort: Effort::Current(3.0),
    full_scale: 16384,
    amps_per_count: 3.0 / 16384.0,
    has_temperature: true,
    gear: Gear::DIRECT,
    rotor_torque_constant: 0.741,
    cascade: cascade(
        PidConfig::new(0.04, 0.1, 0.0, 3.0),
        PidConfig::new(0.8, 0.0, 0.0, 250.0),
        500.0,
        0.0,
    ),
};

/// GM6020 set to voltage mode, as it is sold. ±25000 is what every firmware takes (the first manual
/// says 30000, all newer ones 25000).
pub const GM6020_VOLTAGE: Model = Model {
    name: "GM6020 (voltage mode)",
    command_ids: [0x1FF, 0x2FF],
    effort: Effort::Voltage,
    full_scale: 25000,
    cascade: cascade(
        PidConfig::new(0.003, 0.06, 0.0, 1.0),
        PidConfig::new(0.8, 0.0, 0.0, 250.0),
        500.0,
        // 320 rpm at full voltage without load; less, so that a weak motor is not overdriven.
        0.7 / 320.0,
    ),
    ..GM6020_CURRENT
};

/// An identifier that no device of the model can be set to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct IdOutOfRange {
    /// The model.
    pub model: &'static str,
    /// What was asked for.
    pub id: u8,
    /// Identifiers go from 1 to this.
    pub last_id: u8,
}

impl fmt::Display for IdOutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { model, id, last_id } = self;
        write!(f, "{model} id {id}: its identifiers are 1 to {last_id}")
    }
}

impl core::error::Error for IdOutOfRange {}

/// Which way the output shaft counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// As the motor does.
    #[default]
    Forward,
    /// The other way: a motor that is mounted mirrored.
    Reversed,
}

impl Direction {
    /// 1 for forward, -1 for reversed.
    #[inline]
    #[must_use]
    pub const fn sign(self) -> i8 {
        match self {
            Self::Forward => 1,
            Self::Reversed => -1,
        }
    }
}

/// How often the controller sends feedback; set in RoboMaster Assistant (GM6020: 1 kHz only).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FeedbackRate {
    /// 1000 Hz, the factory setting.
    #[default]
    Hz1000,
    /// 500 Hz: needed from six motors a bus on.
    Hz500,
    /// 250 Hz; above 6750 rpm the rotor's turns are estimated, see [`Feedback::turn_gaps`].
    Hz250,
    /// 125 Hz; above 3375 rpm the rotor's turns are estimated.
    Hz125,
}

impl FeedbackRate {
    /// In frames a second.
    #[must_use]
    pub const fn hz(self) -> u16 {
        match self {
            Self::Hz1000 => 1000,
            Self::Hz500 => 500,
            Self::Hz250 => 250,
            Self::Hz125 => 125,
        }
    }
}

/// The bytes of a feedback frame, as numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawFeedback {
    /// Rotor angle, 0 ..= 8191 for one turn.
    pub angle: u16,
    /// Rotor speed, rpm.
    pub rpm: i16,
    /// Torque current, [`Model::amps_per_count`] each.
    pub current: i16,
    /// Temperature in degrees Celsius, where the model has one.
    pub temperature: u8,
}

impl RawFeedback {
    /// From the eight bytes of a frame; byte 7 means nothing.
    #[inline]
    #[must_use]
    pub const fn unpack(bytes: &[u8; 8]) -> Self {
        // Two fields to a word: half the loads and byte swaps.
        let [a, b, c, d, e, f, temperature, _] = *bytes;
        let motion = u32::from_be_bytes([a, b, c, d]);
        #[expect(clippy::cast_possible_truncation, reason = "the halves of a word")]
        let (angle, rpm) = ((motion >> 16) as u16, motion as i16);
        Self { angle, rpm, current: i16::from_be_bytes([e, f]), temperature }
    }
}

impl Model {
    /// The identifier of the feedback of device `id`.
    ///
    /// # Errors
    /// [`IdOutOfRange`].
    pub fn feedback_id(&self, id: u8) -> Result<StandardId, IdOutOfRange> {
        let error = IdOutOfRange { model: self.name, id, last_id: self.last_id };
        if id == 0 || id > self.last_id {
            return Err(error);
        }
        StandardId::new(self.feedback_base + u16::from(id)).ok_or(error)
    }

    /// The identifier of the frame that commands device `id`, and the first of its two bytes in it.
    ///
    /// # Errors
    /// [`IdOutOfRange`].
    pub fn command_lane(&self, id: u8) -> Result<(StandardId, usize), IdOutOfRange> {
        self.feedback_id(id)?;
        let error = IdOutOfRange { model: self.name, id, last_id: self.last_id };
        let group = usize::from(id - 1) / 4;
        let frame = self.command_ids.get(group).copied().and_then(StandardId::new).ok_or(error)?;
        Ok((frame, usize::from(id - 1) % 4 * 2))
    }

    /// The raw command for an effort: rounded to the nearest, limited to full scale; 0 for NaN.
    #[inline]
    #[must_use]
    pub fn raw_command(&self, effort: f32) -> i16 {
        let full = f32::from(self.full_scale);
        round_to_i16(within(effort * (full / self.effort.full()), full))
    }
}

/// One DJI motor.
#[derive(Clone, Debug)]
pub struct Dji {
    model: &'static Model,
    id: u8,
    feedback_key: u32,
    command_id: StandardId,
    lane: usize,
    gear: Gear,
    direction: Direction,
    rate: FeedbackRate,
    cascade: Cascade,
    /// Largest effort, at most full scale.
    limit: f32,
    /// Largest effort of the speed loop by its own gains.
    loop_limit: f32,
    scale: Scale,
    target: Target,
    goal: Goal,
    /// The angle to keep while the bus says hold.
    held: Option<i64>,
    /// Whether it followed its target in the last tick.
    ran: bool,
    state: CascadeState,
    turn_gaps: u32,
    heard: bool,
    seen: Seen,
}

/// Factors that follow from model, gear and direction: computed once.
#[derive(Clone, Copy, Debug)]
struct Scale {
    /// 1 or -1.
    sign: i32,
    /// Output rpm per rotor rpm, with the sign.
    output_per_rotor: f32,
    /// Raw command per effort, with the sign.
    raw_per_effort: f32,
    /// Amperes per count of the current that is told, with the sign.
    amps_per_count: f32,
    /// Torque at the output per ampere, N m.
    torque_per_amp: f32,
    /// Degrees of the output per rotor count, with the sign.
    degrees_per_count: f32,
    /// Degrees of the output per phase step.
    degrees_per_phase: f32,
    /// Phase steps per turn of the output: encoder counts times rotor turns, so that a rotor count
    /// is a whole number of them whatever the gear.
    phase_turn: i32,
    /// Phase steps per rotor count, with the sign.
    phase_per_count: i32,
    /// How a [`TotalAngle`] counts: rotor encoder counts.
    counts_per_turn: CountsPerTurn,
}

/// The target in the motor's own terms.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Goal {
    Rest,
    Effort(f32),
    Speed(f32),
    /// Phase of the output within its turn.
    Angle(i32),
    /// Rotor counts, in the rotor's own direction.
    Total(i64),
}

/// What the newest feedback told.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    at: Micros,
    /// As received; what is rarely asked for is decoded when it is.
    bytes: [u8; 8],
    /// Rotor angle, 0 ..= 8191.
    angle: i32,
    /// Output rpm.
    speed: f32,
    /// Rotor counts from the zero, in the rotor's own direction.
    total: i64,
    /// Of the output, 0 ..< `phase_turn`.
    phase: i32,
}

/// Frames this close together (µs) are certain to be less than half a turn apart: no rotor of these
/// motors makes 20,700 rpm.
const CERTAIN_MICROS: u64 = 1_300;
/// Speed (rpm) times time (µs) in which the rotor makes 0.45 turns: beyond it, the turns between
/// two frames are not certain any more.
const CERTAIN_RPM_MICROS: u64 = 27_000_000;
/// Nor are they after such a silence, whatever the speed was before and after.
const LONG_SILENCE: Micros = Micros::from_millis(100);

impl Dji {
    /// The device set to identifier `id`, with its stock gearbox, turning forward, at 1 kHz
    /// feedback and with the gains that come with the model.
    ///
    /// # Errors
    /// [`IdOutOfRange`].
    pub fn new(model: &'static Model, id: u8) -> Result<Self, IdOutOfRange> {
        let feedback_id = model.feedback_id(id)?;
        let (command_id, lane) = model.command_lane(id)?;
        Ok(Self {
            model,
            id,
            feedback_key: CanFrame::key_of(feedback_id),
            command_id,
            lane,
            gear: model.gear,
            direction: Direction::Forward,
            rate: FeedbackRate::Hz1000,
            cascade: model.cascade,
            limit: model.effort.full(),
            loop_limit: model.cascade.speed.output_limit,
            scale: Scale::of(model, model.gear, Direction::Forward),
            target: Target::Coast,
            goal: Goal::Rest,
            held: None,
            ran: false,
            state: CascadeState::new(),
            turn_gaps: 0,
            heard: false,
            // So long ago that the first frame comes after a silence, whenever it comes.
            seen: Seen { at: Micros::new(u64::MAX / 2), ..Seen::default() },
        })
    }

    /// With another gearbox ([`Gear::DIRECT`] for none). The gains are scaled so that the rotor is
    /// driven as before; an explicit [`with_cascade`](Self::with_cascade) comes after this.
    #[must_use]
    pub fn with_gear(mut self, gear: Gear) -> Self {
        let factor = gear.ratio() / self.gear.ratio();
        self.cascade.speed.kp *= factor;
        self.cascade.speed.ki *= factor;
        self.cascade.speed.kd *= factor;
        self.cascade.feed_forward *= factor;
        self.cascade.angle.output_limit /= factor;
        self.cascade.acceleration = self.cascade.acceleration / factor;
        self.gear = gear;
        self.scale = Scale::of(self.model, gear, self.direction);
        self
    }

    /// Turning the given way.
    #[must_use]
    pub fn with_direction(mut self, direction: Direction) -> Self {
        self.direction = direction;
        self.scale = Scale::of(self.model, self.gear, direction);
        self
    }

    /// With the feedback rate that is set in the controller.
    #[must_use]
    pub const fn with_feedback_rate(mut self, rate: FeedbackRate) -> Self {
        self.rate = rate;
        self
    }

    /// With gains of your own.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used.
    pub fn with_cascade(mut self, cascade: Cascade) -> Result<Self, ConfigError> {
        let named = |error: ConfigError| error.of_device(self.model.name, self.id.into());
        cascade.validate().map_err(named)?;
        self.cascade = cascade;
        self.loop_limit = cascade.speed.output_limit;
        self.apply_limit();
        Ok(self)
    }

    /// The model.
    #[must_use]
    pub const fn model(&self) -> &'static Model {
        self.model
    }

    /// The command it sends now: raw, as on the wire.
    #[inline]
    #[must_use]
    pub fn raw_command(&self) -> i16 {
        round_to_i16(self.state.effort() * self.scale.raw_per_effort)
    }

    /// How a [`TotalAngle`] of this motor counts: rotor encoder counts.
    #[must_use]
    pub const fn counts_per_turn(&self) -> CountsPerTurn {
        self.scale.counts_per_turn
    }

    /// Counts of the rotor as counts of the output, and back.
    #[inline]
    const fn signed(&self, counts: i64) -> i64 {
        if self.scale.sign < 0 { counts.saturating_neg() } else { counts }
    }

    /// The speed loop never asks for more than the motor's limit.
    fn apply_limit(&mut self) {
        self.cascade.speed.output_limit = self.loop_limit.min(self.limit);
    }

    fn goal_of(&self, target: Target) -> Result<Goal, TargetError> {
        self.supports().accepts(&target)?;
        Ok(match target {
            Target::Current(amps) => Goal::Effort(amps.get()),
            Target::Duty(duty) => Goal::Effort(duty),
            Target::Speed(rpm) => Goal::Speed(rpm.get()),
            Target::Angle(degrees) => Goal::Angle(self.phase_of(degrees)),
            Target::TotalAngle(angle) => {
                let counts = angle.counts_at(self.counts_per_turn());
                Goal::Total(self.signed(counts))
            }
            // What is not supported was refused above.
            _ => Goal::Rest,
        })
    }

    /// The output's phase at an angle of any number of degrees.
    fn phase_of(&self, degrees: Degrees) -> i32 {
        let degrees = degrees.get() % 360.0;
        let degrees = if degrees < 0.0 { degrees + 360.0 } else { degrees };
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
        let phase = round_to_i32(degrees * (self.scale.phase_turn as f32 / 360.0));
        // The last steps before a full turn may round up to it.
        if phase < self.scale.phase_turn { phase } else { 0 }
    }

    /// What is wrong with a frame.
    #[cold]
    #[inline(never)]
    fn reject(&self, frame: &CanFrame) -> Result<FrameKind, FrameError> {
        Err(if frame.key() != self.feedback_key {
            FrameError::NotMine
        } else if frame.all_eight().is_some() {
            FrameError::Encoder
        } else {
            FrameError::Length
        })
    }

    /// Whether a rotor that has this speed after a silence (µs) cannot have gone round in it.
    #[inline]
    fn is_certain(&self, rpm: i16, silence: u64) -> bool {
        let last_rpm = RawFeedback::unpack(&self.seen.bytes).rpm;
        let fastest = u64::from(rpm.unsigned_abs().max(last_rpm.unsigned_abs()));
        silence <= LONG_SILENCE.get() && fastest * silence <= CERTAIN_RPM_MICROS
    }

    /// The first frame, which sets the absolute angle of the rotor; or one after a silence in which
    /// the rotor may have gone round: the speed says which number of turns is likeliest.
    #[cold]
    #[inline(never)]
    fn feedback_after_silence(
        &mut self,
        frame: &CanFrame,
        at: Micros,
    ) -> Result<FrameKind, FrameError> {
        let Some(bytes) = frame.all_eight() else { return self.reject(frame) };
        let RawFeedback { angle, rpm, .. } = RawFeedback::unpack(bytes);
        let (scale, last) = (self.scale, self.seen);
        let angle = i32::from(angle);
        let last_rpm = RawFeedback::unpack(&last.bytes).rpm;
        let silence = at.since(last.at);
        let step = shortest_way_in_bits::<ENCODER_BITS>(last.angle, angle);
        let moved = if self.heard {
            self.turn_gaps = self.turn_gaps.saturating_add(1);
            let mean_rpm = (i64::from(rpm) + i64::from(last_rpm)) / 2;
            let micros = i64::try_from(silence.get()).unwrap_or(i64::MAX);
            let expected = mean_rpm.saturating_mul(micros).saturating_mul(8192) / 60_000_000;
            nearest_movement(step.into(), expected, ENCODER_COUNTS.into())
        } else {
            angle.into()
        };
        let turn = i64::from(scale.phase_turn);
        let steps = (moved % turn) * i64::from(scale.phase_per_count);
        #[expect(clippy::cast_possible_truncation, reason = "below the turn, an i32")]
        let phase = (i64::from(last.phase) + steps).rem_euclid(turn) as i32;
        if !self.heard {
            self.heard = true;
            self.goal = self.goal_of(self.target).unwrap_or(Goal::Rest);
        }
        self.seen = Seen {
            at,
            bytes: *bytes,
            angle,
            speed: f32::from(rpm) * scale.output_per_rotor,
            total: last.total.saturating_add(moved),
            phase,
        };
        Ok(FrameKind::Feedback)
    }

    /// Where the motor can come to a stand: holding the angle at which it still turns would throw
    /// it back there.
    fn standstill(&self) -> i64 {
        let Seen { speed, total, .. } = self.seen;
        // s = v² / 2 a, in degrees and rpm: 1 rpm = 6 degrees a second.
        let degrees = 3.0 * speed * speed.abs() / self.cascade.acceleration.get();
        let counts = round_to_i32(degrees / self.scale.degrees_per_count);
        total.saturating_add(counts.into())
    }

    /// One step towards the goal.
    #[inline(always)]
    fn pursue(&mut self, dt: Seconds) {
        let Self { state, cascade, limit, seen, goal, .. } = self;
        match *goal {
            Goal::Speed(rpm) => state.seek_speed(cascade, rpm, seen.speed, *limit, dt),
            Goal::Angle(_) | Goal::Total(_) => {
                if !state.keep_seeking_angle(cascade, seen.speed, dt) {
                    self.pursue_angle(dt);
                }
            }
            Goal::Rest => state.rest(),
            Goal::Effort(effort) => state.give(effort, *limit, dt),
        }
    }

    /// One step towards the goal, which is an angle, with the angle loop.
    #[inline(never)]
    fn pursue_angle(&mut self, dt: Seconds) {
        let Self { state, cascade, scale, limit, seen, goal, .. } = self;
        state.seek_angle(cascade, scale.degrees_to(goal, seen), seen.speed, *limit, dt);
    }

    /// One step while the target may not be followed.
    #[cold]
    #[inline(never)]
    fn stop(&mut self, drive: DriveMode, dt: Seconds) {
        let ran = core::mem::take(&mut self.ran);
        if drive == DriveMode::Hold && self.held.is_none() && !ran && self.heard {
            // It was at rest and is for one tick more: to find out where takes long enough.
            self.held = Some(self.standstill());
            return self.state.rest();
        }
        if ran && matches!(drive, DriveMode::Brake | DriveMode::Hold) {
            self.state.start_over(drive == DriveMode::Hold);
        }
        let held = match (drive, self.held) {
            (DriveMode::Hold, None) if self.heard => Some(self.standstill()),
            (DriveMode::Hold, held) => held,
            _ => None,
        };
        self.held = held;
        let goal = match (drive, held) {
            (DriveMode::Hold, Some(counts)) => Goal::Total(counts),
            (DriveMode::Brake, _) if self.heard => Goal::Speed(0.0),
            _ => Goal::Rest,
        };
        // The target's own goal waits until it may be followed again.
        let waiting = core::mem::replace(&mut self.goal, goal);
        self.pursue(dt);
        self.goal = waiting;
    }
}

/// Out of line: it happens once in a turn of the output.
#[cold]
const fn wrapped(phase: i32, turn: i32) -> i32 {
    phase.rem_euclid(turn)
}

impl Scale {
    #[expect(clippy::cast_possible_wrap, reason = "8192 times at most 65,535 is below 2^31")]
    #[expect(clippy::cast_precision_loss, reason = "factors")]
    fn of(model: &Model, gear: Gear, direction: Direction) -> Self {
        let sign = i32::from(direction.sign());
        let phase_turn = (ENCODER_COUNTS * gear.rotor_turns()) as i32;
        let phase_per_count = sign * gear.output_turns() as i32;
        Self {
            sign,
            output_per_rotor: sign as f32 / gear.ratio(),
            raw_per_effort: sign as f32 * f32::from(model.full_scale) / model.effort.full(),
            amps_per_count: sign as f32 * model.amps_per_count,
            torque_per_amp: model.rotor_torque_constant * gear.ratio(),
            degrees_per_count: 360.0 * phase_per_count as f32 / phase_turn as f32,
            degrees_per_phase: 360.0 / phase_turn as f32,
            phase_turn,
            phase_per_count,
            counts_per_turn: CountsPerTurn::new(
                ENCODER_COUNTS * gear.rotor_turns(),
                gear.output_turns(),
            ),
        }
    }
}

impl Scale {
    /// The way from where the motor is to a goal that is an angle, in degrees.
    fn degrees_to(&self, goal: &Goal, seen: &Seen) -> f32 {
        let (way, degrees_per_step) = match *goal {
            Goal::Angle(phase) => {
                (shortest_way(seen.phase, phase, self.phase_turn), self.degrees_per_phase)
            }
            Goal::Total(counts) => {
                let way = counts.saturating_sub(seen.total);
                // Thousands of turns away, some more or less do not matter.
                let most = if way < 0 { i32::MIN } else { i32::MAX };
                (i32::try_from(way).unwrap_or(most), self.degrees_per_count)
            }
            Goal::Rest | Goal::Effort(_) | Goal::Speed(_) => (0, 0.0),
        };
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of the way to go")]
        return way as f32 * degrees_per_step;
    }
}

impl Motor for Dji {
    fn loops(&self) -> Option<Loops> {
        let effort = match self.model.effort {
            Effort::Current(_) => TargetKind::Current,
            Effort::Voltage => TargetKind::Duty,
        };
        Some(Loops { effort, cascade: self.cascade })
    }

    fn supports(&self) -> TargetSet {
        use TargetKind::{Angle, Coast, Current, Duty, Speed, TotalAngle};
        match self.model.effort {
            Effort::Current(_) => TargetSet::of(&[Coast, Current, Speed, Angle, TotalAngle]),
            Effort::Voltage => TargetSet::of(&[Coast, Duty, Speed, Angle, TotalAngle]),
        }
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        // The usual case is the same target again; converting an angle is not free. But coasting is
        // also what a target becomes whose number lies elsewhere since a new zero.
        if target != self.target || target == Target::Coast {
            let goal = self.goal_of(target)?;
            self.target = target;
            // Until it is heard there is nothing to compute with.
            if self.heard {
                self.goal = goal;
            }
        }
        Ok(())
    }

    fn target(&self) -> Target {
        self.target
    }

    fn feedback(&self) -> Feedback {
        if !self.heard {
            return Feedback::NEW;
        }
        let seen = &self.seen;
        let raw = RawFeedback::unpack(&seen.bytes);
        let amps = f32::from(raw.current) * self.scale.amps_per_count;
        let torque = amps * self.scale.torque_per_amp;
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
        let angle = seen.phase as f32 * self.scale.degrees_per_phase;
        let mut told = Feedback::new(
            seen.at,
            Rpm::new(seen.speed),
            // The last steps before a full turn may round up to it.
            Degrees::new(if angle < 360.0 { angle } else { 0.0 }),
            TotalAngle::new(self.signed(seen.total), self.counts_per_turn()),
        );
        told.turn_gaps = self.turn_gaps;
        let told = told.with_current(Amps::new(amps)).with_torque(NewtonMetres::new(torque));
        if self.model.has_temperature {
            told.with_temperature(Celsius::new(f32::from(raw.temperature)))
        } else {
            told
        }
    }

    /// None of these controllers has a documented error code.
    fn fault(&self) -> Option<Fault> {
        None
    }

    fn update(&mut self, dt: Seconds, drive: DriveMode) {
        if drive == DriveMode::Run {
            (self.held, self.ran) = (None, true);
            self.pursue(dt);
        } else {
            self.stop(drive, dt);
        }
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        let set = |pid: PidConfig, gains: Gains| {
            // Its limits stand already; one of them may be a current limit of zero.
            PidConfig::new(gains.kp, gains.ki, gains.kd, 1.0).validate()?;
            Ok::<_, RequestError>(PidConfig { kp: gains.kp, ki: gains.ki, kd: gains.kd, ..pid })
        };
        match request {
            Request::SetZero => {
                if !self.heard {
                    return Err(RequestError::NoFeedback);
                }
                let old = core::mem::take(&mut self.seen.total);
                self.seen.phase = 0;
                // What is held or sought stays where it is; the same number commanded again lies
                // elsewhere now.
                self.held = self.held.map(|held| held.saturating_sub(old));
                if let Goal::Total(counts) = self.goal {
                    self.goal = Goal::Total(counts.saturating_sub(old));
                    self.target = Target::Coast;
                }
            }
            Request::SpeedGains(gains) => self.cascade.speed = set(self.cascade.speed, gains)?,
            Request::AngleGains(gains) => self.cascade.angle = set(self.cascade.angle, gains)?,
            Request::CurrentLimit(limit) => {
                let Effort::Current(full) = self.model.effort else {
                    return Err(RequestError::Unsupported);
                };
                let limit = limit.get();
                if limit.is_nan() || limit < 0.0 {
                    let must_be = "zero or more";
                    return Err(ConfigError::new("current limit", limit, must_be).into());
                }
                self.limit = limit.min(full);
                self.apply_limit();
            }
            _ => return Err(RequestError::Unsupported),
        }
        if matches!(request, Request::SpeedGains(_) | Request::AngleGains(_)) {
            let way = self.scale.degrees_to(&self.goal, &self.seen);
            self.state.change_gains(&self.cascade, self.seen.speed, way);
        }
        Ok(Response::Done)
    }
}

impl CanMotor for Dji {
    fn wiring(&self) -> CanIds {
        let exact = |raw: u16| IdPattern::exact(StandardId::new(raw).unwrap_or(StandardId::ZERO));
        let feedback = RxFrames {
            pattern: exact(self.model.feedback_base + u16::from(self.id)),
            len: 8,
            rate: Rate::Hz(self.rate.hz()),
            guard: None,
        };
        let command = TxFrames {
            pattern: IdPattern::exact(Id::Standard(self.command_id)),
            len: 8,
            rate: Rate::EveryTick,
            share: Ownership::Lane(0b11 << self.lane),
        };
        let wiring = CanIds::new(self.model.name, self.id.into());
        let wired = wiring.clone().receives(feedback).and_then(|wiring| wiring.transmits(command));
        wired.unwrap_or(wiring)
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError> {
        let Some(bytes) = frame.all_eight() else { return self.reject(frame) };
        let RawFeedback { angle, rpm, .. } = RawFeedback::unpack(bytes);
        let angle = i32::from(angle);
        if frame.key() != self.feedback_key || angle >= 1 << ENCODER_BITS {
            return self.reject(frame);
        }
        // Also for the first frame of all.
        let silence = at.get().wrapping_sub(self.seen.at.get());
        if silence >= CERTAIN_MICROS && !self.is_certain(rpm, silence) {
            return self.feedback_after_silence(frame, at);
        }
        let Self { seen, scale, .. } = self;
        let moved = shortest_way_in_bits::<ENCODER_BITS>(seen.angle, angle);
        seen.total += i64::from(moved);
        let phase = seen.phase + moved * scale.phase_per_count;
        // Below zero is far above the turn, too.
        seen.phase = if phase.cast_unsigned() < scale.phase_turn.cast_unsigned() {
            phase
        } else {
            wrapped(phase, scale.phase_turn)
        };
        seen.at = at;
        seen.angle = angle;
        seen.speed = f32::from(rpm) * scale.output_per_rotor;
        seen.bytes = *bytes;
        Ok(FrameKind::Feedback)
    }

    #[inline]
    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        // The lane is one of 0, 2, 4, 6; said in a way that the compiler understands too.
        tx.lane(self.command_id, self.lane & 6, self.raw_command().to_be_bytes())
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.lane(self.command_id, self.lane, [0, 0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rc10_app::maths::round_to_i16;

    const MS: Seconds = Seconds::new(0.001);

    fn frame(id: u16, data: [u8; 8]) -> CanFrame {
        CanFrame::eight_bytes(StandardId::new(id).unwrap(), data)
    }

    /// Feedback of rotor `angle` and `rpm` of the motor with feedback identifier `id`.
    fn feedback(id: u16, angle: u16, rpm: i16) -> CanFrame {
        let ([a, b], [c, d]) = (angle.to_be_bytes(), rpm.to_be_bytes());
        frame(id, [a, b, c, d, 0, 0, 0, 0])
    }

    #[test]
    fn feedback_of_a_c620() {
        let mut wheel = Dji::new(&M3508, 1).unwrap();
        let bytes = [0x10, 0x00, 0x01, 0xF4, 0x40, 0x00, 35, 0];
        let heard = wheel.unpack_feedback(&frame(0x201, bytes), Micros::new(7));
        assert_eq!(heard, Ok(FrameKind::Feedback));
        let seen = wheel.feedback();
        assert_eq!((seen.at, seen.current()), (Micros::new(7), Some(Amps::new(20.0))));
        assert_eq!(seen.temperature(), Some(Celsius::new(35.0)));
        assert!((seen.speed.get() - 26.037_315).abs() < 1e-4);
        // Half a rotor turn is 9.37 degrees of the output.
        assert!((seen.total_angle.degrees().get() - 180.0 / 19.203_21).abs() < 1e-3);
        assert!((seen.torque().unwrap().get() - 6.0).abs() < 0.01);
    }

    #[test]
    fn a_c610_has_no_temperature_and_a_gm6020_an_absolute_angle() {
        let mut feeder = Dji::new(&M2006, 3).unwrap();
        feeder.unpack_feedback(&frame(0x203, [0, 0, 0, 0, 0, 0, 99, 0]), Micros::ZERO).unwrap();
        assert_eq!(feeder.feedback().temperature(), None);
        let mut yaw = Dji::new(&GM6020_VOLTAGE, 1).unwrap();
        yaw.unpack_feedback(&feedback(0x205, 2048, 0), Micros::ZERO).unwrap();
        assert!((yaw.feedback().angle.get() - 90.0).abs() < 1e-4);
        let mut mirrored =
            Dji::new(&GM6020_VOLTAGE, 1).unwrap().with_direction(Direction::Reversed);
        mirrored.unpack_feedback(&feedback(0x205, 2048, 5), Micros::ZERO).unwrap();
        let seen = mirrored.feedback();
        assert!((seen.angle.get() - 270.0).abs() < 1e-4);
        assert!((seen.total_angle.degrees().get() + 90.0).abs() < 1e-4);
        assert!((seen.speed.get() + 5.0).abs() < 1e-4);
    }

    #[test]
    fn frames_that_are_no_feedback_change_nothing() {
        let mut wheel = Dji::new(&M3508, 1).unwrap();
        wheel.unpack_feedback(&feedback(0x201, 100, 5), Micros::ZERO).unwrap();
        let before = wheel.feedback();
        let id = StandardId::new(0x201).unwrap();
        let short = CanFrame::data_frame(id, &[0; 7]).unwrap();
        let remote = CanFrame::remote_frame(id, 8).unwrap();
        for (frame, error) in [
            (feedback(0x202, 0, 0), FrameError::NotMine),
            (remote, FrameError::NotMine),
            (short, FrameError::Length),
            (feedback(0x201, 8192, 0), FrameError::Encoder),
        ] {
            assert_eq!(wheel.unpack_feedback(&frame, Micros::new(5)), Err(error), "{frame}");
            assert_eq!(wheel.feedback(), before);
        }
    }

    #[test]
    fn the_output_angle_stays_exact_through_the_gear() {
        let mut wheel = Dji::new(&M3508, 1).unwrap();
        let mut at = Micros::ZERO;
        // 3591 rotor turns are 187 of the output: it is back where it was.
        for quarter in 0..=3591 * 4_u32 {
            let angle = u16::try_from(quarter % 4 * 2048).unwrap();
            at += Micros::from_millis(1);
            wheel.unpack_feedback(&feedback(0x201, angle, 15_000), at).unwrap();
        }
        let seen = wheel.feedback();
        assert_eq!(seen.total_angle, TotalAngle::from_degrees(360 * 187));
        assert!(seen.angle.get() < 1e-4);
        assert_eq!(seen.turn_gaps, 0);
    }

    #[test]
    fn turns_in_a_gap_are_estimated_from_the_speed_and_counted() {
        let mut wheel = Dji::new(&M2006, 1).unwrap();
        wheel.unpack_feedback(&feedback(0x201, 0, 6000), Micros::ZERO).unwrap();
        // 6000 rpm for 50 ms are five turns.
        wheel.unpack_feedback(&feedback(0x201, 100, 6000), Micros::from_millis(50)).unwrap();
        let seen = wheel.feedback();
        assert_eq!((seen.total_angle.counts(), seen.turn_gaps), (5 * 8192 + 100, 1));
        // At rest a late frame is nothing special.
        wheel.unpack_feedback(&feedback(0x201, 100, 0), Micros::from_millis(51)).unwrap();
        wheel.unpack_feedback(&feedback(0x201, 90, 0), Micros::from_millis(90)).unwrap();
        assert_eq!(wheel.feedback().turn_gaps, 1);
    }

    #[test]
    fn a_current_target_leaves_in_the_right_lane_with_the_right_sign() {
        for (id, direction, command, lane, sign) in [
            (1, Direction::Forward, 0x200, 0, 1),
            (4, Direction::Reversed, 0x200, 6, -1),
            (6, Direction::Forward, 0x1FF, 2, 1),
        ] {
            let mut wheel = Dji::new(&M3508, id).unwrap().with_direction(direction);
            wheel.set_target(Target::Current(Amps::new(5.0))).unwrap();
            wheel.unpack_feedback(&feedback(0x200 + u16::from(id), 0, 0), Micros::ZERO).unwrap();
            for _ in 0..30 {
                wheel.update(MS, DriveMode::Run);
            }
            let mut tx = TxBatch::new();
            wheel.pack_command(&mut tx).unwrap();
            let sent = tx.frames()[0];
            assert_eq!(sent.raw_id(), command);
            let mut expected = [0; 8];
            expected[lane..lane + 2].copy_from_slice(&(4096_i16 * sign).to_be_bytes());
            assert_eq!(sent.bytes(), expected);
            tx.clear();
            wheel.coast_frames(&mut tx).unwrap();
            assert_eq!(tx.frames()[0].bytes(), [0; 8]);
        }
    }

    #[test]
    fn nothing_is_driven_before_the_first_feedback() {
        let mut wheel = Dji::new(&M3508, 1).unwrap();
        wheel.set_target(Target::Speed(Rpm::new(300.0))).unwrap();
        for drive in
            [DriveMode::Run, DriveMode::Hold, DriveMode::Brake, DriveMode::Coast, DriveMode::Off]
        {
            wheel.update(MS, drive);
            assert_eq!(wheel.raw_command(), 0, "{drive:?}");
        }
    }

    #[test]
    fn a_motor_in_voltage_mode_takes_duty_and_no_current() {
        let mut pitch = Dji::new(&GM6020_VOLTAGE, 2).unwrap();
        let refused = pitch.set_target(Target::Current(Amps::new(1.0)));
        assert_eq!(refused, Err(TargetError::Unsupported(TargetKind::Current)));
        pitch.set_target(Target::Duty(2.0)).unwrap();
        pitch.unpack_feedback(&feedback(0x206, 0, 0), Micros::ZERO).unwrap();
        for _ in 0..30 {
            pitch.update(MS, DriveMode::Run);
        }
        assert_eq!(pitch.raw_command(), 25000);
    }

    #[test]
    fn requests_take_effect_or_say_why_not() {
        let mut lift = Dji::new(&M3508, 1).unwrap();
        assert_eq!(lift.request(Request::SetZero), Err(RequestError::NoFeedback));
        assert_eq!(lift.request(Request::ClearFault), Err(RequestError::Unsupported));
        lift.unpack_feedback(&feedback(0x201, 5000, 0), Micros::ZERO).unwrap();
        lift.request(Request::SetZero).unwrap();
        assert_eq!(lift.feedback().total_angle, TotalAngle::ZERO);
        let bad = Gains { kp: f32::NAN, ..Gains::default() };
        assert!(matches!(lift.request(Request::SpeedGains(bad)), Err(RequestError::Config(_))));
        lift.request(Request::CurrentLimit(Amps::new(2.0))).unwrap();
        lift.set_target(Target::Current(Amps::new(20.0))).unwrap();
        for _ in 0..30 {
            lift.update(MS, DriveMode::Run);
        }
        assert_eq!(lift.raw_command(), round_to_i16(2.0 * 16384.0 / 20.0));
        let negative = lift.request(Request::CurrentLimit(Amps::new(-1.0)));
        assert!(matches!(negative, Err(RequestError::Config(_))));
    }

    #[test]
    fn told_to_coast_after_a_new_zero_it_coasts() {
        let mut lift = Dji::new(&M3508, 1).unwrap();
        lift.unpack_feedback(&feedback(0x201, 5000, 0), Micros::ZERO).unwrap();
        lift.set_target(Target::TotalAngle(TotalAngle::from_degrees(90))).unwrap();
        lift.update(MS, DriveMode::Run);
        lift.request(Request::SetZero).unwrap();
        lift.set_target(Target::Coast).unwrap();
        for _ in 0..30 {
            lift.update(MS, DriveMode::Run);
        }
        assert_eq!(lift.raw_command(), 0);
    }

    #[test]
    fn all_shipped_gains_can_be_used() {
        for model in [&M3508, &M2006, &GM6020_CURRENT, &GM6020_VOLTAGE] {
            model.cascade.validate().unwrap();
            let motor = Dji::new(model, 1).unwrap();
            motor.clone().with_gear(Gear::DIRECT).cascade.validate().unwrap();
            assert!(model.cascade.speed.output_limit <= model.effort.full());
        }
    }
}
