//! The robot for the tools on a PC, and the `rc10` command, which knows it.

use std::process::ExitCode;

use crate::table::{BASE, BUSES, CONSOLE, LIFT, LIFT_TOP, Name, RECEIVER};
use crate::{Motors, Ports, Shared, chassis, driver, imu, mechanisms, operator};
use anyhow::{Context, Result};
use rc10_motor::{MotorBus, Started};
use rc10_sim::imu::Hwt101;
use rc10_sim::{Nanos, Serial, World};
use rc10_tasks::status;

use rc10_cli::run::build::build_firmware_of;
use rc10_cli::{Base, Description, Plant, RemoteControl, Robot, SerialPart};

/// UART of the IMU, as in `firmware/board/src/h723zg.rs`.
const IMU_UART: u8 = 7;

/// The description of the team's robot.
#[must_use]
pub fn description() -> Description {
    Description {
        base: Some(Base::of(BASE.wheels, &BASE.geometry)),
        remote: Some(RemoteControl::new(
            RECEIVER,
            &operator::SCRIPT,
            Some(operator::SCRIPT_LENGTH),
        )),
        serials: vec![SerialPart { label: "IMU", uart: IMU_UART, twin: imu_twin }],
        console: Some(CONSOLE),
        firmware: Some(|board| build_firmware_of("rc10-firmware", board)),
        ..Description::of(plant)
    }
}

/// Inertias (kg m²) and torques (N m) at the output shaft; our estimates. The wheels get theirs
/// from the base. The weight of the lift pulls each of its shafts down; it hangs a quarter of a
/// turn above its floor at power-on, so that one can see whether it is held or let go.
fn plant(name: Name) -> Plant {
    match name {
        Name::Yaw => Plant::inertia(0.02),
        Name::Pitch => Plant::inertia(0.01),
        Name::Feeder => Plant::inertia(0.002),
        lift if LIFT.contains(&lift) => Plant {
            load: -1.0,
            travel: Some([-90.0, f64::from(LIFT_TOP) + 30.0]),
            ..Plant::inertia(0.01)
        },
        _ => Plant::default(),
    }
}

fn imu_twin(world: &mut World, base: Option<&rc10_sim::Base>) -> Result<Serial> {
    let base = base.context("it must stand on a base")?;
    let phase = world.chance(Nanos::new(5_000_000));
    Ok(world.add_serial(Hwt101::SERIAL, Hwt101::new(base, phase)))
}

/// The robot with all its tasks, before it runs.
#[must_use]
pub fn robot<'r>(io: &'r Shared<'_>, buses: [MotorBus<'r>; BUSES]) -> Robot<'r> {
    robot_of(description(), io, buses)
}

/// The robot with another description, for example with another script.
#[must_use]
pub fn robot_of<'r>(
    description: Description,
    io: &'r Shared<'_>,
    buses: [MotorBus<'r>; BUSES],
) -> Robot<'r> {
    Robot::of(description, Started { buses, lines: [] }, io)
        .task(chassis::run(io))
        .task(mechanisms::run(io))
        .task(driver::run(io))
        .task(status::run(io))
        .serial(&io.imu_reception, async |port| imu::run(io, port).await)
        .yaw("heading", |now| {
            let heading = io.heading.read()?.value.total(now)?;
            Some(heading.microdegrees() as f64 * 1e-6)
        })
}

/// The `rc10` command: [`main_for`](rc10_cli::main_for) this robot.
#[must_use]
pub fn main() -> ExitCode {
    rc10_cli::main_for(&description(), |command| {
        let ports = Ports::new();
        let (io, mut motors) = (Shared::new(&ports), Motors::new());
        command.run(robot(&io, motors.start(&io.switch)?.buses))
    })
}
