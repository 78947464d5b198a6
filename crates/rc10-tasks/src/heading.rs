//! The heading of the robot in the world, by its IMU.
//!
//! **The world's forward is where the robot looked when it was armed**: the heading is zero then. An
//! IMU that comes late, to a robot that was armed without, counts from where the robot looks then: what
//! holds a heading goes on with that ([`Heading::total`]), and nothing jumps; which way the world's
//! forward is ([`Heading::direction`]) is not known until the robot is armed anew. One that falls silent
//! may have lost power and begun at another zero: then there is no heading until it is armed anew.

use core::fmt;
use core::sync::atomic::Ordering;

use embassy_time::{Duration, Ticker, TimeoutError, with_timeout};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::SpiDevice;
use embedded_io_async::Read;
use rc10_app::{Degrees, Seconds};
use rc10_module::imu::attitude::Attitude;
use rc10_module::imu::bmi088::{self, Bmi088};
use rc10_module::imu::{Heading, Sample, Wit, wit};
use rc10_module::{Reception, listen};
use rc10_motor::{ArmState, ArmSwitch, Names};
use rc10_time::Micros;

use crate::common::Common;
use crate::live::Live;

/// A heading that is zero where the robot looked when it was armed.
#[derive(Default)]
struct Zeroed {
    heading: Heading,
    was_disarmed: bool,
    /// How many gaps there were when it was heard last from a robot that was not armed, or first.
    gaps: Option<u32>,
}

impl Zeroed {
    /// The IMU says this; it has `missed` rotations that many times. `None` until it is known from where that counts.
    fn hear(
        &mut self,
        yaw: Degrees,
        missed: u32,
        switch: &ArmSwitch,
        at: Micros,
    ) -> Option<Heading> {
        self.heading.hear(yaw, at);
        let gaps = self.heading.gaps().saturating_add(missed);
        let is_disarmed = switch.state() == ArmState::Disarmed;
        let is_late = !is_disarmed && self.gaps.is_none();
        if is_disarmed || is_late {
            self.gaps = Some(gaps);
        }
        let is_known = self.gaps == Some(gaps);
        if is_late {
            self.heading.begin_here();
        } else if is_known && self.was_disarmed && !is_disarmed {
            self.heading.zero();
        }
        self.was_disarmed = is_disarmed;
        is_known.then_some(self.heading)
    }
}

/// Listens to an HWT101 or WT901 on a serial port, for ever; hands on each heading and its time.
pub async fn listen_to_wit(
    port: impl Read,
    switch: &ArmSwitch,
    reception: &Reception,
    mut hear: impl FnMut(Heading, Micros),
) -> ! {
    let mut zeroed = Zeroed::default();
    listen(port, Wit, reception, |message, at| {
        let wit::Message::Angle { yaw, .. } = message else { return };
        if let Some(heading) = zeroed.hear(yaw, 0, switch, at) {
            hear(heading, at);
        }
    })
    .await
}

/// Listens to an HWT101 or WT901 on a serial port, for ever: the heading that all tasks share.
pub async fn listen_for<N: Names>(shared: &Common<'_, N, impl Live>, port: impl Read) -> ! {
    shared.has_imu.store(true, Ordering::Relaxed);
    listen_to_wit(port, &shared.switch, &shared.imu_reception, |heading, at| {
        shared.heading.set(heading, at);
    })
    .await
}

/// Setting it up takes 0.12 s.
const LONGEST_READ: Duration = Duration::from_millis(250);

/// Reads a BMI088 once a millisecond, for ever; passes on each heading, and each sample or why it
/// is missing, with its time.
///
/// `reception` counts samples as frames, invalid samples of the chips as damaged, and errors of the
/// SPI bus as errors of the port. The sensor lies flat, its z axis up. If the robot does not stand
/// still for a second after power-on, its heading drifts: see [`Attitude`].
pub async fn measure<A, G, D>(
    mut imu: Bmi088<A, G, D>,
    switch: &ArmSwitch,
    reception: &Reception,
    mut hear: impl FnMut(Heading, Micros),
    mut tell: impl FnMut(Result<&Sample, &'static str>, Micros),
) -> !
where
    A: SpiDevice<Error: fmt::Debug>,
    G: SpiDevice<Error = A::Error>,
    D: DelayNs,
{
    let (mut zeroed, mut attitude) = (Zeroed::default(), Attitude::new());
    let mut ticker = Ticker::every(Duration::from_millis(1));
    let mut last = rc10_message::now();
    loop {
        ticker.next().await;
        let asked = rc10_message::now();
        // A bus that stands still ends, too.
        let sample = with_timeout(LONGEST_READ, imu.read()).await;
        let at = rc10_message::now();
        if at.since(asked) > Micros::from_millis(1) {
            // Set up anew: what was not read meanwhile is not read later.
            ticker.reset();
        }
        let bmi088::Counters { samples, spi_errors, refused, .. } = imu.counters();
        reception.count(samples, refused, spi_errors);
        let sample = match sample {
            Ok(Ok(sample)) => sample,
            Ok(Err(error)) => {
                tell(Err(error.words()), at);
                continue;
            }
            Err(TimeoutError) => {
                tell(Err("does not end a transfer"), at);
                continue;
            }
        };
        tell(Ok(&sample), at);
        let step = Seconds::from_micros(at.since(last).get());
        last = at;
        // One that is refused is a rotation that was missed, which the attitude counts.
        let _ = attitude.update(&sample, step);
        let yaw = Degrees::new(attitude.yaw().get().to_degrees());
        if let Some(heading) = zeroed.hear(yaw, attitude.gaps(), switch, at) {
            hear(heading, at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In degrees: the heading with all turns counted, and the direction.
    fn told(heading: Option<Heading>, at: Micros) -> Option<(i64, Option<i64>)> {
        let heading = heading?;
        #[expect(clippy::cast_possible_truncation, reason = "whole degrees")]
        let direction = heading.direction(at).map(|it| it.get().to_degrees().round() as i64);
        Some((heading.total(at)?.microdegrees() / 1_000_000, direction))
    }

    #[test]
    fn an_imu_that_comes_late_joins_where_the_robot_looks_and_knows_no_forward() {
        let switch = ArmSwitch::new();
        switch.arm().unwrap();
        let mut zeroed = Zeroed::default();
        let mut millis = 130;
        let mut hear = |degrees: f32, missed, switch: &ArmSwitch| {
            millis += 5;
            let at = Micros::from_millis(millis);
            told(zeroed.hear(Degrees::new(degrees), missed, switch, at), at)
        };
        assert_eq!(hear(70.0, 0, &switch), Some((0, None)));
        assert_eq!(hear(100.0, 0, &switch), Some((30, None)));
        // Armed anew it knows.
        switch.disarm();
        hear(100.0, 0, &switch);
        switch.arm().unwrap();
        assert_eq!(hear(100.0, 0, &switch), Some((0, Some(0))));
        assert_eq!(hear(90.0, 0, &switch), Some((-10, Some(-10))));
        // One that missed a rotation, and is no late one: nothing until it is armed anew.
        assert_eq!(hear(90.0, 1, &switch), None);
        assert_eq!(hear(90.0, 1, &switch), None);
        switch.disarm();
        hear(90.0, 1, &switch);
        switch.arm().unwrap();
        assert_eq!(hear(90.0, 1, &switch), Some((0, Some(0))));
    }
}
