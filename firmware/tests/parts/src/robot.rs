//! The robot, the same on the chip and in `tests/firmware/parts.rs`: two motors, on as many RS-485 lines as the board
//! has; and at other ports three switches, a voltage and two servos.

/// A robot, on so many lines; the second motor is on that place.
macro_rules! robot {
    ($lines:literal, $second:expr) => {
        use embassy_time::{Duration, Ticker};
        use embedded_hal::digital::InputPin;
        use embedded_hal::pwm::SetDutyCycle;
        use rc10_app::{Degrees, Rpm};
        use rc10_module::remote::Receiver;
        use rc10_module::servo::{Config, Servo, WhenDisarmed};
        use rc10_motor::Place::Line;
        use rc10_motor::rc10_time::Micros;
        use rc10_motor::unitree::{GoM8010, LineConfig};
        use rc10_motor::{ArmState, Entry, Target};
        use rc10_tasks::{Arming, ArmingConfig};

        rc10_motor::motors! {
            /// Names of the motors.
            pub enum Name;
            /// The motors.
            pub struct Motors;
            buses: [100.0; BUSES];
            lines: $lines;
            First: GoM8010 = Entry::new("first", Line(1), LineConfig::new(0)),
            Second: GoM8010 = Entry::new("second", $second, LineConfig::new(1)),
        }

        /// Buses, on which nothing is.
        pub const BUSES: usize = 2;
        /// RS-485 lines.
        pub const LINES: usize = $lines;
        /// The motors answer in this time.
        pub const REPLY: Micros = Micros::new(200);
        /// A receiver that speaks in pulses.
        pub const RECEIVER: Receiver = Receiver::Ppm;
        const ARMING: ArmingConfig = ArmingConfig::DEFAULT.checked(RECEIVER);

        /// The robot's buses and lines.
        pub type Ports = rc10_motor::embassy::Ports<Name, BUSES, LINES>;
        /// What its tasks share.
        pub type Shared<'p> = rc10_tasks::Common<'p, Name, BUSES, LINES>;

        /// 10 us a degree.
        const fn servo(when_disarmed: WhenDisarmed) -> Config {
            let ends = [(Degrees::new(0.0), 1000), (Degrees::new(100.0), 2000)];
            Config { ends, when_disarmed }
        }

        /// The servos go to 1 degree for each volt, and 20, 10 and 5 degrees for closed switches. One holds when the robot
        /// is disarmed.
        pub async fn work(
            shared: &Shared<'_>,
            mut switches: [impl InputPin; 3],
            mut measure: impl AsyncFnMut() -> Option<f32>,
            [first, second]: [impl SetDutyCycle; 2],
        ) {
            let (Ok(mut first), Ok(mut second)) = (
                Servo::new(first, servo(WhenDisarmed::Hold)),
                Servo::new(second, servo(WhenDisarmed::NoPulse)),
            ) else {
                return;
            };
            let (mut arming, mut ticker) =
                (Arming::new(ARMING), Ticker::every(Duration::from_millis(10)));
            loop {
                ticker.next().await;
                let mut angle = measure().await.unwrap_or(f32::NAN);
                for (switch, closed) in switches.iter_mut().zip([20.0, 10.0, 5.0]) {
                    angle += if matches!(switch.is_low(), Ok(true)) { closed } else { 0.0 };
                }
                let is_driven = shared.obey(&mut arming).is_some();
                let is_armed = shared.switch.state() == ArmState::Armed;
                first.drive(Some(Degrees::new(angle)), is_armed);
                second.drive(Some(Degrees::new(angle)), is_armed);
                if is_driven {
                    shared.command(Name::First, Target::Speed(Rpm::new(60.0)));
                    shared.command(Name::Second, Target::Speed(Rpm::new(-60.0)));
                }
            }
        }
    };
}
