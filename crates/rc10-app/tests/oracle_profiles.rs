//! Profiles against those of ruckig, an implementation of its own in f64
//! (`tests/golden/profiles.py`).

use rc10_app::{Profile, ProfileLimits, Seconds, Setpoint};

const GOLDEN: &str = include_str!("golden/profiles.csv");

#[test]
fn durations_and_setpoints_are_those_of_ruckig() {
    // As shares of velocity limit times duration, of the velocity limit, of the acceleration limit.
    // An acceleration that crosses 0 at full jerk turns microseconds into its error.
    const TOLERANCE: [f32; 3] = [2e-6, 1e-5, 1e-4];
    let mut kinds = Vec::new();
    for line in GOLDEN.lines().skip(1) {
        let (kind, numbers) = line.split_once(',').unwrap();
        let numbers: Vec<f32> = numbers.split(',').map(|number| number.parse().unwrap()).collect();
        let [max_velocity, max_acceleration, jerk, velocity, acceleration, way, to, duration] =
            numbers[..8].try_into().unwrap();
        let limits = ProfileLimits { velocity: max_velocity, acceleration: max_acceleration, jerk };
        let mut profile =
            Profile::from_setpoint(Setpoint { position: 0.0, velocity, acceleration });
        match kind {
            "velocity" => profile.set_velocity(&limits, to).unwrap(),
            "moving" => profile.follow(&limits, way, to).unwrap(),
            _ => profile.set_target(&limits, way, to).unwrap(),
        }
        let late = profile.remaining().get() / duration - 1.0;
        assert!((-2e-6..3e-4).contains(&late), "{late} later: {line}");
        for (quarter, sample) in [0.25, 0.5, 0.75].into_iter().zip(numbers[8..].chunks(3)) {
            let mut at = profile;
            let setpoint = at.update(Seconds::new(duration * quarter));
            let off = [
                (setpoint.position - sample[0]).abs() / (max_velocity * duration),
                (setpoint.velocity - sample[1]).abs() / max_velocity,
                (setpoint.acceleration - sample[2]).abs() / max_acceleration,
            ];
            let is_near = off.iter().zip(TOLERANCE).all(|(off, tolerance)| *off <= tolerance);
            assert!(is_near, "{off:?} at {quarter}: {line}");
        }
        kinds.push(kind);
    }
    for (kind, count) in
        [("rest", 150), ("state", 350), ("through", 250), ("moving", 200), ("velocity", 100)]
    {
        assert_eq!(kinds.iter().filter(|other| **other == kind).count(), count, "{kind}");
    }
}
