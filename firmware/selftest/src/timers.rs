//! Tests of timers, and of pins that interrupt.

use embassy_futures::join::join;
use embassy_futures::select::{Either, select};
use embassy_stm32::exti::ExtiInput;
use embassy_stm32::gpio::Pull;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer;
use embassy_stm32::timer::input_capture::{CapturePin, InputCapture};
use embassy_stm32::timer::low_level::CountingMode;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::{Duration, Ticker, Timer, with_timeout};
use embedded_hal::pwm::SetDutyCycle;
use rc10_board::board::{CaptureParts, EncoderParts, StripParts, SwitchParts};
use rc10_bsp::dma_buffer;
use rc10_bsp::pulse_input::PulseInput;
use rc10_bsp::pulse_output::{PulseError, PulseOutput};
use rc10_bsp::quadrature::{QuadratureCounter, QuadratureTimer};
use rc10_bsp::servo::ServoOutput;
use rc10_module::encoder::Counter;
use rc10_module::led::ws2812::{BITS, PulseTiming, Pulses, Strip};
use rc10_module::limit_switch::{Active, Config, Position, watch};
use smart_leds_trait::{RGB8, SmartLedsWriteAsync};

use crate::report::Outcome;
use crate::{Irqs, PRIORITY, say, want};

/// The first servo's pulse, µs, which is also to be measured.
const PULSE: u16 = 1500;

/// Four servos at 50 Hz; a pulse of 1.5 ms is measured.
pub async fn servo(mut servos: [ServoOutput; 4], capture: CaptureParts) -> Outcome {
    for (servo, micros) in servos.iter_mut().zip((PULSE..).step_by(100)) {
        let _ = servo.set_duty_cycle(micros);
    }
    let mut capture = InputCapture::new(
        capture.timer,
        Some(CapturePin::new(capture.pin, Pull::Down)),
        None,
        None,
        None,
        Irqs,
        Hertz(1_000_000),
        CountingMode::EdgeAlignedUp,
    );
    let mut last = 0;
    for _ in 0..3 {
        let rising = capture.wait_for_rising_edge(timer::Channel::Ch1).await;
        let falling = capture.wait_for_falling_edge(timer::Channel::Ch1).await;
        last = falling.wrapping_sub(rising);
        want!(last.abs_diff(PULSE.into()) <= 1, "measured {last} us");
    }
    // Driving on would disturb what comes.
    for servo in &mut servos {
        let _ = servo.set_duty_cycle_fully_off();
    }
    Ok(say!("measured {last} us"))
}

/// Turning points of the encoders: first forward, then back beyond zero, then to the end.
const FORTH: i64 = 1000;
const BACK: i64 = -2000;
const END: i64 = 500;

/// Both counters are turned beyond zero and back, and not a count is lost.
pub async fn encoders(parts: EncoderParts) -> Outcome {
    let (a, b) = parts.short_tracks;
    let short = QuadratureCounter::start(parts.short, a, b, Pull::Up);
    let (a, b) = parts.long_tracks;
    let long = QuadratureCounter::start(parts.long, a, b, Pull::Up);
    let counters = [
        (short, Counter::new(embassy_stm32::peripherals::TIM3::MODULUS)),
        (long, Counter::new(embassy_stm32::peripherals::TIM5::MODULUS)),
    ];
    let mut totals = [0; 2];
    let mut extremes = [(0, 0); 2];
    let mut counters = counters;
    let mut ticker = Ticker::every(Duration::from_millis(1));
    defmt::info!("turn the encoders");
    for _ in 0..2000 {
        ticker.next().await;
        for (index, (counter, encoder)) in counters.iter_mut().enumerate() {
            want!(encoder.update(counter.read()).is_ok(), "encoder {index} beyond its modulus");
            let total = encoder.total();
            let (least, most) = extremes[index];
            extremes[index] = (total.min(least), total.max(most));
            totals[index] = total;
        }
        if totals == [END; 2] && extremes == [(BACK, FORTH); 2] {
            return Ok(say!("{BACK} to {FORTH}, ended at {END}"));
        }
    }
    Err(say!("ended at {totals:?}, were at {extremes:?}"))
}

/// The switches' events: which one, and its position then. However they bounce, it happens once.
const POSITIONS: [(usize, Position); 6] = [
    (0, Position::Released),
    (1, Position::Released),
    (0, Position::Pressed),
    (1, Position::Pressed),
    (0, Position::Released),
    (1, Position::Released),
];

/// Both switches are pressed, then released, the first one first.
pub async fn switches(parts: SwitchParts) -> Outcome {
    let (pin, line) = parts.input_1;
    let first = ExtiInput::new(pin, line, Pull::Up, Irqs);
    let (pin, line) = parts.input_2;
    let second = ExtiInput::new(pin, line, Pull::Up, Irqs);
    // One place more, for what must not come.
    let heard: Channel<NoopRawMutex, (usize, Position), { POSITIONS.len() + 1 }> = Channel::new();
    let hear = |index| {
        let heard = &heard;
        move |position, _| {
            let _ = heard.try_send((index, position));
        }
    };
    let config = Config::new(Active::Low);
    let watch = join(watch(first, config, hear(0)), watch(second, config, hear(1)));
    let listen = async {
        for (step, expected) in POSITIONS.into_iter().enumerate() {
            if step == 2 {
                defmt::info!("press the switches");
            }
            let position = heard.receive().await;
            want!(position == expected, "step {step}: {position:?}, not {expected:?}");
        }
        Timer::after_millis(20).await;
        want!(heard.is_empty(), "a switch bounces");
        Ok(say!("pressed and released, once each"))
    };
    match select(watch, listen).await {
        Either::First(_) => Err(say!("a pin failed")),
        Either::Second(outcome) => outcome,
    }
}

/// Rising edges of a PPM receiver: nine to a frame.
const EDGES: usize = 9 * 5;

/// A PPM receiver is heard, edge for edge.
pub async fn pulses(mut input: PulseInput) -> Outcome {
    let mut last = input.rising_edge().await;
    let (mut shortest, mut longest) = (u64::MAX, 0);
    for _ in 0..EDGES {
        let edge = input.rising_edge().await;
        let gap = edge.since(last).get();
        (shortest, longest) = (shortest.min(gap), longest.max(gap));
        last = edge;
    }
    let age = rc10_message::now().since(last).get();
    want!(age < 1000, "an edge {age} us old");
    want!(shortest >= 700 && longest <= 20_000, "{shortest} .. {longest} us apart");
    // Without reads for a while: lost pulses are counted.
    Timer::after_millis(200).await;
    let lost = input.lost();
    want!(lost > 0, "no edge was lost without a reader");
    Ok(say!("{shortest} .. {longest} us apart, {lost} lost on purpose"))
}

/// Pulse widths of the strip's timer.
const TIMING: PulseTiming = match PulseTiming::new(rc10_bsp::TIMER_CLOCK.0) {
    Ok(timing) => timing,
    Err(_) => panic!("the timer is too slow"),
};
/// Colours of two LEDs.
const PICTURE: [RGB8; 2] = [RGB8::new(0x12, 0x34, 0x56), RGB8::new(0xA5, 0x5A, 0xC3)];
/// Pulses of that.
const PULSES: usize = PICTURE.len() * BITS;

/// Two LEDs, two pictures; then two without waiting for their end.
pub async fn strip(parts: StripParts) -> Outcome {
    let StripParts { timer, pin, stream } = parts;
    let buffer = dma_buffer!(u32; PULSES + 2);
    let mut output = PulseOutput::start(timer, pin, stream, Irqs, TIMING.period, buffer, PRIORITY);
    let many = output.send(&[TIMING.zero; PULSES + 1]).await;
    let refused = Err(PulseError::TooMany { pulses: PULSES + 1, room: PULSES });
    want!(many == refused, "took {} pulses", PULSES + 1);
    let send = async |widths: &[u16]| output.send(widths).await;
    let mut strip = Strip::<_, 2>::new(Pulses::new(TIMING, send));
    let [first, second] = PICTURE;
    for picture in [[first, second], [second, first]] {
        want!(strip.write(picture).await.is_ok(), "could not send");
    }
    // Dropped in the middle, the pulses go on; the next ones wait for their end.
    let dropped = with_timeout(Duration::from_micros(20), strip.write(PICTURE)).await;
    want!(dropped.is_err(), "60 us of pulses took less than 20");
    want!(strip.write([second]).await.is_ok(), "could not send after that");
    Ok(say!("sent"))
}
