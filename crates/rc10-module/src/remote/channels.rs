use super::{Remote, Stick, Switch, Travel};

/// A channel of a transmitter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub struct Channel {
    /// From 1 on, as transmitters show it.
    pub number: u8,
    /// The low end is right, away from the body, or a switch that is down.
    pub is_reversed: bool,
}

impl Channel {
    /// The channel of this number, whose high end is right, away from the body, or a switch down.
    pub const fn new(number: u8) -> Self {
        Self { number, is_reversed: false }
    }

    /// The other way round.
    pub const fn reversed(self) -> Self {
        Self { is_reversed: !self.is_reversed, ..self }
    }
}

/// The channels of the sticks, switches and dial: the mixer page of the transmitter, as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub struct ChannelOrder {
    /// The right stick, to the right.
    pub right_x: Channel,
    /// The right stick, away from the body.
    pub right_y: Channel,
    /// The left stick, to the right.
    pub left_x: Channel,
    /// The left stick, away from the body.
    pub left_y: Channel,
    /// The switch on the right.
    pub right_switch: Channel,
    /// The switch on the left.
    pub left_switch: Channel,
    /// Two more switches; `Middle` without them.
    pub more_switches: [Option<Channel>; 2],
    /// A wheel or dial; 0 without one.
    pub dial: Option<Channel>,
}

const ROLES: usize = 9;

impl ChannelOrder {
    /// Aileron, elevator, throttle, rudder, both switches, two more, a dial: most transmitters.
    pub const AETR: Self = Self {
        right_x: Channel::new(1),
        right_y: Channel::new(2),
        left_y: Channel::new(3),
        left_x: Channel::new(4),
        right_switch: Channel::new(5),
        left_switch: Channel::new(6),
        more_switches: [Some(Channel::new(7)), Some(Channel::new(8))],
        dial: Some(Channel::new(9)),
    };

    /// `RC10_LIB`'s `AirJoy`: left x, y, right y, x, switches A (right here), B (left), C, D.
    pub const AIR_JOY: Self = Self {
        left_x: Channel::new(1),
        left_y: Channel::new(2),
        right_y: Channel::new(3),
        right_x: Channel::new(4),
        dial: None,
        ..Self::AETR
    };

    const fn roles(&self) -> [(&'static str, Option<Channel>); ROLES] {
        let [third, fourth] = self.more_switches;
        [
            ("right_x", Some(self.right_x)),
            ("right_y", Some(self.right_y)),
            ("left_x", Some(self.left_x)),
            ("left_y", Some(self.left_y)),
            ("right_switch", Some(self.right_switch)),
            ("left_switch", Some(self.left_switch)),
            ("more_switches[0]", third),
            ("more_switches[1]", fourth),
            ("dial", self.dial),
        ]
    }
}

/// Makes a [`Remote`] of `N` channels.
///
/// ```
/// use rc10_module::remote::{Channel, ChannelMap, ChannelOrder, Travel};
///
/// // A Futaba, whose middle is 1024, with its three-position switch on channel 8.
/// const ORDER: ChannelOrder = ChannelOrder {
///     right_switch: Channel::new(8).reversed(),
///     more_switches: [Some(Channel::new(7)), None],
///     ..ChannelOrder::AETR
/// };
/// let travel = Travel { low: 352, middle: 1024, high: 1696 };
/// let map = ChannelMap::<16>::new(ORDER, travel)?;
/// let mut channels = [1024; 16];
/// channels[2] = 1696;
/// assert_eq!(map.remote(&channels).left.y, 1.0);
/// # Ok::<(), rc10_module::remote::ChannelMapError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChannelMap<const CHANNELS: usize> {
    order: ChannelOrder,
    travel: Travel,
}

impl<const CHANNELS: usize> ChannelMap<CHANNELS> {
    /// The map of a checked order: of one that does not fit, the receiver's usual one.
    pub(super) fn of(order: ChannelOrder, travel: Travel, usual: Self) -> Self {
        Self::new(order, travel).unwrap_or(usual)
    }

    /// # Errors
    ///
    /// A channel that does not exist, or is twice; a travel whose middle is not in between.
    pub const fn new(order: ChannelOrder, travel: Travel) -> Result<Self, ChannelMapError> {
        if !travel.is_possible() {
            return Err(ChannelMapError::Travel(travel));
        }
        let roles = order.roles();
        let mut index = 0;
        while index < ROLES {
            if let (role, Some(Channel { number, .. })) = roles[index] {
                if number == 0 || number as usize > CHANNELS {
                    return Err(ChannelMapError::NoSuchChannel {
                        role,
                        number,
                        channels: CHANNELS,
                    });
                }
                let mut other = 0;
                while other < index {
                    if let (first, Some(taken)) = roles[other]
                        && taken.number == number
                    {
                        return Err(ChannelMapError::Twice { first, second: role, number });
                    }
                    other += 1;
                }
            }
            index += 1;
        }
        Ok(Self { order, travel })
    }

    /// The state of the remote with these channel values.
    pub fn remote(&self, channels: &[u16; CHANNELS]) -> Remote {
        let raw = |channel: Channel| {
            let index = usize::from(channel.number).wrapping_sub(1);
            channels.get(index).copied().unwrap_or(self.travel.middle)
        };
        let axis = |channel: Channel| {
            let share = self.travel.share(raw(channel));
            if channel.is_reversed { 0.0 - share } else { share }
        };
        let switch = |channel: Channel| match (self.travel.switch(raw(channel)), channel) {
            (Switch::Up, Channel { is_reversed: true, .. }) => Switch::Down,
            (Switch::Down, Channel { is_reversed: true, .. }) => Switch::Up,
            (position, _) => position,
        };
        let ChannelOrder { right_x, right_y, left_x, left_y, .. } = self.order;
        Remote {
            left: Stick { x: axis(left_x), y: axis(left_y) },
            right: Stick { x: axis(right_x), y: axis(right_y) },
            left_switch: switch(self.order.left_switch),
            right_switch: switch(self.order.right_switch),
            more_switches: self.order.more_switches.map(|more| more.map_or(Switch::Middle, switch)),
            dial: self.order.dial.map_or(0.0, axis),
            ..Remote::default()
        }
    }
}

/// Values of eleven bits each, the lowest bit first: how DBUS, SBUS, CRSF and VT03 pack channels.
pub(super) fn eleven_bits<const COUNT: usize>(packed: &[u8]) -> [u16; COUNT] {
    let mut bytes = packed.iter();
    let (mut bits, mut available) = (0_u32, 0_u32);
    [(); COUNT].map(|()| {
        while available < 11 {
            bits |= u32::from(bytes.next().copied().unwrap_or_default()) << available;
            available += 8;
        }
        let [low, high, ..] = bits.to_le_bytes();
        bits >>= 11;
        available -= 11;
        u16::from_le_bytes([low, high]) & 0x7FF
    })
}

/// The map of an order that fits: refused when it is compiled otherwise.
pub(super) const fn fitting<const CHANNELS: usize>(
    order: ChannelOrder,
    travel: Travel,
) -> ChannelMap<CHANNELS> {
    match ChannelMap::new(order, travel) {
        Ok(map) => map,
        Err(_) => panic!("no map of these channels"),
    }
}

/// Why there is no such [`ChannelMap`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ChannelMapError {
    /// The receiver has no such channel.
    #[error("{role} is channel {number}: must be 1 to {channels}")]
    NoSuchChannel {
        /// Field of [`ChannelOrder`].
        role: &'static str,
        /// The channel number in that field.
        number: u8,
        /// Number of channels, from 1 on.
        channels: usize,
    },
    /// One channel cannot be two things.
    #[error("{first} and {second} are both channel {number}: must be two")]
    Twice {
        /// Field of [`ChannelOrder`].
        first: &'static str,
        /// Field of [`ChannelOrder`].
        second: &'static str,
        /// The channel number in both.
        number: u8,
    },
    /// The middle is not between the ends.
    #[error("travel {}, {}, {}: must grow from one to the next", .0.low, .0.middle, .0.high)]
    Travel(Travel),
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRAVEL: Travel = Travel { low: 1000, middle: 1500, high: 2000 };

    fn map(order: ChannelOrder) -> ChannelMap<8> {
        ChannelMap::new(order, TRAVEL).unwrap()
    }

    #[test]
    fn each_channel_goes_where_the_order_says() {
        let channels = [1000, 2000, 1500, 1750, 1000, 2000, 1500, 1000];
        let order = ChannelOrder { dial: None, ..ChannelOrder::AETR };
        let remote = map(order).remote(&channels);
        assert_eq!((remote.right.x, remote.right.y, remote.left.y), (-1.0, 1.0, 0.0));
        assert!((remote.left.x - 0.48 / 0.98).abs() < 1e-6);
        assert_eq!((remote.right_switch, remote.left_switch), (Switch::Up, Switch::Down));
        assert_eq!(remote.more_switches, [Switch::Middle, Switch::Up]);
        assert_eq!((remote.dial, remote.failsafe), (0.0, false));
        let remote = map(ChannelOrder::AIR_JOY).remote(&channels);
        assert_eq!((remote.left.x, remote.left.y, remote.right.y), (-1.0, 1.0, 0.0));
        assert!(remote.right.x > 0.4 && remote.right_switch == Switch::Up);
    }

    #[test]
    fn a_reversed_channel_is_the_other_way_round() {
        let order = ChannelOrder {
            right_x: Channel::new(1).reversed(),
            right_switch: Channel::new(5).reversed(),
            left_switch: Channel::new(6).reversed(),
            more_switches: [None, None],
            dial: Some(Channel::new(8).reversed()),
            ..ChannelOrder::AETR
        };
        let remote = map(order).remote(&[1000, 1500, 1500, 1500, 1000, 2000, 2000, 2000]);
        assert_eq!((remote.right.x, remote.right.y, remote.dial), (1.0, 0.0, -1.0));
        assert_eq!((remote.right_switch, remote.left_switch), (Switch::Down, Switch::Up));
        assert_eq!(remote.more_switches, [Switch::Middle; 2]);
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        let refused = |order, travel| {
            let error = ChannelMap::<8>::new(order, travel).unwrap_err();
            std::string::ToString::to_string(&error)
        };
        let with = |dial| ChannelOrder { dial: Some(Channel::new(dial)), ..ChannelOrder::AETR };
        assert_eq!(refused(with(9), TRAVEL), "dial is channel 9: must be 1 to 8");
        assert_eq!(refused(with(0), TRAVEL), "dial is channel 0: must be 1 to 8");
        assert_eq!(refused(with(3), TRAVEL), "left_y and dial are both channel 3: must be two");
        let travel = Travel { middle: 2000, ..TRAVEL };
        assert_eq!(
            refused(ChannelOrder::AETR, travel),
            "travel 1000, 2000, 2000: must grow from one to the next"
        );
        assert!(ChannelMap::<16>::new(with(9), TRAVEL).is_ok());
    }
}
