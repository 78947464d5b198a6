//! Limit switches: contacts bounce for some milliseconds, and wires break.
//!
//! [`LimitSwitch`] is the state machine: levels in, a [`Position`] out; [`watch`] runs it.
//!
//! Wire the contact that is closed at rest, against ground, with a pull-up: a broken wire then
//! looks pressed, and the axis stops. (`Active::High`.) The other contact would never be reached.

use core::convert::Infallible;

use embassy_time::{Duration, Instant, Timer, with_deadline};
use embedded_hal::digital::InputPin;
use embedded_hal_async::digital::Wait;
use rc10_time::Micros;

/// The level of the pin that means that the switch is pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Active {
    /// Low: the contact that closes when pressed, against ground, with a pull-up.
    Low,
    /// High: the contact that opens when pressed, against ground, with a pull-up.
    High,
}

impl Active {
    /// Whether a switch with this level at its pin is pressed.
    #[must_use]
    pub const fn is_pressed(self, is_high: bool) -> bool {
        is_high == matches!(self, Self::High)
    }
}

/// A contact at a pin: closed or not, which is pressed or not, whatever the level of the pin.
///
/// It does not debounce: [`Homing`](rc10_app::mechanism::Homing) does.
///
/// ```
/// # mod pin { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/docs/pin.rs")); }
/// # use pin::High;
/// use rc10_module::limit_switch::{Active, Contact};
/// let mut bottom = Contact::new(High, Active::High); // wired by the contact that opens
/// assert!(bottom.is_closed());
/// ```
pub struct Contact<P> {
    pin: P,
    active: Active,
}

impl<P: InputPin> Contact<P> {
    /// Creates it at a pin, wired so.
    pub const fn new(pin: P, active: Active) -> Self {
        Self { pin, active }
    }

    /// Whether it is closed now. A pin that cannot be read counts as high, as with a torn wire.
    pub fn is_closed(&mut self) -> bool {
        self.active.is_pressed(!self.pin.is_low().unwrap_or(false))
    }
}

/// Settings of a limit switch: its wiring, and its times of bouncing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// The level of a pressed switch.
    pub active: Active,
    /// Time pressed without a break to count. Zero: at once, but a spark's pulse counts too.
    pub press: Micros,
    /// The time for which it must be released without a break to count as released.
    pub release: Micros,
}

impl Config {
    /// Pressed after 2 ms, released after 10 ms: what the switches of 3D printers need.
    #[must_use]
    pub const fn new(active: Active) -> Self {
        Self { active, press: Micros::from_millis(2), release: Micros::from_millis(10) }
    }
}

/// The position of a limit switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Position {
    /// Not looked at for long enough.
    #[default]
    Unknown,
    /// Released.
    Released,
    /// Pressed.
    Pressed,
    /// The switch does not come to rest: a loose contact, a chafed wire, noise. Stop the axis.
    Chattering,
}

/// Time without rest after which a switch chatters.
pub const CHATTERS_AFTER: Micros = Micros::from_millis(250);

/// A switch without its bouncing. Sampled, or fed with edges: a level holds until the next one.
///
/// ```
/// use rc10_time::Micros;
/// use rc10_module::limit_switch::{Active, Config, LimitSwitch, Position};
/// let mut switch = LimitSwitch::new(Config::new(Active::Low));
/// let mut look = |is_high, millis| switch.update(is_high, Micros::from_millis(millis));
/// assert_eq!(look(true, 0), Position::Unknown);
/// assert_eq!(look(true, 10), Position::Released);
/// assert_eq!(look(false, 20), Position::Released); // may be a spark
/// assert_eq!(look(false, 22), Position::Pressed);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct LimitSwitch {
    config: Config,
    /// The last state of the contact (pressed or not), and the time of its last change.
    contact: Option<(bool, Micros)>,
    disturbed: Micros,
    position: Position,
    changes: u32,
}

impl LimitSwitch {
    /// A switch that has not been read yet.
    #[must_use]
    pub const fn new(config: Config) -> Self {
        Self {
            config,
            contact: None,
            disturbed: Micros::ZERO,
            position: Position::Unknown,
            changes: 0,
        }
    }

    /// The pin is high or low at `now`. Where the switch is now.
    pub fn update(&mut self, is_high: bool, now: Micros) -> Position {
        let is_pressed = self.config.active.is_pressed(is_high);
        let since = match self.contact {
            Some((same, since)) if same == is_pressed => since,
            changed => {
                // Up to now it showed the other: long enough, perhaps, to have come to rest.
                if let Some((other, since)) = changed {
                    self.settle(other, now.since(since), now);
                    self.changes = self.changes.wrapping_add(1);
                } else {
                    self.disturbed = now;
                }
                self.contact = Some((is_pressed, now));
                now
            }
        };
        self.settle(is_pressed, now.since(since), now);
        self.position
    }

    fn settle(&mut self, is_pressed: bool, rested: Micros, now: Micros) {
        let time_to_rest = if is_pressed { self.config.press } else { self.config.release };
        if rested >= time_to_rest {
            self.position = if is_pressed { Position::Pressed } else { Position::Released };
            self.disturbed = now;
        } else if now.since(self.disturbed) >= CHATTERS_AFTER {
            self.position = Position::Chattering;
        }
    }

    /// The pin's level is what the position says: nothing happens before it changes.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        match self.contact {
            Some((is_pressed, _)) if is_pressed => self.position == Position::Pressed,
            Some(_) => self.position == Position::Released,
            None => false,
        }
    }

    /// Level changes, bounces and all, modulo 2³². Many per press: a worn contact, or noise.
    #[must_use]
    pub const fn changes(&self) -> u32 {
        self.changes
    }
}

/// The period of looks at a switch not at rest: a storm of edges does not take the processor.
const LOOK: Duration = Duration::from_millis(1);

/// Watches for ever: `hear` gets the first position and each other one, with its time.
///
/// # Errors
/// The error of the pin; its position is unknown from then on.
pub async fn watch<P: InputPin + Wait>(
    mut pin: P,
    config: Config,
    mut hear: impl FnMut(Position, Micros),
) -> Result<Infallible, P::Error> {
    let mut switch = LimitSwitch::new(config);
    let mut heard = Position::Unknown;
    loop {
        let is_high = pin.is_high()?;
        let look = Instant::now();
        let now = Micros::new(look.as_micros());
        let position = switch.update(is_high, now);
        if position != heard {
            heard = position;
            hear(position, now);
        }
        if switch.is_at_rest() {
            other_level(&mut pin, is_high).await?;
        } else if let Ok(changed) = with_deadline(look + LOOK, other_level(&mut pin, is_high)).await
        {
            // It may be back by the next look: this is how that is not taken for rest.
            changed?;
            switch.update(!is_high, Micros::new(Instant::now().as_micros()));
            Timer::at(look + LOOK).await;
        }
    }
}

/// By level: an edge may have come since the pin was looked at, and would be missed.
async fn other_level<P: Wait>(pin: &mut P, is_high: bool) -> Result<(), P::Error> {
    if is_high { pin.wait_for_low().await } else { pin.wait_for_high().await }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(levels: &[(u64, bool)]) -> (LimitSwitch, Position) {
        let mut switch = LimitSwitch::new(Config::new(Active::Low));
        let mut position = Position::Unknown;
        for &(micros, is_high) in levels {
            position = switch.update(is_high, Micros::new(micros));
        }
        (switch, position)
    }

    #[test]
    fn nothing_is_known_before_it_rested() {
        assert_eq!(after(&[(0, true), (9_999, true)]).1, Position::Unknown);
        assert_eq!(after(&[(0, true), (10_000, true)]).1, Position::Released);
        assert_eq!(after(&[(0, false), (1_999, false)]).1, Position::Unknown);
        assert_eq!(after(&[(0, false), (2_000, false)]).1, Position::Pressed);
    }

    #[test]
    fn bounces_are_one_press_and_sparks_are_none() {
        let mut levels = std::vec![(0, true), (20_000, true)];
        // Bounces of 0.3 ms for 3 ms, then pressed.
        levels.extend((0..10).map(|bounce| (30_000 + bounce * 300, bounce % 2 != 0)));
        levels.push((32_999, true));
        assert_eq!(after(&levels).1, Position::Released);
        levels.push((33_000, false));
        levels.push((34_999, false));
        assert_eq!(after(&levels).1, Position::Released);
        levels.push((35_000, false));
        assert_eq!(after(&levels).1, Position::Pressed);
        assert_eq!(after(&levels).0.changes(), 11);
        let spark = [(0, true), (20_000, true), (30_000, false), (31_000, true), (90_000, true)];
        assert_eq!(after(&spark).1, Position::Released);
    }

    #[test]
    fn edges_alone_say_as_much_as_samples() {
        // Pressed from 30 to 60 ms, seen only by its edges: at the second it had rested.
        let (_, at_the_edge) = after(&[(0, true), (30_000, false), (60_000, true)]);
        assert_eq!(at_the_edge, Position::Pressed);
        let (_, later) = after(&[(0, true), (30_000, false), (60_000, true), (70_000, true)]);
        assert_eq!(later, Position::Released);
    }

    #[test]
    fn a_switch_that_never_rests_says_so_and_recovers() {
        let mut levels = std::vec![(0, true), (20_000, true)];
        levels.extend((0..1000).map(|change| (30_000 + change * 900, change % 2 != 0)));
        let chattering = levels.iter().position(|&(at, _)| at >= 280_000 + 900).unwrap();
        assert_eq!(after(&levels[..chattering - 2]).1, Position::Released);
        assert_eq!(after(&levels[..chattering]).1, Position::Chattering);
        assert_eq!(after(&levels).1, Position::Chattering);
        let &(last, _) = levels.last().unwrap();
        levels.extend([(last + 900, false), (last + 2_901, false)]);
        assert_eq!(after(&levels).1, Position::Pressed);
    }

    #[test]
    fn active_high_is_the_other_way_round_and_zero_is_at_once() {
        let config = Config { press: Micros::ZERO, ..Config::new(Active::High) };
        let mut switch = LimitSwitch::new(config);
        assert!(!switch.is_at_rest());
        assert_eq!(switch.update(true, Micros::new(5)), Position::Pressed);
        assert!(switch.is_at_rest());
        assert_eq!(switch.update(false, Micros::new(6)), Position::Pressed);
        assert!(!switch.is_at_rest());
        assert_eq!(switch.update(false, Micros::new(10_006)), Position::Released);
        assert_eq!(switch.update(true, Micros::new(10_007)), Position::Pressed);
    }

    #[test]
    fn time_that_goes_backwards_is_no_time() {
        let (_, position) = after(&[(1_000_000, true), (0, true), (5, false), (3, true)]);
        assert_eq!(position, Position::Unknown);
    }
}
