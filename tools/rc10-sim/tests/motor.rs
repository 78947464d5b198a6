//! Physics: friction that holds, speed that ends where the supply ends, angles that stay exact.
#![expect(clippy::float_cmp, clippy::unwrap_used, reason = "a test may panic, and exact is meant")]

use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, CanPort};
use rc10_sim::{BusConfig, Esc, EscConfig, EscState, Model, Plant, Scale, World};
use rc10_time::Micros;

struct Bench {
    world: World,
    esc: Esc,
}

/// One motor of id 1 that gets one command.
fn bench(model: Model, plant: Plant, raw: i16) -> Bench {
    let mut world = World::new(2);
    let bus = world.add_bus(BusConfig::default());
    let config = EscConfig { plant, ..EscConfig::new(model, 1) };
    let esc = bus.add_esc(config).unwrap();
    let id = match model {
        Model::C620 | Model::C610 => 0x200,
        Model::Gm6020Voltage => 0x1FF,
        Model::Gm6020Current => 0x1FE,
    };
    let [high, low] = raw.to_be_bytes();
    let data = [high, low, 0, 0, 0, 0, 0, 0];
    let frame = CanFrame::eight_bytes(StandardId::new(id).unwrap(), data);
    let _ = bus.port().submit(&frame);
    Bench { world, esc }
}

fn after(model: Model, raw: i16, millis: u64) -> EscState {
    let mut bench = bench(model, model.plant(), raw);
    bench.world.advance(Micros::from_millis(millis));
    bench.esc.state()
}

#[test]
fn a_shaft_within_its_static_friction_stands_exactly_still() {
    // 0.13 N·m / 0.3 N·m/A = 0.433 A = raw 355.
    let held = after(Model::C620, 345, 500);
    assert_eq!((held.rotor_rpm, held.output_degrees), (0.0, 0.0));
    let free = after(Model::C620, 365, 500);
    assert!(free.output_degrees > 1.0, "{free:?}");
}

#[test]
fn friction_stops_a_coasting_shaft_for_good() {
    let mut bench = bench(Model::C620, Plant::m3508(), 2000);
    bench.world.advance(Micros::from_millis(200));
    bench.esc.set_power(false);
    bench.world.advance(Micros::from_millis(10_000));
    let stopped = bench.esc.state();
    assert_eq!(stopped.rotor_rpm, 0.0);
    assert!(stopped.output_degrees > 10.0);
    bench.world.advance(Micros::from_millis(11_000));
    assert_eq!(bench.esc.state().output_degrees, stopped.output_degrees);
}

#[test]
fn a_weight_falls_when_it_is_heavier_than_friction() {
    let lift = |torque| {
        let mut bench = bench(Model::C620, Plant::m3508().with_load_inertia(0.02), 0);
        bench.esc.set_load(torque);
        bench.world.advance(Micros::from_millis(500));
        bench.esc.state().output_degrees
    };
    assert_eq!(lift(-0.12), 0.0);
    // 0.4 N·m of weight less 0.1 of friction on 0.0237 kg·m², for half a second, with a little
    // viscous drag: just under 0.5 · 12.7 · 0.25 rad.
    let fallen = lift(-0.4);
    assert!((-91.0..-85.0).contains(&fallen), "{fallen}");
}

#[test]
fn a_hard_stop_holds_a_weight_and_lets_it_go() {
    let mut bench = bench(Model::C620, Plant::m3508().with_load_inertia(0.02), 0);
    bench.esc.set_travel(Some([0.0, 90.0]));
    let pull = |bench: &mut Bench, torque, until| {
        bench.esc.set_load(torque);
        bench.world.advance(Micros::from_millis(until));
        bench.esc.state()
    };
    let on_the_floor = pull(&mut bench, -2.0, 1000);
    assert_eq!((on_the_floor.output_degrees, on_the_floor.output_rpm), (0.0, 0.0));
    let at_the_top = pull(&mut bench, 2.0, 2000);
    assert!((at_the_top.output_degrees - 90.0).abs() < 1e-9 && at_the_top.output_rpm == 0.0);
    let between = pull(&mut bench, -0.5, 2200);
    assert!((1.0..89.0).contains(&between.output_degrees), "{between:?}");
    assert_eq!(pull(&mut bench, -0.5, 4000).output_degrees, 0.0);
}

#[test]
fn no_load_speeds_are_the_published_ones() {
    for (model, raw, rotor_rpm) in [
        (Model::C620, 16_384, 9250.0),
        (Model::C620, -16_384, -9250.0),
        (Model::C610, 10_000, 18_000.0),
        (Model::Gm6020Voltage, 25_000, 320.0),
        (Model::Gm6020Current, 16_384, 320.0),
    ] {
        let speed = after(model, raw, 5000).rotor_rpm;
        let tolerance: f64 = if model.last_id() == 7 { 0.05 } else { 0.005 };
        assert!((speed / rotor_rpm - 1.0).abs() < tolerance, "{model:?} {speed}");
    }
}

#[test]
fn half_the_voltage_gives_half_the_speed_and_half_the_current_does_not() {
    let full = after(Model::Gm6020Voltage, 25_000, 5000).rotor_rpm;
    let half = after(Model::Gm6020Voltage, 12_500, 5000).rotor_rpm;
    assert!((half / full - 0.5).abs() < 0.02, "{half} {full}");
    let full = after(Model::C620, 16_384, 5000).rotor_rpm;
    let half = after(Model::C620, 8192, 5000).rotor_rpm;
    assert!((half / full - 1.0).abs() < 0.01, "{half} {full}");
}

#[test]
fn the_current_follows_within_its_time_constant() {
    let mut bench = bench(Model::C620, Plant::m3508(), 4096);
    // The command has arrived after its 1xx µs; then 1 ms is one time constant.
    let arrived = loop {
        let next = bench.world.now() + Micros::new(1);
        bench.world.advance(next);
        if let Some(at) = bench.esc.state().last_command_at {
            break at;
        }
    };
    let grid = arrived.get().next_multiple_of(100);
    bench.world.advance(Micros::new(grid + 900));
    let current = bench.esc.state().current;
    let steps = f64::from(if arrived.get() == grid { 9 } else { 10 });
    assert!((current - 5.0 * (1.0 - (-steps / 10.0).exp())).abs() < 1e-9, "{current}");
}

#[test]
fn scaling_scales() {
    let speed = |by| {
        let mut bench = bench(Model::C620, Plant::m3508().scaled(by), 4096);
        bench.world.advance(Micros::from_millis(30));
        bench.esc.state().rotor_rpm
    };
    let one = Scale::default();
    let nominal = speed(one);
    assert!(speed(Scale { inertia: 1.3, ..one }) < 0.8 * nominal);
    assert!(speed(Scale { inertia: 0.7, ..one }) > 1.3 * nominal);
    assert!(speed(Scale { friction: 1.3, ..one }) < 0.99 * nominal);
    assert!(speed(Scale { torque_constant: 1.3, ..one }) > 1.25 * nominal);
}

#[test]
fn work_makes_the_motor_warm() {
    let mut bench = bench(Model::C620, Plant { static_friction: 100.0, ..Plant::m3508() }, 8192);
    bench.world.advance(Micros::from_millis(300_000));
    // One time constant at 10 A: 63 % of 2.5 °C/W · 19.4 W above 25 °C.
    let temperature = bench.esc.state().temperature;
    assert!((temperature - (25.0 + 48.5 * 0.632)).abs() < 0.5, "{temperature}");
}

#[test]
fn ten_minutes_at_full_speed_lose_no_angle() {
    let mut bench = bench(Model::C610, Plant::m2006(), 10_000);
    bench.world.advance(Micros::from_millis(5000));
    let early = bench.esc.state();
    bench.world.advance(Micros::from_millis(605_000));
    let late = bench.esc.state();
    // Constant speed by then: the angle is speed times time, to a thousandth of a degree in three
    // hundred thousand turns.
    assert_eq!(early.output_rpm, late.output_rpm);
    let expected = late.output_rpm * 6.0 * 600.0;
    let travelled = late.output_degrees - early.output_degrees;
    assert!((travelled - expected).abs() < 1e-3, "{travelled} {expected}");
}
