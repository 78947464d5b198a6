//! `sbus-rs` and `crsf`, whose authors never saw our code, say the same of the same frames.

use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};
use rc10_module::remote::{Crsf, CrsfFrame, Sbus};
use rc10_module::{Found, Protocol};

const FRAMES: u32 = 10_000;

fn check<S: Strategy>(frames: S, agree: impl Fn(S::Value)) {
    let rng_seed = RngSeed::Fixed(10);
    let config = ProptestConfig {
        cases: FRAMES,
        rng_seed,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let checked = TestRunner::new(config).run(&frames, |frame| {
        agree(frame);
        Ok(())
    });
    checked.unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn sbus_rs_agrees() {
    let header = prop_oneof![9 => Just(0x0F_u8), 1 => any::<u8>()];
    let flags = prop_oneof![9 => 0..16_u8, 1 => any::<u8>()];
    let end =
        prop_oneof![8 => prop::sample::select(vec![0, 4, 0x14, 0x24, 0x34]), 1 => any::<u8>()];
    let taken = std::cell::Cell::new(0);
    check((header, any::<[u8; 22]>(), flags, end), |(header, channels, flags, end)| {
        let mut frame = [0; 25];
        [frame[0], frame[23], frame[24]] = [header, flags, end];
        frame[1..23].copy_from_slice(&channels);
        let theirs = sbus_rs::SbusPacket::from_array(&frame);
        match Sbus.examine(&frame) {
            Found::Frame(25, ours) => {
                let theirs = theirs.unwrap();
                assert_eq!(ours.channels, theirs.channels);
                assert_eq!(ours.digital, [theirs.flags.d1, theirs.flags.d2]);
                assert_eq!(ours.frame_lost, theirs.flags.frame_lost);
                assert_eq!(ours.failsafe, theirs.flags.failsafe);
                taken.set(taken.get() + 1);
            }
            // They look neither at flags that do not exist nor at the high half of an end.
            _ => assert!(theirs.is_err() || flags > 15 || end > 0x34, "{frame:02X?}"),
        }
    });
    assert!(taken.get() > FRAMES / 2, "{}", taken.get());
}

#[test]
fn crsf_agrees() {
    let address = prop::sample::select(vec![0xC8_u8, 0xEA, 0xEC, 0xEE]);
    let channels = prop::array::uniform16(0..2048_u16);
    check((address, channels, any::<[u8; 10]>()), |(address, channels, statistics)| {
        // Theirs packs, ours unpacks.
        let to = crsf::PacketAddress::from_u8(address).unwrap();
        let frame = crsf::Packet::RcChannels(crsf::RcChannels(channels)).into_raw(to);
        let frame = frame.data();
        assert_eq!(Crsf.examine(frame), Found::Frame(26, CrsfFrame::Channels(channels)));

        let [rssi1, rssi2, quality, snr, antenna, mode, power, rssi, down_quality, down_snr] =
            statistics;
        let theirs = crsf::LinkStatistics {
            uplink_rssi_1: rssi1,
            uplink_rssi_2: rssi2,
            uplink_link_quality: quality,
            uplink_snr: snr.cast_signed(),
            active_antenna: antenna,
            rf_mode: mode,
            uplink_tx_power: power,
            downlink_rssi: rssi,
            downlink_link_quality: down_quality,
            downlink_snr: down_snr.cast_signed(),
        };
        let frame = crsf::Packet::LinkStatistics(theirs).into_raw(to);
        let Found::Frame(14, CrsfFrame::Link(ours)) = Crsf.examine(frame.data()) else {
            panic!("{:02X?}", frame.data())
        };
        assert_eq!(ours.uplink_rssi, [-i16::from(rssi1), -i16::from(rssi2)]);
        assert_eq!((ours.uplink_quality, ours.uplink_snr), (quality, snr.cast_signed()));
        assert_eq!((ours.antenna, ours.rf_mode, ours.transmit_power), (antenna, mode, power));
        assert_eq!((ours.downlink_rssi, ours.downlink_quality), (-i16::from(rssi), down_quality));
        assert_eq!(ours.downlink_snr, down_snr.cast_signed());
    });
}

/// A damaged frame: both refuse it.
#[test]
fn crsf_agrees_on_checksums() {
    let damage = (any::<[u8; 22]>(), 2..26_usize, 1..=255_u8);
    check(damage, |(payload, at, flip)| {
        let mut frame = vec![0xC8, 24, 0x16];
        frame.extend(payload);
        let sum = (0..=255).find(|sum| {
            let whole = [&frame[..], &[*sum]].concat();
            theirs(&whole)
        });
        frame.push(sum.expect("one of all checksums is right"));
        assert!(matches!(Crsf.examine(&frame), Found::Frame(26, _)));
        frame[at] ^= flip;
        // Behind a new type stands a frame that is as long, but says something else.
        let sound = matches!(Crsf.examine(&frame), Found::Frame(..) | Found::Other(_));
        assert!(!sound && !theirs(&frame), "{frame:02X?}");
    });
}

fn theirs(frame: &[u8]) -> bool {
    let mut parser = crsf::PacketParser::<128>::new();
    parser.push_bytes(frame);
    matches!(parser.next_packet(), Some(Ok(_)))
}
