use rc10_can::CanFrame;
use rc10_motor::unitree::ModuleConfig;
use rc10_motor::unitree::signals::{NOT_IN_DBC, messages};
use rc10_sim::Random;
use rc10_sim::unitree_module::{Asked, Command};

use super::values::values;
use crate::motors::assert_same;

#[test]
fn the_table_reads_what_the_codec_reads() {
    let mut random = Random::new(1);
    let table = messages(&ModuleConfig::new(3, 2));
    let mut compared = 0;
    for _ in 0..2_500 {
        for message in table.iter().filter(|message| message.is_plain() && !message.from_device) {
            let data = random.bits().to_le_bytes();
            let frame = CanFrame::eight_bytes(message.id, data);
            let read = values(message.name, &frame);
            assert_same(message, &frame, &read, |value| 2e-7 * value.abs());
            compared += read.len();
        }
    }
    assert_eq!(compared, 2_500 * 8);
}

#[test]
fn each_message_is_what_its_name_says_to_the_module() {
    let asked = |name: &str| {
        let table = messages(&ModuleConfig::new(3, 2));
        let message = table.iter().find(|message| message.name == name).unwrap();
        let frame = CanFrame::eight_bytes(message.id, [0; 8]);
        let command = Command::unpack(&frame).unwrap();
        assert_eq!((command.module, command.motor), (3, 2));
        assert!(!message.from_device && message.len == 8);
        command.asked.unwrap()
    };
    let status = |asked| match asked {
        Asked::Control { status, answered: true, .. } => Some(status),
        _ => None,
    };
    assert_eq!(status(asked("UNITREE_GO_LOCK")), Some(0));
    assert_eq!(status(asked("UNITREE_GO_CONTROL")), Some(1));
    assert!(matches!(asked("UNITREE_GO_SET_GAINS"), Asked::SetGains(_)));
    assert_eq!(asked("UNITREE_GO_READ_GAINS"), Asked::ReadGains);
    assert_eq!(NOT_IN_DBC.len(), 3);
}
