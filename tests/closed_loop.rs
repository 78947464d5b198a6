//! The shipped gains against simulated motors that are not quite what the data sheet says.

use crate::common::{Bench, motor, twin};
use rc10_app::{Amps, Degrees, Gear, Rpm, TotalAngle};
use rc10_motor::dji::{self, Dji, Model};
use rc10_motor::{ArmSwitch, Safety, Target};
use rc10_sim::{EscConfig, Scale};

/// Response to a step of the target.
#[derive(Debug)]
struct Response {
    /// Beyond the target, in parts of the step.
    overshoot: f64,
    /// From the step until it stays within the band around its goal, in milliseconds.
    settled: Option<usize>,
}

/// Arms, lets the motor be heard, gives it `target` for `millis`; the simulated shaft's `measure`
/// must go from where it is then to `goal`.
fn respond(
    bench: &mut Bench<'_>,
    id: rc10_motor::MotorId,
    target: Target,
    goal: f64,
    (millis, band): (usize, f64),
    measure: impl Fn() -> f64,
) -> Response {
    let start = measure();
    let step = goal - start;
    let progress: Vec<f64> = (0..millis)
        .map(|_| {
            bench.hold(id, target, 1);
            (measure() - start) / step
        })
        .collect();
    let overshoot = progress.iter().fold(0.0_f64, |most, progress| most.max(progress - 1.0));
    let last_outside = progress.iter().rposition(|progress| ((progress - 1.0) * step).abs() > band);
    let settled = match last_outside {
        None => Some(0),
        Some(last) if last + 1 < millis => Some(last + 1),
        Some(_) => None,
    };
    Response { overshoot, settled }
}

/// Usual load of a motor: kg m² at its output shaft.
fn load(model: &Model) -> f64 {
    if let Ok(x) = std::env::var("LOAD") {
        return x.parse().unwrap();
    }
    match model.name {
        // A quarter of a 20 kg robot on a wheel of 76 mm.
        name if name == dji::M3508.name => 0.029,
        name if name == dji::M2006.name => 0.002,
        // A gimbal.
        _ => 0.01,
    }
}

fn loaded(model: &Model, scale: Scale) -> EscConfig {
    let mut device = twin(model, 1);
    device.plant = device.plant.with_load_inertia(load(model)).scaled(scale);
    device
}

fn speed_step(model: &'static Model, seed: u64, scale: Scale, rpm: f32) -> Response {
    let switch = ArmSwitch::new();
    let mut ours = motor(model, 1);
    let mut bench = Bench::new(seed, &switch);
    let (id, esc) = bench.add(&mut ours, Safety::COAST, loaded(model, scale));
    switch.arm().unwrap();
    bench.hold(id, Target::Speed(Rpm::ZERO), 50);
    let target = Target::Speed(Rpm::new(rpm));
    // 2 %, but no finer than the feedback: whole rotor rpm, which a GM6020 has no gear to divide.
    let resolution = 1.2 / f64::from(model.gear.ratio());
    let band = (0.02 * f64::from(rpm)).max(resolution);
    respond(&mut bench, id, target, rpm.into(), (1500, band), || esc.state().output_rpm)
}

fn angle_step(model: &'static Model, seed: u64, scale: Scale, degrees: f32) -> Response {
    let switch = ArmSwitch::new();
    let mut ours = motor(model, 1);
    let mut bench = Bench::new(seed, &switch);
    let (id, esc) = bench.add(&mut ours, Safety::COAST, loaded(model, scale));
    switch.arm().unwrap();
    bench.hold(id, Target::Coast, 50);
    let start = bench.status(id).feedback.total_angle;
    let target = start.plus(TotalAngle::try_from_degrees(Degrees::new(degrees)).unwrap());
    let from = esc.state().output_degrees;
    let goal = from + f64::from(degrees);
    let measure = || esc.state().output_degrees;
    let band = (0.02 * f64::from(degrees)).max(0.5);
    respond(&mut bench, id, Target::TotalAngle(target), goal, (2500, band), measure)
}

const MODELS: [&Model; 4] = [&dji::M3508, &dji::M2006, &dji::GM6020_CURRENT, &dji::GM6020_VOLTAGE];

/// Speeds for steps: small, usual, near the end of what the motor does.
fn speeds(model: &Model) -> [f32; 3] {
    if model.gear.ratio() > 1.0 { [30.0, 100.0, 300.0] } else { [20.0, 60.0, 120.0] }
}

#[test]
fn wheels_reach_a_speed_within_half_a_second_and_hardly_overshoot() {
    for rpm in speeds(&dji::M3508) {
        let response = speed_step(&dji::M3508, 1, Scale::default(), rpm);
        assert!(response.overshoot <= 0.10, "{rpm} rpm: {response:?}");
        assert!(response.settled.is_some_and(|millis| millis <= 500), "{rpm} rpm: {response:?}");
    }
}

#[test]
fn every_motor_reaches_speeds_and_angles_with_the_shipped_gains() {
    for model in MODELS {
        for rpm in speeds(model) {
            let response = speed_step(model, 1, Scale::default(), rpm);
            let settled = response.settled.is_some_and(|millis| millis <= 700);
            assert!(settled && response.overshoot < 0.10, "{} {rpm} rpm: {response:?}", model.name);
        }
        for degrees in [5.0, 90.0, 720.0] {
            let response = angle_step(model, 1, Scale::default(), degrees);
            let settled = response.settled.is_some_and(|millis| millis <= 1500);
            let good = settled && response.overshoot < 0.05;
            assert!(good, "{} {degrees} deg: {response:?}", model.name);
        }
    }
}

/// A hundred motors, each off by up to 30 % in inertia, friction and torque constant, each with its
/// own feedback phase and rotor angle.
#[test]
fn a_hundred_motors_that_are_not_like_the_data_sheet() {
    for seed in 0..100_u32 {
        let part = |step: u32| 0.7 + f64::from(seed * step % 61) * 0.01;
        let scale = Scale { inertia: part(7), friction: part(23), torque_constant: part(41) };
        let model = MODELS[seed as usize % 4];
        let rpm = speeds(model)[seed as usize / 4 % 3];
        let response = speed_step(model, seed.into(), scale, rpm);
        let what = format!("{} seed {seed} {scale:?}", model.name);
        assert!(response.settled.is_some(), "{what} {rpm} rpm: {response:?}");
        assert!(response.overshoot < 0.20, "{what} {rpm} rpm: {response:?}");
        let degrees = [10.0, 90.0, 720.0][seed as usize / 4 % 3];
        let response = angle_step(model, seed.into(), scale, degrees);
        assert!(response.settled.is_some(), "{what} {degrees} deg: {response:?}");
        assert!(response.overshoot < 0.15, "{what} {degrees} deg: {response:?}");
    }
}

#[test]
fn from_350_to_10_degrees_goes_20_forward() {
    for model in MODELS {
        let switch = ArmSwitch::new();
        let mut ours = motor(model, 1);
        let mut bench = Bench::new(3, &switch);
        let (id, esc) = bench.add(&mut ours, Safety::COAST, loaded(model, Scale::default()));
        switch.arm().unwrap();
        bench.hold(id, Target::Angle(Degrees::new(350.0)), 3000);
        let start = esc.state().output_degrees;
        assert!((bench.status(id).feedback.angle.get() - 350.0).abs() < 0.5, "{}", model.name);
        let mut furthest_back = 0.0_f64;
        for _ in 0..2000 {
            bench.hold(id, Target::Angle(Degrees::new(10.0)), 1);
            furthest_back = furthest_back.min(esc.state().output_degrees - start);
        }
        let moved = esc.state().output_degrees - start;
        assert!((moved - 20.0).abs() < 1.0, "{}: moved {moved}", model.name);
        assert!(furthest_back > -1.0, "{}: went back {furthest_back}", model.name);
    }
}

/// Compares our side's feedback with the simulated device: `Err` where they differ by more
/// than the sampling of a moving motor explains. The device decodes and encodes with code of its
/// own.
fn agrees(model: &'static Model, gear_of: &'static Model) -> Result<(), String> {
    let switch = ArmSwitch::new();
    let mut ours = Dji::new(dji::Config::new(model, 1)).unwrap();
    let mut bench = Bench::new(5, &switch);
    let mut device = twin(gear_of, 1);
    device.plant = device.plant.with_load_inertia(load(gear_of));
    let (id, esc) = bench.add(&mut ours, Safety::COAST, device);
    switch.arm().unwrap();
    let check = |what: &str, ours: f64, theirs: f64, tolerance: f64| {
        if (ours - theirs).abs() <= tolerance {
            Ok(())
        } else {
            Err(format!("{what}: {ours}, in truth {theirs}"))
        }
    };
    if let dji::Effort::Current(full) = model.effort {
        let amps = full * 0.4;
        bench.hold(id, Target::Current(Amps::new(amps)), 60);
        let one_percent = 0.01 * f64::from(amps);
        check("current commanded", amps.into(), esc.state().current, one_percent)?;
        let told = bench.status(id).feedback.current().unwrap().get();
        check("current reported", told.into(), esc.state().current, one_percent)?;
    }
    bench.hold(id, Target::Speed(Rpm::new(50.0)), 1200);
    let feedback = bench.status(id).feedback;
    check("speed", feedback.speed.get().into(), esc.state().output_rpm, 1.2)?;
    let degrees = |angle: TotalAngle| angle.microdegrees() as f64 * 1e-6;
    let (before, truth) = (degrees(feedback.total_angle), esc.state().output_degrees);
    bench.hold(id, Target::Speed(Rpm::new(50.0)), 1000);
    let moved = degrees(bench.status(id).feedback.total_angle) - before;
    // One part in 600.
    check("angle", moved, esc.state().output_degrees - truth, 0.5)
}

#[test]
fn both_sides_of_the_wire_mean_the_same() {
    for model in MODELS {
        agrees(model, model).unwrap();
    }
}

/// The test above is worth something: each scale error in our tables turns it red.
#[test]
fn a_scale_error_on_our_side_does_not_cancel_itself_out() {
    const FULL_SCALE: Model = Model { full_scale: 16000, ..dji::M3508 };
    const CURRENT: Model = Model { amps_per_count: 20.0 / 16000.0, ..dji::M3508 };
    const GEAR: Model = Model {
        gear: match Gear::new(3600, 187) {
            Some(gear) => gear,
            None => panic!(),
        },
        ..dji::M3508
    };
    for (wrong, what) in
        [(&FULL_SCALE, "current commanded"), (&CURRENT, "current reported"), (&GEAR, "angle")]
    {
        let complaint = agrees(wrong, &dji::M3508).unwrap_err();
        assert!(complaint.starts_with(what), "{complaint}");
    }
}
