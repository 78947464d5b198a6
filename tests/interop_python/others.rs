//! Other motors than DJI's, for the programs of others to read and to drive.

use std::num::NonZeroU8;

use rc10_app::{Amps, Gear};
use rc10_cli::dbc::Node;
use rc10_cli::description::Description;
use rc10_cli::motor::{Device, Motor, Place};
use rc10_motor::MotorName;
use rc10_motor::cybergear::{self, Address};
use rc10_motor::damiao::signals::Scaled;
use rc10_motor::damiao::{self, Control, models::J4310};
use rc10_motor::signals::Message;
use rc10_motor::unitree::{self, wire::module::Module};
use rc10_motor::vesc::{self, Currents, ElectricalScale, StatusRates, VescId};
use rc10_sim::cybergear::{CYBERGEAR, CyberGear};
use rc10_sim::damiao::{Damiao, DamiaoConfig};

/// The identifiers that the scripts know.
pub const DAMIAO_ID: u8 = 1;
pub const DAMIAO_MASTER: u16 = 0x11;
pub const CYBERGEAR_ID: u8 = 0x7F;

/// Those that a driver drives. On one bus: none takes another's frames for its own.
pub fn bus() -> Description {
    Description { motors: vec![damiao(), cybergear()], buses: 1, ..Description::default() }
}

/// The nodes of a bus with those, two VESCs and a Unitree motor behind a module.
pub fn nodes() -> Vec<Node> {
    let status = StatusRates {
        status_1: 200,
        status_2: 5,
        status_3: 5,
        status_4: 10,
        status_5: 200,
        status_6: 5,
    };
    let vesc = |id| {
        let scale = ElectricalScale::new(NonZeroU8::new(7).unwrap(), Gear::DIRECT);
        let (limit, brake, handbrake) = (Amps::new(40.0), Amps::new(15.0), Amps::new(20.0));
        let currents = Currents { limit, brake, handbrake };
        let config = vesc::Config::new(id, scale, currents);
        vesc::signals::messages(&vesc::Config { status, ..config }).into_iter().collect()
    };
    let node = |label: &str, messages, not_in_dbc| Node {
        label: label.to_owned(),
        comment: String::new(),
        messages,
        not_in_dbc,
    };
    let unitree =
        unitree::signals::messages(Module::FACTORY, unitree::wire::Address::new(2).unwrap());
    let mut nodes: Vec<_> = bus().motors.iter().map(Node::from).collect();
    nodes.extend([
        node("left wheel", vesc(3), vesc::signals::NOT_IN_DBC),
        node("right wheel", vesc(4), vesc::signals::NOT_IN_DBC),
        node("leg", unitree.into_iter().collect(), unitree::signals::NOT_IN_DBC),
    ]);
    nodes
}

fn damiao() -> Motor {
    fn messages() -> Vec<Message> {
        static SCALED: Scaled = Scaled::of(&J4310.limits);
        let motor = damiao::Damiao::new(damiao::Config::new(
            J4310,
            DAMIAO_ID.into(),
            DAMIAO_MASTER,
            Control::Velocity,
        ))
        .unwrap();
        damiao::signals::messages(&motor, &SCALED).into_iter().collect()
    }
    let device = Device::Can {
        name: MotorName { model: "DM-J4310", id: DAMIAO_ID.into() },
        twin: |wire, inertia| {
            let config = DamiaoConfig::j4310(DAMIAO_ID.into(), DAMIAO_MASTER);
            Ok(wire.add(Damiao::new(&config), config.plant.with_load_inertia(inertia)))
        },
        messages,
        not_in_dbc: damiao::signals::NOT_IN_DBC,
    };
    Motor::with_device("joint", Place::Bus(1), device)
}

fn cybergear() -> Motor {
    fn messages() -> Vec<Message> {
        static SCALED: cybergear::signals::Scaled =
            cybergear::signals::Scaled::of(&cybergear::models::CYBERGEAR);
        let address = Address { motor: CYBERGEAR_ID, host: 0xFD };
        let model = &cybergear::models::CYBERGEAR;
        cybergear::signals::messages(model, address, &SCALED).into_iter().collect()
    }
    let device = Device::Can {
        name: MotorName { model: "CyberGear", id: CYBERGEAR_ID.into() },
        twin: |wire, inertia| {
            let plant = CYBERGEAR.plant().with_load_inertia(inertia);
            Ok(wire.add(CyberGear::new(cybergear::Config::new(&CYBERGEAR, CYBERGEAR_ID)), plant))
        },
        messages,
        not_in_dbc: cybergear::signals::NOT_IN_DBC,
    };
    Motor::with_device("wrist", Place::Bus(1), device)
}
