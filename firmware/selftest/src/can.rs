//! One CAN bus alone, and a transceiver with a standby pin.

use embassy_executor::Spawner;
use embassy_stm32::Peri;
use embassy_stm32::gpio::Level;
use embassy_stm32::peripherals::{FDCAN2, PG4};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::Timer;
use rc10_bsp::can::{Bus, BusParts, FdcanPort};
use rc10_can::embedded_can::{Frame as _, StandardId};
use rc10_can::{CanFrame, CanPort as _, Health};

use crate::report::Outcome;
use crate::{say, want};

/// Frames sent and not taken back, frames received, and how the bus was.
static RESULT: Signal<CriticalSectionRawMutex, (u32, u32, Health)> = Signal::new();

/// Frames to send.
const FRAMES: u32 = 20;

/// A frame that no motor takes for a command, every millisecond.
#[embassy_executor::task]
async fn talk(mut port: FdcanPort) {
    let (mut sent, mut received) = (0, 0);
    if let Some(frame) = CanFrame::new(StandardId::MAX, &[0x10; 8]) {
        for _ in 0..FRAMES {
            let _ = port.submit(&frame);
            Timer::after_millis(1).await;
            while port.receive().is_some() {
                received += 1;
            }
            sent += 1 - u32::from(port.cancel_pending());
        }
    }
    RESULT.signal((sent, received, port.health()));
}

/// Only FDCAN2 is used, not FDCAN1, on which the clock of all three depends; the standby pin is
/// high before the first frame leaves. Somebody acknowledges, and sends too.
pub async fn exchange(
    spawner: Spawner,
    parts: BusParts<FDCAN2>,
    standby: Peri<'static, PG4>,
) -> Outcome {
    let parts = parts.with_standby(standby, Level::High);
    let talks = talk(Bus::start(parts)).map(|task| spawner.spawn(task));
    want!(talks.is_ok(), "cannot spawn");
    let (sent, received, health) = RESULT.wait().await;
    want!(sent == FRAMES && received > 0, "{sent} sent, {received} received, {health}");
    want!(health == Health::NEW, "{health}");
    Ok(say!("{sent} sent, others heard"))
}
