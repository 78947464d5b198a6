//! Boards that carry the chip: what is soldered, and which of the chip's pins lead outside.

/// A pin of the chip: its port, 'A' ..= 'K', and its number, 0 ..= 15.
pub type Pin = (char, usize);

/// A case, and the pins that it bonds out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Package {
    /// 100 pins: STM32H723V.
    Lqfp100,
    /// 144 pins: STM32H723Z.
    Lqfp144,
}

impl Package {
    /// The case's name in the data sheet.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lqfp100 => "LQFP100",
            Self::Lqfp144 => "LQFP144",
        }
    }

    /// Whether a pin (port 'A' ..= 'K', 0 ..= 15) is bonded out, be it behind a switch. Source:
    /// stm32-metapac 21.0.0, STM32H723VG and STM32H723ZG.
    pub(crate) const fn bonds(self, port: char, pin: usize) -> bool {
        match port {
            'A'..='E' => pin < 16,
            'F' | 'G' => matches!(self, Self::Lqfp144) && pin < 16,
            'H' => pin < 2,
            _ => false,
        }
    }

    /// Whether only the analog pad of a pin is bonded out: `PC2_C`, `PC3_C`. The digital part reaches
    /// it while the switch between them is closed. Source: data sheet DS13313, pin definitions.
    pub(crate) const fn is_behind_switch(self, port: char, pin: usize) -> bool {
        port == 'C' && (pin == 2 || pin == 3)
    }
}

/// A board with an STM32H723; with another crystal it is `Board { crystal_hz: 25_000_000,
/// ..Board::DM_MC02 }`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board {
    /// Name on the command line.
    pub name: &'static str,
    /// The chip's name.
    pub chip: &'static str,
    /// The chip's case.
    pub package: Package,
    /// The crystal at HSE, hertz.
    pub crystal_hz: u64,
    /// Whether the transceiver of each bus takes part: it has its 5 V, is not in standby, and its RX and TX are not
    /// exchanged. One that does not drives no bus, and its RXD rests high, so that the chip does not hear its own
    /// bits. Source: data sheets of TJA1051 and TJA1044, undervoltage detection and standby mode.
    pub transceivers: [bool; 3],
    /// Whether the core's regulator gets to its voltage: not without the capacitors at VCAP.
    pub core_supply: bool,
    /// The brown-out level in the chip's option bytes (`BOR_LEV`): 0 as sold, 3 as `docs/bring-up.md` says.
    pub brown_out: u8,
    /// Whether there is an inverter between the remote's receiver and the chip.
    pub inverts_remote: bool,
    /// The board's supply (VIN) at power-on, millivolts.
    pub supply: u32,
    /// Where the chip measures it.
    pub supply_sense: Option<SupplySense>,
    /// The board's BMI088.
    pub imu: Option<ImuWiring>,
    /// The BMI088's heater.
    pub heater: Option<Heater>,
    /// Where a W25Q64JV is: pins of its select, clock, and data lines 0 to 3.
    pub memory: Option<[Pin; 6]>,
    /// The key, which connects the pin to ground; a pull-up is beside it.
    pub key: Option<Pin>,
    /// Inputs for switches to ground, without a pull-up.
    pub switches: [Pin; 8],
    /// Outputs for servos.
    pub servos: [Pin; 4],
    /// Inputs for voltages, beside that of the supply.
    pub voltages: &'static [Pin],
    /// Input for a receiver that sends pulses.
    pub pulses: Pin,
}

/// Where a BMI088 is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImuWiring {
    /// Number of its SPI.
    pub spi: u8,
    /// Pin of the accelerometer's chip select.
    pub accelerometer_select: Pin,
    /// Pin of the gyroscope's.
    pub gyroscope_select: Pin,
}

/// A resistor between the board's supply and a switch that a pin closes while it is high.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heater {
    /// Port and number.
    pub pin: Pin,
    /// Resistance, ohms.
    pub ohms: u32,
}

/// A voltage divider from the board's supply to a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SupplySense {
    /// Port and number.
    pub pin: Pin,
    /// The supply divided by the pin's voltage.
    pub divider: u32,
}

impl Board {
    /// The team's own: STM32H723ZGT6, 25 MHz. Source: the team's `CubeMX` project.
    pub const H723ZG: Self = Self {
        name: "h723zg",
        chip: "STM32H723ZG",
        package: Package::Lqfp144,
        crystal_hz: 25_000_000,
        transceivers: [true; 3],
        core_supply: true,
        brown_out: 3,
        inverts_remote: false,
        supply: 24_000,
        supply_sense: None,
        imu: None,
        heater: None,
        memory: None,
        key: None,
        switches: [('G', 2), ('G', 3), ('G', 5), ('G', 6), ('G', 7), ('G', 8), ('G', 9), ('G', 10)],
        servos: [('D', 12), ('D', 13), ('D', 14), ('D', 15)],
        voltages: &[('B', 0), ('B', 1), ('C', 0), ('C', 1)],
        pulses: ('F', 8),
    };
    /// Damiao DM-MC02: STM32H723VGT6, 24 MHz. Source: the vendor's schematic of 2024-01-24.
    pub const DM_MC02: Self = Self {
        name: "dm-mc02",
        chip: "STM32H723VG",
        package: Package::Lqfp100,
        crystal_hz: 24_000_000,
        transceivers: [true; 3],
        core_supply: true,
        brown_out: 3,
        inverts_remote: true,
        supply: 24_000,
        // 100 and 10 kilohms at ADC1_INP4, from VIN: USB does not count.
        supply_sense: Some(SupplySense { pin: ('C', 4), divider: 11 }),
        imu: Some(ImuWiring { spi: 2, accelerometer_select: ('C', 0), gyroscope_select: ('C', 3) }),
        // Ten of 470 ohms in parallel.
        heater: Some(Heater { pin: ('B', 1), ohms: 47 }),
        memory: Some([('E', 11), ('B', 2), ('D', 11), ('B', 0), ('A', 3), ('A', 1)]),
        key: Some(('A', 15)),
        switches: [
            ('E', 14),
            ('E', 0),
            ('E', 1),
            ('C', 10),
            ('C', 11),
            ('C', 12),
            ('B', 8),
            ('B', 9),
        ],
        servos: [('E', 9), ('E', 13), ('A', 0), ('A', 2)],
        voltages: &[('A', 5)],
        pulses: ('D', 14),
    };
    /// All boards.
    pub const ALL: [Self; 2] = [Self::H723ZG, Self::DM_MC02];

    /// The board of a name; `None`: there is no such board.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|board| board.name == name)
    }
}

impl Default for Board {
    /// The team's own.
    fn default() -> Self {
        Self::H723ZG
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boards_have_names() {
        assert_eq!(Board::named("dm-mc02"), Some(Board::DM_MC02));
        assert_eq!(Board::named("h723zg"), Some(Board::H723ZG));
        assert_eq!(Board::named("nucleo"), None);
    }

    #[test]
    fn packages_bond_their_pins() {
        let count = |package: Package| {
            let pins = ('A'..='K').flat_map(|port| (0..16).map(move |pin| (port, pin)));
            pins.filter(|&(port, pin)| package.bonds(port, pin)).count()
        };
        assert_eq!((count(Package::Lqfp100), count(Package::Lqfp144)), (82, 114));
        for board in Board::ALL {
            assert!(board.switches.iter().all(|(port, pin)| board.package.bonds(*port, *pin)));
        }
    }
}
