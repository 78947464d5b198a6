//! On the polled `fdcan` crate, whose message RAM is laid out here; clocks, pins: embassy-stm32.
//!
//! Unlike `rc10-bsp` it holds three frames each way, without a way back from bus-off.
#![no_std]
#![no_main]

use core::num::{NonZeroU8, NonZeroU16};

use cortex_m_rt::entry;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::pac::can::vals::Tfqm;
use embassy_stm32::peripherals::FDCAN1;
use embassy_stm32::rcc;
use embassy_stm32::{Peri, pac};
use fdcan::config::{Interrupt, NominalBitTiming};
use fdcan::frame::{FrameFormat, TxFrameHeader};
use fdcan::{FdCan, NormalOperationMode, ReceiveOverrun, message_ram};
use interop::{start, superloop};
use rc10_can::CanFrame;
use rc10_can::embedded_can::nb::Can;
use rc10_can::embedded_can::{self, Error, ErrorKind, ExtendedId, Frame, Id, StandardId};

/// FDCAN1, as the crate wants to know it.
struct Controller {
    _peripheral: Peri<'static, FDCAN1>,
}

/// RM0468, memory map.
const MESSAGE_RAM: usize = 0x4000_AC00;

// SAFETY: the value owns the peripheral, and the address is that of its registers.
unsafe impl fdcan::Instance for Controller {
    const REGISTERS: *mut fdcan::RegisterBlock = pac::FDCAN1.as_ptr().cast();
}

// SAFETY: the message RAM begins there; nothing else in this program uses it.
unsafe impl message_ram::Instance for Controller {
    const MSG_RAM: *mut message_ram::RegisterBlock = MESSAGE_RAM as *mut message_ram::RegisterBlock;
}

/// Tells the controller where the crate expects its parts, in words: 28 standard filters, 8
/// extended, three elements of 18 words a FIFO, three events. In configuration mode only.
fn lay_out_message_ram() {
    const EXTENDED_FILTERS: u16 = 28;
    const FIFO_0: u16 = EXTENDED_FILTERS + 8 * 2;
    const FIFO_1: u16 = FIFO_0 + 3 * 18;
    const EVENTS: u16 = FIFO_1 + 3 * 18;
    const TRANSMIT: u16 = EVENTS + 3 * 2;
    /// Elements with 64 data bytes.
    const LARGEST: u8 = 7;

    let can = pac::FDCAN1;
    can.sidfc().modify(|w| w.set_flssa(0));
    can.xidfc().modify(|w| w.set_flesa(EXTENDED_FILTERS));
    for (fifo, start) in [(0, FIFO_0), (1, FIFO_1)] {
        can.rxfc(fifo).write(|w| {
            w.set_fsa(start);
            w.set_fs(3);
        });
    }
    can.txefc().write(|w| {
        w.set_efsa(EVENTS);
        w.set_efs(3);
    });
    can.txbc().write(|w| {
        w.set_tbsa(TRANSMIT);
        w.set_tfqs(3);
        w.set_tfqm(Tfqm::QUEUE);
    });
    can.rxesc().write(|w| {
        w.set_fds(0, LARGEST);
        w.set_fds(1, LARGEST);
    });
    can.txesc().write(|w| w.set_tbds(LARGEST));
}

/// Frames that the crate can send: no data frames of no bytes, which become remote ones.
#[derive(Clone)]
struct Sendable(CanFrame);

impl Frame for Sendable {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        if data.is_empty() {
            return None;
        }
        CanFrame::new(id, data).map(Self)
    }
    fn new_remote(id: impl Into<Id>, length: usize) -> Option<Self> {
        if length > 0 {
            return None;
        }
        CanFrame::new_remote(id, length).map(Self)
    }
    fn is_extended(&self) -> bool {
        self.0.is_extended()
    }
    fn is_remote_frame(&self) -> bool {
        self.0.is_remote_frame()
    }
    fn id(&self) -> Id {
        self.0.id()
    }
    fn dlc(&self) -> usize {
        self.0.dlc()
    }
    fn data(&self) -> &[u8] {
        self.0.data()
    }
}

struct Fdcan {
    can: FdCan<Controller, NormalOperationMode>,
    overrun: bool,
}

impl Can for Fdcan {
    type Frame = Sendable;
    type Error = Overrun;

    fn transmit(&mut self, frame: &Sendable) -> nb::Result<Option<Sendable>, Overrun> {
        let header = TxFrameHeader {
            len: u8::try_from(frame.dlc()).unwrap_or(8),
            frame_format: FrameFormat::Standard,
            id: to_crate(frame.id()),
            bit_rate_switching: false,
            marker: None,
        };
        let mut evicted = |_, header: TxFrameHeader, words: &[u32]| {
            let mut data = [0; 8];
            for (bytes, word) in data.chunks_exact_mut(4).zip(words) {
                bytes.copy_from_slice(&word.to_le_bytes());
            }
            from_crate(header.id, &data[..usize::from(header.len).min(8)])
        };
        match self.can.transmit_preserve(header, frame.data(), &mut evicted) {
            Ok(evicted) => Ok(evicted.flatten().map(Sendable)),
            Err(_) => Err(nb::Error::WouldBlock),
        }
    }

    fn receive(&mut self) -> nb::Result<Sendable, Overrun> {
        if core::mem::take(&mut self.overrun) {
            self.can.clear_interrupt(Interrupt::RxFifo0MsgLost);
            return Err(nb::Error::Other(Overrun));
        }
        let mut data = [0; 64];
        let received = self.can.receive0(&mut data).map_err(|_| nb::Error::WouldBlock)?;
        // Told at the next call: this frame is a good one.
        self.overrun = matches!(received, ReceiveOverrun::Overrun(_));
        let info = received.unwrap();
        let length = usize::from(info.len).min(8);
        let frame = if info.rtr {
            CanFrame::new_remote(from_crate_id(info.id), length)
        } else {
            from_crate(info.id, &data[..length])
        };
        frame.map(Sendable).ok_or(nb::Error::WouldBlock)
    }
}

fn to_crate(id: Id) -> fdcan::id::Id {
    match id {
        Id::Standard(id) => fdcan::id::StandardId::new(id.as_raw()).map(Into::into),
        Id::Extended(id) => fdcan::id::ExtendedId::new(id.as_raw()).map(Into::into),
    }
    // Both crates know the same identifiers.
    .unwrap_or(fdcan::id::Id::Standard(fdcan::id::StandardId::MAX))
}

fn from_crate_id(id: fdcan::id::Id) -> Id {
    match id {
        fdcan::id::Id::Standard(id) => {
            StandardId::new(id.as_raw()).unwrap_or(StandardId::MAX).into()
        }
        fdcan::id::Id::Extended(id) => {
            ExtendedId::new(id.as_raw()).unwrap_or(ExtendedId::MAX).into()
        }
    }
}

fn from_crate(id: fdcan::id::Id, data: &[u8]) -> Option<CanFrame> {
    CanFrame::new(from_crate_id(id), data)
}

/// Frames came faster than they were read.
#[derive(Debug)]
struct Overrun;

impl Error for Overrun {
    fn kind(&self) -> ErrorKind {
        embedded_can::ErrorKind::Overrun
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
    rcc::enable_and_reset::<FDCAN1>();
    let alternate_function = 9; // STM32H723 data sheet, alternate functions of port D
    let (mut receive, mut transmit) = (Flex::new(p.PD0), Flex::new(p.PD1));
    receive.set_as_af_unchecked(alternate_function, AfType::input(Pull::None));
    let push_pull = AfType::output(OutputType::PushPull, Speed::VeryHigh);
    transmit.set_as_af_unchecked(alternate_function, push_pull);

    let mut can = FdCan::new(Controller { _peripheral: p.FDCAN1 }).into_config_mode();
    lay_out_message_ram();
    can.set_nominal_bit_timing(TIMING);
    let can = Fdcan { can: can.into_normal(), overrun: false };
    superloop(can, heartbeat)
}
