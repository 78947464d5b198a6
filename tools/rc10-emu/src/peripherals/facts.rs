//! Connections of UARTs, SPIs and I2Cs inside the chip. Source: stm32-metapac.

#[derive(Debug)]
pub(super) struct Facts {
    pub number: u8,
    /// The kernel clock among those of its kind.
    pub clock: usize,
    /// Numbers of its interrupts: of an I2C event and error.
    pub interrupts: [usize; 2],
    /// DMAMUX1's number of its receive request; the transmit request is the next one.
    receive_request: u32,
}

impl Facts {
    /// Whether a number of DMAMUX1 is that of its receive request.
    pub const fn reads(&self, request: u32) -> bool {
        request == self.receive_request
    }

    /// Whether a number of DMAMUX1 is that of its transmit request.
    pub const fn writes(&self, request: u32) -> bool {
        request == self.receive_request + 1
    }
}

const fn facts(number: u8, clock: usize, interrupts: [usize; 2], receive_request: u32) -> Facts {
    Facts { number, clock, interrupts, receive_request }
}

/// USART1, 2, 3, UART4, 5, USART6, UART7, 8, 9, USART10: kernel clock 0 is from APB1, 1 from APB2.
pub(super) const USARTS: [Facts; 10] = [
    facts(1, 1, [37; 2], 41),
    facts(2, 0, [38; 2], 43),
    facts(3, 0, [39; 2], 45),
    facts(4, 0, [52; 2], 63),
    facts(5, 0, [53; 2], 65),
    facts(6, 1, [71; 2], 71),
    facts(7, 0, [82; 2], 79),
    facts(8, 0, [83; 2], 81),
    facts(9, 1, [155; 2], 116),
    facts(10, 1, [156; 2], 118),
];

/// SPI1 to SPI5: kernel clock 0 is that of SPI1 to 3, 1 that of SPI4 and 5.
pub(super) const SPIS: [Facts; 5] = [
    facts(1, 0, [35; 2], 37),
    facts(2, 0, [36; 2], 39),
    facts(3, 0, [51; 2], 61),
    facts(4, 1, [84; 2], 83),
    facts(5, 1, [85; 2], 85),
];

/// I2C1, 2, 3, 5.
pub(super) const I2CS: [Facts; 4] = [
    facts(1, 0, [31, 32], 33),
    facts(2, 0, [33, 34], 35),
    facts(3, 0, [72, 73], 73),
    facts(5, 0, [157, 158], 124),
];
