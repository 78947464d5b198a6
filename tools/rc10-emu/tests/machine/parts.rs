//! What is soldered on DM-MC02: its IMU on SPI2, the heater of that, its key, its supply.

use rc10_emu::parts::Thermal;
use rc10_emu::peripherals::{AccessKind, Width};
use rc10_emu::{Board, Machine, Options};
use rc10_sim::imu::bmi088::Motion;

use super::{Bench, HANDLER, START, program, reports};

/// `WFI`: the program sleeps.
const WFI: u16 = 0xBF30;
const RCC: u32 = 0x5802_4400;
const GPIO: u32 = 0x5802_0000;
const SPI2: u32 = 0x4000_3800;
const TIM3: u32 = 0x4000_0400;
const SYSCFG: u32 = 0x5800_0400;
/// Of port C: chip selects of the accelerometer and the gyroscope.
const SELECTS: [u32; 2] = [0, 3];

/// Ports A, B, C; SPI2, TIM3, SYSCFG; SPI2 from PER, which is HSI.
fn started(board: Board) -> Bench {
    let bench = Bench::new(WFI, Options { board, ..Options::default() });
    bench.write(RCC + 0xE0, 0b111);
    bench.write(RCC + 0xE8, 1 << 14 | 1 << 1);
    bench.write(RCC + 0xF4, 1 << 1);
    bench.write(RCC + 0x50, 4 << 12);
    bench
}

impl Bench {
    /// SPI2 at 4 MHz, mode 3, frames of eight bits, both selects high.
    fn start_spi(&mut self) {
        for (port, pin) in [(1, 13), (2, 2), (2, 1)] {
            self.alternate(port, pin, 5);
        }
        for pin in SELECTS {
            self.write(GPIO + 0x818, 1 << pin);
            self.set(GPIO + 0x800, 3 << (2 * pin), 1 << (2 * pin));
        }
        self.write(SPI2 + 0x0C, 1 << 26 | 1 << 22 | 1 << 29 | 0b11 << 24);
        self.write(SPI2 + 0x08, 3 << 28 | 7);
        self.write(SPI2, 1);
        self.set(SPI2, 1 << 9, 1 << 9);
    }

    /// A transaction with one of the chips; what came in.
    fn transfer(&mut self, select: u32, bytes: &[u8]) -> Vec<u8> {
        self.write(GPIO + 0x818, 1 << (select + 16));
        let heard = bytes.iter().map(|&byte| {
            let now = self.machine.now();
            self.machine.soc().write(SPI2 + 0x20, Width::Byte, byte.into(), now).unwrap();
            self.wait(2_500);
            let now = self.machine.now();
            let heard = self.machine.soc().read(SPI2 + 0x30, Width::Byte, now).unwrap();
            u8::try_from(heard).unwrap()
        });
        let heard = heard.collect();
        self.write(GPIO + 0x818, 1 << select);
        heard
    }

    /// The IMU, told to measure.
    fn start_imu(&mut self) {
        self.start_spi();
        self.wait(40_000_000);
        self.transfer(SELECTS[0], &[0x80, 0, 0]);
        for bytes in [[0x7C, 0x00], [0x7D, 0x04], [0x40, 0xAC]] {
            self.transfer(SELECTS[0], &bytes);
            self.wait(1_000_000);
        }
    }

    /// The temperature by its register.
    fn celsius(&mut self) -> f64 {
        let heard = self.transfer(SELECTS[0], &[0xA2, 0, 0, 0]);
        f64::from(i16::from_be_bytes([heard[2], heard[3]]) >> 5) / 8.0 + 23.0
    }
}

#[test]
fn the_imu_answers_on_spi2() {
    let mut bench = started(Board::DM_MC02);
    bench.start_imu();
    assert_eq!(bench.transfer(SELECTS[0], &[0x80, 0, 0])[2], 0x1E);
    assert_eq!(bench.transfer(SELECTS[1], &[0x80, 0])[1], 0x0F);
    let motion = Motion { rotation: [0.0, 0.0, 500.0_f64.to_radians()], ..Motion::REST };
    bench.machine.parts.imu.as_ref().unwrap().with(|imu| imu.motion = motion);
    bench.wait(1_000_000);
    let heard = bench.transfer(SELECTS[1], &[0x82, 0, 0, 0, 0, 0, 0]);
    let turns = i16::from_le_bytes([heard[5], heard[6]]);
    assert!(turns.abs_diff(8_192) <= 1, "{turns}");
    let heard = bench.transfer(SELECTS[0], &[0x92, 0, 0, 0, 0, 0, 0, 0]);
    let up = i16::from_le_bytes([heard[6], heard[7]]);
    assert!(up.abs_diff(5_461) <= 1, "{up}");
    assert!((bench.celsius() - 25.0).abs() < 0.1);
    // The gyroscope's select and MISO go through the switches of PC3 and PC2.
    bench.set(SYSCFG + 4, 1 << 27, 1 << 27);
    assert_eq!(bench.transfer(SELECTS[1], &[0x80, 0]), [0, 0]);
    bench.set(SYSCFG + 4, 3 << 26, 1 << 26);
    assert_eq!(bench.transfer(SELECTS[0], &[0x80, 0, 0]), [0, 0, 0]);
    bench.wait(1_000_000);
    let said = reports(&bench.machine).join("\n");
    for pad in ["PC3_C", "PC2_C"] {
        assert!(said.contains(pad), "{said}");
    }
}

#[test]
fn an_imu_on_a_base_turns_with_it() {
    let mut bench = started(Board::DM_MC02);
    let bus = bench.world.add_bus(rc10_sim::BusConfig::default());
    let motors = [1, 2, 3, 4].map(|id| {
        let config = rc10_sim::EscConfig::new(rc10_sim::Model::C620, id);
        bus.add_esc(config).unwrap()
    });
    let wheels = motors.iter().map(|motor| (motor, rc10_sim::Mounting::Normal));
    let base = bench.world.add_base(rc10_sim::Chassis::default(), wheels).unwrap();
    bench.machine.parts.base = Some(base.clone());
    // All wheels the same way turn it: those on the right roll backwards.
    let mut port = bus.port();
    for _ in 0..50 {
        let id = rc10_can::embedded_can::StandardId::new(0x200).unwrap();
        let amperes = [0x08, 0, 0xF8, 0, 0x08, 0, 0xF8, 0];
        let _ = rc10_can::CanPort::submit(&mut port, &rc10_can::CanFrame::eight_bytes(id, amperes));
        bench.wait(2_000_000);
    }
    let rate = base.twist().yaw;
    assert!(rate.abs() > 0.1, "{rate}");
    let felt = bench.machine.parts.imu.as_ref().unwrap().with(|imu| imu.motion.rotation[2]);
    assert!((felt - rate).abs() < 0.05 * rate.abs(), "{felt} {rate}");
}

/// A control loop in this test's hands: a temperature of 40 °C, a duty of 25 % at most.
#[test]
fn a_heater_keeps_its_imu_warm() {
    let mut bench = started(Board::DM_MC02);
    let thermal = Thermal { time_constant: 1.0, ..Thermal::default() };
    bench.machine.parts.thermal = thermal;
    bench.start_imu();
    // TIM3 at 1 kHz, channel 4 on PB1.
    bench.alternate(1, 1, 2);
    bench.write(TIM3 + 0x28, 63);
    bench.write(TIM3 + 0x2C, 999);
    bench.write(TIM3 + 0x1C, 0x6800);
    bench.write(TIM3 + 0x20, 1 << 12);
    bench.write(TIM3 + 0x14, 1);
    bench.write(TIM3, 1);
    bench.machine.watch_pin('B', 1).unwrap();
    let mut duty = 0.0;
    for _ in 0..12 {
        duty = f64::clamp(duty + (40.0 - bench.celsius()) * 3.0, 0.0, 250.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 250")]
        bench.write(TIM3 + 0x40, duty as u32);
        bench.wait(1_280_000_000);
    }
    let share = bench.machine.take_pin_time('B', 1).unwrap().share();
    let celsius = bench.machine.parts.imu.as_ref().unwrap().with(|imu| imu.celsius);
    assert!((celsius - 40.0).abs() < 0.3, "{celsius}");
    assert!((0.05..0.25).contains(&share), "{share}");
    // Half the voltage is a quarter of the power.
    bench.write(TIM3 + 0x40, 250);
    bench.machine.set_supply(12_000).unwrap();
    bench.wait(10_000_000_000);
    let celsius = bench.machine.parts.imu.as_ref().unwrap().with(|imu| imu.celsius);
    let expected = 25.0 + 12.0 * 0.25 * 144.0 / 47.0;
    assert!((celsius - expected).abs() < 0.05, "{celsius} {expected}");
    assert_eq!(reports(&bench.machine), [""; 0]);
}

/// The chip as a firmware's test may ask for it.
#[test]
fn options_and_faults_reach_the_chip() {
    let options = Options { board: Board::DM_MC02, ..Options::default() };
    for (switches_closed, value) in [(true, 0), (false, 3)] {
        let bench = Bench::new(WFI, Options { switches_closed, ..options });
        bench.write(RCC + 0xF4, 1 << 1);
        assert_eq!(bench.read(SYSCFG + 4) >> 26 & 3, value);
    }
    let silent = Bench::new(WFI, Options { silent: &["TIM17"], ..options });
    silent.write(0x4001_482C, 7);
    let gated = silent.machine.soc().count(AccessKind::Gated);
    assert_eq!((silent.read(0x4001_482C), gated), (0, 0));
    let unknown = Options { silent: &["TIM99"], ..options };
    let error = Machine::with(&program(WFI, START, HANDLER), unknown).err().unwrap().to_string();
    assert_eq!(error, "there is no peripheral TIM99");
    // ADC1's regulator, PER as its clock, ADEN, and no ADRDY as long as it fails.
    let mut bench = Bench::new(WFI, options);
    bench.write(RCC + 0xD8, 1 << 5);
    bench.write(RCC + 0x58, 2 << 16);
    bench.write(0x4002_2308, 3 << 18);
    bench.write(0x4002_2008, 3 << 8 | 1 << 28);
    bench.run_to(20_000);
    bench.machine.set_adc_fails(true);
    bench.write(0x4002_2008, 3 << 8 | 1 << 28 | 1);
    bench.run_to(5_000_000);
    assert_eq!(bench.read(0x4002_2000) & 1, 0);
    bench.machine.set_adc_fails(false);
    bench.run_to(5_010_000);
    assert_eq!(bench.read(0x4002_2000) & 1, 1);
}

#[test]
fn a_key_is_low_while_it_is_pressed() {
    let mut bench = started(Board::DM_MC02);
    // PA15 is an input.
    bench.set(GPIO, 3 << 30, 0);
    for (pressed, level) in [(false, 1), (true, 0), (false, 1)] {
        bench.machine.press_key(pressed).unwrap();
        assert_eq!(bench.read(GPIO + 0x10) >> 15 & 1, level, "{pressed}");
    }
    let mut other = started(Board::H723ZG);
    let error = other.machine.press_key(true).unwrap_err().to_string();
    assert_eq!(error, "h723zg has no key");
    assert!(other.machine.parts.imu.as_ref().is_none());
    assert!(other.machine.set_supply(24_000).is_err());
    other.run_to(5_000_000);
}
