//! Motors that occupy any identifiers: clashes, dispatch, load of the bus.

use proptest::collection::vec;
use proptest::prelude::*;
use rc10_can::embedded_can::Id;
use rc10_can::{CanFrame, IdPattern};
use rc10_conformance::Dummy;
use rc10_motor::{
    ArmSwitch, AttachError, CanIds, CanMotor, Dispatch, Frames, Guard, MotorBus, Ownership, Rate,
    Safety, TargetKind, TargetSet,
};
use rc10_time::Micros;

use super::any;

/// Few identifiers, so that they meet.
fn few_ids() -> impl Strategy<Value = Id> {
    any::either(0..64_u16)
}

fn pattern() -> impl Strategy<Value = IdPattern> {
    prop_oneof![
        4 => few_ids().prop_map(IdPattern::exact),
        1 => (few_ids(), any::<u32>()).prop_map(|(id, mask)| IdPattern::exact(id).under(mask | 0x30)),
    ]
}

fn rate() -> impl Strategy<Value = Rate> {
    prop_oneof![any::<u16>().prop_map(Rate::Hz), Just(Rate::EveryTick), Just(Rate::Rare)]
}

fn guard() -> impl Strategy<Value = Guard> {
    let parts = (0..10_u8, any::<u8>(), any::<u8>());
    parts.prop_map(|(byte, mask, value)| Guard { byte, mask, value })
}

fn frames() -> impl Strategy<Value = Frames> {
    let ownership = prop_oneof![
        Just(Ownership::Whole),
        any::<u8>().prop_map(Ownership::Bytes),
        guard().prop_map(Ownership::Guard),
    ];
    (pattern(), any::<u8>(), rate(), ownership).prop_map(|(pattern, len, rate, ownership)| {
        Frames::new(pattern, len, rate).owned(ownership)
    })
}

fn wired() -> impl Strategy<Value = Dummy> {
    (vec(frames(), 0..=4), vec(frames(), 0..=1), vec(pattern(), 0..=1)).prop_map(
        |(receives, transmits, listens)| {
            let mut wiring = CanIds::new();
            for receive in receives {
                wiring = wiring.receives(receive);
            }
            for transmit in transmits {
                wiring = wiring.transmits(transmit);
            }
            for pattern in listens {
                wiring = wiring.listens_to(pattern);
            }
            Dummy::new("any", 1, wiring)
        },
    )
}

fn hears(wiring: &CanIds, frame: &CanFrame) -> bool {
    wiring.received().iter().any(|frames| frames.contains(frame))
}

proptest! {
    #![proptest_config(any::cases(1500))]

    /// Whatever was attached: a frame is claimed by one motor at most, and that one gets it.
    #[test]
    fn a_frame_reaches_the_motor_that_claims_it(
        mut motors in vec(wired(), 1..12),
        frames in vec((few_ids(), vec(any::<u8>(), 0..=8)), 40),
        bits_per_second in any::<u32>(),
    ) {
        let wirings: Vec<_> = motors.iter().map(CanMotor::can_ids).collect();
        let switch = ArmSwitch::new();
        let mut bus = MotorBus::new(&switch);
        let mut attached: Vec<(_, &CanIds)> = Vec::new();
        for (motor, wiring) in motors.iter_mut().zip(&wirings) {
            let clashes = attached.iter().any(|(_, other)| {
                let clash = wiring.clash(other);
                assert_eq!(clash.is_some(), other.clash(wiring).is_some(), "{wiring:?} {other:?}");
                clash.is_some()
            });
            match bus.attach(motor, Safety::COAST) {
                Ok(id) => attached.push((id, wiring)),
                Err(AttachError::Full { .. }) => prop_assert_eq!(attached.len(), 8),
                Err(AttachError::Clash { .. }) => prop_assert!(clashes),
                Err(AttachError::TableFull { .. }) => {}
                Err(error) => return Err(TestCaseError::fail(error.to_string())),
            }
            prop_assert!(wiring.link_timeout() >= Micros::from_millis(10));
        }
        for (id, bytes) in frames {
            let frame = CanFrame::data_frame(id, &bytes).unwrap();
            let claims = attached.iter().filter(|(_, wiring)| hears(wiring, &frame));
            let claims: Vec<_> = claims.map(|(id, _)| *id).collect();
            let expected = match claims[..] {
                [] => Dispatch::Unclaimed,
                [one] => Dispatch::Motor(one),
                _ => return Err(TestCaseError::fail(format!("{frame} is claimed by {claims:?}"))),
            };
            prop_assert_eq!(bus.on_frame(&frame, Micros::ZERO), expected, "{}", frame);
            let remote = CanFrame::remote_frame(id, bytes.len()).unwrap();
            prop_assert_eq!(bus.on_frame(&remote, Micros::ZERO), Dispatch::Unclaimed);
        }
        let load = bus.load(bits_per_second);
        let numbers = [0.0, load.least, load.typical, load.worst];
        prop_assert!(numbers.is_sorted() && load.worst.is_finite(), "{:?}", load);
        prop_assert!(!load.to_string().is_empty());
        prop_assert!(bus.supports(rc10_motor::numbers([rc10_motor::Place::Bus(1); 201]).last().unwrap()) == TargetSet::NONE);
        prop_assert!(!TargetSet::NONE.contains(TargetKind::Coast));
    }
}
