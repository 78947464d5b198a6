//! The robot does what hands tell it.

use rc10_cli::judge::problems;
use rc10_cli::recording::problem::any;
use rc10_cli::run::simulate::simulate;
use rc10_motor::{Link, Names as _};
use rc10_time::Micros;
use starter::table::Name;
use starter::{Motors, Ports, Shared, simulation};

#[test]
fn it_drives_forward_and_has_no_problems() {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = simulation::robot(&shared, &mut motors).unwrap();
    let run = simulate(robot, 1, Micros::from_millis(5000)).unwrap();
    assert!(run.motors.iter().all(|track| track.last.link == Link::Online));
    let found = problems(&run);
    assert!(!any(&found), "{found:?}");
    // A sample is 10 ms: forward at the end of the first second.
    let path = run.base.unwrap().path;
    assert!(path[119].x > 0.5 && path[119].y.abs() < 0.05, "{:?}", path[119]);
    // 3.0 s: the feeder turns.
    let feeder = run.motors[Name::Feeder.index()].samples[299].rpm;
    assert!((feeder - 200.0).abs() < 10.0, "{feeder} rpm");
}
