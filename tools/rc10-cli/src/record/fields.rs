//! The fields of each kind of message in a record, as data: from one table follow its bytes, its schema,
//! and how it is read back.

use rc10_app::{Amps, Celsius, NewtonMetres, TotalAngle, Volts};
use rc10_can::{ErrorState, Micros, Timing};
use rc10_module::Counters;
use rc10_motor::embassy::Rs485Status;
use rc10_motor::{ArmState, Condition, DriveMode, Fault, Feedback, Link, TargetKind};

use crate::recording::look::{BusLook, MotorLook, RemoteLook, RobotLook};
use crate::recording::remote::Loss;

/// One field of a message about a `T`: a number, NaN where there is none.
pub struct Field<T> {
    /// Name of the field, in small letters.
    pub name: &'static str,
    /// What it is, with its unit.
    pub about: &'static str,
    /// Its value.
    pub get: fn(&T) -> f64,
    /// Puts it back.
    pub set: fn(&mut T, f64),
    /// Whether it counts since power-on.
    pub counts: bool,
}

/// Whether a field of this type counts.
const fn counts<T, N: Number>(_: fn(&T) -> N) -> bool {
    N::COUNTS
}

/// The names of a table's fields.
pub(crate) fn names<T: 'static>(
    table: &'static [&'static [Field<T>]],
) -> impl Iterator<Item = &'static str> {
    table.iter().copied().flatten().map(|field| field.name)
}

/// A value that stands in a field.
pub trait Number: Copy {
    /// Whether it counts since power-on.
    const COUNTS: bool = false;
    /// As a number; NaN if there is none.
    fn number(self) -> f64;
    /// Of a number: the nearest that there is.
    fn of(number: f64) -> Self;
}

impl Number for f64 {
    fn number(self) -> f64 {
        self
    }
    fn of(number: f64) -> Self {
        number
    }
}

impl Number for f32 {
    fn number(self) -> f64 {
        self.into()
    }
    fn of(number: f64) -> Self {
        number as Self
    }
}

macro_rules! whole_numbers {
    ($($whole:ty: $counts:literal),+) => {
        $(impl Number for $whole {
            const COUNTS: bool = $counts;
            fn number(self) -> f64 {
                self as f64
            }
            fn of(number: f64) -> Self {
                number as Self
            }
        })+
    };
}
whole_numbers!(u8: false, u32: true, u64: true);

impl Number for bool {
    fn number(self) -> f64 {
        self.into()
    }
    fn of(number: f64) -> Self {
        number > 0.0
    }
}

/// In seconds.
impl Number for Micros {
    fn number(self) -> f64 {
        self.get() as f64 * 1e-6
    }
    fn of(number: f64) -> Self {
        Self::new((number * 1e6).round() as u64)
    }
}

impl<T: Number> Number for Option<T> {
    fn number(self) -> f64 {
        self.map_or(f64::NAN, Number::number)
    }
    fn of(number: f64) -> Self {
        (!number.is_nan()).then(|| T::of(number))
    }
}

/// States: by their place in a list, which the schema shows. One that no list has is the first.
macro_rules! states {
    ($($state:ident: $($name:ident),+;)+) => {
        $(impl Number for $state {
            fn number(self) -> f64 {
                [$(Self::$name),+].iter().position(|one| *one == self).map_or(f64::NAN, |at| at as f64)
            }
            fn of(number: f64) -> Self {
                let all = [$(Self::$name),+];
                all.get(number as usize).copied().unwrap_or(all[0])
            }
        })+
        /// The states with their names, in the order of their numbers.
        pub const STATES: &[(&str, &[&str])] =
            &[$((stringify!($state), &[$(stringify!($name)),+])),+];
    };
}
states! {
    Link: NeverSeen, Online, Lost;
    DriveMode: Off, Coast, Brake, Hold, Run;
    TargetKind: Coast, Current, Duty, Speed, Angle, TotalAngle, Torque, Impedance, Brake, Handbrake,
        Motion, SpeedMotion;
    Condition: Ready, Starting, Unregulated, SlowFeedback, NoReports, NotFollowing;
    ArmState: Disarmed, Armed, Suspended, EStopped;
    ErrorState: Active, Warning, Passive, BusOff;
}

/// The table of a type: each line has a name, what it is, and where it stands in the type.
macro_rules! fields {
    ($table:ident: $of:ty { $($name:literal, $about:literal, $($place:ident).+;)* } $(+ $($more:expr),+ $(,)?)?) => {
        #[doc = concat!("The fields of a [`", stringify!($of), "`].")]
        pub const $table: &[&[Field<$of>]] = &[
            &[$(Field {
                name: $name,
                about: $about,
                get: |it| it.$($place).+.number(),
                set: |it, number| it.$($place).+ = Number::of(number),
                counts: counts(|it: &$of| it.$($place).+),
            }),*],
            $($($more),+)?
        ];
    };
}

/// The four numbers of a [`Timing`].
macro_rules! timing {
    ($of:ty, $($place:ident).+: $count:literal, $min:literal, $max:literal, $sum:literal) => {
        [
            timing!(@ $of, 0, $($place).+, $count, "number of them"),
            timing!(@ $of, 1, $($place).+, $min, "the shortest, us"),
            timing!(@ $of, 2, $($place).+, $max, "the longest, us"),
            timing!(@ $of, 3, $($place).+, $sum, "all together, us"),
        ]
    };
    (@ $of:ty, $part:literal, $($place:ident).+, $name:literal, $about:literal) => {
        Field {
            name: $name,
            about: $about,
            get: |it: &$of| it.$($place).+.parts()[$part] as f64,
            set: |it: &mut $of, number| {
                let mut parts = it.$($place).+.parts();
                parts[$part] = number as u64;
                it.$($place).+ = Timing::from_parts(parts);
            },
            counts: false,
        }
    };
}

/// A measurement that not every device sends.
macro_rules! reading {
    ($name:literal, $about:literal, $get:ident, $with:ident, $unit:ident) => {
        Field {
            name: $name,
            about: $about,
            get: |it: &MotorLook| it.feedback().$get().map($unit::get).number(),
            set: |it: &mut MotorLook, number| {
                let feedback: &mut Feedback = it.feedback_mut();
                *feedback = feedback.$with($unit::new(number as f32));
            },
            counts: false,
        }
    };
}

fields!(MOTOR: MotorLook {
    "target_kind", "TargetKind of the target", seen.kind;
    "target", "what it is to do: rpm, or degrees; NaN while it follows no target", seen.target;
    "measured", "the same as measured", seen.measured;
    "link", "Link: whether it is heard", seen.link;
    "drive", "DriveMode: what it does", seen.drive;
    "shaft_speed", "speed of the simulated shaft, rpm", seen.rpm;
    "winding_current", "current in the simulated winding, A", seen.current;
    "effort", "effort of its loops, in their unit; NaN while they do not drive", effort;
} + &[
    Field {
        name: "speed",
        about: "speed by its feedback, rpm",
        get: |it| it.feedback().speed.get().number(),
        set: |it, number| it.feedback_mut().speed = rc10_app::Rpm::new(number as f32),
        counts: false,
    },
    Field {
        name: "total_angle",
        about: "degrees of the output shaft by its feedback, all turns counted",
        get: |it| it.feedback().total_angle.microdegrees() as f64 * 1e-6,
        set: |it, number| {
            it.feedback_mut().total_angle =
                TotalAngle::from_microdegrees((number * 1e6).round() as i64);
        },
        counts: false,
    },
    reading!("current", "current by its feedback, A", current, with_current, Amps),
    reading!("torque", "torque by its feedback, N m", torque, with_torque, NewtonMetres),
]);

fields!(MOTOR_HEALTH: MotorLook {
    "received", "good feedback frames", seen.counters.received;
    "malformed", "frames with its identifier that were no feedback", seen.counters.malformed;
    "unasked", "answers to requests that were not made", seen.counters.unasked;
    "lost", "times it went from online to lost", seen.counters.lost;
    "expired", "times its command expired", seen.counters.expired;
    "refused_unsupported", "targets of a kind that it does not take", seen.counters.refused.unsupported;
    "refused_not_finite", "targets that were infinite or NaN", seen.counters.refused.not_finite;
    "refused_out_of_range", "targets out of its range", seen.counters.refused.out_of_range;
    "overwritten", "feedback frames overwritten in the ESC", seen.overwritten;
    "condition", "Condition: whether it does what its target says", status.condition;
    "turn_gaps", "times that turns had to be estimated", status.feedback.turn_gaps;
} + &[
    Field {
        name: "fault",
        about: "code of the fault that it reports; NaN for none",
        get: |it| it.status.fault.map(|fault| fault.code).number(),
        // Its text is written beside it: see `Record`.
        set: |it, number| {
            it.status.fault = Option::<u32>::of(number).map(|code| Fault::new(code, ""));
        },
        counts: false,
    },
    reading!("temperature", "of the motor, degrees Celsius", temperature, with_temperature, Celsius),
    reading!(
        "controller_temperature",
        "of what drives the motor, degrees Celsius",
        controller_temperature,
        with_controller_temperature,
        Celsius
    ),
    reading!("supply", "voltage it is supplied with, V", supply, with_supply, Volts),
]);

fields!(BUS: BusLook {
    "frames", "frames on the wire", frames;
    "load", "busy share of the wire since power-on, percent", load;
    "ticks", "ticks of its task", status.ticks;
    "overruns", "ticks that did not happen", status.overruns;
    "submitted", "frames handed to the port", status.submitted;
    "replaced", "frames replaced before they left", status.replaced;
    "refused", "frames refused", status.refused;
    "received", "frames received", status.received.received;
    "malformed", "frames that were no feedback", status.received.malformed;
    "unclaimed", "frames that no motor claims", status.received.unclaimed;
    "last_unclaimed", "key of the newest of those", status.received.last_unclaimed;
    "remote_requests", "remote requests", status.received.remote;
    "state", "ErrorState of the controller", status.health.state;
    "transmit_errors", "transmit error counter", status.health.transmit_errors;
    "receive_errors", "receive error counter", status.health.receive_errors;
    "receive_lost", "received frames lost", status.health.receive_lost;
    "transmit_lost", "frames that never left", status.health.transmit_lost;
    "ignored", "received frames that were not asked for", status.health.ignored;
    "bus_offs", "times the controller went off", status.health.bus_offs;
    "restrictions", "times it was found unable to send", status.health.restrictions;
    "stalls", "times its motors were made safe because it stood still", status.health.stalls;
    "planned_frames", "frames a second that its motors need", status.load.frames_per_second;
    "planned_least", "load by its motors without stuff bits, percent", status.load.least;
    "planned_typical", "load by its motors typically, percent", status.load.typical;
    "planned_worst", "load by its motors at worst, percent", status.load.worst;
} + &timing!(BusLook, status.period: "periods", "period_min", "period_max", "period_sum"),
    &timing!(BusLook, status.execution: "executions", "execution_min", "execution_max", "execution_sum")
);

fields!(LINE: Rs485Status {
    "ticks", "ticks of its task", ticks;
    "overruns", "ticks that did not happen", overruns;
    "port_errors", "times its UART could not read or write", port_errors;
    "exchanges", "commands with a reply", traffic.exchanges;
    "timeouts", "commands without a whole reply in time", traffic.timeouts;
    "crc_errors", "replies with a wrong CRC", traffic.crc_errors;
    "garbage", "bytes that were no reply", traffic.garbage;
    "unexpected", "replies of a motor that was not polled", traffic.unexpected;
} + &timing!(Rs485Status, period: "periods", "period_min", "period_max", "period_sum"),
    &timing!(Rs485Status, traffic.exchange: "exchange_count", "exchange_min", "exchange_max", "exchange_sum"),
    &timing!(Rs485Status, traffic.cycle: "cycles", "cycle_min", "cycle_max", "cycle_sum")
);

fields!(PART: Counters {
    "frames", "good frames", frames;
    "damaged", "frames whose contents were not sound", damaged;
    "skipped", "bytes that belonged to no good frame", skipped;
    "port_errors", "times that its UART lost or damaged bytes", port_errors;
});

fields!(REMOTE: RemoteLook {
    "is_live", "1 if the receiver's frames come from the remote", sample.is_live;
    "arm", "ArmState, if the robot tells it", sample.arm;
    "frames_sent", "frames that the receiver sent", sent.frames;
    "live_frames_sent", "those that came from the remote", sent.live;
    "is_told", "1 if the robot tells what it heard", is_told;
    "frames", "good frames that the robot heard", heard.frames;
    "damaged", "damaged frames that it heard", heard.damaged;
    "skipped", "bytes that it skipped", heard.skipped;
    "port_errors", "times that its UART lost or damaged bytes", heard.port_errors;
});

fields!(LOSS: Loss {
    "from", "the transmitter went off, s", lost.from;
    "until", "it came on again, s; NaN: never", lost.until;
    "last_frame", "the last good frame had ended, s", last_frame;
    "coasting", "every motor that may not hold had let go, s", coasting;
    "back", "the first good frame had ended, s", back;
    "resumed", "motors were driven again, s", resumed;
    "disarmed", "the robot was disarmed, s", disarmed;
});

fields!(ROBOT: RobotLook {
    "arm", "ArmState, if it is known", arm;
    "x", "place of the simulated base, m", pose.x;
    "y", "the same to the left, m", pose.y;
    "yaw", "the way it looks, rad counter-clockwise", pose.yaw;
    "imu_yaw", "the same by its IMU, degrees", yaw;
});

#[cfg(test)]
mod tests {
    use rc10_can::Micros;

    use super::*;
    use crate::robot::remote::Lost;

    /// Each field of a table is put back where it is taken from, and nowhere else.
    fn assert_sound<T>(table: &[&[Field<T>]], mut it: T) {
        let fields: Vec<_> = table.iter().copied().flatten().collect();
        let is_state = |field: &Field<T>| {
            STATES.iter().any(|(state, _)| field.about.starts_with(state))
                || field.name.starts_with("is_")
        };
        let value = |(at, field): (usize, &&Field<T>)| {
            if is_state(field) { 1.0 } else { (at + 2) as f64 }
        };
        let values: Vec<f64> = fields.iter().enumerate().map(value).collect();
        for (field, value) in fields.iter().zip(&values) {
            (field.set)(&mut it, *value);
        }
        for (field, value) in fields.iter().zip(&values) {
            let found = (field.get)(&it);
            assert!((found - value).abs() < 1e-9, "{}: {found} is not {value}", field.name);
        }
        let mut names: Vec<_> = fields.iter().map(|field| field.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), fields.len());
    }

    #[test]
    fn every_field_is_put_back_where_it_was() {
        assert_sound(MOTOR, MotorLook::NEW);
        assert_sound(MOTOR_HEALTH, MotorLook::NEW);
        assert_sound(BUS, BusLook::default());
        assert_sound(LINE, Rs485Status::default());
        assert_sound(PART, Counters::default());
        assert_sound(REMOTE, RemoteLook::default());
        assert_sound(LOSS, Loss::new(Lost { from: Micros::ZERO, until: None }));
        assert_sound(ROBOT, RobotLook::default());
    }

    #[test]
    fn what_there_is_not_stays_none() {
        assert_eq!(Option::<u32>::of(Option::<u32>::None.number()), None);
        assert_eq!(Option::<ArmState>::of(f64::NAN), None);
        assert_eq!(Option::<ArmState>::of(3.0), Some(ArmState::EStopped));
        for kind in [TargetKind::Handbrake, TargetKind::Motion, TargetKind::SpeedMotion] {
            assert_eq!(TargetKind::of(kind.number()), kind);
        }
        assert_eq!(Micros::of(Micros::new(3_600_000_001).number()), Micros::new(3_600_000_001));
    }
}
