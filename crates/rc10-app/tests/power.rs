//! Power of a base: torques within a limit against brute force, and drives under a referee.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "numbers of a test")]

extern crate std;

mod drive;
mod policies;

use std::f64::consts::PI;
use std::println;
use std::string::String;
use std::vec::Vec;

use drive::{Drive, Driven, FULL, Four, M3508, Policy, Trouble, power, watts};
use policies::{Community, Hkust, Nothing, Ours, Taproot, Truth, config};
use rc10_app::{
    Base, Body, Joules, NewtonMetres, PowerConfig, PowerInput, PowerLimiter, PowerModel, Rpm,
    Seconds, Twist, Watts,
};

use crate::random::Random;

fn any_model(random: &mut Random, returned: f32) -> PowerModel {
    let mut about = |number: f32| number * (1.0 + 0.6 * random.within(1.0));
    PowerModel {
        mechanical: about(1.2),
        per_speed: about(0.22),
        per_torque: about(1.2),
        idle: about(2.78),
        returned,
    }
}

fn rpm(speeds: &Four) -> [Rpm; 4] {
    speeds.map(|speed| Rpm::new((speed * 30.0 / PI) as f32))
}

fn torques(torques: &Four) -> [NewtonMetres; 4] {
    torques.map(|torque| NewtonMetres::new(torque as f32))
}

/// The power of a share of torques, with nothing that is cut off at zero.
fn at_share(model: &PowerModel, wished: &Four, speeds: &Four, share: f64) -> f64 {
    let one = |at: usize| {
        let (torque, speed) = (wished[at] * share, speeds[at]);
        let own = f64::from(model.mechanical) * torque * speed
            + f64::from(model.per_speed) * speed.abs()
            + f64::from(model.per_torque) * torque * torque;
        if own < 0.0 { own * f64::from(model.returned) } else { own }
    };
    f64::from(model.idle) + (0..4).map(one).sum::<f64>()
}

/// Against a thousand shares each, by a power that is summed up in f64: where the supply is shared, and where all
/// wheels drive, no other share is nearer to the wish; everywhere the limit is kept.
#[test]
fn the_share_is_the_nearest_that_keeps_the_limit() {
    let mut random = Random(1);
    let (mut whole, mut limited, mut hopeless, mut worst) = (0, 0, 0, 0.0_f64);
    for case in 0..6_000 {
        let all_drive = case % 3 == 0;
        let returned = [1.0, 0.0, 0.5][case / 3 % 3];
        let model = any_model(&mut random, returned);
        let wished: Four = [0.0; 4].map(|_| f64::from(random.within(6.0)));
        let mut speeds: Four = [0.0; 4].map(|_| f64::from(random.within(50.0)));
        if all_drive {
            speeds = core::array::from_fn(|at| speeds[at].abs().copysign(wished[at]));
        }
        let limit = 20.0 + 100.0 * f64::from(random.within(1.0)).abs();
        let given = model.allocate(torques(&wished), rpm(&speeds), watts(limit));
        let share = f64::from(given.share);
        for (torque, wish) in given.torques.iter().zip(&wished) {
            let off = f64::from(torque.get()) - wish * share;
            assert!(off.abs() < 1e-5, "the wrench keeps its direction: {given:?} of {wished:?}");
        }
        let of = |share| at_share(&model, &wished, &speeds, share);
        let shares = || (0..=1000).map(|part| f64::from(part) / 1000.0);
        let least = shares().map(of).fold(f64::INFINITY, f64::min);
        let near = 1e-4 * limit.max(of(1.0).abs());
        if least > limit + near {
            // None keeps it: as little as can be, but for what is counted more carefully.
            hopeless += 1;
            if all_drive || returned > 0.9 {
                assert!(of(share) < least + near, "{case}: {} at {share}, not {least}", of(share));
            }
        } else if share < 1.0 {
            // Where rolling alone takes more, a gain that is not sure does not count.
            let is_sure = of(0.0) <= limit || all_drive || returned > 0.9;
            let is_kept = of(share) < limit + near;
            assert!(is_kept || !is_sure, "{case}: {} of {limit} at {share}", of(share));
            let nearest = shares().filter(|share| of(*share) <= limit).fold(0.0, f64::max);
            worst = worst.max(nearest - share);
            if all_drive || returned > 0.9 {
                limited += 1;
                assert!(share > nearest - 1e-3, "{case}: {share}, not {nearest}");
                // 1 - s = λ P'(s), λ ≥ 0: less power is further from the wish.
                assert!(of(share + 1e-4) > of(share), "{case}");
            }
        } else {
            whole += 1;
            let is_least = of(1.0) < least + near || of(0.0) > limit && returned < 1.0;
            assert!(of(1.0) < limit + near || is_least, "{case}: {} of {limit}", of(1.0));
        }
    }
    println!(
        "{whole} whole, {limited} exact, {hopeless} hopeless; at most {worst:.3} below the nearest"
    );
    assert!(whole > 300 && limited > 1000 && hopeless > 200);
}

/// Four wheels, three ways to move: torques that push against each other change no wrench, and always take more.
#[test]
fn no_other_torques_with_the_same_wrench_take_less() {
    let mut random = Random(2);
    let body = Body { mass_kg: 18.0, yaw_inertia_kg_m2: 1.0 };
    let fastest = Rpm::new(450.0);
    let mecanum = Base::mecanum(0.076, 0.2, 0.22, fastest);
    let omni = Base::omni_4(0.076, 0.25, fastest);
    for case in 0..2_000 {
        let base = if case % 2 == 0 { &mecanum } else { &omni };
        let any = |random: &mut Random, size| {
            Twist::new(random.within(size), random.within(size), random.within(2.0 * size))
        };
        let twist = any(&mut random, 1.0);
        let speeds = base.inverse(twist).unwrap().speeds;
        let wished = base.torques(&body, twist, any(&mut random, 4.0));
        let model = any_model(&mut random, 1.0);
        let taken = model.power(&wished, &speeds).get();
        // What these wheels do without any motion of the base, by its rows: least squares leave it over.
        let thrust = Rpm::new(100.0 * random.within(1.0));
        let mut pushed = [Rpm::ZERO; 4];
        pushed[0] = thrust;
        let motion = base.forward(pushed);
        let inner = motion.residual.map(|residual| 5.0 * residual);
        let other: [NewtonMetres; 4] =
            core::array::from_fn(|at| wished[at] + NewtonMetres::new(inner[at]));
        let of = model.power(&other, &speeds).get();
        let size: f32 = inner.iter().map(|torque| torque * torque).sum();
        if taken > 0.0 {
            let more = model.per_torque * size;
            assert!(of > taken - 1e-3 * taken, "{case}: {of} and {taken}");
            assert!(
                (of - taken - more).abs() < 2e-3 * (taken + more) + 1e-3,
                "{case}: {of} {taken} {more}"
            );
        }
    }
}

#[test]
fn braking_is_not_limited_and_nothing_that_is_not_finite_comes_out() {
    let speeds = [Rpm::new(400.0); 4];
    for returned in [0.0, 1.0] {
        let model = PowerModel { returned, ..M3508 };
        let brakes = [NewtonMetres::new(-2.0); 4];
        // The speed alone takes 40 W; what brakes takes less than that.
        let given = model.allocate(brakes, speeds, Watts::new(10.0));
        assert_eq!((given.share, given.torques), (1.0, brakes), "{returned}");
        assert_eq!(
            model.power(&brakes, &speeds),
            Watts::new(if returned > 0.0 { 0.0 } else { 2.78 })
        );
        let drives = [NewtonMetres::new(2.0); 4];
        let given = model.allocate(drives, speeds, Watts::new(10.0));
        assert_eq!((given.share, given.torques), (0.0, [NewtonMetres::ZERO; 4]), "{returned}");
    }
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut wished = [NewtonMetres::new(1.0); 4];
        wished[2] = NewtonMetres::new(bad);
        let given = M3508.allocate(wished, speeds, Watts::new(50.0));
        assert_eq!((given.share, given.torques), (0.0, [NewtonMetres::ZERO; 4]), "{bad}");
        let mut turning = speeds;
        turning[1] = Rpm::new(bad);
        let given = M3508.allocate([NewtonMetres::new(1.0); 4], turning, Watts::new(50.0));
        assert!(given.torques.iter().all(|torque| torque.is_finite()), "{bad}: {given:?}");
        let given = M3508.allocate([NewtonMetres::new(9.0); 4], speeds, Watts::new(bad));
        assert!(given.torques.iter().all(|torque| torque.is_finite()), "{bad}: {given:?}");
    }
}

#[test]
fn a_limiter_ignores_bad_steps_and_readings() {
    let config = config(M3508);
    let mut limiter = PowerLimiter::new(&config);
    limiter.hear(&config, Watts::new(80.0), Joules::new(50.0));
    let good = PowerInput {
        wished: [NewtonMetres::new(2.0); 4],
        measured: [NewtonMetres::new(1.0); 4],
        speeds: [Rpm::new(200.0); 4],
        others: Watts::ZERO,
        derating: 1.0,
    };
    assert!(limiter.allocate(&config, &good, Seconds::new(0.01)).share > 0.1);
    let before = limiter;
    for bad in [f32::NAN, f32::INFINITY] {
        let mut inputs = [good; 4];
        inputs[0].wished[0] = NewtonMetres::new(bad);
        inputs[1].measured[3] = NewtonMetres::new(bad);
        inputs[2].speeds[2] = Rpm::new(bad);
        inputs[3].others = Watts::new(bad);
        for input in inputs {
            let given = limiter.allocate(&config, &input, Seconds::new(0.01));
            assert_eq!(given.torques, [NewtonMetres::ZERO; 4], "{input:?}");
        }
        for dt in [0.0, -0.01, bad] {
            assert!(limiter.allocate(&config, &good, Seconds::new(dt)).share <= 0.0);
        }
        limiter.measure(&config, Watts::new(bad), &good.measured, &good.speeds);
        assert_eq!(limiter, before, "{bad}");
    }
    limiter.hear(&config, Watts::new(f32::NAN), Joules::new(f32::NAN));
    assert!(limiter.limit() == config.limits[0] && limiter.energy().is_finite());
    // Less of the limit where it is hot, and none where that is not known.
    let hot = limiter.allocate(&config, &PowerInput { derating: 0.5, ..good }, Seconds::new(0.01));
    let not =
        limiter.allocate(&config, &PowerInput { derating: f32::NAN, ..good }, Seconds::new(0.01));
    assert!(hot.share < 0.8 && not.share == 0.0, "{hot:?} {not:?}");
}

/// A base at rest whose task makes no steps: the buffer fills, and that contradicts nothing.
#[test]
fn readings_without_a_step_between_contradict_nothing() {
    let config = config(M3508);
    let mut limiter = PowerLimiter::new(&config);
    for joules in 10..=60_u8 {
        limiter.hear(&config, Watts::new(80.0), Joules::new(joules.into()));
        assert!((limiter.energy().get() - f32::from(joules)).abs() <= 0.5);
    }
    assert_eq!((limiter.rejected(), limiter.model(&config)), (0, config.model));
}

#[test]
fn configurations_are_checked() {
    let config = config(M3508);
    assert_eq!(config.validate(), Ok(()));
    let wrong = |change: fn(&mut PowerConfig)| {
        let mut config = config;
        change(&mut config);
        config.validate().unwrap_err().field
    };
    assert_eq!(wrong(|config| config.model.mechanical = -1.0), "mechanical");
    assert_eq!(wrong(|config| config.model.per_speed = f32::NAN), "per_speed");
    assert_eq!(wrong(|config| config.model.per_torque = f32::INFINITY), "per_torque");
    assert_eq!(wrong(|config| config.model.idle = -0.1), "idle");
    assert_eq!(wrong(|config| config.model.returned = 1.1), "returned");
    assert_eq!(wrong(|config| config.uncertainty = 1.0), "uncertainty");
    assert_eq!(wrong(|config| config.limits[0] = Watts::ZERO), "limits[0]");
    assert_eq!(wrong(|config| config.limits[1] = Watts::new(30.0)), "limits[1]");
    assert_eq!(wrong(|config| config.buffer = Joules::new(5.0)), "buffer");
}

/// The limit that a limiter keeps: the lowest before it hears one, a higher one slowly, 0.85 of it in silence.
#[test]
fn a_limit_is_believed_slowly_and_kept_with_a_reserve_in_silence() {
    let config = config(M3508);
    let mut limiter = PowerLimiter::new(&config);
    let rest = PowerInput {
        wished: [NewtonMetres::ZERO; 4],
        measured: [NewtonMetres::ZERO; 4],
        speeds: [Rpm::ZERO; 4],
        others: Watts::ZERO,
        derating: 1.0,
    };
    let pass = |limiter: &mut PowerLimiter, seconds: u32, told: Option<f32>| {
        for tenth in 0..10 * seconds {
            if let Some(limit) = told {
                limiter.hear(&config, Watts::new(limit), Joules::new(60.0));
            }
            for _ in 0..10 {
                limiter.allocate(&config, &rest, Seconds::new(0.01));
            }
            assert_eq!(
                limiter.is_unheard(),
                told.is_none() && tenth > 1 || told.is_none() && limiter.is_unheard()
            );
        }
        limiter.limit().get()
    };
    let near = |actual: f32, expected: f32| assert!((actual - expected).abs() < 0.3, "{actual}");
    near(pass(&mut limiter, 5, None), 45.0);
    near(pass(&mut limiter, 5, Some(80.0)), 55.0);
    near(pass(&mut limiter, 30, Some(80.0)), 80.0);
    near(pass(&mut limiter, 3, Some(1e9)), 86.0);
    near(pass(&mut limiter, 1, Some(60.0)), 60.0);
    near(pass(&mut limiter, 1, None), 0.85 * 60.0);
    near(pass(&mut limiter, 1, Some(0.0)), 45.0);
}

/// Each kind of trouble that a referee makes, and all of them.
const TROUBLES: [Trouble; 5] = [
    Trouble { silence: false, limits: false, energies: false },
    Trouble { silence: true, limits: false, energies: false },
    Trouble { silence: false, limits: true, energies: false },
    Trouble { silence: false, limits: false, energies: true },
    Trouble { silence: true, limits: true, energies: true },
];

/// Drives minutes of our limiter by seeds, and tells the lowest energy of the buffer.
fn lowest_of(seeds: core::ops::Range<u64>) -> f64 {
    let mut lowest = [FULL; TROUBLES.len()];
    for seed in seeds.clone() {
        let of = seed as usize % TROUBLES.len();
        let returned = [0.0, 1.0][seed as usize / TROUBLES.len() % 2];
        let (drive, believed) = Drive::new(seed, TROUBLES[of], returned);
        let driven = drive.run(&mut Ours::new(believed), 60.0);
        if driven.lowest < 6.0 {
            println!("seed {seed}: {:.2} J with {:?}", driven.lowest, TROUBLES[of]);
        }
        lowest[of] = lowest[of].min(driven.lowest);
    }
    println!("{seeds:?} minutes of 100 Hz; lowest by trouble: {lowest:.2?}");
    lowest.into_iter().fold(FULL, f64::min)
}

#[test]
fn the_buffer_keeps_five_joules_whatever_the_referee_does() {
    assert!(lowest_of(0..400) >= 5.0);
}

/// `cargo test --release -p rc10-app --test all minutes -- --ignored --nocapture`: five minutes.
#[test]
#[ignore = "takes minutes"]
fn the_buffer_keeps_five_joules_for_a_hundred_thousand_minutes() {
    assert!(lowest_of(0..100_000) >= 5.0);
}

/// By the buffer alone: whole joules ten times a second, which say nothing while it is full.
#[test]
fn the_model_is_within_five_per_cent_after_a_minute() {
    let (mut errors, mut all) = ([const { Vec::new() }; 4], Vec::new());
    for seed in 0..200 {
        let returned = [0.0, 1.0][seed as usize % 2];
        let (drive, believed) = Drive::new(seed, Trouble::default(), returned);
        let mut ours = Ours::new(believed);
        let driven = drive.run(&mut ours, 60.0);
        let (learned, truth) = (ours.limiter.model(&ours.config), drive.truth());
        let hot = truth.per_torque * driven.hot as f32;
        let pairs = [
            (learned.mechanical, truth.mechanical),
            (learned.per_speed, truth.per_speed),
            (learned.per_torque, hot),
            (learned.idle, truth.idle),
        ];
        for (errors, (learned, truth)) in errors.iter_mut().zip(pairs) {
            errors.push(f64::from((learned / truth - 1.0).abs()));
        }
        // What a base takes that accelerates, and at speed.
        for (torque, speed) in [(2.0, 10.0), (0.8, 30.0), (0.3, 45.0)] {
            let truth = PowerModel { per_torque: hot, ..*truth };
            let of = |model: &PowerModel| at_share(model, &[torque; 4], &[speed; 4], 1.0);
            all.push((of(&learned) / of(&truth) - 1.0).abs());
        }
    }
    let report = |name: &str, errors: &mut Vec<f64>| {
        errors.sort_by(f64::total_cmp);
        let at = |share: f64| errors[(share * (errors.len() - 1) as f64) as usize];
        let within = errors.iter().filter(|error| **error < 0.05).count();
        let share = within as f64 / errors.len() as f64;
        println!(
            "{name}: median {:.4}, 95 % {:.4}, worst {:.4}; {share:.3} within 5 %",
            at(0.5),
            at(0.95),
            at(1.0)
        );
        share
    };
    // A robot with a high limit that mostly rolls has a full buffer, and learns less.
    for (name, errors) in ["mechanical", "per_speed", "per_torque"].into_iter().zip(&mut errors) {
        assert!(report(name, errors) > 0.92, "{name}");
    }
    // Of 3 W beside 100 a buffer does not say more.
    report("idle", &mut errors[3]);
    assert!(report("power", &mut all) > 0.99);
}

/// A meter tells it all in seconds.
#[test]
fn a_meter_teaches_the_model_in_seconds() {
    let mut random = Random(5);
    for _ in 0..50 {
        let truth = any_model(&mut random, 1.0);
        let mut off = |number: f32| number * (1.0 + 0.5 * random.within(1.0));
        let believed = PowerModel {
            mechanical: off(truth.mechanical),
            per_speed: off(truth.per_speed),
            per_torque: off(truth.per_torque),
            idle: off(truth.idle),
            returned: 1.0,
        };
        let config = config(believed);
        let mut limiter = PowerLimiter::new(&config);
        for step in 0..500_u16 {
            let phase = f64::from(step) * 0.02;
            let given = [2.0 * phase.sin(); 4];
            let speeds = [30.0 * (0.37 * phase).sin(); 4];
            let watts = power(&truth, 1.0, &given, &speeds) as f32 * (1.0 + random.within(0.02));
            limiter.measure(&config, Watts::new(watts), &torques(&given), &rpm(&speeds));
        }
        let learned = limiter.model(&config);
        for (learned, truth) in [
            (learned.mechanical, truth.mechanical),
            (learned.per_speed, truth.per_speed),
            (learned.per_torque, truth.per_torque),
            (learned.idle, truth.idle),
        ] {
            assert!((learned / truth - 1.0).abs() < 0.05, "{learned} {truth}");
        }
    }
}

type Make = fn(PowerModel) -> std::boxed::Box<dyn Policy>;
const POLICIES: [(&str, Make); 6] = [
    ("no limit", |_| std::boxed::Box::new(Nothing)),
    ("taproot: ratio of the buffer", |_| std::boxed::Box::new(Taproot::new())),
    ("community: fixed quadratic", |model| std::boxed::Box::new(Community::new(model))),
    ("HKUST 2024 without a supercapacitor", |model| std::boxed::Box::new(Hkust::new(model))),
    ("RC10", |model| std::boxed::Box::new(Ours::new(model))),
    ("one that knows the truth", |_| std::boxed::Box::new(Truth)),
];

/// The table of the docs: `cargo test -p rc10-app --test all policies -- --nocapture`.
#[test]
fn policies_of_three_teams_are_beaten() {
    let minutes = 100;
    let sum = |trouble: Trouble, make: Make| {
        let mut sum = Driven { lowest: FULL, empty: 0.0, way: 0.0, energy: 0.0, hot: 1.0 };
        for seed in 0..minutes {
            let (drive, believed) =
                Drive::new(1_000 + seed, trouble, [0.0, 1.0][seed as usize % 2]);
            let driven = drive.run(&mut *make(believed), 60.0);
            sum.lowest = sum.lowest.min(driven.lowest);
            sum.empty += driven.empty;
            sum.way += driven.way;
            sum.energy += driven.energy;
        }
        sum
    };
    let mut table = String::from(
        "| policy | way, % | empty, s a minute | lowest, J | with a referee that fails: way, % | empty, s a minute | lowest, J |\n\
         |---|---|---|---|---|---|---|\n",
    );
    let mut rows = Vec::new();
    let best = [TROUBLES[0], TROUBLES[4]].map(|trouble| sum(trouble, POLICIES[5].1).way);
    for (name, make) in POLICIES {
        let both = [TROUBLES[0], TROUBLES[4]].map(|trouble| sum(trouble, make));
        table += &std::format!("| {name} |");
        for (driven, best) in both.iter().zip(best) {
            let (way, empty) = (100.0 * driven.way / best, driven.empty / minutes as f64);
            table += &std::format!(" {way:.1} | {empty:.2} | {:.0} |", driven.lowest);
        }
        table.push('\n');
        rows.push(both);
    }
    println!("{table}");
    for page in [
        include_str!("../../../docs/control/power.md"),
        include_str!("../../../docs/control/power.zh-CN.md"),
    ] {
        for (row, (name, _)) in table.lines().skip(2).zip(POLICIES) {
            let numbers = &row[name.len() + 2..];
            assert!(page.contains(numbers), "the page has another table than this: {row}");
        }
    }
    for (at, trouble) in [0, 1].into_iter().enumerate() {
        let ours = &rows[4][trouble];
        assert!(ours.empty == 0.0 && ours.lowest >= 5.0);
        for team in &rows[1..4] {
            assert!(team[at].empty > 0.0 || team[at].way < ours.way, "{:?}", team[at]);
        }
    }
    // Against the truth, with a referee that does not fail.
    assert!(rows[4][0].way > 0.97 * best[0]);
}
