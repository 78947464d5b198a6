//! Faults: text, safe state, and nothing but clearing them lets it move again.

use rc10_app::Rpm;
use rc10_motor::{DriveMode, Fault, Request, RequestError, Response, Safety, Target};
use rc10_sim::EscFault;
use rc10_sim::cybergear::Mode;

use super::{Pair, with_cybergear, with_rs04};

const SPEED: Target = Target::Speed(Rpm::new(40.0));

fn answer(pair: &mut Pair<'_, '_>, most: u32) -> Result<Response, RequestError> {
    for _ in 0..most {
        pair.bench.hold(pair.motor, SPEED, 1).unwrap();
        if let Some(answer) = pair.bench.bus.response(pair.motor) {
            return answer;
        }
        let busy = pair.bench.bus.request(pair.motor, Request::ClearFault);
        assert_eq!(busy, Err(RequestError::Busy));
    }
    panic!("no answer");
}

#[test]
fn each_fault_has_its_text_and_waits_for_clearing() {
    for (fault, code, text) in [
        (EscFault::OverTemperature, 1 << 0, "motor too hot (80 °C)"),
        (EscFault::OverCurrent, 1 << 16, "over-current in phase A"),
        (EscFault::UnderVoltage, 1 << 2, "under-voltage"),
        (EscFault::Encoder, 1 << 7, "encoder not calibrated"),
        // The feedback says nothing of it: only the fault frame does.
        (EscFault::OverVoltage, 1 << 3, "over-voltage"),
    ] {
        with_cybergear(Safety::HOLD, |mut pair| {
            pair.switch.arm().unwrap();
            pair.bench.hold(pair.motor, SPEED, 300).unwrap();
            assert!((pair.rpm() - 40.0).abs() < 2.0);
            assert!(pair.esc.inject(fault));
            pair.bench.hold(pair.motor, SPEED, 500).unwrap();
            let status = pair.bench.status(pair.motor);
            assert_eq!(status.fault, Some(Fault::new(code, text)));
            assert_eq!(status.drive, DriveMode::Hold);
            assert_eq!(pair.device(|device| device.mode()), Mode::Reset);
            assert_eq!(pair.esc.state().current, 0.0);
            assert!(pair.rpm().abs() < 1.0);

            // Its cause is still there.
            pair.device(|device| device.set_lasting(true));
            let request = pair.bench.bus.request(pair.motor, Request::ClearFault);
            assert_eq!(request, Ok(Response::Pending));
            let bits = pair.device(|device| device.faults().0);
            if bits != 0 {
                let refused = RequestError::Refused(bits.into());
                assert_eq!(answer(&mut pair, 150), Err(refused));
                assert_eq!(pair.device(|device| device.mode()), Mode::Reset);
                assert!(pair.bench.status(pair.motor).fault.is_some());
                pair.device(|device| device.set_lasting(false));
                pair.bench.bus.request(pair.motor, Request::ClearFault).unwrap();
            }
            pair.device(|device| device.set_lasting(false));
            assert_eq!(answer(&mut pair, 20), Ok(Response::Done));
            pair.bench.hold(pair.motor, SPEED, 300).unwrap();
            assert_eq!(pair.bench.status(pair.motor).fault, None);
            assert!((pair.rpm() - 40.0).abs() < 2.0);
        });
    }
}

/// Power off and on takes the fault from the device, not from us.
#[test]
fn a_restart_clears_nothing() {
    with_cybergear(Safety::COAST, |mut pair| {
        pair.switch.arm().unwrap();
        pair.bench.hold(pair.motor, SPEED, 100).unwrap();
        pair.esc.inject(EscFault::OverCurrent);
        pair.bench.hold(pair.motor, SPEED, 100).unwrap();
        pair.esc.set_power(false);
        pair.bench.hold(pair.motor, SPEED, 100).unwrap();
        pair.esc.set_power(true);
        pair.bench.hold(pair.motor, SPEED, 300).unwrap();
        assert!(pair.bench.status(pair.motor).fault.is_some());
        assert_eq!(pair.device(|device| device.mode()), Mode::Reset);
        pair.bench.bus.request(pair.motor, Request::ClearFault).unwrap();
        assert_eq!(answer(&mut pair, 20), Ok(Response::Done));
        pair.bench.hold(pair.motor, SPEED, 300).unwrap();
        assert!((pair.rpm() - 40.0).abs() < 2.0);
    });
}

#[test]
fn a_robstride_has_texts_of_its_own() {
    with_rs04(|pair| {
        pair.esc.inject(EscFault::OverTemperature);
        pair.bench.wait(3);
        let status = pair.bench.status(pair.motor);
        assert_eq!(status.fault, Some(Fault::new(1, "motor too hot")));
    });
}

/// The fault frame is not taken: the bits of the feedback have their own text.
#[test]
fn feedback_alone_tells_a_fault() {
    with_cybergear(Safety::COAST, |pair| {
        pair.esc.set_feedback(false);
        pair.esc.inject(EscFault::OverCurrent);
        pair.bench.wait(5);
        pair.esc.set_feedback(true);
        pair.bench.wait(5);
        let status = pair.bench.status(pair.motor);
        assert_eq!(status.fault, Some(Fault::new(1 << 1, "over-current")));
    });
}

#[test]
fn clearing_without_an_answer_gives_up() {
    with_cybergear(Safety::COAST, |mut pair| {
        pair.esc.inject(EscFault::OverCurrent);
        pair.bench.wait(5);
        pair.bench.wire.set_cut(true);
        pair.bench.bus.request(pair.motor, Request::ClearFault).unwrap();
        assert_eq!(answer(&mut pair, 150), Err(RequestError::Timeout));
        assert!(pair.bench.status(pair.motor).fault.is_some());
    });
}
