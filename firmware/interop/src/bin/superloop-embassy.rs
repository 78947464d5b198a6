//! On embassy-stm32's own CAN driver with its queues, polled: interrupts fill and empty them.
//!
//! Unlike `rc10-bsp` it holds three frames, takes none back, and does not notice losses.
#![no_std]
#![no_main]

use core::num::{NonZeroU8, NonZeroU16};

use cortex_m_rt::entry;
use embassy_stm32::bind_interrupts;
use embassy_stm32::can::config::NominalBitTiming;
use embassy_stm32::can::enums::BusError;
use embassy_stm32::can::{
    BufferedCanReceiver, BufferedCanSender, CanConfigurator, Frame, IT0InterruptHandler,
    IT1InterruptHandler, RxBuf, TxBuf, config::TxBufferMode,
};
use embassy_stm32::peripherals::FDCAN1;
use interop::{start, superloop};
use rc10_can::embedded_can::nb::Can;
use rc10_can::embedded_can::{Error, ErrorKind};
use static_cell::ConstStaticCell;

bind_interrupts!(struct Irqs {
    FDCAN1_IT0 => IT0InterruptHandler<FDCAN1>;
    FDCAN1_IT1 => IT1InterruptHandler<FDCAN1>;
});

/// Room for the frames of two motors in 8 ms at 1 kHz.
static RECEIVE: ConstStaticCell<RxBuf<16>> = ConstStaticCell::new(RxBuf::new());
/// The commands of one tick.
static TRANSMIT: ConstStaticCell<TxBuf<4>> = ConstStaticCell::new(TxBuf::new());

struct Embassy {
    receiver: BufferedCanReceiver,
    sender: BufferedCanSender,
}

impl Can for Embassy {
    type Frame = Frame;
    type Error = Failed;

    fn transmit(&mut self, frame: &Frame) -> nb::Result<Option<Frame>, Failed> {
        self.sender.try_write(*frame).map(|()| None).map_err(|_| nb::Error::WouldBlock)
    }

    fn receive(&mut self) -> nb::Result<Frame, Failed> {
        match self.receiver.try_receive() {
            Ok(Ok(envelope)) => Ok(envelope.frame),
            Ok(Err(error)) => Err(nb::Error::Other(Failed(error))),
            Err(_) => Err(nb::Error::WouldBlock),
        }
    }
}

#[derive(Debug)]
struct Failed(BusError);

impl Error for Failed {
    fn kind(&self) -> ErrorKind {
        match self.0 {
            BusError::Stuff => ErrorKind::Stuff,
            BusError::Form => ErrorKind::Form,
            BusError::Acknowledge => ErrorKind::Acknowledge,
            BusError::BitRecessive | BusError::BitDominant => ErrorKind::Bit,
            BusError::Crc => ErrorKind::Crc,
            _ => ErrorKind::Other,
        }
    }
}

/// 25 MHz / 1 = 25 time quanta a bit; sampled after 19 of them (76 %).
const TIMING: NominalBitTiming = NominalBitTiming {
    prescaler: NonZeroU16::MIN,
    seg1: NonZeroU8::new(18).expect("not zero"),
    seg2: NonZeroU8::new(6).expect("not zero"),
    sync_jump_width: NonZeroU8::new(6).expect("not zero"),
};

#[entry]
fn main() -> ! {
    let (p, heartbeat) = start();
    let mut can = CanConfigurator::new(p.FDCAN1, p.PD0, p.PD1, Irqs);
    let mut settings = can.config().set_nominal_bit_timing(TIMING);
    // The default mode evicts frames to send more urgent ones.
    settings.tx_buffer_mode = TxBufferMode::Fifo;
    can.set_config(settings);
    let can = can.into_normal_mode().buffered(TRANSMIT.take(), RECEIVE.take());
    let can = Embassy { receiver: can.reader(), sender: can.writer() };
    superloop(can, heartbeat)
}
