//! The simulated twin of each device, and the messages in its frames.

use anyhow::{Context, Result, bail, ensure};
use rc10_motor::dji::FeedbackRate;
use rc10_motor::signals::Message;
use rc10_motor::{Device, Place, cybergear, damiao, dji, lk, odrive, unitree, vesc};
use rc10_sim::damiao::{DamiaoConfig, Mode};
use rc10_sim::odrive::Version;
use rc10_sim::{Bus, Esc, EscConfig, Line, Nonlinear};
use rc10_time::Micros;

use crate::robot::motor::{Motor, Plant};

impl Motor {
    /// The messages in the frames of the device.
    pub fn messages(&self) -> Vec<Message> {
        self.frames().0
    }

    /// The messages in the frames of the device, and facts about the frames that a DBC file cannot
    /// express: a sentence each.
    pub fn frames(&self) -> (Vec<Message>, &'static [&'static str]) {
        match &self.plant.own {
            Some(own) => (own.messages.to_vec(), own.not_in_dbc),
            None => frames(&self.device),
        }
    }

    /// Puts the motor's simulated twin on its wire or line. Fails if there is no such bus or line,
    /// no twin of the device for it, or the identifier is invalid.
    pub fn plug_in(&self, wires: &[rc10_sim::Bus], lines: &[rc10_sim::Line]) -> Result<Esc> {
        let Plant { inertia, load, nonlinear, travel, rotor, own } = &self.plant;
        let index = |number: u8| usize::from(number).checked_sub(1);
        let nowhere = || format!("there is no {}", self.on);
        let twin = match self.on {
            Place::Bus(number) => {
                let wire = index(number).and_then(|at| wires.get(at)).with_context(nowhere)?;
                match own {
                    Some(own) => (own.twin)(wire, *inertia)?,
                    None => on_bus(&self.device, wire, *inertia)?,
                }
            }
            Place::Line(number) => {
                let line = index(number).and_then(|at| lines.get(at)).with_context(nowhere)?;
                on_line(&self.device, line, *inertia)?
            }
        };
        twin.set_load(self.sign() * load);
        if *nonlinear != Nonlinear::NONE {
            // Seen from the other side an angle and a torque change their signs.
            let nonlinear = Nonlinear {
                gravity_torque: self.sign() * nonlinear.gravity_torque,
                gravity_offset: self.sign() * nonlinear.gravity_offset,
                ..*nonlinear
            };
            twin.set_plant(rc10_sim::Plant { nonlinear, ..twin.plant() });
        }
        if let Some(travel) = travel {
            let mut travel = travel.map(|end| self.sign() * end);
            travel.sort_by(f64::total_cmp);
            twin.set_travel(Some(travel));
        }
        if let Some(degrees) = rotor {
            twin.set_rotor_angle(*degrees);
        }
        Ok(twin)
    }
}

/// Puts a twin on a wire, with an inertia (kg m²) on its shaft.
fn on_bus(device: &Device, wire: &Bus, inertia: f64) -> Result<Esc> {
    match device {
        Device::Dji(config) => dji(config, wire, inertia),
        Device::Vesc(config) => vesc(config, wire, inertia),
        Device::Damiao(config) => damiao(config, wire, inertia),
        Device::CyberGear(config) => cybergear(config, wire, inertia),
        Device::Lk(config) => lk(config, wire, inertia),
        Device::ODrive(config) => odrive(config, wire, inertia),
        Device::GoModule(unitree::ModuleConfig { module, motor, .. }) => {
            let plant = rc10_sim::unitree_module::plant().with_load_inertia(inertia);
            let module = rc10_sim::unitree_module::UnitreeModule::new(*module)?;
            Ok(wire.add(module.motor(*motor)?, plant))
        }
        Device::GoM8010(_) => bail!("it has no CAN: it is plugged into a bus"),
        _ => no_twin(device),
    }
}

/// Puts a twin on a line, with an inertia (kg m²) on its shaft.
fn on_line(device: &Device, line: &Line, inertia: f64) -> Result<Esc> {
    let Device::GoM8010(config) = device else {
        bail!("it has only CAN: it is plugged into a line")
    };
    let plant = rc10_sim::unitree_line::plant().with_load_inertia(inertia);
    Ok(line.add(rc10_sim::unitree_line::GoM8010::new(config.id), plant))
}

fn no_twin(device: &Device) -> Result<Esc> {
    bail!(
        "there is no simulated {}: give the motor a twin of its own, by `Plant::with_twin`",
        device.name().model
    )
}

fn dji(config: &dji::Config, wire: &Bus, inertia: f64) -> Result<Esc> {
    let twin = match config.model {
        model if *model == dji::M3508 => rc10_sim::Model::C620,
        model if *model == dji::M2006 => rc10_sim::Model::C610,
        model if *model == dji::GM6020_CURRENT => rc10_sim::Model::Gm6020Current,
        model if *model == dji::GM6020_VOLTAGE => rc10_sim::Model::Gm6020Voltage,
        _ => return no_twin(&config.device()),
    };
    let mut esc = EscConfig::new(twin, config.id);
    esc.plant = esc.plant.with_load_inertia(inertia);
    esc.rate = match config.rate {
        FeedbackRate::Hz1000 => rc10_sim::FeedbackRate::Hz1000,
        FeedbackRate::Hz500 => rc10_sim::FeedbackRate::Hz500,
        FeedbackRate::Hz250 => rc10_sim::FeedbackRate::Hz250,
        FeedbackRate::Hz125 => rc10_sim::FeedbackRate::Hz125,
    };
    let esc = wire.add_esc(esc)?;
    if config.gear != config.model.gear {
        esc.set_gear(config.gear.ratio().into());
    }
    Ok(esc)
}

fn vesc(config: &vesc::Config, wire: &Bus, inertia: f64) -> Result<Esc> {
    let plant = rc10_sim::vesc::outrunner_270_kv().with_load_inertia(inertia);
    let twin = rc10_sim::vesc::VescConfig {
        status_hz: config.status.all(),
        timeout: config.timeout,
        pole_pairs: config.scale.pole_pairs.get(),
        encoder_on_shaft: config.encoder_on_shaft,
        ..rc10_sim::vesc::VescConfig::new(config.id, plant)
    };
    Ok(geared(wire.add(rc10_sim::vesc::Vesc::new(twin)?, plant), &plant, config.scale.gear.ratio()))
}

/// Replaces the plant's gearbox by the one in the robot's table.
fn geared(esc: Esc, plant: &rc10_sim::Plant, ratio: f32) -> Esc {
    if (plant.gear_ratio - f64::from(ratio)).abs() > 1e-6 {
        esc.set_gear(ratio.into());
    }
    esc
}

fn damiao(config: &damiao::Config, wire: &Bus, inertia: f64) -> Result<Esc> {
    let &damiao::Config { model, can_id, master_id, ref control, timeout, .. } = config;
    let mut twin = match model {
        model if model.name == damiao::models::J4310.name => DamiaoConfig::j4310(can_id, master_id),
        model if model.name == damiao::models::J8009.name => DamiaoConfig::j8009(can_id, master_id),
        _ => return no_twin(&config.device()),
    };
    twin.mode = match control.mode() {
        damiao::Mode::Mit => Mode::Mit,
        damiao::Mode::PositionVelocity => Mode::PositionVelocity,
        damiao::Mode::Velocity => Mode::Velocity,
        damiao::Mode::ForcePosition => Mode::ForcePosition,
    };
    twin.timeout = steps(timeout)?;
    let plant = twin.plant.with_load_inertia(inertia);
    Ok(wire.add(rc10_sim::damiao::Damiao::new(&twin), plant))
}

/// A time-out as Damiao and RobStride count it: in 50 µs.
fn steps(timeout: Micros) -> Result<u32> {
    Ok(u32::try_from(timeout.get() / 50)?)
}

fn cybergear(config: &cybergear::Config, wire: &Bus, inertia: f64) -> Result<Esc> {
    let known = rc10_sim::cybergear::ALL.into_iter().find(|it| it.name == config.model.name);
    let Some(known) = known else { return no_twin(&config.device()) };
    let mut model = *known;
    model.position = config.model.limits.position.into();
    let plant = model.plant().with_load_inertia(inertia);
    let twin = rc10_sim::cybergear::CyberGear::new(&model, config.address.motor)
        .with_timeout(steps(config.timeout)?);
    Ok(wire.add(twin, plant))
}

fn lk(config: &lk::Config, wire: &Bus, inertia: f64) -> Result<Esc> {
    let (settings, plant) = match config.model {
        model if model.name == lk::models::MG4010E_I10.name => {
            (rc10_sim::lk::Settings::mg(config.id), rc10_sim::lk::mg4010e_i10())
        }
        model if model.name == lk::models::MF9025.name => {
            (rc10_sim::lk::Settings::mf(config.id), rc10_sim::lk::mf9025())
        }
        _ => return no_twin(&config.device()),
    };
    let multi_motor = config.commands == lk::Commands::MultiMotor;
    let settings = rc10_sim::lk::Settings { multi_motor, ..settings };
    let drive = rc10_sim::lk::Drive::new(settings).context("no such LK drive")?;
    Ok(wire.add(drive, plant.with_load_inertia(inertia)))
}

fn odrive(config: &odrive::Config, wire: &Bus, inertia: f64) -> Result<Esc> {
    let period = |hz: u16| Micros::new(1_000_000 / u64::from(hz.max(1)));
    let odrive::Rates { estimates, heartbeat, currents, temperatures, supply } = config.rates;
    let others: Vec<u16> =
        [currents, temperatures, supply].into_iter().filter(|rate| *rate > 0).collect();
    ensure!(
        others.iter().all(|rate| Some(rate) == others.first()),
        "the simulated ODrive sends currents, temperatures and supply at one rate"
    );
    let settings = rc10_sim::odrive::Settings {
        version: if config.firmware.has_temperatures { Version::V0_6 } else { Version::V0_5 },
        estimates_every: period(estimates),
        heartbeat_every: period(heartbeat),
        others_every: others.first().map(|rate| period(*rate)),
        ..rc10_sim::odrive::Settings::new(config.node)
    };
    let plant = rc10_sim::odrive::d6374_8to1().with_load_inertia(inertia);
    let axis = rc10_sim::odrive::Axis::new(settings).context("no such ODrive")?;
    Ok(geared(wire.add(axis, plant), &plant, config.gear.ratio()))
}

fn frames(device: &Device) -> (Vec<Message>, &'static [&'static str]) {
    // Scales follow from the model, and live as long as the messages: to the end of the program.
    match device {
        Device::Dji(config) => {
            let messages = dji::signals::messages(config.model, config.id);
            (messages.into_iter().flatten().collect(), dji::signals::NOT_IN_DBC)
        }
        Device::Vesc(config) => {
            (vesc::signals::messages(config).to_vec(), vesc::signals::NOT_IN_DBC)
        }
        Device::Damiao(config) => {
            let scaled = Box::leak(Box::new(damiao::signals::Scaled::of(&config.model.limits)));
            (damiao::signals::messages(config, scaled).to_vec(), damiao::signals::NOT_IN_DBC)
        }
        Device::CyberGear(config) => {
            let scaled = Box::leak(Box::new(cybergear::signals::Scaled::of(&config.model)));
            let messages = cybergear::signals::messages(&config.model, config.address, scaled);
            (messages.to_vec(), cybergear::signals::NOT_IN_DBC)
        }
        Device::Lk(config) => {
            let messages = lk::signals::messages(config).into_iter().flatten();
            (messages.collect(), lk::signals::NOT_IN_DBC)
        }
        Device::ODrive(config) => {
            let messages = odrive::signals::messages(config).into_iter().flatten();
            (messages.collect(), odrive::signals::NOT_IN_DBC)
        }
        Device::GoModule(config) => {
            (unitree::signals::messages(config).to_vec(), unitree::signals::NOT_IN_DBC)
        }
        _ => (Vec::new(), &[]),
    }
}

#[cfg(test)]
mod tests {
    use rc10_motor::dji::M3508;
    use rc10_sim::{BusConfig, World};

    use super::*;
    use rc10_motor::rc10_app::Direction;

    /// An arm is the same arm when its motor looks the other way: what it counts is negative then.
    #[test]
    fn a_weight_pulls_down_whichever_way_its_motor_looks() {
        let nonlinear = Nonlinear {
            gravity_torque: 1.0,
            gravity_offset: 30.0,
            backlash: 2.0,
            ..Nonlinear::NONE
        };
        let fall = |direction| {
            let mut world = World::new(1);
            let wire = world.add_bus(BusConfig::default());
            let plant = Plant { nonlinear, ..Plant::inertia(0.05) };
            let arm = Motor { plant, direction, ..Motor::dji_on("arm", 1, &M3508, 1) };
            let twin = arm.plug_in(&[wire], &[]).unwrap();
            world.advance(rc10_time::Micros::from_millis(300));
            let state = twin.state();
            [state.load_degrees, state.output_degrees].map(|degrees| arm.sign() * degrees)
        };
        let [load, shaft] = fall(Direction::Forward);
        // It began 30 degrees over the horizontal.
        assert!(load < -20.0 && (shaft - load - 1.0).abs() < 1e-6, "{load} {shaft}");
        let other = fall(Direction::Reversed);
        assert!((other[0] - load).abs() < 1e-6 && (other[1] - shaft).abs() < 1e-6, "{other:?}");
    }
}
