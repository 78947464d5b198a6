//! The drive's side of the protocol: commands in, answers out.

/// A command to a drive. Angles 0.01°, speeds of a command 0.01°/s, limits 1°/s, of the rotor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// `80`.
    Off,
    /// `81`.
    Stop,
    /// `88`.
    Run,
    /// `A0`: power, ±850.
    OpenLoop(i16),
    /// `A1`: steps of torque current, ±2048.
    Current(i16),
    /// `A2`.
    Speed(i32),
    /// `A3`, or `A4` with a largest speed.
    TurnTo(i32, Option<u16>),
    /// `A5`, or `A6` with a largest speed; whether the other way round.
    TurnWithin(u16, bool, Option<u16>),
    /// `A7`, or `A8` with a largest speed.
    TurnBy(i32, Option<u16>),
    /// `9A`.
    ReadHealth,
    /// `9B`.
    ClearErrors,
    /// `9C`.
    ReadState,
    /// `9D`.
    ReadPhases,
    /// `92`.
    ReadManyTurns,
    /// `94`.
    ReadOneTurn,
}

/// The command in a payload; `None` if there is no such.
pub const fn decode(bytes: &[u8; 8]) -> Option<Order> {
    let word = i32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]);
    let half = i16::from_le_bytes([bytes[4], bytes[5]]);
    let within = u16::from_le_bytes([bytes[4], bytes[5]]);
    let most = u16::from_le_bytes([bytes[2], bytes[3]]);
    let is_backwards = bytes[1] == 1;
    Some(match bytes[0] {
        0x80 => Order::Off,
        0x81 => Order::Stop,
        0x88 => Order::Run,
        0x92 => Order::ReadManyTurns,
        0x94 => Order::ReadOneTurn,
        0x9A => Order::ReadHealth,
        0x9B => Order::ClearErrors,
        0x9C => Order::ReadState,
        0x9D => Order::ReadPhases,
        0xA0 => Order::OpenLoop(half),
        0xA1 => Order::Current(half),
        0xA2 => Order::Speed(word),
        0xA3 => Order::TurnTo(word, None),
        0xA4 => Order::TurnTo(word, Some(most)),
        0xA5 => Order::TurnWithin(within, is_backwards, None),
        0xA6 => Order::TurnWithin(within, is_backwards, Some(most)),
        0xA7 => Order::TurnBy(word, None),
        0xA8 => Order::TurnBy(word, Some(most)),
        _ => return None,
    })
}

/// Measurements of a drive, in its own steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    /// °C.
    pub temperature: i8,
    /// Torque current, ±2048.
    pub current: i16,
    /// Speed of the rotor, degrees/s.
    pub speed: i16,
    /// Angle of the rotor in its turn, steps of the encoder.
    pub encoder: u16,
}

/// The answer to `9C` and to everything that moves: `command` is repeated.
pub const fn encode_state(command: u8, state: State) -> [u8; 8] {
    let [current, current_high] = state.current.to_le_bytes();
    let [speed, speed_high] = state.speed.to_le_bytes();
    let [angle, angle_high] = state.encoder.to_le_bytes();
    let [temperature] = state.temperature.to_le_bytes();
    [command, temperature, current, current_high, speed, speed_high, angle, angle_high]
}

/// The answer to `9A` and `9B`.
pub fn encode_health(command: u8, temperature: i8, volts: f64, errors: u8) -> [u8; 8] {
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let [low, high] = ((volts * 10.0).round() as u16).to_le_bytes();
    let [temperature] = temperature.to_le_bytes();
    [command, temperature, 0, low, high, 0, 0, errors]
}

/// The answer to `80`, `81` and `88`.
pub const fn encode_echo(command: u8) -> [u8; 8] {
    [command, 0, 0, 0, 0, 0, 0, 0]
}

/// The answer to `9D`: 64 steps an ampere.
pub(super) const fn encode_phases(temperature: i8, phases: [i16; 3]) -> [u8; 8] {
    let [temperature] = temperature.to_le_bytes();
    let [a, b] = phases[0].to_le_bytes();
    let [c, d] = phases[1].to_le_bytes();
    let [e, f] = phases[2].to_le_bytes();
    [0x9D, temperature, a, b, c, d, e, f]
}

/// The answer to `92`: 56 bits of 0.01°.
pub(super) const fn encode_many_turns(centidegrees: i64) -> [u8; 8] {
    let [a, b, c, d, e, f, g, _] = centidegrees.to_le_bytes();
    [0x92, a, b, c, d, e, f, g]
}

/// The answer to `94`.
pub(super) const fn encode_one_turn(centidegrees: u16) -> [u8; 8] {
    let [low, high] = centidegrees.to_le_bytes();
    [0x94, 0, 0, 0, low, high, 0, 0]
}
