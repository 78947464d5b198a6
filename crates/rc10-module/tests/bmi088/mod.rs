//! The BMI088 driver against a BMI088 that is written from the data sheet, in virtual time.
#![cfg(test)]
#![expect(clippy::cast_possible_truncation, reason = "a chip's registers are bytes")]

mod chip;

use chip::{BusFault, Chip, Device, Motion, Shared, Wires, run};
use rc10_module::imu::Sample;
use rc10_module::imu::bmi088::{
    AccelerationRange, Bmi088, Config, ERRORS_BEFORE_RESTART, Error, Part, RotationBandwidth,
    RotationRange,
};

struct Bench {
    package: Shared,
    imu: Bmi088<Device, Device, Shared>,
    config: Config,
}

type Read = Result<Sample, Error<BusFault>>;

impl Bench {
    fn new(config: Config) -> Self {
        let package = Shared::new();
        let (accelerometer, gyroscope) =
            (package.device(Chip::Accelerometer), package.device(Chip::Gyroscope));
        let imu = Bmi088::new(accelerometer, gyroscope, package.clone(), config);
        Self { package, imu, config }
    }

    /// One reading, a millisecond after the last.
    fn read(&mut self) -> Read {
        self.package.with(|package| package.now += 1_000_000);
        run(self.imu.read())
    }

    fn now_ms(&self) -> u64 {
        self.package.with(|package| package.now / 1_000_000)
    }

    /// The sample is what the world does, within two of the last digit: noise and rounding.
    fn check(&self, sample: &Sample) {
        let motion = self.package.with(|package| package.motion);
        let acceleration = f64::from(self.config.acceleration_range.g()) * 9.80665;
        let rotation = f64::from(self.config.rotation_range.degrees()).to_radians();
        for axis in 0..3 {
            let wanted = motion.acceleration[axis].clamp(-acceleration, acceleration);
            let read = f64::from(sample.acceleration[axis]);
            assert!((read - wanted).abs() < 2.0 * acceleration / 32768.0, "{read} {wanted}");
            let wanted = motion.rotation[axis].clamp(-rotation, rotation);
            let read = f64::from(sample.rotation[axis]);
            assert!((read - wanted).abs() < 2.0 * rotation / 32767.0, "{read} {wanted}");
        }
    }
}

const RANGES: [(AccelerationRange, RotationRange); 5] = [
    (AccelerationRange::G3, RotationRange::Degrees125),
    (AccelerationRange::G6, RotationRange::Degrees250),
    (AccelerationRange::G12, RotationRange::Degrees500),
    (AccelerationRange::G24, RotationRange::Degrees1000),
    (AccelerationRange::G24, RotationRange::Degrees2000),
];

#[test]
fn every_range_measures_what_the_world_does() {
    for (acceleration_range, rotation_range) in RANGES {
        let config = Config { acceleration_range, rotation_range, ..Config::default() };
        let mut bench = Bench::new(config);
        for step in -20..=20 {
            let part = f64::from(step) / 20.5;
            let full = f64::from(acceleration_range.g()) * 9.80665 * part;
            let turn = f64::from(rotation_range.degrees()).to_radians() * part;
            let motion = Motion {
                acceleration: [full, -full, full / 2.0],
                rotation: [-turn, turn / 3.0, turn],
            };
            bench.package.with(|package| package.motion = motion);
            let sample = bench.read().unwrap();
            bench.check(&sample);
            assert!(!sample.acceleration_is_saturated && !sample.rotation_is_saturated);
        }
        assert_eq!((bench.imu.counters().starts, bench.imu.counters().samples), (1, 41));
    }
}

#[test]
fn it_starts_in_time_and_a_sample_is_61_bytes() {
    let mut bench = Bench::new(Config::default());
    bench.read().unwrap();
    assert!(bench.now_ms() < 120, "{} ms", bench.now_ms());
    let before = bench.package.with(|package| package.transferred);
    bench.read().unwrap();
    assert_eq!(bench.package.with(|package| package.transferred) - before, 61);
}

#[test]
fn a_warm_start_of_the_controller_finds_the_chips_running() {
    let mut bench =
        Bench::new(Config { rotation_range: RotationRange::Degrees250, ..Config::default() });
    bench.read().unwrap();
    let (accelerometer, gyroscope) =
        (bench.package.device(Chip::Accelerometer), bench.package.device(Chip::Gyroscope));
    bench.config = Config::default();
    bench.imu = Bmi088::new(accelerometer, gyroscope, bench.package.clone(), bench.config);
    let sample = bench.read().unwrap();
    bench.check(&sample);
}

#[test]
fn an_accelerometer_that_is_back_at_i2c_after_its_reset_is_told_again() {
    let mut bench = Bench::new(Config::default());
    bench.package.with(|package| package.accelerometer.reset_forgets_spi = true);
    for _ in 0..2 {
        bench.read().unwrap();
        let package = bench.package.clone();
        let devices = [Chip::Accelerometer, Chip::Gyroscope].map(|chip| package.device(chip));
        let [accelerometer, gyroscope] = devices;
        bench.imu = Bmi088::new(accelerometer, gyroscope, package, bench.config);
    }
}

#[test]
fn strangers_are_named_with_what_they_said() {
    let wrong = |part, read| Err(Error::WrongChip { part, read });
    let mut bench = Bench::new(Config::default());
    bench.package.with(|package| package.accelerometer.id = 0x1F);
    assert_eq!(bench.read(), wrong(Part::Accelerometer, 0x1F));
    let text = bench.read().unwrap_err().to_string();
    assert!(text.contains("accelerometer says it is 0x1f, not 0x1e"), "{text}");

    let mut bench = Bench::new(Config::default());
    bench.package.with(|package| package.gyroscope.id = 0x10);
    assert_eq!(bench.read(), wrong(Part::Gyroscope, 0x10));

    for (wires, read) in [(Wires::Cut, 0xFF), (Wires::Stuck(0), 0x00), (Wires::Stuck(0xFF), 0xFF)] {
        let mut bench = Bench::new(Config::default());
        bench.package.with(|package| package.wires = wires);
        assert_eq!(bench.read(), wrong(Part::Accelerometer, read));
        let text = bench.read().unwrap_err().to_string();
        assert!(text.contains("nothing answers"), "{text}");
    }

    let mut bench = Bench::new(Config::default());
    bench.package.with(|package| package.is_swapped = true);
    assert!(matches!(bench.read(), Err(Error::WrongChip { part: Part::Accelerometer, .. })));
}

#[test]
fn a_setting_that_is_not_taken_is_named() {
    for (register, wrote) in [(0x7C, 0x00), (0x7D, 0x04), (0x40, 0x8C), (0x41, 0x02)] {
        let config = Config { acceleration_range: AccelerationRange::G12, ..Config::default() };
        let mut bench = Bench::new(config);
        bench.package.with(|package| package.accelerometer.deaf = Some(register));
        let Err(Error::NotKept { part, register: named, wrote: written, .. }) = bench.read() else {
            panic!("register {register:#x} was not missed");
        };
        assert_eq!((part, named, written), (Part::Accelerometer, register, wrote));
    }
    for (register, wrote) in [(0x0F, 0x03), (0x10, 0x82)] {
        let config = Config { rotation_range: RotationRange::Degrees250, ..Config::default() };
        let mut bench = Bench::new(config);
        bench.package.with(|package| package.gyroscope.deaf = Some(register));
        let Err(Error::NotKept { part, register: named, wrote: written, .. }) = bench.read() else {
            panic!("register {register:#x} was not missed");
        };
        assert_eq!((part, named, written), (Part::Gyroscope, register, wrote));
    }
}

#[test]
fn a_broken_accelerometer_says_so() {
    let mut bench = Bench::new(Config::default());
    bench.read().unwrap();
    bench.package.with(|package| package.accelerometer.errors = 0x01);
    assert_eq!(bench.read(), Err(Error::Broken { errors: 0x01 }));
}

#[test]
fn the_end_of_a_range_is_seen() {
    let mut bench =
        Bench::new(Config { rotation_range: RotationRange::Degrees500, ..Config::default() });
    let over = Motion { acceleration: [0.0, -70.0, 0.0], rotation: [0.0, 0.0, 20.0] };
    bench.package.with(|package| package.motion = over);
    let sample = bench.read().unwrap();
    assert!(sample.acceleration_is_saturated && sample.rotation_is_saturated);
    bench.package.with(|package| package.motion.rotation = [8.7, 0.0, 0.0]);
    let sample = bench.read().unwrap();
    assert!(sample.acceleration_is_saturated && !sample.rotation_is_saturated);
    assert_eq!(bench.imu.counters().saturated, 2);
}

#[test]
fn temperatures_are_those_of_the_data_sheet() {
    let mut bench = Bench::new(Config::default());
    for celsius in [85.0, 23.375, 23.25, 23.125, 23.0, 22.875, -40.0] {
        bench.package.with(|package| package.celsius = celsius);
        // It is measured every 1.28 s.
        bench.package.with(|package| package.now += 1_280_000_000);
        let read = bench.read().unwrap().temperature.map(f64::from);
        assert_eq!(read, Some(celsius));
    }
}

#[test]
fn a_frozen_chip_is_told_from_a_still_one() {
    let mut bench = Bench::new(Config::default());
    for _ in 0..1000 {
        bench.read().unwrap();
    }
    bench.package.with(|package| package.accelerometer.is_frozen = true);
    // At once: no sample is given twice.
    assert_eq!(bench.read(), Err(Error::Stuck(Part::Accelerometer)));
    bench.package.with(|package| package.accelerometer.is_frozen = false);
    bench.read().unwrap();

    bench.package.with(|package| package.gyroscope.is_frozen = true);
    let given = (0..200).find(|_| bench.read() == Err(Error::Stuck(Part::Gyroscope)));
    assert!(given.is_some_and(|given| given <= 100), "{given:?}");
    // It is started over and over until it measures again.
    bench.package.with(|package| package.gyroscope.is_frozen = false);
    let given = (0..5).find(|_| bench.read().is_ok());
    assert!(given.is_some(), "{:?}", bench.imu.counters());
}

#[test]
fn a_slow_gyroscope_that_is_read_too_often_is_not_stuck() {
    let slow = [RotationBandwidth::Hz12At100, RotationBandwidth::Hz32At100];
    for rotation_bandwidth in slow {
        let mut bench = Bench::new(Config { rotation_bandwidth, ..Config::default() });
        for _ in 0..5000 {
            bench.read().unwrap();
        }
    }
}

#[test]
fn after_a_brown_out_no_sample_has_the_wrong_scale() {
    for (acceleration_range, rotation_range) in RANGES {
        let config = Config { acceleration_range, rotation_range, ..Config::default() };
        for reads in [1, 2, 3] {
            let mut bench = Bench::new(config);
            bench.package.with(|package| package.motion.rotation = [0.5, -1.0, 1.5]);
            for _ in 0..reads {
                bench.read().unwrap();
            }
            bench.package.with(chip::Package::lose_supply);
            let lost = bench.now_ms();
            // Long enough for the gyroscope to be there again, with its own settings.
            for wait in 0..u64::from(ERRORS_BEFORE_RESTART) {
                bench.package.with(|package| package.now += 40_000_000 * u64::from(wait == 0));
                assert!(bench.read().is_err(), "{acceleration_range:?} {rotation_range:?}");
            }
            let sample = bench.read().unwrap();
            bench.check(&sample);
            assert!(bench.now_ms() - lost < 40 + 130);
            assert_eq!(bench.imu.counters().starts, 2);
        }
    }
}

#[test]
fn an_accelerometer_that_started_again_gives_no_sample() {
    for reads in [1, 2] {
        let mut bench = Bench::new(Config::default());
        for _ in 0..reads {
            bench.read().unwrap();
        }
        bench.package.with(chip::Package::reset_accelerometer);
        bench.package.with(|package| package.now += 2_000_000);
        for _ in 0..ERRORS_BEFORE_RESTART {
            let read = bench.read();
            let named = matches!(read, Err(Error::NotKept { part: Part::Accelerometer, .. }));
            assert!(named, "{read:?}");
        }
        let sample = bench.read().unwrap();
        bench.check(&sample);
    }
}

/// In turn, two with each sample: a wrong one is seen in the second at the latest.
#[test]
fn each_setting_of_the_accelerometer_that_changes_by_itself_is_seen() {
    let config = Config { acceleration_range: AccelerationRange::G12, ..Config::default() };
    for (register, wrong) in [(0x7C, 0x03), (0x7D, 0x00), (0x40, 0xA8), (0x41, 0x00)] {
        for reads in [1, 2] {
            let mut bench = Bench::new(config);
            for _ in 0..reads {
                bench.read().unwrap();
            }
            bench.package.with(|package| package.set_accelerometer(register, wrong));
            let seen = [(); 2].map(|()| bench.read());
            let is_named = |read: &Read| {
                matches!(read, Err(Error::NotKept { part: Part::Accelerometer, register: named, .. })
                    if *named == register)
            };
            assert!(seen.iter().any(is_named), "register {register:#x}: {seen:?}");
        }
    }
}

#[test]
fn bus_errors_are_counted_and_do_not_last() {
    let mut bench = Bench::new(Config::default());
    bench.read().unwrap();
    // As many in a row as it bears, with a sample between, are never added up.
    for _ in 0..5 {
        bench.package.with(|package| package.wires = Wires::Error);
        for _ in 1..ERRORS_BEFORE_RESTART {
            bench.read().unwrap_err();
        }
        bench.package.with(|package| package.wires = Wires::Good);
        bench.read().unwrap();
    }
    assert_eq!(bench.imu.counters().starts, 1);
    for (errors, starts) in [(1, 1), (2, 1), (3, 2), (10, 3)] {
        let before = bench.imu.counters().spi_errors;
        bench.package.with(|package| package.wires = Wires::Error);
        for _ in 0..errors {
            assert_eq!(bench.read().map_err(|error| matches!(error, Error::Spi(..))), Err(true));
        }
        assert_eq!(bench.imu.counters().spi_errors - before, errors);
        bench.package.with(|package| package.wires = Wires::Good);
        let sample = bench.read().unwrap();
        bench.check(&sample);
        let failed_starts = errors.saturating_sub(3);
        let counted = bench.imu.counters().starts;
        assert!(counted >= starts && counted <= starts + failed_starts + 1, "{counted}");
    }
}

/// A thousand faults of every kind at any time: each sample is true, and a second after the last
/// fault there are samples again.
#[test]
fn whatever_happens_a_sample_is_true_and_they_come_back() {
    for seed in 1..=20_u64 {
        let mut random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mut next = |below: u64| {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            random % below
        };
        let (acceleration_range, rotation_range) = RANGES[next(5) as usize];
        let config = Config { acceleration_range, rotation_range, ..Config::default() };
        let mut bench = Bench::new(config);
        for story in 0..50 {
            bench.package.with(|package| match next(8) {
                0 => package.lose_supply(),
                1 => package.wires = Wires::Error,
                2 => package.wires = Wires::Cut,
                3 => package.wires = Wires::Stuck(0),
                4 => package.wires = Wires::Stuck(0xFF),
                5 => package.accelerometer.is_frozen = true,
                6 => package.accelerometer.errors = 1 << next(5),
                _ => package.is_swapped = true,
            });
            let angle = next(628) as f64 / 100.0;
            let motion = Motion {
                acceleration: [9.0 * angle.sin(), 2.0, 9.0 * angle.cos()],
                rotation: [angle.sin(), angle.cos(), -2.0],
            };
            bench.package.with(|package| package.motion = motion);
            for _ in 0..next(10) {
                bench.package.with(|package| package.now += 1_000_000 * next(60));
                if let Ok(sample) = bench.read() {
                    bench.check(&sample);
                }
            }
            bench.package.with(|package| {
                package.wires = Wires::Good;
                package.accelerometer.is_frozen = false;
                package.accelerometer.errors = 0;
                package.is_swapped = false;
            });
            let from = bench.now_ms();
            let back = loop {
                if let Ok(sample) = bench.read() {
                    bench.check(&sample);
                    break bench.now_ms() - from;
                }
                assert!(bench.now_ms() - from < 1000, "seed {seed}, story {story}: no sample");
            };
            assert!(back < 300, "seed {seed}, story {story}: after {back} ms");
        }
    }
}
