//! Other motors than DJI's, for the programs of others to read and to drive.

use std::num::NonZeroU8;

use rc10_app::{Amps, Cascade, FeedForward, Gear, PidConfig, RpmPerSecond};
use rc10_cli::Place;
use rc10_cli::formats::dbc::Node;
use rc10_cli::robot::description::Description;
use rc10_cli::robot::motor::Motor;
use rc10_motor::cybergear::{self, Address};
use rc10_motor::damiao::{self, Control, models::J4310};
use rc10_motor::unitree;
use rc10_motor::vesc::{self, Currents, ElectricalScale, StatusRates};

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
    let unitree = unitree::signals::messages(&unitree::ModuleConfig::new(3, 2));
    let mut nodes: Vec<_> = bus().motors.iter().map(Node::from).collect();
    nodes.extend([
        node("left wheel", vesc(3), vesc::signals::NOT_IN_DBC),
        node("right wheel", vesc(4), vesc::signals::NOT_IN_DBC),
        node("leg", unitree.into_iter().collect(), unitree::signals::NOT_IN_DBC),
    ]);
    nodes
}

/// In MIT mode, as it is sold: the driver finds a motor in the mode of its configuration.
fn damiao() -> Motor {
    let control = Control::Mit(Cascade {
        speed: PidConfig::within(7.0).kp(0.063).ki(0.5),
        angle: PidConfig::within(150.0).kp(1.3),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    });
    let config = damiao::Config::new(J4310, DAMIAO_ID.into(), DAMIAO_MASTER, control);
    Motor::new("joint", Place::Bus(1), config.device())
}

fn cybergear() -> Motor {
    let address = Address { motor: CYBERGEAR_ID, host: 0xFD };
    let config = cybergear::Config::new(&cybergear::models::CYBERGEAR, address);
    Motor::new("wrist", Place::Bus(1), config.device())
}
