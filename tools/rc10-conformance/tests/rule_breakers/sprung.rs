//! A motor that obeys impedances, but for one thing.

use rc10_can::CanFrame;
use rc10_conformance::{Report, check};
use rc10_motor::damiao::Damiao;
use rc10_motor::rc10_app::Direction;
use rc10_motor::{
    CanIds, CanMotor, Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Impedance,
    Link, Motor, MotorName, Request, RequestError, Response, Target, TargetError, TargetSet, Tick,
    TxBatch, TxFull,
};
use rc10_time::Micros;

use crate::conformance::damiao;

/// Defects of its impedances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slip {
    /// Revolutions are taken for radians.
    SpeedInTurns,
    /// The full torque comes after 60 ms.
    StartsSlowly,
    /// While it starts, the spring alone is weaker.
    MovesEquilibrium,
}

impl Slip {
    /// The rule that each breaks.
    pub const ALL: [(&str, Self); 3] = [
        ("impedance-law", Self::SpeedInTurns),
        ("soft-impedance", Self::StartsSlowly),
        ("soft-impedance", Self::MovesEquilibrium),
    ];
}

struct Sprung {
    good: Damiao,
    slip: Slip,
    asked: Option<Impedance>,
    driven: u32,
}

/// Length of a start that is too slow, ms.
const SOFT_TIME: u32 = 60;

impl Sprung {
    /// The impedance that it takes for the one that is asked for.
    fn slipped(&self, asked: Impedance) -> Impedance {
        let Impedance { speed, torque, kp, .. } = asked;
        let starts = self.driven < SOFT_TIME;
        match self.slip {
            Slip::SpeedInTurns => Impedance { speed: speed * core::f32::consts::TAU, ..asked },
            Slip::StartsSlowly if starts && kp == 0.0 => {
                Impedance { torque: torque * 0.5, ..asked }
            }
            Slip::MovesEquilibrium if starts => Impedance { kp: kp * 0.5, ..asked },
            _ => asked,
        }
    }
}

impl Motor for Sprung {
    fn name(&self) -> MotorName {
        self.good.name()
    }

    fn supports(&self) -> TargetSet {
        self.good.supports()
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        self.good.set_target(target)?;
        self.asked = match target {
            Target::Impedance(asked) => Some(asked),
            _ => None,
        };
        Ok(())
    }

    fn target(&self) -> Target {
        self.good.target()
    }

    fn feedback(&self) -> Feedback {
        self.good.feedback()
    }

    fn fault(&self) -> Option<Fault> {
        self.good.fault()
    }

    fn update(&mut self, tick: &Tick) {
        let runs = tick.mode == DriveMode::Run && self.asked.is_some();
        self.driven = if runs { self.driven.saturating_add(1) } else { 0 };
        let wrong = self.asked.filter(|_| runs).map(|asked| (asked, self.slipped(asked)));
        match wrong {
            Some((asked, slipped)) if asked != slipped => {
                let _ = self.good.set_target(Target::Impedance(slipped));
                self.good.update(tick);
                let _ = self.good.set_target(Target::Impedance(asked));
            }
            _ => self.good.update(tick),
        }
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        if request == Request::SetZero {
            self.asked = None;
        }
        self.good.request(request)
    }

    fn response(&mut self) -> Option<Result<Response, RequestError>> {
        self.good.response()
    }

    fn condition(&self) -> Condition {
        self.good.condition()
    }
}

impl CanMotor for Sprung {
    fn can_ids(&self) -> CanIds {
        self.good.can_ids()
    }

    fn unpack_feedback(
        &mut self,
        frame: &CanFrame,
        at: Micros,
        link: Link,
    ) -> Result<FrameKind, FrameError> {
        self.good.unpack_feedback(frame, at, link)
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.good.pack_command(tx)
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.good.coast_frames(tx)
    }
}

pub fn check_sprung(slip: Slip) -> Result<(), Report> {
    let (control, declared) = damiao::mit();
    check(
        &declared,
        |id| {
            let good = damiao::motor(id, control, Direction::Forward);
            Sprung { good, slip, asked: None, driven: 0 }
        },
        |wire, id| damiao::device(wire, id, &control),
    )
}
