use rc10_app::angle::{shortest_way, shortest_way_degrees};
use rc10_app::{Degrees, Radians, TotalAngle, maths};
use rc10_time::Micros;

/// An older heading is of no use: 2000 °/s makes half a turn in this time.
pub const FRESH_FOR: Micros = Micros::from_millis(90);

/// Microdegrees.
const TURN: i32 = 360_000_000;

/// A heading from a sensor's yaw: continuous, counter-clockwise, exact microdegrees, own zero.
///
/// Small and `Copy`, to be published; without a yaw newer than [`FRESH_FOR`] it has no value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Heading {
    heard: Option<Micros>,
    /// The sensor's yaw, within its turn; and how many turns it made.
    yaw: i32,
    turns: i32,
    zero: i32,
    zero_turns: i32,
    gaps: u32,
    is_lost: bool,
}

impl Heading {
    /// The sensor says this at `at`: degrees, without whole turns. What is not finite is ignored.
    pub fn hear(&mut self, yaw: Degrees, at: Micros) {
        if !yaw.is_finite() {
            return;
        }
        let yaw = shortest_way_degrees(Degrees::ZERO, yaw).get();
        let yaw = maths::round_to_i32(yaw * 1e6);
        if let Some(last) = self.heard {
            let way = yaw - self.yaw;
            let turns = (shortest_way(self.yaw, yaw, TURN) - way).signum();
            self.turns = self.turns.wrapping_add(turns);
            if at.since(last) > FRESH_FOR {
                self.gaps = self.gaps.saturating_add(1);
            }
        }
        self.yaw = yaw;
        self.heard = Some(at);
    }

    /// Makes the present heading zero. The sensor does not know of it.
    pub const fn zero(&mut self) {
        self.zero = self.yaw;
        self.zero_turns = self.turns;
        self.is_lost = false;
    }

    /// Makes the present heading zero, without a [`direction`](Self::direction): the IMU came late.
    pub const fn begin_here(&mut self) {
        self.zero();
        self.is_lost = true;
    }

    /// The heading with all turns counted; `None` if that is not known.
    #[must_use]
    pub fn total(&self, now: Micros) -> Option<TotalAngle> {
        let turns = i64::from(self.turns) - i64::from(self.zero_turns);
        let way = i64::from(self.yaw) - i64::from(self.zero);
        self.is_fresh(now).then(|| TotalAngle::from_microdegrees(turns * i64::from(TURN) + way))
    }

    /// The direction, -π ..= π, for [`Twist::into_frame`](rc10_app::Twist::into_frame), if known.
    #[must_use]
    pub fn direction(&self, now: Micros) -> Option<Radians> {
        let way = shortest_way(self.zero, self.yaw, TURN);
        let degrees = way as f32 * 1e-6;
        let is_known = self.is_fresh(now) && !self.is_lost;
        is_known.then(|| Radians::new(degrees.to_radians()))
    }

    /// Times of silence beyond [`FRESH_FOR`]: turns may be missing from [`total`](Self::total), and
    /// [`direction`](Self::direction) be wrong until [`zero`](Self::zero).
    #[must_use]
    pub const fn gaps(&self) -> u32 {
        self.gaps
    }

    fn is_fresh(&self, now: Micros) -> bool {
        self.heard.is_some_and(|heard| now.since(heard) <= FRESH_FOR)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f32::consts::{FRAC_PI_2, PI};

    const STEP: Micros = Micros::from_millis(5);

    /// A heading after these yaws, one every 5 ms, and the time of the last.
    fn after(yaws: impl IntoIterator<Item = f32>) -> (Heading, Micros) {
        let (mut heading, mut now) = (Heading::default(), Micros::ZERO);
        for yaw in yaws {
            now += STEP;
            heading.hear(Degrees::new(yaw), now);
        }
        (heading, now)
    }

    fn microdegrees(heading: &Heading, now: Micros) -> Option<i64> {
        heading.total(now).map(TotalAngle::microdegrees)
    }

    fn wrapped(degrees: f32) -> f32 {
        degrees - 360.0 * maths::round(degrees / 360.0)
    }

    #[test]
    fn turns_are_counted_both_ways() {
        let (heading, now) = after((0..=1000).map(|step| wrapped(step as f32 * 7.0)));
        assert_eq!(microdegrees(&heading, now), Some(7_000_000_000));
        assert_eq!(heading.gaps(), 0);
        let there_and_back =
            (0..=1000).chain((0..1000).rev()).map(|step| wrapped(step as f32 * -7.0));
        let (heading, now) = after(there_and_back);
        assert_eq!(microdegrees(&heading, now), Some(0));
    }

    #[test]
    fn both_ends_of_the_scale_are_neighbours() {
        let (heading, now) = after([179.0, -179.0]);
        assert_eq!(microdegrees(&heading, now), Some(181_000_000));
        let (heading, now) = after([-179.0, 179.0, -180.0, 180.0]);
        assert_eq!(microdegrees(&heading, now), Some(-180_000_000));
    }

    #[test]
    fn zero_is_where_it_looks_when_told() {
        let (mut heading, mut now) = after([100.0, 170.0, -120.0]);
        heading.zero();
        assert_eq!(microdegrees(&heading, now), Some(0));
        assert_eq!(heading.direction(now), Some(Radians::ZERO));
        now += STEP;
        heading.hear(Degrees::new(-30.0), now);
        assert_eq!(microdegrees(&heading, now), Some(90_000_000));
        assert!((heading.direction(now).unwrap().get() - FRAC_PI_2).abs() < 1e-6);
        for (yaw, way) in [(100.0, -140.0_f32), (-150.0, -30.0)] {
            now += STEP;
            heading.hear(Degrees::new(yaw), now);
            assert!((heading.direction(now).unwrap().get() - way.to_radians()).abs() < 1e-6);
        }
        assert_eq!(microdegrees(&heading, now), Some(330_000_000));
    }

    #[test]
    fn a_stale_heading_is_none() {
        let heading = Heading::default();
        assert_eq!((heading.total(Micros::ZERO), heading.direction(Micros::ZERO)), (None, None));
        let (mut heading, now) = after([1.0, 2.0]);
        assert!(heading.direction(now + FRESH_FOR).is_some());
        let late = now + FRESH_FOR + Micros::new(1);
        assert_eq!((heading.total(late), heading.direction(late)), (None, None));
        heading.hear(Degrees::new(f32::NAN), late);
        assert_eq!(heading.direction(late), None);
        assert_eq!(heading.gaps(), 0);
        heading.hear(Degrees::new(3.0), late);
        assert_eq!((microdegrees(&heading, late), heading.gaps()), (Some(3_000_000), 1));
    }

    #[test]
    fn no_yaw_makes_it_fall() {
        let yaws = [f32::MAX, f32::MIN, 1e9, -1e9, f32::INFINITY, 540.0, f32::NAN, -0.0, 1e-40];
        let (heading, now) = after(yaws.into_iter().cycle().take(1000));
        assert!(heading.direction(now).unwrap().get().abs() <= PI);
        assert!(heading.total(now).is_some());
    }
}
