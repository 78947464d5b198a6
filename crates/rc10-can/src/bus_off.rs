/// Policy for bus-off, above 255 transmit errors: a cut or short wire, or no other node.
///
/// With every policy, unsent frames are dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum BusOffPolicy {
    /// The bus goes back: at once, then with growing pauses (2 ms, 4 ms .. 50 ms) while it fails.
    #[default]
    Automatic,
    /// The bus stays off until it is asked to come back.
    Manual,
    /// Like [`Automatic`](Self::Automatic), with an emergency stop of the whole robot.
    Latched,
}
