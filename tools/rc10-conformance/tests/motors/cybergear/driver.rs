//! The simulated device as somebody else's driver uses it: all run modes, by registers, with frames
//! of `python-cybergear` 0.1.2's shape.

use rc10_can::embedded_can::ExtendedId;
use rc10_can::{CanFrame, CanPort};
use rc10_sim::cybergear::{self as sim, Mode};
use rc10_sim::{Bus, BusConfig, Esc, SimPort, World};
use rc10_time::Micros;

const HOST: u32 = 0xFD;

struct Driver {
    world: World,
    port: SimPort,
    esc: Esc,
    _wire: Bus,
    motor: u32,
}

impl Driver {
    fn new(model: &sim::Model) -> Self {
        let mut world = World::new(5);
        let wire = world.add_bus(BusConfig::default());
        let plant = model.plant().with_load_inertia(0.005);
        let esc = wire.add(sim::CyberGear::new(model, 127), plant);
        Self { port: wire.port(), world, esc, _wire: wire, motor: 127 }
    }

    /// Sends one frame and waits 2 ms: what came back.
    fn send(&mut self, kind: u32, middle: u32, data: &[u8]) -> Vec<CanFrame> {
        let id = ExtendedId::new(kind << 24 | middle << 8 | self.motor).unwrap();
        let _ = self.port.submit(&CanFrame::data_frame(id, data).unwrap());
        self.wait(2);
        std::iter::from_fn(|| self.port.receive()).map(|(frame, _)| frame).collect()
    }

    fn wait(&mut self, millis: u64) {
        let until = self.world.now() + Micros::from_millis(millis);
        self.world.advance(until);
    }

    fn write(&mut self, index: u16, value: [u8; 4]) {
        let [low, high] = index.to_le_bytes();
        let [a, b, c, d] = value;
        let answers = self.send(18, HOST, &[low, high, 0, 0, a, b, c, d]);
        // Feedback, whose low bytes are motor and host.
        assert_eq!(answers.len(), 1);
        assert_eq!(answers[0].raw_id() & 0x1F00_FFFF, 2 << 24 | self.motor << 8 | HOST);
    }

    fn write_real(&mut self, index: u16, value: f32) {
        self.write(index, value.to_le_bytes());
    }

    fn read(&mut self, index: u16) -> f32 {
        let [low, high] = index.to_le_bytes();
        let answers = self.send(17, HOST, &[low, high, 0, 0, 0, 0, 0, 0]);
        assert_eq!(answers[0].raw_id(), 17 << 24 | self.motor << 8 | HOST);
        let bytes = answers[0].bytes();
        assert_eq!(bytes[..4], [low, high, 0, 0]);
        f32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]])
    }

    /// Enables as that driver does: stop, then enable.
    fn enable(&mut self, run_mode: u8) {
        self.write(0x7005, [run_mode, 0, 0, 0]);
        assert_eq!(self.send(4, HOST, &[0; 8]).len(), 1);
        let answers = self.send(3, HOST, &[0; 8]);
        assert_eq!(answers[0].raw_id() >> 22 & 3, 2);
    }

    fn rad_s(&self) -> f64 {
        self.esc.state().output_rpm / 9.549_297
    }
}

#[test]
fn it_is_found_and_says_who_it_is() {
    let mut driver = Driver::new(&sim::CYBERGEAR);
    // One byte, as that driver asks.
    let answers = driver.send(0, HOST, &[0]);
    assert_eq!(answers.len(), 1);
    assert_eq!(answers[0].raw_id(), 127 << 8 | 0xFE);
    assert_eq!(answers[0].bytes().len(), 8);
    let chip = answers[0].bytes().to_vec();
    // Another identifier, at once: the answer has it already.
    let answers = driver.send(7, 5 << 8 | HOST, &chip);
    assert_eq!(answers[0].raw_id(), 5 << 8 | 0xFE);
    assert!(driver.send(3, HOST, &[0; 8]).is_empty());
    driver.motor = 5;
    assert_eq!(driver.send(3, HOST, &[0; 8]).len(), 1);
}

#[test]
fn speed_mode() {
    for model in sim::ALL {
        let mut driver = Driver::new(model);
        driver.enable(2);
        driver.write_real(0x700A, 5.0);
        driver.wait(600);
        assert!((driver.rad_s() - 5.0).abs() < 0.1, "{} {}", model.name, driver.rad_s());
        assert!((driver.read(0x701B) - 5.0).abs() < 0.1);
        // Never faster than it can: cut off.
        driver.write_real(0x700A, 1000.0);
        assert!((f64::from(driver.read(0x700A)) - model.velocity).abs() < 1e-3);
    }
}

#[test]
fn position_mode_goes_at_the_speed_limit() {
    let mut driver = Driver::new(&sim::CYBERGEAR);
    driver.enable(1);
    driver.write_real(0x7017, 4.0);
    driver.write_real(0x7016, 6.0);
    driver.wait(500);
    assert!((driver.rad_s() - 4.0).abs() < 0.2, "{}", driver.rad_s());
    driver.wait(2500);
    assert!((driver.read(0x7019) - 6.0).abs() < 0.05, "{}", driver.read(0x7019));
    // Back to zero, as that driver has it.
    driver.write(0x7005, [4, 0, 0, 0]);
    driver.enable(4);
    driver.wait(4000);
    assert!(driver.read(0x7019).abs() < 0.05);
}

#[test]
fn current_mode_and_motion_control() {
    let mut driver = Driver::new(&sim::CYBERGEAR);
    driver.enable(3);
    driver.write_real(0x7006, 1.5);
    driver.wait(10);
    assert!((driver.esc.state().current - 1.5).abs() < 0.01);
    assert!((driver.read(0x701A) - 1.5).abs() < 0.01);
    // Motion control is another mode: its setpoints mean nothing here.
    driver.write_real(0x7006, 0.0);
    driver.send(1, 0xFFFF, &[0x80, 0, 0x80, 0, 0, 0, 0, 0]);
    assert!(driver.esc.state().current.abs() < 0.05);
    driver.enable(0);
    // 2 N m in the identifier.
    driver.send(1, 38229, &[0x80, 0, 0x80, 0, 0, 0, 0, 0]);
    driver.wait(10);
    let torque = driver.esc.state().current * sim::CYBERGEAR.torque_constant;
    assert!((torque - 2.0).abs() < 0.01, "{torque}");
    // The limit holds there as well.
    driver.write_real(0x700B, 0.5);
    driver.wait(10);
    let torque = driver.esc.state().current * sim::CYBERGEAR.torque_constant;
    assert!((torque - 0.5).abs() < 0.01, "{torque}");
}

#[test]
fn jogging_stopping_and_zero() {
    let mut driver = Driver::new(&sim::CYBERGEAR);
    let [high, low] = 43_690_u16.to_be_bytes();
    driver.write(0x7005, [7, 1, high, low]);
    driver.wait(300);
    assert!((driver.rad_s() - 10.0).abs() < 0.2, "{}", driver.rad_s());
    // Reverse-engineered by that driver: no torque at once.
    driver.send(20, HOST, &[0; 8]);
    assert_eq!(driver.esc.with(|device: &mut sim::CyberGear| device.mode), Some(Mode::Reset));
    driver.wait(2000);
    driver.send(6, HOST, &[1, 0, 0, 0, 0, 0, 0, 0]);
    assert!(driver.read(0x7019).abs() < 0.01);
}

#[test]
fn a_fault_is_told_once_by_itself_and_enabling_is_refused() {
    let mut driver = Driver::new(&sim::CYBERGEAR);
    driver.enable(2);
    driver.esc.inject(rc10_sim::EscFault::OverTemperature);
    driver.wait(5);
    let (told, _) = driver.port.receive().unwrap();
    assert_eq!(told.raw_id(), 21 << 24 | 127 << 8 | HOST);
    assert_eq!(told.bytes(), [1, 0, 0, 0, 0, 0, 0, 0]);
    assert!(driver.port.receive().is_none());
    let answers = driver.send(3, HOST, &[0; 8]);
    assert_eq!(answers[0].raw_id() >> 16 & 0xFF, 1 << 2);
    driver.send(4, HOST, &[1, 0, 0, 0, 0, 0, 0, 0]);
    let answers = driver.send(3, HOST, &[0; 8]);
    assert_eq!(answers[0].raw_id() >> 16 & 0xFF, 2 << 6);
}

/// It protects itself when its winding gets hot, in spite of any command.
#[test]
fn it_stops_itself_when_it_is_too_hot() {
    let mut driver = Driver::new(&sim::CYBERGEAR);
    driver.esc.set_load(-14.0);
    driver.enable(3);
    driver.write_real(0x7006, 19.0);
    let mut seconds = 0;
    while driver.esc.with(|device: &mut sim::CyberGear| device.mode) == Some(Mode::Run) {
        driver.wait(1000);
        seconds += 1;
        assert!(seconds < 600);
    }
    let temperature = driver.esc.state().temperature;
    assert!((79.0..81.0).contains(&temperature), "{temperature}");
    assert_eq!(driver.esc.with(|device: &mut sim::CyberGear| device.faults()), Some((4, 1)));
}

/// Type 22 to a CyberGear is a new bit rate: after power-on no node understands it any more.
#[test]
fn a_changed_bit_rate_makes_it_deaf() {
    let mut driver = Driver::new(&sim::CYBERGEAR);
    driver.send(22, HOST, &[2, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(driver.send(3, HOST, &[0; 8]).len(), 1);
    driver.esc.set_power(false);
    driver.wait(10);
    driver.esc.set_power(true);
    assert!(driver.send(3, HOST, &[0; 8]).is_empty());
}
