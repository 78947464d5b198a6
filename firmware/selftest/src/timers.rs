//! What is made of timers, and pins that interrupt.

use embassy_futures::join::join;
use embassy_futures::select::{Either, select};
use embassy_stm32::exti::ExtiInput;
use embassy_stm32::gpio::{OutputType, Pull};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::Channel;
use embassy_stm32::timer::input_capture::{CapturePin, InputCapture};
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_time::{Duration, Ticker, Timer, with_timeout};
use rc10_app::Encoder;
use rc10_bsp::dma_buffer;
use rc10_bsp::pulse_input::PulseInput;
use rc10_bsp::pulse_output::{PulseError, PulseOutput};
use rc10_bsp::quadrature::{QuadratureCounter, QuadratureTimer};
use rc10_firmware::board::{
    CaptureParts, EncoderParts, PulseParts, ServoParts, StripParts, SwitchParts,
};

use crate::report::Outcome;
use crate::{Irqs, PRIORITY, say, want};

/// The first servo's pulse, µs, which is also to be measured.
const PULSE: u32 = 1500;

/// Four servos at 50 Hz; a pulse of 1.5 ms is measured.
pub async fn servo(servos: ServoParts, capture: CaptureParts) -> Outcome {
    let kind = OutputType::PushPull;
    let mut pwm = SimplePwm::new(
        servos.timer,
        Some(PwmPin::new(servos.first, kind)),
        Some(PwmPin::new(servos.second, kind)),
        Some(PwmPin::new(servos.third, kind)),
        Some(PwmPin::new(servos.fourth, kind)),
        Hertz(50),
        CountingMode::EdgeAlignedUp,
    );
    for (number, channel) in
        [Channel::Ch1, Channel::Ch2, Channel::Ch3, Channel::Ch4].into_iter().enumerate()
    {
        let micros = PULSE + 100 * u32::try_from(number).unwrap_or(0);
        let mut channel = pwm.channel(channel);
        channel.set_duty_cycle_fraction(micros, 20_000);
        channel.enable();
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
        let rising = capture.wait_for_rising_edge(Channel::Ch1).await;
        let falling = capture.wait_for_falling_edge(Channel::Ch1).await;
        last = falling.wrapping_sub(rising);
        want!(last.abs_diff(PULSE) <= 1, "measured {last} us");
    }
    // Driving on would disturb what comes.
    drop(pwm);
    Ok(say!("measured {last} us"))
}

/// Where the encoders are turned to: first forward, then back beyond zero, then to here.
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
        (short, Encoder::new(embassy_stm32::peripherals::TIM3::MODULUS)),
        (long, Encoder::new(embassy_stm32::peripherals::TIM5::MODULUS)),
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

/// Both switches close, the first one first.
pub async fn switches(parts: SwitchParts) -> Outcome {
    let (pin, line) = parts.first;
    let mut first = ExtiInput::new(pin, line, Pull::Up, Irqs);
    let (pin, line) = parts.second;
    let mut second = ExtiInput::new(pin, line, Pull::Up, Irqs);
    want!(first.is_high() && second.is_high(), "a switch is closed");
    defmt::info!("close the switches");
    match select(first.wait_for_falling_edge(), second.wait_for_falling_edge()).await {
        Either::First(()) => {}
        Either::Second(()) => return Err(say!("the second one was first")),
    }
    second.wait_for_low().await;
    join(first.wait_for_high(), second.wait_for_high()).await;
    Ok(say!("closed and opened"))
}

/// Rising edges of a PPM receiver: nine to a frame.
const EDGES: usize = 9 * 5;

/// A PPM receiver is heard, edge for edge.
pub async fn pulses(parts: PulseParts) -> Outcome {
    let mut input = PulseInput::start(parts.timer, parts.pin, Irqs, PRIORITY);
    let mut last = input.rising_edge().await;
    let (mut shortest, mut longest) = (u64::MAX, 0);
    for _ in 0..EDGES {
        let edge = input.rising_edge().await;
        let gap = edge.since(last).get();
        (shortest, longest) = (shortest.min(gap), longest.max(gap));
        last = edge;
    }
    let age = rc10_bsp::now().since(last).get();
    want!(age < 1000, "an edge {age} us old");
    want!(shortest >= 700 && longest <= 20_000, "{shortest} .. {longest} us apart");
    // Nobody reads for a while: what is lost is counted.
    Timer::after_millis(200).await;
    let lost = input.lost();
    want!(lost > 0, "no edge was lost though nobody read");
    Ok(say!("{shortest} .. {longest} us apart, {lost} lost on purpose"))
}

/// Sent to the strip: half of the pulses wide.
const WIDTHS: [u16; 48] = {
    let mut widths = [75; 48];
    let mut index = 0;
    while index < 48 {
        if index % 3 != 0 {
            widths[index] = 180;
        }
        index += 1;
    }
    widths
};

/// Two LEDs' worth of pulses, twice.
pub async fn strip(parts: StripParts) -> Outcome {
    let StripParts { timer, pin, stream } = parts;
    let buffer = dma_buffer!(u32; 50);
    let mut strip = PulseOutput::start(timer, pin, stream, Irqs, 300, buffer, PRIORITY);
    let many = strip.send(&[75; 49]).await;
    want!(many == Err(PulseError::TooMany { pulses: 49, room: 48 }), "took 49 pulses");
    for _ in 0..2 {
        want!(strip.send(&WIDTHS).await == Ok(()), "could not send");
        Timer::after_micros(300).await;
    }
    // Dropped in the middle, the pulses go on; the next ones wait for their end.
    let dropped = with_timeout(Duration::from_micros(20), strip.send(&WIDTHS)).await;
    want!(dropped.is_err(), "60 us of pulses took less than 20");
    want!(strip.send(&WIDTHS[..24]).await == Ok(()), "could not send after that");
    Ok(say!("sent"))
}
