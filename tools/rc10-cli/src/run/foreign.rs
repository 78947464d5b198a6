//! Detects a program for another chip, by the peripherals that an STM32H723 does not have.

use std::ops::Range;

use rc10_emu::Report;

/// Parts of other chips at addresses where an STM32H723 has nothing, and where start-up code goes
/// first: their reference manuals' memory maps (RM0008, RM0090, RM0316, RM0351, RM0385, RM0440,
/// RM0456, RM0481).
const OTHERS: [(Range<u32>, &str); 6] = [
    (0x4002_3800..0x4002_3C00, "the clock control of STM32F2, F4 and F7"),
    (0x4002_1000..0x4002_1400, "the clock control of STM32F0, F1, F3, G0, G4, L0 and L4"),
    (0x4000_7000..0x4000_7400, "the power control of STM32F0 to F7, G4, L0 and L4"),
    (0xE004_2000..0xE004_2400, "the debug unit of STM32F1 to F7, G4 and L4"),
    (0x4602_0C00..0x4602_1000, "the clock control of STM32U5"),
    (0x4402_0C00..0x4402_1000, "the clock control of STM32H5"),
];

/// The part of another chip that a program has accessed, if any.
pub(crate) fn chip_of(reports: &[Report]) -> Option<String> {
    reports.iter().find_map(|report| {
        if !report.text.contains("unowned") {
            return None;
        }
        let (_, hex) = report.text.split_once("0x")?;
        let address = u32::from_str_radix(hex.get(..8)?, 16).ok()?;
        let (_, what) = OTHERS.iter().find(|(range, _)| range.contains(&address))?;
        Some(format!("it looks for {what}, at {address:#010x}"))
    })
}

#[cfg(test)]
mod tests {
    use rc10_sim::Nanos;

    use super::*;

    #[test]
    fn what_only_others_have_is_named() {
        let report = |text: &str| Report { at: Nanos::new(0), text: text.into() };
        let chip = |text: &str| chip_of(&[report(text)]);
        let f4 = "read of 0xe0042004 (no device): unowned or unaligned by HardFault";
        let words = "it looks for the debug unit of STM32F1 to F7, G4 and L4, at 0xe0042004";
        assert_eq!(chip(f4).as_deref(), Some(words));
        assert_eq!(chip("read of 0x58024400 (RCC): not modelled"), None);
        assert_eq!(chip("write to 0x60000000 (no device): unowned or unaligned by main"), None);
    }
}
