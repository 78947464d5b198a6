//! The heater of an IMU, on a die that is warmed and cooled as a board's is.
#![cfg(test)]

use rc10_app::Seconds;
use rc10_module::imu::heater::{Heater, HeaterConfig};

/// DM-MC02's.
const CONFIG: HeaterConfig =
    HeaterConfig { resistance: 47.0, most: 250, most_power: 3.4, target: 45.0 };
const STEP: Seconds = Seconds::new(0.1);

/// A die in air: degrees a watt, reached with this time constant. The sensor tells it as it was a
/// second ago.
struct Die {
    air: f32,
    now: f32,
    degrees_a_watt: f32,
    seconds: f32,
    told: [f32; 10],
}

impl Die {
    fn new(air: f32, degrees_a_watt: f32, seconds: f32) -> Self {
        Self { air, now: air, degrees_a_watt, seconds, told: [air; 10] }
    }

    fn heat(&mut self, power: f32) {
        let end = self.air + self.degrees_a_watt * power;
        self.now += (end - self.now) * STEP.get() / self.seconds;
        self.told.rotate_left(1);
        self.told[9] = self.now;
    }
}

/// The temperature after some minutes, the highest one, and the largest share of time.
fn run(heater: &mut Heater, die: &mut Die, volts: f32, minutes: u32) -> (f32, f32, u16) {
    let (mut highest, mut most) = (f32::MIN, 0);
    for _ in 0..minutes * 600 {
        let share = heater.update(Some(die.told[0]), Some(volts), STEP);
        most = most.max(share);
        die.heat(f32::from(share) / 1000.0 * volts * volts / CONFIG.resistance);
        highest = highest.max(die.now);
    }
    (die.now, highest, most)
}

#[test]
fn the_die_gets_warm_and_stays_so_whatever_the_supply() {
    for air in [0.0, 15.0, 25.0] {
        for volts in [21.0, 24.0, 25.2] {
            for (degrees_a_watt, seconds) in [(16.0, 30.0), (20.0, 60.0), (30.0, 120.0)] {
                let (mut heater, mut die) =
                    (Heater::new(CONFIG), Die::new(air, degrees_a_watt, seconds));
                let (end, highest, most) = run(&mut heater, &mut die, volts, 20);
                let reachable =
                    air + degrees_a_watt * CONFIG.most_power.min(volts * volts / 47.0 / 4.0);
                let wanted = CONFIG.target.min(reachable);
                let case = format!("{air} °C, {volts} V, {degrees_a_watt} K/W in {seconds} s");
                assert!((end - wanted).abs() < 0.5, "{case}: {end}, not {wanted}");
                assert!(highest < CONFIG.target + 1.5, "{case}: up to {highest}");
                assert!(most <= CONFIG.most, "{case}: {most} thousandths");
            }
        }
    }
}

#[test]
fn the_power_is_bounded_and_not_the_share_alone() {
    let mut heater = Heater::new(CONFIG);
    for (volts, share) in [(12.0, 250), (24.0, 250), (30.0, 177)] {
        assert_eq!(heater.update(Some(20.0), Some(volts), STEP), share, "{volts} V");
    }
}

#[test]
fn what_is_not_known_switches_it_off_and_is_forgotten() {
    let mut heater = Heater::new(CONFIG);
    let unknown = [
        (None, Some(24.0)),
        (Some(20.0), None),
        (Some(f32::NAN), Some(24.0)),
        (Some(20.0), Some(f32::INFINITY)),
        (Some(-50.0), Some(24.0)),
        (Some(90.0), Some(24.0)),
        (Some(20.0), Some(5.0)),
        (Some(20.0), Some(40.0)),
    ];
    for (temperature, volts) in unknown {
        assert!(heater.update(Some(20.0), Some(24.0), STEP) > 0);
        assert_eq!(heater.update(temperature, volts, STEP), 0, "{temperature:?} {volts:?}");
    }
    // Nothing is left of what it had learned before.
    for _ in 0..6000 {
        heater.update(Some(44.0), Some(24.0), STEP);
    }
    let learned = heater.update(Some(45.0), Some(24.0), STEP);
    heater.update(None, None, STEP);
    let after = heater.update(Some(45.0), Some(24.0), STEP);
    assert!(learned > 50 && after == 0, "{learned}, then {after}");
    assert_eq!(heater.update(Some(46.0), Some(24.0), STEP), 0);
}

#[test]
fn a_board_that_was_too_hot_is_warmed_again_as_soon_as_it_cools() {
    for hot in [46.0, 48.0, 50.0, 55.0, 70.0] {
        let (mut heater, mut die) = (Heater::new(CONFIG), Die::new(hot, 20.0, 60.0));
        run(&mut heater, &mut die, 24.0, 20);
        die.air = 20.0;
        let mut lowest = f32::MAX;
        for _ in 0..10 * 600 {
            let share = heater.update(Some(die.told[0]), Some(24.0), STEP);
            die.heat(f32::from(share) / 1000.0 * 24.0 * 24.0 / CONFIG.resistance);
            lowest = lowest.min(die.now);
        }
        println!("after {hot} °C: down to {lowest}, then {}", die.now);
        assert!(lowest > CONFIG.target - 3.0, "after {hot} °C: down to {lowest}");
        assert!((die.now - CONFIG.target).abs() < 0.5, "after {hot} °C: {}", die.now);
    }
}
