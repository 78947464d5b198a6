//! The signal table against the codec.

use std::collections::BTreeSet;

use rc10_can::CanFrame;
use rc10_can::embedded_can::ExtendedId;
use rc10_motor::cybergear::signals::{self, NOT_IN_DBC, Scaled};
use rc10_motor::cybergear::{Address, Model};
use rc10_motor::signals::Message;
use rc10_sim::Random;

use super::values::{PARAMETERS, values};
use super::{ADDRESS, models};
use crate::motors::{assert_same, by_table};

fn messages(model: &Model, address: Address) -> Vec<Message> {
    let scaled = Box::leak(Box::new(Scaled::of(model)));
    signals::messages(model, address, scaled).into_iter().collect()
}

#[test]
fn the_table_reads_ten_thousand_frames_as_the_codec_does() {
    let mut random = Random::new(1);
    let mut seen = BTreeSet::new();
    let mut frames = 0;
    let mut compared = 0;
    let tables: Vec<_> = models().map(|(model, _)| (model, messages(model, ADDRESS))).collect();
    while frames < 10_000 {
        for (model, table) in &tables {
            for message in table.iter().filter(|it| it.from_device && it.is_plain()) {
                let mut data = random.bits().to_le_bytes();
                if message.name.ends_with("PARAMETER") {
                    let choice = usize::try_from(random.bits() % 11).unwrap();
                    let rest = [0x7005, 0x7028];
                    let all = PARAMETERS.iter().map(|(index, _)| index.0).chain(rest);
                    let index = all.into_iter().nth(choice).unwrap();
                    data[..2].copy_from_slice(&index.to_le_bytes());
                }
                let frame = CanFrame::eight_bytes(message.id, data);
                let ours = values(message.name, &frame, model);
                frames += 1;
                // What is no number, our codec does not hand out.
                if by_table(message, &frame).iter().any(|(_, value)| !value.is_finite()) {
                    continue;
                }
                assert_same(message, &frame, &ours, |value| 4e-6 * value.abs().max(1.0));
                compared += ours.len();
                seen.extend(ours.iter().map(|(name, _)| (message.name, *name)));
            }
        }
    }
    assert!(compared > 40_000, "{compared}");
    let all: BTreeSet<_> = models()
        .flat_map(|(model, _)| messages(model, ADDRESS))
        .filter(|message| message.from_device && message.is_plain())
        .flat_map(|message| message.signals.iter().map(move |signal| (message.name, signal.name)))
        .collect();
    assert_eq!(seen, all);
}

#[test]
fn messages_have_names_and_identifiers_of_their_own() {
    for (model, _) in models() {
        let mut all = messages(model, ADDRESS);
        assert_eq!(all.len(), if model.saves { 18 } else { 15 });
        all.retain(Message::is_plain);
        assert_eq!(all.len(), if model.saves { 13 } else { 12 });
        let ids: BTreeSet<_> = all.iter().map(|message| CanFrame::key_of(message.id)).collect();
        let names: BTreeSet<_> = all.iter().map(|message| message.name).collect();
        assert_eq!((ids.len(), names.len()), (all.len(), all.len()));
    }
    assert!(NOT_IN_DBC.iter().any(|line| line.contains("torque")));
}

/// Frames of a host are read as the device reads them.
#[test]
fn commands_in_the_table_are_the_devices() {
    use rc10_sim::cybergear::wire::{Command, read};
    for (model, theirs) in models() {
        for message in messages(model, ADDRESS).iter().filter(|it| !it.from_device && it.is_plain())
        {
            let mut data = [0x05, 0x70, 0, 0, 2, 0, 0, 0];
            if message.name.ends_with("SAVE") || message.name.ends_with("BIT_RATE") {
                data = [1, 2, 3, 4, 5, 6, 7, 8];
            }
            if message.name.ends_with("STOP") || message.name.ends_with("ZERO") {
                data[0] = 1;
            }
            if message.name.ends_with("SET_REPORT") {
                data = [1, 2, 3, 4, 5, 6, 1, 0];
            }
            let (to, host, command) =
                read(&CanFrame::eight_bytes(message.id, data), theirs).unwrap();
            assert_eq!((to, host), (ADDRESS.motor, ADDRESS.host));
            let wanted = match message.name.split_once('_').unwrap().1 {
                "ENABLE" => Command::Enable,
                "STOP" => Command::Stop { clear: true },
                "SET_ZERO" => Command::SetZero,
                "READ_PARAMETER" => Command::Read(0x7005),
                "WRITE_PARAMETER" => Command::Write(0x7005, [2, 0, 0, 0]),
                "IDENTIFY" => Command::Identify,
                "SET_REPORT" => Command::Report(true),
                "SAVE" | "SET_BIT_RATE" => Command::SaveOrBitRate(data),
                other => panic!("{other}"),
            };
            assert_eq!(command, Some(wanted));
        }
    }
}

/// Bytes by hand, from the manuals' tables of types 1, 2, 7, 17 and 24.
#[test]
fn what_the_identifier_carries_is_told() {
    let (robstride, _) = models().find(|(model, _)| model.name == "RS02").unwrap();
    let table = messages(robstride, ADDRESS);
    let (motor, host) = (u32::from(ADDRESS.motor), u32::from(ADDRESS.host));
    let told = |raw: u32, data: [u8; 8], from_device: bool| {
        let frame = CanFrame::eight_bytes(ExtendedId::new(raw).unwrap(), data);
        let is_it = |it: &&Message| it.from_device == from_device && it.matches(&frame);
        let message = table.iter().rev().find(is_it)?;
        let read = |name: &str| {
            let signal = message.signals.iter().find(|signal| signal.name == name);
            // Limits are f32.
            (signal.unwrap().physical_in(&frame).unwrap() * 1e4).round() * 1e-4
        };
        let numbers: Vec<f64> = match message.name {
            "ROBSTRIDE_MOTION" => vec![read("TORQUE"), read("POSITION"), read("KP")],
            "ROBSTRIDE_FEEDBACK" | "ROBSTRIDE_REPORT" => {
                vec![read("MODE"), read("FAULT_0"), read("FAULT_2"), read("TORQUE")]
            }
            "ROBSTRIDE_SET_ID" => vec![read("NEW_ID")],
            _ => Vec::new(),
        };
        Some((message.name, numbers))
    };
    let ends = [0xFF, 0xFF, 0x80, 0, 0xFF, 0xFF, 0, 0];
    let motion = told(1 << 24 | 0xFFFF << 8 | motor, ends, false);
    // 17 N m, 12.57 rad, 500 N m/rad at the ends.
    assert_eq!(motion, Some(("ROBSTRIDE_MOTION", vec![17.0, 12.57, 500.0])));
    let state = |kind: u32, upper: u32| kind << 24 | upper << 16 | motor << 8 | host;
    let running = told(state(2, 0x84), ends, true);
    assert_eq!(running, Some(("ROBSTRIDE_FEEDBACK", vec![2.0, 0.0, 1.0, 17.0])));
    let unasked = told(state(24, 0x01), ends, true);
    assert_eq!(unasked, Some(("ROBSTRIDE_REPORT", vec![0.0, 1.0, 0.0, 17.0])));
    let none = told(state(17, 0x01), [5, 0x70, 0, 0, 0, 0, 0, 0], true);
    assert_eq!(none, Some(("ROBSTRIDE_NO_SUCH_PARAMETER", Vec::new())));
    let renamed = told(7 << 24 | 9 << 16 | host << 8 | motor, [1, 0, 0, 0, 0, 0, 0, 0], false);
    assert_eq!(renamed, Some(("ROBSTRIDE_SET_ID", vec![9.0])));
}
