/// Policy for a controller that has left its bus: its transmit error counter went above 255,
/// because the wire is cut, shorted, or no other node has its bit rate.
///
/// With every policy, unsent frames are dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BusOffPolicy {
    /// The bus goes back by itself: at once the first time, and with growing pauses (2 ms, 4 ms ..
    /// 50 ms) while that keeps failing.
    #[default]
    Automatic,
    /// The bus stays off until it is asked to come back.
    Manual,
    /// Like [`Automatic`](Self::Automatic), but the whole robot is in emergency stop then, until
    /// that is reset: for a bus whose motors must never go on as if nothing had been.
    Latched,
}
