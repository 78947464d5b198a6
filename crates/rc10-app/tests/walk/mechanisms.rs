//! A deterministic walk through all mechanisms: what they give on a PC and on the chip is the same bit
//! for bit.

use rc10_app::mechanism::{
    Axes, AxesConfig, AxesHoming, AxesHomingConfig, AxesHomingStatus, Braking, Feeder,
    FeederConfig, Health, Homing, HomingConfig, HomingStatus, Jam, JamConfig, Limited, Measured,
    MotorCommand, Reference, SoftLimits, Stall,
};
use rc10_app::{
    AngleSetpoint, CountsPerTurn, Degrees, Direction, Rpm, RpmPerSecond, Seconds, TotalAngle,
};

/// A repeatable generator (`SplitMix64`).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((bits ^ (bits >> 31)) >> 32) as u32
    }

    /// Within ± `size`.
    fn within(&mut self, size: f32) -> f32 {
        size * ((self.bits() >> 8) as f32 / 8_388_608.0 - 1.0)
    }

    fn one_in(&mut self, count: u32) -> bool {
        self.bits().is_multiple_of(count)
    }
}

const DT: Seconds = Seconds::new(0.005);
const BRAKING: Braking =
    Braking { acceleration: RpmPerSecond::new(400.0), reaction: Seconds::new(0.03) };
const STALL: Stall = Stall { effort: 6.0, standstill: Rpm::new(3.0), time: Seconds::new(0.05) };
const JAM: JamConfig = JamConfig {
    stall: STALL,
    following_error: Degrees::new(2.0),
    reverse: Degrees::new(20.0),
    reverse_speed: Rpm::new(40.0),
    reverse_time: Seconds::new(0.3),
    tries: 3,
};

const fn homing(reference: Reference, direction: Direction) -> HomingConfig {
    HomingConfig {
        reference,
        direction,
        fast: Rpm::new(60.0),
        slow: Rpm::new(10.0),
        back_off: Degrees::new(20.0),
        tolerance: Degrees::new(8.0),
        touch_at: TotalAngle::from_degrees(-7),
        travel: Degrees::new(400.0),
        braking: BRAKING,
        phase_timeout: Seconds::new(4.0),
        timeout: Seconds::new(6.0),
    }
}

/// A motor that follows commands with a lag, in front of a stop.
struct Motor {
    measured: Measured,
    stop: TotalAngle,
}

impl Motor {
    fn new(at: i32, stop: i32) -> Self {
        let angle = TotalAngle::from_degrees(at);
        let stop = TotalAngle::from_degrees(stop);
        Self { measured: Measured { angle, ..Measured::default() }, stop }
    }

    fn follow(&mut self, command: MotorCommand) {
        let Measured { angle, speed, .. } = self.measured;
        let asked = match command {
            MotorCommand::Coast => 0.0,
            MotorCommand::Speed(speed) => speed.get(),
            MotorCommand::Angle(AngleSetpoint { angle: to, speed, .. }) => {
                speed.get() + (to.minus(angle).degrees().get() * 2.0).clamp(-80.0, 80.0)
            }
        };
        let mut speed = speed.get() + (asked - speed.get()) * 0.3;
        let step = TotalAngle::from_microdegrees((speed * 30_000.0) as i64);
        let mut next = angle.plus(step);
        self.measured.effort = (asked - speed) * 0.5;
        if next >= self.stop {
            (next, speed) = (self.stop, 0.0);
            self.measured.effort = asked;
        }
        (self.measured.angle, self.measured.speed) = (next, Rpm::new(speed));
    }
}

fn put_angle(put: &mut dyn FnMut(f32), angle: TotalAngle) {
    let bits = angle.microdegrees();
    put(f32::from_bits(bits as u32 & 0x3FFF_FFFF));
    put((bits >> 30) as f32);
}

fn put_command(put: &mut dyn FnMut(f32), command: MotorCommand) {
    match command {
        MotorCommand::Coast => put(-1.0),
        MotorCommand::Speed(speed) => put(speed.get()),
        MotorCommand::Angle(AngleSetpoint { angle, speed, acceleration }) => {
            put_angle(put, angle);
            put(speed.get());
            put(acceleration.get());
        }
    }
}

fn walk_homing(put: &mut dyn FnMut(f32), random: &mut Random) {
    let contact = Reference::Contact { debounce: Seconds::new(0.012) };
    for run in 0..6 {
        let reference = if run % 2 == 0 { contact } else { Reference::Stop(STALL) };
        let config = homing(reference, Direction::Forward);
        let (mut homing, mut motor) = (Homing::new(), Motor::new(random.within(90.0) as i32, 100));
        for _ in 0..500 {
            let closed = motor.measured.angle >= TotalAngle::from_degrees(95) && !random.one_in(8);
            let command = homing.update(&config, &motor.measured, closed, DT);
            put_command(put, command);
            motor.follow(command);
        }
        if let HomingStatus::Done { zero } = homing.status() {
            put_angle(put, zero);
            put_angle(put, motor.measured.counted_from(zero).angle);
        }
    }
    let config = AxesHomingConfig {
        homing: homing(Reference::Stop(STALL), Direction::Forward),
        spread: Degrees::new(30.0),
    };
    for _ in 0..4 {
        let mut homing = AxesHoming::<2>::new();
        let mut motors = [Motor::new(0, 100), Motor::new(0, 100 + random.within(35.0) as i32)];
        for _ in 0..500 {
            let measured = [motors[0].measured, motors[1].measured];
            let commands = homing.update(&config, &measured, &[false; 2], DT);
            for (motor, command) in motors.iter_mut().zip(commands) {
                put_command(put, command);
                motor.follow(command);
            }
        }
        if let AxesHomingStatus::Done { zeros } = homing.status() {
            zeros.iter().for_each(|zero| put_angle(put, *zero));
        }
    }
}

fn walk_axes(put: &mut dyn FnMut(f32), random: &mut Random) {
    let config = AxesConfig {
        wait: Degrees::new(8.0),
        stop: Degrees::new(30.0),
        patience: Seconds::new(0.2),
        coupling: 0.5,
        correction: Degrees::new(5.0),
    };
    let (mut axes, mut at) = (Axes::<4>::new(), 0.0_f32);
    let mut motors = [0, 1, 2, 3].map(|at| Motor::new(at, 100_000));
    for _ in 0..1000 {
        let speed = 40.0 + random.within(20.0);
        at += speed * axes.pace() * 0.03;
        let angle = TotalAngle::from_microdegrees((at * 1e6) as i64);
        let measured = [0, 1, 2, 3].map(|index: usize| motors[index].measured);
        let (speed, acceleration) = (Rpm::new(speed), RpmPerSecond::new(random.within(200.0)));
        let setpoint = AngleSetpoint { angle, speed, acceleration };
        let commands = axes.update(&config, &setpoint, &measured, DT);
        for (motor, command) in motors.iter_mut().zip(commands) {
            put_command(put, command);
            if !random.one_in(4) {
                motor.follow(command);
            }
        }
        put(axes.difference().get());
        put(axes.pace());
        if axes.failure().is_some() {
            axes.reset();
            motors.iter_mut().for_each(|motor| motor.measured.angle = angle);
        }
    }
}

fn walk_jams(put: &mut dyn FnMut(f32), random: &mut Random) {
    let config = FeederConfig {
        pieces: CountsPerTurn::new(7, 2),
        direction: Direction::Forward,
        pieces_per_s: 3.0,
        acceleration: RpmPerSecond::new(400.0),
        tolerance: Degrees::new(3.0),
        jam: JAM,
    };
    let limits = SoftLimits {
        lower: TotalAngle::from_degrees(-50),
        upper: TotalAngle::from_degrees(4000),
        braking: BRAKING,
        not_homed: Rpm::new(5.0),
    };
    let (mut feeder, mut fed_by) = (Feeder::new(), Motor::new(-30, 100_000));
    let (mut jam, mut turned_by) = (Jam::new(), Motor::new(0, 100_000));
    let mut wanted = MotorCommand::STOP;
    for _ in 0..4000 {
        if random.one_in(150) {
            wanted = MotorCommand::Speed(Rpm::new(random.within(100.0)));
            match random.bits() % 4 {
                0 => feeder.run(2.0 + random.within(2.5)),
                1 => feeder.stop(),
                more => feeder.feed(more),
            }
            // An obstacle, or none.
            let obstacle = TotalAngle::from_degrees(random.within(100.0) as i32);
            fed_by.stop = fed_by.measured.angle.plus(obstacle);
            turned_by.stop = turned_by.measured.angle.plus(obstacle);
        }
        if feeder.jam().count() % 3 == 2 {
            fed_by.stop = TotalAngle::from_degrees(1_000_000);
            feeder.reset();
        }
        if random.one_in(300) {
            jam.reset();
        }
        fed_by.measured.health = if random.one_in(50) { Health::Offline } else { Health::Ready };
        let command = feeder.update(&config, &fed_by.measured, DT);
        put_command(put, command);
        put(feeder.fed() as f32);
        put(feeder.left() as f32);
        fed_by.follow(command);

        let angle = turned_by.measured.angle;
        let position = (!random.one_in(20)).then_some(angle);
        let Limited { command, by } = limits.limit(wanted, position);
        put(f32::from(by.is_some()));
        let command = jam.update(&JAM, command, &turned_by.measured, DT);
        put_command(put, command.shifted(TotalAngle::from_degrees(1)));
        put(jam.count() as f32);
        turned_by.follow(command);
        put(BRAKING.way(Rpm::new(random.within(100.0))).get());
        put(BRAKING.speed(Degrees::new(random.within(100.0))).get());
    }
}

/// Gives everything that the mechanisms give.
pub fn walk(put: &mut dyn FnMut(f32)) {
    let mut random = Random(31);
    walk_homing(put, &mut random);
    walk_axes(put, &mut random);
    walk_jams(put, &mut random);
}
