//! Motors that break one rule each.

use std::cell::{Cell, RefCell};

use rc10_app::{Degrees, Rpm, TotalAngle};
use rc10_can::embedded_can::{ExtendedId, StandardId};
use rc10_can::{CanFrame, IdPattern};
use rc10_motor::{
    CanIds, CanMotor, Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Frames, Guard,
    Link, Motion, Motor, MotorName, Ownership, Rate, Request, RequestError, Response, Target,
    TargetError, TargetKind, TargetSet, Tick, TxBatch, TxFull,
};
use rc10_time::Micros;

use super::motor::{Command, Finch};
use super::spoil::Spoil;

thread_local! {
    static MADE: Cell<u32> = const { Cell::new(0) };
    /// Identifier and number of every motor that lives.
    static ALIVE: RefCell<Vec<(u16, u32)>> = const { RefCell::new(Vec::new()) };
}

/// A good motor, but for one thing.
pub struct Spoiled {
    good: Finch,
    spoil: Spoil,
    id: u16,
    number: u32,
    ticks: u32,
    /// The drive that the bus allows, and since how many ticks.
    drive: DriveMode,
    since: u32,
    /// The drive before.
    before: DriveMode,
    was_armed: bool,
    was_asked: bool,
    /// A target came since the last tick.
    commanded: bool,
    report: Option<[u8; 8]>,
    /// Ticks since the last report, and how many there were between the two before.
    silent_for: u32,
    silence: u32,
    /// Ticks for which it does something wrong yet.
    wrong_for: u32,
    /// Which way it turned when it last ran, 1 or -1.
    turned: f32,
    /// The time step was a long one.
    long_step: bool,
    response: Option<Result<Response, RequestError>>,
    /// The last target that it took.
    asked: Target,
    /// A torque limit was set.
    is_limited: bool,
    /// Error of a wrong count of turns.
    lost: TotalAngle,
}

impl Spoiled {
    pub fn new(good: Finch, spoil: Spoil) -> Self {
        let number = MADE.with(|made| made.replace(made.get() + 1));
        let id = good.name().id;
        ALIVE.with(|alive| alive.borrow_mut().push((id, number)));
        Self {
            good,
            spoil,
            id,
            number,
            ticks: 0,
            drive: DriveMode::Off,
            since: 0,
            before: DriveMode::Off,
            was_armed: false,
            was_asked: false,
            commanded: false,
            report: None,
            silent_for: 0,
            silence: 0,
            wrong_for: 0,
            turned: 1.0,
            long_step: false,
            response: None,
            asked: Target::Coast,
            is_limited: false,
            lost: TotalAngle::ZERO,
        }
    }

    fn is(&self, spoil: Spoil) -> bool {
        self.spoil == spoil
    }

    fn is_enabled(&self) -> bool {
        self.report.is_some_and(|bytes| bytes[6] == 1)
    }

    /// Whether it does what it must not do just now.
    fn drives_anyhow(&self) -> bool {
        match self.spoil {
            Spoil::DrivesUnheard => self.report.is_none() && self.drive == DriveMode::Run,
            Spoil::DrivesUnarmed | Spoil::EnablesUnarmed => {
                let told = self.good.target() != Target::Coast;
                !self.was_armed && !self.was_asked && told && self.report.is_some()
            }
            Spoil::DisarmsLate => {
                self.drive == DriveMode::Off && self.before == DriveMode::Run && self.since < 60
            }
            Spoil::ClearingDrives | Spoil::ZeroMoves | Spoil::ZeroThrows => self.wrong_for > 0,
            Spoil::ForgetsFaults | Spoil::EnablesFaulted => {
                self.fault().is_some() && self.wrong_for > 0
            }
            Spoil::StaysEnabled => self.drive == DriveMode::Off && self.before != DriveMode::Off,
            _ => false,
        }
    }

    /// The drive that it takes for the one of the bus.
    fn heeds(&self, drive: DriveMode) -> DriveMode {
        let (commanded, is_heard) = (self.commanded, self.silent_for < 5);
        let from_run = drive == DriveMode::Coast && self.before == DriveMode::Run;
        let fine = self.fault().is_none() && is_heard;
        match (self.spoil, drive) {
            (Spoil::IgnoresStop, _) if from_run && fine && commanded => DriveMode::Run,
            (Spoil::IgnoresExpiry, _) if from_run && fine && !commanded && self.since < 60 => {
                DriveMode::Run
            }
            (Spoil::IgnoresSilence, _) if from_run && !is_heard && self.since < 30 => {
                DriveMode::Run
            }
            (Spoil::GivesUpEarly, DriveMode::Run) if self.silent_for > 4 => DriveMode::Coast,
            (Spoil::HoldsBehind, DriveMode::Hold) => DriveMode::Run,
            (Spoil::CoastsForBraking, DriveMode::Brake)
            | (Spoil::CoastsForHolding, DriveMode::Hold)
            | (Spoil::NeverEnables, DriveMode::Run) => DriveMode::Coast,
            (
                Spoil::OneCutTooMany | Spoil::OneRestartTooMany | Spoil::NeverRecovers,
                DriveMode::Run,
            ) if self.wrong_for > 0 => DriveMode::Coast,
            _ => drive,
        }
    }

    fn command(&self, command: Command) -> CanFrame {
        CanFrame::exact(standard(0x300 + self.id), command.pack())
    }
}

impl Drop for Spoiled {
    fn drop(&mut self) {
        ALIVE.with(|alive| alive.borrow_mut().retain(|(_, number)| *number != self.number));
    }
}

fn standard(raw: u16) -> StandardId {
    StandardId::new(raw).unwrap()
}

/// A torque frame with another torque.
fn scaled(frame: CanFrame, factor: f32) -> CanFrame {
    match *frame.bytes() {
        [2, high, low] => {
            let torque = f32::from(i16::from_be_bytes([high, low])) * 1e-3;
            CanFrame::exact(frame.id(), Command::Torque(torque * factor).pack())
        }
        _ => frame,
    }
}

/// A report with the bytes of its speed exchanged.
fn speed_swapped(frame: CanFrame) -> CanFrame {
    match frame.all_eight() {
        Some(&[a, b, high, low, e, f, g, h]) if !frame.is_extended_id() => {
            CanFrame::eight_bytes(frame.id(), [a, b, low, high, e, f, g, h])
        }
        _ => frame,
    }
}

impl Motor for Spoiled {
    fn name(&self) -> MotorName {
        let is_other = self.is(Spoil::OtherName) && self.report.is_some();
        MotorName { model: if is_other { "Falcon" } else { "Finch F10" }, id: self.id }
    }

    fn supports(&self) -> TargetSet {
        use TargetKind::{Angle, Coast, Duty, Speed, Torque, TotalAngle};
        if self.is(Spoil::TakesMore) && self.report.is_some() {
            TargetSet::of(&[Coast, Torque, Speed, Angle, TotalAngle, Duty])
        } else {
            self.good.supports()
        }
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        self.commanded = true;
        if self.is(Spoil::TakesInfinity) && !target.is_finite() {
            return Ok(());
        }
        let taken = match target {
            // Angles without a speed: a stair.
            Target::Motion(motion @ Motion { angle: Some(_), .. }) if self.is(Spoil::Stairs) => {
                Target::Motion(Motion { speed: Rpm::ZERO, ..motion })
            }
            target => target,
        };
        self.good.set_target(taken)?;
        self.asked = target;
        Ok(())
    }

    fn target(&self) -> Target {
        if self.is(Spoil::OldScale) { self.asked } else { self.good.target() }
    }

    fn feedback(&self) -> Feedback {
        let mut told = self.good.feedback();
        if self.is(Spoil::AngleBeyondTurn) {
            told.angle = Degrees::new(told.angle.get() + 360.0);
        }
        if self.is(Spoil::TooFast) {
            told.speed = Rpm::new(told.speed.get() * 1.07);
        }
        if self.is(Spoil::AMicrosecondLate) {
            told.at += Micros::new(1);
        }
        told.total_angle = told.total_angle.plus(self.lost);
        if self.is(Spoil::NotANumber) && self.report.is_some_and(|bytes| bytes[7] > 99) {
            told.speed = Rpm::new(f32::NAN);
        }
        told
    }

    fn fault(&self) -> Option<Fault> {
        let fault = self.good.fault()?;
        Some(if self.is(Spoil::FaultWithoutWords) { Fault::new(fault.code, "") } else { fault })
    }

    fn update(&mut self, tick: &Tick) {
        let drive = tick.mode;
        self.ticks += 1;
        self.wrong_for = self.wrong_for.saturating_sub(1);
        // It remembers what it was told before the new zero.
        if self.is(Spoil::OldNumber) && self.wrong_for == 1 && drive == DriveMode::Run {
            let _ = self.good.set_target(self.asked);
        }
        if drive == self.drive {
            self.since += 1;
        } else {
            (self.before, self.drive, self.since) = (self.drive, drive, 0);
        }
        if drive == DriveMode::Run {
            self.turned = self.good.feedback().speed.get().signum();
        }
        self.was_armed |= drive != DriveMode::Off;
        self.long_step = tick.dt.get() > 0.005;
        if self.is(Spoil::HoldsBehind) && drive == DriveMode::Hold && self.since == 0 {
            let behind = TotalAngle::from_degrees(if self.turned > 0.0 { -20 } else { 20 });
            let behind = self.good.feedback().total_angle.plus(behind);
            let _ = self.good.set_target(Target::TotalAngle(behind));
        }
        self.good.update(&Tick { mode: self.heeds(drive), ..*tick });
        self.commanded = false;
        self.silent_for += 1;
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        self.was_asked = true;
        self.is_limited |= matches!(request, Request::TorqueLimit(_));
        let is_off = self.drive == DriveMode::Off;
        match (self.spoil, request) {
            (Spoil::NoZero, Request::SetZero) if is_off => return Ok(Response::Done),
            (Spoil::AnyLimit, Request::TorqueLimit(limit))
                if limit.get().is_nan() || limit.get() < 0.0 =>
            {
                return Ok(Response::Done);
            }
            (Spoil::StoresAnyTime, Request::StoreZero) => return Ok(Response::Done),
            (Spoil::ClearingDrives, Request::ClearFault) if self.fault().is_none() => {
                self.wrong_for = 300;
            }
            (Spoil::ZeroMoves, Request::SetZero) if is_off => self.wrong_for = 100,
            (Spoil::ZeroThrows, Request::SetZero) if self.drive == DriveMode::Hold => {
                self.wrong_for = 100;
            }
            (Spoil::OldNumber, Request::SetZero) if self.drive == DriveMode::Run => {
                self.wrong_for = 600;
            }
            _ => (),
        }
        self.good.request(request)
    }

    fn response(&mut self) -> Option<Result<Response, RequestError>> {
        let again = self.response.take();
        let response = self.good.response();
        if self.is(Spoil::AnswersTwice) {
            self.response = response;
        }
        if self.is(Spoil::NeverRecovers) && response == Some(Ok(Response::Done)) {
            self.wrong_for = 5000;
        }
        response.or(again)
    }

    fn condition(&self) -> Condition {
        if self.is(Spoil::AlwaysStarting) { Condition::Starting } else { self.good.condition() }
    }
}

impl CanMotor for Spoiled {
    fn can_ids(&self) -> CanIds {
        let good = self.good.can_ids();
        let (mut received, mut sent) = (good.received().to_vec(), good.transmitted().to_vec());
        match self.spoil {
            Spoil::NineBytes => {
                let pattern = IdPattern::exact(standard(0x700 + self.id));
                received.push(Frames::new(pattern, 9, Rate::Rare));
            }
            Spoil::OtherRate if self.report.is_some() => sent[0].rate = Rate::Hz(100),
            Spoil::IgnoresGuard => {
                received[0].ownership = Ownership::Guard(Guard { byte: 6, mask: 0xFE, value: 0 });
            }
            Spoil::RareCommands => sent[0].rate = Rate::Hz(100),
            Spoil::Unaware => {
                let mine = (self.id, self.number);
                let older = |(id, number): &(u16, u32)| *id == mine.0 && *number < mine.1;
                if ALIVE.with(|alive| alive.borrow().iter().any(older)) {
                    received[0].pattern = IdPattern::exact(standard(0x600 + self.id));
                    sent[0].pattern = IdPattern::exact(standard(0x680 + self.id));
                }
            }
            _ => (),
        }
        let ids = received.into_iter().fold(CanIds::new(), CanIds::receives);
        sent.into_iter().fold(ids, CanIds::transmits)
    }

    fn unpack_feedback(
        &mut self,
        frame: &CanFrame,
        at: Micros,
        link: Link,
    ) -> Result<FrameKind, FrameError> {
        let read = if self.is(Spoil::SwapsSpeed) { speed_swapped(*frame) } else { *frame };
        let heard = self.good.unpack_feedback(&read, at, link);
        let is_own = frame.key() == CanFrame::key_of(standard(0x380 + self.id));
        if heard.is_err() {
            let takes = match self.spoil {
                Spoil::TakesExtended => frame.is_extended_id(),
                Spoil::TakesSeven => is_own && frame.len() == 7,
                Spoil::IgnoresGuard => is_own && frame.all_eight().is_some(),
                Spoil::PanicsWithoutBytes => {
                    assert!(!is_own || !frame.bytes().is_empty(), "no byte 0");
                    false
                }
                _ => false,
            };
            return if takes { Ok(FrameKind::Other) } else { heard };
        }
        let was_enabled = self.is_enabled();
        (self.silence, self.silent_for) = (self.silent_for, 0);
        if self.is(Spoil::CountsNoTurns) && self.silence > 200 && self.drive != DriveMode::Off {
            self.lost = self.lost.plus(TotalAngle::from_degrees(-720));
        }
        self.report = frame.all_eight().copied();
        let wrong = match self.spoil {
            Spoil::OneCutTooMany | Spoil::KicksAfterCut => self.silence > 30 && self.is_enabled(),
            Spoil::OneRestartTooMany | Spoil::KicksAfterRestart => {
                let lost_it = was_enabled && !self.is_enabled();
                lost_it
                    && self.silence < 9
                    && self.drive == DriveMode::Run
                    && self.fault().is_none()
            }
            Spoil::ForgetsFaults | Spoil::EnablesFaulted => {
                self.silence > 50 && self.fault().is_some()
            }
            _ => false,
        };
        if wrong {
            self.wrong_for = match self.spoil {
                Spoil::KicksAfterCut | Spoil::KicksAfterRestart => 10,
                _ => 5000,
            };
        }
        if self.is(Spoil::FaultUnheard) { Ok(FrameKind::Feedback) } else { heard }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        let mut own = TxBatch::new();
        self.good.pack_command(&mut own)?;
        let mut frame = own.frames()[0];
        let mut stream = frame.key();
        match self.spoil {
            _ if self.drives_anyhow() => {
                let enable = !self.is_enabled() && self.ticks.is_multiple_of(2);
                let torque = match self.spoil {
                    Spoil::StaysEnabled | Spoil::EnablesUnarmed | Spoil::EnablesFaulted => 0.0,
                    _ => 0.5,
                };
                frame =
                    self.command(if enable { Command::Enable } else { Command::Torque(torque) });
            }
            Spoil::UndeclaredFrame if self.ticks.is_multiple_of(100) => {
                tx.push(CanFrame::exact(ExtendedId::new(0x7B0).unwrap(), [0]))?;
            }
            Spoil::ForeignStream => stream = 0x700 + u32::from(self.id),
            Spoil::ThreeFrames if self.ticks.is_multiple_of(100) => {
                tx.push(frame)?;
                tx.push(frame)?;
            }
            Spoil::TenthOfTorque => frame = scaled(frame, 0.1),
            Spoil::HalfTheTorque if matches!(self.good.target(), Target::Torque(_)) => {
                frame = scaled(frame, 0.5);
            }
            Spoil::IgnoresLimit if self.is_limited && self.drive == DriveMode::Run => {
                if let Target::Torque(torque) = self.good.target() {
                    frame = self.command(Command::Torque(torque.get()));
                }
            }
            Spoil::LeapsAfterPause if self.long_step && self.is_enabled() => {
                frame = self.command(Command::Torque(-5.0));
            }
            Spoil::KicksAfterCut | Spoil::KicksAfterRestart
                if self.wrong_for > 0 && self.is_enabled() && self.drive == DriveMode::Run =>
            {
                frame = self.command(Command::Torque(5.0));
            }
            Spoil::SecondIsOther if self.ticks == 5 => {
                frame = CanFrame::exact(frame.id(), [0, 0, self.number as u8]);
            }
            Spoil::SpeaksForAnother if self.id == 2 => {
                frame = CanFrame::data_frame(standard(0x301), frame.bytes()).unwrap();
                stream = frame.key();
            }
            _ => (),
        }
        tx.push_as(frame, stream)
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        let command = match self.spoil {
            Spoil::OtherCoastFrame if self.report.is_some() => Command::ClearError,
            Spoil::CoastFrameEnables => Command::Enable,
            _ => return self.good.coast_frames(tx),
        };
        tx.push(self.command(command))
    }
}
