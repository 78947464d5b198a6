//! The robot of `rc10_robot::mixed`, for the tools.

use anyhow::{Context, Result};
use rc10_can::Micros;
use rc10_motor::damiao::signals::Scaled;
use rc10_motor::signals::Message;
use rc10_motor::unitree::wire::Address;
use rc10_motor::unitree::wire::module::Module;
use rc10_motor::unitree::{GoModule, ModuleConfig, Rs485Bus};
use rc10_motor::{Motor as _, MotorBus, MotorName, cybergear, damiao, lk, odrive, unitree, vesc};
use rc10_robot::mixed::{
    ARM_IDS, ARMED_AT, BUSES, FLYWHEEL, FLYWHEEL_NODE, HIP, LEGS, SCRIPT, Shared, TURRET,
    TURRET_ID, WRIST, arm, run, wheel,
};
use rc10_sim::lk::Drive;
use rc10_sim::odrive::Axis;
use rc10_sim::unitree_module::UnitreeModule;
use rc10_sim::vesc::VescConfig;
use rc10_sim::{Bus, Esc, Line};

use crate::description::{Description, LinePart};
use crate::emulate::build_line;
use crate::motor::{Device, Motor, Place};
use crate::robot::Robot;
use crate::script::Event;
use crate::script::Script;

/// The description of the mixed robot.
///
/// # Errors
/// If the robot's numbers cannot be.
pub fn description() -> Result<Description> {
    let can = |label, bus, name, twin, messages, not_in_dbc| {
        let device = Device::Can { name, twin, messages, not_in_dbc };
        Motor::with_device(label, Place::Bus(bus), device)
    };
    let vesc = vesc::Vesc::new(wheel())?.name();
    let damiao = arm()?.name();
    let hip = GoModule::new(ModuleConfig::new(HIP.0, HIP.1))?.name();
    let model = &cybergear::models::CYBERGEAR;
    let wrist = cybergear::CyberGear::new(cybergear::Config::new(model, WRIST))?.name();
    let turret = lk::Lk::new(lk::Config { id: TURRET_ID, ..TURRET })?.name();
    let axis = odrive::ODrive::new(odrive::Config { node: FLYWHEEL_NODE, ..FLYWHEEL })?.name();
    // Inertias in kg m² at the output shaft; our estimates.
    let mut motors = vec![
        Motor {
            inertia: 0.003,
            holds: true,
            ..can("wheel", 1, vesc, wheel_twin, wheel_messages, vesc::signals::NOT_IN_DBC)
        },
        Motor {
            inertia: 0.02,
            holds: true,
            ..can("arm", 1, damiao, arm_twin, arm_messages, damiao::signals::NOT_IN_DBC)
        },
        Motor {
            inertia: 0.02,
            holds: true,
            ..can("hip", 1, hip, hip_twin, hip_messages, unitree::signals::NOT_IN_DBC)
        },
        Motor {
            inertia: 0.005,
            ..can("wrist", 2, wrist, wrist_twin, wrist_messages, cybergear::signals::NOT_IN_DBC)
        },
        Motor {
            inertia: 0.02,
            holds: true,
            ..can("turret", 2, turret, turret_twin, turret_messages, lk::signals::NOT_IN_DBC)
        },
        Motor {
            inertia: 0.03,
            ..can(
                "flywheel",
                2,
                axis,
                flywheel_twin,
                flywheel_messages,
                odrive::signals::NOT_IN_DBC,
            )
        },
    ];
    for (id, (label, twin)) in (0..).zip(LEG_TWINS) {
        let name = MotorName { model: "GO-M8010-6", id };
        let device = Device::Line { name, twin };
        let leg = Motor::with_device(label, Place::Line(1), device);
        motors.push(Motor { inertia: 0.01, holds: true, ..leg });
    }
    let event = |&(at, label, _): &(u32, &'static str, _)| Event {
        at: Micros::from_millis(at.into()),
        label,
    };
    let armed = Event { at: Micros::from_millis(ARMED_AT), label: "arm" };
    Ok(Description {
        motors,
        buses: BUSES as u8,
        lines: vec![LinePart { uart: 2 }],
        script: Script {
            events: std::iter::once(armed).chain(SCRIPT.iter().map(event)).collect(),
            repeats_after: None,
        },
        firmware: Some(build_line),
        ..Description::default()
    })
}

fn wheel_twin(wire: &Bus, inertia: f64) -> Result<Esc> {
    let set = wheel();
    let plant = rc10_sim::vesc::outrunner_270_kv().with_load_inertia(inertia);
    let config = VescConfig {
        status_hz: set.status.all(),
        timeout: set.timeout,
        ..VescConfig::new(set.id.get(), plant)
    };
    Ok(wire.add(rc10_sim::vesc::Vesc::new(config)?, plant))
}

fn wheel_messages() -> Vec<Message> {
    vesc::signals::messages(&wheel()).to_vec()
}

fn arm_twin(wire: &Bus, inertia: f64) -> Result<Esc> {
    let config = rc10_sim::damiao::DamiaoConfig::j4310(ARM_IDS.0, ARM_IDS.1);
    let plant = config.plant.with_load_inertia(inertia);
    Ok(wire.add(rc10_sim::damiao::Damiao::new(&config), plant))
}

fn arm_messages() -> Vec<Message> {
    static SCALED: Scaled = Scaled::of(&damiao::models::J4310.limits);
    arm().map(|arm| damiao::signals::messages(&arm, &SCALED).to_vec()).unwrap_or_default()
}

fn hip_twin(wire: &Bus, inertia: f64) -> Result<Esc> {
    let plant = rc10_sim::unitree_module::plant().with_load_inertia(inertia);
    Ok(wire.add(UnitreeModule::new(HIP.0)?.motor(HIP.1)?, plant))
}

fn hip_messages() -> Vec<Message> {
    let hip = Module::new(HIP.0).zip(Address::new(HIP.1));
    hip.map(|(module, motor)| unitree::signals::messages(module, motor).to_vec())
        .unwrap_or_default()
}

fn wrist_twin(wire: &Bus, inertia: f64) -> Result<Esc> {
    let model = &rc10_sim::cybergear::CYBERGEAR;
    let plant = model.plant().with_load_inertia(inertia);
    Ok(wire.add(rc10_sim::cybergear::CyberGear::new(model, WRIST.motor), plant))
}

fn wrist_messages() -> Vec<Message> {
    static SCALED: cybergear::signals::Scaled =
        cybergear::signals::Scaled::of(&cybergear::models::CYBERGEAR);
    cybergear::signals::messages(&cybergear::models::CYBERGEAR, WRIST, &SCALED).to_vec()
}

fn turret_twin(wire: &Bus, inertia: f64) -> Result<Esc> {
    let drive = Drive::new(rc10_sim::lk::Settings::mg(TURRET_ID));
    let plant = rc10_sim::lk::mg4010e_i10().with_load_inertia(inertia);
    Ok(wire.add(drive.context("no such LK drive")?, plant))
}

fn turret_messages() -> Vec<Message> {
    lk::signals::messages(TURRET_ID, &TURRET).map(|all| all.to_vec()).unwrap_or_default()
}

fn flywheel_twin(wire: &Bus, inertia: f64) -> Result<Esc> {
    let heartbeat = Micros::new(1_000_000 / u64::from(FLYWHEEL.rates.heartbeat));
    let settings = rc10_sim::odrive::Settings {
        heartbeat_every: heartbeat,
        ..rc10_sim::odrive::Settings::new(FLYWHEEL_NODE)
    };
    let plant = rc10_sim::odrive::d6374_8to1().with_load_inertia(inertia);
    Ok(wire.add(Axis::new(settings).context("no such ODrive")?, plant))
}

fn flywheel_messages() -> Vec<Message> {
    odrive::signals::messages(FLYWHEEL_NODE, &FLYWHEEL).map(|all| all.to_vec()).unwrap_or_default()
}

type LegTwin = fn(&Line, f64) -> Result<Esc>;

const LEG_TWINS: [(&str, LegTwin); LEGS] = [
    ("leg 0", leg_twin::<0>),
    ("leg 1", leg_twin::<1>),
    ("leg 2", leg_twin::<2>),
    ("leg 3", leg_twin::<3>),
    ("leg 4", leg_twin::<4>),
    ("leg 5", leg_twin::<5>),
    ("leg 6", leg_twin::<6>),
    ("leg 7", leg_twin::<7>),
];

fn leg_twin<const ID: u8>(line: &Line, inertia: f64) -> Result<Esc> {
    let plant = rc10_sim::unitree_line::plant().with_load_inertia(inertia);
    Ok(line.add(rc10_sim::unitree_line::GoM8010::new(ID), plant))
}

/// The robot with its task, before it runs.
///
/// # Errors
/// If the robot's numbers cannot be.
pub fn robot<'r>(
    io: &'r Shared,
    buses: [MotorBus<'r>; BUSES],
    line: Rs485Bus<'r>,
) -> Result<Robot<'r>> {
    let robot = Robot::new(description()?).line(line, &io.line);
    let robot =
        buses.into_iter().zip(&io.buses).fold(robot, |robot, (bus, port)| robot.bus(bus, port));
    Ok(robot.task(run(io)))
}
