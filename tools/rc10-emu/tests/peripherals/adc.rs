//! ADC1 on PC4, as a program written to the manual uses it.

use rc10_emu::Board;
use rc10_emu::peripherals::{AccessKind, AdcFault, ResetCause};
use rc10_sim::Nanos;

use crate::chip::{AHB1ENR, Chip, RCC, TOO_FAST};

const ADC1: u32 = 0x4002_2000;
const ISR: u32 = ADC1;
const IER: u32 = ADC1 + 0x04;
const CR: u32 = ADC1 + 0x08;
const CFGR: u32 = ADC1 + 0x0C;
const CFGR2: u32 = ADC1 + 0x10;
const SMPR1: u32 = ADC1 + 0x14;
const PCSEL: u32 = ADC1 + 0x1C;
const SQR1: u32 = ADC1 + 0x30;
const DR: u32 = ADC1 + 0x40;
const CCR: u32 = ADC1 + 0x308;
const ADEN: u32 = 1;
const ADSTART: u32 = 1 << 2;
const ADCALLIN: u32 = 1 << 16;
const ADVREGEN: u32 = 1 << 28;
const ADCAL: u32 = 1 << 31;
const BOOST: u32 = 3 << 8;
const EOC: u32 = 1 << 2;
const EOS: u32 = 1 << 3;
const OVR: u32 = 1 << 4;

/// DM-MC02 on 24 V with ADC1's gate open; PER, which is HSI, divided by 2: a clock of 16 MHz.
fn gated() -> Chip {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    chip.start_clocks_with(2, 40, 6);
    chip.set(RCC + 0x58, 3 << 16, 2 << 16);
    chip.write(AHB1ENR, 1 << 5);
    chip.write(CCR, 1 << 18);
    assert!(chip.soc.set_supply(24_000, Nanos::new(chip.now)));
    chip
}

/// Switches the regulator on, waits for it, and enables.
fn enable(chip: &mut Chip, boost: u32) {
    chip.write(CR, boost | ADVREGEN);
    chip.run_to(chip.now + 10_000);
    chip.write(CR, boost | ADVREGEN | ADEN);
}

/// Enabled, and set up for channel 4 with 16.5 clocks.
fn enabled() -> Chip {
    let mut chip = gated();
    enable(&mut chip, BOOST);
    chip.wait(ISR, 1);
    chip.write(SMPR1, 3 << 12);
    chip.write(PCSEL, 1 << 4);
    chip.write(SQR1, 4 << 6);
    assert_eq!(chip.kinds(), []);
    chip
}

fn start(chip: &mut Chip) {
    chip.set(CR, ADSTART, ADSTART);
}

#[test]
fn it_starts_as_the_manual_says() {
    let mut chip = gated();
    assert_eq!(chip.read(CR), 1 << 29, "deep power-down after a reset");
    chip.write(CR, BOOST | ADVREGEN);
    let start = chip.now;
    chip.run_to(start + 9_999);
    assert_eq!(chip.read(ISR) >> 12 & 1, 0, "LDORDY");
    chip.run_to(start + 10_000);
    assert_eq!(chip.read(ISR) >> 12 & 1, 1);
    // Of 16 MHz: with linearity 16,384 to 165,010 clocks, without 20 to 1280: from the least to
    // the most of what sources say (`adc.rs`).
    for (linearity, shortest, longest) in [(ADCALLIN, 1_024_000, 10_313_125), (0, 1_250, 80_000)] {
        let start = chip.now;
        chip.write(CR, BOOST | ADVREGEN | linearity);
        chip.write(CR, BOOST | ADVREGEN | linearity | ADCAL);
        chip.run_to(start + shortest - 1);
        assert_eq!(chip.read(CR) & ADCAL, ADCAL);
        chip.run_to(start + longest);
        assert_eq!(chip.read(CR) & ADCAL, 0);
    }
    chip.write(CR, BOOST | ADVREGEN | ADEN);
    assert_eq!(chip.read(ISR) & 1, 0);
    // A conversion's time, some ten clocks.
    chip.run_to(chip.now + 1_000);
    assert_eq!((chip.read(ISR) & 1, chip.read(CR) & ADEN), (1, ADEN));
    chip.write(ISR, 1);
    assert_eq!(chip.read(ISR) & 1, 0);
    assert_eq!(chip.kinds(), []);
}

/// 24 V / 11 of 3.3 V.
#[test]
fn the_supply_is_measured_in_all_resolutions() {
    let mut chip = enabled();
    // RES, code, time of 16.5 clocks and the approximation, which is 8.5 for 16 bits.
    for (resolution, code, nanos) in [
        (0, 43_329, 1_563),
        (1, 10_832, 1_500),
        (2, 2_708, 1_438),
        (3, 677, 1_375),
        (5, 10_832, 1_500),
        (6, 2_708, 1_438),
        (7, 169, 1_313),
    ] {
        chip.write(CFGR, 1 << 31 | resolution << 2);
        chip.write(IER, EOC);
        start(&mut chip);
        let began = chip.now;
        assert_eq!(chip.read(CR) & ADSTART, ADSTART);
        assert_eq!(chip.until_interrupt(18, u64::MAX), Some(began + nanos), "{resolution}");
        assert_eq!(chip.read(ISR) & (EOC | EOS), EOC | EOS);
        assert_eq!((chip.read(CR) & ADSTART, chip.read(DR)), (0, code));
        assert!(!chip.interrupt(18), "reading takes it");
        chip.write(ISR, EOS);
    }
    assert_eq!(chip.kinds(), []);
    // More than the reference.
    assert!(chip.soc.set_supply(40_000, Nanos::new(chip.now)));
    start(&mut chip);
    chip.run_to(chip.now + 10_000);
    assert_eq!(chip.read(DR), 0xFF);
}

#[test]
fn sequences_oversampling_and_overrun() {
    let mut chip = enabled();
    let now = Nanos::new(chip.now);
    assert!(chip.soc.set_voltage('A', 5, 1_650_000, now));
    // Channels 4, 19, 4; 16 samples each, shifted back.
    chip.write(PCSEL, 1 << 4 | 1 << 19);
    chip.write(SQR1, 2 | 4 << 6 | 19 << 12 | 4 << 18);
    chip.write(CFGR2, 15 << 16 | 4 << 5 | 1);
    start(&mut chip);
    let mut results = Vec::new();
    for _ in 0..3 {
        chip.wait(ISR, EOC);
        results.push(chip.read(DR));
    }
    assert_eq!(results, [43_329, 32_768, 43_329]);
    assert_eq!(chip.read(ISR) & OVR, 0);
    // Unread: the first stays, or with OVRMOD the last.
    for (mode, code) in [(0, 43_329), (1 << 12, 32_768)] {
        chip.write(ISR, u32::MAX);
        chip.write(CFGR, 1 << 31 | mode);
        chip.write(SQR1, 1 | 4 << 6 | 19 << 12);
        start(&mut chip);
        chip.run_to(chip.now + 1_000_000);
        assert_eq!((chip.read(ISR) & OVR, chip.read(DR)), (OVR, code));
    }
    assert_eq!(chip.kinds(), []);
}

#[test]
fn continuous_conversions_go_by_dma() {
    const DMA1: u32 = 0x4002_0000;
    let mut chip = enabled();
    chip.write(RCC + 0xDC, 1 << 29);
    // ADC1's request to stream 0: half words.
    chip.stream((1, 0), 9, [DR, 0x3000_0000], 4, 1 << 13 | 1 << 11 | 1);
    // CONT, DMNGT.
    chip.write(CFGR, 1 << 31 | 1 << 13 | 1);
    start(&mut chip);
    chip.run_to(chip.now + 4 * 1_563);
    assert_eq!(chip.read(DMA1 + 0x14), 0);
    for word in [0x3000_0000, 0x3000_0004] {
        assert_eq!(chip.memory.word(word).unwrap(), 43_329 << 16 | 43_329);
    }
    // ADSTP.
    chip.set(CR, 1 << 4, 1 << 4);
    assert_eq!(chip.read(CR) & (ADSTART | 1 << 4), 0);
    assert_eq!(chip.soc.next_event(), None);
    assert_eq!(chip.kinds(), []);
}

#[test]
fn what_the_manual_forbids_is_told() {
    // Too early for the regulator.
    let mut chip = gated();
    chip.write(CR, ADVREGEN);
    chip.write(CR, ADVREGEN | ADCAL);
    assert_eq!(chip.kinds(), [AccessKind::Adc(AdcFault::RegulatorNotUp)]);
    assert_eq!(chip.read(CR) & ADCAL, 0);
    // Too early for the converter.
    chip.run_to(chip.now + 10_000);
    chip.write(CR, BOOST | ADVREGEN | ADEN);
    chip.write(CR, BOOST | ADVREGEN | ADEN | ADSTART);
    assert_eq!(chip.kinds(), [AccessKind::Adc(AdcFault::NotReady)]);
    // A channel whose switch is open.
    let mut chip = enabled();
    chip.write(PCSEL, 1 << 5);
    start(&mut chip);
    let report = chip.soc.take_reports()[0].to_string();
    assert_eq!(report, "ADC1 converts channel 4, which is not preselected (PCSEL)");
    // What is locked while it converts, and while it is on.
    chip.write(SQR1, 0);
    chip.write(CCR, 0);
    assert_eq!(chip.kinds(), [AccessKind::Protected; 2]);
    chip.wait(ISR, EOC);
    assert_eq!((chip.read(DR), chip.read(SQR1)), (0, 4 << 6));
    // Triggers, injected channels.
    chip.write(CFGR, 1 << 31 | 1 << 10);
    chip.write(ADC1 + 0x4C, 1);
    assert_eq!(chip.kinds(), [AccessKind::Unmodelled; 2]);
    // AUTDLY, DISCEN, JDISCEN, JQM, AWD1EN, JAWD1EN, JAUTO.
    for bit in [14, 16, 20, 21, 23, 24, 25] {
        chip.write(CFGR, 1 << 31 | 1 << bit);
        assert_eq!(chip.kinds(), [AccessKind::Unmodelled], "{bit}");
    }
    // DISCNUM, AWD1SGL, AWD1CH: of no meaning without those.
    for bit in [17, 19, 22, 26, 30] {
        chip.write(CFGR, 1 << 31 | 1 << bit);
        assert_eq!(chip.kinds(), [], "{bit}");
    }
}

/// Calibration, start and conversion, with a defect that comes and goes, also over a reset.
#[test]
fn one_that_fails_ends_nothing() {
    let mut chip = gated();
    let fail = |chip: &mut Chip, fails| chip.soc.set_adc_fails(fails, Nanos::new(chip.now));
    chip.write(CR, BOOST | ADVREGEN);
    chip.run_to(chip.now + 10_000);
    let check = |chip: &mut Chip, register, before, after| {
        fail(chip, true);
        chip.run_to(chip.now + 100_000_000);
        assert_eq!((chip.read(register), chip.soc.next_event()), (before, None));
        fail(chip, false);
        assert_eq!(chip.read(register), after);
    };
    chip.write(CR, BOOST | ADVREGEN | ADCAL);
    check(&mut chip, CR, BOOST | ADVREGEN | ADCAL, BOOST | ADVREGEN);
    chip.write(CR, BOOST | ADVREGEN | ADEN);
    check(&mut chip, ISR, 1 << 12, 1 << 12 | 1);
    chip.write(PCSEL, 1 << 4);
    chip.write(SQR1, 4 << 6);
    start(&mut chip);
    check(&mut chip, ISR, 1 << 12 | 1, 1 << 12 | 1 | 1 << 1 | EOC | EOS);
    assert_eq!((chip.read(DR), chip.kinds()), (43_329, vec![]));
    // A reset of the chip repairs nothing.
    fail(&mut chip, true);
    chip.soc.reset(ResetCause::Software, Nanos::new(chip.now));
    chip.set(RCC + 0x58, 3 << 16, 2 << 16);
    chip.write(AHB1ENR, 1 << 5);
    enable(&mut chip, 0);
    chip.run_to(chip.now + 100_000_000);
    assert_eq!(chip.read(ISR) & 1, 0);
}

#[test]
fn its_clock_has_limits() {
    // CKMODE 1: 240 MHz / 2.
    let mut chip = gated();
    chip.write(CCR, 1 << 16);
    enable(&mut chip, BOOST);
    let report = chip.soc.take_reports()[0].to_string();
    assert!(report.contains("ADC1's clock is 120 MHz, with this BOOST 50 are allowed"), "{report}");
    // 16 MHz need BOOST 2.
    for (boost, count) in [(1, 1), (2, 0)] {
        let mut chip = gated();
        enable(&mut chip, boost << 8);
        assert_eq!(chip.soc.count(TOO_FAST), count, "{boost}");
    }
    // PLL2 is off.
    let mut chip = gated();
    chip.set(RCC + 0x58, 3 << 16, 0);
    enable(&mut chip, BOOST);
    assert_eq!(chip.kinds(), [AccessKind::Adc(AdcFault::NoClock)]);
}

#[test]
fn voltages_are_at_pins_that_lead_to_it() {
    let now = Nanos::ZERO;
    let mut chip = Chip::on(Board::DM_MC02, 0);
    assert!(!chip.soc.set_voltage('D', 4, 1, now));
    assert!(!chip.soc.set_voltage('F', 11, 1, now), "not bonded out");
    let mut chip = Chip::new();
    assert!(chip.soc.set_voltage('F', 11, 1, now));
    assert!(!chip.soc.set_supply(24_000, now), "this board does not measure it");
}
