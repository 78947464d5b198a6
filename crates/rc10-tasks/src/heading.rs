//! The heading of the robot in the world, by its IMU.
//!
//! **The world's forward is where the robot looked when it was armed**: the heading is zero then. One
//! that comes late, to a robot that was armed without, is zero where the robot looks as it comes: until
//! then it drove by its own axes, so nothing jumps. An IMU that falls silent may have lost power and
//! begun at another zero: until the robot is armed anew there is no heading then.

use core::fmt;
use core::sync::atomic::Ordering;

use embassy_time::{Duration, Ticker, TimeoutError, with_timeout};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::SpiDevice;
use embedded_io_async::Read;
use rc10_app::{Degrees, Seconds};
use rc10_can::Micros;
use rc10_module::imu::attitude::Attitude;
use rc10_module::imu::bmi088::{self, Bmi088};
use rc10_module::imu::{Heading, Sample, Wit, wit};
use rc10_module::{Reception, listen};
use rc10_motor::{ArmState, ArmSwitch, Names};

use crate::common::Common;

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
        if is_late || (is_known && self.was_disarmed && !is_disarmed) {
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
pub async fn listen_for<N: Names, const BUSES: usize, const LINES: usize>(
    shared: &Common<'_, N, BUSES, LINES>,
    port: impl Read,
) -> ! {
    shared.has_imu.store(true, Ordering::Relaxed);
    listen_to_wit(port, &shared.switch, &shared.imu_reception, |heading, at| {
        shared.heading.set(heading, at);
    })
    .await
}

/// Setting it up takes 0.12 s.
const LONGEST_READ: Duration = Duration::from_millis(250);

/// Reads a BMI088 once a millisecond, for ever; hands on each heading, each sample or in words why there is none, and its time.
///
/// `reception` counts samples as frames, those that the chips spoilt as damaged, and errors of the SPI bus as errors of
/// the port. The sensor lies flat, its z axis up. Where the robot does not stand still for a second after power-on, its heading
/// drifts: see [`Attitude`].
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
