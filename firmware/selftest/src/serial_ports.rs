//! UARTs, with a device at the other end that sends back what comes.

use embassy_futures::join::join;
use embassy_stm32::peripherals::{DMA1_CH3, DMA1_CH4, USART3};
use embassy_time::{Duration, Timer, with_timeout};
use embedded_io_async::{Read, Write};
use rc10_bsp::dma_buffer;
use rc10_bsp::serial::{
    BaudError, Parity, Serial, SerialConfig, SerialError, SerialParts, StopBits,
};

use crate::report::Outcome;
use crate::{Irqs, PRIORITY, say, want};

/// More than ring and buffer hold, several times.
const MESSAGE: usize = 1000;

/// 115,200 baud, 8N1: a long message comes back whole, while the next piece of it is being sent.
pub async fn echo(port: Result<Serial, BaudError>) -> Outcome {
    let Ok(port) = port else { return Err(say!("no such baud rate")) };
    let (mut receiver, mut transmitter) = port.split();
    let byte = |index: usize| (index * 7 + index / 256).to_le_bytes()[0];
    let send = async {
        let message: [u8; MESSAGE] = core::array::from_fn(byte);
        // Dropped before it could take anything, or after: nothing is sent twice or lost.
        let mut sent = 0;
        while sent < MESSAGE {
            let write = transmitter.write(&message[sent..]);
            if let Ok(Ok(count)) = with_timeout(Duration::from_micros(300), write).await {
                sent += count;
            }
        }
        transmitter.flush().await
    };
    let receive = async {
        let (mut received, mut buffer) = (0, [0; 40]);
        while received < MESSAGE {
            let Ok(count) = receiver.read(&mut buffer).await else { return Err(received) };
            for &read in &buffer[..count] {
                if read != byte(received) {
                    return Err(received);
                }
                received += 1;
            }
        }
        Ok(())
    };
    let (sent, received) = join(send, receive).await;
    want!(sent.is_ok(), "could not send");
    if let Err(at) = received {
        return Err(say!("byte {at} did not come back"));
    }
    let counters = receiver.counters();
    want!(counters == Default::default(), "something was lost");
    Ok(say!("{MESSAGE} bytes came back"))
}

/// A frame: a mark, a number, and its complement.
const FRAME: usize = 3;
const MARK: u8 = 0xA5;
/// Frames that are sent.
const FRAMES: u8 = 250;

/// 100 kbaud, 8E2, inverted, disturbed: behind every error the next frame arrives.
pub async fn faults(parts: SerialParts<USART3, DMA1_CH3, DMA1_CH4>) -> Outcome {
    let (ring, buffer) = (dma_buffer!(u8; 64), dma_buffer!(u8; 16));
    let config = SerialConfig {
        parity: Parity::Even,
        stop_bits: StopBits::Two,
        invert_receive: true,
        invert_transmit: true,
        ..SerialConfig::new(100_000)
    };
    let port = Serial::start(parts, Irqs, &config, ring, buffer, PRIORITY);
    let Ok(port) = port else { return Err(say!("no such baud rate")) };
    let (mut receiver, mut transmitter) = port.split();
    let mut heard = [false; FRAMES as usize];
    let (mut errors, mut lost_in_a_row) = (0_u32, 0);
    for number in 0..FRAMES {
        let frame = [MARK, number, !number];
        let send = async {
            transmitter.write_all(&frame).await?;
            transmitter.flush().await
        };
        match send.await {
            Ok(()) => {}
            // The frame is lost; the next one is not.
            Err(SerialError::Dma) => errors += 1,
            Err(_) => return Err(say!("could not send {number}")),
        }
        let mut bytes = heapless::Vec::<u8, 16>::new();
        // The echo of three bytes takes less than 1 ms.
        let silence = Timer::after_millis(2);
        let listen = async {
            let mut buffer = [0; 16];
            loop {
                match receiver.read(&mut buffer).await {
                    Ok(count) => {
                        let _ = bytes.extend_from_slice(&buffer[..count]);
                    }
                    Err(error) => {
                        errors += 1;
                        defmt::debug!("{}", error);
                        let _: SerialError = error;
                    }
                }
            }
        };
        embassy_futures::select::select(silence, listen).await;
        let is_back = bytes.windows(FRAME).any(|piece| piece == frame);
        heard[usize::from(number)] = is_back;
        lost_in_a_row = if is_back { 0 } else { lost_in_a_row + 1 };
        // Faults are farther apart than that.
        want!(lost_in_a_row < 2, "after a fault frame {number} did not arrive");
    }
    let lost = heard.iter().filter(|heard| !**heard).count();
    let counters = receiver.counters();
    let kinds = [
        counters.framing,
        counters.parity,
        counters.noise,
        counters.breaks,
        counters.overruns,
        counters.dma,
    ];
    want!(lost == 0 || errors > 0, "{lost} frames lost without an error");
    let [framing, parity, noise, breaks, overruns, dma] = kinds;
    Ok(say!(
        "{lost} of {FRAMES} lost: {framing} F {parity} P {noise} N {breaks} B {overruns} O {dma} D"
    ))
}
