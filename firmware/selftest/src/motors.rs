//! Two GO-M8010 on RS-485 at 4 Mbit/s.

use embassy_executor::Spawner;
use embassy_time::Timer;
use rc10_app::Rpm;
use rc10_bsp::serial::{BaudError, Serial};
use rc10_motor::embassy::{Rs485Port, run_rs485};
use rc10_motor::unitree::{GoM8010, LineConfig, Rs485Bus};
use rc10_motor::{ArmSwitch, Link, Safety, Target};
use static_cell::StaticCell;

use crate::report::Outcome;
use crate::{say, want};

static SWITCH: ArmSwitch = ArmSwitch::new();
static PORT: Rs485Port = Rs485Port::new();
static MOTORS: StaticCell<[GoM8010; 2]> = StaticCell::new();

#[embassy_executor::task]
async fn drive(port: Serial, line: Rs485Bus<'static>) {
    run_rs485(port, line, &PORT).await;
}

/// Both follow a speed.
pub async fn line(spawner: Spawner, port: Result<Serial, BaudError>) -> Outcome {
    let Ok(port) = port else { return Err(say!("no such baud rate")) };
    let (Ok(first), Ok(second)) =
        (GoM8010::new(LineConfig::new(0)), GoM8010::new(LineConfig::new(1)))
    else {
        return Err(say!("no such ids"));
    };
    let mut line = Rs485Bus::new(&SWITCH);
    let [first, second] = MOTORS.init([first, second]).each_mut();
    let attached = (line.attach(first, Safety::COAST), line.attach(second, Safety::COAST));
    let (Ok(first), Ok(second)) = attached else { return Err(say!("cannot attach")) };
    let Ok(task) = drive(port, line) else { return Err(say!("cannot spawn")) };
    spawner.spawn(task);
    Timer::after_millis(10).await;
    want!(SWITCH.arm().is_ok(), "cannot arm");
    let motors = [first, second].map(|motor| PORT.motor(motor));
    for _ in 0..300 {
        for motor in &motors {
            want!(motor.command(Target::Speed(Rpm::new(60.0))).is_ok(), "refused");
        }
        Timer::after_millis(1).await;
    }
    SWITCH.disarm();
    for (index, motor) in motors.iter().enumerate() {
        let status = motor.status();
        want!(status.link == Link::Online, "motor {index} is not heard");
        let speed = status.feedback.speed.get();
        want!((speed - 60.0).abs() < 3.0, "motor {index} does not follow");
    }
    let status = PORT.status();
    let (traffic, overruns, errors) = (status.traffic, status.overruns, status.port_errors);
    let exchanges = traffic.exchanges;
    want!(overruns == 0 && errors == 0, "{overruns} ticks late, {errors} port errors");
    want!(traffic.timeouts == 0, "{} of {exchanges} not answered", traffic.timeouts);
    Ok(say!("{exchanges} commands answered"))
}
