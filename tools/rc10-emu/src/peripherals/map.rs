//! The address map. Source: stm32-metapac 21.0.0, STM32H723ZG; sizes from RM0468.

/// A clock gate and its reset, in RCC: the same bit of two registers.
#[derive(Clone, Copy)]
pub(super) struct Switch {
    /// Offset of the clock enable register in RCC.
    pub enable: u32,
    /// Bits of which one at least must be set: several peripherals' buses may share a part.
    pub mask: u32,
    /// Offset of the reset register in RCC; same bits. `None`: only a reset of the chip does it.
    pub reset: Option<u32>,
}

/// A clock gate; `None`: always a clock.
type Gate = Option<Switch>;

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Block {
    Rcc,
    Power,
    Flash,
    Syscfg,
    Exti,
    Debug,
    Watchdog,
    /// Port A is 0, K is 10.
    Gpio(usize),
    /// Index in the table of timers, of UARTs, ..
    Timer(usize),
    Usart(usize),
    /// .. of SPIs: SPI1 is 0; of I2Cs.
    Spi(usize),
    I2c(usize),
    /// DMA1 is 0.
    Dma(usize),
    DmaMux,
    /// FDCAN1 is 0.
    Fdcan(usize),
    FdcanRam,
    FdcanCalibration,
    Adc,
    /// The registers that ADC1 shares with ADC2.
    AdcCommon,
    /// OCTOSPI1.
    OctoSpi,
    OctoSpiManager,
    /// The chip has it, the model does not.
    Unmodelled,
}

#[derive(Clone, Copy)]
pub(super) struct Row {
    pub name: &'static str,
    pub base: u32,
    pub size: u32,
    pub switch: Gate,
    pub block: Block,
}

/// On every bus of this chip the reset registers lie so far below the enable registers.
const RESET_BELOW_ENABLE: u32 = 0xD4 - 0x7C;

const fn gate(enable: u32, bit: u32) -> Gate {
    Some(Switch { enable, mask: 1 << bit, reset: Some(enable - RESET_BELOW_ENABLE) })
}

const fn gate_without_reset(enable: u32, mask: u32) -> Gate {
    Some(Switch { enable, mask, reset: None })
}

const fn row(name: &'static str, base: u32, size: u32, switch: Gate, block: Block) -> Row {
    Row { name, base, size, switch, block }
}

// Offsets of the buses' enable registers in RCC.
words! {
    AHB3: 0xD4, AHB1: 0xD8, AHB2: 0xDC, AHB4: 0xE0, APB3: 0xE4, APB1_LOW: 0xE8, APB1_HIGH: 0xEC,
    APB2: 0xF0, APB4: 0xF4,
}
const NO_GATE: Gate = None;
use Block::Unmodelled;

/// All peripherals of the chip, by address.
#[rustfmt::skip]
pub(super) const MAP: &[Row] = &[
    row("TIM2", 0x4000_0000, 0x400, gate(APB1_LOW, 0), Block::Timer(0)),
    row("TIM3", 0x4000_0400, 0x400, gate(APB1_LOW, 1), Block::Timer(1)),
    row("TIM4", 0x4000_0800, 0x400, gate(APB1_LOW, 2), Block::Timer(2)),
    row("TIM5", 0x4000_0C00, 0x400, gate(APB1_LOW, 3), Block::Timer(3)),
    row("TIM6", 0x4000_1000, 0x400, gate(APB1_LOW, 4), Block::Timer(4)),
    row("TIM7", 0x4000_1400, 0x400, gate(APB1_LOW, 5), Block::Timer(5)),
    row("TIM12", 0x4000_1800, 0x400, gate(APB1_LOW, 6), Block::Timer(6)),
    row("TIM13", 0x4000_1C00, 0x400, gate(APB1_LOW, 7), Block::Timer(7)),
    row("TIM14", 0x4000_2000, 0x400, gate(APB1_LOW, 8), Block::Timer(8)),
    row("LPTIM1", 0x4000_2400, 0x400, gate(APB1_LOW, 9), Unmodelled),
    row("SPI2", 0x4000_3800, 0x400, gate(APB1_LOW, 14), Block::Spi(1)),
    row("SPI3", 0x4000_3C00, 0x400, gate(APB1_LOW, 15), Block::Spi(2)),
    row("SPDIFRX1", 0x4000_4000, 0x400, gate(APB1_LOW, 16), Unmodelled),
    row("USART2", 0x4000_4400, 0x400, gate(APB1_LOW, 17), Block::Usart(1)),
    row("USART3", 0x4000_4800, 0x400, gate(APB1_LOW, 18), Block::Usart(2)),
    row("UART4", 0x4000_4C00, 0x400, gate(APB1_LOW, 19), Block::Usart(3)),
    row("UART5", 0x4000_5000, 0x400, gate(APB1_LOW, 20), Block::Usart(4)),
    row("I2C1", 0x4000_5400, 0x400, gate(APB1_LOW, 21), Block::I2c(0)),
    row("I2C2", 0x4000_5800, 0x400, gate(APB1_LOW, 22), Block::I2c(1)),
    row("I2C3", 0x4000_5C00, 0x400, gate(APB1_LOW, 23), Block::I2c(2)),
    row("I2C5", 0x4000_6400, 0x400, gate(APB1_LOW, 25), Block::I2c(3)),
    row("CEC", 0x4000_6C00, 0x400, gate(APB1_LOW, 27), Unmodelled),
    row("DAC1", 0x4000_7400, 0x400, gate(APB1_LOW, 29), Unmodelled),
    row("UART7", 0x4000_7800, 0x400, gate(APB1_LOW, 30), Block::Usart(6)),
    row("UART8", 0x4000_7C00, 0x400, gate(APB1_LOW, 31), Block::Usart(7)),
    row("CRS", 0x4000_8400, 0x400, gate(APB1_HIGH, 1), Unmodelled),
    row("SWPMI1", 0x4000_8800, 0x400, gate(APB1_HIGH, 2), Unmodelled),
    row("OPAMP1", 0x4000_9000, 0x10, gate(APB1_HIGH, 4), Unmodelled),
    row("OPAMP2", 0x4000_9010, 0x3F0, gate(APB1_HIGH, 4), Unmodelled),
    row("MDIOS", 0x4000_9400, 0x400, gate(APB1_HIGH, 5), Unmodelled),
    row("FDCAN1", 0x4000_A000, 0x400, gate(APB1_HIGH, 8), Block::Fdcan(0)),
    row("FDCAN2", 0x4000_A400, 0x400, gate(APB1_HIGH, 8), Block::Fdcan(1)),
    row("FDCAN_CCU", 0x4000_A800, 0x400, gate(APB1_HIGH, 8), Block::FdcanCalibration),
    row("FDCANRAM", 0x4000_AC00, 0x2800, gate(APB1_HIGH, 8), Block::FdcanRam),
    row("FDCAN3", 0x4000_D400, 0x400, gate(APB1_HIGH, 8), Block::Fdcan(2)),
    row("TIM23", 0x4000_E000, 0x400, gate(APB1_HIGH, 24), Block::Timer(9)),
    row("TIM24", 0x4000_E400, 0x400, gate(APB1_HIGH, 25), Block::Timer(10)),
    row("TIM1", 0x4001_0000, 0x400, gate(APB2, 0), Block::Timer(11)),
    row("TIM8", 0x4001_0400, 0x400, gate(APB2, 1), Block::Timer(12)),
    row("USART1", 0x4001_1000, 0x400, gate(APB2, 4), Block::Usart(0)),
    row("USART6", 0x4001_1400, 0x400, gate(APB2, 5), Block::Usart(5)),
    row("UART9", 0x4001_1800, 0x400, gate(APB2, 6), Block::Usart(8)),
    row("USART10", 0x4001_1C00, 0x400, gate(APB2, 7), Block::Usart(9)),
    row("SPI1", 0x4001_3000, 0x400, gate(APB2, 12), Block::Spi(0)),
    row("SPI4", 0x4001_3400, 0x400, gate(APB2, 13), Block::Spi(3)),
    row("TIM15", 0x4001_4000, 0x400, gate(APB2, 16), Unmodelled),
    row("TIM16", 0x4001_4400, 0x400, gate(APB2, 17), Block::Timer(13)),
    row("TIM17", 0x4001_4800, 0x400, gate(APB2, 18), Block::Timer(14)),
    row("SPI5", 0x4001_5000, 0x400, gate(APB2, 20), Block::Spi(4)),
    row("SAI1", 0x4001_5800, 0x400, gate(APB2, 22), Unmodelled),
    row("DFSDM1", 0x4001_7800, 0x400, gate(APB2, 28), Unmodelled),
    row("DMA1", 0x4002_0000, 0x400, gate(AHB1, 0), Block::Dma(0)),
    row("DMA2", 0x4002_0400, 0x400, gate(AHB1, 1), Block::Dma(1)),
    // It has a clock if one of its DMAs has.
    row("DMAMUX1", 0x4002_0800, 0x400, gate_without_reset(AHB1, 0b11), Block::DmaMux),
    row("ADC1", 0x4002_2000, 0x100, gate(AHB1, 5), Block::Adc),
    row("ADC2", 0x4002_2100, 0x200, gate(AHB1, 5), Unmodelled),
    row("ADC12_COMMON", 0x4002_2300, 0x100, gate(AHB1, 5), Block::AdcCommon),
    row("ETH", 0x4002_8000, 0x1400, gate(AHB1, 15), Unmodelled),
    row("USB_OTG_HS", 0x4004_0000, 0x40000, gate(AHB1, 25), Unmodelled),
    row("DCMI", 0x4802_0000, 0x400, gate(AHB2, 0), Unmodelled),
    row("PSSI", 0x4802_0400, 0x400, gate(AHB2, 0), Unmodelled),
    row("RNG", 0x4802_1800, 0x400, gate(AHB2, 6), Unmodelled),
    row("SDMMC2", 0x4802_2400, 0x400, gate(AHB2, 9), Unmodelled),
    row("DLYB_SDMMC2", 0x4802_2800, 0x400, gate(AHB2, 9), Unmodelled),
    row("FMAC", 0x4802_4000, 0x400, gate(AHB2, 16), Unmodelled),
    row("CORDIC", 0x4802_4400, 0x400, gate(AHB2, 17), Unmodelled),
    row("LTDC", 0x5000_1000, 0x1000, gate(APB3, 3), Unmodelled),
    row("WWDG1", 0x5000_3000, 0x1000, gate_without_reset(APB3, 1 << 6), Unmodelled),
    row("MDMA", 0x5200_0000, 0x1000, gate(AHB3, 0), Unmodelled),
    row("DMA2D", 0x5200_1000, 0x1000, gate(AHB3, 4), Unmodelled),
    row("FLASH", 0x5200_2000, 0x1000, NO_GATE, Block::Flash),
    row("FMC", 0x5200_4000, 0x1000, gate(AHB3, 12), Unmodelled),
    row("OCTOSPI1", 0x5200_5000, 0x1000, gate(AHB3, 14), Block::OctoSpi),
    row("DLYB_OCTOSPI1", 0x5200_6000, 0x1000, gate(AHB3, 14), Unmodelled),
    row("SDMMC1", 0x5200_7000, 0x1000, gate(AHB3, 16), Unmodelled),
    row("DLYB_SDMMC1", 0x5200_8000, 0x1000, gate(AHB3, 16), Unmodelled),
    row("OCTOSPI2", 0x5200_A000, 0x1000, gate(AHB3, 19), Unmodelled),
    row("DLYB_OCTOSPI2", 0x5200_B000, 0x400, gate(AHB3, 19), Unmodelled),
    row("OCTOSPIM", 0x5200_B400, 0x400, gate(AHB3, 21), Block::OctoSpiManager),
    row("EXTI", 0x5800_0000, 0x400, NO_GATE, Block::Exti),
    row("SYSCFG", 0x5800_0400, 0x400, gate(APB4, 1), Block::Syscfg),
    row("LPUART1", 0x5800_0C00, 0x400, gate(APB4, 3), Unmodelled),
    row("SPI6", 0x5800_1400, 0x400, gate(APB4, 5), Unmodelled),
    row("I2C4", 0x5800_1C00, 0x400, gate(APB4, 7), Unmodelled),
    row("LPTIM2", 0x5800_2400, 0x400, gate(APB4, 9), Unmodelled),
    row("LPTIM3", 0x5800_2800, 0x400, gate(APB4, 10), Unmodelled),
    row("LPTIM4", 0x5800_2C00, 0x400, gate(APB4, 11), Unmodelled),
    row("LPTIM5", 0x5800_3000, 0x400, gate(APB4, 12), Unmodelled),
    row("COMP1", 0x5800_380C, 0x4, gate(APB4, 14), Unmodelled),
    row("COMP2", 0x5800_3810, 0x3F0, gate(APB4, 14), Unmodelled),
    row("VREFBUF", 0x5800_3C00, 0x400, gate(APB4, 15), Unmodelled),
    row("RTC", 0x5800_4000, 0x400, gate_without_reset(APB4, 1 << 16), Unmodelled),
    row("IWDG1", 0x5800_4800, 0x400, NO_GATE, Block::Watchdog),
    row("SAI4", 0x5800_5400, 0x400, gate(APB4, 21), Unmodelled),
    row("DTS", 0x5800_6800, 0x400, gate(APB4, 26), Unmodelled),
    row("GPIOA", 0x5802_0000, 0x400, gate(AHB4, 0), Block::Gpio(0)),
    row("GPIOB", 0x5802_0400, 0x400, gate(AHB4, 1), Block::Gpio(1)),
    row("GPIOC", 0x5802_0800, 0x400, gate(AHB4, 2), Block::Gpio(2)),
    row("GPIOD", 0x5802_0C00, 0x400, gate(AHB4, 3), Block::Gpio(3)),
    row("GPIOE", 0x5802_1000, 0x400, gate(AHB4, 4), Block::Gpio(4)),
    row("GPIOF", 0x5802_1400, 0x400, gate(AHB4, 5), Block::Gpio(5)),
    row("GPIOG", 0x5802_1800, 0x400, gate(AHB4, 6), Block::Gpio(6)),
    row("GPIOH", 0x5802_1C00, 0x400, gate(AHB4, 7), Block::Gpio(7)),
    row("GPIOJ", 0x5802_2400, 0x400, gate(AHB4, 9), Block::Gpio(9)),
    row("GPIOK", 0x5802_2800, 0x400, gate(AHB4, 10), Block::Gpio(10)),
    row("RCC", 0x5802_4400, 0x400, NO_GATE, Block::Rcc),
    row("PWR", 0x5802_4800, 0x400, NO_GATE, Block::Power),
    row("CRC", 0x5802_4C00, 0x400, gate(AHB4, 19), Unmodelled),
    row("BDMA", 0x5802_5400, 0x400, gate(AHB4, 21), Unmodelled),
    row("DMAMUX2", 0x5802_5800, 0x400, gate(AHB4, 21), Unmodelled),
    row("ADC3", 0x5802_6000, 0x300, gate(AHB4, 24), Unmodelled),
    row("ADC3_COMMON", 0x5802_6300, 0x100, gate(AHB4, 24), Unmodelled),
    row("HSEM", 0x5802_6400, 0x400, gate(AHB4, 25), Unmodelled),
    row("DBGMCU", 0x5C00_1000, 0x400, NO_GATE, Block::Debug),
];

/// First address behind each bus, and clocks of AXI and AHB, and of the APB behind them, of an
/// access of the core. Our estimates, of the order told of this family: reads of a timer or an
/// FDCAN in 40 to 50 clocks at 480 MHz with buses of 240 and 120 MHz, of a GPIO port in half of
/// that.
const WAYS: [(u32, (u64, u64)); 7] = [
    (0x4002_0000, (10, 6)), // APB1, APB2 of domain 2
    (0x5000_0000, (12, 0)), // AHB1, AHB2 of domain 2
    (0x5200_0000, (6, 4)),  // APB3 of domain 1
    (0x5800_0000, (6, 0)),  // AHB3 of domain 1
    (0x5802_0000, (10, 6)), // APB4 of domain 3
    (0x5C00_0000, (12, 0)), // AHB4 of domain 3
    (u32::MAX, (10, 6)),    // the debug unit
];

pub(super) fn way_to(address: u32) -> (u64, u64) {
    let way = WAYS.iter().find(|(end, _)| address < *end);
    way.unwrap_or(&WAYS[WAYS.len() - 1]).1
}

/// The row that owns an address, and its index.
pub(super) fn row_of(address: u32) -> Option<(usize, &'static Row)> {
    let index = MAP.partition_point(|row| row.base <= address).checked_sub(1)?;
    let row = MAP.get(index)?;
    (address - row.base < row.size).then_some((index, row))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_sorted_and_do_not_overlap() {
        for pair in MAP.windows(2) {
            let [before, after] = pair else { unreachable!() };
            assert!(before.base + before.size <= after.base, "{} {}", before.name, after.name);
        }
    }

    #[test]
    fn an_address_finds_its_owner() {
        let name = |address| row_of(address).map(|(_, row)| row.name);
        assert_eq!(name(0x4000_0000), Some("TIM2"));
        assert_eq!(name(0x4000_D3FC), Some("FDCANRAM"));
        assert_eq!(name(0x4000_D400), Some("FDCAN3"));
        assert_eq!(name(0x5802_2000), None, "there is no port I");
        assert_eq!(name(0x3FFF_FFFC), None);
    }
}
