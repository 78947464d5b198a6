//! Each fault that a device tells has its code and text; while its cause lasts, it cannot be cleared.
//! A device that is not heard is disabled.

use rc10_app::Rpm;
use rc10_motor::cybergear::{Address, Config as CyberGearConfig, CyberGear, models};
use rc10_motor::lk::Lk;
use rc10_motor::odrive::{Config, Firmware, ODrive};
use rc10_motor::unitree::{GoModule, ModuleConfig};
use rc10_motor::{CanMotor, DriveMode, Fault, Link, Request, RequestError, Safety, Target};
use rc10_sim::odrive::{Axis, Settings, Version};
use rc10_sim::unitree_module::UnitreeModule;
use rc10_sim::{Device, EscFault, Plant};

use super::{One, cybergear, damiao, lk, odrive};
use EscFault::{
    CommunicationLost, Encoder, OverCurrent, OverTemperature, OverVoltage, UnderVoltage,
};

const SPEED: Target = Target::Speed(Rpm::new(60.0));

/// A motor that runs and brakes as its safe state.
fn running<D: Device>(motor: impl CanMotor + 'static, device: D, plant: Plant) -> One<D> {
    let mut one = One::new(motor, device, plant, Safety::BRAKE);
    one.bench.wait(150);
    one.switch.arm().unwrap();
    one.hold(SPEED, 300);
    one
}

/// Faults, their codes and their texts. `lasts` has the cause stay, and says whether it does.
fn assert_told<D: Device>(
    make: impl Fn() -> One<D>,
    lasts: impl Fn(&One<D>, EscFault) -> bool,
    faults: &[(EscFault, u32, &'static str)],
) {
    // One that is not heard is disabled.
    let mut one = make();
    one.esc.set_feedback(false);
    one.hold(SPEED, 35);
    assert!(one.esc.state().open || one.esc.state().shorted, "{:?}", one.esc.state());
    for &(fault, code, text) in faults {
        let mut one = make();
        assert!(one.esc.inject(fault));
        one.hold(SPEED, 200);
        let status = one.status();
        assert_eq!(status.fault, Some(Fault::new(code, text)), "{fault:?}");
        assert_eq!((status.drive, status.link), (DriveMode::Brake, Link::Online), "{fault:?}");
        if lasts(&one, fault) {
            let answer = one.ask(Request::ClearFault);
            assert!(matches!(answer, Err(RequestError::Refused(_))), "{fault:?}: {answer:?}");
            assert!(one.status().fault.is_some(), "{fault:?}");
        }
    }
}

fn always<D>(_: &One<D>, _: EscFault) -> bool {
    true
}

#[test]
fn of_a_damiao() {
    let control = damiao::controls()[0];
    let device = damiao::device(&control);
    let make =
        || running(damiao::motor(control), rc10_sim::damiao::Damiao::new(&device), device.plant);
    assert_told(
        make,
        |_, fault| fault != CommunicationLost,
        &[
            (OverTemperature, 0xB, "transistors too hot"),
            (CommunicationLost, 0xD, "communication lost"),
            (OverCurrent, 0xA, "over-current"),
            (OverVoltage, 0x8, "over-voltage"),
            (UnderVoltage, 0x9, "under-voltage"),
            (Encoder, 0x5, "sensor error"),
        ],
    );
}

#[test]
fn of_an_lk_drive() {
    let make = || {
        let drive = rc10_sim::lk::Drive::new(rc10_sim::lk::Settings::mg(1)).unwrap();
        running(Lk::new(lk::joint()).unwrap(), drive, lk::joint_plant())
    };
    assert_told(
        make,
        always,
        &[
            (OverTemperature, 1 << 3, "motor too hot"),
            (CommunicationLost, 1 << 7, "commands have stopped"),
            (OverCurrent, 1 << 4, "current too high"),
            (OverVoltage, 1 << 1, "supply voltage too high"),
            (UnderVoltage, 1, "supply voltage too low"),
        ],
    );
}

#[test]
fn of_an_odrive_of_either_firmware() {
    let make = |version, firmware| {
        move || {
            let motor = ODrive::new(Config { firmware, ..odrive::wheel() }).unwrap();
            let settings = Settings { version, ..Settings::new(odrive::NODE) };
            running(motor, Axis::new(settings).unwrap(), odrive::plant())
        }
    };
    assert_told(
        make(Version::V0_6, Firmware::V0_6),
        always,
        &[
            (OverTemperature, 0x2000, "motor too hot"),
            (CommunicationLost, 0x100_0000, "watchdog expired"),
            (OverCurrent, 0x1000, "current limit violated"),
            (OverVoltage, 0x100, "supply voltage too high"),
            (UnderVoltage, 0x200, "supply voltage too low"),
            (Encoder, 0x8, "encoder estimate missing"),
        ],
    );
    assert_told(
        make(Version::V0_5, Firmware::V0_5),
        always,
        &[
            (OverTemperature, 0x4_0000, "too hot"),
            (OverCurrent, 0x40, "motor failed"),
            (Encoder, 0x100, "encoder failed"),
            (CommunicationLost, 0x800, "watchdog expired"),
            (OverVoltage, 0x4, "supply voltage too high"),
            (UnderVoltage, 0x2, "supply voltage too low"),
        ],
    );
}

#[test]
fn of_a_cybergear_and_a_robstride() {
    use rc10_sim::cybergear as sim;
    let make = |ours, theirs: &'static sim::Model| {
        move || {
            let motor = CyberGear::new(CyberGearConfig::new(ours, ADDRESS)).unwrap();
            let plant = theirs.plant().with_load_inertia(0.01);
            running(motor, sim::CyberGear::new(theirs, ADDRESS.motor), plant)
        }
    };
    const ADDRESS: Address = cybergear::ADDRESS;
    let lasts = |one: &One<sim::CyberGear>, fault| {
        one.device(|device| device.lasting = true);
        // The feedback says nothing of it: only the fault frame does.
        fault != OverVoltage
    };
    assert_told(
        make(&models::CYBERGEAR, &sim::CYBERGEAR),
        lasts,
        &[
            (OverTemperature, 1 << 0, "motor too hot (80 °C)"),
            (OverCurrent, 1 << 16, "over-current in phase A"),
            (UnderVoltage, 1 << 2, "under-voltage"),
            (Encoder, 1 << 7, "encoder not calibrated"),
            (OverVoltage, 1 << 3, "over-voltage"),
        ],
    );
    assert_told(make(&models::RS04, &sim::RS04), lasts, &[(OverTemperature, 1, "motor too hot")]);
}

#[test]
fn of_a_go_m8010_behind_a_module() {
    let make = || {
        let motor = GoModule::new(ModuleConfig::new(3, 0)).unwrap();
        let device = UnitreeModule::new(3).unwrap().motor(0).unwrap();
        running(motor, device, rc10_sim::unitree_module::plant())
    };
    assert_told(
        make,
        |_, _| false,
        &[
            (OverTemperature, 0x1D01_0080, "over-temperature"),
            (OverCurrent, 0x1D02_0080, "over-current"),
            (OverVoltage, 0x1D03_0080, "over-voltage"),
            (Encoder, 0x1D04_0080, "encoder"),
        ],
    );
}
