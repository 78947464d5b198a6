//! One CAN bus alone, and a transceiver with a standby pin.

use embassy_stm32::Peri;
use embassy_stm32::gpio::Level;
use embassy_stm32::peripherals::{FDCAN2, PG4};
use embassy_time::Timer;
use rc10_bsp::can::{Bus, BusParts};
use rc10_can::embedded_can::{Frame as _, StandardId};
use rc10_can::{CanFrame, CanPort as _, Health};

use crate::report::Outcome;
use crate::{say, want};

/// Frames to send, one a millisecond.
const FRAMES: u32 = 20;

/// FDCAN2 without FDCAN1, on which all clocks depend; standby is high before the first frame.
pub async fn exchange(parts: BusParts<FDCAN2>, standby: Peri<'static, PG4>) -> Outcome {
    let mut port = Bus::start(parts.with_standby(standby, Level::High));
    // No motor takes it for a command.
    let Some(frame) = CanFrame::new(StandardId::MAX, &[0x10; 8]) else {
        return Err(say!("no such frame"));
    };
    let (mut sent, mut received) = (0, 0);
    for _ in 0..FRAMES {
        let _ = port.submit(&frame);
        Timer::after_millis(1).await;
        while port.receive().is_some() {
            received += 1;
        }
        sent += 1 - u32::from(port.cancel_pending());
    }
    let health = port.health();
    want!(sent == FRAMES && received > 0, "{sent} sent, {received} received, {health}");
    want!(health == Health::NEW, "{health}");
    Ok(say!("{sent} sent, others heard"))
}
