use std::pin::Pin;

use embassy_time::Timer;
use rc10_app::Rpm;
use rc10_motor::embassy::{Rs485Port, run_rs485};
use rc10_motor::unitree::{GoM8010, Rs485Bus};
use rc10_motor::{
    ArmState, ArmSwitch, DriveMode, Link, Request, RequestError, Response, Safety, Target,
    TargetError, TargetKind,
};
use rc10_sim::unitree_line::{GoM8010 as Device, plant};
use rc10_sim::{Esc, EscFault, LineConfig, Tasks, World};
use rc10_time::Micros;

use super::bench::motors;
use super::bench::nth;

const SPEED: Target = Target::Speed(Rpm::new(60.0));

/// Eight motors under embassy, of which number 3 has no power at first; what `robot` does with them
/// in two seconds.
fn run<F: Future<Output = ()>>(
    config: LineConfig,
    robot: impl FnOnce(&'static Rs485Port, &'static ArmSwitch, Vec<Esc>) -> F,
) -> (&'static Rs485Port, Vec<Esc>, rc10_sim::Line) {
    let switch: &'static ArmSwitch = Box::leak(Box::default());
    let port: &'static Rs485Port = Box::leak(Box::default());
    let ours: &'static mut [GoM8010] = Box::leak(motors(8).into_boxed_slice());
    let mut world = World::new(40);
    let wire = world.add_line(config);
    let devices: Vec<_> = (0..8).map(|id| wire.add(Device::new(id), plant())).collect();
    devices[3].set_power(false);
    let mut line = Rs485Bus::new(switch);
    for motor in ours {
        line.attach(motor, Safety::COAST).unwrap();
    }
    let mut tasks = Tasks::new();
    tasks.add(run_rs485(wire.port(), line, port));
    tasks.add(robot(port, switch, devices.clone()));
    assert!(world.run(Pin::new(&mut tasks), Micros::from_millis(2000)).is_pending());
    (port, devices, wire)
}

async fn command_all(port: &Rs485Port, millis: u32) {
    for _ in 0..millis {
        for index in 0..8 {
            port.motor(nth(index)).command(SPEED).unwrap();
        }
        Timer::after_millis(1).await;
    }
}

#[test]
fn a_line_under_embassy_drives_its_motors_and_answers_requests() {
    let (port, devices, wire) = run(LineConfig::default(), |port, switch, devices| async move {
        let first = port.motor(nth(0));
        let refused = TargetError::Unsupported(TargetKind::Speed);
        assert_eq!(port.motor(nth(8)).command(SPEED), Err(refused));
        Timer::after_millis(5).await;
        assert_eq!(first.status().drive, DriveMode::Off);
        assert_eq!(first.request(Request::SetZero).await, Ok(Response::Done));
        switch.arm().unwrap();
        command_all(port, 500).await;
        assert!(devices[0].inject(EscFault::OverCurrent));
        command_all(port, 5).await;
        assert_eq!(first.status().fault.map(|fault| fault.text), Some("over-current"));
        // Each waits for the device's own answer.
        assert_eq!(first.request(Request::ClearFault).await, Err(RequestError::Refused(2)));
        let silent = port.motor(nth(3));
        assert_eq!(silent.request(Request::ClearFault).await, Err(RequestError::Timeout));
        devices[0].set_power(false);
        devices[3].set_power(true);
        command_all(port, 50).await;
        devices[0].set_power(true);
        command_all(port, 150).await;
        assert_eq!(first.request(Request::ClearFault).await, Ok(Response::Done));
        command_all(port, 2000).await;
    });
    for (index, device) in (0..8).zip(&devices) {
        let status = port.motor(nth(index)).status();
        assert_eq!((status.link, status.drive), (Link::Online, DriveMode::Run), "{index}");
        assert!((device.state().output_rpm - 60.0).abs() < 0.5, "{index} {:?}", device.state());
    }
    let status = port.status();
    assert_eq!((status.ticks, status.overruns, status.port_errors), (2000, 0, 0));
    // A tick waits for the end of a command that is going out, 42.5 us, and no longer.
    let (shortest, longest) = (status.period.min().unwrap(), status.period.max().unwrap());
    assert!(shortest >= 957 && longest <= 1043, "{shortest} {longest}");
    assert_eq!(status.arm, ArmState::Armed);
    // Eight exchanges a millisecond, less what the silent ones and power-offs cost.
    assert!((14_500..16_000).contains(&status.traffic.exchanges), "{:?}", status.traffic);
    assert!((3..80).contains(&status.traffic.timeouts), "{:?}", status.traffic);
    assert_eq!((status.traffic.unexpected, status.traffic.crc_errors), (0, 0));
    assert_eq!((wire.counters().collided, wire.counters().overrun), (0, 0));
}

/// A port whose reading ends at once, again and again.
struct Ended;

impl embedded_io_async::ErrorType for Ended {
    type Error = core::convert::Infallible;
}

impl embedded_io_async::Read for Ended {
    async fn read(&mut self, _: &mut [u8]) -> Result<usize, Self::Error> {
        Ok(0)
    }
}

impl embedded_io_async::Write for Ended {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

#[test]
fn a_port_that_has_ended_is_counted_and_stops_no_tick() {
    let switch: &'static ArmSwitch = Box::leak(Box::default());
    let port: &'static Rs485Port = Box::leak(Box::default());
    let mut world = World::new(41);
    let mut tasks = Tasks::new();
    tasks.add(run_rs485(Ended, Rs485Bus::new(switch), port));
    assert!(world.run(Pin::new(&mut tasks), Micros::from_millis(100)).is_pending());
    let status = port.status();
    assert_eq!((status.ticks, status.overruns), (100, 0));
    // One every 100 us.
    assert!((900..=1000).contains(&status.port_errors), "{}", status.port_errors);
}

#[test]
fn hearing_its_own_commands_is_no_harm() {
    let echo = LineConfig { echo: true, ..LineConfig::default() };
    let (port, devices, wire) = run(echo, |port, switch, _| async move {
        Timer::after_millis(5).await;
        switch.arm().unwrap();
        command_all(port, 2000).await;
    });
    assert!((devices[0].state().output_rpm - 60.0).abs() < 0.5);
    let status = port.status();
    assert_eq!(status.traffic.garbage, u32::try_from(wire.counters().from_host).unwrap() / 17 * 17);
    assert!(status.traffic.exchanges > 13_500, "{:?}", status.traffic);
    assert_eq!(status.traffic.unexpected, 0);
}
