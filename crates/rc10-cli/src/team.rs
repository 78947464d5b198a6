//! The robot of `rc10-robot`, for the tools. It is the robot of the `rc10` command.

mod operator;

use anyhow::{Context, Result};
use rc10_motor::{ArmState, MotorBus, Names, SafeState};
use rc10_robot::table::{BASE, BUSES, LIFT, LIFT_TOP, Name, RECEIVER, WHEELS};
use rc10_robot::{Shared, chassis, driver, imu, mechanisms};
use rc10_sim::imu::Hwt101;
use rc10_sim::{Chassis, Nanos, Serial, World};
use rc10_tasks::{remote, status};

use crate::description::{Base, Description, SerialPart};
use crate::emulate::build_firmware;
use crate::motor::{Device, Motor, Place};
use crate::remote::{Receiver, ReceiverPort, RemoteControl};
use crate::robot::Robot;

/// The ports and pins of its parts: `firmware/src/board.rs`.
const REMOTE_UART: u8 = 5;
const PULSE_PIN: (char, usize) = ('F', 8);
const IMU_UART: u8 = 7;

/// The description of the team's robot.
#[must_use]
pub fn description() -> Description {
    let chassis = Chassis {
        wheel_radius: BASE.wheel_radius.into(),
        half_length: BASE.half_wheelbase.into(),
        half_width: BASE.half_track.into(),
        ..Chassis::default()
    };
    Description {
        motors: Name::ALL.iter().map(motor).collect(),
        buses: BUSES as u8,
        base: Some(Base { wheels: WHEELS.map(|name| name as usize), chassis }),
        remote: Some(RemoteControl {
            receiver: RECEIVER,
            receivers: Receiver::ALL.into(),
            uart: REMOTE_UART,
            pulse_pin: PULSE_PIN,
            script: operator::SCRIPT.into(),
            repeats_after: Some(operator::SCRIPT_LENGTH),
            lost: Vec::new(),
        }),
        serials: vec![SerialPart { label: "IMU", uart: IMU_UART, twin: imu_twin }],
        firmware: Some(build_firmware),
        ..Description::default()
    }
}

fn motor(name: &Name) -> Motor {
    // kg m² and N m at the output shaft; our estimates. The wheels get theirs from the base, and
    // the weight of the lift pulls every one of its shafts down. It hangs a quarter of a turn above
    // its floor at power-on: so one can see whether it is held or let go.
    let (inertia, load) = match *name {
        Name::Yaw => (0.02, 0.0),
        Name::Pitch => (0.01, 0.0),
        Name::Feeder => (0.002, 0.0),
        name if LIFT.contains(&name) => (0.01, -1.0),
        _ => (0.0, 0.0),
    };
    let travel = LIFT.contains(name).then_some([-90.0, f64::from(LIFT_TOP) + 30.0]);
    let entry = name.entry();
    let rc10_motor::Device::Dji(config) = entry.config else { unreachable!() };
    let rc10_motor::dji::Config { model, id, direction, rate, .. } = config;
    let device = Device::Dji { model, id, rate };
    let holds = entry.safety.state != SafeState::Coast;
    let on = Place::Bus(entry.on.bus().unwrap_or_default());
    Motor { direction, inertia, load, travel, holds, ..Motor::with_device(entry.label, on, device) }
}

fn imu_twin(world: &mut World, base: Option<&rc10_sim::Base>) -> Result<Serial> {
    let base = base.context("it must stand on a base")?;
    let phase = world.chance(Nanos::new(5_000_000));
    Ok(world.add_serial(Hwt101::SERIAL, Hwt101::new(base, phase)))
}

/// The robot with all its tasks, before it runs.
#[must_use]
pub fn robot<'r>(io: &'r Shared<'_>, buses: [MotorBus<'r>; BUSES]) -> Robot<'r> {
    let robot = Robot::new(description()).switch(&io.switch);
    let robot = buses
        .into_iter()
        .zip(&io.ports.buses)
        .fold(robot, |robot, (bus, port)| robot.bus(bus, port));
    robot
        .task(chassis::run(io))
        .task(mechanisms::run(io))
        .task(driver::run(io))
        .task(status::run(io, [("IMU", &io.imu_reception)]))
        .remote(&io.remote_reception, async |receiver, port| match port {
            ReceiverPort::Serial(port) => remote::listen(io, receiver, port).await,
            ReceiverPort::Pulses(mut port) => {
                remote::listen_pulses(io, async || port.rising_edge().await).await
            }
        })
        .serial(&io.imu_reception, async |port| imu::run(io, port).await)
        .signal("lift tilt", "deg", |_| {
            // They stand anywhere until each has been set to zero at the bottom.
            if io.switch.state() == ArmState::Disarmed {
                return None;
            }
            let angles = LIFT.map(|name| io.motor(name).status().feedback.total_angle);
            let [lowest, highest] = [angles.iter().min()?, angles.iter().max()?];
            Some(highest.minus(*lowest).microdegrees() as f64 * 1e-6)
        })
        .yaw(|now| {
            let heading = io.heading.read()?.value.total(now)?;
            Some(heading.microdegrees() as f64 * 1e-6)
        })
}
