//! Tables of the simulated world's values in a record, like the robot's own in [`mod@seen`].

use std::ops::Range;

use rc10_motor::MotorStatus;
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_tasks::seen;
use rc10_tasks::seen::{OFTEN, Seen, Whole};

use crate::recording::look::{BusLook, RemoteLook, RobotLook, Shaft};
use crate::recording::remote::Loss;

/// Indices of the values of a motor that are written every millisecond.
pub const MOTOR: Range<usize> = 0..OFTEN;
/// Indices of the other values of a motor.
pub const MOTOR_HEALTH: Range<usize> = OFTEN..MotorStatus::FIELDS.len();

seen!(Shaft {
    shaft_speed: "rpm", "speed of the simulated shaft" => .rpm;
    winding_current: "A", "current in the simulated winding" => .current;
    overwritten: "frames", "feedback frames overwritten in the ESC" => .overwritten;
});

seen!(BusLook {
    frames: "frames", "frames on the wire" => .frames;
    load: "%", "busy share of the wire since power-on" => .load;
});

seen!(RemoteLook {
    is_live: "", "1 if the receiver's frames come from the remote" => .sample.is_live;
    arm: "", "whether the robot is armed, if it tells" => .sample.arm;
    frames_sent: "frames", "frames that the receiver sent" => .sent.frames;
    live_frames_sent: "frames", "those that came from the remote" => .sent.live;
    is_told: "", "1 if the robot tells what it heard" => .is_told;
    frames: "frames", "good frames that the robot heard" => .heard.frames;
    damaged: "frames", "damaged frames that it heard" => .heard.damaged;
    skipped: "bytes", "bytes that it skipped" => .heard.skipped;
    port_errors: "times", "times that its UART lost or damaged bytes" => .heard.port_errors;
});

seen!(Loss {
    from: "s", "the transmitter went off" => .lost.from;
    until: "s", "it came on again; NaN: never" => .lost.until;
    last_frame: "s", "the last good frame had ended" => .last_frame;
    coasting: "s", "every motor that may not hold had let go" => .coasting;
    back: "s", "the first good frame had ended" => .back;
    resumed: "s", "motors were driven again" => .resumed;
    disarmed: "s", "the robot was disarmed" => .disarmed;
});

seen!(RobotLook {
    x: "m", "place of the simulated base" => .pose.x;
    y: "m", "the same to the left" => .pose.y;
    yaw: "rad", "the way it looks, counter-clockwise" => .pose.yaw;
    imu_yaw: "deg", "the same by its IMU" => .yaw;
});

/// A message of one number.
#[derive(Clone, Copy, Debug, Default)]
pub struct Single {
    /// The number; NaN without a value.
    pub value: f64,
}

seen!(Single {
    value: "", "NaN without a value" => .value;
});

/// The line of a schema for a number: name, unit, description, and the numbers of states.
pub(crate) fn line<'s>(
    name: &str,
    about: &str,
    unit: &str,
    states: impl Iterator<Item = &'s str>,
) -> String {
    let states: Vec<_> = states.enumerate().map(|(at, state)| format!("{at} {state}")).collect();
    let notes = [about, unit, &states.join(", ")];
    let notes: Vec<_> = notes.into_iter().filter(|note| !note.is_empty()).collect();
    format!("float64 {name}  # {}\n", notes.join("; "))
}

/// The description of a number in this folder of topics.
pub(crate) fn about(folder: &str, name: &str) -> &'static str {
    fn of<T: Seen>(name: &str) -> Option<&'static str> {
        place::<T>(name).map(|at| T::ABOUT[at])
    }
    let found = match folder {
        "motors" => of::<MotorStatus>(name),
        "buses" => of::<BusStatus>(name),
        "lines" => of::<Rs485Status>(name),
        "robot" => of::<Whole>(name),
        _ => of::<Single>(name),
    };
    found.unwrap_or_default()
}

pub(crate) fn schema<T: Seen>(range: Range<usize>) -> String {
    let one = |at: usize| {
        let field = &T::FIELDS[at];
        let (unit, states) = field.unit_and_states();
        line(field.name, T::ABOUT[at], unit, states.split(',').filter(|state| !state.is_empty()))
    };
    range.map(one).collect()
}

/// The index of a value in the table of a type.
pub(crate) fn place<T: Seen>(name: &str) -> Option<usize> {
    T::FIELDS.iter().position(|field| field.name == name)
}

/// A thing whose numbers have names.
pub(crate) trait Named {
    /// Puts a number back; one of a newer writer, with another name, is ignored.
    fn put_named(&mut self, name: &str, number: f64);
    /// Whether a number counts since power-on.
    fn counts(&self, name: &str) -> bool;
}

impl<T: Seen> Named for T {
    fn put_named(&mut self, name: &str, number: f64) {
        if let Some(at) = place::<T>(name) {
            self.put(at, number);
        }
    }

    fn counts(&self, name: &str) -> bool {
        place::<T>(name).is_some_and(|at| T::COUNTS[at])
    }
}

#[cfg(test)]
mod tests {
    use rc10_module::Counters;
    use rc10_motor::{ArmState, TargetKind};
    use rc10_tasks::seen::Value;
    use rc10_time::Micros;

    use super::*;
    use crate::recording::look::MotorLook;
    use crate::robot::remote::Lost;

    /// Each number of a table is put back where it is taken from, and nowhere else.
    fn assert_sound<T: Seen>(mut it: T) {
        let is_state = |at: usize| {
            let field = &T::FIELDS[at];
            !field.unit_and_states().1.is_empty() || field.name.starts_with("is_")
        };
        let value = |at: usize| if is_state(at) { 1.0 } else { (at + 2) as f64 };
        let all = 0..T::FIELDS.len();
        all.clone().for_each(|at| it.put(at, value(at)));
        for at in all {
            let (name, found, short) = (T::FIELDS[at].name, it.exact(at), it.short(at));
            assert!((found - value(at)).abs() < 1e-9, "{name}: {found} is not {}", value(at));
            assert!((f64::from(short) - found).abs() < 1e-6, "{name}: a link tells {short}");
        }
        let mut names: Vec<_> = T::FIELDS.iter().map(|field| field.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), T::FIELDS.len());
        assert_eq!([T::ABOUT.len(), T::COUNTS.len()], [T::FIELDS.len(); 2]);
    }

    #[test]
    fn every_number_is_put_back_where_it_was() {
        assert_sound(MotorLook::NEW);
        assert_sound(Shaft::default());
        assert_sound(BusStatus::default());
        assert_sound(BusLook::default());
        assert_sound(Rs485Status::default());
        assert_sound(Counters::default());
        assert_sound(RemoteLook::default());
        assert_sound(Loss::new(Lost { from: Micros::ZERO, until: None }));
        assert_sound(RobotLook::default());
        assert_sound(Whole::default());
        assert_sound(Single::default());
    }

    #[test]
    fn what_there_is_not_stays_none() {
        assert_eq!(Option::<u32>::of(Option::<u32>::None.exact()), None);
        assert_eq!(Option::<ArmState>::of(f64::NAN), None);
        assert_eq!(Option::<ArmState>::of(3.0), Some(ArmState::EStopped));
        for kind in TargetKind::ALL {
            assert_eq!(TargetKind::of(kind.exact()), *kind);
        }
        assert_eq!(Micros::of(Micros::new(3_600_000_001).exact()), Micros::new(3_600_000_001));
    }

    #[test]
    fn a_schema_says_which_number_is_which_state() {
        let schema = schema::<MotorLook>(MOTOR);
        assert_eq!(schema.lines().count(), OFTEN);
        let line = "float64 link  # whether it is heard; 0 NeverSeen, 1 Online, 2 Lost";
        assert!(schema.lines().any(|one| one == line), "{schema}");
    }
}
