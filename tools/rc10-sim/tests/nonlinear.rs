//! Gravity, cogging and backlash, against closed forms.
#![expect(clippy::unwrap_used, clippy::cast_possible_truncation, reason = "a test may panic")]

use std::f64::consts::TAU;

use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, CanPort};
use rc10_sim::{Bus, BusConfig, Esc, EscConfig, Model, Nonlinear, Plant, World};
use rc10_time::Micros;

/// kg·m².
const LOAD: f64 = 0.02;

/// A motor without friction, and a load.
/// One with a play of so many degrees.
fn loose(backlash: f64, plant: Plant) -> Plant {
    Plant { nonlinear: Nonlinear { backlash, ..plant.nonlinear }, ..plant }
}

fn cogging(cogging_torque: f64, cogging_periods: f64) -> Plant {
    let nonlinear = Nonlinear { cogging_torque, cogging_periods, ..Nonlinear::NONE };
    Plant { nonlinear, ..frictionless() }
}

fn frictionless() -> Plant {
    Plant { viscous_friction: 0.0, coulomb_friction: 0.0, static_friction: 0.0, ..Plant::m3508() }
        .with_load_inertia(LOAD)
}

struct Bench {
    world: World,
    bus: Bus,
    esc: Esc,
}

impl Bench {
    fn new(plant: Plant) -> Self {
        let mut world = World::new(5);
        let bus = world.add_bus(BusConfig::default());
        let esc = bus.add_esc(EscConfig { plant, ..EscConfig::new(Model::C620, 1) }).unwrap();
        Self { world, bus, esc }
    }

    /// A torque of the motor, N·m, from now on.
    fn torque(&self, torque: f64) {
        let raw = (torque / 0.3 * 16_384.0 / 20.0).round() as i16;
        let [high, low] = raw.to_be_bytes();
        let data = [high, low, 0, 0, 0, 0, 0, 0];
        let frame = CanFrame::eight_bytes(StandardId::new(0x200).unwrap(), data);
        let _ = self.bus.port().submit(&frame);
    }

    fn wait(&mut self, micros: u64) {
        self.world.advance(self.world.now() + Micros::new(micros));
    }

    /// rad/s of shaft and load.
    fn speeds(&self) -> [f64; 2] {
        let state = self.esc.state();
        [state.output_rpm, state.load_rpm].map(|rpm| rpm / 60.0 * TAU)
    }

    /// How far the shaft is ahead of the load, degrees.
    fn lead(&self) -> f64 {
        let state = self.esc.state();
        state.output_degrees - state.load_degrees
    }
}

/// Reflected inertia of the rotor, kg·m².
fn rotor() -> f64 {
    1e-5 * (3591.0_f64 / 187.0).powi(2)
}

fn near(value: f64, expected: f64, share: f64) {
    assert!((value - expected).abs() <= share * expected.abs(), "{value}, not {expected}");
}

/// Arithmetic-geometric mean: the complete elliptic integral of a pendulum's period.
fn agm(mut a: f64, mut b: f64) -> f64 {
    for _ in 0..20 {
        (a, b) = (f64::midpoint(a, b), (a * b).sqrt());
    }
    a
}

/// `T = 2π √(J / m g l) / agm(1, cos(θ₀/2))`, for a swing from `θ₀` beside the lowest point.
#[test]
fn a_weight_swings_with_the_period_of_a_pendulum() {
    let weight = 2.0;
    for (beside, plant) in [
        (5.0, frictionless()),
        (90.0, frictionless()),
        (150.0, frictionless()),
        // The weight hangs behind the play: it never leaves its end.
        (90.0, loose(0.01, frictionless())),
    ] {
        let (gravity_torque, gravity_offset) = (weight, beside - 90.0);
        let nonlinear = Nonlinear { gravity_torque, gravity_offset, ..plant.nonlinear };
        let mut bench = Bench::new(Plant { nonlinear, ..plant });
        let expected = TAU * (bench.esc.plant().inertia() / weight).sqrt()
            / agm(1.0, (beside / 2.0_f64).to_radians().cos());
        // Turns round at the far end, and comes back: two times that the speed changes its sign.
        let (mut turned, mut before, mut lowest) = (0, 0.0, 0.0_f64);
        while turned < 20 {
            bench.wait(100);
            let [speed, _] = bench.speeds();
            turned += i32::from(before * speed < 0.0);
            before = if speed == 0.0 { before } else { speed };
            lowest = lowest.min(bench.esc.state().output_degrees);
        }
        let period = bench.world.now().get() as f64 * 1e-6 / 10.0;
        near(period, expected, 0.002);
        near(lowest, -2.0 * beside, 0.002);
    }
}

#[test]
fn a_weight_is_held_by_its_torque_at_its_angle() {
    let nonlinear = Nonlinear { gravity_torque: 2.0, gravity_offset: 60.0, ..Nonlinear::NONE };
    let plant = Plant { nonlinear, ..frictionless() };
    let mut bench = Bench::new(Plant { viscous_friction: 0.1, ..plant });
    // 2 N·m · cos(60 + angle) is 0.6 N·m at 72.54 degrees, which is stable where the cosine rises:
    // below the horizontal, at -72.54.
    bench.torque(0.6);
    bench.wait(5_000_000);
    let angle = bench.esc.state().output_degrees + 60.0;
    let expected = -(0.6_f64 / 2.0).acos().to_degrees();
    assert!((angle - expected).abs() < 0.1, "{angle} {expected}");
}

#[test]
fn cogging_averages_to_zero_over_a_turn() {
    let (torque, periods) = (0.2, 84.0);
    let mut bench = Bench::new(cogging(torque, periods));
    bench.esc.set_load(1.0);
    bench.wait(50_000);
    bench.esc.set_load(0.0);
    // Slow enough for some steps in a period, fast enough to go over each.
    let inertia = bench.esc.plant().inertia();
    let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
    for _ in 0..10_000 {
        bench.wait(100);
        let [speed, _] = bench.speeds();
        (low, high) = (low.min(speed), high.max(speed));
    }
    // Up and down by the work of half a period: T / (periods · gear) · 2 rad, in ½ J w².
    let work = 2.0 * torque / (periods * 3591.0 / 187.0);
    near(0.5 * inertia * (high * high - low * low), work, 0.05);
    // Every whole turn takes as long as the one before: nothing was gained or lost.
    let turns = |bench: &Bench| bench.esc.state().output_degrees / 360.0 * 3591.0 / 187.0;
    let mut last = None;
    for _ in 0..3 {
        let (begun, from) = (bench.world.now().get(), turns(&bench));
        bench.wait(1_000_000);
        let pace = (turns(&bench) - from) / (bench.world.now().get() - begun) as f64;
        if let Some(last) = last.replace(pace) {
            near(pace, last, 0.002);
        }
    }
    // A rotor that goes on by whole periods in each step feels nothing of it: 10000/84 turns a second.
    let mut fast = Bench::new(cogging(torque, periods));
    fast.esc.set_load(10.0);
    let wanted = 10_000.0 / periods * TAU * 187.0 / 3591.0;
    while fast.speeds()[0] < wanted {
        fast.wait(100);
    }
    fast.esc.set_load(-0.05);
    let [before, _] = fast.speeds();
    fast.wait(500_000);
    near(before - fast.speeds()[0], 0.05 / inertia * 0.5, 0.02);
}

#[test]
fn cogging_holds_a_rotor_up_to_its_amplitude() {
    let moved = |load: f64| {
        let plant = cogging(0.2, 84.0);
        let mut bench = Bench::new(Plant { viscous_friction: 0.5, ..plant });
        bench.wait(500_000);
        let from = bench.esc.state().output_degrees;
        // Slowly, so that no swing carries it over.
        for step in 1..=100 {
            bench.esc.set_load(load * f64::from(step) / 100.0);
            bench.wait(20_000);
        }
        bench.wait(100_000);
        (bench.esc.state().output_degrees - from) * 3591.0 / 187.0 * 84.0 / 360.0
    };
    // 0.2 · sin(phase) is 0.19.
    near(moved(0.19), 0.95_f64.asin() / TAU, 0.01);
    assert!(moved(0.21) > 1.0, "{}", moved(0.21));
}

#[test]
fn a_gap_is_crossed_and_closed_without_a_bounce() {
    let gap = 2.0_f64;
    let mut bench = Bench::new(loose(gap, frictionless()));
    // From the middle of the play: half of it, by the rotor alone.
    bench.torque(0.3);
    bench.wait(1000);
    while bench.speeds()[1] == 0.0 {
        bench.wait(100);
        assert!(bench.lead() <= gap / 2.0 + 1e-9);
    }
    near(bench.lead(), gap / 2.0, 1e-9);
    let [shaft, load] = bench.speeds();
    // ½ w² = τ / J · half of the gap, then one momentum in both; within the current's first ms.
    let before = (2.0 * 0.3 / rotor() * (gap / 2.0).to_radians()).sqrt();
    near(rotor() * shaft + LOAD * load, rotor() * before, 0.12);
    bench.wait(200);
    let [shaft, load] = bench.speeds();
    near(shaft, load, 1e-9);
    // From there on one inertia.
    bench.wait(100_000);
    near((bench.speeds()[0] - shaft) / 0.1, 0.3 / (rotor() + LOAD), 0.001);
    near(bench.lead(), gap / 2.0, 1e-9);
    // The other way round it loses the whole gap before the load feels anything.
    bench.torque(-0.3);
    bench.wait(2000);
    let [_, load] = bench.speeds();
    while bench.lead() > -gap / 2.0 {
        near(bench.speeds()[1], load, 1e-9);
        bench.wait(100);
    }
    near(bench.lead(), -gap / 2.0, 1e-9);
}

#[test]
fn play_never_makes_energy_and_keeps_momentum() {
    for load in [2e-4, LOAD, 2.0] {
        let plant = loose(1.5, frictionless().with_load_inertia(load));
        let mut bench = Bench::new(plant);
        bench.torque(1.0);
        bench.wait(30_000);
        bench.torque(-1.0);
        bench.wait(20_000);
        bench.esc.set_power(false);
        bench.wait(1000);
        let energy = |[shaft, its]: [f64; 2]| 0.5 * (rotor() * shaft * shaft + load * its * its);
        let momentum = |[shaft, its]: [f64; 2]| rotor() * shaft + load * its;
        let (begun, mut before) = (momentum(bench.speeds()), energy(bench.speeds()));
        for _ in 0..20_000 {
            bench.wait(100);
            let now = energy(bench.speeds());
            assert!(now <= before * (1.0 + 1e-12) && bench.lead().abs() < 0.75 + 1e-9);
            before = now;
        }
        near(momentum(bench.speeds()), begun, 1e-9);
    }
}

/// A relay that turns the torque round at each end: the shaft goes to and fro in the whole gap, and the
/// load hardly moves.
#[test]
fn a_limit_cycle_is_as_wide_as_the_gap() {
    let gap = 1.2;
    let mut bench = Bench::new(loose(gap, frictionless().with_load_inertia(50.0)));
    let (mut sign, mut low, mut high, mut turns) = (1.0, 0.0_f64, 0.0_f64, 0);
    for _ in 0..3000 {
        bench.torque(0.2 * sign);
        bench.wait(1000);
        let lead = bench.lead();
        if lead * sign >= gap / 2.0 - 1e-9 {
            (sign, turns) = (-sign, turns + 1);
        }
        (low, high) = (low.min(lead), high.max(lead));
    }
    assert!(turns > 50, "{turns}");
    near(high - low, gap, 1e-9);
    // Its encoder sees that gap, too.
    assert!(bench.esc.state().load_degrees.abs() < 0.01, "{:?}", bench.esc.state());
}

#[test]
fn friction_of_the_gearbox_holds_what_hangs_behind_the_play() {
    let mut bench = Bench::new(loose(2.0, Plant::m3508().with_load_inertia(LOAD)));
    // Less than the static friction of 0.13 N·m: only the play goes.
    bench.esc.set_load(-0.05);
    bench.wait(1_000_000);
    let state = bench.esc.state();
    assert!(state.load_rpm.abs() < 1e-9 && state.rotor_rpm.abs() < 1e-9, "{state:?}");
    near(bench.lead(), 1.0, 1e-9);
    bench.esc.set_load(-0.2);
    bench.wait(500_000);
    assert!(bench.esc.state().load_degrees < -10.0);
    // A stop holds the load, and the shaft goes on to the end of its play.
    bench.esc.set_travel(Some([-90.0, 90.0]));
    bench.wait(3_000_000);
    bench.torque(-1.0);
    bench.wait(1_000_000);
    let state = bench.esc.state();
    assert!((state.load_degrees + 90.0).abs() < 1e-6, "{state:?}");
    assert!((state.output_degrees + 91.0).abs() < 1e-6, "{state:?}");
    assert!(state.load_rpm.abs() < 1e-9 && state.output_rpm.abs() < 1e-9, "{state:?}");
}

#[test]
fn zero_is_off_and_a_plant_can_be_changed_on_the_way() {
    let mut plain = Bench::new(Plant::m3508().with_load_inertia(LOAD));
    let plant = Plant::m3508().with_load_inertia(LOAD);
    let nonlinear = Nonlinear { gravity_offset: 30.0, cogging_periods: 84.0, ..Nonlinear::NONE };
    let off = Plant { nonlinear, ..plant };
    let mut same = Bench::new(off);
    for bench in [&mut plain, &mut same] {
        bench.torque(1.0);
        bench.wait(300_000);
    }
    assert_eq!(plain.esc.state(), same.esc.state());
    let before = same.speeds();
    same.esc.set_plant(loose(1.0, same.esc.plant()));
    near(same.speeds()[1], before[1], 1e-12);
    same.wait(100_000);
    near(same.lead(), 0.5, 1e-9);
}
