//! Servos: pulses of angles, and what they get from a robot that is not armed.

use rc10_module::rc10_app::Degrees;
use rc10_module::servo::{Config, Servo, WhenDisarmed};

const fn config(when_disarmed: WhenDisarmed) -> Config {
    // Mounted the other way round.
    let ends = [(Degrees::new(-30.0), 2200), (Degrees::new(90.0), 800)];
    Config { ends, when_disarmed }
}

#[test]
fn an_angle_is_a_pulse_and_the_ends_are_kept() {
    let config = config(WhenDisarmed::Hold);
    let pulse = |angle| config.pulse(Degrees::new(angle));
    for (angle, micros) in [(-30.0, 2200), (90.0, 800), (30.0, 1500), (1e9, 800), (-31.0, 2200)] {
        assert_eq!(pulse(angle), Some(micros), "{angle}");
    }
    assert_eq!([pulse(f32::NAN), pulse(f32::INFINITY)], [None; 2]);
}

#[test]
fn it_gets_no_pulse_before_it_is_told() {
    for when in [WhenDisarmed::Hold, WhenDisarmed::NoPulse] {
        let wire = rc10_sim::Servo::default();
        let mut servo = Servo::new(wire.clone(), config(when)).unwrap();
        assert_eq!(wire.pulse(), None);
        servo.drive(Some(Degrees::new(30.0)), false);
        assert_eq!(wire.pulse(), None, "{when:?}");
        servo.drive(Some(Degrees::new(30.0)), true);
        assert_eq!(wire.pulse(), Some(1500.0));
        servo.drive(Some(Degrees::new(f32::NAN)), true);
        assert_eq!(wire.pulse(), Some(1500.0));
    }
}

#[test]
fn disarmed_it_holds_or_gets_no_pulse() {
    for (when, pulse) in [(WhenDisarmed::Hold, Some(1500.0)), (WhenDisarmed::NoPulse, None)] {
        let wire = rc10_sim::Servo::default();
        let mut servo = Servo::new(wire.clone(), config(when)).unwrap();
        servo.drive(Some(Degrees::new(30.0)), true);
        servo.drive(Some(Degrees::new(90.0)), false);
        assert_eq!(wire.pulse(), pulse, "{when:?}");
        servo.drive(None, true);
        assert_eq!(wire.pulse(), None);
    }
}

#[test]
fn settings_that_are_no_servos_are_refused() {
    let refused = |ends: [(f32, u16); 2]| {
        let ends = ends.map(|(angle, pulse)| (Degrees::new(angle), pulse));
        let config = Config { ends, when_disarmed: WhenDisarmed::Hold };
        Servo::new(rc10_sim::Servo::default(), config).err().map(|error| error.to_string())
    };
    assert_eq!(refused([(0.0, 500), (90.0, 2500)]), None);
    let pulse = "`ends` is 2501, but must be a pulse of 500 to 2500 us";
    assert_eq!(refused([(0.0, 500), (90.0, 2501)]).as_deref(), Some(pulse));
    let pulse = "`ends` is 499, but must be a pulse of 500 to 2500 us";
    assert_eq!(refused([(0.0, 499), (90.0, 2500)]).as_deref(), Some(pulse));
    let angle = "`ends` is 90, but must be an angle other than the first one";
    assert_eq!(refused([(90.0, 500), (90.0, 2500)]).as_deref(), Some(angle));
    assert!(refused([(f32::NAN, 500), (90.0, 2500)]).is_some());
}
