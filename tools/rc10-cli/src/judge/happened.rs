//! The events of a real robot, from its recording: it follows no script that would name them.

use rc10_motor::{ArmState, Link};
use rc10_time::Micros;

use crate::recording::Recording;
use crate::recording::sample::time_of;

/// Events in words, in the order of time.
pub fn happened(recording: &Recording) -> Vec<(Micros, String)> {
    let mut found = Vec::new();
    changes(&recording.arm, |at, arm| {
        let what = match arm {
            ArmState::Armed => "armed",
            ArmState::Disarmed => "disarmed",
            ArmState::Suspended => "suspended",
            ArmState::EStopped => "emergency stop",
        };
        found.push((at, what.to_owned()));
    });
    for track in &recording.motors {
        let links: Vec<Link> = track.samples.iter().map(|sample| sample.link).collect();
        let mut was_lost = false;
        changes(&links, |at, link| {
            let what = match link {
                Link::Lost => "lost",
                Link::Online if was_lost => "back",
                Link::Online | Link::NeverSeen => "heard",
            };
            was_lost |= link == Link::Lost;
            found.push((at, format!("{} {what}", track.motor.label)));
        });
    }
    for track in &recording.buses {
        let offs: Vec<u32> = track.samples.iter().map(|sample| sample.bus_offs).collect();
        changes(&offs, |at, _| found.push((at, format!("bus {} off", track.number))));
    }
    found.extend(recording.marks.iter().cloned());
    found.extend(recording.gaps.iter().map(|gap| (gap.at, gap.to_string())));
    found.sort_by_key(|(at, _)| *at);
    found
}

/// Calls `tell` where a sample differs from the one before.
fn changes<T: Copy + PartialEq>(samples: &[T], mut tell: impl FnMut(Micros, T)) {
    for (index, pair) in samples.windows(2).enumerate() {
        if pair[0] != pair[1] {
            tell(time_of(index + 1), pair[1]);
        }
    }
}
