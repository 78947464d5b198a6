//! Patterns of a strip: a colour and a rhythm per state of the robot.
//!
//! The rhythm alone tells the states apart: one man in twelve confuses red and green, and the sun
//! hides colours. No more than three flashes a second: faster is dangerous for some (WCAG 2.3.1).
//!
//! | state | colour | rhythm of an LED, one mark is 100 ms | |
//! |---|---|---|---|
//! | [`Disarmed`](LampState::Disarmed) | blue | `##########..........` | slow: one second on, one off |
//! | [`Armed`](LampState::Armed) | green | `####################` | steady |
//! | [`Suspended`](LampState::Suspended) | amber | `#.#.......#.#.......` | two short flashes a second |
//! | [`Stopped`](LampState::Stopped) | red | `##..##..##..##..##..` | even and fast |
//! | [`LinkLost`](LampState::LinkLost) | magenta | `#...#...#...#...#...` | points that run along the strip |
//! | [`Fault`](LampState::Fault) | white | `#.#.#...............` | three short flashes, a pause |
//! | [`LowSupply`](LampState::LowSupply) | yellow | `#...................` | one short flash every two seconds |
//! | [`NotAtRest`](LampState::NotAtRest) | blue | `###.###.............` | two long flashes, a pause |

use rc10_time::Micros;
use smart_leds_trait::RGB8;

/// A state of a robot that a strip can show. Which state matters most is the robot's to decide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LampState {
    /// No torque.
    #[default]
    Disarmed,
    /// The robot may move at any time.
    Armed,
    /// Armed, and let go for a moment: it goes on by itself.
    Suspended,
    /// Emergency stop.
    Stopped,
    /// The remote control is not heard.
    LinkLost,
    /// A motor or a sensor is missing or tells of a fault.
    Fault,
    /// The battery is nearly empty.
    LowSupply,
    /// A stick was not at rest when the robot was to be armed.
    NotAtRest,
}

rc10_app::states!(
    LampState: Disarmed, Armed, Suspended, Stopped, LinkLost, Fault, LowSupply, NotAtRest
);

/// One mark of a rhythm.
const BEAT: Micros = Micros::from_millis(100);
/// Marks of a rhythm; then it starts over.
const BEATS: u32 = 20;

/// The look of a state: its colour, and its rhythm, in which `#` is on.
const fn look(state: LampState) -> (RGB8, &'static [u8; BEATS as usize]) {
    let (colour, rhythm) = match state {
        LampState::Disarmed => ([0, 0, 255], b"##########.........."),
        LampState::Armed => ([0, 255, 0], b"####################"),
        LampState::Suspended => ([255, 110, 0], b"#.#.......#.#......."),
        LampState::Stopped => ([255, 0, 0], b"##..##..##..##..##.."),
        LampState::LinkLost => ([255, 0, 180], b"#...#...#...#...#..."),
        LampState::Fault => ([255, 255, 255], b"#.#.#..............."),
        LampState::LowSupply => ([255, 220, 0], b"#..................."),
        LampState::NotAtRest => ([0, 0, 255], b"###.###............."),
    };
    let [r, g, b] = colour;
    (RGB8 { r, g, b }, rhythm)
}

/// The colour of LED `index` at `now` in this state, at full brightness.
///
/// ```
/// use rc10_time::Micros;
/// use rc10_module::led::pattern::{LampState, colour};
/// let dark = |millis| colour(LampState::Stopped, Micros::from_millis(millis), 0).g == 0
///     && colour(LampState::Stopped, Micros::from_millis(millis), 0).r == 0;
/// assert!(!dark(100) && dark(300) && !dark(400));
/// ```
#[must_use]
pub fn colour(state: LampState, now: Micros, index: usize) -> RGB8 {
    let (colour, rhythm) = look(state);
    let beats = rhythm.len();
    #[expect(clippy::cast_possible_truncation, reason = "below 20")]
    let beat = (now.get() / BEAT.get() % u64::from(BEATS)) as usize;
    // Each LED is a mark later than the one before it.
    let later = if state == LampState::LinkLost { index % beats } else { 0 };
    let mark = rhythm.get((beat + beats - later) % beats);
    if mark == Some(&b'#') { colour } else { RGB8::default() }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// The signs of an LED for an eye that sees no colours.
    fn seen(state: LampState, index: usize) -> Vec<bool> {
        let at = |beat| Micros::new(1_000_000_000_000 + beat * BEAT.get() + 99_999);
        (0..20).map(|beat| colour(state, at(beat), index) != RGB8::default()).collect()
    }

    #[test]
    fn rhythm_alone_tells_every_state_from_every_other() {
        for (first, a) in LampState::ALL.iter().copied().enumerate() {
            for b in LampState::ALL.iter().copied().skip(first + 1) {
                for index in 0..30 {
                    let (a_seen, mut b_seen) = (seen(a, index), seen(b, 0));
                    for _ in 0..20 {
                        assert_ne!(a_seen, b_seen, "{a:?} looks like {b:?}");
                        b_seen.rotate_left(1);
                    }
                }
            }
        }
    }

    #[test]
    fn nothing_flashes_more_than_three_times_a_second() {
        for &state in LampState::ALL {
            let twice: Vec<_> = seen(state, 0).repeat(2);
            for second in twice.windows(10) {
                let flashes = second.windows(2).filter(|pair| !pair[0] && pair[1]).count();
                assert!(flashes <= 3, "{state:?}: {flashes}");
            }
        }
    }

    #[test]
    fn all_leds_blink_together_but_those_that_run() {
        for &state in LampState::ALL {
            let same = (1..40).all(|index| seen(state, index) == seen(state, 0));
            assert_eq!(same, state != LampState::LinkLost, "{state:?}");
        }
        let (first, mut second) = (seen(LampState::LinkLost, 0), seen(LampState::LinkLost, 1));
        second.rotate_left(1);
        assert_eq!(first, second);
    }

    #[test]
    fn the_table_of_the_documentation_is_the_one_that_is_shown() {
        let source = include_str!("pattern.rs");
        for &state in LampState::ALL {
            let name = std::format!("//! | [`{state:?}`]");
            let row = source.lines().find(|line| line.starts_with(&name)).unwrap();
            let rhythm = core::str::from_utf8(look(state).1).unwrap();
            assert!(row.contains(rhythm), "{row}");
        }
    }

    #[test]
    fn any_time_and_any_led_has_a_colour() {
        for &state in LampState::ALL {
            for now in [0, 1, u64::MAX / 2, u64::MAX] {
                for index in [0, 1, 1000, usize::MAX] {
                    let _ = colour(state, Micros::new(now), index);
                }
            }
        }
        assert_eq!(
            colour(LampState::Armed, Micros::new(u64::MAX), usize::MAX),
            RGB8::new(0, 255, 0)
        );
    }
}
