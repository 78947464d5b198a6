use rc10_app::{NewtonMetres, Rpm, TotalAngle};
use rc10_motor::Target;
use rc10_motor::rc10_app::Direction;
use rc10_sim::{EscFault, EscState};

/// The abilities of a motor, as far as the rules have to know them. Its report rate and its link
/// timeout they read in its [identifiers](rc10_motor::CanIds).
#[derive(Clone, Debug)]
pub struct Declaration {
    /// Two identifiers that can be set on devices of one bus. The first is used when one will do.
    pub ids: [u8; 2],
    /// Which way the motor was made to turn. The targets, the far angle and the load below are
    /// those of a forward motor; for a reversed one the kit mirrors what it commands and what it
    /// reads, so that the shaft moves as a forward motor's.
    pub direction: Direction,
    /// A speed it reaches with ease, also against the `load`; positive.
    pub cruise: Rpm,
    /// For a motor that takes no speed: an angle that is positive and so far away that it turns
    /// towards it at `cruise` for four seconds, wherever in its first turn it starts; the same
    /// negative one must be in its range, too.
    pub far: Option<TotalAngle>,
    /// The largest torque at the output shaft.
    pub full_torque: NewtonMetres,
    /// A torque it can easily work against, well above its own friction.
    pub load: NewtonMetres,
    /// Largest torque that counts as zero: noise and rounding.
    pub no_torque: NewtonMetres,
    /// Longest time from the first tick in which it may run until it can be driven, ms.
    pub enables_within: u32,
    /// Longest time from the tick in which it has to stop until its winding is without torque, ms.
    pub stops_within: u32,
    /// Largest growth of its torque in a millisecond when it comes back, as a share of
    /// `full_torque`.
    pub softness: f64,
    /// How far a shaft that is held may give under the `load`, in degrees.
    pub hold_gives: f64,
    /// Targets to try, one at least for each kind that it takes. A torque or current of about half
    /// of what it can give shows best whether it starts softly.
    pub trials: Vec<Trial>,
    /// Whether its shaft turns freely when it is told to have no torque. Where it cannot, torque
    /// against the movement counts as none while its bridge shorts the winding.
    pub coasts_freely: Claim,
    /// Whether it can be disabled. Disarmed and after a fault its bridge must be open then, or short
    /// the winding if it does not coast freely.
    pub disables: Claim,
    /// Whether [`DriveMode::Brake`](rc10_motor::DriveMode::Brake) slows it down.
    pub brakes: Claim,
    /// Whether [`DriveMode::Hold`](rc10_motor::DriveMode::Hold) keeps its angle.
    pub holds: Claim,
    /// Faults that its device can have and its protocol cannot tell.
    pub untold_faults: Vec<(EscFault, &'static str)>,
}

/// Whether a motor has an ability that not every motor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Claim {
    /// The motor has it.
    Does,
    /// The motor has it not, for this reason.
    Cannot(&'static str),
}

/// A target, and when it counts as reached.
///
/// | target | reached when |
/// |---|---|
/// | `Coast` | the winding is without torque |
/// | `Speed` | the shaft turns at this speed ± `tolerance` rpm |
/// | `Angle`, `TotalAngle`, `Impedance` | the feedback says this angle ± `tolerance` degrees |
/// | `Current` | the winding carries this current ± `tolerance` A |
/// | `Torque` | the shaft gets this torque ± `tolerance` N m |
/// | `Duty` | the shaft turns that way, faster than `tolerance` rpm |
/// | `Brake`, `Handbrake` | after cruising, it turns slower than `tolerance` rpm |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// The target, commanded every millisecond.
    pub target: Target,
    /// Largest distance from the target, in the unit of the table above.
    pub tolerance: f64,
    /// Longest time from enabling until it is reached, for 10 ms on end; ms.
    pub within: u32,
}

impl Trial {
    /// A target, its tolerance, and the time it may take in ms.
    pub const fn new(target: Target, tolerance: f64, within: u32) -> Self {
        Self { target, tolerance, within }
    }
}

impl Declaration {
    /// A motor that is driven at once, stops within 10 ms, starts as softly as a
    /// [`Servo`](rc10_motor::servo::Servo) does, coasts freely, disables, brakes and holds, and works easily
    /// against a tenth of its full torque. 0.2 % of that counts as no torque.
    pub fn new(ids: [u8; 2], cruise: Rpm, full_torque: NewtonMetres) -> Self {
        Self {
            ids,
            direction: Direction::Forward,
            cruise,
            far: None,
            full_torque,
            load: full_torque * 0.1,
            no_torque: full_torque * 0.002,
            enables_within: 20,
            stops_within: 10,
            softness: 0.12,
            hold_gives: 10.0,
            trials: Vec::new(),
            coasts_freely: Claim::Does,
            disables: Claim::Does,
            brakes: Claim::Does,
            holds: Claim::Does,
            untold_faults: Vec::new(),
        }
    }

    /// The same with more targets to try.
    #[must_use]
    pub fn with_trials(mut self, trials: &[Trial]) -> Self {
        self.trials.extend_from_slice(trials);
        self
    }

    /// Whether torque against the movement is only the drag of a winding that is shorted, which the
    /// motor cannot avoid.
    pub(crate) fn drags(&self, state: &EscState) -> bool {
        self.coasts_freely != Claim::Does && state.shorted
    }

    /// The target that makes it turn.
    pub(crate) fn onward(&self) -> Target {
        self.far.map_or(Target::Speed(self.cruise), Target::TotalAngle)
    }

    /// The target that makes it turn the other way.
    pub(crate) fn backward(&self) -> Target {
        let speed = Target::Speed(Rpm::new(-self.cruise.get()));
        self.far.map_or(speed, |far| Target::TotalAngle(TotalAngle::ZERO.minus(far)))
    }
}
