//! A feeder that counts its pieces by angle.

use super::{
    Braking, DEGREES_PER_SECOND, Jam, JamConfig, JamStatus, Measured, MotorCommand, small_angle,
};
use crate::angle::{CountsPerTurn, TotalAngle};
use crate::config::{ConfigError, not_negative, positive};
use crate::ok;
use crate::profile::AngleSetpoint;
use crate::units::{Degrees, Direction, Rpm, RpmPerSecond, Seconds};

/// Properties of a feeder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeederConfig {
    /// Pieces (counts) in turns of the shaft: `CountsPerTurn::new(8, 1)` for a wheel of eight pockets.
    pub pieces: CountsPerTurn,
    /// Where it feeds.
    pub direction: Direction,
    /// Pieces a second when a number is fed; > 0.
    pub pieces_per_s: f32,
    /// Acceleration of the angle asked for; > 0, what the motor reaches: more would feed too much.
    pub acceleration: RpmPerSecond,
    /// Degrees before its pocket at which a piece counts; less than half a piece, above the error.
    pub tolerance: Degrees,
    /// The jams. Their following error must be at most the tolerance: a piece not fed is a jam.
    pub jam: JamConfig,
}

impl FeederConfig {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let (tolerance, error) = (self.tolerance.get(), self.jam.following_error.get());
        let piece = self.piece().degrees().get();
        ok!(positive("pieces_per_s", self.pieces_per_s));
        ok!(positive("acceleration", self.acceleration.get()));
        ok!(not_negative("tolerance", tolerance));
        let is_small = tolerance < 0.5 * piece;
        ok!(ConfigError::check(is_small, "tolerance", tolerance, "less than half a piece"));
        ok!(self.jam.validate(), in "jam");
        let is_seen = error <= tolerance;
        let check = ConfigError::check(is_seen, "following_error", error, "at most `tolerance`");
        check.map_err(|error| error.in_part("jam"))
    }

    fn piece(&self) -> TotalAngle {
        TotalAngle::from_counts(1, self.pieces)
    }

    /// The angle from the beginning at which this many pieces are fed.
    fn angle_of(&self, pieces: i64) -> TotalAngle {
        TotalAngle::from_counts(pieces, self.pieces)
    }

    /// Whole pieces in an angle from the beginning.
    fn pieces_in(&self, angle: TotalAngle) -> i64 {
        let nearest = angle.counts_at(self.pieces);
        if self.angle_of(nearest) > angle { nearest - 1 } else { nearest }
    }
}

/// State of a feeder. It begins where its motor is first measured: a pocket has arrived there, unless
/// [`align`](Self::align) says where one has.
///
/// Pieces are counted forward only: reversing out of a jam and going again count nothing.
///
/// ```
/// use rc10_app::mechanism::{MotorCommand, Feeder, FeederConfig, JamConfig, Measured, Stall};
/// use rc10_app::{
///     AngleSetpoint, CountsPerTurn, Degrees, Direction, Rpm, RpmPerSecond, Seconds, TotalAngle,
/// };
/// let config = FeederConfig {
///     pieces: CountsPerTurn::new(8, 1),
///     direction: Direction::Forward,
///     pieces_per_s: 10.0,
///     acceleration: RpmPerSecond::new(500.0),
///     tolerance: Degrees::new(2.0),
///     jam: JamConfig {
///         stall: Stall { effort: 6.0, standstill: Rpm::new(5.0), time: Seconds::new(0.2) },
///         following_error: Degrees::new(2.0),
///         reverse: Degrees::new(30.0),
///         reverse_speed: Rpm::new(60.0),
///         reverse_time: Seconds::new(0.5),
///         tries: 3,
///     },
/// };
/// assert_eq!(config.validate(), Ok(()));
/// let mut feeder = Feeder::new();
/// feeder.feed(3);
/// let mut motor = Measured::default();
/// for _ in 0..100 {
///     // A motor that follows at once.
///     if let MotorCommand::Angle(AngleSetpoint { angle, .. }) = feeder.update(&config, &motor, Seconds::new(0.01)) {
///         motor.angle = angle;
///     }
/// }
/// assert_eq!((feeder.fed(), motor.angle), (3, TotalAngle::from_degrees(135)));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feeder {
    /// The motor's angle at the beginning.
    began: Option<TotalAngle>,
    /// The angle asked for, forward from the beginning.
    setpoint: TotalAngle,
    /// The speed, 0 or more.
    speed: Rpm,
    order: Order,
    fed: i64,
    jam: Jam,
    command: MotorCommand,
}

/// An order to a feeder.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    /// A number of pieces since the beginning.
    Total(i64),
    /// The piece in which it can brake, and a number of pieces more.
    Whole(i64),
    /// Pieces a second, until told otherwise.
    Rate(f32),
}

impl Default for Order {
    fn default() -> Self {
        Self::Total(0)
    }
}

impl Feeder {
    /// Nothing to feed.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Feeds more pieces; ends [`run`](Self::run) after the piece in which it could brake.
    pub fn feed(&mut self, pieces: u32) {
        let pieces = i64::from(pieces);
        self.order = match self.order {
            Order::Total(total) => Order::Total(total.saturating_add(pieces)),
            Order::Whole(more) => Order::Whole(more.saturating_add(pieces)),
            Order::Rate(_) => Order::Whole(pieces),
        };
    }

    /// Feeds at a rate a second until told otherwise; one that is not finite and positive stops.
    pub fn run(&mut self, rate: f32) {
        self.order =
            if rate > 0.0 && rate.is_finite() { Order::Rate(rate) } else { Order::Whole(0) };
    }

    /// Stops after the piece in which it can still brake; what was asked for beyond it is forgotten.
    pub const fn stop(&mut self) {
        self.order = Order::Whole(0);
    }

    /// Pieces fed since the beginning.
    pub const fn fed(&self) -> u32 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative"
        )]
        return self.fed as u32;
    }

    /// Pieces that were asked for and are not fed yet; 0 while it [runs](Self::run).
    pub const fn left(&self) -> u32 {
        let left = match self.order {
            Order::Total(total) => total.saturating_sub(self.fed),
            Order::Whole(more) => more,
            Order::Rate(_) => 0,
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        return if left <= 0 {
            0
        } else if left > u32::MAX as i64 {
            u32::MAX
        } else {
            left as u32
        };
    }

    /// The feeder's jams.
    pub const fn jam(&self) -> &Jam {
        &self.jam
    }

    /// Feeds on after a jam that was given up.
    pub fn reset(&mut self) {
        self.jam.reset();
    }

    /// A pocket is where the motor is at `pocket`, by [`Homing`](super::Homing). The counts stay.
    pub fn align(&mut self, config: &FeederConfig, pocket: TotalAngle) {
        self.setpoint = config.angle_of(self.fed);
        self.speed = Rpm::ZERO;
        self.began = Some(pocket.minus(forward(config.direction, self.setpoint)));
    }

    /// One step.
    ///
    /// A bad `dt` repeats the last command. An unusable motor feeds nothing.
    pub fn update(
        &mut self,
        config: &FeederConfig,
        measured: &Measured,
        dt: Seconds,
    ) -> MotorCommand {
        if dt.is_step() {
            self.command = match measured.usable() {
                Ok(()) => self.step(config, measured, dt),
                Err(_) => MotorCommand::Coast,
            };
        }
        self.command
    }

    fn step(&mut self, config: &FeederConfig, measured: &Measured, dt: Seconds) -> MotorCommand {
        let began = *self.began.get_or_insert(measured.angle);
        let at = forward(config.direction, measured.angle.minus(began));
        let tolerance = small_angle(config.tolerance.get());
        let arrived = config.pieces_in(at.plus(tolerance));
        self.fed = self.fed.max(arrived);

        // The angle asked for: within its rate, its braking, and a piece ahead of a lagging motor.
        let braking = Braking { acceleration: config.acceleration, reaction: dt };
        let (rate, end) = self.goal(config, &braking, tolerance);
        let piece = config.piece();
        let fastest = rate * piece.degrees().get() / DEGREES_PER_SECOND;
        let left = end.minus(self.setpoint).degrees();
        let faster = self.speed.get() + config.acceleration.get() * dt.get();
        let speed = if self.jam.status() == JamStatus::Free { faster } else { 0.0 };
        let speed = speed.min(fastest).min(braking.speed(left).get());
        let step = small_angle(speed * DEGREES_PER_SECOND * dt.get());
        let next = self.setpoint.plus(step).min(at.plus(piece)).max(self.setpoint);
        let moved = next.minus(self.setpoint).degrees().get();
        self.speed = Rpm::new(moved / (DEGREES_PER_SECOND * dt.get()));
        self.setpoint = next;
        let sign = f32::from(config.direction.sign());
        let angle = began.plus(forward(config.direction, self.setpoint));
        let speed = self.speed * sign;
        let wanted = MotorCommand::Angle(AngleSetpoint { speed, ..AngleSetpoint::at(angle) });
        self.jam.update(&config.jam, wanted, measured, dt)
    }

    /// Pieces a second, and the angle to stop at.
    fn goal(
        &mut self,
        config: &FeederConfig,
        braking: &Braking,
        tolerance: TotalAngle,
    ) -> (f32, TotalAngle) {
        if let Order::Whole(more) = self.order {
            let stands = self.setpoint.plus(small_angle(braking.way(self.speed).get()));
            let whole = config.pieces_in(stands);
            // A pocket that has left by no more than the tolerance is still there.
            let begun = i64::from(config.angle_of(whole).plus(tolerance) < stands);
            self.order = Order::Total(whole.saturating_add(begun).saturating_add(more));
        }
        match self.order {
            Order::Rate(rate) => (rate, TotalAngle::from_microdegrees(i64::MAX)),
            Order::Total(total) | Order::Whole(total) => {
                (config.pieces_per_s, config.angle_of(total))
            }
        }
    }
}

/// An angle of the motor as an angle where it feeds, and the other way round.
const fn forward(direction: Direction, angle: TotalAngle) -> TotalAngle {
    match direction {
        Direction::Forward => angle,
        Direction::Reversed => angle.reversed(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Stall;
    use super::*;

    const DT: Seconds = Seconds::new(0.01);
    const CONFIG: FeederConfig = FeederConfig {
        // 360 / 7 is no whole number of microdegrees.
        pieces: CountsPerTurn::new(7, 1),
        direction: Direction::Reversed,
        pieces_per_s: 9.3,
        acceleration: RpmPerSecond::new(50_000.0),
        tolerance: Degrees::new(2.0),
        jam: JamConfig {
            stall: Stall { effort: 6.0, standstill: Rpm::new(5.0), time: Seconds::new(0.095) },
            following_error: Degrees::new(2.0),
            reverse: Degrees::new(30.0),
            reverse_speed: Rpm::new(60.0),
            reverse_time: Seconds::new(0.05),
            tries: 2,
        },
    };

    /// A motor that follows at once.
    struct Ideal(Feeder, Measured);

    impl Ideal {
        fn run(&mut self, steps: u32) {
            for _ in 0..steps {
                if let MotorCommand::Angle(AngleSetpoint { angle, .. }) =
                    self.0.update(&CONFIG, &self.1, DT)
                {
                    self.1.angle = angle;
                }
            }
        }
    }

    #[test]
    fn a_million_pieces_are_exact() {
        let mut ideal = Ideal(Feeder::new(), Measured::default());
        ideal.1.angle = TotalAngle::from_degrees(77);
        ideal.run(1);
        for _ in 0..1000 {
            ideal.0.feed(1000);
        }
        // At once: a fast motor.
        ideal.0.setpoint = CONFIG.angle_of(999_999);
        ideal.1.angle = TotalAngle::from_degrees(77).minus(ideal.0.setpoint);
        ideal.run(20);
        assert_eq!((ideal.0.fed(), ideal.0.left()), (1_000_000, 0));
        // 142,857 turns and one seventh.
        let turned = TotalAngle::from_degrees(77).minus(ideal.1.angle).microdegrees();
        assert_eq!(turned, 142_857 * 360_000_000 + 51_428_571);
    }

    #[test]
    fn stopping_finishes_the_piece_that_is_on_its_way() {
        let mut ideal = Ideal(Feeder::new(), Measured::default());
        ideal.0.run(10.0);
        ideal.run(25); // two pieces and a half
        ideal.0.run(0.0);
        ideal.run(50);
        assert_eq!(ideal.0.fed(), 3);
        // At rest nothing is on its way.
        ideal.0.stop();
        ideal.run(50);
        assert_eq!(ideal.0.fed(), 3);
        ideal.0.feed(5);
        ideal.run(1);
        ideal.0.stop();
        ideal.run(50);
        assert_eq!((ideal.0.fed(), ideal.0.left()), (4, 0));
        // From continuous to a number: the piece on its way, and two.
        ideal.0.run(10.0);
        ideal.run(5);
        ideal.0.feed(1);
        ideal.0.feed(1);
        assert_eq!(ideal.0.left(), 2);
        ideal.run(100);
        assert_eq!(ideal.0.fed(), 7);
    }

    #[test]
    fn an_aligned_feeder_keeps_its_count_and_what_it_was_asked_for() {
        let mut ideal = Ideal(Feeder::new(), Measured::default());
        ideal.0.feed(2);
        ideal.run(1);
        ideal.run(100);
        // Asked for before it knows where its pockets are, and while it is elsewhere.
        ideal.0.feed(3);
        ideal.1.angle = TotalAngle::from_degrees(1003);
        ideal.0.align(&CONFIG, TotalAngle::from_degrees(1000));
        assert_eq!((ideal.0.fed(), ideal.0.left()), (2, 3));
        ideal.run(100);
        assert_eq!((ideal.0.fed(), ideal.0.left()), (5, 0));
        let turned = TotalAngle::from_degrees(1000).minus(ideal.1.angle);
        assert_eq!(CONFIG.pieces_in(turned), 3);
        assert!(turned.minus(CONFIG.angle_of(3)).microdegrees().abs() <= 1, "{turned:?}");
        // In the middle of a piece.
        ideal.0.feed(2);
        while ideal.0.fed() < 6 {
            ideal.run(1);
        }
        ideal.run(3);
        assert!(ideal.0.setpoint > CONFIG.angle_of(6), "{:?}", ideal.0);
        ideal.1.angle = TotalAngle::ZERO;
        ideal.0.align(&CONFIG, TotalAngle::ZERO);
        ideal.run(100);
        assert_eq!(
            (ideal.0.fed(), ideal.1.angle),
            (7, CONFIG.angle_of(7).minus(CONFIG.angle_of(6)).reversed())
        );
        // One that has fed nothing yet.
        let mut fresh = Ideal(Feeder::new(), Measured::default());
        fresh.0.feed(1);
        fresh.0.align(&CONFIG, TotalAngle::from_degrees(10));
        fresh.run(100);
        let end = TotalAngle::from_degrees(10).minus(CONFIG.angle_of(1));
        assert_eq!((fresh.0.fed(), fresh.1.angle), (1, end));
    }

    #[test]
    fn the_rate_is_that_asked_for() {
        let mut ideal = Ideal(Feeder::new(), Measured::default());
        ideal.0.run(12.5);
        ideal.run(1000);
        assert!((124..=125).contains(&ideal.0.fed()), "{}", ideal.0.fed());
        ideal.0.run(f32::NAN);
        ideal.run(100);
        // It may have been too late to brake before the next.
        assert!((125..=126).contains(&ideal.0.fed()), "{}", ideal.0.fed());
    }

    /// Else it would be pulled on all the harder once it is free.
    #[test]
    fn while_a_jam_is_cleared_the_setpoint_stands_and_then_begins_at_rest() {
        for direction in [Direction::Forward, Direction::Reversed] {
            let acceleration = RpmPerSecond::new(300.0);
            let config = FeederConfig { direction, pieces_per_s: 2.0, acceleration, ..CONFIG };
            let (mut feeder, effort) = (Feeder::new(), 19.0 * f32::from(direction.sign()));
            feeder.run(2.0);
            let stuck = Measured { effort, ..Measured::default() };
            while feeder.jam().status() == JamStatus::Free {
                feeder.update(&config, &stuck, DT);
            }
            let stands = feeder.setpoint;
            assert!(stands > TotalAngle::ZERO && stands < CONFIG.piece(), "{stands:?}");
            let mut cleared = 0;
            while feeder.jam().status() == JamStatus::Clearing {
                feeder.update(&config, &stuck, DT);
                cleared += 1;
                assert_eq!((feeder.setpoint, feeder.speed), (stands, Rpm::ZERO));
            }
            assert!(cleared > 3, "{cleared}");
            // 300 rpm/s of one step.
            feeder.update(&config, &stuck, DT);
            assert!(feeder.setpoint > stands && feeder.speed.get() < 3.01, "{feeder:?}");
        }
    }

    #[test]
    fn a_motor_that_does_not_follow_or_cannot_be_used_is_not_left_behind() {
        let mut feeder = Feeder::new();
        feeder.run(10.0);
        let standing = Measured { gaps: 3, ..Measured::default() };
        let mut command = MotorCommand::Coast;
        for _ in 0..1000 {
            command = feeder.update(&CONFIG, &standing, DT);
        }
        assert_eq!(command, MotorCommand::hold(CONFIG.piece().reversed()));
        let offline = Measured { health: super::super::Health::Offline, ..standing };
        assert_eq!(feeder.update(&CONFIG, &offline, DT), MotorCommand::Coast);
        let before = feeder;
        feeder.update(&CONFIG, &standing, Seconds::new(f32::NAN));
        assert_eq!(feeder, before);
        assert_eq!(feeder.fed(), 0);
    }

    #[test]
    fn the_configuration_is_checked() {
        assert_eq!(CONFIG.validate(), Ok(()));
        let jam = JamConfig { following_error: Degrees::new(2.1), ..CONFIG.jam };
        for (bad, part, field) in [
            (FeederConfig { pieces_per_s: 0.0, ..CONFIG }, "", "pieces_per_s"),
            (FeederConfig { acceleration: RpmPerSecond::ZERO, ..CONFIG }, "", "acceleration"),
            (FeederConfig { tolerance: Degrees::new(26.0), ..CONFIG }, "", "tolerance"),
            (FeederConfig { jam, ..CONFIG }, "jam", "following_error"),
        ] {
            let error = bad.validate().unwrap_err();
            assert_eq!((error.part, error.field), (part, field));
        }
    }
}
