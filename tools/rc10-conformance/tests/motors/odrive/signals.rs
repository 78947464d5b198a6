//! The signal table says what the codec says.

use proptest::array::uniform8;
use proptest::prelude::*;
use rc10_app::NewtonMetres;
use rc10_can::CanFrame;
use rc10_motor::odrive::signals::{NOT_IN_DBC, messages};
use rc10_motor::odrive::{
    AxisState, Command, Config, Control, ControlMode, Firmware, InputMode, Node, ODrive, Rates,
};
use rc10_motor::signals::Message;
use rc10_motor::{CanMotor, Ownership};

use super::values::{NODE, config, values};
use crate::motors::{assert_same, by_table, cases};

fn of_0_5() -> Config {
    let rates = Rates { temperatures: 0, ..config().rates };
    Config { firmware: Firmware::V0_5, rates, ..config() }
}

/// The messages that the axis sends as it is set up.
fn own(config: &Config) -> Vec<Message> {
    let ids = ODrive::new(*config).unwrap().can_ids();
    let sends = |message: &Message| {
        message.from_device && ids.received().iter().any(|it| it.pattern.id() == message.id)
    };
    messages(config).unwrap().into_iter().filter(sends).collect()
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn every_signal_is_what_the_codec_says(
        bytes in uniform8(any::<u8>()), which in 0..5_usize, old: bool,
    ) {
        let config = if old { of_0_5() } else { config() };
        let own = own(&config);
        let message = &own[which % own.len()];
        let frame = CanFrame::data_frame(message.id, &bytes).unwrap();
        let ours = values(message.name, &frame, &config.firmware);
        if ours.is_empty() {
            // Refused: only for what is no number.
            let table = by_table(message, &frame);
            prop_assert!(table.iter().any(|(_, value)| !value.is_finite()), "{}", message.name);
            return Ok(());
        }
        assert_same(message, &frame, &ours, |_| 0.0);
    }

    #[test]
    fn every_command_is_in_the_table(a in -50.0..50.0_f32, b in -30.0..30.0_f32, c in -30.0..30.0_f32) {
        let torque = NewtonMetres::new;
        let modes = Command::Modes(ControlMode::Position, InputMode::Trapezoid);
        let limits = Command::Limits { velocity: a.abs(), current: rc10_app::Amps::new(b.abs()) };
        let in_position = Config { control: Control::Position(InputMode::Trapezoid), ..config() };
        let in_velocity = Config { control: Control::Velocity(InputMode::VelocityRamp), ..config() };
        for (config, name, command, wanted) in [
            (config(), "ODRIVE_SET_TORQUE", Command::Torque(torque(a)), vec![a]),
            (in_velocity, "ODRIVE_SET_VELOCITY",
                Command::Velocity { velocity: a, torque: torque(b) }, vec![a, b]),
            (in_position, "ODRIVE_SET_POSITION",
                Command::Position { position: a, velocity: b, torque: torque(c) }, vec![a, b, c]),
            (config(), "ODRIVE_SET_LIMITS", limits, vec![a.abs(), b.abs()]),
            (config(), "ODRIVE_SET_STATE", Command::State(AxisState::CLOSED_LOOP), vec![8.0]),
            (config(), "ODRIVE_SET_MODES", modes, vec![3.0, 5.0]),
            (config(), "ODRIVE_CLEAR_ERRORS", Command::ClearErrors, vec![]),
        ] {
            let all = messages(&config).unwrap();
            let message = all.iter().find(|message| message.name == name).unwrap();
            let frame = command.pack(Node::new(NODE).unwrap()).unwrap();
            prop_assert_eq!((frame.id(), frame.len()), (message.id, usize::from(message.len)));
            let told = by_table(message, &frame);
            prop_assert_eq!(told.len(), wanted.len());
            for ((_, told), wanted) in told.into_iter().zip(wanted) {
                prop_assert!((told - f64::from(wanted)).abs() <= 0.000_501, "{} {}", name, told);
            }
        }
    }
}

#[test]
fn the_table_names_what_is_on_the_wire() {
    for config in [config(), of_0_5()] {
        let wiring = ODrive::new(config).unwrap().can_ids();
        let all = messages(&config).unwrap();
        let heard = own(&config);
        assert_eq!(heard.len(), wiring.received().len());
        assert!(heard.iter().all(Message::is_plain));
        assert!(wiring.transmitted().iter().all(|transmit| transmit.ownership == Ownership::Whole));
        for name in ["ODRIVE_SET_TORQUE", "ODRIVE_SET_LIMITS", "ODRIVE_CLEAR_ERRORS"] {
            let is_plain = |it: &&Message| it.name == name && it.is_plain() && !it.from_device;
            assert_eq!(all.iter().filter(is_plain).count(), 1, "{name}");
        }
    }
    assert!(!NOT_IN_DBC.is_empty());
    assert!(messages(&Config { node: 63, ..config() }).is_err());
}

#[test]
fn set_bits_and_states_have_the_codecs_texts() {
    for config in [config(), of_0_5()] {
        let heartbeat = messages(&config).unwrap()[0];
        let mut bits = 0;
        for signal in heartbeat.signals.iter().filter(|signal| signal.start < 32) {
            let text = config.firmware.fault(1 << signal.start).unwrap().text;
            assert!(signal.values().eq([(1, text)]));
            assert_eq!(signal.name, format!("ERROR_{}", signal.start));
            bits += 1;
        }
        assert_eq!(bits, config.firmware.errors.len());
        let state = heartbeat.signals.iter().find(|signal| signal.name == "AXIS_STATE").unwrap();
        for (number, name) in state.values() {
            let state = AxisState::new(u8::try_from(number).unwrap());
            assert_eq!(state.name(), Some(name));
        }
        assert_eq!(state.values().count(), 15);
    }
    let own = Firmware { version: "own", errors: &[], ..Firmware::V0_6 };
    let signals = messages(&Config { firmware: own, ..config() }).unwrap()[0].signals;
    assert_eq!(signals.len(), 1);
}
