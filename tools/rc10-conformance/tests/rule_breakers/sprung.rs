//! A motor that obeys impedances, but for one thing.

use rc10_app::{
    Cascade, Degrees, FeedForward, NewtonMetres, PidConfig, Rpm, RpmPerSecond, TotalAngle,
};
use rc10_can::{CanFrame, Micros};
use rc10_conformance::{Declaration, Report, Trial, check};
use rc10_motor::damiao::{Config, Control, Damiao, models};
use rc10_motor::{
    CanIds, CanMotor, Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Impedance,
    Link, Motor, MotorName, Request, RequestError, Response, Target, TargetError, TargetSet, Tick,
    TxBatch, TxFull,
};
use rc10_sim::damiao::{Damiao as Device, DamiaoConfig, Mode};

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

/// N m.
const FULL: f32 = 7.0;

fn declared() -> Declaration {
    let spring = Impedance { angle: Degrees::new(90.0), kp: 8.0, kd: 0.8, ..Impedance::default() };
    let declared = Declaration::new([0x11, 0x12], Rpm::new(60.0), NewtonMetres::new(FULL));
    Declaration { enables_within: 60, ..declared }.with_trials(&[
        Trial::new(Target::Torque(NewtonMetres::new(3.5)), 0.1, 100),
        Trial::new(Target::Impedance(spring), 3.0, 3000),
        Trial::new(Target::Speed(Rpm::new(100.0)), 2.0, 1500),
        Trial::new(Target::Angle(Degrees::new(90.0)), 1.0, 5000),
        Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-360)), 1.0, 12_000),
    ])
}

pub fn check_sprung(slip: Slip) -> Result<(), Report> {
    let cascade = Cascade {
        speed: PidConfig::new(0.063, 0.5, 0.0, FULL),
        angle: PidConfig::new(1.3, 0.0, 0.0, 150.0),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    };
    let ids = |id: u8| (u16::from(id), u16::from(id) + 0x20);
    check(
        &declared(),
        |id| {
            let (can_id, master_id) = ids(id);
            let control = Control::Mit(cascade);
            let good = Damiao::new(Config::new(models::J4310, can_id, master_id, control)).unwrap();
            Sprung { good, slip, asked: None, driven: 0 }
        },
        |wire, id| {
            let (can_id, master_id) = ids(id);
            let config = DamiaoConfig { mode: Mode::Mit, ..DamiaoConfig::j4310(can_id, master_id) };
            wire.add(Device::new(&config), config.plant.with_load_inertia(0.02))
        },
    )
}
